//! `stream-turned` (error): a stream that gravity has shaped, turned or mirrored so that gravity would point elsewhere.
//!
//! A ballistic path falls along gravity, and a recorded one has fallen; only turns about the direction of gravity and mirrors
//! along it leave that as it is.

use super::{Subject, join};
use crate::math::Vec3;
use crate::scene::gate::{PathMode, Transform};

/// Largest change of the unit direction of gravity that is taken for round-off.
const SLACK: f64 = 1e-9;

pub(super) fn check(subject: &Subject<'_>) {
    let draft = subject.draft;
    let Some(down) = draft.gravity.try_normalize(0.0) else { return };
    if !draft.stages.whole {
        return;
    }
    for stage in &draft.stages.stages {
        for (index, replay) in stage.item.replays.iter().enumerate() {
            let how = match replay.path {
                PathMode::Constant => continue,
                PathMode::Ballistic => "ballistic",
                PathMode::Recorded => "recorded",
                PathMode::Compliant => "compliant",
            };
            if changes(&replay.transform, &down) {
                let key = if replay.transform.rotation.is_some() { "place.rotate" } else { "mirror" };
                subject.error(
                    "stream-turned",
                    &join(&stage.path, &format!("replay.{index}.{key}")),
                    format!("the stream is turned against gravity, and its {how} paths have fallen along it"),
                    "turn it about the direction of gravity only, or write `path = \"constant\"`",
                );
            }
        }
    }
}

fn changes(transform: &Transform, down: &Vec3) -> bool {
    (transform.direction(*down) - down).norm() > SLACK
}
