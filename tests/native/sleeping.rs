//! Sleep: a bed at rest costs nothing, bears what it bore, and wakes when something happens to it.

use crate::common::*;
use tollgate::dem::checkpoint::SimulationRecord;
use tollgate::dem::law::{LawSettings, RollingLaw};
use tollgate::dem::particles::Path;
use tollgate::dem::removal::RemovalCause;
use tollgate::dem::simulation::{Setup, Simulation};
use tollgate::dem::sleep::SleepSettings;
use tollgate::geometry::motion::{Motion, MotionKind, MotionTerm};
use tollgate::geometry::part::{Surface, Trigger};
use tollgate::math::lanes::SimdLevel;
use tollgate::math::{Bounds, Vec3, vec3};
use tollgate::particle::{ParticleId, ParticleState};

const RADIUS: f64 = 0.005;
/// Half the width of the tub [m].
const HALF: f64 = 6.0 * RADIUS;
/// Unbalanced force over the weight at which sleepers wake.
const UNBALANCED: f64 = 0.01;
const SLEEPING: SleepSettings = SleepSettings { speed: 1e-3, hold: 0.01, acceleration: UNBALANCED * 9.81 };

/// A square tub of a floor, which is a mesh, and four planes. Rolling resistance, so that rest comes soon.
fn tub(sleeping: Option<SleepSettings>) -> Setup {
    let law = LawSettings { rolling: RollingLaw::Epsd2, ..HERTZ };
    let mut setup = empty(RADIUS, law, pair(0.3, 0.5, 0.1));
    setup.gravity = gravity();
    setup.domain = Bounds { minimum: [-0.5, -0.5, -0.1], maximum: [0.5, 0.5, 1.0] };
    setup.momentum = true;
    setup.sleeping = sleeping;
    let floor = sheet(vec3(-0.1, -0.1, 0.0), vec3(0.2, 0.0, 0.0), vec3(0.0, 0.2, 0.0), 8, 8);
    setup.parts = vec![
        part("floor", Surface::Mesh(floor), Vec::new()),
        plane("left", vec3(-HALF, 0.0, 0.0), Vec3::x()),
        plane("right", vec3(HALF, 0.0, 0.0), -Vec3::x()),
        plane("front", vec3(0.0, -HALF, 0.0), Vec3::y()),
        plane("back", vec3(0.0, HALF, 0.0), -Vec3::y()),
    ];
    setup
}

/// So many layers of particles of two sizes that fall a little.
fn filling(layers: u64) -> Vec<ParticleState> {
    let start = vec3(-HALF + 1.1 * RADIUS, -HALF + 1.1 * RADIUS, 1.1 * RADIUS);
    let mut states = lattice([5, 5, layers], start, 2.3 * RADIUS, RADIUS, 0.05, &mut Draw(3));
    states.iter_mut().step_by(3).for_each(|state| state.radius *= 0.85);
    states
}

fn asleep(simulation: &Simulation) -> usize {
    simulation.views().filter(|view| view.path == Path::Asleep).count()
}

fn weight(simulation: &Simulation) -> f64 {
    let setup = simulation.setup();
    simulation.particles().iter().map(|state| setup.body.mass(state.radius, state.density) * 9.81).sum()
}

/// Runs until nobody is awake.
fn settle(simulation: &mut Simulation) {
    for _ in 0..400 {
        run(simulation, 250);
        if asleep(simulation) == simulation.particle_count() {
            return;
        }
    }
    panic!("{} of {} sleep after {} s", asleep(simulation), simulation.particle_count(), simulation.time());
}

fn bed(setup: Setup, layers: u64) -> Simulation {
    let mut simulation = with(setup, &filling(layers));
    settle(&mut simulation);
    simulation
}

fn places(simulation: &Simulation) -> Vec<Vec3> {
    simulation.particles().iter().map(|state| state.position).collect()
}

fn forces(simulation: &Simulation) -> Vec<Vec3> {
    simulation.stored_states().map(|(_, force, _)| force).collect()
}

/// A sphere that falls upon the middle of the bed.
fn striker(simulation: &mut Simulation, speed: f64) -> ParticleId {
    let top = simulation.particles().iter().map(|state| state.position.z + state.radius).fold(0.0, f64::max);
    let state = grain(9000, 1.2 * RADIUS, vec3(0.0, 0.0, top + 1.3 * RADIUS), vec3(0.0, 0.0, -speed));
    simulation.insert(&[state]);
    state.id
}

