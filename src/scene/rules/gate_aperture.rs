//! `gate-aperture` (error): the sides of a rectangle lie in the gate plane and span it.

use super::{Subject, join};
use crate::geometry::plane::Aperture;

/// Sine of the angle that is taken for round-off of what was typed.
const SLACK: f64 = 1e-6;

pub(super) fn check(subject: &Subject<'_>) {
    for gate in &subject.draft.gates {
        let Aperture::Rectangle { side_a, side_b } = gate.item.plane.aperture else { continue };
        let normal = gate.item.plane.normal;
        let mut in_plane = true;
        for (key, side) in [("side_a", side_a), ("side_b", side_b)] {
            let off = side.dot(&normal);
            if off.abs() > SLACK * side.norm() {
                in_plane = false;
                let [x, y, z] = (1e3 * (side - normal * off)).into();
                subject.error(
                    "gate-aperture",
                    &join(&gate.path, &format!("aperture.{key}")),
                    format!("`{key}` does not lie in the plane of gate \"{}\"", gate.item.name),
                    format!("its part in the plane is `{key}_mm = [{x}, {y}, {z}]`"),
                );
            }
        }
        if in_plane && side_a.cross(&side_b).norm() <= SLACK * side_a.norm() * side_b.norm() {
            subject.error(
                "gate-aperture",
                &join(&gate.path, "aperture.side_b"),
                format!("the sides of gate \"{}\" lie along one line, so nothing can pass", gate.item.name),
                "turn one of the two",
            );
        }
    }
}
