//! `domain-empty` (error): a domain whose lower corner is not below its upper one holds nothing.

use super::Subject;

pub(super) fn check(subject: &Subject<'_>) {
    let bounds = subject.domain.bounds;
    for axis in 0..3 {
        let given = &subject.draft.domain;
        let both_or_one = given.minimum.is_some() || given.maximum.is_some();
        if both_or_one && bounds.minimum[axis] >= bounds.maximum[axis] {
            let name = ["x", "y", "z"][axis];
            subject.error(
                "domain-empty",
                if given.maximum.is_some() { "domain.max" } else { "domain.min" },
                format!("the domain is empty along {name}: `max` must be greater than `min`"),
                "give the lower corner as `min` and the upper one as `max`",
            );
        }
    }
}
