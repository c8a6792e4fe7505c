//! A flow cut in two by a plane: the part behind it, fed with ghosts and arrivals, must go on as the whole does.

use crate::common::*;
use std::collections::{HashMap, HashSet};
use tollgate::dem::ghost::PrescribedMotion;
use tollgate::dem::inspect::Partner;
use tollgate::dem::law::{Compatibility, LawSettings, NormalLaw, RollingLaw, TangentialLaw};
use tollgate::dem::momentum::MomentumBudget;
use tollgate::dem::particles::Path;
use tollgate::dem::release::{Arrival, ReleaseCount};
use tollgate::dem::simulation::{Setup, Simulation};
use tollgate::dem::tether::TetherLaw;
use tollgate::dem::view::ParticleView;
use tollgate::geometry::part::{Surface, TriangleMesh};
use tollgate::math::{Vec3, vec3};
use tollgate::particle::{ParticleId, ParticleState};

const RADIUS: f64 = 0.0025;
/// Half edge of the square hole: 4.8 diameters wide, so that nothing arches.
const HOLE: f64 = 0.012;
/// Half edge of the box.
const BOX: f64 = 0.025;
/// Height of the gate plane: below the hole, where the flow is dense.
const GATE: f64 = 0.0005;
/// Ghosts exist from here on: two and a half diameters before the plane.
const ZONE: f64 = GATE + 5.0 * RADIUS;
/// New ghosts come at multiples of so many steps.
const ROUND: u64 = 16;

/// Every term of the default laws.
const LAW: LawSettings = LawSettings { rolling: RollingLaw::Epsd2, ..HERTZ };

/// A box whose floor has a hole, and a plate under it on which a heap grows.
fn hopper(share: f64, law: LawSettings) -> Setup {
    let mut setup = empty(RADIUS, law, pair(0.4, 0.5, 0.1));
    setup.gravity = gravity();
    setup.timestep = rayleigh_share(share, RADIUS);
    setup.overlap_limit = 0.5;
    let (outer, inner) = (BOX, HOLE);
    let wing = outer - inner;
    let mut soup = Vec::new();
    for (corner, a, b) in [
        (vec3(-outer, -outer, 0.0), vec3(2.0 * outer, 0.0, 0.0), vec3(0.0, wing, 0.0)),
        (vec3(-outer, inner, 0.0), vec3(2.0 * outer, 0.0, 0.0), vec3(0.0, wing, 0.0)),
        (vec3(-outer, -inner, 0.0), vec3(wing, 0.0, 0.0), vec3(0.0, 2.0 * inner, 0.0)),
        (vec3(inner, -inner, 0.0), vec3(wing, 0.0, 0.0), vec3(0.0, 2.0 * inner, 0.0)),
    ] {
        let mesh = sheet(corner, a, b, 3, 3);
        soup.extend((0..mesh.triangles.len()).map(|triangle| mesh.corners(triangle)));
    }
    setup.parts = vec![
        part("floor", Surface::Mesh(TriangleMesh::from_soup(&soup)), Vec::new()),
        plane("plate", vec3(0.0, 0.0, -0.015), Vec3::z()),
        plane("left", vec3(-outer, 0.0, 0.0), Vec3::x()),
        plane("right", vec3(outer, 0.0, 0.0), -Vec3::x()),
        plane("front", vec3(0.0, -outer, 0.0), Vec3::y()),
        plane("back", vec3(0.0, outer, 0.0), -Vec3::y()),
    ];
    setup
}

fn grains() -> Vec<ParticleState> {
    let mut draw = Draw(5);
    let mut states = lattice([9, 9, 4], vec3(-0.021, -0.021, 0.0027), 2.1 * RADIUS, RADIUS, 0.05, &mut draw);
    states.iter_mut().for_each(|state| state.radius *= draw.between(0.8, 1.0));
    states
}

fn motion(view: &ParticleView) -> PrescribedMotion {
    PrescribedMotion {
        position: view.position,
        velocity: view.velocity,
        spin: view.spin,
        acceleration: view.acceleration,
        spin_acceleration: view.spin_acceleration,
    }
}

fn total(a: ReleaseCount, b: ReleaseCount) -> ReleaseCount {
    ReleaseCount {
        restored: a.restored + b.restored,
        kept_by_solver: a.kept_by_solver + b.kept_by_solver,
        without_partner: a.without_partner + b.without_partner,
        with_parts: a.with_parts + b.with_parts,
    }
}

