//! `feed-crowded` (warning): more particles than random insertion can place.
//!
//! Random sequential addition saturates at a solid fraction of 0.384 for equal spheres (Zhang and Torquato 2013) and of
//! 0.547 for equal discs (Feder 1980); it becomes slow well before. A stream faces the same limit in the
//! slab that its velocity opens in a second.

use super::{Subject, join, round};
use crate::dem::feed::{Amount, Face, FeedKind, Rate, Region};
use crate::geometry::mesh::MeshReport;
use crate::material::Material;
use crate::math::Vec3;
use crate::particle::{Body, GradingBy, ParticleClass, SizeDistribution};
use std::f64::consts::PI;

/// Solid fraction that one insertion of spheres is likely to reach [-].
const SPHERES: f64 = 0.35;
/// The same for discs in the plane [-].
const DISCS: f64 = 0.5;

pub(super) fn check(subject: &Subject<'_>) {
    let body = subject.draft.body;
    let reach = if body == Body::Sphere { SPHERES } else { DISCS };
    for feed in &subject.draft.feeds {
        let (key, fraction, next) = match &feed.item.kind {
            FeedKind::Fill { class, region, amount, interval, .. } if interval.is_infinite() => {
                let Some(solid) = solid(subject, *class, *amount) else { continue };
                let Some(space) = region_volume(region, body) else { continue };
                ("amount", solid / space, "make the region larger, or let it fill in turns with `interval`")
            }
            FeedKind::Stream { class, face, rate, velocity, .. } => {
                let amount = match rate {
                    Rate::Mass(rate) => Amount::Mass(*rate),
                    // A second's worth; the count need not be whole.
                    Rate::Count(rate) => {
                        let Some(one) = solid(subject, *class, Amount::Count(1)) else { continue };
                        let space = face_flow(face, velocity, body);
                        report(subject, &feed.path, "rate", rate * one / space, reach, STREAM);
                        continue;
                    }
                };
                let Some(solid) = solid(subject, *class, amount) else { continue };
                ("rate", solid / face_flow(face, velocity, body), STREAM)
            }
            _ => continue,
        };
        report(subject, &feed.path, key, fraction, reach, next);
    }
}

const STREAM: &str = "make the face larger, the stream faster, or the rate smaller";

fn report(subject: &Subject<'_>, path: &str, key: &str, fraction: f64, reach: f64, next: &str) {
    if fraction.is_finite() && fraction > reach {
        subject.warning(
            "feed-crowded",
            &join(path, key),
            format!(
                "the particles would fill {} of the room, and random insertion reaches about {reach}",
                round(fraction)
            ),
            next,
        );
    }
}

/// Solid volume of an amount [m3].
fn solid(subject: &Subject<'_>, class: usize, amount: Amount) -> Option<f64> {
    let class: &ParticleClass = subject.class(class)?;
    match amount {
        Amount::Mass(mass) => {
            let material: &Material = subject.draft.materials.get(usize::from(class.material))?;
            Some(mass / material.density?)
        }
        Amount::Count(count) => Some(count as f64 * mean_volume(&class.diameter, subject.draft.body)),
    }
}

/// Mean volume of a particle [m3].
fn mean_volume(sizes: &SizeDistribution, body: Body) -> f64 {
    match body {
        Body::Sphere => PI / 6.0 * mean_power(sizes, 3),
        Body::Disc { thickness } => PI / 4.0 * thickness * mean_power(sizes, 2),
    }
}

/// Mean of d^power by number.
fn mean_power(sizes: &SizeDistribution, power: i32) -> f64 {
    match sizes {
        SizeDistribution::Fixed { diameter } => diameter.powi(power),
        SizeDistribution::Uniform { minimum, maximum } => uniform_power(*minimum, *maximum, power),
        SizeDistribution::Normal { mean, deviation, minimum, maximum } => {
            weighted(*minimum, *maximum, power, |d| (-0.5 * ((d - mean) / deviation).powi(2)).exp())
        }
        SizeDistribution::Lognormal { median, geometric_deviation, minimum, maximum } => {
            weighted(*minimum, *maximum, power, |d| {
                (-0.5 * ((d / median).ln() / geometric_deviation.ln()).powi(2)).exp() / d
            })
        }
        SizeDistribution::Sieve { by, sieves, fractions } => {
            let classes = sieves.windows(2).zip(fractions);
            match by {
                GradingBy::Number => classes.map(|(s, f)| f * uniform_power(s[0], s[1], power)).sum(),
                // Numbers are mass shares over the mean mass of a class.
                GradingBy::Mass => {
                    let (mut sum, mut number) = (0.0, 0.0);
                    for (s, f) in classes {
                        let share = f / uniform_power(s[0], s[1], 3);
                        sum += share * uniform_power(s[0], s[1], power);
                        number += share;
                    }
                    sum / number
                }
            }
        }
    }
}

