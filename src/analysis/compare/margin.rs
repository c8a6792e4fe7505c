//! Margins: the differences that would not matter.

use crate::scene::quantity_in;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// What a measure is; decides its margin where none is asked for.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Kind {
    /// A mass flow rate: 4 % of the reference.
    MassFlowRate,
    /// An angle: 2 deg.
    Angle,
    /// A coordinate of a centre of mass: 2 mm.
    CentreOfMass,
    /// A time: 4 % of the reference.
    Time,
    /// A number of particles: 1 % of the reference.
    Count,
    /// A mass: 1 % of the reference.
    Mass,
    /// A curve: 5 % of the reference's range.
    Curve,
    /// A distribution: a Kolmogorov-Smirnov distance of 0.05.
    Distribution,
    /// Anything else: 5 % of the reference.
    Other,
}

impl Kind {
    /// The kind of a measure, by its name without the unit and by its unit.
    pub(super) fn of(name: &str, unit: &str) -> Self {
        match unit {
            "kg/s" => Self::MassFlowRate,
            "deg" => Self::Angle,
            "s" => Self::Time,
            "kg" => Self::Mass,
            "m" if ["_x", "_y", "_z"].iter().any(|axis| name.ends_with(axis)) => Self::CentreOfMass,
            _ => Self::Other,
        }
    }

    /// The margin where none is asked for.
    #[must_use]
    pub const fn margin(self) -> Margin {
        match self {
            Self::MassFlowRate | Self::Time => Margin::Relative(0.04),
            Self::Angle => Margin::Absolute(2.0),
            Self::CentreOfMass => Margin::Absolute(2e-3),
            Self::Count | Self::Mass => Margin::Relative(0.01),
            Self::Curve | Self::Other => Margin::Relative(0.05),
            Self::Distribution => Margin::Absolute(0.05),
        }
    }
}

/// A margin, +- of what is given.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Margin {
    /// A share of the reference's mean, or of its range [-].
    Relative(f64),
    /// A difference in the measure's unit.
    Absolute(f64),
}

impl Margin {
    /// In the measure's unit, for a reference of this size.
    #[must_use]
    pub fn absolute(self, reference: f64) -> f64 {
        match self {
            Self::Relative(share) => share * reference,
            Self::Absolute(margin) => margin,
        }
    }
}

/// The margins that were asked for, by name.
#[derive(Debug, Clone, Default)]
pub(super) struct Margins(BTreeMap<String, Margin>);

impl Margins {
    /// Reads margins for measures that are known by name and unit. A name may leave out the stage or gate before its last
    /// dot, and stands for all that end so then.
    pub fn read(asked: &[(String, String)], known: &[(String, String)]) -> Result<Self, Vec<String>> {
        let mut margins = BTreeMap::new();
        let mut faults = Vec::new();
        for (name, value) in asked {
            let meant: Vec<&(String, String)> = known.iter().filter(|(known, unit)| means(name, known, unit)).collect();
            if meant.is_empty() {
                faults.push(unknown(name, known));
            }
            for (known, unit) in meant {
                match read_margin(value, unit) {
                    Ok(margin) if margins.insert(known.clone(), margin).is_some_and(|before| before != margin) => {
                        faults.push(format!("--margin {name}={value}: \"{known}\" has two different margins"));
                    }
                    Ok(_) => {}
                    Err(fault) => faults.push(format!("--margin {name}={value}: \"{value}\" {fault}")),
                }
            }
        }
        faults.dedup();
        if faults.is_empty() { Ok(Self(margins)) } else { Err(faults) }
    }

    /// The margin of a measure.
    pub fn of(&self, name: &str, kind: Kind) -> Margin {
        self.0.get(name).copied().unwrap_or_else(|| kind.margin())
    }
}

/// Whether `asked` names the measure `known`: with or without its unit, with or without what stands before a dot.
fn means(asked: &str, known: &str, unit: &str) -> bool {
    let with_unit = format!("{known}{}", super::matching::ending(unit));
    [known, with_unit.as_str()]
        .iter()
        .any(|name| asked == *name || name.strip_suffix(asked).is_some_and(|before| before.ends_with('.')))
}

