//! What a campaign file says is varied: axes, tables and samples become factors.

use super::file::{Column, Factor, MOST_POINTS, Value, quoted};
use crate::scene::reader::Reader;
use crate::scene::tree::{Node, Value as TreeValue};
use std::path::Path;

/// All factors of a campaign file, whose folder is `base`.
pub(super) fn factors(reader: &Reader<'_>, base: &Path) -> Vec<Factor> {
    let mut factors = axes(reader);
    factors.extend(reader.tables("table", "campaign.table").into_iter().filter_map(|table| table_of(table, base)));
    factors.extend(reader.tables("sample", "campaign.sample").into_iter().filter_map(sample));
    factors
}

/// A whole number of at least `least`.
pub(super) fn whole_number(reader: &Reader<'_>, key: &'static str, default: u64, least: u64) -> u64 {
    let Some(number) = reader.integer(key, default) else { return default };
    if number < least {
        reader.report.error(
            "out-of-range",
            &reader.place_of(key),
            format!("`{key}` must be at least {least}, not {number}"),
            format!("write for example `{key} = {least}`"),
        );
    }
    number.max(least)
}

/// A TOML value as a value of a column.
pub(super) fn value_of(reader: &Reader<'_>, key: &str, node: &Node, unit: &str) -> Option<Value> {
    match &node.value {
        TreeValue::Integer(number) => Some(Value::of_cell(&number.to_string(), unit)),
        TreeValue::Number(number) => Some(Value::of_number(*number, unit)),
        TreeValue::Text(text) if unit.is_empty() => Some(Value { cell: text.clone(), setting: quoted(text) }),
        TreeValue::Boolean(flag) if unit.is_empty() => Some(Value::of_cell(&flag.to_string(), unit)),
        TreeValue::Array(items) if unit.is_empty() => {
            let items: Option<Vec<Value>> = items.iter().map(|item| value_of(reader, key, item, "")).collect();
            let items: Vec<String> = items?.into_iter().map(|item| item.setting).collect();
            let text = format!("[{}]", items.join(", "));
            Some(Value { cell: text.clone(), setting: text })
        }
        _ => {
            let wanted = if unit.is_empty() { "a text, a number, true or false, or an array" } else { "a number" };
            reader.wrong_type(key, node, wanted, "[30, 40]");
            None
        }
    }
}

/// The keys that a column sets: one text, or an array of them.
fn keys_of(reader: &Reader<'_>, name: &str) -> Vec<String> {
    let Some(node) = reader.node("keys") else {
        reader.missing("keys", &format!("keys = \"part.{name}.friction\""));
        return Vec::new();
    };
    let one = |node: &Node| match &node.value {
        TreeValue::Text(text) if !text.is_empty() => Some(text.clone()),
        _ => None,
    };
    let found = match &node.value {
        TreeValue::Array(items) if !items.is_empty() => items.iter().map(one).collect(),
        _ => one(node).map(|key| vec![key]),
    };
    found.unwrap_or_else(|| {
        reader.wrong_type("keys", node, "a key of the scene or an array of them", "\"part.chute.place.rotate.angle\"");
        Vec::new()
    })
}

/// The column of an axis; everything that is wrong with it is found, also where it has no name.
fn column(reader: &Reader<'_>) -> Option<Column> {
    let name = reader.name();
    let unit = reader.text("unit").unwrap_or_default().to_owned();
    let keys = keys_of(reader, name.as_deref().unwrap_or("chute"));
    Some(Column { name: name?, unit, keys })
}

/// The axes: those that are zipped make one factor.
fn axes(reader: &Reader<'_>) -> Vec<Factor> {
    let mut factors: Vec<(Option<String>, Factor)> = Vec::new();
    for axis in reader.tables("axis", "campaign.axis") {
        let zip = axis.text("zip").map(str::to_owned);
        let place = axis.place;
        let column = column(&axis);
        let values = values(&axis, column.as_ref().map_or("", |column| &column.unit));
        axis.finish();
        let (Some(column), Some(values)) = (column, values) else { continue };
        let partner = factors.iter_mut().find(|(name, _)| zip.is_some() && *name == zip);
        let Some((_, factor)) = partner else {
            let points = values.into_iter().map(|value| vec![value]).collect();
            factors.push((zip, Factor { columns: vec![column], points }));
            continue;
        };
        if factor.points.len() == values.len() {
            factor.columns.push(column);
            factor.points.iter_mut().zip(values).for_each(|(point, value)| point.push(value));
        } else {
            let (first, known, here) = (&factor.columns[0].name, factor.points.len(), values.len());
            reader.report.error(
                "out-of-range",
                place,
                format!(
                    "axis \"{}\" has {here} values, and \"{first}\", with which it is zipped, has {known}",
                    column.name
                ),
                "give both as many values, or leave `zip` out: then every value meets every other",
            );
        }
    }
    factors.into_iter().map(|(_, factor)| factor).collect()
}

/// The values of an axis: listed, or from one number to another.
fn values(axis: &Reader<'_>, unit: &str) -> Option<Vec<Value>> {
    if let Some(node) = axis.node("values") {
        let items = match &node.value {
            TreeValue::Array(items) if !items.is_empty() => items,
            _ => {
                axis.wrong_type("values", node, "an array with at least one value", "[30, 40, 50]");
                return None;
            }
        };
        return items.iter().map(|item| value_of(axis, "values", item, unit)).collect();
    }
    if !axis.has("from") && !axis.has("to") {
        axis.missing("values", "values = [30, 40, 50]`, or `from = 30, to = 50, count = 5");
        return None;
    }
    let scale = Scale::of(axis);
    if !axis.has("count") {
        axis.missing("count", "count = 5");
    }
    let count = axis.integer("count", 5)?;
    if !(2..=MOST_POINTS).contains(&count) {
        axis.report.error(
            "out-of-range",
            &axis.place_of("count"),
            format!("`count` must be from 2 to {MOST_POINTS}, not {count}"),
            "write `count = 5`, or list the `values`",
        );
        return None;
    }
    let scale = scale?;
    let share = |k: u64| k as f64 / (count - 1) as f64;
    Some((0..count).map(|k| Value::of_number(scale.at(share(k)), unit)).collect())
}