#[test]
fn a_bed_at_rest_sleeps_where_it_is_and_weighs_what_it_weighs() {
    let mut simulation = bed(tub(Some(SLEEPING)), 5);
    let (before, contacts, loads) = (places(&simulation), simulation.contacts(), forces(&simulation));
    let budget = simulation.energy();
    run(&mut simulation, 3000);
    assert_eq!(asleep(&simulation), 125);
    assert!(places(&simulation) == before && simulation.contacts() == contacts, "nothing moves");
    assert!(forces(&simulation) == loads, "forces are those of before");
    assert!(contacts.len() > 250, "a bed in contact: {}", contacts.len());
    let floor = -simulation.part_loads()[0].force.z;
    let share = floor / weight(&simulation);
    // The planes bear some of it by friction, and each sleeper may lack its share.
    let walls: f64 = simulation.part_loads().iter().map(|load| load.force.z).sum();
    assert!((-walls / weight(&simulation) - 1.0).abs() < UNBALANCED, "{walls} of {}", weight(&simulation));
    assert!((0.5..1.0).contains(&share), "the floor bears {share}");
    // What the contacts say that is looked at, the loads say that were kept.
    let of_floor: f64 = simulation
        .contacts()
        .iter()
        .filter(|contact| matches!(contact.j, tollgate::dem::inspect::Partner::Part { part: 0, .. }))
        .map(|contact| contact.force.z)
        .sum();
    assert!((of_floor / floor - 1.0).abs() < 1e-9, "{of_floor} and {floor}");
    let after = simulation.energy();
    assert!(after == budget && after.sleep > 0.0 && after.kinetic == 0.0, "{after:?}");
    assert!(simulation.momentum_budget().imbalance().norm() < 1e-9 * simulation.momentum_budget().gravity.norm());
}

#[test]
fn the_budget_closes_over_falling_asleep_and_waking() {
    let mut simulation = with(tub(Some(SLEEPING)), &filling(4));
    let start = simulation.energy().sum();
    settle(&mut simulation);
    striker(&mut simulation, 1.0);
    run(&mut simulation, 20);
    settle(&mut simulation);
    let end = simulation.energy();
    let wander = (end.sum() - start).abs() / end.dissipated();
    assert!(wander < 2e-3, "{wander:e} of {end:?}");
    assert!(end.sleep > 0.0 && end.sleep < 1e-3 * end.dissipated(), "{:e}", end.sleep);
    let momentum = simulation.momentum_budget();
    assert!(momentum.imbalance().norm() < 1e-9 * momentum.gravity.norm(), "{:?}", momentum.imbalance());
    assert!(momentum.sleep.norm() > 0.0);
}

#[test]
fn a_sphere_that_falls_upon_a_bed_wakes_it_as_far_as_it_is_felt() {
    let mut simulation = bed(tub(Some(SLEEPING)), 6);
    let before = places(&simulation);
    let ball = striker(&mut simulation, 0.5);
    let mut fewest = simulation.particle_count();
    let (mut struck, mut deepest) = (false, f64::INFINITY);
    for _ in 0..2000 {
        run(&mut simulation, 1);
        let awake = simulation.views().filter(|view| view.path == Path::Free && view.id != ball);
        let depth = awake.map(|view| view.position.z).fold(f64::INFINITY, f64::min);
        if depth < f64::INFINITY && !struck {
            let force = simulation.contact_force(ball).expect("it is there").z;
            assert!(force > 0.0, "nobody wakes before the ball touches");
            struck = true;
        }
        deepest = deepest.min(depth);
        fewest = fewest.min(asleep(&simulation));
    }
    assert!(struck && deepest < 3.0 * RADIUS, "the impact goes down: {deepest}");
    let after = places(&simulation);
    let moved = after.iter().zip(&before).filter(|(new, old)| (*new - *old).norm() > 1e-6).count();
    assert!(moved > 5, "the bed gives way: {moved}");
    assert!(fewest < 140, "{fewest} slept on");
    settle(&mut simulation);
    let walls: f64 = simulation.part_loads().iter().map(|load| load.force.z).sum();
    assert!((-walls / weight(&simulation) - 1.0).abs() < UNBALANCED, "the ball's weight has come down");
}

#[test]
fn a_touch_too_light_wakes_nobody() {
    let mut simulation = bed(tub(Some(SLEEPING)), 3);
    let top = simulation.particles().into_iter().max_by(|a, b| a.position.z.total_cmp(&b.position.z)).expect("a bed");
    let radius = 0.15 * top.radius;
    let place = top.position + vec3(0.0, 0.0, top.radius + 0.999 * radius);
    // a three-hundredth of the weight, laid on
    simulation.insert(&[grain(9000, radius, place, Vec3::zeros())]);
    run(&mut simulation, 400);
    let awake = simulation.views().filter(|view| view.path == Path::Free && view.id != id(9000)).count();
    assert!(awake == 0 && simulation.contact_force(id(9000)).expect("it is there").z > 0.0, "felt, and {awake} woke");
}