/// The whole flow, and who of it has passed the gate.
struct Whole {
    simulation: Simulation,
    states: HashMap<ParticleId, ParticleState>,
    passed: HashSet<ParticleId>,
    views: HashMap<ParticleId, ParticleView>,
    arrivals: Vec<Arrival>,
}

impl Whole {
    fn new(setup: Setup) -> Self {
        let simulation = with(setup, &grains());
        let states = simulation.particles().into_iter().map(|state| (state.id, state)).collect();
        Self { simulation, states, passed: HashSet::new(), views: HashMap::new(), arrivals: Vec::new() }
    }

    fn step(&mut self) {
        run(&mut self.simulation, 1);
        self.views = self.simulation.views().map(|view| (view.id, view)).collect();
        let mut ids: Vec<ParticleId> = self.views.values().filter(|v| v.position.z <= GATE).map(|v| v.id).collect();
        ids.retain(|id| self.passed.insert(*id));
        ids.sort();
        let states: HashMap<_, _> = self.simulation.particles().into_iter().map(|state| (state.id, state)).collect();
        let contacts = self.simulation.contacts_of(&ids);
        assert_eq!(contacts.len(), ids.len());
        self.arrivals = contacts
            .into_iter()
            .map(|(id, contacts)| Arrival {
                state: states[&id],
                force: self.views[&id].force,
                torque: self.views[&id].torque,
                contacts: contacts.iter().map(|contact| (contact.partner, contact.memory)).collect(),
            })
            .collect();
    }

    /// The largest number of contacts that a particle behind the gate has now.
    fn most_contacts(&self) -> usize {
        let mut count: HashMap<ParticleId, usize> = HashMap::new();
        for contact in self.simulation.contacts() {
            *count.entry(contact.i).or_default() += 1;
            if let Partner::Particle(other) = contact.j {
                *count.entry(other).or_default() += 1;
            }
        }
        self.passed.iter().filter_map(|id| count.get(id)).copied().max().unwrap_or(0)
    }
}

/// How the lower part is run.
#[derive(Clone, Copy)]
struct Manner {
    /// Time step as a share of the Rayleigh time.
    share: f64,
    /// Contact laws.
    law: LawSettings,
    /// Whether arrivals bring the memory of their contacts.
    with_memory: bool,
    /// Law that binds ghosts to their paths from one and a half radii before the gate on.
    tether: Option<TetherLaw>,
}

const EXACT: Manner = Manner { share: 0.1, law: LAW, with_memory: true, tether: None };

/// Carries out at the lower part what has happened in the whole, after the same step.
fn observe(lower: &mut Simulation, whole: &Whole, manner: Manner) -> ReleaseCount {
    assert_eq!(lower.steps_done(), whole.simulation.steps_done());
    if lower.steps_done().is_multiple_of(ROUND) {
        let here: HashSet<ParticleId> = lower.views().map(|view| view.id).collect();
        let is_due = |view: &&ParticleView| {
            view.position.z < ZONE && !whole.passed.contains(&view.id) && !here.contains(&view.id)
        };
        let mut due: Vec<&ParticleView> = whole.views.values().filter(is_due).collect();
        due.sort_by_key(|view| view.id);
        let ghosts: Vec<_> = due.iter().map(|view| (whole.states[&view.id], Path::Recorded, motion(view))).collect();
        lower.insert_prescribed(&ghosts);
    }
    lower.steer(|id| whole.views.get(&id).map(motion));
    let mut arrivals = whole.arrivals.clone();
    if !manner.with_memory {
        arrivals.iter_mut().for_each(|arrival| arrival.contacts.clear());
    }
    if let Some(law) = manner.tether {
        lower.untether(&arrivals.iter().map(|arrival| arrival.state.id).collect::<Vec<_>>());
        let near = |view: &ParticleView| view.path == Path::Recorded && view.position.z < GATE + 1.5 * RADIUS;
        let near: Vec<ParticleId> = lower.views().filter(near).map(|view| view.id).collect();
        lower.tether(&near, law);
    }
    lower.release(&arrivals)
}

/// Largest distance between a particle that has passed in the lower part and in the whole.
fn deviation(lower: &Simulation, whole: &Whole) -> f64 {
    let free = lower.views().filter(|view| view.path == Path::Free);
    free.map(|view| (view.position - whole.views[&view.id].position).norm()).fold(0.0, f64::max)
}