/// From one number to another, linear or by equal ratios.
#[derive(Debug, Clone, Copy)]
struct Scale {
    from: f64,
    to: f64,
    is_logarithmic: bool,
}

impl Scale {
    fn of(axis: &Reader<'_>) -> Option<Self> {
        let is_logarithmic = axis.word("spacing", &[("linear", false), ("logarithmic", true)]).unwrap_or(false);
        let number = |key: &'static str, example: &str| {
            let Some(node) = axis.node(key) else {
                axis.missing(key, example);
                return None;
            };
            match node.value {
                TreeValue::Integer(number) => Some(number as f64),
                TreeValue::Number(number) if number.is_finite() => Some(number),
                _ => {
                    axis.wrong_type(key, node, "a number, its unit in `unit`", "30");
                    None
                }
            }
        };
        let (from, to) = (number("from", "from = 30"), number("to", "to = 50"));
        let (from, to) = (from?, to?);
        if is_logarithmic && !(from > 0.0 && to > 0.0) {
            axis.report.error(
                "out-of-range",
                &axis.place_of("spacing"),
                "equal ratios need numbers above 0 at both ends",
                "change `from` and `to`, or write `spacing = \"linear\"`",
            );
            return None;
        }
        Some(Self { from, to, is_logarithmic })
    }

    /// The number at `share` of the way; both ends exactly.
    fn at(&self, share: f64) -> f64 {
        if share <= 0.0 {
            self.from
        } else if share >= 1.0 {
            self.to
        } else if self.is_logarithmic {
            self.from * (self.to / self.from).powf(share)
        } else {
            self.from + (self.to - self.from) * share
        }
    }
}

/// A table of variants: CSV, one row a point.
fn table_of(reader: Reader<'_>, base: &Path) -> Option<Factor> {
    let place = reader.place_of("file");
    let file = base.join(reader.need_text("file", "variants.csv")?);
    let known = reader.named_tables("columns", "campaign.table.column");
    let mut named: Vec<Column> = Vec::new();
    for (name, column) in known {
        let unit = column.text("unit").unwrap_or_default().to_owned();
        named.push(Column { keys: keys_of(&column, &name), unit, name });
        column.finish();
    }
    let report = reader.report;
    reader.finish();
    let fail = |what: String, next: &str| {
        report.error("file-unreadable", &place, what, next);
        None
    };
    let shown = file.display();
    let next = "write a header and one row a variant, cells apart by commas";
    let mut rows = match csv::ReaderBuilder::new().trim(csv::Trim::All).comment(Some(b'#')).from_path(&file) {
        Ok(rows) => rows,
        Err(error) => return fail(format!("the table \"{shown}\" cannot be read: {error}"), next),
    };
    let header = match rows.headers() {
        Ok(header) => header.clone(),
        Err(error) => return fail(format!("the table \"{shown}\" cannot be read: {error}"), next),
    };
    let column = |name: &str| {
        let known = named.iter().find(|column| column.name == name);
        known.cloned().unwrap_or_else(|| Column {
            name: name.to_owned(),
            unit: String::new(),
            keys: vec![name.to_owned()],
        })
    };
    let columns: Vec<Column> = header.iter().map(column).collect();
    if let Some(unused) = named.iter().find(|named| !header.iter().any(|name| name == named.name)) {
        return fail(
            format!("the table \"{shown}\" has no column `{}`", unused.name),
            "correct its name, or the header",
        );
    }
    let mut points = Vec::new();
    for (index, row) in rows.records().enumerate() {
        match row {
            Ok(row) => points.push(row.iter().zip(&columns).map(|(cell, of)| Value::of_cell(cell, &of.unit)).collect()),
            Err(error) => return fail(format!("row {} of the table \"{shown}\": {error}", index + 1), next),
        }
    }
    if points.is_empty() {
        return fail(format!("the table \"{shown}\" has no rows"), next);
    }
    Some(Factor { columns, points })
}

/// A Latin hypercube sample.
fn sample(reader: Reader<'_>) -> Option<Factor> {
    let seed = reader.integer("seed", 1).unwrap_or(1);
    let count = whole_number(&reader, "count", 2, 2);
    if !reader.has("count") {
        reader.missing("count", "count = 20");
    }
    if count > MOST_POINTS {
        reader.report.error(
            "out-of-range",
            &reader.place_of("count"),
            format!("`count` must be at most {MOST_POINTS}, not {count}"),
            "write for example `count = 20`",
        );
        return None;
    }
    let mut columns = Vec::new();
    let mut points: Vec<Vec<Value>> = vec![Vec::new(); count as usize];
    for axis in reader.tables("axis", "campaign.sample.axis") {
        let column = column(&axis);
        let scale = Scale::of(&axis);
        axis.finish();
        let (Some(column), Some(scale)) = (column, scale) else { continue };
        let shares = crate::campaign::latin_hypercube::shares(seed, &column.name, points.len());
        for (point, share) in points.iter_mut().zip(shares) {
            point.push(Value::of_number(scale.at(share), &column.unit));
        }
        columns.push(column);
    }
    if !reader.has("axis") {
        reader.missing("axis", "[[sample.axis]]");
    }
    reader.finish();
    (!columns.is_empty()).then_some(Factor { columns, points })
}