/// Mean of d^p for d uniform between a and b: (b^(p+1) - a^(p+1)) / ((p + 1)(b - a)).
fn uniform_power(a: f64, b: f64, p: i32) -> f64 {
    if b - a <= 1e-9 * b {
        return b.powi(p);
    }
    (b.powi(p + 1) - a.powi(p + 1)) / (f64::from(p + 1) * (b - a))
}

/// Mean of d^p under a density, by the midpoint rule; a rough figure is enough here.
fn weighted(a: f64, b: f64, p: i32, density: impl Fn(f64) -> f64) -> f64 {
    const POINTS: i32 = 1000;
    let (mut sum, mut total) = (0.0, 0.0);
    for k in 0..POINTS {
        let d = a + (b - a) * (f64::from(k) + 0.5) / f64::from(POINTS);
        sum += d.powi(p) * density(d);
        total += density(d);
    }
    sum / total
}

/// Volume of a region [m3]; in a plane problem, of its slice.
fn region_volume(region: &Region, body: Body) -> Option<f64> {
    let slice = match body {
        Body::Sphere => None,
        Body::Disc { thickness } => Some(thickness),
    };
    match (region, slice) {
        (Region::Box { minimum, maximum }, None) => Some((maximum - minimum).product()),
        (Region::Box { minimum, maximum }, Some(slice)) => {
            Some((maximum.x - minimum.x) * (maximum.z - minimum.z) * slice)
        }
        (Region::Cylinder { start, end, radius }, None) => Some(PI * radius * radius * (end - start).norm()),
        (Region::Inside(mesh), None) => {
            let report: MeshReport = mesh.inspect();
            Some(report.signed_volume.abs())
        }
        // How the plane y = 0 cuts a slanted cylinder or a mesh is left to the feed's own report.
        (Region::Cylinder { .. } | Region::Inside(_), Some(_)) => None,
    }
    .filter(|volume| *volume > 0.0)
}

/// Volume that the face sweeps in a second [m3/s].
fn face_flow(face: &Face, velocity: &Vec3, body: Body) -> f64 {
    match (face, body) {
        (Face::Disc { normal, radius, .. }, Body::Sphere) => PI * radius * radius * velocity.dot(normal).abs(),
        (Face::Rectangle { side_a, side_b, .. }, Body::Sphere) => velocity.dot(&side_a.cross(side_b)).abs(),
        (Face::Disc { normal, radius, .. }, Body::Disc { thickness }) => {
            2.0 * radius * thickness * velocity.dot(normal).abs()
        }
        (Face::Rectangle { side_a, side_b, .. }, Body::Disc { thickness }) => {
            // Its trace in the plane is the longer of the two edges seen there.
            let seen = |side: &Vec3| Vec3::new(side.x, 0.0, side.z);
            let (a, b) = (seen(side_a), seen(side_b));
            let trace = if a.norm() >= b.norm() { a } else { b };
            thickness * trace.cross(&Vec3::new(velocity.x, 0.0, velocity.z)).norm()
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn means_agree_with_closed_forms() {
        let uniform = SizeDistribution::Uniform { minimum: 1.0, maximum: 3.0 };
        assert!((mean_power(&uniform, 3) - (81.0 - 1.0) / (4.0 * 2.0)).abs() < 1e-12);
        // Untruncated normal: E d^3 = m^3 + 3 m s^2; cut at six deviations the rest is below 1e-8.
        let normal = SizeDistribution::Normal { mean: 2.0, deviation: 0.1, minimum: 1.4, maximum: 2.6 };
        assert!((mean_power(&normal, 3) - (8.0 + 3.0 * 2.0 * 0.01)).abs() < 1e-6);
        // Untruncated lognormal: E d^3 = m^3 exp(9 s^2 / 2), s = ln of the geometric deviation.
        let s = 1.1_f64.ln();
        let lognormal =
            SizeDistribution::Lognormal { median: 2.0, geometric_deviation: 1.1, minimum: 1.0, maximum: 4.0 };
        assert!((mean_power(&lognormal, 3) - 8.0 * (4.5 * s * s).exp()).abs() < 1e-4);
        let one = SizeDistribution::Sieve { by: GradingBy::Mass, sieves: vec![1.0, 3.0], fractions: vec![1.0] };
        assert!((mean_power(&one, 3) - 10.0).abs() < 1e-12);
        // Half the mass each of (almost) 1 and 2: numbers 8 to 1.
        let two = SizeDistribution::Sieve {
            by: GradingBy::Mass,
            sieves: vec![1.0, 1.0 + 1e-10, 2.0 - 1e-10, 2.0],
            fractions: vec![0.5, 0.0, 0.5],
        };
        assert!((mean_power(&two, 1) - (8.0 * 1.0 + 1.0 * 2.0) / 9.0).abs() < 1e-6);
    }
}