fn size(budget: &MomentumBudget) -> f64 {
    let MomentumBudget { momentum, gravity, walls, ghosts, tethers, sleep, hand_over, inserted, removed } = budget;
    [momentum, gravity, walls, ghosts, tethers, sleep, hand_over, inserted, removed].into_iter().map(Vec3::norm).sum()
}

/// What came out of running whole and lower part side by side.
struct Course {
    /// Contacts between ghosts and residents seen while everything was bit-equal.
    exact_ghost_contacts: usize,
    /// Steps after the first passage for which everything was bit-equal.
    exact_steps: u64,
    /// Deviation after each hundred steps after the first passage [m].
    deviations: Vec<f64>,
    count: ReleaseCount,
    lower: Simulation,
    whole: Whole,
}

/// Runs until `steps` steps after the first passage; `look` sees lower part and whole, and how many steps it is since.
fn course(steps: u64, manner: Manner, mut look: impl FnMut(&Simulation, &Whole, u64)) -> Course {
    let setup = hopper(manner.share, manner.law);
    let mut course = Course {
        exact_ghost_contacts: 0,
        exact_steps: 0,
        deviations: Vec::new(),
        count: ReleaseCount::default(),
        lower: Simulation::new(setup.clone()),
        whole: Whole::new(setup),
    };
    let (mut after, mut crowded) = (0, !manner.with_memory || manner.tether.is_some());
    while after < steps {
        course.whole.step();
        run(&mut course.lower, 1);
        after += u64::from(!course.whole.passed.is_empty());
        if !crowded && after > 0 {
            // Sums of up to two forces do not depend on their order.
            for view in course.lower.views().filter(|view| view.path == Path::Free) {
                assert_eq!(view, course.whole.views[&view.id], "step {after} after the first passage");
            }
            course.exact_ghost_contacts += course.lower.ghost_pressure().len();
            course.exact_steps = after;
        }
        if after > 0 && after.is_multiple_of(100) {
            course.deviations.push(deviation(&course.lower, &course.whole));
        }
        let counted = observe(&mut course.lower, &course.whole, manner);
        course.count = total(course.count, counted);
        crowded = crowded || course.whole.most_contacts() > 2;
        look(&course.lower, &course.whole, after);
    }
    course
}

#[test]
fn the_lower_part_goes_on_as_the_whole_does() {
    let course = course(2000, EXACT, |_, _, _| {});
    // As long as no resident bears three forces, whose sum depends on their order, every bit is that of the whole.
    assert!(course.exact_steps > 300, "{}", course.exact_steps);
    assert!(course.exact_ghost_contacts > 100, "{}", course.exact_ghost_contacts);
    // Then round-off enters: a place is known to 1e-18 m, some 1e-15 of a radius. Collisions multiply a deviation by ten in about 400
    // steps (measured over 6000), so 2000 steps make 1e-10 of it at the most; 3e-13 was seen.
    assert!(course.deviations.iter().all(|deviation| *deviation < 1e-9 * RADIUS), "{:?}", course.deviations);
    assert!(course.whole.passed.len() > 60, "{}", course.whole.passed.len());
    let ReleaseCount { restored, kept_by_solver, without_partner, with_parts } = course.count;
    assert!(restored > 5 && kept_by_solver > 5 && with_parts > 2, "{:?}", course.count);
    assert_eq!(without_partner, 0, "all that an arrival touches is here");

    // The comparison sees what is lost: without the memory of a dozen contacts the lower part goes its own way at once.
    let forgetful = self::course(600, Manner { with_memory: false, ..EXACT }, |_, _, _| {});
    assert!(forgetful.deviations[5] > 1e-5 * RADIUS, "{:?}", forgetful.deviations);
}

#[test]
fn every_law_is_handed_over_to_the_last_bit() {
    let linear = LawSettings { normal: NormalLaw::Linear, tangential: TangentialLaw::Total, ..LAW };
    let rival = LawSettings { compatibility: Compatibility::Liggghts, ..LAW };
    let plain = LawSettings { rolling: RollingLaw::None, ..LAW };
    for law in [linear, rival, plain] {
        let course = course(500, Manner { law, ..EXACT }, |_, _, _| {});
        assert!(course.exact_steps > 200 && course.exact_ghost_contacts > 50, "{law:?}: {}", course.exact_steps);
        assert!(course.count.restored + course.count.with_parts > 0, "{law:?}: {:?}", course.count);
        assert!(course.deviations.iter().all(|deviation| *deviation < 1e-12 * RADIUS), "{:?}", course.deviations);
    }
}

