//! Bit for bit: threads, repetition, records.

use crate::common::*;
use tollgate::dem::checkpoint::SimulationRecord;
use tollgate::dem::feed::{Amount, Face, Feed, FeedKind, Rate, Region};
use tollgate::dem::law::{LawSettings, RollingLaw};
use tollgate::dem::particles::Path;
use tollgate::dem::simulation::{Setup, Simulation};
use tollgate::geometry::motion::MotionKind::{Oscillate, Rotate};
use tollgate::geometry::part::{AtRest, Surface, TriangleMesh, Trigger};
use tollgate::math::{Bounds, Vec3, vec3};
use tollgate::particle::{ParticleClass, SizeDistribution};

const RADIUS: f64 = 0.005;

/// A tub with a turning paddle and a shaken floor plate: friction, rolling resistance, planes, meshes, a frustum.
fn tub(half: f64) -> Setup {
    let law = LawSettings { rolling: RollingLaw::Epsd2, ..HERTZ };
    let mut setup = empty(RADIUS, law, pair(0.5, 0.4, 0.1));
    setup.gravity = gravity();
    setup.domain = Bounds { minimum: [-1.0, -1.0, -0.1], maximum: [1.0, 1.0, 3.0] };
    let paddle = sheet(vec3(-0.9 * half, 0.0, 0.01), vec3(1.8 * half, 0.0, 0.0), vec3(0.0, 0.0, 0.06), 6, 3);
    let turn = Rotate { origin: Vec3::zeros(), axis: vec3(0.0, 0.0, 1.0), rate: 12.0 };
    let plate = TriangleMesh::box_mesh(&vec3(-0.4 * half, -0.4 * half, -0.02), &vec3(0.4 * half, 0.4 * half, 0.004));
    let shake = Oscillate { amplitude: vec3(0.0, 0.0, 0.002), frequency: 30.0, phase: 0.4 };
    let tube =
        Surface::Frustum { start: Vec3::zeros(), end: vec3(0.0, 0.0, 2.0), start_radius: half, end_radius: 1.1 * half };
    setup.parts = vec![
        plane("floor", Vec3::zeros(), Vec3::z()),
        part("tub", tube, Vec::new()),
        part("paddle", Surface::Mesh(paddle), vec![turn]),
        part("plate", Surface::Mesh(plate), vec![shake]),
    ];
    setup
}

fn thrown(threads: usize, steps: u64) -> SimulationRecord {
    let mut setup = tub(0.14);
    setup.threads = threads;
    let cloud = lattice([20, 20, 16], vec3(-0.095, -0.095, 0.075), 1.995 * RADIUS, RADIUS, 0.1, &mut Draw(7));
    // the corners of the lattice lie outside of the tub
    let mut cloud: Vec<_> = cloud.into_iter().filter(|p| p.position.xy().norm() < 0.133).collect();
    cloud.iter_mut().for_each(|state| state.velocity.z -= 2.0);
    assert!(cloud.len() > 5000, "three chunks and more: {}", cloud.len());
    let mut simulation = with(setup, &cloud);
    let mut touched = vec![false; simulation.part_loads().len()];
    for _ in 0..steps {
        run(&mut simulation, 1);
        touched.iter_mut().zip(simulation.part_loads()).for_each(|(seen, load)| *seen |= load.force != Vec3::zeros());
    }
    let contacts = simulation.contacts().len();
    assert!(contacts > 900, "a bed in contact: {contacts}");
    assert!(touched.iter().all(|touched| *touched), "every part is touched");
    simulation.record()
}

#[test]
fn threads_and_repetition_change_no_bit() {
    let once = thrown(1, 700);
    for threads in [1, 2, 3] {
        // not assert_eq!: nobody reads a million numbers
        assert!(thrown(threads, 700) == once, "{threads} threads gave another result");
    }
}

/// Feeds that go on, a gate that opens at rest, moving parts.
fn busy() -> Setup {
    let mut setup = tub(0.07);
    setup.overlap_limit = 0.9;
    let diameter = SizeDistribution::Uniform { minimum: 1.4 * RADIUS, maximum: 2.0 * RADIUS };
    setup.classes = vec![ParticleClass { name: "grain".to_owned(), material: GRAIN, diameter }];
    let region = Region::Cylinder { start: vec3(0.0, 0.0, 0.08), end: vec3(0.0, 0.0, 0.3), radius: 0.068 };
    let face = Face::Disc { centre: vec3(0.0, 0.0, 0.5), normal: vec3(0.0, 0.0, -1.0), radius: 0.05 };
    setup.feeds = vec![
        Feed {
            name: "fill".to_owned(),
            kind: FeedKind::Fill {
                class: 0,
                region,
                amount: Amount::Count(1500),
                velocity: vec3(0.0, 0.0, -1.0),
                start: 0.0,
                interval: 0.02,
                until: 0.12,
            },
        },
        Feed {
            name: "stream".to_owned(),
            kind: FeedKind::Stream {
                class: 0,
                face,
                rate: Rate::Count(3000.0),
                amount: Some(Amount::Count(200)),
                velocity: vec3(0.0, 0.0, -2.0),
                start: 0.01,
                until: 0.1,
            },
        },
    ];
    let sheet = sheet(vec3(-0.1, -0.1, 0.072), vec3(0.2, 0.0, 0.0), vec3(0.0, 0.2, 0.0), 9, 9);
    let mut gate = part("gate", Surface::Mesh(sheet), Vec::new());
    // rest as nobody would call it, so that it comes soon
    gate.disappears = Trigger::AtRest(AtRest { speed: 1.5, hold: 0.004, not_before: 0.0 });
    setup.parts.push(gate);
    setup
}

