//! `characteristic-velocity` (error): the linear law derives its stiffness from Young's modulus at a characteristic
//! collision velocity; without it there is no stiffness.

use super::Subject;
use crate::dem::law::NormalLaw;
use crate::material::PairContact;

pub(super) fn check(subject: &Subject<'_>) {
    let linear = subject.draft.law.is_some_and(|law| law.normal == NormalLaw::Linear);
    if !linear || subject.written.has_path("contact.characteristic_velocity") {
        return;
    }
    let derived =
        subject.draft.pairs.iter().find(|pair| {
            pair.item.properties.is_some_and(|pair| matches!(pair.contact, PairContact::Restitution { .. }))
        });
    if let Some(pair) = derived {
        let (a, b) = (subject.material(pair.item.a), subject.material(pair.item.b));
        subject.error(
            "characteristic-velocity",
            "contact.law",
            format!("the linear law needs a `characteristic_velocity` for the stiffness of {a} with {b}"),
            "add for example `characteristic_velocity = \"1 m/s\"` to [contact], or give the pair its stiffnesses",
        );
    }
}
