//! `elasticity-missing` (error): a pair given by its restitution takes its stiffness from both materials.

use super::Subject;
use crate::material::PairContact;

pub(super) fn check(subject: &Subject<'_>) {
    let mut reported = Vec::new();
    for pair in &subject.draft.pairs {
        let by_restitution =
            pair.item.properties.is_some_and(|pair| matches!(pair.contact, PairContact::Restitution { .. }));
        for material in [pair.item.a, pair.item.b] {
            let name = subject.material(material);
            let given = subject.written.has_path(&format!("material.{name}.youngs_modulus"));
            let missing = subject.draft.materials[usize::from(material)].elasticity.is_none() && !given;
            if by_restitution && missing && !reported.contains(&material) {
                reported.push(material);
                subject.error(
                    "elasticity-missing",
                    &format!("material.{name}"),
                    format!(
                        "material \"{name}\" has no `youngs_modulus`, and a pair of it is given by its restitution"
                    ),
                    "add `youngs_modulus` and `poissons_ratio`, or `youngs_modulus = \"rigid\"` for a wall",
                );
            }
        }
    }
}
