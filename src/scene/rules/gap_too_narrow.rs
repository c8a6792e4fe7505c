//! `gap-too-narrow` (warning): an opening that the largest particle cannot pass.
//!
//! Looked at: the open ends of cylinders and cones, and the border loops of open meshes (an outlet is one). Whether
//! particles must pass there only the user knows, and another part may close it: hence a warning. A crack between
//! triangles is a border too, but encloses almost nothing for its length, and is left to `stl-open`.

use super::{Subject, join, mm};
use crate::geometry::part::Surface;
use crate::particle::Body;
use std::f64::consts::PI;

/// A border that encloses less than this share of a circle of its length is a crack.
const CRACK: f64 = 0.2;

pub(super) fn check(subject: &Subject<'_>) {
    if subject.largest == 0.0 || subject.draft.body != Body::Sphere {
        return;
    }
    for (part, inspection) in subject.draft.parts.iter().zip(&subject.inspections) {
        let radii: Vec<f64> = match (&part.item.part.surface, inspection) {
            (Surface::Frustum { start_radius, end_radius, .. }, _) => vec![*start_radius, *end_radius],
            (Surface::Mesh(_), Some(report)) => report
                .boundary_loops
                .iter()
                .filter(|border| border.equivalent_radius > CRACK * border.length / (2.0 * PI))
                .map(|border| border.equivalent_radius)
                .collect(),
            _ => continue,
        };
        let narrowest = radii.into_iter().filter(|radius| *radius > 0.0).fold(f64::INFINITY, f64::min);
        if 2.0 * narrowest < subject.largest {
            let key = if inspection.is_some() { "file" } else { "shape" };
            subject.warning(
                "gap-too-narrow",
                &join(&part.path, key),
                format!(
                    "part \"{}\" has an opening {} wide, and the largest particle ({}) cannot pass it",
                    part.item.part.name,
                    mm(2.0 * narrowest),
                    mm(subject.largest)
                ),
                "enlarge the opening, or feed smaller particles; ignore this where nothing has to pass",
            );
        }
    }
}