#[test]
fn a_gate_that_opens_lets_all_of_a_sleeping_bed_out() {
    let mut setup = tub(Some(SLEEPING));
    let settled = bed(setup.clone(), 4);
    let opens = settled.time() + 0.01;
    setup.parts[0].disappears = Trigger::At { time: opens };
    let mut simulation = Simulation::resume(setup, &settled.record()).expect("the same parts");
    while simulation.time() < opens - 2.0 * simulation.setup().timestep {
        run(&mut simulation, 1);
        assert_eq!(asleep(&simulation), 100, "nothing has happened yet");
    }
    run(&mut simulation, 5);
    assert!(asleep(&simulation) < 90, "who lay on it is awake: {}", asleep(&simulation));
    let lower = |simulation: &Simulation| places(simulation).iter().map(|place| place.z).fold(f64::INFINITY, f64::min);
    let height = lower(&simulation);
    while simulation.particle_count() > 0 {
        run(&mut simulation, 100);
        assert!(
            simulation.time() < opens + 3.0,
            "{} stay, {} asleep",
            simulation.particle_count(),
            asleep(&simulation)
        );
    }
    assert_eq!((simulation.removed().len(), height > 0.0), (100, true));
}

#[test]
fn a_plate_that_begins_to_move_pushes_sleepers() {
    let mut setup = tub(Some(SLEEPING));
    let plate = sheet(vec3(-HALF, -HALF, 0.0), vec3(0.0, 2.0 * HALF, 0.0), vec3(0.0, 0.0, 0.1), 2, 2);
    let push = MotionKind::Translate { velocity: vec3(0.02, 0.0, 0.0) };
    let mut plate = part("plate", Surface::Mesh(plate), Vec::new());
    let from = 3.0;
    plate.motion = Motion { terms: vec![MotionTerm { kind: push, from, until: f64::INFINITY }] };
    setup.parts.push(plate);
    let mut simulation = bed(setup, 2);
    assert!(simulation.time() < from, "{}", simulation.time());
    while simulation.time() < from - 2.0 * simulation.setup().timestep {
        run(&mut simulation, 1);
    }
    assert_eq!(asleep(&simulation), 50, "it stands still yet");
    let before = places(&simulation);
    while simulation.time() < from + 0.5 {
        run(&mut simulation, 100);
    }
    let after = places(&simulation);
    let reach = -HALF + 0.01;
    let leftmost = after.iter().map(|place| place.x).fold(f64::INFINITY, f64::min);
    assert!(leftmost > reach, "all are before the plate: {leftmost}");
    assert!(before.iter().any(|place| place.x < reach), "some were behind where it is now");
}

#[test]
fn who_loses_a_neighbour_wakes() {
    let mut simulation = bed(tub(Some(SLEEPING)), 4);
    let contacts = simulation.contacts();
    // One that others rest on: taken out of the middle of the floor.
    let states = simulation.particles();
    let gone = states
        .iter()
        .filter(|state| state.position.z < 1.2 * RADIUS)
        .min_by(|a, b| a.position.norm().total_cmp(&b.position.norm()))
        .expect("a lowest layer");
    let floor = |simulation: &Simulation| {
        let loads = simulation.part_loads().iter();
        -loads.map(|load| load.force.z).sum::<f64>() / weight(simulation)
    };
    simulation.remove_particles(&[gone.id], RemovalCause::Asked);
    assert_eq!(asleep(&simulation), 99);
    run(&mut simulation, 1);
    let awake: Vec<ParticleId> =
        simulation.views().filter(|view| view.path == Path::Free).map(|view| view.id).collect();
    let touched = |id: &ParticleId| {
        let other = tollgate::dem::inspect::Partner::Particle;
        contacts.iter().any(|c| (c.i, c.j) == (gone.id, other(*id)) || (c.i, c.j) == (*id, other(gone.id)))
    };
    assert!(!awake.is_empty() && awake.iter().all(touched), "those who touched it, at first: {awake:?}");
    settle(&mut simulation);
    assert!((floor(&simulation) - 1.0).abs() < UNBALANCED, "{}", floor(&simulation));
    let moved = simulation.particles();
    let fell = moved.iter().filter(|state| {
        let old = states.iter().find(|old| old.id == state.id).expect("it was there");
        old.position.z - state.position.z > 0.1 * RADIUS
    });
    assert!(fell.count() > 0, "somebody fell into the gap");
}

