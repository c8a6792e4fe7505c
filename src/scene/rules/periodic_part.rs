//! `periodic-part` (error): a part that crosses a periodic border would have to go on at the other side, and does not.
//!
//! A part that ends exactly at the border is fine, and so is a plane along the axis, which is endless. A plane across
//! the axis is not: it would block the way around.

use super::{Subject, join};
use crate::geometry::part::Surface;
use crate::math::Bounds;
use crate::scene::extent;

pub(super) fn check(subject: &Subject<'_>) {
    let given = &subject.draft.domain;
    let (Some(minimum), Some(maximum)) = (given.minimum, given.maximum) else { return };
    let end = subject.draft.end.map_or(0.0, |end| end.time);
    for part in &subject.draft.parts {
        let surface = &part.item.part.surface;
        let bounds: Bounds = extent::moved(extent::of_surface(surface), &part.item.part.motion, end);
        for axis in (0..3).filter(|axis| given.periodic[*axis]) {
            let crosses = match surface {
                Surface::Plane { normal, .. } => normal[axis].abs() > 1e-9,
                _ => {
                    let slack = 1e-6 * (maximum[axis] - minimum[axis]);
                    bounds.minimum[axis] < minimum[axis] - slack || bounds.maximum[axis] > maximum[axis] + slack
                }
            };
            if crosses {
                let name = ["x", "y", "z"][axis];
                subject.error(
                    "periodic-part",
                    &join(&part.path, "shape"),
                    format!("part \"{}\" crosses the periodic border along {name}", part.item.part.name),
                    "let it end at the border, or make the border open",
                );
            }
        }
    }
}
