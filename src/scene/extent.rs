//! How far things reach: bounds of surfaces along their motion, of regions and faces, and the domain that follows.

use super::Domain;
use super::resolve::{Draft, Located};
use crate::dem::feed::{Face, Feed, FeedKind, Region};
use crate::geometry::motion::{Motion, MotionKind};
use crate::geometry::part::Surface;
use crate::math::{Bounds, Vec3};
use crate::particle::{ParticleClass, SizeDistribution};

/// Smallest and largest diameter a distribution can draw [m].
pub(super) fn diameter_range(sizes: &SizeDistribution) -> (f64, f64) {
    match sizes {
        SizeDistribution::Fixed { diameter } => (*diameter, *diameter),
        SizeDistribution::Uniform { minimum, maximum }
        | SizeDistribution::Normal { minimum, maximum, .. }
        | SizeDistribution::Lognormal { minimum, maximum, .. } => (*minimum, *maximum),
        SizeDistribution::Sieve { sieves, fractions, .. } => {
            // A class without particles at either end does not count.
            let first = fractions.iter().position(|f| *f > 0.0).unwrap_or(0);
            let last = fractions.iter().rposition(|f| *f > 0.0).map_or(sieves.len(), |k| k + 1);
            let at = |k: usize| sieves.get(k.min(sieves.len().saturating_sub(1))).copied().unwrap_or(f64::NAN);
            (at(first), at(last))
        }
    }
}

/// The largest diameter of any particle in the scene [m]; 0 without particles.
pub(super) fn largest_diameter(classes: &[Located<Option<ParticleClass>>], feeds: &[Located<Feed>]) -> f64 {
    let classes = classes.iter().filter_map(|class| class.item.as_ref()).map(|c| diameter_range(&c.diameter).1);
    let files = feeds.iter().flat_map(|feed| match &feed.item.kind {
        FeedKind::File { particles } => &particles[..],
        _ => &[],
    });
    classes.chain(files.map(|particle| 2.0 * particle.radius)).fold(0.0, f64::max)
}

/// Bounds of a surface at rest; of a plane only its point.
pub(crate) fn of_surface(surface: &Surface) -> Bounds {
    let mut bounds = Bounds::EMPTY;
    match surface {
        Surface::Plane { point, .. } => bounds.include(point),
        Surface::Frustum { start, end, start_radius, end_radius } => {
            let axis = (end - start).normalize();
            bounds = of_disc(start, &axis, *start_radius).union(&of_disc(end, &axis, *end_radius));
        }
        Surface::Mesh(mesh) => mesh.vertices.iter().for_each(|vertex| bounds.include(vertex)),
    }
    bounds
}

/// Bounds of a disc: along axis k it reaches r sqrt(1 - n_k^2).
fn of_disc(centre: &Vec3, normal: &Vec3, radius: f64) -> Bounds {
    let reach = normal.map(|n| radius * (1.0 - n * n).max(0.0).sqrt());
    let mut bounds = Bounds::EMPTY;
    bounds.include(&(centre - reach));
    bounds.include(&(centre + reach));
    bounds
}

/// Bounds of all that `bounds` can reach by `motion` until `end` [s]; never too small.
pub(crate) fn moved(mut bounds: Bounds, motion: &Motion, end: f64) -> Bounds {
    for term in motion.terms.iter().filter(|term| term.from < end) {
        let duration = term.until.min(end) - term.from;
        bounds = match &term.kind {
            MotionKind::Rotate { origin, axis, .. } => turned(&bounds, origin, axis),
            MotionKind::Translate { velocity } => {
                let shift = velocity * duration;
                let shifted = Bounds {
                    minimum: (Vec3::from(bounds.minimum) + shift).into(),
                    maximum: (Vec3::from(bounds.maximum) + shift).into(),
                };
                bounds.union(&shifted)
            }
            MotionKind::Oscillate { amplitude, .. } => {
                // x lies between -2a and 2a, as it starts without a jump at any phase.
                let reach = 2.0 * amplitude.abs();
                Bounds {
                    minimum: (Vec3::from(bounds.minimum) - reach).into(),
                    maximum: (Vec3::from(bounds.maximum) + reach).into(),
                }
            }
            MotionKind::Conveyor { .. } => bounds,
        };
    }
    bounds
}

/// Bounds of a full turn of a box about an axis: of the cylinder that its corners sweep.
fn turned(bounds: &Bounds, origin: &Vec3, axis: &Vec3) -> Bounds {
    let (mut low, mut high, mut radius) = (f64::INFINITY, f64::NEG_INFINITY, 0.0_f64);
    for corner in corners(bounds) {
        let offset = corner - origin;
        let along = offset.dot(axis);
        low = low.min(along);
        high = high.max(along);
        radius = radius.max((offset - along * axis).norm());
    }
    of_disc(&(origin + low * axis), axis, radius).union(&of_disc(&(origin + high * axis), axis, radius))
}

/// The eight corners of a box.
pub(crate) fn corners(bounds: &Bounds) -> [Vec3; 8] {
    let pick = |high: bool, axis: usize| if high { bounds.maximum[axis] } else { bounds.minimum[axis] };
    std::array::from_fn(|k| Vec3::new(pick(k & 1 != 0, 0), pick(k & 2 != 0, 1), pick(k & 4 != 0, 2)))
}

