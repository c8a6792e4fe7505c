//! `stage-empty` (error): a stage that nothing brings particles into: no feed, no stream, no start checkpoint.

use super::Subject;

pub(super) fn check(subject: &Subject<'_>) {
    let draft = subject.draft;
    // A feed that did not resolve may belong to it.
    let feeds_whole = draft.names.iter().filter(|(kind, ..)| *kind == "feed").count() == draft.feeds.len();
    if !draft.stages.whole || !feeds_whole || draft.start_checkpoint.is_some() {
        return;
    }
    for (index, stage) in draft.stages.stages.iter().enumerate() {
        if stage.item.replays.is_empty() && subject.layout.feeds_of(index).is_empty() {
            let name = &stage.item.name;
            subject.error(
                "stage-empty",
                &stage.path,
                format!("stage \"{name}\" has no feed, no stream and no start checkpoint, so it has no particles"),
                "name its `feeds`, add a [[stage.replay]], or turn the gate's `normal` around if it points upstream",
            );
        }
    }
}
