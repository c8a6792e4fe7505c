//! `feed-crowded` (warning): more particles than random insertion can place.
//!
//! Random sequential addition saturates at a solid fraction of 0.384 for equal spheres (Zhang and Torquato 2013) and of
//! 0.547 for equal discs (Feder 1980); it becomes slow well before. A stream faces the same limit in the
//! slab that its velocity opens in a second.

use super::{Subject, join, round};
use crate::dem::feed::size::SizeSampler;
use crate::dem::feed::{Amount, Face, FeedKind, Rate};
use crate::math::Vec3;
use crate::particle::Body;
use std::f64::consts::PI;

/// Solid fraction that one insertion of spheres is likely to reach [-].
const SPHERES: f64 = 0.35;
/// The same for discs in the plane [-].
const DISCS: f64 = 0.5;

pub(super) fn check(subject: &Subject<'_>) {
    if subject.report.has_errors() {
        // Sizes that are wrong have no mean.
        return;
    }
    let body = subject.draft.body;
    let reach = if body == Body::Sphere { SPHERES } else { DISCS };
    for feed in &subject.draft.feeds {
        let (key, fraction, next) = match &feed.item.kind {
            FeedKind::Fill { class, region, amount, interval, .. } if interval.is_infinite() => {
                let Some(solid) = solid(subject, *class, *amount) else { continue };
                (
                    "amount",
                    solid / region.measure(body),
                    "make the region larger, or let it fill in turns with `interval`",
                )
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

/// Solid volume of an amount [m3]; in a plane problem its area [m2].
fn solid(subject: &Subject<'_>, class: usize, amount: Amount) -> Option<f64> {
    let class = subject.class(class)?;
    let body = subject.draft.body;
    match amount {
        Amount::Mass(mass) => {
            let density = subject.draft.materials.get(usize::from(class.material))?.density?;
            let slice = if let Body::Disc { thickness } = body { thickness } else { 1.0 };
            Some(mass / density / slice)
        }
        Amount::Count(count) => {
            let sizes = SizeSampler::new(&class.diameter, body);
            let one = match body {
                Body::Sphere => PI / 6.0 * sizes.mean_power(3),
                Body::Disc { .. } => PI / 4.0 * sizes.mean_power(2),
            };
            Some(count as f64 * one)
        }
    }
}

/// Volume that the face sweeps in a second [m3/s]; in a plane problem the area [m2/s].
fn face_flow(face: &Face, velocity: &Vec3, body: Body) -> f64 {
    match (face, body) {
        (Face::Disc { normal, radius, .. }, Body::Sphere) => PI * radius * radius * velocity.dot(normal).abs(),
        (Face::Rectangle { side_a, side_b, .. }, Body::Sphere) => velocity.dot(&side_a.cross(side_b)).abs(),
        (Face::Disc { normal, radius, .. }, Body::Disc { .. }) => 2.0 * radius * velocity.dot(normal).abs(),
        (Face::Rectangle { side_a, side_b, .. }, Body::Disc { .. }) => {
            // Its trace in the plane is the longer of the two edges seen there.
            let seen = |side: &Vec3| Vec3::new(side.x, 0.0, side.z);
            let (a, b) = (seen(side_a), seen(side_b));
            let trace = if a.norm() >= b.norm() { a } else { b };
            trace.cross(&Vec3::new(velocity.x, 0.0, velocity.z)).norm()
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_face_sweeps_its_area_times_the_speed_across_it() {
        let velocity = Vec3::new(3.0, 0.0, -2.0);
        let disc = Face::Disc { centre: Vec3::zeros(), normal: Vec3::z(), radius: 0.5 };
        assert!((face_flow(&disc, &velocity, Body::Sphere) - PI * 0.25 * 2.0).abs() < 1e-12);
        let plane = Body::Disc { thickness: 0.1 };
        assert!((face_flow(&disc, &velocity, plane) - 1.0 * 2.0).abs() < 1e-12);
        let (side_a, side_b) = (Vec3::x() * 4.0, Vec3::y() * 0.5);
        let rectangle = Face::Rectangle { centre: Vec3::zeros(), side_a, side_b };
        assert!((face_flow(&rectangle, &velocity, Body::Sphere) - 4.0 * 0.5 * 2.0).abs() < 1e-12);
        assert!((face_flow(&rectangle, &velocity, plane) - 4.0 * 2.0).abs() < 1e-12);
    }
}
