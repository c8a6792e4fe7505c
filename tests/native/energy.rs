//! Conservation: energy, momentum, angular momentum.

use crate::common::*;
use tollgate::dem::energy::EnergyBudget;
use tollgate::dem::law::{LawSettings, NormalLaw, TangentialLaw};
use tollgate::dem::simulation::{Setup, Simulation};
use tollgate::geometry::motion::MotionKind::Rotate;
use tollgate::geometry::part::Surface;
use tollgate::math::{Bounds, Vec3, vec3};

const RADIUS: f64 = 0.005;

/// A hopper of planes' slopes over a paddle that turns, filled in the air; particles leave through the lower border.
fn hopper(layers: u64, law: LawSettings, share: f64) -> Simulation {
    let mut setup = empty(RADIUS, law, pair(0.5, 0.4, 0.0));
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

/// Runs, looks at the budget `looks` times, and returns the largest wander of its sum over what was dissipated, with the end.
fn wander(simulation: &mut Simulation, steps: u64, looks: u64) -> (f64, EnergyBudget) {
    let start = simulation.energy().sum();
    let mut worst = 0.0_f64;
    for _ in 0..looks {
        run(simulation, steps / looks);
        worst = worst.max((simulation.energy().sum() - start).abs());
    }
    let end = simulation.energy();
    println!("particles {} left {} wander {:.3e} of {:?}", simulation.particle_count(), simulation.removed().len(), worst / end.dissipated(), end);
    (worst / end.dissipated(), end)
}

#[test]
fn tune() {
    for (name, law) in [("hertz inc", HERTZ), ("hertz total", LawSettings { tangential: TangentialLaw::Total, ..HERTZ }), ("linear", LINEAR)] {
        for share in [0.05, 0.1, 0.15] {
            let mut simulation = hopper(4, law, share);
            let steps = (0.4 / simulation.setup().timestep) as u64;
            println!("{name} {share} {steps}");
            wander(&mut simulation, steps, 40);
        }
    }
}
#[expect(dead_code)]
fn x(_: Setup, _: NormalLaw, _: Vec3) {}
