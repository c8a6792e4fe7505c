//! `ghost-zone` (warning): a part of the downstream stage, which the upstream stage does not have, in the way of its ghosts.
//!
//! Ghosts move as they did upstream. What was not there then does not stop them now: they run through it, and press what
//! lies in between. Parts that both stages have are fine: the paths have already been around them.

use super::{Subject, join};
use crate::scene::gate::StreamSource;
use crate::scene::reach;

pub(super) fn check(subject: &Subject<'_>) {
    let draft = subject.draft;
    if !draft.stages.whole {
        return;
    }
    let layout = &subject.layout;
    for (index, stage) in draft.stages.stages.iter().enumerate() {
        let here = layout.parts_of(index);
        for (number, replay) in stage.item.replays.iter().enumerate() {
            let StreamSource::Gate(gate) = replay.source else { continue };
            // A part that keeps its place while the stream is moved is not where it was upstream.
            let upstream: Vec<Vec<bool>> = if replay.transform.is_identity() {
                layout.recorders(gate).map(|recorder| layout.parts_of(recorder)).collect()
            } else {
                Vec::new()
            };
            let plane = replay.transform.plane(&layout.gates[gate].plane);
            for (part, draft) in layout.parts.iter().enumerate().filter(|(part, _)| here[*part]) {
                let is_shared = upstream.iter().any(|has| has[part]);
                if !is_shared && reach::enters(draft, &plane, (-replay.length, 0.0), layout.end) {
                    subject.warning(
                        "ghost-zone",
                        &join(&stage.path, &format!("replay.{number}")),
                        format!(
                            "part \"{}\" of stage \"{}\" reaches into the zone before the plane, where ghosts pass as if \
                             it was not there",
                            draft.name, stage.item.name
                        ),
                        "move the gate away from it, or let the stage before the gate have it too",
                    );
                }
            }
        }
    }
}
