//! Rolling, sliding, and the way from one to the other.

use super::experiment::{HERTZ, one_material, restitution};
use super::reference::{sphere_mass, static_overlap};
use super::{Case, CaseSetup, Check, Experiment, NotRun, Sample, Tolerance};
use crate::dem::law::LawSettings;
use crate::math::{Vec3, vec3};
use crate::particle::ParticleState;

pub(super) const CASES: &[Case] = &[
    Case {
        name: "incline-rolling",
        title: "sphere that rolls down an incline without slip",
        source: "rigid-body mechanics",
        run: rolling,
    },
    Case {
        name: "incline-sliding",
        title: "sphere that slides down a steep incline",
        source: "rigid-body mechanics",
        run: sliding,
    },
    Case {
        name: "slip-to-roll",
        title: "sphere set down with a speed but no spin: slides, then rolls",
        source: "rigid-body mechanics",
        run: slip_to_roll,
    },
];

pub(super) const RADIUS: f64 = 5e-3;
const DENSITY: f64 = 2500.0;
const YOUNGS_MODULUS: f64 = 1e9;
const POISSONS_RATIO: f64 = 0.25;
pub(super) const GRAVITY: f64 = 9.81;
/// 10 % of the Rayleigh time of this sphere.
const TIMESTEP: f64 = 4e-6;
const REASON: &str = "lever arm r - delta (5e-5 of r) and the swing of the tangential spring at the start";

/// A sphere of 5 mm that rests on a plane inclined by `slope` [rad], set off with `speed` [m/s] downhill and without spin.
fn roll(
    experiment: &mut dyn Experiment,
    friction: f64,
    slope: f64,
    speed: f64,
    duration: f64,
) -> Result<Vec<Sample>, NotRun> {
    let table = one_material(DENSITY, YOUNGS_MODULUS, POISSONS_RATIO, restitution(0.3), friction);
    let mut setup = CaseSetup::new(table, LawSettings { tangential_damping: true, ..HERTZ }, 20.0);
    setup.gravity = GRAVITY * vec3(slope.sin(), 0.0, -slope.cos());
    setup.add_floor(1);
    let weight = sphere_mass(RADIUS, DENSITY) * GRAVITY * slope.cos();
    let overlap = static_overlap(YOUNGS_MODULUS / (1.0 - POISSONS_RATIO.powi(2)), RADIUS, weight);
    setup.add_sphere(RADIUS, vec3(0.0, 0.0, RADIUS - overlap), vec3(speed, 0.0, 0.0), Vec3::zeros());
    setup.run_for(duration, TIMESTEP, 200);
    experiment.run(&setup)
}

/// Mean acceleration between the samples at a share of the whole run.
pub(super) fn slope_between(samples: &[Sample], from: f64, to: f64, value: impl Fn(&ParticleState) -> f64) -> f64 {
    let at = |share: f64| &samples[((samples.len() - 1) as f64 * share) as usize];
    let (first, last) = (at(from), at(to));
    (value(&last.particles[0]) - value(&first.particles[0])) / (last.time - first.time)
}

fn rolling(experiment: &mut dyn Experiment) -> Result<Vec<Check>, NotRun> {
    let mut checks = Vec::new();
    for degrees in [5.0, 20.0, 40.0_f64] {
        let slope = degrees.to_radians();
        let samples = roll(experiment, 1.0, slope, 0.0, 0.4)?;
        let acceleration = slope_between(&samples, 0.1, 1.0, |p| p.velocity.x);
        let last = &samples[samples.len() - 1].particles[0];
        let row = |quantity: &str, reference, measured, unit| Check {
            quantity: format!("{degrees} deg: {quantity}"),
            reference,
            measured,
            tolerance: Tolerance::Relative(2e-4),
            reason: REASON,
            unit,
            source: "a = 5/7 g sin theta, v = omega r",
        };
        checks.push(row("acceleration", 5.0 / 7.0 * GRAVITY * slope.sin(), acceleration, "m/s2"));
        checks.push(row("omega r / v at the end", 1.0, last.spin.y * RADIUS / last.velocity.x, "-"));
    }
    Ok(checks)
}

fn sliding(experiment: &mut dyn Experiment) -> Result<Vec<Check>, NotRun> {
    let mut checks = Vec::new();
    // rolls without slip where tan theta <= 7/2 mu: here 0.7
    for (degrees, friction) in [(40.0_f64, 0.2), (60.0, 0.2), (60.0, 0.0)] {
        let slope = degrees.to_radians();
        let samples = roll(experiment, friction, slope, 0.0, 0.4)?;
        let (along, across) = (GRAVITY * slope.sin(), GRAVITY * slope.cos());
        let row = |quantity: &str, reference, measured, tolerance, unit| Check {
            quantity: format!("{degrees} deg, mu = {friction}: {quantity}"),
            reference,
            measured,
            tolerance,
            reason: REASON,
            unit,
            source: "a = g (sin theta - mu cos theta), d omega / dt = 5 mu g cos theta / 2r",
        };
        let acceleration = slope_between(&samples, 0.1, 1.0, |p| p.velocity.x);
        let reference = along - friction * across;
        checks.push(row("acceleration", reference, acceleration, Tolerance::Relative(2e-4), "m/s2"));
        let turning = slope_between(&samples, 0.1, 1.0, |p| p.spin.y);
        let reference = 2.5 * friction * across / RADIUS;
        let tolerance = if friction == 0.0 { Tolerance::Absolute(1e-9) } else { Tolerance::Relative(2e-4) };
        checks.push(row("angular acceleration", reference, turning, tolerance, "rad/s2"));
    }
    Ok(checks)
}

fn slip_to_roll(experiment: &mut dyn Experiment) -> Result<Vec<Check>, NotRun> {
    let mut checks = Vec::new();
    for (speed, friction) in [(1.0, 0.3), (0.2, 0.1)] {
        let slip_time = 2.0 * speed / (7.0 * friction * GRAVITY);
        let samples = roll(experiment, friction, 0.0, speed, 2.0 * slip_time)?;
        let row = |quantity: &str, reference, measured, unit| Check {
            quantity: format!("v0 = {speed} m/s, mu = {friction}: {quantity}"),
            reference,
            measured,
            tolerance: Tolerance::Relative(5e-4),
            reason: REASON,
            unit,
            source: "slides with -mu g, rolls with 5/7 v0 from t = 2 v0 / (7 mu g)",
        };
        let slowing = slope_between(&samples, 0.05, 0.45, |p| p.velocity.x);
        let end = samples[samples.len() - 1].particles[0];
        checks.push(row("deceleration while it slides", -friction * GRAVITY, slowing, "m/s2"));
        checks.push(row("speed when it rolls", 5.0 / 7.0 * speed, end.velocity.x, "m/s"));
        checks.push(row("omega r / v when it rolls", 1.0, end.spin.y * RADIUS / end.velocity.x, "-"));
        // where the straight line of sliding meets the level of rolling
        let early = &samples[samples.len() / 4];
        let meets = early.time + (end.velocity.x - early.particles[0].velocity.x) / slowing;
        checks.push(row("end of sliding", slip_time, meets, "s"));
    }
    Ok(checks)
}
