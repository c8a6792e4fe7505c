//! `feed-window` (error): a feed that stops before it starts, or starts after the run has ended.

use super::{Subject, join, round};
use crate::dem::feed::FeedKind;

pub(super) fn check(subject: &Subject<'_>) {
    for feed in &subject.draft.feeds {
        let (FeedKind::Fill { start, until, .. } | FeedKind::Stream { start, until, .. }) = feed.item.kind else {
            continue;
        };
        if until < start {
            let what = format!("the feed stops at {} s, and starts at {} s", round(until), round(start));
            subject.error("feed-window", &join(&feed.path, "until"), what, "make `until` later than `start`");
        }
        if let Some(end) = subject.draft.end
            && start > end.time
        {
            let what = format!("the feed starts at {} s, and the run ends at {} s", round(start), round(end.time));
            subject.error(
                "feed-window",
                &join(&feed.path, "start"),
                what,
                "start the feed earlier, or end the run later",
            );
        }
    }
}
