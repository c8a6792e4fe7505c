//! Order of convergence in the time step: a sphere that stays in contact and swings, so that no impact disturbs the order.

use super::experiment::{HERTZ, LINEAR, one_material, restitution};
use super::reference::{damping_ratio, runge_kutta, sphere_mass, static_overlap};
use super::{Case, CaseSetup, Check, Experiment, NotRun, Tolerance};
use crate::dem::law::{LawSettings, NormalLaw};
use crate::math::{Vec3, vec3};

pub(super) const CASES: &[Case] = &[Case {
    name: "order-in-timestep",
    title: "swing of a sphere on an elastic plane: error against the time step",
    source: "velocity-Verlet is of second order",
    run: order,
}];

const RADIUS: f64 = 0.01;
const DENSITY: f64 = 2500.0;
const YOUNGS_MODULUS: f64 = 1e7;
const POISSONS_RATIO: f64 = 0.3;
const GRAVITY: f64 = 9.81;

fn order(experiment: &mut dyn Experiment) -> Result<Vec<Check>, NotRun> {
    let mut checks = Vec::new();
    for (name, law, e) in [("linear", LINEAR, 1.0), ("Hertz", HERTZ, 1.0), ("Hertz, damped", HERTZ, 0.8)] {
        let mut heights = Vec::new();
        for parts in [50.0, 100.0, 200.0, 400.0] {
            heights.push(swing(experiment, law, e, parts)?);
        }
        // three halvings and no outside reference: differences of neighbours shrink by 2^order
        let (coarse, fine) = (heights[1] - heights[0], heights[3] - heights[2]);
        let measured = (coarse / fine).abs().log2() / 2.0;
        let undamped = e >= 1.0;
        checks.push(Check {
            quantity: format!("{name}: order from 50 to 400 steps per swing"),
            reference: if undamped { 2.0 } else { 1.0 },
            measured,
            tolerance: if undamped { Tolerance::Absolute(0.1) } else { Tolerance::AtLeast },
            reason: "next term of the error: 1 % at the coarsest step; a dashpot may cost one order",
            unit: "-",
            source: "self-convergence",
        });
        if law.normal == NormalLaw::HertzMindlin {
            let amplitude = 0.5 * rest_overlap();
            checks.push(Check {
                quantity: format!("{name}: height after 3.3 swings, 400 steps per swing"),
                reference: exact_height(e),
                measured: heights[3],
                tolerance: Tolerance::Absolute(if undamped { 2e-3 } else { 1e-2 } * amplitude),
                reason: "phase error 2 pi 3.3 (omega dt)^2 / 24 = 2e-4 of the amplitude; first order with the dashpot",
                unit: "m",
                source: "equation of motion, Runge-Kutta",
            });
        }
    }
    Ok(checks)
}

fn modulus() -> f64 {
    YOUNGS_MODULUS / (1.0 - POISSONS_RATIO * POISSONS_RATIO)
}

fn rest_overlap() -> f64 {
    static_overlap(modulus(), RADIUS, sphere_mass(RADIUS, DENSITY) * GRAVITY)
}

/// Period of small swings about the rest position on Hertz's spring [s].
fn period() -> f64 {
    let tangent = 2.0 * modulus() * (RADIUS * rest_overlap()).sqrt();
    2.0 * std::f64::consts::PI * (sphere_mass(RADIUS, DENSITY) / tangent).sqrt()
}

/// Starts half the rest overlap too high and ends after 3.3 periods, between the turning points.
fn swing(experiment: &mut dyn Experiment, law: LawSettings, e: f64, parts: f64) -> Result<f64, NotRun> {
    let table = one_material(DENSITY, YOUNGS_MODULUS, POISSONS_RATIO, restitution(e), 0.0);
    let mut setup = CaseSetup::new(table, LawSettings { characteristic_velocity: 0.05, ..law }, 1.0);
    setup.gravity = vec3(0.0, 0.0, -GRAVITY);
    setup.add_floor(1);
    setup.add_sphere(RADIUS, vec3(0.0, 0.0, RADIUS - 0.5 * rest_overlap()), Vec3::zeros(), Vec3::zeros());
    setup.timestep = period() / parts;
    setup.steps = (3.3 * parts).round() as u64;
    setup.sample_every = setup.steps;
    let samples = experiment.run(&setup)?;
    samples.last().and_then(|s| s.particles.first()).map(|p| p.position.z).ok_or_else(|| "no state came back".into())
}

fn exact_height(e: f64) -> f64 {
    let mass = sphere_mass(RADIUS, DENSITY);
    let damping = 2.0 * (5.0_f64 / 6.0).sqrt() * damping_ratio(e);
    let rates = |y: &[f64; 2]| {
        let tangent = 2.0 * modulus() * (RADIUS * y[0].max(0.0)).sqrt();
        let force = 2.0 / 3.0 * tangent * y[0] + damping * (tangent * mass).sqrt() * y[1];
        [y[1], GRAVITY - force / mass]
    };
    let steps = 100_000;
    let step = 3.3 * period() / f64::from(steps);
    let end = (0..steps).fold([0.5 * rest_overlap(), 0.0], |state, _| runge_kutta(&rates, &state, step));
    RADIUS - end[0]
}