#[test]
fn a_sleeper_that_is_displaced_frozen_or_started_from_is_awake() {
    let mut simulation = bed(tub(Some(SLEEPING)), 2);
    let states = simulation.particles();
    let highest = states.iter().max_by(|a, b| a.position.z.total_cmp(&b.position.z)).expect("a bed");
    assert!(simulation.displace(highest.id, vec3(0.0, 0.0, 2.0 * RADIUS)));
    simulation.prescribe(&[states[0].id], Path::Constant);
    assert_eq!(asleep(&simulation), 48);
    let record = simulation.record();
    let other = Simulation::start_from(tub(None), &record).expect("the same materials");
    assert_eq!(asleep(&other), 0);
    let refused = Simulation::resume(tub(None), &record).expect_err("not the same scene");
    assert!(refused.to_string().contains("may sleep"), "{refused}");
}

/// A bed of several chunks, settled, struck and half asleep again, with a stirrer beside it; records at the moments given.
fn disturbed(threads: usize, simd: SimdLevel, moments: &[u64]) -> (Vec<SimulationRecord>, [usize; 2]) {
    const STEPS: u64 = 14_000;
    let mut simulation = with(large(threads, simd), &large_filling());
    let mut records = Vec::new();
    let mut slept = [usize::MAX, 0];
    for step in 1..=STEPS {
        run(&mut simulation, 1);
        act(&mut simulation);
        if step > 9000 {
            slept = [slept[0].min(asleep(&simulation)), slept[1].max(asleep(&simulation))];
        }
        if moments.contains(&step) || step == STEPS {
            records.push(simulation.record());
        }
    }
    (records, slept)
}

fn large(threads: usize, simd: SimdLevel) -> Setup {
    let mut setup = tub(Some(SleepSettings { speed: 0.01, hold: 4e-3, acceleration: 0.5 }));
    (setup.threads, setup.simd) = (threads, simd);
    for (plane, side) in setup.parts[1..].iter_mut().zip([-Vec3::x(), Vec3::x(), -Vec3::y(), Vec3::y()]) {
        let Surface::Plane { normal, .. } = plane.surface else { unreachable!("a plane") };
        plane.surface = Surface::Plane { point: side * (3.0 * HALF), normal };
    }
    setup
}

fn large_filling() -> Vec<ParticleState> {
    let start = vec3(-2.9 * HALF + RADIUS, -2.9 * HALF + RADIUS, 1.1 * RADIUS);
    let mut states = lattice([15, 15, 4], start, 2.25 * RADIUS, RADIUS, 0.05, &mut Draw(9));
    states.iter_mut().step_by(3).for_each(|state| state.radius *= 0.9);
    states
}

/// Strikes at fixed steps.
fn act(simulation: &mut Simulation) {
    if simulation.steps_done() == 9500 {
        striker(simulation, 1.0);
    }
}

#[test]
fn threads_lanes_and_records_change_no_bit_of_who_sleeps() {
    let moments = [7013, 9501, 9640, 12_345];
    let (records, [fewest, most]) = disturbed(1, SimdLevel::best(), &moments);
    let count = large_filling().len();
    assert!(most > count * 9 / 10, "nearly all sleep at times: {most} of {count}");
    assert!(fewest + 30 < most, "and some wake: {fewest} of {most}");
    for (threads, simd) in [(3, SimdLevel::best()), (1, SimdLevel::Scalar)] {
        let (others, _) = disturbed(threads, simd, &moments);
        for (record, other) in records.iter().zip(&others) {
            assert!(record == other, "{threads} threads, {simd:?}: another result");
        }
    }
    let end = records.last().expect("the end");
    for (record, moment) in records.iter().zip(moments) {
        let mut resumed = Simulation::resume(large(2, SimdLevel::best()), record).expect("the same setup");
        assert!(resumed.record() == *record, "a record of the record, step {moment}");
        while resumed.steps_done() < 14_000 {
            run(&mut resumed, 1);
            act(&mut resumed);
        }
        assert!(resumed.record() == *end, "continued from step {moment}");
    }
}

#[test]
fn what_nobody_may_sleep_by_changes_no_bit() {
    let run_with = |sleeping| {
        let mut simulation = with(tub(sleeping), &filling(3));
        run(&mut simulation, 6000);
        (simulation.particles(), simulation.contacts(), simulation.energy())
    };
    let off = run_with(None);
    // Nobody is ever as slow as that, but everything that sleep needs is looked at.
    assert!(run_with(Some(SleepSettings { speed: 1e-300, ..SLEEPING })) == off);
    assert!(run_with(Some(SleepSettings { speed: 0.01, hold: 4e-3, acceleration: 0.5 })) != off, "with others it does");
}
