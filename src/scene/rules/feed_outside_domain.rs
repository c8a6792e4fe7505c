//! `feed-outside-domain` (error): particles whose centre is outside of the domain leave at once.

use super::{Subject, join};
use crate::dem::feed::FeedKind;
use crate::particle::Body;
use crate::scene::extent;

pub(super) fn check(subject: &Subject<'_>) {
    let domain = subject.domain.bounds;
    for feed in &subject.draft.feeds {
        let bounds = extent::of_feed(&feed.item.kind);
        if bounds.is_empty() || domain.size().min() <= 0.0 {
            continue;
        }
        let key = match feed.item.kind {
            FeedKind::Fill { .. } => "region",
            FeedKind::Stream { .. } => "face",
            FeedKind::File { .. } => "file",
        };
        // In a plane problem all centres lie at y = 0, whatever the region says.
        let axes: &[usize] = if subject.draft.body == Body::Sphere { &[0, 1, 2] } else { &[0, 2] };
        // Round-off of a region that ends where the domain ends is no finding.
        let slack = 1e-9 * domain.size().max();
        let out = axes.iter().find(|axis| {
            bounds.minimum[**axis] < domain.minimum[**axis] - slack
                || bounds.maximum[**axis] > domain.maximum[**axis] + slack
        });
        if let Some(axis) = out {
            subject.error(
                "feed-outside-domain",
                &join(&feed.path, key),
                format!("feed \"{}\" reaches out of the domain along {}", feed.item.name, ["x", "y", "z"][*axis]),
                "enlarge [domain], or move the feed",
            );
        }
    }
}
