//! Quantities: "3 mm" to metres. Units are checked at the door; inside, everything is SI.

use std::borrow::Cow;
use std::collections::{HashMap, HashSet};
use std::sync::LazyLock;

/// What a quantity measures.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Dimension {
    Length,
    Time,
    Velocity,
    Acceleration,
    Angle,
    AngularVelocity,
    Frequency,
    Mass,
    Density,
    Pressure,
    Stiffness,
    Damping,
    MassRate,
    NumberRate,
    Dimensionless,
}

use Dimension as D;

impl Dimension {
    /// In words.
    pub fn words(self) -> &'static str {
        match self {
            Self::Length => "a length",
            Self::Time => "a time",
            Self::Velocity => "a velocity",
            Self::Acceleration => "an acceleration",
            Self::Angle => "an angle",
            Self::AngularVelocity => "an angular velocity",
            Self::Frequency => "a frequency",
            Self::Mass => "a mass",
            Self::Density => "a density",
            Self::Pressure => "a pressure",
            Self::Stiffness => "a stiffness",
            Self::Damping => "a damping constant",
            Self::MassRate => "a mass rate",
            Self::NumberRate => "a number rate",
            Self::Dimensionless => "a number without unit",
        }
    }

    /// A quantity of this kind as one would write it: number, unit.
    pub fn example(self) -> (&'static str, &'static str) {
        match self {
            Self::Length => ("3", "mm"),
            Self::Time => ("0.5", "s"),
            Self::Velocity => ("2", "m/s"),
            Self::Acceleration => ("-9.81", "m/s2"),
            Self::Angle => ("40", "deg"),
            Self::AngularVelocity => ("10", "rpm"),
            Self::Frequency => ("50", "Hz"),
            Self::Mass => ("2", "kg"),
            Self::Density => ("3300", "kg/m3"),
            Self::Pressure => ("10", "MPa"),
            Self::Stiffness => ("1200", "N/m"),
            Self::Damping => ("0.02", "kg/s"),
            Self::MassRate => ("5", "kg/s"),
            Self::NumberRate => ("200", "1/s"),
            Self::Dimensionless => ("25", "%"),
        }
    }
}

/// A unit: its dimension, how it is written, and what one of it is in SI.
pub(crate) struct Unit {
    /// Dimension.
    pub dimension: Dimension,
    /// As written in a quantity.
    pub symbol: &'static str,
    /// One of it, in SI.
    pub factor: f64,
}

const fn unit(dimension: Dimension, symbol: &'static str, factor: f64) -> Unit {
    Unit { dimension, symbol, factor }
}

const DEGREE: f64 = std::f64::consts::PI / 180.0;

