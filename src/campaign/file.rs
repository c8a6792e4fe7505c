//! The campaign file: a base scene, what is varied, how often.

use super::CampaignError;
use crate::scene::diagnostics::{Place, Report, Severity};
use crate::scene::reader::Reader;
use crate::scene::tree::{self, Node, Value as TreeValue};
use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

/// A campaign file in a folder.
pub const FILE: &str = "campaign.toml";
/// The only version of the format so far.
const VERSION: u64 = 1;
/// Campaigns are written by hand; what is larger than this [bytes] is something else.
const LARGEST: u64 = 16 << 20;
/// More points than this are a slip of the pen.
const MOST_POINTS: u64 = 1_000_000;

/// A campaign: valid by construction ([`read`] is the way to one).
#[derive(Debug, Clone, PartialEq)]
pub struct Campaign {
    /// Short name: that of the file's folder, or of the file.
    pub name: String,
    /// What it is called in tables and figures.
    pub title: String,
    /// The campaign file.
    pub file: PathBuf,
    /// The base scene: its file, or the folder that holds it.
    pub scene: PathBuf,
    /// Runs of each variant that differ by their seed.
    pub replicates: u64,
    /// Variants that are also run unsplit, for the comparison of loads.
    pub whole_runs: u64,
    /// Settings of all variants: dotted key, TOML value.
    pub settings: Vec<(String, String)>,
    /// What is varied, in the file's order; columns of one factor advance together, factors are crossed.
    pub factors: Vec<Factor>,
}

/// Columns that advance together: an axis, axes that are zipped, a table, a sample.
#[derive(Debug, Clone, PartialEq)]
pub struct Factor {
    /// Its columns.
    pub columns: Vec<Column>,
    /// Its points: one value for each column.
    pub points: Vec<Vec<Value>>,
}

/// Something that is varied.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Column {
    /// Name in tables.
    pub name: String,
    /// Unit of its numbers; empty where they have none.
    pub unit: String,
    /// Keys of the scene that are set to its value, dotted.
    pub keys: Vec<String>,
}

impl Column {
    /// Name and unit as a header: `tilt_deg`.
    #[must_use]
    pub fn header(&self) -> String {
        if self.unit.is_empty() {
            self.name.clone()
        } else {
            format!("{}_{}", self.name, self.unit.replace('/', "_per_").replace('%', "percent").replace(' ', "_"))
        }
    }

    /// Name and unit for people: `tilt [deg]`.
    #[must_use]
    pub fn label(&self) -> String {
        if self.unit.is_empty() { self.name.clone() } else { format!("{} [{}]", self.name, self.unit) }
    }
}

/// One value of a column.
#[derive(Debug, Clone, PartialEq)]
pub struct Value {
    /// As it stands in tables.
    pub cell: String,
    /// As a setting of the scene: a TOML value.
    pub setting: String,
}

impl Value {
    /// The number that it is, in its column's unit.
    #[must_use]
    pub fn number(&self) -> Option<f64> {
        self.cell.parse().ok().filter(|number: &f64| number.is_finite())
    }

    fn of_number(number: f64, unit: &str) -> Self {
        Self::of_cell(&number.to_string(), unit)
    }

    /// Of a table's cell: a TOML value, or else a text; with a unit, a number in it.
    pub(super) fn of_cell(cell: &str, unit: &str) -> Self {
        let setting = if unit.is_empty() {
            let is_value = toml::from_str::<toml::Table>(&format!("value = {cell}")).is_ok();
            if is_value { cell.to_owned() } else { quoted(cell) }
        } else {
            quoted(&format!("{cell} {unit}"))
        };
        Self { cell: cell.to_owned(), setting }
    }
}

/// A text as a TOML string.
pub(super) fn quoted(text: &str) -> String {
    toml::Value::String(text.to_owned()).to_string()
}

/// The campaign file that `path` names: itself, or the one in that folder.
#[must_use]
pub fn place(path: &Path) -> PathBuf {
    if path.is_dir() { path.join(FILE) } else { path.to_owned() }
}

/// Reads a campaign: `path` is its file, or a folder that holds `campaign.toml`.
///
/// # Errors
/// All findings at once.
pub fn read(path: &Path) -> Result<Campaign, CampaignError> {
    let file = place(path);
    let shown = file.display().to_string();
    let text = match std::fs::metadata(&file) {
        Ok(found) if found.len() > LARGEST => Err(format!("it has {} bytes, more than any campaign", found.len())),
        Ok(_) => std::fs::read_to_string(&file).map_err(|error| error.to_string()),
        Err(error) => Err(error.to_string()),
    };
    match text {
        Ok(text) => read_text(&text, &file),
        Err(reason) => {
            let report = Report::new(&shown, "");
            report.error(
                "file-unreadable",
                &Place::in_file(0..0),
                format!("the campaign \"{shown}\" cannot be read: {reason}"),
                "name a campaign file, or a folder that holds a campaign.toml",
            );
            Err(CampaignError::Findings(report.into_findings()))
        }
    }
}

