//! Conservation: energy, momentum, angular momentum.

use crate::common::*;
use tollgate::dem::energy::EnergyBudget;
use tollgate::dem::law::{LawSettings, RollingLaw, TangentialLaw};
use tollgate::dem::simulation::Simulation;
use tollgate::geometry::motion::MotionKind::Rotate;
use tollgate::geometry::part::Surface;
use tollgate::material::Elasticity;
use tollgate::math::{Bounds, Vec3, vec3};

const RADIUS: f64 = 0.005;

/// A hopper over a paddle that turns, filled in the air; particles leave through the lower border. The time step is `share` of
/// the Rayleigh time.
fn hopper(layers: u64, law: LawSettings, share: f64) -> Simulation {
    let mut setup = empty(RADIUS, law, pair(0.5, 0.4, 0.05));
    setup.timestep = rayleigh_share(share, RADIUS);
    setup.gravity = gravity();
    setup.overlap_limit = 0.6;
    setup.domain = Bounds { minimum: [-0.5, -0.5, -0.12], maximum: [0.5, 0.5, 3.0] };
    let cone = |z: f64, r: f64, top: f64, wide: f64| Surface::Frustum {
        start: vec3(0.0, 0.0, z),
        end: vec3(0.0, 0.0, top),
        start_radius: r,
        end_radius: wide,
    };
    let paddle = sheet(vec3(-0.03, -0.03, -0.07), vec3(0.06, 0.0, 0.0), vec3(0.0, 0.06, 0.04), 4, 3);
    let turn = Rotate { origin: vec3(0.0, 0.0, -0.05), axis: vec3(0.0, 1.0, 0.0), rate: 15.0 };
    setup.parts = vec![
        part("cone", cone(0.0, 0.045, 0.08, 0.125), Vec::new()),
        part("silo", cone(0.08, 0.125, 2.0, 0.125), Vec::new()),
        part("paddle", Surface::Mesh(paddle), vec![turn]),
    ];
    let cloud = lattice([22, 22, layers], vec3(-0.111, -0.111, 0.09), 2.1 * RADIUS, RADIUS, 0.3, &mut Draw(5));
    let cloud: Vec<_> = cloud.into_iter().filter(|p| p.position.xy().norm() < 0.118).collect();
    with(setup, &cloud)
}

/// Runs for `time` [s], looks at the budget often, and returns the largest wander of its sum over the dissipation, with the end.
fn wander(simulation: &mut Simulation, time: f64) -> (f64, EnergyBudget) {
    const LOOKS: u64 = 40;
    let start = simulation.energy().sum();
    let steps = (time / simulation.setup().timestep) as u64;
    let mut worst = 0.0_f64;
    for _ in 0..LOOKS {
        run(simulation, steps / LOOKS);
        worst = worst.max((simulation.energy().sum() - start).abs());
    }
    let end = simulation.energy();
    let share = worst / end.dissipated();
    (share, end)
}

#[test]
fn the_budget_of_an_emptying_hopper_closes() {
    let mut simulation = hopper(13, HERTZ, 0.08);
    assert!(simulation.particle_count() > 5000);
    let (share, end) = wander(&mut simulation, 0.3);
    assert!(simulation.removed().len() > 100, "it empties");
    assert!(end.wall_work != 0.0 && end.slip > 0.0 && end.dashpot > 0.0 && end.removed != 0.0, "{end:?}");
    assert!(share < 1e-3, "{share:e}");
}

