//! `pair-twice` (error): one pair of materials has one set of properties, whichever is named first.

use super::{Subject, join};

pub(super) fn check(subject: &Subject<'_>) {
    let pairs = &subject.draft.pairs;
    for (index, pair) in pairs.iter().enumerate() {
        let (a, b) = (pair.item.a, pair.item.b);
        let same = |x: u16, y: u16| (x, y) == (a, b) || (y, x) == (a, b);
        if pairs[..index].iter().any(|other| same(other.item.a, other.item.b)) {
            subject.error(
                "pair-twice",
                &join(&pair.path, "between"),
                format!("the pair of {} and {} is given twice", subject.material(a), subject.material(b)),
                "keep one of the two",
            );
        }
    }
}
