//! `no-feed` (warning): a scene without feeds, without a start checkpoint and without a stored stream has no particles.

use super::Subject;

pub(super) fn check(subject: &Subject<'_>) {
    let has_other = subject.draft.start_checkpoint.is_some() || subject.has_stored_stream();
    if !subject.written.has_path("feed") && !has_other {
        subject.warning(
            "no-feed",
            "",
            "the scene has no feed and no start checkpoint, so it has no particles".to_owned(),
            "add a [[feed]], or `start_checkpoint = \"…\"`",
        );
    }
}