fn unknown(name: &str, known: &[(String, String)]) -> String {
    let names: Vec<&str> = known.iter().map(|(name, _)| name.as_str()).collect();
    let known = if names.is_empty() { "there is none".to_owned() } else { format!("known are {}", names.join(", ")) };
    format!("--margin: no measure is called \"{name}\"; {known}")
}

fn read_margin(text: &str, unit: &str) -> Result<Margin, String> {
    let trimmed = text.trim();
    let margin = match trimmed.strip_suffix('%') {
        // Of a measure in percent, "2 %" are two of its points, and no share.
        Some(number) if unit == "%" => Margin::Absolute(number.trim().parse().map_err(|_| "is no number of percent")?),
        Some(number) => Margin::Relative(number.trim().parse::<f64>().map_err(|_| "is no number of percent")? / 100.0),
        None => Margin::Absolute(quantity_in(trimmed, unit)?),
    };
    match margin {
        Margin::Relative(size) | Margin::Absolute(size) if size.is_finite() && size >= 0.0 => Ok(margin),
        _ => Err("is no margin; give zero or more".to_owned()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn known() -> Vec<(String, String)> {
        [("chute.heap_angle", "deg"), ("hopper.heap_angle", "deg"), ("flow", "kg/s"), ("gate.outlet.crossings", "")]
            .map(|(name, unit)| (name.to_owned(), unit.to_owned()))
            .into()
    }

    fn read(asked: &[(&str, &str)]) -> Result<Margins, Vec<String>> {
        let asked: Vec<_> = asked.iter().map(|(n, v)| ((*n).to_owned(), (*v).to_owned())).collect();
        Margins::read(&asked, &known())
    }

    #[test]
    fn kinds_follow_from_unit_and_name() {
        assert_eq!(Kind::of("outflow", "kg/s"), Kind::MassFlowRate);
        assert_eq!(Kind::of("heap_centre_x", "m"), Kind::CentreOfMass);
        assert_eq!(Kind::of("sizes_d50_by_mass", "m"), Kind::Other);
        assert_eq!(Kind::of("contacts", ""), Kind::Other);
    }

    #[test]
    fn a_margin_is_a_share_or_a_quantity() {
        let margins = read(&[("heap_angle", "1deg"), ("flow_kg_per_s", "3 %"), ("crossings", "12")]).unwrap();
        assert_eq!(margins.of("chute.heap_angle", Kind::Angle), Margin::Absolute(1.0));
        assert_eq!(margins.of("hopper.heap_angle", Kind::Angle), Margin::Absolute(1.0));
        assert_eq!(margins.of("flow", Kind::MassFlowRate), Margin::Relative(0.03));
        assert_eq!(margins.of("gate.outlet.crossings", Kind::Count), Margin::Absolute(12.0));
        assert_eq!(margins.of("else", Kind::Mass), Margin::Relative(0.01));
        let one = read(&[("chute.heap_angle", "1 deg")]).unwrap();
        assert_eq!(one.of("hopper.heap_angle", Kind::Angle), Margin::Absolute(2.0), "only the one that was named");
    }

    #[test]
    fn everything_wrong_is_said_at_once() {
        let asked = [("angel", "1 deg"), ("heap_angle", "1 mm"), ("flow", "-2 %"), ("crossings", "few")];
        let faults = read(&asked).unwrap_err();
        assert_eq!(faults.len(), 4, "{faults:?}");
        assert!(faults[0].contains("no measure is called \"angel\"; known are chute.heap_angle"), "{faults:?}");
        assert!(faults[1].contains("is a length; an angle is wanted here"), "{faults:?}");
        assert!(faults[2].contains("zero or more") && faults[3].contains("\"few\""), "{faults:?}");
        assert!(read(&[("flow", "1 %"), ("flow", "2 %")]).unwrap_err()[0].contains("two different margins"));
    }
}
