//! `periodic-extent` (error): along a periodic axis the domain is a physical length, so it must be given, and it must
//! hold three of the largest particles, or one could be a neighbour of another from both sides.

use super::{Subject, join, mm};
use crate::particle::Body;

pub(super) fn check(subject: &Subject<'_>) {
    let given = &subject.draft.domain;
    for axis in 0..3 {
        if !given.periodic[axis] {
            continue;
        }
        let name = ["x", "y", "z"][axis];
        let path = join("domain.boundary", name);
        if axis == 1 && subject.draft.body != Body::Sphere {
            let what = "a plane problem has no extent along y that could be periodic".to_owned();
            subject.error("periodic-extent", &path, what, "remove it");
        } else if given.minimum.is_none() || given.maximum.is_none() {
            let missing = [("min", given.minimum), ("max", given.maximum)];
            if missing.iter().any(|(key, corner)| corner.is_none() && !subject.written.has_path(&join("domain", key))) {
                let what = format!("{name} is periodic, so the domain needs `min` and `max`");
                subject.error("periodic-extent", &path, what, "add both to [domain]");
            }
        } else {
            let bounds = subject.domain.bounds;
            let length = bounds.maximum[axis] - bounds.minimum[axis];
            if length > 0.0 && length < 3.0 * subject.largest {
                let (length, largest) = (mm(length), mm(subject.largest));
                let what = format!(
                    "the period along {name} ({length}) is less than three of the largest particle ({largest})"
                );
                subject.error("periodic-extent", &path, what, "enlarge the domain");
            }
        }
    }
}
