//! Each particle comes from one place.
//!
//! - `feed-twice` (error): a feed in two stages of which one lies upstream of the other, or which both lead to a third: its
//!   particles would be there twice. Variants of one stage may share a feed.
//! - `feed-straddles` (error): particles of an initial state on both sides of a gate plane, and no stage that names the feed.

use super::{Subject, join};
use crate::dem::feed::FeedKind;

pub(super) fn check(subject: &Subject<'_>) {
    if subject.draft.stages.whole {
        twice(subject);
        straddles(subject);
    }
}

fn twice(subject: &Subject<'_>) {
    let stages = &subject.draft.stages.stages;
    let feeds: Vec<Vec<usize>> = (0..stages.len()).map(|stage| subject.layout.feeds_of(stage)).collect();
    for (index, feed) in subject.draft.feeds.iter().enumerate() {
        let in_one_run = (0..stages.len()).find_map(|stage| {
            let mut run = subject.layout.ancestors(stage);
            run.push(stage);
            run.retain(|member| feeds[*member].contains(&index));
            run.dedup();
            (run.len() > 1).then_some(run)
        });
        if let Some(run) = in_one_run {
            let (first, second) = (&stages[run[0]].item.name, &stages[run[1]].item.name);
            subject.error(
                "feed-twice",
                &feed.path,
                format!(
                    "feed \"{}\" is in stages \"{first}\" and \"{second}\": its particles would be there twice",
                    feed.item.name
                ),
                "name it in `feeds` of one of them; where no stage names it, the gate planes decide",
            );
        }
    }
}

fn straddles(subject: &Subject<'_>) {
    let stages = &subject.draft.stages.stages;
    for (index, feed) in subject.draft.feeds.iter().enumerate() {
        let FeedKind::File { particles } = &feed.item.kind else { continue };
        if subject.layout.is_named(index) {
            continue;
        }
        let deciding = (0..stages.len()).filter(|stage| stages[*stage].item.feeds.is_none());
        let mut planes =
            deciding.flat_map(|stage| [subject.layout.entering(stage), subject.layout.leaving(stage)].concat());
        let crossed = planes.any(|(plane, _)| {
            let beyond = particles.iter().filter(|particle| plane.distance(&particle.position) >= 0.0).count();
            (1..particles.len()).contains(&beyond)
        });
        if crossed {
            subject.error(
                "feed-straddles",
                &join(&feed.path, "file"),
                format!("particles of feed \"{}\" lie on both sides of a gate plane", feed.item.name),
                "make a file for each side, or name the feed in `feeds` of one stage",
            );
        }
    }
}