/// Prescribes and releases some particles at fixed steps.
fn steer(simulation: &mut Simulation) {
    let states = simulation.particles();
    let chosen: Vec<_> = states.iter().step_by(37).map(|state| state.id).collect();
    match simulation.steps_done() {
        200 => simulation.prescribe(&chosen, Path::Ballistic),
        300 => simulation.prescribe(&chosen[5..], Path::Constant),
        420 => release_as_they_are(simulation, &chosen),
        _ => {}
    }
}

#[test]
fn a_run_continues_from_its_record_bit_for_bit() {
    const STEPS: u64 = 3000;
    let mut at = Draw(11);
    let moments = [at.between(30.0, 200.0) as u64, at.between(210.0, 450.0) as u64, at.between(600.0, 2900.0) as u64];
    let mut records = Vec::new();
    let mut whole = Simulation::new(busy());
    for step in 1..=STEPS {
        run(&mut whole, 1);
        steer(&mut whole);
        if moments.contains(&step) {
            records.push(whole.record());
        }
    }
    assert!(whole.particle_count() > 800, "two chunks and more: {}", whole.particle_count());
    assert_eq!(whole.part_events().len(), 1, "the gate has opened");
    let opened = whole.part_events()[0].time;
    let before_gate = moments.iter().filter(|step| (**step as f64) * whole.setup().timestep < opened).count();
    assert!((1..=3).contains(&before_gate), "records before the gate opened: {before_gate}");
    let end = whole.record();
    for (record, moment) in records.iter().zip(moments) {
        for threads in [1, 2] {
            let mut resumed = Simulation::resume(Setup { threads, ..busy() }, record).expect("the same setup");
            assert!(resumed.record() == *record, "a record of the record, step {moment}");
            while resumed.steps_done() < STEPS {
                run(&mut resumed, 1);
                steer(&mut resumed);
            }
            assert!(resumed.record() == end, "continued from step {moment} with {threads} threads");
            assert_eq!(resumed.contacts(), whole.contacts());
            assert_eq!(resumed.energy(), whole.energy());
            assert_eq!(resumed.feed_reports(), whole.feed_reports());
        }
    }
    // the run that never took a record is the same run
    let mut quiet = Simulation::new(busy());
    for _ in 0..STEPS {
        run(&mut quiet, 1);
        steer(&mut quiet);
    }
    assert!(quiet.record() == end, "taking records changed the run");
}

#[test]
fn a_run_started_from_a_record_keeps_its_contacts() {
    let mut setup = tub(0.07);
    setup.parts.truncate(2);
    let cloud = lattice([9, 9, 10], vec3(-0.041, -0.041, 0.006), 2.01 * RADIUS, RADIUS, 0.0, &mut Draw(3));
    let cloud: Vec<_> = cloud.into_iter().filter(|p| p.position.xy().norm() < 0.06).collect();
    let mut first = with(setup.clone(), &cloud);
    run(&mut first, 12_000);
    let record = first.record();
    // another skin, another part, other threads: the same contacts
    setup.skin *= 0.5;
    setup.threads = 2;
    let mut next = Simulation::start_from(setup.clone(), &record).expect("it fits");
    let (before, after) = (first.contacts(), next.contacts());
    assert_eq!(before.len(), after.len());
    let weight = 9.81 * DENSITY * 4.0 / 3.0 * std::f64::consts::PI * RADIUS.powi(3);
    for (a, b) in before.iter().zip(&after) {
        // the same bits in another order of storage: a pair may be computed from its other side
        assert_eq!((a.i, a.j), (b.i, b.j));
        assert!((a.force - b.force).norm() <= 1e-14 * a.force.norm(), "{a:?} {b:?}");
        assert!((a.point - b.point).norm() < 1e-14, "{a:?} {b:?}");
    }
    assert!(
        before.iter().any(|c| (c.force - c.normal * c.force.dot(&c.normal)).norm() > 1e-2 * weight),
        "friction acts"
    );
    // and it goes on as if nothing had happened
    run(&mut first, 500);
    run(&mut next, 500);
    assert_eq!(next.steps_done(), 500);
    for (a, b) in first.particles().iter().zip(&next.particles()) {
        // the first loads are computed anew with full-step velocities: a difference of the order of dt times the creeping speed
        assert!((a.position - b.position).norm() < 1e-7 * RADIUS, "{:e}", (a.position - b.position).norm());
    }
    assert!(next.energy().sum().abs() < 1e-6 * next.energy().inserted.abs(), "{:?}", next.energy());
}