/// Reads a campaign from the text of `file`; other files are named from its folder.
///
/// # Errors
/// All findings at once.
pub fn read_text(text: &str, file: &Path) -> Result<Campaign, CampaignError> {
    let report = Report::new(&file.display().to_string(), text);
    let root = tree::parse(text, &report);
    let campaign = match &root.value {
        TreeValue::Table(table) if report.is_empty() => resolve(Reader::root(table, "campaign", &report), file),
        _ => None,
    };
    let findings = report.into_findings();
    match campaign {
        Some(campaign) if findings.iter().all(|finding| finding.severity != Severity::Error) => Ok(campaign),
        _ => Err(CampaignError::Findings(findings)),
    }
}

fn resolve(reader: Reader<'_>, file: &Path) -> Option<Campaign> {
    let base = file.parent().unwrap_or(Path::new(""));
    match reader.integer("version", VERSION) {
        Some(VERSION) => {}
        Some(other) => reader.report.error(
            "unknown-version",
            &reader.place_of("version"),
            format!("campaigns of version {other} are not known"),
            format!("write `version = {VERSION}`"),
        ),
        None if reader.has("version") => {}
        None => reader.missing("version", &format!("version = {VERSION}")),
    }
    let title = reader.text("title");
    let scene = reader.text("scene").unwrap_or("scene.toml");
    let replicates = whole_number(&reader, "replicates", 1, 1);
    let whole_runs = whole_number(&reader, "whole_runs", 0, 0);
    let settings = reader.node("set").map_or_else(Vec::new, |node| free_settings(&reader, node));
    let mut factors = axes(&reader);
    factors.extend(reader.tables("table", "campaign.table").into_iter().filter_map(|table| table_of(table, base)));
    factors.extend(reader.tables("sample", "campaign.sample").into_iter().filter_map(sample));
    check_columns(&reader, &factors, &settings);
    let points: u64 = factors.iter().fold(replicates, |n, factor| n.saturating_mul(factor.points.len() as u64));
    if points > MOST_POINTS {
        reader.report.error(
            "out-of-range",
            &reader.place,
            format!("the campaign has {points} runs, more than {MOST_POINTS}"),
            "give fewer values, zip axes, or draw a sample",
        );
    }
    reader.finish();
    let name = crate::run::name_of(file, FILE);
    Some(Campaign {
        title: title.map_or_else(|| name.clone(), str::to_owned),
        name,
        file: file.to_owned(),
        scene: base.join(scene),
        replicates,
        whole_runs,
        settings,
        factors,
    })
}

fn whole_number(reader: &Reader<'_>, key: &'static str, default: u64, least: u64) -> u64 {
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

/// The table `set`: whole dotted keys, in quotes where they have dots.
fn free_settings(reader: &Reader<'_>, node: &Node) -> Vec<(String, String)> {
    let TreeValue::Table(table) = &node.value else {
        reader.wrong_type("set", node, "a table", "{ \"solver.timestep\" = \"2 us\" }");
        return Vec::new();
    };
    let setting = |entry: &tree::Entry| {
        if matches!(entry.node.value, TreeValue::Table(_)) {
            reader.report.error(
                "wrong-type",
                &entry.key_place,
                format!("`{}` is a table, and a setting is one key with its value", entry.key),
                format!("write the whole key in quotes: `\"{}.KEY\" = …`", entry.key),
            );
            return None;
        }
        Some((entry.key.clone(), value_of(reader, &entry.key, &entry.node, "")?.setting))
    };
    table.entries.iter().filter_map(setting).collect()
}

/// A TOML value as a value of a column.
fn value_of(reader: &Reader<'_>, key: &str, node: &Node, unit: &str) -> Option<Value> {
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
        let place = axis.place.clone();
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
                &place,
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
        let shares = super::latin_hypercube::shares(seed, &column.name, points.len());
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

/// No name and no key of the scene twice.
fn check_columns(reader: &Reader<'_>, factors: &[Factor], settings: &[(String, String)]) {
    let mut names = BTreeSet::new();
    let mut keys: BTreeSet<&str> = settings.iter().map(|(key, _)| key.as_str()).collect();
    for column in factors.iter().flat_map(|factor| &factor.columns) {
        let twice = |what: String, next: &str| {
            reader.report.error("given-twice", &reader.place, what, next);
        };
        if !names.insert(&column.name) || ["variant", "replicate", "seed", "status"].contains(&column.name.as_str()) {
            twice(format!("two columns of the results would be called `{}`", column.name), "give it another name");
        }
        for key in &column.keys {
            if !keys.insert(key) {
                twice(format!("`{key}` is set twice, here by \"{}\"", column.name), "keep one of them");
            }
        }
    }
}
