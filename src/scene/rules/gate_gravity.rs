//! `gate-gravity` (error): what needs gravity at a gate. The lowest point of a particle is where gravity points, and the
//! spring of a compliant ghost is as stiff as its weight asks for.

use super::{Subject, join};
use crate::scene::gate::{PassingPoint, PathMode};

pub(super) fn check(subject: &Subject<'_>) {
    let draft = subject.draft;
    if draft.gravity.norm_squared() > 0.0 {
        return;
    }
    for gate in draft.gates.iter().filter(|gate| gate.item.passage == PassingPoint::LowestPoint) {
        subject.error(
            "gate-gravity",
            &join(&gate.path, "passage"),
            "without gravity a particle has no lowest point".to_owned(),
            "write `passage = \"centre\"`",
        );
    }
    if !draft.stages.whole {
        return;
    }
    for stage in &draft.stages.stages {
        for (index, replay) in stage.item.replays.iter().enumerate() {
            if replay.path == PathMode::Compliant {
                subject.error(
                    "gate-gravity",
                    &join(&stage.path, &format!("replay.{index}.path")),
                    "without gravity a compliant ghost has no stiffness".to_owned(),
                    "write `path = \"recorded\"`",
                );
            }
        }
    }
}