/// All units.
pub(crate) const UNITS: &[Unit] = &[
    unit(D::Length, "m", 1.0),
    unit(D::Length, "cm", 1e-2),
    unit(D::Length, "mm", 1e-3),
    unit(D::Length, "um", 1e-6),
    unit(D::Length, "nm", 1e-9),
    unit(D::Length, "km", 1e3),
    unit(D::Time, "s", 1.0),
    unit(D::Time, "ms", 1e-3),
    unit(D::Time, "us", 1e-6),
    unit(D::Time, "min", 60.0),
    unit(D::Time, "h", 3600.0),
    unit(D::Velocity, "m/s", 1.0),
    unit(D::Velocity, "cm/s", 1e-2),
    unit(D::Velocity, "mm/s", 1e-3),
    unit(D::Velocity, "m/min", 1.0 / 60.0),
    unit(D::Velocity, "km/h", 1.0 / 3.6),
    unit(D::Acceleration, "m/s2", 1.0),
    unit(D::Acceleration, "cm/s2", 1e-2),
    unit(D::Acceleration, "mm/s2", 1e-3),
    unit(D::Angle, "rad", 1.0),
    unit(D::Angle, "mrad", 1e-3),
    unit(D::Angle, "deg", DEGREE),
    unit(D::AngularVelocity, "rad/s", 1.0),
    unit(D::AngularVelocity, "deg/s", DEGREE),
    unit(D::AngularVelocity, "rpm", 6.0 * DEGREE),
    unit(D::Frequency, "Hz", 1.0),
    unit(D::Frequency, "kHz", 1e3),
    unit(D::Frequency, "1/s", 1.0),
    unit(D::Frequency, "1/min", 1.0 / 60.0),
    unit(D::Mass, "kg", 1.0),
    unit(D::Mass, "g", 1e-3),
    unit(D::Mass, "mg", 1e-6),
    unit(D::Mass, "t", 1e3),
    unit(D::Density, "kg/m3", 1.0),
    unit(D::Density, "g/cm3", 1e3),
    unit(D::Density, "t/m3", 1e3),
    unit(D::Pressure, "Pa", 1.0),
    unit(D::Pressure, "kPa", 1e3),
    unit(D::Pressure, "MPa", 1e6),
    unit(D::Pressure, "GPa", 1e9),
    unit(D::Pressure, "bar", 1e5),
    unit(D::Pressure, "N/m2", 1.0),
    unit(D::Pressure, "N/mm2", 1e6),
    unit(D::Stiffness, "N/m", 1.0),
    unit(D::Stiffness, "kN/m", 1e3),
    unit(D::Stiffness, "MN/m", 1e6),
    unit(D::Stiffness, "N/mm", 1e3),
    unit(D::Damping, "kg/s", 1.0),
    unit(D::Damping, "g/s", 1e-3),
    unit(D::Damping, "N s/m", 1.0),
    unit(D::MassRate, "kg/s", 1.0),
    unit(D::MassRate, "g/s", 1e-3),
    unit(D::MassRate, "kg/min", 1.0 / 60.0),
    unit(D::MassRate, "kg/h", 1.0 / 3600.0),
    unit(D::MassRate, "t/h", 1.0 / 3.6),
    unit(D::NumberRate, "1/s", 1.0),
    unit(D::NumberRate, "1/min", 1.0 / 60.0),
    unit(D::NumberRate, "1/h", 1.0 / 3600.0),
    unit(D::Dimensionless, "%", 1e-2),
];

/// The end of a key that names a unit, by the unit's symbol: `_kg_per_m3` for `kg/m3`. Kept, because every key of every scene is
/// held against them.
static KEY_ENDINGS: LazyLock<HashMap<&str, String>> = LazyLock::new(|| {
    let ending = |symbol: &str| match symbol {
        "%" => "_percent".to_owned(),
        symbol if symbol.starts_with("1/") => symbol.replace("1/", "_per_"),
        symbol => format!("_{}", symbol.replace('/', "_per_").replace(' ', "_")),
    };
    UNITS.iter().map(|unit| (unit.symbol, ending(unit.symbol))).collect()
});

/// The values of [`KEY_ENDINGS`].
static ALL_KEY_ENDINGS: LazyLock<HashSet<&str>> = LazyLock::new(|| KEY_ENDINGS.values().map(String::as_str).collect());

impl Unit {
    /// The end of a key that names this unit: `_kg_per_m3`.
    pub fn key_ending(&self) -> &'static str {
        &KEY_ENDINGS[self.symbol]
    }
}

/// The units of a dimension.
pub(crate) fn units_of(dimension: Dimension) -> impl Iterator<Item = &'static Unit> {
    UNITS.iter().filter(move |unit| unit.dimension == dimension)
}

/// `key` without the unit at its end: `diameter` of `diameter_mm`.
pub(crate) fn base_of_key(key: &str) -> &str {
    // The longest ending begins at the first underscore; a key is more than its unit.
    let ends = key.match_indices('_').map(|(at, _)| at).filter(|at| *at > 0);
    let longest = ends.into_iter().find(|at| ALL_KEY_ENDINGS.contains(&key[*at..]));
    &key[..longest.unwrap_or(key.len())]
}

/// Why a text is not the quantity that was asked for.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) enum Fault {
    /// It has no number, or one that is not finite.
    Number,
    /// It has a number but no unit.
    NoUnit,
    /// No unit is called that.
    UnknownUnit(String),
    /// The unit measures something else.
    WrongDimension(String, Dimension),
}

