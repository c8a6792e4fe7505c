//! Contact laws and materials as LIGGGHTS takes them: a pair style, a wall model, and one property a line.
//!
//! Where its formulas are others than ours, docs/theory/conventions.md names them; what it cannot do at all is refused here.

use super::deck_number;
use crate::dem::law::{LawSettings, NormalLaw, RollingLaw, TangentialLaw};
use crate::material::{Elasticity, MaterialTable, PairContact, PairProperties};

/// Young's modulus of a rigid material [Pa]. LIGGGHTS knows no rigid wall; this one's compliance 1/E is lost in the round-off of
/// the sum (1 - nu_i^2)/E_i + (1 - nu_j^2)/E_j as long as E_i < 1e24 Pa, so that E* and G* are those of a rigid partner to the
/// last bit.
pub const RIGID_YOUNGS_MODULUS: f64 = 1e40;
/// Young's modulus below which LIGGGHTS wants `soft_particles yes` [Pa].
const SOFT: f64 = 5e6;
/// Young's modulus above which LIGGGHTS wants `hard_particles yes` [Pa].
const HARD: f64 = 1e9;
/// LIGGGHTS takes coefficients of restitution above this one only [-].
const SMALLEST_RESTITUTION: f64 = 0.05;
/// LIGGGHTS takes characteristic velocities from this one on [m/s].
const SMALLEST_CHARACTERISTIC_VELOCITY: f64 = 0.01;

/// The contact laws of a deck. Material number m of the table is atom type m + 1.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Models {
    /// What follows `pair_style`.
    pub pair_style: String,
    /// What follows `fix ID all wall/gran`, before `primitive` or `mesh`.
    pub wall_model: String,
    /// What ends a `fix ID all wall/gran`; may be empty.
    pub wall_options: String,
    /// Lines that stand after `create_box` and before `pair_style`, with comments; a value list may go over several lines.
    pub properties: Vec<String>,
}

/// The laws of a scene for LIGGGHTS.
///
/// # Errors
/// All that LIGGGHTS cannot do, in the user's words, with what to do about it.
pub fn models(law: &LawSettings, materials: &MaterialTable) -> Result<Models, Vec<String>> {
    let faults = refusals(law, materials);
    if !faults.is_empty() {
        return Err(faults);
    }
    let direct = pairs(materials).any(|(_, _, pair)| matches!(pair.contact, PairContact::Stiffness { .. }));
    let rolling = rolls(law, materials);
    let normal = match (law.normal, direct) {
        (NormalLaw::Linear, true) => "hooke/stiffness",
        (NormalLaw::Linear, false) => "hooke",
        (NormalLaw::HertzMindlin, _) => "hertz",
    };
    let mut model = format!("model {normal} tangential history");
    match law.rolling {
        RollingLaw::Cdt if rolling => model += " rolling_friction cdt",
        RollingLaw::Epsd2 if rolling => model += " rolling_friction epsd2",
        _ => {}
    }
    let options = [
        (direct, "absolute_damping on"),
        (!law.tangential_damping, "tangential_damping off"),
        (!law.attraction, "limitForce on"),
    ];
    let options: Vec<&str> = options.iter().filter(|(on, _)| *on).map(|(_, text)| *text).collect();
    let wall_options = options.join(" ");
    let pair_style = format!("gran {model} {wall_options}").trim_end().to_owned();
    Ok(Models { pair_style, wall_model: model, wall_options, properties: properties(law, materials, direct, rolling) })
}

/// Whether rolling resistance acts in some pair.
fn rolls(law: &LawSettings, materials: &MaterialTable) -> bool {
    law.rolling != RollingLaw::None && pairs(materials).any(|(_, _, pair)| pair.rolling_friction > 0.0)
}

/// The pairs that the scene gives, each once.
fn pairs(materials: &MaterialTable) -> impl Iterator<Item = (u16, u16, &PairProperties)> {
    let count = count(materials);
    let all = (0..count).flat_map(move |a| (a..count).map(move |b| (a, b)));
    all.filter_map(|(a, b)| materials.pair(a, b).map(|pair| (a, b, pair)))
}

fn count(materials: &MaterialTable) -> u16 {
    u16::try_from(materials.materials.len()).unwrap_or(u16::MAX)
}

