//! A time step that is left to be completed later gives the bits of one that is completed at its end, whoever looks or interferes.
//!
//! Momentum is accounted for within every step, so that a run with that account is the one completed at its end.

use crate::common::*;
use tollgate::dem::checkpoint::SimulationRecord;
use tollgate::dem::law::{Compatibility, LawSettings, RollingLaw};
use tollgate::dem::particles::Path;
use tollgate::dem::removal::RemovalCause;
use tollgate::dem::simulation::{Setup, Simulation};
use tollgate::dem::view::ParticleView;
use tollgate::geometry::motion::MotionKind::Oscillate;
use tollgate::geometry::part::Surface;
use tollgate::math::lanes::SimdLevel;
use tollgate::math::{Bounds, Vec3, vec3};
use tollgate::particle::{Body, ParticleState};

const RADIUS: f64 = 0.004;
/// Beyond the 256th step, at whose end the watchdog looks at the energy.
const STEPS: u64 = 600;

/// A shaken tray, periodic along x, out of which particles are thrown beyond the domain's upper border.
fn tray(body: Body, compatibility: Compatibility) -> (Setup, Vec<ParticleState>) {
    let law = LawSettings { rolling: RollingLaw::Epsd2, compatibility, ..HERTZ };
    let mut setup = empty(RADIUS, law, pair(0.6, 0.4, 0.1));
    (setup.body, setup.energy, setup.gravity) = (body, false, gravity());
    setup.domain = Bounds { minimum: [0.0, -0.05, -0.05], maximum: [0.06, 0.05, 0.06] };
    (setup.periodic, setup.overlap_limit) = ([true, false, false], 0.9);
    let shake = Oscillate { amplitude: vec3(0.0, 0.0, 0.003), frequency: 60.0, phase: 0.0 };
    let floor = Surface::Plane { point: Vec3::zeros(), normal: Vec3::z() };
    setup.parts = vec![
        part("floor", floor, vec![shake]),
        plane("front", vec3(0.0, -0.02, 0.0), Vec3::y()),
        plane("back", vec3(0.0, 0.02, 0.0), -Vec3::y()),
    ];
    let (deep, behind) = if body == Body::Sphere { (4, -0.0126) } else { (1, 0.0) };
    let corner = vec3(0.006, behind, 0.006);
    let states = lattice([7, deep, 5], corner, 2.1 * RADIUS, RADIUS, 0.8, &mut Draw(11));
    (setup, states)
}

/// A thin cloud that falls between sheets onto a shaken floor, and out of the domain: most particles touch nobody.
fn cloud(body: Body, compatibility: Compatibility) -> (Setup, Vec<ParticleState>) {
    let (mut setup, _) = tray(body, compatibility);
    setup.domain = Bounds { minimum: [0.0, -0.1, -0.05], maximum: [0.24, 0.1, 0.17] };
    for (number, y) in [(1, -0.06), (2, 0.06)] {
        let sheet = sheet(vec3(-0.1, y, -0.05), Vec3::x() * 0.44, Vec3::z() * 0.3, 4, 3);
        setup.parts[number] = part(&setup.parts[number].name, Surface::Mesh(sheet), Vec::new());
    }
    let (deep, behind) = if body == Body::Sphere { (4, -0.04) } else { (1, 0.0) };
    let states = lattice([9, deep, 7], vec3(0.012, behind, 0.006), 0.026, RADIUS, 1.5, &mut Draw(12));
    (setup, states)
}

/// What others do to a run between its steps.
fn interfere(simulation: &mut Simulation) {
    let chosen: Vec<_> = simulation.particles().iter().step_by(9).map(|state| state.id).collect();
    match simulation.steps_done() {
        90 => assert!(simulation.displace(chosen[1], vec3(0.0, 0.0, 0.0003))),
        140 => simulation.insert(&[grain(5000, RADIUS, vec3(0.03, 0.0, 0.054), vec3(0.1, 0.0, 2.0))]),
        190 => simulation.remove_particles(&chosen[..2], RemovalCause::Asked),
        300 => simulation.prescribe(&chosen, Path::Ballistic),
        330 => release_as_they_are(simulation, &chosen),
        _ => {}
    }
}

/// Runs on to the end, undisturbed but for what is done to every run.
fn finish(mut simulation: Simulation) -> SimulationRecord {
    while simulation.steps_done() < STEPS {
        run(&mut simulation, 1);
        interfere(&mut simulation);
    }
    simulation.record()
}

fn bits(record: &SimulationRecord) -> Vec<(&str, Vec<u64>)> {
    record.reals.iter().map(|(name, column)| (*name, column.iter().map(|x| x.to_bits()).collect())).collect()
}

/// All that observers see must be the same.
fn assert_alike(late: &Simulation, whole: &Simulation) {
    let step = late.steps_done();
    let views = |simulation: &Simulation| simulation.views().collect::<Vec<ParticleView>>();
    assert!(views(late) == views(whole), "views, step {step}");
    assert!(late.stored_states().eq(whole.stored_states()), "states, step {step}");
    assert_eq!(late.rms_speed().to_bits(), whole.rms_speed().to_bits(), "step {step}");
    assert!(late.contacts() == whole.contacts(), "contacts, step {step}");
    assert_eq!(late.contact_survey(), whole.contact_survey(), "step {step}");
    assert_eq!(late.energy(), whole.energy(), "step {step}");
    assert_eq!(late.momentum_budget().momentum, whole.momentum_budget().momentum, "step {step}");
    let first: Vec<_> = late.views().take(3).map(|view| view.id).collect();
    assert_eq!(late.contacts_of(&first), whole.contacts_of(&first), "step {step}");
    assert_eq!(late.ghost_pressure(), whole.ghost_pressure(), "step {step}");
}

#[test]
fn neither_looking_nor_interfering_shows_that_a_step_is_late() {
    for body in [Body::Sphere, Body::Disc { thickness: 0.01 }] {
        for compatibility in [Compatibility::Tollgate, Compatibility::Liggghts] {
            for (scene, contacts) in [(tray as fn(_, _) -> _, 20..usize::MAX), (cloud, 4..60)] {
                let (setup, states) = scene(body, compatibility);
                let whole = Setup { momentum: true, ..setup.clone() };
                let (mut late, mut whole) = (with(setup.clone(), &states), with(whole, &states));
                let (mut records, mut most_contacts) = (Vec::new(), 0);
                while late.steps_done() < STEPS {
                    for simulation in [&mut late, &mut whole] {
                        run(simulation, 1);
                    }
                    assert_alike(&late, &whole);
                    let (record, other) = (late.record(), whole.record());
                    assert!(bits(&record) == bits(&other) && record.integers == other.integers, "record");
                    most_contacts = most_contacts.max(late.contacts().len());
                    if [70, 256, 401].contains(&late.steps_done()) {
                        records.push(record);
                    }
                    interfere(&mut late);
                    interfere(&mut whole);
                }
                let left = late.removed().iter().filter(|removal| removal.cause == RemovalCause::UpperZ).count();
                assert!(contacts.contains(&most_contacts) && left > 0, "{most_contacts} contacts, {left} left");
                let end = late.record();
                for simd in SimdLevel::ALL.into_iter().filter(|level| level.is_available()) {
                    assert!(finish(with(Setup { simd, ..setup.clone() }, &states)) == end, "not looked at, {simd:?}");
                }
                for record in &records {
                    let resumed = Simulation::resume(setup.clone(), record).expect("the same setup");
                    assert!(resumed.record() == *record, "a record of the record");
                    assert!(finish(resumed) == end, "resumed");
                }
            }
        }
    }
}