/// Bounds of a region.
pub(super) fn of_region(region: &Region) -> Bounds {
    let mut bounds = Bounds::EMPTY;
    match region {
        Region::Box { minimum, maximum } => {
            bounds.include(minimum);
            bounds.include(maximum);
        }
        Region::Cylinder { start, end, radius } => {
            let axis = (end - start).normalize();
            bounds = of_disc(start, &axis, *radius).union(&of_disc(end, &axis, *radius));
        }
        Region::Inside(mesh) => mesh.vertices.iter().for_each(|vertex| bounds.include(vertex)),
    }
    bounds
}

/// Bounds of a face.
pub(super) fn of_face(face: &Face) -> Bounds {
    match face {
        Face::Disc { centre, normal, radius } => of_disc(centre, normal, *radius),
        Face::Rectangle { centre, side_a, side_b } => {
            let reach = (side_a.abs() + side_b.abs()) / 2.0;
            let mut bounds = Bounds::EMPTY;
            bounds.include(&(centre - reach));
            bounds.include(&(centre + reach));
            bounds
        }
    }
}

/// Bounds of all that a feed brings in.
pub(crate) fn of_feed(kind: &FeedKind) -> Bounds {
    match kind {
        FeedKind::Fill { region, .. } => of_region(region),
        FeedKind::Stream { face, .. } => of_face(face),
        FeedKind::File { particles } => {
            let mut bounds = Bounds::EMPTY;
            particles.iter().for_each(|particle| bounds.include(&particle.position));
            bounds
        }
    }
}

/// The domain: as given, else all parts along their motions and all feeds, with a margin of a tenth of the largest edge
/// and at least two of the largest diameters.
pub(super) fn domain(draft: &Draft) -> Domain {
    let end = draft.end.map_or(0.0, |end| end.time);
    let mut bounds = Bounds::EMPTY;
    for part in &draft.parts {
        bounds = bounds.union(&moved(of_surface(&part.item.part.surface), &part.item.part.motion, end));
    }
    for feed in &draft.feeds {
        bounds = bounds.union(&of_feed(&feed.item.kind));
    }
    if bounds.is_empty() {
        bounds.include(&Vec3::zeros());
    }
    let margin = (0.1 * bounds.size().max()).max(2.0 * largest_diameter(&draft.classes, &draft.feeds));
    let grown = bounds.grown(margin);
    let bounds = Bounds {
        minimum: draft.domain.minimum.unwrap_or(grown.minimum),
        maximum: draft.domain.maximum.unwrap_or(grown.maximum),
    };
    Domain { bounds, periodic: draft.domain.periodic }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::motion::MotionTerm;
    use crate::math::vec3;

    fn close(bounds: &Bounds, minimum: [f64; 3], maximum: [f64; 3]) {
        for axis in 0..3 {
            assert!((bounds.minimum[axis] - minimum[axis]).abs() < 1e-12, "{bounds:?}");
            assert!((bounds.maximum[axis] - maximum[axis]).abs() < 1e-12, "{bounds:?}");
        }
    }

    #[test]
    fn an_upright_cone_reaches_its_radii() {
        let surface = Surface::Frustum {
            start: vec3(1.0, 0.0, 0.0),
            end: vec3(1.0, 0.0, 2.0),
            start_radius: 0.5,
            end_radius: 3.0,
        };
        close(&of_surface(&surface), [-2.0, -3.0, 0.0], [4.0, 3.0, 2.0]);
    }

    #[test]
    fn motions_reach_as_far_as_they_can() {
        let bounds = Bounds { minimum: [-1.0, -2.0, 0.0], maximum: [1.0, 2.0, 3.0] };
        let once = |kind| Motion { terms: vec![MotionTerm { kind, from: 1.0, until: f64::INFINITY }] };
        let z = vec3(0.0, 0.0, 1.0);
        let spin = once(MotionKind::Rotate { origin: Vec3::zeros(), axis: z, rate: 1.0 });
        let reach = (1.0_f64 + 4.0).sqrt();
        close(&moved(bounds, &spin, 2.0), [-reach, -reach, 0.0], [reach, reach, 3.0]);
        let slide = once(MotionKind::Translate { velocity: vec3(2.0, 0.0, -1.0) });
        // From 1 s to 4 s: three seconds.
        close(&moved(bounds, &slide, 4.0), [-1.0, -2.0, -3.0], [7.0, 2.0, 3.0]);
        close(&moved(bounds, &slide, 0.5), bounds.minimum, bounds.maximum);
        let shake = once(MotionKind::Oscillate { amplitude: vec3(0.0, -0.1, 0.0), frequency: 5.0, phase: 0.3 });
        close(&moved(bounds, &shake, 2.0), [-1.0, -2.2, 0.0], [1.0, 2.2, 3.0]);
    }

    #[test]
    fn empty_sieve_classes_do_not_count() {
        let sizes = SizeDistribution::Sieve {
            by: crate::particle::GradingBy::Mass,
            sieves: vec![1.0, 2.0, 4.0, 8.0],
            fractions: vec![0.0, 1.0, 0.0],
        };
        assert_eq!(diameter_range(&sizes), (2.0, 4.0));
    }
}
