//! The reader's half for quantities: numbers with units, vectors, directions.

use super::Reader;
use crate::math::Vec3;
use crate::scene::diagnostics::{Place, hint};
use crate::scene::quantity::{self, Dimension, Fault, Unit, units_of};
use crate::scene::tree::{Node, Value};

/// Which values a quantity may take.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum Limit {
    /// Any finite value.
    Any,
    /// > 0.
    Positive,
    /// >= 0.
    NotNegative,
    /// low < value <= high.
    Within(f64, f64),
    /// low < value < high.
    Between(f64, f64),
    /// > low.
    Above(f64),
}

impl Limit {
    fn allows(self, value: f64) -> bool {
        match self {
            Self::Any => true,
            Self::Positive => value > 0.0,
            Self::NotNegative => value >= 0.0,
            Self::Within(low, high) => value > low && value <= high,
            Self::Between(low, high) => value > low && value < high,
            Self::Above(low) => value > low,
        }
    }

    fn words(self) -> String {
        match self {
            Self::Any => "be a number".to_owned(),
            Self::Positive => "be greater than 0".to_owned(),
            Self::NotNegative => "not be negative".to_owned(),
            Self::Within(low, high) => format!("be greater than {low} and at most {high}"),
            Self::Between(low, high) => format!("lie between {low} and {high}"),
            Self::Above(low) => format!("be greater than {low}"),
        }
    }
}

impl<'a> Reader<'a> {
    /// The value of `key` or `key_<unit>`, with the factor that the key's ending implies.
    pub fn measured(
        &self,
        key: &'static str,
        dimensions: &[Dimension],
    ) -> Option<(&'a Node, Option<(Dimension, f64)>)> {
        self.ask(key);
        let unit = |ending: &str| {
            let unit = dimensions.iter().flat_map(|d| units_of(*d)).find(|unit| unit.key_ending() == ending);
            unit.map(|unit| Some((unit.dimension, unit.factor)))
        };
        let mut found = self.table.entries.iter().enumerate().filter_map(|(number, entry)| {
            let ending = entry.key.strip_prefix(key)?;
            let factor = if ending.is_empty() { None } else { unit(ending)? };
            self.used.borrow_mut().push(number);
            Some((&entry.node, factor))
        });
        let first = found.next();
        if let Some((second, _)) = found.next() {
            self.report.error(
                "given-twice",
                &second.place,
                format!("`{key}` is given twice, with different units"),
                "keep one of the two",
            );
        }
        // A third one is marked as read as well.
        found.for_each(drop);
        first
    }

    /// A quantity in SI.
    pub fn quantity(&self, key: &'static str, dimension: Dimension, limit: Limit) -> Option<f64> {
        let (node, factor) = self.measured(key, &[dimension])?;
        let value = self.number(key, node, factor.map(|(_, factor)| factor), dimension)?;
        self.limited(key, node, value, limit)
    }

    /// A quantity in SI that must be there.
    pub fn need_quantity(&self, key: &'static str, dimension: Dimension, limit: Limit) -> Option<f64> {
        if !self.has(key) {
            self.missing(key, &example(key, dimension));
        }
        self.quantity(key, dimension, limit)
    }

    /// `node` as a quantity of `dimension` in SI; `factor` where its key named the unit.
    pub fn number(&self, key: &str, node: &Node, factor: Option<f64>, dimension: Dimension) -> Option<f64> {
        let bare = match &node.value {
            Value::Integer(number) => *number as f64,
            Value::Number(number) => *number,
            Value::Text(text) if factor.is_none() => return self.written(key, node, text, dimension),
            Value::Text(_) => {
                self.report.error(
                    "wrong-type",
                    &node.place,
                    format!("`{key}` names its unit in the key, so its value must be a bare number, not a string"),
                    format!("write the number alone, or `{key} = …` with the unit in the string"),
                );
                return None;
            }
            _ => {
                self.wrong_type(key, node, dimension.words(), &value_example(dimension));
                return None;
            }
        };
        let factor = match factor {
            Some(factor) => factor,
            None if dimension == Dimension::Dimensionless => 1.0,
            None => {
                self.bare(key, node, bare, dimension);
                return None;
            }
        };
        let value = bare * factor;
        if !value.is_finite() {
            self.bad_quantity(key, node, &bare.to_string(), dimension);
            return None;
        }
        Some(value)
    }

    fn written(&self, key: &str, node: &Node, text: &str, dimension: Dimension) -> Option<f64> {
        match quantity::parse(text, dimension) {
            Ok(value) => return Some(value),
            Err(Fault::Number) => self.bad_quantity(key, node, text, dimension),
            Err(Fault::NoUnit) => self.bare(key, node, text.trim().parse().unwrap_or(f64::NAN), dimension),
            Err(Fault::UnknownUnit(symbol)) => {
                let known: Vec<&str> = units_of(dimension).map(|unit| unit.symbol).collect();
                self.report.error(
                    "unknown-unit",
                    &node.place,
                    format!("`{key}` has the unknown unit `{symbol}`"),
                    hint(&symbol, &known),
                );
            }
            Err(Fault::WrongDimension(symbol, other)) => {
                let known: Vec<&str> = units_of(dimension).map(|unit| unit.symbol).collect();
                let next = match dimension {
                    Dimension::Dimensionless => "write a bare number, or a percentage".to_owned(),
                    _ => format!("units: {}", known.join(", ")),
                };
                self.report.error(
                    "wrong-dimension",
                    &node.place,
                    format!("`{key}` must be {}, and `{symbol}` is a unit of {}", dimension.words(), other.words()),
                    next,
                );
            }
        }
        None
    }