/// Reads a quantity of `dimension`, in SI.
pub(crate) fn parse(text: &str, dimension: Dimension) -> Result<f64, Fault> {
    let text = text.trim();
    let (number, symbol) = text.split_at(number_length(text));
    let number: f64 = number.parse().map_err(|_| Fault::Number)?;
    if !number.is_finite() {
        return Err(Fault::Number);
    }
    let symbol = normal_spelling(symbol);
    if symbol.is_empty() {
        return if dimension == D::Dimensionless { Ok(number) } else { Err(Fault::NoUnit) };
    }
    if let Some(unit) = units_of(dimension).find(|unit| unit.symbol == symbol) {
        return Some(number * unit.factor).filter(|value| value.is_finite()).ok_or(Fault::Number);
    }
    match UNITS.iter().find(|unit| unit.symbol == symbol) {
        Some(unit) => Err(Fault::WrongDimension(symbol.into_owned(), unit.dimension)),
        None => Err(Fault::UnknownUnit(symbol.into_owned())),
    }
}

/// Reads a quantity such as "2 mm" in the unit `symbol`: 0.002 for "m". Angles may be asked for in "deg"; a number without
/// unit is one of dimension 1, whose symbol is empty.
///
/// # Errors
/// Says what is wrong with `text`, in words that go after it.
pub fn quantity_in(text: &str, symbol: &str) -> Result<f64, String> {
    let wanted: Vec<&Unit> = if symbol.is_empty() {
        units_of(D::Dimensionless).collect()
    } else {
        UNITS.iter().filter(|unit| unit.symbol == symbol).collect()
    };
    let mut fault = Fault::UnknownUnit(symbol.to_owned());
    for unit in &wanted {
        let factor = if symbol.is_empty() { 1.0 } else { unit.factor };
        match parse(text, unit.dimension) {
            Ok(value) => return Ok(value / factor),
            Err(found) => fault = found,
        }
    }
    let kind = wanted.first().map_or("a number without unit", |unit| unit.dimension.words());
    Err(match fault {
        Fault::Number => "is no number with a unit".to_owned(),
        Fault::NoUnit => format!("has no unit; {kind} is wanted here, as in \"{} {symbol}\"", text.trim()),
        Fault::UnknownUnit(unit) => format!("has the unknown unit \"{unit}\"; {kind} is wanted here"),
        Fault::WrongDimension(_, found) => format!("is {}; {kind} is wanted here", found.words()),
    })
}

/// Length of the number that `text` starts with, in bytes.
fn number_length(text: &str) -> usize {
    let bytes = text.as_bytes();
    let mut at = 0;
    while at < bytes.len() {
        let exponent =
            matches!(bytes[at], b'e' | b'E') && at > 0 && matches!(bytes.get(at + 1), Some(b'0'..=b'9' | b'+' | b'-'));
        let sign = matches!(bytes[at], b'+' | b'-') && (at == 0 || matches!(bytes[at - 1], b'e' | b'E'));
        if !(bytes[at].is_ascii_digit() || bytes[at] == b'.' || exponent || sign) {
            break;
        }
        at += 1;
    }
    at
}