#[test]
fn without_friction_springs_hold_what_normal_forces_stored() {
    let radius = RADIUS;
    let mut simulation = with(empty(radius, HERTZ, pair(0.9, 0.0, 0.0)), &[]);
    let overlap = 1e-5;
    let other = vec3(2.0 * radius - overlap, 0.0, 0.0);
    simulation.insert(&[grain(1, radius, Vec3::zeros(), Vec3::zeros()), grain(2, radius, other, vec3(0.0, 0.5, 0.0))]);
    simulation.prepare();
    // 8/15 E* sqrt(R*) d^(5/2), with E* = E / (2 (1 - nu^2)) and R* = r / 2
    let setup = simulation.setup();
    let Some(Elasticity::Isotropic { youngs_modulus, poissons_ratio }) = setup.materials.materials[0].elasticity else {
        panic!("the grains are elastic")
    };
    let modulus = 0.5 * youngs_modulus / (1.0 - poissons_ratio * poissons_ratio);
    let expected = 8.0 / 15.0 * modulus * (0.5 * radius).sqrt() * overlap.powf(2.5);
    let elastic = simulation.energy().elastic;
    // the overlap is a difference of lengths a thousand times longer: 1e-13 of it, 2.5 times that of the energy
    assert!((elastic / expected - 1.0).abs() < 1e-12, "{elastic:e} {expected:e}");
}

#[test]
fn the_budget_closes_with_every_law_and_better_with_shorter_steps() {
    let total = LawSettings { tangential: TangentialLaw::Total, ..HERTZ };
    let epsd2 = LawSettings { rolling: RollingLaw::Epsd2, ..HERTZ };
    for law in [HERTZ, total, epsd2, LINEAR] {
        let (coarse, end) = wander(&mut hopper(2, law, 0.16), 0.25);
        let (fine, _) = wander(&mut hopper(2, law, 0.08), 0.25);
        assert!(fine < 1e-3, "{law:?}: {fine:e}");
        // what is left is the error of the time step, of second order: a quarter; half leaves room for another course of events
        assert!(fine < 0.5 * coarse, "{law:?}: {coarse:e} {fine:e}");
        if law == LINEAR {
            assert_eq!(end.law_residual, 0.0, "a linear spring makes nothing");
        }
    }
}

#[test]
fn a_closed_system_keeps_momentum_and_angular_momentum() {
    let law = LawSettings { rolling: RollingLaw::Epsd2, ..HERTZ };
    let setup = empty(RADIUS, law, pair(0.5, 0.4, 0.1));
    let mut cloud = lattice([10, 10, 10], Vec3::repeat(-0.06), 2.4 * RADIUS, RADIUS, 0.4, &mut Draw(12));
    for (k, state) in cloud.iter_mut().enumerate() {
        state.radius *= [1.0, 0.8, 0.5][k % 3];
        // towards the middle, so that they meet, and round about it
        state.velocity += -20.0 * state.position + vec3(1.0, -2.0, 3.0).cross(&state.position) + vec3(0.1, 0.2, -0.3);
    }
    let mut simulation = with(setup, &cloud);
    let measure = |simulation: &Simulation| {
        let (mut linear, mut angular, mut scale, mut turn) = (Vec3::zeros(), Vec3::zeros(), 0.0, 0.0);
        for state in simulation.particles() {
            let mass = DENSITY * 4.0 / 3.0 * std::f64::consts::PI * state.radius.powi(3);
            linear += state.velocity * mass;
            let own = 0.4 * mass * state.radius.powi(2) * state.spin;
            angular += state.position.cross(&state.velocity) * mass + own;
            scale += mass * state.velocity.norm();
            turn += mass * state.position.norm() * state.velocity.norm() + own.norm();
        }
        (linear, angular, scale, turn)
    };
    let (linear, angular, scale, turn) = measure(&simulation);
    run(&mut simulation, 3000);
    let (end, turned, ..) = measure(&simulation);
    assert!(simulation.energy().dissipated() > 0.05 * simulation.energy().inserted, "they have collided");
    assert!((end - linear).norm() < 1e-12 * scale, "{:e}", (end - linear).norm() / scale);
    // the lever arms of a pair add up to its distance, so a pair's torques balance exactly; sums of round-off remain
    assert!((turned - angular).norm() < 1e-12 * turn, "{:e}", (turned - angular).norm() / turn);
}
