//! Static friction at a large size ratio: a small sphere chocks a big one.
//!
//! A big sphere (radius R) on a plane leans against a small one (radius r). The small sphere's weight is negligible, so
//! the forces at its two contacts lie on the line between them, which is inclined by theta / 2 against both normals,
//! cos theta = (R - r) / (R + r). It can hold if and only if mu >= tan(theta / 2) = sqrt(r / R), whatever the load; and it
//! holds rigidly, because both contacts rolling would need the velocities of the touching surfaces to be perpendicular.
//! Static friction between bodies of very different size is what velocities taken at half steps get wrong.
//! The statics are our own; the fault of half-step velocities was shown by Vyas, Ottino, Lueptow and Umbanhowar (2025).

use super::experiment::{HERTZ, one_material, restitution};
use super::reference::{sphere_mass, static_overlap};
use super::{Case, CaseSetup, Check, Experiment, NotRun, Tolerance};
use crate::dem::law::LawSettings;
use crate::math::{Vec3, vec3};

pub(super) const CASES: &[Case] = &[Case {
    name: "chock",
    title: "a small sphere holds a big one on a slope if mu >= sqrt(r / R), size ratios 4 to 100",
    source: "statics; after Vyas et al. 2025",
    run: chock,
}];

const SMALL: f64 = 1e-3;
const GRAVITY: f64 = 9.81;
const DENSITY: f64 = 2500.0;
const YOUNGS_MODULUS: f64 = 1e8;
const POISSONS_RATIO: f64 = 0.25;

fn chock(experiment: &mut dyn Experiment) -> Result<Vec<Check>, NotRun> {
    let mut checks = Vec::new();
    for ratio in [4.0, 20.0, 100.0_f64] {
        let limit = (1.0 / ratio).sqrt();
        for share in [1.5, 0.9] {
            let travel = travel(experiment, ratio, share * limit)?;
            let holds = share > 1.0;
            checks.push(Check {
                quantity: format!("R / r = {ratio}, mu = {share} sqrt(r / R): way of the big sphere / r"),
                reference: if holds { 0.2 } else { 2.0 },
                measured: travel / SMALL,
                tolerance: if holds { Tolerance::AtMost } else { Tolerance::AtLeast },
                reason: "held: elastic way only, about delta / 2 sqrt(r / R); not held: half of the free way",
                unit: "-",
                source: "self-locking wedge, mu = sqrt(r / R)",
            });
        }
    }
    Ok(checks)
}

/// How far the big sphere moves downhill [m].
fn travel(experiment: &mut dyn Experiment, ratio: f64, friction: f64) -> Result<f64, NotRun> {
    let big = ratio * SMALL;
    let table = one_material(DENSITY, YOUNGS_MODULUS, POISSONS_RATIO, restitution(0.3), friction);
    let mut setup = CaseSetup::new(table, LawSettings { tangential_damping: true, ..HERTZ }, 20.0 * big);
    // a slope so small that the load stays light against the small sphere's stiffness, the same push per r^2 for all
    let slope = 0.02 * (20.0 / ratio).powi(3).min(1.0);
    setup.gravity = GRAVITY * vec3(slope.sin(), 0.0, -slope.cos());
    setup.add_floor(1);
    // Pressed together from the start: both alone would roll down alike and never press. The big sphere's moment balance gives
    // the force on the line between the contacts, F = M g sin(slope) / (2 sin(theta / 2)).
    let half_angle = (1.0 / ratio).sqrt().atan();
    let weight = sphere_mass(big, DENSITY) * GRAVITY;
    let normal_force = weight * slope.sin() / (2.0 * half_angle.tan());
    let plane_strain = YOUNGS_MODULUS / (1.0 - POISSONS_RATIO * POISSONS_RATIO);
    let small_height = SMALL - static_overlap(plane_strain, SMALL, normal_force);
    let big_height = big - static_overlap(plane_strain, big, weight - normal_force);
    let distance = big + SMALL - static_overlap(0.5 * plane_strain, big * SMALL / (big + SMALL), normal_force);
    let apart = (distance.powi(2) - (big_height - small_height).powi(2)).sqrt();
    setup.add_sphere(big, vec3(0.0, 0.0, big_height), Vec3::zeros(), Vec3::zeros());
    setup.add_sphere(SMALL, vec3(apart, 0.0, small_height), Vec3::zeros(), Vec3::zeros());
    // free rolling for this long would bring the big sphere 4 small radii away
    let duration = (8.0 * SMALL / (5.0 / 7.0 * GRAVITY * slope.sin())).sqrt();
    setup.run_for(duration, 3e-6, 1);
    let samples = experiment.run(&setup)?;
    let last = samples.last().and_then(|s| s.particles.first()).ok_or("no state came back")?;
    Ok(last.position.x.abs())
}
