//! `gate-periodic` (error): a gate across a periodic axis has its downstream on both sides.

use super::{Subject, join};

pub(super) fn check(subject: &Subject<'_>) {
    for gate in &subject.draft.gates {
        for (axis, name) in ["x", "y", "z"].into_iter().enumerate() {
            if subject.draft.domain.periodic[axis] && gate.item.plane.normal[axis].abs() > 1e-9 {
                subject.error(
                    "gate-periodic",
                    &join(&gate.path, "normal"),
                    format!("gate \"{}\" lies across {name}, which is periodic: its two sides are one", gate.item.name),
                    format!("give a normal without a {name} component, or make {name} open"),
                );
            }
        }
    }
}
