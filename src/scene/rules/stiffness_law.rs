//! `stiffness-law` (error): constant stiffnesses belong to the linear law; the stiffness of Hertz grows with the overlap.

use super::{Subject, join};
use crate::dem::law::NormalLaw;
use crate::material::PairContact;

pub(super) fn check(subject: &Subject<'_>) {
    if !subject.draft.law.is_some_and(|law| law.normal == NormalLaw::HertzMindlin) {
        return;
    }
    for pair in &subject.draft.pairs {
        if pair.item.properties.is_some_and(|pair| matches!(pair.contact, PairContact::Stiffness { .. })) {
            subject.error(
                "stiffness-law",
                &join(&pair.path, "normal_stiffness"),
                "a constant stiffness has no place in the Hertz law".to_owned(),
                "write `restitution`, or `law = \"linear\"` in [contact]",
            );
        }
    }
}
