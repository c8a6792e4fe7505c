//! `no-feed` (warning): a scene without feeds and without a start checkpoint has no particles.

use super::Subject;

pub(super) fn check(subject: &Subject<'_>) {
    if !subject.report.was_given("feed") && subject.draft.start_checkpoint.is_none() {
        subject.warning(
            "no-feed",
            "",
            "the scene has no feed and no start checkpoint, so it has no particles".to_owned(),
            "add a [[feed]], or `start_checkpoint = \"…\"`",
        );
    }
}
