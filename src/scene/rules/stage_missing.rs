//! What belongs to no stage is left out of every run, which is often a slip in a list of names.
//!
//! - `part-nowhere` (warning): a part that no stage has.
//! - `feed-nowhere` (warning): a feed that no stage has.

use super::Subject;

pub(super) fn check(subject: &Subject<'_>) {
    let draft = subject.draft;
    let count = draft.stages.stages.len();
    if !draft.stages.whole || count == 0 {
        return;
    }
    let parts: Vec<Vec<bool>> = (0..count).map(|stage| subject.layout.parts_of(stage)).collect();
    for (index, part) in draft.parts.iter().enumerate() {
        if !parts.iter().any(|has| has[index]) {
            let what = format!("part \"{}\" belongs to no stage, so no particle meets it", part.item.part.name);
            subject.warning("part-nowhere", &part.path, what, "name it in `parts` of a stage, or remove it");
        }
    }
    let feeds: Vec<usize> = (0..count).flat_map(|stage| subject.layout.feeds_of(stage)).collect();
    for (index, feed) in draft.feeds.iter().enumerate() {
        if !feeds.contains(&index) {
            let what = format!("feed \"{}\" belongs to no stage, so it brings nothing", feed.item.name);
            subject.warning("feed-nowhere", &feed.path, what, "name it in `feeds` of a stage, or remove it");
        }
    }
}