fn refusals(law: &LawSettings, materials: &MaterialTable) -> Vec<String> {
    let mut faults = Vec::new();
    if law.tangential == TangentialLaw::Incremental {
        faults.push(
            "LIGGGHTS keeps the whole tangential displacement: contact.tangential = \"incremental\" runs on the native solver only; \
             use \"total\""
                .to_owned(),
        );
    }
    let name = |m: u16| &materials.materials[usize::from(m)].name;
    let (mut direct, mut derived) = (None, None);
    for (a, b, pair) in pairs(materials) {
        let between = format!("between `{}` and `{}`", name(a), name(b));
        match pair.contact {
            PairContact::Stiffness { .. } => direct = direct.or(Some(between)),
            PairContact::Restitution { coefficient } => {
                if coefficient <= SMALLEST_RESTITUTION {
                    faults.push(format!(
                        "LIGGGHTS takes coefficients of restitution above {SMALLEST_RESTITUTION}; {between} it is {coefficient}: \
                         raise it, or use the native solver"
                    ));
                }
                derived = derived.or(Some(between));
            }
        }
    }
    if let (Some(direct), Some(derived)) = (&direct, &derived) {
        faults.push(format!(
            "LIGGGHTS takes the stiffness of all pairs in one way; it is given {direct} and follows from Young's modulus {derived}: \
             give both in one way, or use the native solver"
        ));
    }
    if derived.is_some() {
        faults.extend(poisson_refusals(materials));
        if law.normal == NormalLaw::Linear && law.characteristic_velocity < SMALLEST_CHARACTERISTIC_VELOCITY {
            faults.push(format!(
                "LIGGGHTS takes characteristic velocities from {SMALLEST_CHARACTERISTIC_VELOCITY} m/s on; it is {} m/s: raise it, \
                 or use the native solver",
                law.characteristic_velocity
            ));
        }
    } else if let (Some(direct), NormalLaw::HertzMindlin) = (&direct, law.normal) {
        faults.push(format!(
            "stiffnesses in N/m, as given {direct}, belong to contact.law = \"linear\"; Hertz's law takes Young's modulus"
        ));
    }
    faults
}

fn poisson_refusals(materials: &MaterialTable) -> Vec<String> {
    let outside = materials.materials.iter().filter_map(|material| match material.elasticity {
        Some(Elasticity::Isotropic { poissons_ratio, .. }) if !(0.0..=0.5).contains(&poissons_ratio) => Some(format!(
            "LIGGGHTS takes Poisson's ratios from 0 to 0.5; that of `{}` is {poissons_ratio}: use the native solver",
            material.name
        )),
        _ => None,
    });
    outside.collect()
}

fn properties(law: &LawSettings, materials: &MaterialTable, direct: bool, rolling: bool) -> Vec<String> {
    let mut lines = vec![atom_types(materials)];
    if direct {
        lines.extend(direct_stiffness(materials));
    } else {
        lines.extend(elastic_constants(materials));
        let restitution = |pair: &PairProperties| match pair.contact {
            PairContact::Restitution { coefficient } => coefficient,
            PairContact::Stiffness { .. } => 1.0,
        };
        lines.push("# Coefficient of restitution [-]".to_owned());
        lines.extend(table(materials, "coefficient_of_restitution", "coefficientRestitution", 1.0, restitution));
        if law.normal == NormalLaw::Linear {
            lines.push(
                "# Collision velocity at which the linear spring takes up as much energy as Hertz's [m/s]".to_owned(),
            );
            lines.push(format!(
                "fix characteristic_velocity all property/global characteristicVelocity scalar {}",
                deck_number(law.characteristic_velocity)
            ));
        }
    }
    lines.push("# Sliding friction [-]".to_owned());
    lines.extend(table(materials, "sliding_friction", "coefficientFriction", 0.0, |pair| pair.sliding_friction));
    if rolling {
        lines.push("# Rolling friction [-]".to_owned());
        lines.extend(table(materials, "rolling_friction", "coefficientRollingFriction", 0.0, |p| p.rolling_friction));
    }
    lines
}

/// Which material is which atom type; only letters, digits, `_` and `-` of their names reach the deck.
fn atom_types(materials: &MaterialTable) -> String {
    let safe = |c: char| if c.is_ascii_alphanumeric() || c == '_' || c == '-' { c } else { '_' };
    let named = materials.materials.iter().zip(1..).map(|(material, number)| {
        let name: String = material.name.chars().map(safe).collect();
        format!("{number} {name}")
    });
    format!("# Atom types: {}; pairs that never touch are 1 (restitution) or 0", named.collect::<Vec<_>>().join(", "))
}

