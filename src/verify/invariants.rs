//! What no time step may break: momentum, and indifference to the observer, to mirrors and to numbering.

use super::experiment::{HERTZ, LINEAR, one_material, restitution};
use super::{Case, CaseSetup, Check, Experiment, NotRun, Tolerance};
use crate::dem::law::{LawSettings, TangentialLaw};
use crate::math::{Vec3, vec3};
use crate::particle::{ParticleId, ParticleState};

pub(super) const CASES: &[Case] = &[
    Case {
        name: "momentum",
        title: "momentum and angular momentum of a closed cloud of colliding spheres",
        source: "Newton's third law",
        run: |experiment| momentum(experiment, &LAWS),
    },
    Case {
        name: "momentum-incremental",
        title: "momentum and angular momentum with the incremental tangential law",
        source: "Newton's third law",
        run: |experiment| momentum(experiment, &INCREMENTAL),
    },
    Case {
        name: "galilean-shift",
        title: "the same cloud seen from a moving frame",
        source: "Galilean invariance",
        run: |experiment| galilean_shift(experiment, &LAWS),
    },
    Case {
        name: "galilean-shift-incremental",
        title: "the cloud from a moving frame with the incremental tangential law",
        source: "Galilean invariance",
        run: |experiment| galilean_shift(experiment, &INCREMENTAL),
    },
    Case {
        name: "mirror",
        title: "the mirrored cloud",
        source: "mirror symmetry",
        run: |experiment| mirror(experiment, &LAWS),
    },
    Case {
        name: "mirror-incremental",
        title: "the mirrored cloud with the incremental tangential law",
        source: "mirror symmetry",
        run: |experiment| mirror(experiment, &INCREMENTAL),
    },
    Case {
        name: "renumbering",
        title: "the same cloud with its particles numbered backwards",
        source: "indifference to numbering",
        run: |experiment| renumbering(experiment, &LAWS),
    },
    Case {
        name: "renumbering-incremental",
        title: "the cloud numbered backwards with the incremental tangential law",
        source: "indifference to numbering",
        run: |experiment| renumbering(experiment, &INCREMENTAL),
    },
];

