//! `rigid-pair` (error): two rigid materials have no stiffness between them.

use super::{Subject, join};
use crate::material::{Elasticity, PairContact};

pub(super) fn check(subject: &Subject<'_>) {
    for pair in &subject.draft.pairs {
        let by_restitution =
            pair.item.properties.is_some_and(|pair| matches!(pair.contact, PairContact::Restitution { .. }));
        let rigid = |index: u16| {
            subject.draft.materials.get(usize::from(index)).is_some_and(|m| m.elasticity == Some(Elasticity::Rigid))
        };
        if by_restitution && rigid(pair.item.a) && rigid(pair.item.b) {
            let (a, b) = (subject.material(pair.item.a), subject.material(pair.item.b));
            subject.error(
                "rigid-pair",
                &join(&pair.path, "between"),
                format!("{a} and {b} are both rigid, so nothing yields where they touch"),
                "give one of them a Young's modulus, or the pair its stiffnesses",
            );
        }
    }
}
