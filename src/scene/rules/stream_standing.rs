//! `stream-standing` (error): a stream whose velocity lies in its own face never leaves it, and blocks itself.

use super::{Subject, join};
use crate::dem::feed::{Face, FeedKind};

pub(super) fn check(subject: &Subject<'_>) {
    for feed in &subject.draft.feeds {
        let FeedKind::Stream { face, velocity, .. } = &feed.item.kind else { continue };
        let normal = match face {
            Face::Disc { normal, .. } => *normal,
            Face::Rectangle { side_a, side_b, .. } => side_a.cross(side_b).normalize(),
        };
        if velocity.dot(&normal).abs() <= 1e-9 * velocity.norm() {
            subject.error(
                "stream-standing",
                &join(&feed.path, "velocity"),
                format!("feed \"{}\" does not leave its face: the velocity has no part across it", feed.item.name),
                "give a velocity across the face, for example 1 m/s",
            );
        }
    }
}