    fn bare(&self, key: &str, node: &Node, number: f64, dimension: Dimension) {
        let (_, symbol) = dimension.example();
        let ending = ending_of(dimension);
        self.report.error(
            "bare-number",
            &node.place,
            format!("`{key}` is a bare number, and the key does not name its unit"),
            format!(
                "write it with its unit, for example `{key} = \"{number} {symbol}\"` or `{key}{ending} = {number}`"
            ),
        );
    }

    fn bad_quantity(&self, key: &str, node: &Node, text: &str, dimension: Dimension) {
        self.report.error(
            "bad-quantity",
            &node.place,
            format!("`{key}` cannot read \"{text}\" as {}", dimension.words()),
            format!("write a finite number and its unit, for example `{}`", example(key, dimension)),
        );
    }

    /// `value` if `limit` allows it.
    pub fn limited(&self, key: &str, node: &Node, value: f64, limit: Limit) -> Option<f64> {
        if limit.allows(value) {
            return Some(value);
        }
        let given = match &node.value {
            Value::Text(text) => text.clone(),
            Value::Integer(number) => number.to_string(),
            Value::Number(number) => number.to_string(),
            _ => value.to_string(),
        };
        self.out_of_range(key, &node.place, &limit.words(), &given);
        None
    }

    pub(in crate::scene) fn out_of_range(&self, key: &str, place: &Place, words: &str, given: &str) {
        self.report.error("out-of-range", place, format!("`{key}` must {words}, and is {given}"), "correct the value");
    }

    /// An array of quantities in SI; `None` where one of them is wrong.
    pub fn quantities(&self, key: &'static str, dimension: Dimension, limit: Limit) -> Option<Vec<f64>> {
        let (node, factor) = self.measured(key, &[dimension])?;
        let Value::Array(items) = &node.value else {
            self.wrong_type(key, node, "an array", &format!("[{}, …]", value_example(dimension)));
            return None;
        };
        let bare = |item: &Node| matches!(item.value, Value::Integer(_) | Value::Number(_));
        if factor.is_none() && dimension != Dimension::Dimensionless && items.iter().any(bare) {
            let (ending, value) = (ending_of(dimension), value_example(dimension));
            self.report.error(
                "bare-number",
                &node.place,
                format!("`{key}` holds bare numbers, and the key does not name their unit"),
                format!("rename it, for example `{key}{ending}`, or give each number its unit: `{key} = [{value}, …]`"),
            );
            return None;
        }
        let values: Vec<Option<f64>> = items
            .iter()
            .map(|item| {
                let value = self.number(key, item, factor.map(|(_, factor)| factor), dimension)?;
                self.limited(key, item, value, limit)
            })
            .collect();
        values.into_iter().collect()
    }

    /// An array of `N` quantities in SI.
    pub fn array<const N: usize>(&self, key: &'static str, dimension: Dimension, limit: Limit) -> Option<[f64; N]> {
        let values = self.quantities(key, dimension, limit)?;
        let count = values.len();
        values.try_into().ok().or_else(|| {
            self.report.error(
                "wrong-length",
                &self.place_of(key),
                format!("`{key}` needs {N} elements, and has {count}"),
                format!("write {N} of them in [brackets]"),
            );
            None
        })
    }

    /// A vector in SI.
    pub fn vector(&self, key: &'static str, dimension: Dimension) -> Option<Vec3> {
        self.array::<3>(key, dimension, Limit::Any).map(Vec3::from)
    }

    /// A vector in SI that must be there.
    pub fn need_vector(&self, key: &'static str, dimension: Dimension) -> Option<Vec3> {
        if !self.has(key) {
            let value = value_example(dimension);
            self.missing(key, &format!("{key} = [{value}, {value}, {value}]"));
        }
        self.vector(key, dimension)
    }

    /// A direction, made a unit vector; it must be there.
    pub fn need_direction(&self, key: &'static str) -> Option<Vec3> {
        if !self.has(key) {
            self.missing(key, &format!("{key} = [0, 0, 1]"));
        }
        let vector = self.vector(key, Dimension::Dimensionless)?;
        let unit = vector.try_normalize(0.0).filter(|unit| unit.iter().all(|x| x.is_finite()));
        if unit.is_none() {
            self.zero_vector(key);
        }
        unit
    }

    /// Reports that `key` is a vector without a direction.
    pub fn zero_vector(&self, key: &str) {
        self.report.error(
            "zero-vector",
            &self.place_of(key),
            format!("`{key}` has no length, so it has no direction"),
            "give a vector that is not zero",
        );
    }
}

/// The end of a key that names the usual unit of a dimension.
fn ending_of(dimension: Dimension) -> &'static str {
    let (_, symbol) = dimension.example();
    units_of(dimension).find(|unit| unit.symbol == symbol).map_or("", Unit::key_ending)
}

fn value_example(dimension: Dimension) -> String {
    match dimension {
        Dimension::Dimensionless => "0.5".to_owned(),
        _ => {
            let (number, symbol) = dimension.example();
            format!("\"{number} {symbol}\"")
        }
    }
}

fn example(key: &str, dimension: Dimension) -> String {
    format!("{key} = {}", value_example(dimension))
}
