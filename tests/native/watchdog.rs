//! The watchdog stops what must be stopped and nothing else; parts come and go when they should.

use crate::common::*;
use tollgate::dem::simulation::{Setup, Simulation};
use tollgate::dem::watchdog::{Stop, StopCause};
use tollgate::geometry::part::{AtRest, Trigger};
use tollgate::math::{Bounds, Vec3, vec3};

const RADIUS: f64 = 0.005;

fn until_stop(simulation: &mut Simulation, steps: u64) -> Option<Stop> {
    (0..steps).find_map(|_| simulation.step().err())
}

fn scene(restitution: f64) -> Setup {
    empty(RADIUS, HERTZ, pair(restitution, 0.3, 0.0))
}

#[test]
fn each_trouble_is_stopped_by_its_name_with_the_particle() {
    // a velocity, a place, and two centres in the same place
    let still = |serial, x: f64| grain(serial, RADIUS, vec3(x, 0.0, 0.0), Vec3::zeros());
    let mut bad_velocity = still(3, 0.1);
    bad_velocity.velocity.y = f64::NAN;
    let mut bad_place = still(3, 0.1);
    bad_place.position.z = f64::NAN;
    let mut infinite = still(3, 0.1);
    infinite.spin.x = f64::INFINITY;
    for bad in [bad_velocity, bad_place, infinite] {
        let mut simulation = with(scene(0.5), &[still(1, 0.0), bad, still(5, 0.2)]);
        let stop = until_stop(&mut simulation, 3).expect("it stops");
        assert_eq!((stop.cause, stop.particle), (StopCause::NotANumber, Some(id(3))), "{stop}");
    }
    let mut simulation = with(scene(0.5), &[still(1, 0.0), still(2, 0.1), still(7, 0.1)]);
    let stop = until_stop(&mut simulation, 3).expect("it stops");
    assert_eq!(stop.cause, StopCause::NotANumber, "{stop}");
    assert!([Some(id(2)), Some(id(7))].contains(&stop.particle), "{stop}");

    // 40 % of the smaller radius, the limit is 30 %
    let mut simulation = with(scene(0.5), &[still(1, 0.0), still(2, 0.1), still(7, 0.1 + 1.6 * RADIUS)]);
    let stop = until_stop(&mut simulation, 3).expect("it stops");
    assert_eq!(stop.cause, StopCause::DeepOverlap, "{stop}");
    assert!([Some(id(2)), Some(id(7))].contains(&stop.particle), "{stop}");
    let mut setup = scene(0.5);
    setup.parts = vec![plane("floor", Vec3::zeros(), Vec3::z())];
    let mut simulation = with(setup, &[grain(4, RADIUS, vec3(0.0, 0.0, 0.6 * RADIUS), Vec3::zeros())]);
    let stop = until_stop(&mut simulation, 3).expect("it stops");
    assert_eq!((stop.cause, stop.particle), (StopCause::DeepOverlap, Some(id(4))), "{stop}");
    assert!(stop.what.contains("'floor'"), "{stop}");

    // half a radius in one step
    let setup = scene(0.5);
    let speed = 0.6 * RADIUS / setup.timestep;
    let mut simulation = with(setup, &[still(1, 0.0), grain(6, RADIUS, vec3(0.0, 0.1, 0.0), vec3(0.0, speed, 0.0))]);
    let stop = until_stop(&mut simulation, 3).expect("it stops");
    assert_eq!((stop.cause, stop.particle), (StopCause::FastParticle, Some(id(6))), "{stop}");
}

#[test]
fn a_late_step_is_stopped_as_one_that_is_completed_at_its_end() {
    let still = |serial, x: f64| grain(serial, RADIUS, vec3(x, 0.0, 0.0), Vec3::zeros());
    let fast = |speed: f64| grain(6, RADIUS, vec3(0.0, 0.1, 0.0), vec3(0.0, speed, 0.0));
    // numbers with squares that are none, no numbers, one that is merely fast, and one that brings no trouble
    let troubles = [fast(1e160), fast(1e303), fast(f64::INFINITY), fast(f64::NAN), fast(1e3), still(7, 0.05)];
    for trouble in troubles {
        let states = [still(1, 0.0), still(2, 0.1), trouble];
        let stopped = |momentum: bool| {
            let mut simulation = with(Setup { energy: false, momentum, ..scene(0.5) }, &states);
            let stop = until_stop(&mut simulation, 3).unwrap_or_else(|| {
                // centre on centre: their force is not a number
                assert!(simulation.displace(id(7), vec3(0.05, 0.0, 0.0)));
                until_stop(&mut simulation, 1).expect("it stops")
            });
            let bits = |(_, column): &(_, Vec<f64>)| column.iter().map(|x| x.to_bits()).collect::<Vec<u64>>();
            (stop, simulation.record().reals.iter().map(bits).collect::<Vec<_>>())
        };
        // accounts of momentum are kept within each step
        assert_eq!(stopped(false), stopped(true));
    }
}

