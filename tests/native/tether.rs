//! Particles bound to recorded paths by tethers.

use crate::common::*;
use tollgate::dem::ghost::PrescribedMotion;
use tollgate::dem::particles::Path;
use tollgate::dem::simulation::{Setup, Simulation};
use tollgate::dem::tether::TetherLaw;
use tollgate::dem::watchdog::StopCause;
use tollgate::math::{Vec3, vec3};

const RADIUS: f64 = 0.002;
/// w2 [1/s2] and c [m].
const LAW: TetherLaw = TetherLaw { frequency_squared: 2.5e5, compliance: 0.0004 };

fn still(position: Vec3) -> PrescribedMotion {
    let none = Vec3::zeros();
    PrescribedMotion { position, velocity: none, spin: none, acceleration: none, spin_acceleration: none }
}

fn bound(setup: Setup, position: Vec3) -> Simulation {
    let mut simulation = Simulation::new(setup);
    simulation.insert_prescribed(&[(grain(0, RADIUS, position, Vec3::zeros()), Path::Recorded, still(position))]);
    simulation.tether(&[id(0)], LAW);
    simulation
}

#[test]
fn a_displaced_path_is_reached_as_by_a_critically_damped_oscillator() {
    let mut setup = empty(RADIUS, HERTZ, pair(0.5, 0.4, 0.0));
    let omega = LAW.frequency_squared.sqrt();
    setup.timestep = 1e-3 / omega;
    let timestep = setup.timestep;
    let step = 1e-3 * LAW.compliance;
    let mut simulation = bound(setup, Vec3::zeros());
    let target = still(vec3(step, 0.0, 0.0));
    simulation.steer(|_| Some(target));
    for _ in 0..5000 {
        run(&mut simulation, 1);
        let time = simulation.time();
        // x = X (1 - (1 + w t) exp(-w t)); the tether's first pull is felt one time step late, the cubic term is 1e-6 of the spring
        let expected = step * (1.0 - (1.0 + omega * time) * (-omega * time).exp());
        let got = simulation.particles()[0].position.x;
        assert!((got - expected).abs() < omega * timestep * step, "{got} {expected} at {time}");
        simulation.steer(|_| Some(target));
    }
    assert!((simulation.particles()[0].position.x - step).abs() < 0.05 * step);
}

#[test]
fn it_hangs_below_a_resting_path_where_the_hardening_spring_bears_its_weight() {
    let mut setup = empty(RADIUS, HERTZ, pair(0.5, 0.4, 0.0));
    setup.gravity = 40.0 * gravity();
    let g = -setup.gravity.z;
    let mut simulation = bound(setup, Vec3::zeros());
    let started = simulation.energy().sum();
    for _ in 0..6000 {
        run(&mut simulation, 1);
        simulation.steer(|_| Some(still(Vec3::zeros())));
    }
    let view = simulation.views().next().unwrap();
    let excursion = -view.position.z;
    // w2 e (1 + (e/c)^2) = g
    let borne = LAW.frequency_squared * excursion * (1.0 + (excursion / LAW.compliance).powi(2));
    assert!((borne - g).abs() < 1e-9 * g, "{borne} {g}");
    assert!(excursion > LAW.compliance, "well beyond the linear range: {excursion}");
    assert_eq!(view.force, Vec3::zeros(), "a tether is no contact");
    assert!(view.acceleration.norm() < 1e-6);
    let budget = simulation.energy();
    let mass = budget.gravitational / (-excursion * g);
    // at rest: all that gravity gave went into the tether
    assert!((budget.tether_work + mass * g * excursion).abs() < 1e-3 * mass * g * excursion, "{budget:?}");
    assert!((budget.sum() - started).abs() < 1e-3 * mass * g * excursion, "{budget:?}");
    assert_eq!((budget.dashpot, budget.prescribed_work), (0.0, 0.0));
    let momentum = simulation.momentum_budget();
    assert!(momentum.imbalance().norm() < 1e-12 * momentum.gravity.norm(), "{momentum:?}");
    // untied it falls, from where it is
    let place = view.position;
    simulation.untether(&[id(0)]);
    let fall_from = simulation.time();
    run(&mut simulation, 100);
    let fallen = simulation.time() - fall_from;
    let state = simulation.particles()[0];
    assert!((state.position.z - (place.z - 0.5 * g * fallen * fallen)).abs() < 1e-9, "{}", state.position.z);
    assert!(simulation.momentum_budget().imbalance().norm() < 1e-12 * momentum.gravity.norm());
}