fn elastic_constants(materials: &MaterialTable) -> Vec<String> {
    let constants: Vec<(f64, f64)> = materials
        .materials
        .iter()
        .map(|material| match material.elasticity {
            Some(Elasticity::Isotropic { youngs_modulus, poissons_ratio }) => (youngs_modulus, poissons_ratio),
            Some(Elasticity::Rigid) | None => (RIGID_YOUNGS_MODULUS, 0.0),
        })
        .collect();
    let list = |value: fn(&(f64, f64)) -> f64| {
        constants.iter().map(|constant| deck_number(value(constant))).collect::<Vec<_>>().join(" ")
    };
    let mut lines = Vec::new();
    if constants.iter().any(|(modulus, _)| *modulus < SOFT) {
        lines.push(format!("# Young's moduli below {} Pa", deck_number(SOFT)));
        lines.push("soft_particles yes".to_owned());
    }
    if constants.iter().any(|(modulus, _)| *modulus > HARD) {
        lines.push(format!("# Young's moduli above {} Pa", deck_number(HARD)));
        lines.push("hard_particles yes".to_owned());
    }
    let rigid = if constants.iter().any(|(modulus, _)| *modulus == RIGID_YOUNGS_MODULUS) {
        format!("; {} is a rigid material", deck_number(RIGID_YOUNGS_MODULUS))
    } else {
        String::new()
    };
    lines.push(format!("# Young's modulus [Pa]{rigid}"));
    lines.push(format!("fix youngs_modulus all property/global youngsModulus peratomtype {}", list(|c| c.0)));
    lines.push("# Poisson's ratio [-]".to_owned());
    lines.push(format!("fix poissons_ratio all property/global poissonsRatio peratomtype {}", list(|c| c.1)));
    lines
}

fn direct_stiffness(materials: &MaterialTable) -> Vec<String> {
    let constant = |index: usize| {
        move |pair: &PairProperties| match pair.contact {
            PairContact::Stiffness { normal_stiffness, tangential_stiffness, normal_damping, tangential_damping } => {
                [normal_stiffness, tangential_stiffness, normal_damping, tangential_damping][index]
            }
            PairContact::Restitution { .. } => 0.0,
        }
    };
    let names = [
        ("# Normal stiffness [N/m]", "normal_stiffness", "kn"),
        ("# Tangential stiffness [N/m]", "tangential_stiffness", "kt"),
        ("# Normal damping [kg/s]", "normal_damping", "gamman_abs"),
        ("# Tangential damping [kg/s]", "tangential_damping", "gammat_abs"),
    ];
    let mut lines = Vec::new();
    for (index, (comment, id, property)) in names.into_iter().enumerate() {
        lines.push(comment.to_owned());
        lines.extend(table(materials, id, property, 0.0, constant(index)));
    }
    lines
}

