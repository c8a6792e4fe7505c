//! `checkpoint-stages` (error): a start checkpoint holds the particles of one run, and belongs to the one stage that nothing
//! enters.

use super::Subject;

pub(super) fn check(subject: &Subject<'_>) {
    let draft = subject.draft;
    if !draft.stages.whole || draft.stages.stages.is_empty() || draft.start_checkpoint.is_none() {
        return;
    }
    let first = draft.stages.stages.iter().filter(|stage| stage.item.replays.is_empty()).count();
    if first != 1 {
        subject.error(
            "checkpoint-stages",
            "start_checkpoint",
            format!("the start checkpoint belongs to the stage that no stream enters, and there are {first} of them"),
            "leave one stage without a [[stage.replay]], or remove the checkpoint",
        );
    }
}