/// One spelling for `m/s^2`, `m/s²`, `N·s/m`, `µm`.
fn normal_spelling(symbol: &str) -> Cow<'_, str> {
    let symbol = symbol.trim();
    if symbol.bytes().all(|byte| byte.is_ascii() && !matches!(byte, b'^' | b'*')) {
        return Cow::Borrowed(symbol);
    }
    symbol
        .chars()
        .filter(|c| *c != '^')
        .map(|c| match c {
            '²' => '2',
            '³' => '3',
            '·' | '*' => ' ',
            'µ' | 'μ' => 'u',
            other => other,
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f64::consts::PI;

    #[test]
    fn quantities_in_a_given_unit() {
        assert_eq!(quantity_in("2 mm", "m"), Ok(2e-3));
        assert!((quantity_in("0.1 rad", "deg").unwrap() - 0.1 * 180.0 / PI).abs() < 1e-12);
        assert_eq!(quantity_in("36 t/h", "kg/s"), Ok(36.0 / 3.6));
        assert_eq!(quantity_in("0.2", ""), Ok(0.2));
        assert!(quantity_in("2 mm", "deg").unwrap_err().contains("is a length; an angle is wanted"));
        assert!(quantity_in("2", "deg").unwrap_err().contains("has no unit"));
        assert!(quantity_in("2 furlong", "m").unwrap_err().contains("furlong"));
        assert!(quantity_in("two", "m").unwrap_err().contains("no number"));
    }

    /// (dimension, text, value in SI by hand): written apart from the table, one line for each of its rows.
    fn by_hand() -> Vec<(Dimension, &'static str, f64)> {
        vec![
            (D::Length, "3 m", 3.0),
            (D::Length, "250 cm", 2.5),
            (D::Length, "3 mm", 0.003),
            (D::Length, "40 um", 0.00004),
            (D::Length, "250 nm", 0.000_000_25),
            (D::Length, "1.5 km", 1500.0),
            (D::Time, "2 s", 2.0),
            (D::Time, "5 ms", 0.005),
            (D::Time, "7 us", 0.000007),
            (D::Time, "2 min", 120.0),
            (D::Time, "0.5 h", 1800.0),
            (D::Velocity, "2 m/s", 2.0),
            (D::Velocity, "50 cm/s", 0.5),
            (D::Velocity, "500 mm/s", 0.5),
            (D::Velocity, "90 m/min", 1.5),
            (D::Velocity, "36 km/h", 10.0),
            (D::Acceleration, "-9.81 m/s2", -9.81),
            (D::Acceleration, "981 cm/s2", 9.81),
            (D::Acceleration, "9810 mm/s2", 9.81),
            (D::Angle, "2 rad", 2.0),
            (D::Angle, "10 mrad", 0.01),
            (D::Angle, "180 deg", PI),
            (D::AngularVelocity, "3 rad/s", 3.0),
            (D::AngularVelocity, "90 deg/s", PI / 2.0),
            (D::AngularVelocity, "60 rpm", 2.0 * PI),
            (D::Frequency, "50 Hz", 50.0),
            (D::Frequency, "2 kHz", 2000.0),
            (D::Frequency, "4 1/s", 4.0),
            (D::Frequency, "120 1/min", 2.0),
            (D::Mass, "2 kg", 2.0),
            (D::Mass, "25 g", 0.025),
            (D::Mass, "30 mg", 0.00003),
            (D::Mass, "1.2 t", 1200.0),
            (D::Density, "3300 kg/m3", 3300.0),
            (D::Density, "2.5 g/cm3", 2500.0),
            (D::Density, "1.6 t/m3", 1600.0),
            (D::Pressure, "5 Pa", 5.0),
            (D::Pressure, "5 kPa", 5000.0),
            (D::Pressure, "10 MPa", 10_000_000.0),
            (D::Pressure, "70 GPa", 70_000_000_000.0),
            (D::Pressure, "2 bar", 200_000.0),
            (D::Pressure, "4 N/m2", 4.0),
            (D::Pressure, "3 N/mm2", 3_000_000.0),
            (D::Stiffness, "1200 N/m", 1200.0),
            (D::Stiffness, "3 kN/m", 3000.0),
            (D::Stiffness, "2 MN/m", 2_000_000.0),
            (D::Stiffness, "4 N/mm", 4000.0),
            (D::Damping, "0.02 kg/s", 0.02),
            (D::Damping, "20 g/s", 0.02),
            (D::Damping, "0.3 N s/m", 0.3),
            (D::MassRate, "5 kg/s", 5.0),
            (D::MassRate, "250 g/s", 0.25),
            (D::MassRate, "90 kg/min", 1.5),
            (D::MassRate, "7200 kg/h", 2.0),
            (D::MassRate, "36 t/h", 10.0),
            (D::NumberRate, "200 1/s", 200.0),
            (D::NumberRate, "30 1/min", 0.5),
            (D::NumberRate, "7200 1/h", 2.0),
            (D::Dimensionless, "25 %", 0.25),
        ]
    }

    #[test]
    fn every_row_agrees_with_hand_arithmetic() {
        for (dimension, text, expected) in by_hand() {
            let value = parse(text, dimension).unwrap_or_else(|fault| panic!("{text}: {fault:?}"));
            // One rounding in the factor and one in the product.
            assert!((value - expected).abs() <= 4.0 * f64::EPSILON * expected.abs(), "{text}: {value}, not {expected}");
        }
    }

    #[test]
    fn every_row_is_in_the_hand_list_and_no_other() {
        let tested: Vec<(Dimension, String)> =
            by_hand().iter().map(|(d, text, _)| (*d, text.split_once(' ').expect("a unit").1.to_owned())).collect();
        for unit in UNITS {
            let rows = tested.iter().filter(|(d, symbol)| *d == unit.dimension && symbol == unit.symbol).count();
            assert_eq!(rows, 1, "`{}` as {} is tested {rows} times", unit.symbol, unit.dimension.words());
        }
        assert_eq!(tested.len(), UNITS.len());
    }

    #[test]
    fn numbers_and_spellings() {
        let close = |text: &str, dimension, expected: f64| {
            let value = parse(text, dimension).unwrap_or_else(|fault| panic!("{text}: {fault:?}"));
            assert!((value - expected).abs() <= 4.0 * f64::EPSILON * expected.abs(), "{text}: {value}");
        };
        close("1e-5 s", D::Time, 1e-5);
        close("1.5E+2mm", D::Length, 0.15);
        close(" +3   mm ", D::Length, 0.003);
        close("-9.81 m/s^2", D::Acceleration, -9.81);
        close("9.81 m/s²", D::Acceleration, 9.81);
        close("2 N*s/m", D::Damping, 2.0);
        close("2 N·s/m", D::Damping, 2.0);
        close("5 µm", D::Length, 5e-6);
        close("0.25", D::Dimensionless, 0.25);
        close(".5 m", D::Length, 0.5);
    }

    #[test]
    fn faults_are_told_apart() {
        assert_eq!(parse("mm", D::Length), Err(Fault::Number));
        assert_eq!(parse("1-2 mm", D::Length), Err(Fault::UnknownUnit("-2 mm".into())));
        assert_eq!(parse("inf mm", D::Length), Err(Fault::Number));
        assert_eq!(parse("1e999 mm", D::Length), Err(Fault::Number));
        assert_eq!(parse("3", D::Length), Err(Fault::NoUnit));
        assert_eq!(parse("3 furlong", D::Length), Err(Fault::UnknownUnit("furlong".into())));
        assert_eq!(parse("3 kg", D::Length), Err(Fault::WrongDimension("kg".into(), D::Mass)));
        assert_eq!(parse("3 %", D::Length), Err(Fault::WrongDimension("%".into(), D::Dimensionless)));
    }

    #[test]
    fn keys_name_their_unit_at_the_end() {
        let ending = |symbol: &str| UNITS.iter().find(|u| u.symbol == symbol).expect("a unit").key_ending();
        assert_eq!(ending("kg/m3"), "_kg_per_m3");
        assert_eq!(ending("1/s"), "_per_s");
        assert_eq!(ending("N s/m"), "_N_s_per_m");
        assert_eq!(ending("%"), "_percent");
        assert_eq!(base_of_key("diameter_mm"), "diameter");
        assert_eq!(base_of_key("density_kg_per_m3"), "density");
        assert_eq!(base_of_key("velocity_m_per_s"), "velocity");
        assert_eq!(base_of_key("normal_damping_N_s_per_m"), "normal_damping");
        assert_eq!(base_of_key("rate_per_s"), "rate");
        assert_eq!(base_of_key("friction"), "friction");
        assert_eq!(base_of_key("_mm"), "_mm");
    }

    #[test]
    fn examples_are_valid() {
        for unit in UNITS {
            let (number, symbol) = unit.dimension.example();
            assert!(parse(&format!("{number} {symbol}"), unit.dimension).is_ok());
        }
    }
}