#[test]
fn ghosts_keep_the_bits_of_the_whole() {
    // every ghost has the bits of the whole, at every step and before it is steered
    let mut lower = Simulation::new(hopper(0.1, LAW));
    let mut whole = Whole::new(hopper(0.1, LAW));
    let (mut compared, mut seen) = (0, HashSet::new());
    for _ in 0..1500 {
        whole.step();
        run(&mut lower, 1);
        for view in lower.views().filter(|view| view.path == Path::Recorded) {
            assert_eq!(view.position, whole.views[&view.id].position);
            compared += 1;
            seen.insert(view.id);
        }
        observe(&mut lower, &whole, EXACT);
        for view in lower.views().filter(|view| view.path == Path::Recorded) {
            assert_eq!(motion(&view), motion(&whole.views[&view.id]));
        }
    }
    assert!(seen.len() > 100 && compared > 10_000, "{} {compared}", seen.len());
}

/// A tenth of a diameter, at which the linear spring alone bears ten times the weight.
fn law() -> TetherLaw {
    let compliance = 0.2 * RADIUS;
    TetherLaw { frequency_squared: 10.0 * 9.81 / compliance, compliance }
}

#[test]
fn the_momentum_of_the_free_is_accounted_for() {
    for tether in [None, Some(law())] {
        let (mut left, mut disturbed, mut quiet) = (Vec3::zeros(), true, 0);
        let course = course(1500, Manner { tether, ..EXACT }, |lower, whole, after| {
            let budget = lower.momentum_budget();
            assert!(budget.imbalance().norm() <= 1e-9 * size(&budget), "step {after}: {budget:?}");
            if !disturbed {
                assert_eq!(budget.hand_over, left, "nobody came or went: nothing is left by that");
                quiet += 1;
            }
            // what is done after this step is booked in the next one
            left = budget.hand_over;
            disturbed = tether.is_some() || !whole.arrivals.is_empty() || lower.steps_done().is_multiple_of(ROUND);
        });
        let budget = course.lower.momentum_budget();
        let nothing = Vec3::zeros();
        assert!(budget.walls != nothing && budget.ghosts != nothing && budget.hand_over != nothing, "{budget:?}");
        assert_eq!(budget.tethers != nothing, tether.is_some());
        assert_eq!(quiet > 1000, tether.is_none());
        // what the hand-over of a contact leaves is half a time step of its force: small beside what came with the particles
        assert!(budget.hand_over.norm() < 1e-2 * budget.inserted.norm(), "{budget:?}");
    }
}

#[test]
fn the_energy_of_the_free_is_accounted_for() {
    for tether in [None, Some(law())] {
        // the power is sampled once a step: an error of first order in dt, here far below what is asked for
        let course = course(7500, Manner { share: 0.02, tether, ..EXACT }, |_, _, _| {});
        let budget = course.lower.energy();
        assert!(budget.sum().abs() < 1e-3 * budget.dissipated(), "{:e} {budget:?}", budget.sum());
        assert!(budget.prescribed_work != 0.0 && budget.inserted != 0.0);
        assert_eq!(budget.tether_work != 0.0, tether.is_some());
    }
}

#[test]
fn a_hand_over_continues_from_its_record_bit_for_bit() {
    let manner = Manner { tether: Some(law()), ..EXACT };
    let mut whole = Whole::new(hopper(0.1, LAW));
    let mut lower = Simulation::new(hopper(0.1, LAW));
    let mut copies: Vec<Simulation> = Vec::new();
    let mut kinds = HashSet::new();
    for step in 1..=1400_u64 {
        whole.step();
        run(&mut lower, 1);
        observe(&mut lower, &whole, manner);
        for copy in &mut copies {
            run(copy, 1);
            observe(copy, &whole, manner);
        }
        // right after ghosts came, and at an odd moment
        if [800, 1013].contains(&step) {
            let record = lower.record();
            kinds.extend(lower.views().map(|view| view.path as u32));
            let copy = Simulation::resume(Setup { threads: 2, ..hopper(0.1, LAW) }, &record).expect("the same setup");
            assert!(copy.record() == record, "a record of the record");
            copies.push(copy);
        }
    }
    assert!(kinds.contains(&(Path::Recorded as u32)) && kinds.contains(&(Path::Tethered as u32)), "{kinds:?}");
    for copy in &copies {
        assert!(copy.record() == lower.record());
        assert_eq!(copy.energy(), lower.energy());
        assert_eq!(copy.momentum_budget(), lower.momentum_budget());
        assert_eq!(copy.contacts(), lower.contacts());
    }
}