type NamedLaw = (&'static str, LawSettings);

const LAWS: [NamedLaw; 2] = [
    ("Hertz, total", LawSettings { tangential_damping: true, ..HERTZ }),
    ("linear", LawSettings { tangential_damping: true, attraction: false, ..LINEAR }),
];
const INCREMENTAL: [NamedLaw; 1] =
    [("Hertz, incremental", LawSettings { tangential: TangentialLaw::Incremental, ..HERTZ })];

const SYMMETRY_REASON: &str = "round-off (1e-16 of the extent) grown by the collisions of a short run";
/// Largest difference [m] that counts as the same: 1e-10 of a diameter.
const SAME: f64 = 1e-12;

/// 64 spheres of 4 to 6 mm that fly towards their common centre with spins, and collide several times.
fn cloud(law: LawSettings) -> CaseSetup {
    let table = one_material(2500.0, 1e7, 0.3, restitution(0.7), 0.4);
    let mut setup = CaseSetup::new(table, law, 1.0);
    let mut draw = halton();
    for k in 0..64 {
        let cell = vec3(f64::from(k % 4), f64::from(k / 4 % 4), f64::from(k / 16)) - Vec3::repeat(1.5);
        let position = 6.5e-3 * cell + 0.2e-3 * draw();
        let velocity = -40.0 * position + 0.2 * draw();
        let radius = 2.0e-3 + 1e-3 * (0.5 + 0.5 * draw().x);
        setup.add_sphere(radius, position, velocity, 50.0 * draw());
    }
    setup.run_for(0.02, 5e-6, 1);
    setup
}

/// Vectors in the cube -1..1, evenly spread and the same at every call (Halton sequence in bases 2, 3, 5).
fn halton() -> impl FnMut() -> Vec3 {
    let mut index = 0_u32;
    move || {
        index += 1;
        let component = |base: u32| {
            let (mut rest, mut share, mut value) = (index, 1.0, 0.0);
            while rest > 0 {
                share /= f64::from(base);
                value += share * f64::from(rest % base);
                rest /= base;
            }
            2.0 * value - 1.0
        };
        vec3(component(2), component(3), component(5))
    }
}

fn end(experiment: &mut dyn Experiment, setup: &CaseSetup) -> Result<Vec<ParticleState>, NotRun> {
    let samples = experiment.run(setup)?;
    let last = samples.last().map(|s| s.particles.clone()).unwrap_or_default();
    if last.len() != setup.particles.len() {
        return Err(format!("{} of {} particles came back", last.len(), setup.particles.len()).into());
    }
    let kick = |(a, b): (&ParticleState, &ParticleState)| (a.velocity - b.velocity).norm() > 1e-3;
    if last.iter().zip(&setup.particles).filter(|&pair| kick(pair)).count() < setup.particles.len() / 2 {
        return Err("too few of the spheres collided".into());
    }
    Ok(last)
}

fn momentum(experiment: &mut dyn Experiment, laws: &[NamedLaw]) -> Result<Vec<Check>, NotRun> {
    let mut checks = Vec::new();
    for &(name, law) in laws {
        let setup = cloud(law);
        let after = end(experiment, &setup)?;
        let mass = |p: &ParticleState| setup.body.mass(p.radius, p.density);
        let linear = |p: &ParticleState| mass(p) * p.velocity;
        let angular = |p: &ParticleState| p.position.cross(&linear(p)) + 0.4 * mass(p) * p.radius.powi(2) * p.spin;
        let total = |states: &[ParticleState], of: &dyn Fn(&ParticleState) -> Vec3| states.iter().map(of).sum::<Vec3>();
        let size = |of: &dyn Fn(&ParticleState) -> Vec3| setup.particles.iter().map(|p| of(p).norm()).sum::<f64>();
        let mut row = |quantity: &str, of: &dyn Fn(&ParticleState) -> Vec3, tolerance, reason| {
            checks.push(Check {
                quantity: format!("{name}: change of {quantity} / sum of magnitudes"),
                reference: 0.0,
                measured: (total(&after, of) - total(&setup.particles, of)).norm() / size(of),
                tolerance: Tolerance::Absolute(tolerance),
                reason,
                unit: "-",
                source: "closed system",
            });
        };
        row("momentum", &linear, 1e-12, "bar of the suite; round-off of 4000 steps");
        row("angular momentum", &angular, 1e-12, "both forces act in one contact point; round-off of 4000 steps");
    }
    Ok(checks)
}

/// Compares `after`, brought back by `undo`, with the plain run.
fn same(
    name: &str,
    plain: &[ParticleState],
    after: &[ParticleState],
    undo: impl Fn(&ParticleState) -> ParticleState,
) -> Check {
    let difference = plain.iter().zip(after).map(|(a, b)| {
        let b = undo(b);
        let turn = (a.spin - b.spin).norm() * a.radius * 1e-3;
        (a.position - b.position).norm().max(turn)
    });
    Check {
        quantity: format!("{name}: largest difference of position (and spin x r x 1 ms)"),
        reference: 0.0,
        measured: difference.fold(0.0, |a: f64, b| if b.is_nan() { b } else { a.max(b) }),
        tolerance: Tolerance::Absolute(SAME),
        reason: SYMMETRY_REASON,
        unit: "m",
        source: "the plain run",
    }
}

fn galilean_shift(experiment: &mut dyn Experiment, laws: &[NamedLaw]) -> Result<Vec<Check>, NotRun> {
    let mut checks = Vec::new();
    for &(name, law) in laws {
        let setup = cloud(law);
        let mut moving = setup.clone();
        let shift = vec3(3.0, -2.0, 1.0);
        moving.particles.iter_mut().for_each(|p| p.velocity += shift);
        let duration = setup.timestep * setup.steps as f64;
        let (plain, after) = (end(experiment, &setup)?, end(experiment, &moving)?);
        checks.push(same(name, &plain, &after, |p| ParticleState { position: p.position - duration * shift, ..*p }));
    }
    Ok(checks)
}

fn mirror(experiment: &mut dyn Experiment, laws: &[NamedLaw]) -> Result<Vec<Check>, NotRun> {
    let mut checks = Vec::new();
    // x -> -x; a spin is a pseudovector and keeps its x
    let reflect = |p: &ParticleState| ParticleState {
        position: vec3(-p.position.x, p.position.y, p.position.z),
        velocity: vec3(-p.velocity.x, p.velocity.y, p.velocity.z),
        spin: vec3(p.spin.x, -p.spin.y, -p.spin.z),
        ..*p
    };
    for &(name, law) in laws {
        let setup = cloud(law);
        let mut mirrored = setup.clone();
        mirrored.particles = setup.particles.iter().map(reflect).collect();
        let (plain, after) = (end(experiment, &setup)?, end(experiment, &mirrored)?);
        checks.push(same(name, &plain, &after, reflect));
    }
    Ok(checks)
}

fn renumbering(experiment: &mut dyn Experiment, laws: &[NamedLaw]) -> Result<Vec<Check>, NotRun> {
    let mut checks = Vec::new();
    for &(name, law) in laws {
        let setup = cloud(law);
        let mut backwards = setup.clone();
        backwards.particles.reverse();
        for (k, particle) in backwards.particles.iter_mut().enumerate() {
            particle.id = ParticleId::new(0, k as u64);
        }
        let plain = end(experiment, &setup)?;
        // `end` compares with the order of the setup, and so do we
        let mut after = end(experiment, &backwards)?;
        after.reverse();
        checks.push(same(name, &plain, &after, |p| *p));
    }
    Ok(checks)
}