/// A property of pairs as one command, a row of the table a line.
fn table(
    materials: &MaterialTable,
    id: &str,
    property: &str,
    absent: f64,
    value: impl Fn(&PairProperties) -> f64,
) -> Vec<String> {
    let count = count(materials);
    let row = |a: u16| {
        let values = (0..count).map(|b| deck_number(materials.pair(a, b).map_or(absent, &value)));
        values.collect::<Vec<_>>().join(" ")
    };
    let head = format!("fix {id} all property/global {property} peratomtypepair {count}");
    if count == 1 {
        return vec![format!("{head} {}", row(0))];
    }
    let mut lines = vec![format!("{head} &")];
    lines.extend((0..count).map(|a| format!("    {}{}", row(a), if a + 1 < count { " &" } else { "" })));
    lines
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::dem::law::Compatibility;
    use crate::dem::law::constants::PairConstants;
    use crate::material::Material;

    const LAW: LawSettings = LawSettings {
        normal: NormalLaw::HertzMindlin,
        tangential: TangentialLaw::Total,
        tangential_damping: true,
        attraction: true,
        rolling: RollingLaw::None,
        characteristic_velocity: 1.0,
        compatibility: Compatibility::Tollgate,
    };

    fn grain_and_wall(contact: PairContact) -> MaterialTable {
        let elasticity = Elasticity::Isotropic { youngs_modulus: 4.5e6, poissons_ratio: 0.3 };
        let mut table = MaterialTable::new(vec![
            Material { name: "grain".into(), density: Some(2500.0), elasticity: Some(elasticity) },
            Material { name: "steel".into(), density: None, elasticity: Some(Elasticity::Rigid) },
        ]);
        let pair = |friction| PairProperties { contact, sliding_friction: friction, rolling_friction: 0.1 };
        table.set_pair(0, 0, pair(0.5));
        table.set_pair(0, 1, pair(0.4));
        table
    }

    fn refused(law: &LawSettings, table: &MaterialTable) -> String {
        models(law, table).expect_err("must be refused").join("\n")
    }

    #[test]
    fn hertz_takes_elastic_constants_and_restitution() {
        let table = grain_and_wall(PairContact::Restitution { coefficient: 0.6 });
        let models = models(&LAW, &table).expect("LIGGGHTS can");
        assert_eq!(models.pair_style, "gran model hertz tangential history");
        assert_eq!((models.wall_model.as_str(), models.wall_options.as_str()), ("model hertz tangential history", ""));
        let text = models.properties.join("\n");
        for line in [
            "# Atom types: 1 grain, 2 steel; pairs that never touch are 1 (restitution) or 0",
            "soft_particles yes",
            "hard_particles yes",
            "fix youngs_modulus all property/global youngsModulus peratomtype 4500000 1e40",
            "fix poissons_ratio all property/global poissonsRatio peratomtype 0.3 0",
            "fix coefficient_of_restitution all property/global coefficientRestitution peratomtypepair 2 &\n    0.6 0.6 &\n    0.6 1",
            "fix sliding_friction all property/global coefficientFriction peratomtypepair 2 &\n    0.5 0.4 &\n    0.4 0",
        ] {
            assert!(text.contains(line), "{line} is not in\n{text}");
        }
        assert!(!text.contains("Rolling"), "no rolling law, no rolling friction:\n{text}");
    }

    #[test]
    fn a_rigid_wall_has_no_compliance_to_the_last_bit() {
        let mut table = grain_and_wall(PairContact::Restitution { coefficient: 0.6 });
        let rigid = PairConstants::of(&table, 0, 1).expect("given");
        table.materials[1].elasticity =
            Some(Elasticity::Isotropic { youngs_modulus: RIGID_YOUNGS_MODULUS, poissons_ratio: 0.0 });
        assert_eq!(PairConstants::of(&table, 0, 1).expect("given"), rigid);
    }

    #[test]
    fn settings_become_options_of_pairs_and_walls() {
        let table = grain_and_wall(PairContact::Restitution { coefficient: 0.6 });
        let law = LawSettings { tangential_damping: false, attraction: false, rolling: RollingLaw::Epsd2, ..LAW };
        let found = models(&law, &table).expect("LIGGGHTS can");
        let model = "model hertz tangential history rolling_friction epsd2";
        assert_eq!(
            (found.wall_model.as_str(), found.wall_options.as_str()),
            (model, "tangential_damping off limitForce on")
        );
        assert_eq!(found.pair_style, format!("gran {model} tangential_damping off limitForce on"));
        assert!(found.properties.iter().any(|line| line.contains("coefficientRollingFriction")));
        let linear = LawSettings { normal: NormalLaw::Linear, rolling: RollingLaw::Cdt, ..LAW };
        let found = models(&linear, &table).expect("LIGGGHTS can");
        assert_eq!(found.pair_style, "gran model hooke tangential history rolling_friction cdt");
        assert!(found.properties.iter().any(|line| line.ends_with("characteristicVelocity scalar 1")));
    }

    #[test]
    fn stiffnesses_given_directly_are_absolute() {
        let contact = PairContact::Stiffness {
            normal_stiffness: 1000.0,
            tangential_stiffness: 300.0,
            normal_damping: 0.02,
            tangential_damping: 0.01,
        };
        let table = grain_and_wall(contact);
        let linear = LawSettings { normal: NormalLaw::Linear, ..LAW };
        let found = models(&linear, &table).expect("LIGGGHTS can");
        assert_eq!(found.pair_style, "gran model hooke/stiffness tangential history absolute_damping on");
        let text = found.properties.join("\n");
        assert!(text.contains("gamman_abs peratomtypepair 2 &\n    0.02 0.02 &\n    0.02 0"), "{text}");
        assert!(!text.contains("youngsModulus"), "{text}");
        assert!(refused(&LAW, &table).contains("belong to contact.law = \"linear\""));
    }

    #[test]
    fn what_liggghts_cannot_do_is_refused_with_advice() {
        let table = grain_and_wall(PairContact::Restitution { coefficient: 0.05 });
        let incremental = LawSettings { tangential: TangentialLaw::Incremental, ..LAW };
        let text = refused(&incremental, &table);
        assert!(text.contains("use \"total\"") && text.contains("between `grain` and `steel` it is 0.05"), "{text}");
        let mut mixed = grain_and_wall(PairContact::Restitution { coefficient: 0.5 });
        let contact = PairContact::Stiffness {
            normal_stiffness: 1000.0,
            tangential_stiffness: 300.0,
            normal_damping: 0.02,
            tangential_damping: 0.01,
        };
        mixed.set_pair(0, 1, PairProperties { contact, sliding_friction: 0.1, rolling_friction: 0.0 });
        let slow = LawSettings { normal: NormalLaw::Linear, characteristic_velocity: 1e-3, ..LAW };
        let text = refused(&slow, &mixed);
        assert!(text.contains("given between `grain` and `steel` and follows") && text.contains("0.001 m/s"), "{text}");
        mixed.materials[0].elasticity = Some(Elasticity::Isotropic { youngs_modulus: 1e7, poissons_ratio: -0.1 });
        assert!(refused(&LAW, &mixed).contains("that of `grain` is -0.1"));
    }
}
