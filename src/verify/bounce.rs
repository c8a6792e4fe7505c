//! A sphere dropped on a plane: the free-fall and bouncing cases of Garg et al. (2012), against the solution that
//! keeps gravity while in contact.

use super::experiment::LINEAR;
use super::reference::{Bounce, damping_ratio, sphere_mass};
use super::{Case, CaseSetup, Check, Experiment, NotRun, Sample, Tolerance};
use crate::material::{Material, MaterialTable, PairContact, PairProperties};
use crate::math::{Vec3, vec3};

pub(super) const CASES: &[Case] = &[
    Case {
        name: "mfix-dem01",
        title: "freely falling sphere, first contact and rebound",
        source: "Garg et al. 2012, case DEM01",
        run: first_contact,
    },
    Case {
        name: "mfix-dem02",
        title: "bouncing sphere, heights of five successive bounces",
        source: "Garg et al. 2012, case DEM02",
        run: successive_bounces,
    },
];

const RELEASE_HEIGHT: f64 = 0.5;

fn bounce(stiffness: f64, restitution: f64) -> Bounce {
    let mass = sphere_mass(0.1, 2600.0);
    let damping = 2.0 * damping_ratio(restitution) * (stiffness * mass).sqrt();
    Bounce { radius: 0.1, mass, stiffness, damping, gravity: 9.80665 }
}

/// Drops the sphere and samples every `sample_every` steps of 1/1500 of the elastic contact.
fn drop_sphere(
    experiment: &mut dyn Experiment,
    bounce: &Bounce,
    duration: f64,
    sample_every: u64,
) -> Result<Vec<Sample>, NotRun> {
    let mut materials = MaterialTable::new(vec![
        Material { name: "sphere".into(), density: Some(2600.0), elasticity: None },
        Material { name: "plane".into(), density: None, elasticity: None },
    ]);
    let contact = PairContact::Stiffness {
        normal_stiffness: bounce.stiffness,
        tangential_stiffness: 2.0 / 7.0 * bounce.stiffness,
        normal_damping: bounce.damping,
        tangential_damping: 0.0,
    };
    let pair = PairProperties { contact, sliding_friction: 0.0, rolling_friction: 0.0 };
    materials.set_pair(0, 0, pair);
    materials.set_pair(0, 1, pair);
    let mut setup = CaseSetup::new(materials, LINEAR, 1.0);
    setup.gravity = vec3(0.0, 0.0, -bounce.gravity);
    // the softest case is pressed flat almost to its centre: meant so by the published case
    setup.overlap_limit = 1.0;
    setup.add_floor(1);
    setup.add_sphere(bounce.radius, vec3(0.0, 0.0, RELEASE_HEIGHT), Vec3::zeros(), Vec3::zeros());
    setup.timestep = std::f64::consts::PI * (bounce.mass / bounce.stiffness).sqrt() / 1500.0;
    setup.steps = (duration / setup.timestep).ceil() as u64;
    setup.steps = setup.steps.div_ceil(sample_every) * sample_every;
    setup.sample_every = sample_every;
    experiment.run(&setup)
}

fn first_contact(experiment: &mut dyn Experiment) -> Result<Vec<Check>, NotRun> {
    let mut checks = Vec::new();
    for (stiffness, e) in
        [(1e4, 0.9), (1e4, 0.6), (2.5e4, 1.0), (2.5e4, 0.8), (5e4, 0.9), (5e4, 0.6), (1e5, 1.0), (1e5, 0.7)]
    {
        let bounce = bounce(stiffness, e);
        let fall = (2.0 * (RELEASE_HEIGHT - bounce.radius) / bounce.gravity).sqrt();
        let touch = bounce.gravity * fall;
        let samples = drop_sphere(experiment, &bounce, fall + 2.0 * bounce.contact_duration(-touch), 5)?;
        let worst = |part: fn((f64, f64)) -> f64, measured: fn(&Sample) -> f64| {
            let difference = |s: &Sample| (measured(s) - part(bounce.state(RELEASE_HEIGHT, s.time))).abs();
            samples.iter().map(difference).fold(0.0, |a: f64, b| if b.is_nan() { b } else { a.max(b) })
        };
        let row = |quantity: &str, measured, scale: f64, unit| Check {
            quantity: format!("k = {stiffness:.1e} N/m, e = {e}: {quantity}"),
            reference: 0.0,
            measured,
            tolerance: Tolerance::Absolute(1e-3 * scale),
            reason: "bar of the suite: 1e-3 of radius and impact speed at 1500 steps per contact",
            unit,
            source: "free fall, damped oscillator with gravity, free flight",
        };
        let height = worst(|state| state.0, |s| s.particles[0].position.z);
        let speed = worst(|state| state.1, |s| s.particles[0].velocity.z);
        checks.push(row("largest error of the height", height, bounce.radius, "m"));
        checks.push(row("largest error of the velocity", speed, touch, "m/s"));
    }
    Ok(checks)
}

fn successive_bounces(experiment: &mut dyn Experiment) -> Result<Vec<Check>, NotRun> {
    const BOUNCES: usize = 5;
    let mut checks = Vec::new();
    for (stiffness, e) in [(5e4, 1.0), (5e4, 0.9), (5e5, 0.9), (5e5, 0.7), (5e6, 1.0), (5e6, 0.8)] {
        let bounce = bounce(stiffness, e);
        let expected = bounce.apexes(RELEASE_HEIGHT, BOUNCES);
        let flights: f64 =
            expected.iter().map(|apex| 2.0 * (2.0 * (apex - bounce.radius) / bounce.gravity).sqrt()).sum();
        let samples = drop_sphere(experiment, &bounce, flights + 0.5, 300)?;
        for (k, (&reference, measured)) in expected.iter().zip(apexes(&samples, &bounce)).enumerate() {
            checks.push(Check {
                quantity: format!("k = {stiffness:.1e} N/m, e = {e}: top of bounce {}", k + 1),
                reference,
                measured,
                tolerance: Tolerance::Relative(1e-3),
                reason: "bar of the suite; the dashpot starts with a jump: first order, 1500 steps per contact",
                unit: "m",
                source: "damped oscillator with gravity, bounce after bounce",
            });
        }
        if checks.len() % BOUNCES != 0 {
            return Err(format!("fewer than {BOUNCES} bounces seen at k = {stiffness:e} N/m, e = {e}").into());
        }
    }
    Ok(checks)
}

/// Height of the top of each bounce, z + v^2 / 2g from the first sample of every rising flight.
fn apexes(samples: &[Sample], bounce: &Bounce) -> Vec<f64> {
    let state = |s: &Sample| (s.particles[0].position.z, s.particles[0].velocity.z);
    let rising = |s: &Sample| state(s).0 > bounce.radius && state(s).1 > 0.0;
    samples
        .windows(2)
        .filter(|pair| !rising(&pair[0]) && rising(&pair[1]))
        .map(|pair| {
            let (height, speed) = state(&pair[1]);
            height + speed * speed / (2.0 * bounce.gravity)
        })
        .collect()
}
