//! `stage-cycle` (error): a stage that waits for its own stream, perhaps through others. What flows back cannot be replayed
//! before it is known.

use super::Subject;

pub(super) fn check(subject: &Subject<'_>) {
    let draft = subject.draft;
    if !draft.stages.whole {
        return;
    }
    for (index, stage) in draft.stages.stages.iter().enumerate() {
        if subject.layout.ancestors(index).contains(&index) {
            subject.error(
                "stage-cycle",
                &stage.path,
                format!("stage \"{}\" would have to run before itself: its streams lead back to it", stage.item.name),
                "cut the cycle: put what flows back into one stage",
            );
        }
    }
}
