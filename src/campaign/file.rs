//! The campaign file: a base scene, what is varied, how often.

use super::CampaignError;
use super::factors::{self, value_of, whole_number};
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
pub(super) const MOST_POINTS: u64 = 1_000_000;

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

    pub(super) fn of_number(number: f64, unit: &str) -> Self {
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
    let shown = file.display().to_string();
    let report = Report::new(&shown, text);
    let root = tree::parse(text, &report);
    let campaign = if report.is_empty() { resolve(Reader::root(&root, "campaign", &report), file) } else { None };
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
    let factors = factors::factors(&reader, base);
    check_columns(&reader, &factors, &settings);
    let points: u64 = factors.iter().fold(replicates, |n, factor| n.saturating_mul(factor.points.len() as u64));
    if points > MOST_POINTS {
        reader.report.error(
            "out-of-range",
            reader.place,
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

/// No name and no key of the scene twice.
fn check_columns(reader: &Reader<'_>, factors: &[Factor], settings: &[(String, String)]) {
    let mut names = BTreeSet::new();
    let mut keys: BTreeSet<&str> = settings.iter().map(|(key, _)| key.as_str()).collect();
    for column in factors.iter().flat_map(|factor| &factor.columns) {
        let twice = |what: String, next: &str| {
            reader.report.error("given-twice", reader.place, what, next);
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
