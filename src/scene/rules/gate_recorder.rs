//! `gate-recorder` (error): each gate is recorded by one stage.

use super::Subject;

pub(super) fn check(subject: &Subject<'_>) {
    let draft = subject.draft;
    if !draft.stages.whole {
        return;
    }
    for (index, gate) in draft.gates.iter().enumerate() {
        let recorders: Vec<String> = subject
            .layout
            .recorders(index)
            .map(|stage| format!("\"{}\"", draft.stages.stages[stage].item.name))
            .collect();
        let name = &gate.item.name;
        match recorders.as_slice() {
            [_] => {}
            [] => subject.error(
                "gate-recorder",
                &gate.path,
                format!("no stage records gate \"{name}\""),
                format!("write `records = [\"{name}\"]` in the stage that lies before it"),
            ),
            several => subject.error(
                "gate-recorder",
                &gate.path,
                format!("gate \"{name}\" is recorded by stages {}: a stream has one origin", several.join(" and ")),
                "let one of them record it, and give the other a gate of its own",
            ),
        }
    }
}
