//! `gate-outside-domain` (error): nothing passes a gate whose point lies outside of the domain.

use super::{Subject, join};

pub(super) fn check(subject: &Subject<'_>) {
    if subject.domain.bounds.size().min() <= 0.0 {
        return;
    }
    for gate in &subject.draft.gates {
        if !subject.domain.bounds.contains(&gate.item.plane.point) {
            subject.error(
                "gate-outside-domain",
                &join(&gate.path, "point"),
                format!("gate \"{}\" lies outside of the domain", gate.item.name),
                "move it, or enlarge [domain]",
            );
        }
    }
}
