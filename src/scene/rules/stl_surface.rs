//! What is odd about a surface from an STL file; particles can still touch it from both sides.
//!
//! - `stl-open` (warning): edges with one triangle only. Right for a hopper, wrong for a solid.
//! - `stl-non-manifold` (warning): edges with more than two triangles.
//! - `stl-inconsistent` (warning): neighbours whose normals point to different sides.
//! - `stl-inverted` (warning): a closed surface whose normals point inwards.
//! - `stl-degenerate` (warning): triangles without area.

use super::{Subject, join};

pub(super) fn check(subject: &Subject<'_>) {
    for (part, inspection) in subject.draft.parts.iter().zip(&subject.inspections) {
        let Some(inspection) = inspection else { continue };
        let path = join(&part.path, "file");
        let name = &part.item.part.name;
        let warn = |rule, what: String, next| subject.warning(rule, &path, what, next);
        if inspection.open_edges > 0 {
            warn(
                "stl-open",
                format!("the surface of part \"{name}\" is not closed: {} open edges", inspection.open_edges),
                "ignore this for a hopper or a chute; close the surface where it should be a solid",
            );
        }
        if inspection.non_manifold_edges > 0 {
            warn(
                "stl-non-manifold",
                format!(
                    "the surface of part \"{name}\" has {} edges where more than two triangles meet",
                    inspection.non_manifold_edges
                ),
                "remove doubled or inner faces where the surface was drawn",
            );
        }
        if inspection.inconsistent_edges > 0 {
            warn(
                "stl-inconsistent",
                format!(
                    "the surface of part \"{name}\" has {} edges where the normals of two triangles disagree",
                    inspection.inconsistent_edges
                ),
                "make the normals agree where the surface was drawn; contacts are the same on both sides",
            );
        }
        if inspection.inverted == Some(true) {
            warn(
                "stl-inverted",
                format!("the surface of part \"{name}\" is inside out: its normals point inwards"),
                "flip the normals where the surface was drawn; contacts are the same on both sides",
            );
        }
        if inspection.degenerate > 0 {
            warn(
                "stl-degenerate",
                format!("the surface of part \"{name}\" has {} triangles without area", inspection.degenerate),
                "remove them where the surface was drawn",
            );
        }
    }
}
