//! `path-storage` (error): a replay that needs paths which the gate does not store, or not from far enough before the plane.

use super::{Subject, join, mm};
use crate::scene::gate::{PathMode, StreamSource};

/// Round-off of a length given in another unit.
const SLACK: f64 = 1e-9;

pub(super) fn check(subject: &Subject<'_>) {
    let draft = subject.draft;
    if !draft.stages.whole {
        return;
    }
    for stage in &draft.stages.stages {
        for (index, replay) in stage.item.replays.iter().enumerate() {
            let StreamSource::Gate(gate) = replay.source else { continue };
            if !matches!(replay.path, PathMode::Recorded | PathMode::Compliant) {
                continue;
            }
            let gate = &draft.gates[gate].item;
            let path = |key: &str| join(&stage.path, &format!("replay.{index}.{key}"));
            match gate.paths {
                None => subject.error(
                    "path-storage",
                    &path("path"),
                    format!("gate \"{}\" stores no paths, so none can be followed", gate.name),
                    "remove `paths = \"none\"` at the gate, or write `path = \"ballistic\"`",
                ),
                Some(paths) if paths.length < replay.length * (1.0 - SLACK) => subject.error(
                    "path-storage",
                    &path("length"),
                    format!(
                        "ghosts are made {} before the plane, and gate \"{}\" stores paths from {} before it on",
                        mm(replay.length),
                        gate.name,
                        mm(paths.length)
                    ),
                    format!(
                        "write `paths = {{ length_mm = {} }}` at the gate, or more",
                        super::round(1e3 * replay.length)
                    ),
                ),
                Some(_) => {}
            }
        }
    }
}
