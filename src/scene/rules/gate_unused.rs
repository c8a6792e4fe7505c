//! `gate-unused` (warning): a gate whose stream nobody replays.

use super::Subject;

pub(super) fn check(subject: &Subject<'_>) {
    let draft = subject.draft;
    if !draft.stages.whole {
        return;
    }
    for (index, gate) in draft.gates.iter().enumerate() {
        if subject.layout.replayers(index).next().is_none() {
            let name = &gate.item.name;
            subject.warning(
                "gate-unused",
                &gate.path,
                format!("no stage replays gate \"{name}\": what passes it is stored and leaves the scene"),
                format!("add a [[stage.replay]] with `gate = \"{name}\"`, or keep it for another scene"),
            );
        }
    }
}
