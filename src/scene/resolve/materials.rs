//! `[material.NAME]` and `[[pair]]`.

use super::{Context, Located, PairDraft};
use crate::dem::law::{LawSettings, RollingLaw};
use crate::material::{Elasticity, Material, PairContact, PairProperties};
use crate::scene::quantity::Dimension;
use crate::scene::reader::{Limit, Reader};
use crate::scene::tree::{Node, Value};

/// All materials, in the file's order.
pub(super) fn materials(reader: &Reader<'_>) -> Vec<Material> {
    reader.named_tables("material", "material").into_iter().map(|(name, table)| material(name, table)).collect()
}

fn material(name: String, reader: Reader<'_>) -> Material {
    let density = reader.quantity("density", Dimension::Density, Limit::Positive);
    let rigid = matches!(reader.node("youngs_modulus"), Some(Node { value: Value::Text(text), .. }) if text == "rigid");
    let ratio = if reader.has("poissons_ratio") {
        reader.quantity("poissons_ratio", Dimension::Dimensionless, Limit::Between(-1.0, 0.5))
    } else {
        if reader.has("youngs_modulus") && !rigid {
            reader.missing("poissons_ratio", "poissons_ratio = 0.25");
        }
        None
    };
    let elasticity = if rigid {
        Some(Elasticity::Rigid)
    } else {
        let modulus = reader.quantity("youngs_modulus", Dimension::Pressure, Limit::Positive);
        modulus
            .zip(ratio)
            .map(|(youngs_modulus, poissons_ratio)| Elasticity::Isotropic { youngs_modulus, poissons_ratio })
    };
    reader.finish();
    Material { name, density, elasticity }
}

const DIRECT: [&str; 4] = ["normal_stiffness", "tangential_stiffness", "normal_damping", "tangential_damping"];

/// All pairs, in the file's order; and whether each names two materials.
pub(super) fn pairs(
    reader: &Reader<'_>,
    context: &Context<'_>,
    law: Option<&LawSettings>,
) -> (Vec<Located<PairDraft>>, bool) {
    let tables = reader.tables("pair", "pair");
    let count = tables.len();
    let pairs: Vec<_> = tables.into_iter().filter_map(|table| pair(table, context, law)).collect();
    let whole = pairs.len() == count;
    (pairs, whole)
}

fn pair(reader: Reader<'_>, context: &Context<'_>, law: Option<&LawSettings>) -> Option<Located<PairDraft>> {
    let ends = between(&reader, context);
    let contact = if reader.has("restitution") {
        restitution(&reader)
    } else if DIRECT.iter().any(|key| reader.has(key)) {
        stiffness(&reader, law)
    } else {
        reader.missing("restitution", "restitution = 0.5");
        None
    };
    let friction = reader.need_quantity("friction", Dimension::Dimensionless, Limit::NotNegative);
    let rolling = reader.quantity("rolling_friction", Dimension::Dimensionless, Limit::NotNegative);
    rolling_friction(&reader, law);
    let path = reader.path();
    reader.finish();
    let properties = contact.zip(friction).map(|(contact, sliding_friction)| PairProperties {
        contact,
        sliding_friction,
        rolling_friction: rolling.unwrap_or(0.0),
    });
    let (a, b) = ends?;
    Some(Located { path, item: PairDraft { a, b, properties } })
}

fn between(reader: &Reader<'_>, context: &Context<'_>) -> Option<(u16, u16)> {
    let example = "between = [\"…\", \"…\"]";
    let Some(node) = reader.node("between") else {
        reader.missing("between", example);
        return None;
    };
    let Value::Array(items) = &node.value else {
        reader.wrong_type("between", node, "an array of two material names", "[\"…\", \"…\"]");
        return None;
    };
    let [first, second] = items.as_slice() else {
        reader.report.error(
            "wrong-length",
            &node.place,
            format!("`between` needs 2 elements, and has {}", items.len()),
            "name the two materials; a material with itself is named twice",
        );
        return None;
    };
    let index = |item| reader.reference_of("between", item, "material", &context.materials);
    let (a, b) = (index(first), index(second));
    Some((u16::try_from(a?).ok()?, u16::try_from(b?).ok()?))
}

fn restitution(reader: &Reader<'_>) -> Option<PairContact> {
    let direct: Vec<&str> = DIRECT.into_iter().filter(|key| reader.has(key)).collect();
    for key in DIRECT {
        let _ = reader.measured(key, &[Dimension::Stiffness, Dimension::Damping]);
    }
    if !direct.is_empty() {
        reader.report.error(
            "pair-both",
            &reader.place_of(direct[0]),
            format!("the pair has `restitution` and `{}`: two answers to one question", direct[0]),
            "keep `restitution`, or else the stiffnesses and dampings",
        );
    }
    let coefficient = reader.quantity("restitution", Dimension::Dimensionless, Limit::Within(0.0, 1.0))?;
    direct.is_empty().then_some(PairContact::Restitution { coefficient })
}

fn stiffness(reader: &Reader<'_>, law: Option<&LawSettings>) -> Option<PairContact> {
    let normal_stiffness = reader.need_quantity("normal_stiffness", Dimension::Stiffness, Limit::Positive);
    let tangential_stiffness = reader.need_quantity("tangential_stiffness", Dimension::Stiffness, Limit::NotNegative);
    let normal_damping = reader.need_quantity("normal_damping", Dimension::Damping, Limit::NotNegative);
    let tangential_damping = if law.is_some_and(|law| !law.tangential_damping) {
        Some(reader.quantity("tangential_damping", Dimension::Damping, Limit::NotNegative).unwrap_or(0.0))
    } else {
        reader.need_quantity("tangential_damping", Dimension::Damping, Limit::NotNegative)
    };
    Some(PairContact::Stiffness {
        normal_stiffness: normal_stiffness?,
        tangential_stiffness: tangential_stiffness?,
        normal_damping: normal_damping?,
        tangential_damping: tangential_damping?,
    })
}

/// `rolling_friction` goes with a rolling law, and a rolling law with `rolling_friction`.
fn rolling_friction(reader: &Reader<'_>, law: Option<&LawSettings>) {
    let Some(law) = law else { return };
    match (law.rolling, reader.has("rolling_friction")) {
        (RollingLaw::None, true) => reader.report.warning(
            "rolling-friction-unused",
            &reader.place_of("rolling_friction"),
            "`rolling_friction` has no effect: the scene has no rolling resistance",
            "remove it, or write `rolling = \"cdt\"` or `rolling = \"epsd2\"` in [contact]",
        ),
        (RollingLaw::Cdt | RollingLaw::Epsd2, false) => reader.report.error(
            "rolling-friction",
            reader.place,
            "the scene has rolling resistance, and this pair has no `rolling_friction`",
            "add for example `rolling_friction = 0.05`; 0 for none in this pair",
        ),
        _ => {}
    }
}
