//! `at-rest-never` (error): a condition that waits for rest and cannot be met before the run ends.
//!
//! Rest needs at least one particle, all feeds due so far finished, and a hold that fits before the end. A stream that
//! goes on until the end keeps the condition from ever holding.

use super::{Subject, join, round};
use crate::dem::feed::{Amount, FeedKind, Rate};
use crate::geometry::part::{AtRest, Trigger};

pub(super) fn check(subject: &Subject<'_>) {
    let Some(end) = subject.draft.end else { return };
    let mut conditions: Vec<(String, AtRest)> = Vec::new();
    if let Some(rest) = end.at_rest {
        conditions.push(("end.at_rest".to_owned(), rest));
    }
    for part in &subject.draft.parts {
        for (key, trigger) in [("appears", part.item.part.appears), ("disappears", part.item.part.disappears)] {
            if let Trigger::AtRest(rest) = trigger {
                conditions.push((join(&part.path, key), rest));
            }
        }
    }
    for (path, rest) in conditions {
        if let Some(reason) = reason(subject, &rest, end.time) {
            report(subject, &path, &reason);
        }
    }
    // Whose feeds go on in a stage of its own is not judged, only whether there is time.
    for stage in &subject.draft.stages.stages {
        let Some(end) = stage.item.end else { continue };
        if let Some(reason) = end.at_rest.and_then(|rest| too_late(&rest, end.time)) {
            report(subject, &join(&stage.path, "end.at_rest"), &reason);
        }
    }
}

fn report(subject: &Subject<'_>, path: &str, reason: &str) {
    let what = format!("this can never be at rest before the end: {reason}");
    subject.error("at-rest-never", path, what, "end the feeds earlier, or the run later");
}

fn too_late(rest: &AtRest, end: f64) -> Option<String> {
    let earliest = rest.not_before + rest.hold;
    (earliest > end)
        .then(|| format!("`not_before` and `hold` last until {} s, the run until {} s", round(earliest), round(end)))
}

fn reason(subject: &Subject<'_>, rest: &AtRest, end: f64) -> Option<String> {
    if let Some(reason) = too_late(rest, end) {
        return Some(reason);
    }
    let has_other = subject.draft.start_checkpoint.is_some() || subject.has_stored_stream();
    if subject.draft.feeds.is_empty() && !has_other && !subject.written.has_path("feed") {
        return Some("there are no particles".to_owned());
    }
    subject.draft.feeds.iter().find_map(|feed| {
        let FeedKind::Stream { rate, amount, start, until, .. } = &feed.item.kind else { return None };
        let last = match (amount, rate) {
            (Some(Amount::Count(count)), Rate::Count(rate)) => start + *count as f64 / rate,
            (Some(Amount::Mass(mass)), Rate::Mass(rate)) => start + mass / rate,
            // Count against mass depends on the sizes drawn; no verdict.
            (Some(_), _) => *start,
            (None, _) => f64::INFINITY,
        };
        (*start <= 0.0 && last.min(*until) >= end)
            .then(|| format!("feed \"{}\" goes on until the run ends at {} s", feed.item.name, round(end)))
    })
}