/// A gas in a periodic box.
fn gas(
    restitution: f64,
    law: tollgate::dem::law::LawSettings,
    friction: f64,
    timestep_factor: f64,
    speed: f64,
) -> Simulation {
    // how deep they meet is not the question
    let mut setup = empty(RADIUS, law, pair(restitution, friction, 0.0));
    setup.domain = Bounds { minimum: [0.0; 3], maximum: [0.06; 3] };
    setup.periodic = [true; 3];
    setup.timestep *= timestep_factor;
    setup.overlap_limit = 1.9;
    let cloud = lattice([4, 4, 4], Vec3::repeat(0.0075), 3.0 * RADIUS, RADIUS, speed, &mut Draw(31));
    with(setup, &cloud)
}

#[test]
fn energy_from_nothing_is_stopped() {
    // contacts that last about two time steps: what comes out depends on where within a step they began
    let contact = std::f64::consts::PI / {
        let simulation = gas(1.0, LINEAR, 0.0, 1.0, 1.0);
        let mass: f64 = 1.0 / (2.0 / (DENSITY * 4.0 / 3.0 * std::f64::consts::PI * RADIUS.powi(3)));
        let modulus = YOUNGS_MODULUS / (2.0 * (1.0 - POISSONS_RATIO.powi(2)));
        let stiffness = tollgate::dem::timescale::linear_stiffness(mass, 0.5 * RADIUS, modulus, 1.0);
        drop(simulation);
        (stiffness / mass).sqrt()
    };
    let base = empty(RADIUS, LINEAR, pair(1.0, 0.0, 0.0)).timestep;
    let mut simulation = gas(1.0, LINEAR, 0.0, contact / 2.2 / base, 0.2);
    let stop = until_stop(&mut simulation, 50_000).expect("it stops");
    assert_eq!(stop.cause, StopCause::EnergyFromNothing, "{stop}");
    assert!(stop.particle.is_some());
}

#[test]
fn a_stable_gas_without_losses_runs_on() {
    for (law, friction) in [(HERTZ, 0.0), (LINEAR, 0.0), (HERTZ, 0.3)] {
        let mut simulation = gas(1.0, law, friction, 1.0, 1.0);
        let start = simulation.energy();
        run(&mut simulation, 60_000);
        let end = simulation.energy();
        println!(
            "mechanical {:e} of {:e}, sum {:e}",
            end.mechanical() - start.mechanical(),
            start.mechanical(),
            end.sum() - start.sum()
        );
        if friction == 0.0 {
            // some hundred collisions a particle, each with an error of 1e-4 of either sign
            assert!((end.mechanical() - start.mechanical()).abs() < 0.02 * start.mechanical(), "{end:?}");
        }
    }
}

#[test]
fn parts_appear_at_their_time_and_disappear_at_rest() {
    let mut setup = scene(0.3);
    setup.gravity = gravity();
    setup.domain.minimum[2] = -0.2;
    // the books close with the square of the time step
    setup.timestep *= 0.5;
    let mut gate = plane("gate", Vec3::zeros(), Vec3::z());
    let rest = AtRest { speed: 1e-3, hold: 0.02, not_before: 0.05 };
    gate.disappears = Trigger::AtRest(rest);
    let mut net = plane("net", vec3(0.0, 0.0, -0.05), Vec3::z());
    net.appears = Trigger::At { time: 0.1 };
    setup.parts = vec![gate, net];
    let timestep = setup.timestep;
    let mut simulation = with(setup, &[grain(0, RADIUS, vec3(0.0, 0.0, 1.5 * RADIUS), Vec3::zeros())]);
    let start = simulation.energy().sum();
    let mut slow_since = None;
    let mut opened = None;
    while simulation.time() < 0.6 {
        run(&mut simulation, 1);
        let speed = simulation.rms_speed();
        if opened.is_none() {
            slow_since = if speed < rest.speed { slow_since.or(Some(simulation.time())) } else { None };
            opened = simulation.part_events().iter().find(|event| event.part == 0).map(|event| event.time);
        }
    }
    let opened = opened.expect("the gate opens");
    let since = slow_since.expect("it was slow").max(0.0);
    // it is looked at twenty times within the hold time
    let look = rest.hold / 20.0 + 2.0 * timestep;
    assert!(opened >= rest.not_before && opened >= since + rest.hold - timestep, "{opened} {since}");
    assert!(opened <= (since + rest.hold).max(rest.not_before + rest.hold) + 2.0 * look, "{opened} {since}");
    let net = simulation.part_events().iter().find(|event| event.part == 1).expect("the net comes");
    assert!((net.time - 0.1).abs() <= timestep && net.present);
    let state = simulation.particles()[0];
    assert!(
        (state.position.z + 0.05 - RADIUS).abs() < 0.05 * RADIUS,
        "it fell through the gate and lies on the net: {state:?}"
    );
    let budget = simulation.energy();
    assert!((budget.sum() - start).abs() < 1e-3 * budget.dissipated(), "{:e} {budget:?}", budget.sum() - start);
}