#[test]
fn it_yields_to_a_resident_that_a_ghost_would_have_run_into() {
    // head-on at a resting sphere of a hundred times the mass: a recorded ghost would go through to full overlap
    let mut setup = empty(RADIUS, HERTZ, pair(0.5, 0.4, 0.0));
    setup.timestep *= 0.2;
    setup.skin = 0.4 * RADIUS;
    let speed = 0.05;
    let timestep = setup.timestep;
    let heavy = 5.0 * RADIUS;
    let mut simulation = with(setup, &[grain(1, heavy, vec3(heavy + 1.02 * RADIUS, 0.0, 0.0), Vec3::zeros())]);
    let at = |step: u64| PrescribedMotion {
        position: vec3(speed * (step as f64 * timestep), 0.0, 0.0),
        velocity: vec3(speed, 0.0, 0.0),
        ..still(Vec3::zeros())
    };
    simulation.insert_prescribed(&[(grain(0, RADIUS, Vec3::zeros(), at(0).velocity), Path::Recorded, at(0))]);
    simulation.tether(&[id(0)], LAW);
    let (mut deepest, mut hit) = (0.0_f64, 0);
    let steps = (0.3 * RADIUS / speed / timestep) as u64;
    for step in 1..=steps {
        run(&mut simulation, 1);
        simulation.steer(|_| Some(at(step)));
        assert!(simulation.ghost_pressure().is_empty(), "no prescribed particle is left");
        for contact in simulation.contacts() {
            deepest = deepest.max(contact.overlap);
            hit += 1;
        }
    }
    let path = at(steps).position.x;
    let behind = path - simulation.particles()[0].position.x;
    assert!(hit > 100 && deepest < 0.02 * RADIUS, "{hit} {deepest:e}");
    assert!(behind > 0.1 * RADIUS, "it was held up: {behind:e}");
    let budget = simulation.energy();
    let brought = budget.inserted;
    // sampled once a step, the work of a force that is still there lacks half a step of it
    assert!(budget.sum().abs() < 2e-3 * budget.tether_work, "{:e}: {budget:?}", budget.sum());
    assert!(budget.tether_work > brought, "the tether has pushed");
}

#[test]
fn an_excursion_that_makes_it_too_stiff_stops_the_run_in_words() {
    let setup = empty(RADIUS, HERTZ, pair(0.5, 0.4, 0.0));
    let timestep = setup.timestep;
    let mut simulation = bound(setup.clone(), Vec3::zeros());
    // w2 dt^2 (1 + 3 (e/c)^2) = 0.1 at this excursion
    let limit = LAW.compliance * ((0.1 / (LAW.frequency_squared * timestep * timestep) - 1.0) / 3.0).sqrt();
    simulation.steer(|_| Some(still(vec3(0.0, 0.0, 0.99 * limit))));
    assert!(simulation.step().is_ok());
    simulation = bound(setup, Vec3::zeros());
    simulation.steer(|_| Some(still(vec3(0.0, 0.0, 1.01 * limit))));
    let stop = simulation.step().unwrap_err();
    assert_eq!((stop.cause, stop.particle), (StopCause::StiffTether, Some(id(0))));
    assert!(stop.to_string().contains("off its recorded path"), "{stop}");
}
