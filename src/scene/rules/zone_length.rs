//! `zone-length` (error): a zone at a gate that is shorter than the largest particle.
//!
//! A particle taken out closer than one largest diameter behind the plane could still have touched one that has not passed
//! (L1), and one that becomes free closer than that to where ghosts are made could touch one that is not there yet (L2).

use super::{Subject, join, mm};

/// Round-off of a length given in another unit.
const SLACK: f64 = 1e-9;

pub(super) fn check(subject: &Subject<'_>) {
    let draft = subject.draft;
    for gate in &draft.gates {
        let path = join(&gate.path, "exclusion.length");
        let what = format!("the exclusion plane of gate \"{}\"", gate.item.name);
        judge(subject, &path, &what, gate.item.exclusion.length, "behind the gate plane");
    }
    if !draft.stages.whole {
        return;
    }
    for stage in &draft.stages.stages {
        for (index, replay) in stage.item.replays.iter().enumerate() {
            let path = join(&stage.path, &format!("replay.{index}.length"));
            let what = format!("the generation plane of stage \"{}\"", stage.item.name);
            judge(subject, &path, &what, replay.length, "before the calculation plane");
        }
    }
}

fn judge(subject: &Subject<'_>, path: &str, what: &str, length: f64, where_: &str) {
    if length == 0.0 && !subject.report.has_errors() {
        let what = format!("{what} has no distance: no particle size is known that it could follow from");
        subject.error("zone-length", path, what, "give `length`, at least the largest diameter of any particle");
    } else if length > 0.0 && length < subject.largest * (1.0 - SLACK) {
        let (length, largest) = (mm(length), mm(subject.largest));
        subject.error(
            "zone-length",
            path,
            format!("{what} lies {length} {where_}, less than the largest particle ({largest})"),
            format!("make `length` at least {largest}: a particle there could still touch one on the other side"),
        );
    }
}
