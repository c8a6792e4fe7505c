//! What came out: one tidy row a variant and replicate, a summary over replicates, and what the split saved.

use super::CampaignError;
use super::file::Campaign;
use super::status::State;
use super::task::{Graph, Run};
use super::variant::{Variant, columns};
use super::workspace::Workspace;
use crate::analysis::replicates::{ReplicateFigure, figures};
use crate::output::summary::{LoadAccount, Summary};
use crate::stage::key::value_of;
use crate::storage::StorageError;
use crate::storage::staging::write_whole;
use serde::Serialize;
use serde_json::Value;
use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::{Path, PathBuf};

/// The results of all runs.
#[derive(Debug, Clone)]
pub struct Results {
    /// Names of the measures, with units.
    pub measures: Vec<String>,
    /// One a run.
    pub rows: Vec<ResultRow>,
    /// Split against unsplit; `None` for a scene without gates, or before any run is done.
    pub load: Option<Load>,
    /// Summaries of stored tasks by their index.
    summaries: BTreeMap<usize, Summary>,
}

/// The result of one variant and replicate.
#[derive(Debug, Clone, PartialEq)]
pub struct ResultRow {
    /// Index of the variant.
    pub variant: usize,
    /// Its replicate, from 1.
    pub replicate: u64,
    /// Its seed.
    pub seed: u64,
    /// `done`, `refused`, or the state of the first of its tasks that is not done.
    pub status: &'static str,
    /// Why it is not done.
    pub reason: String,
    /// Measures by name.
    pub measures: BTreeMap<String, Value>,
    /// Processor time of the tasks that nothing follows [s].
    pub own_cpu_s: Option<f64>,
    /// Processor time of the tasks upstream of them, shared with other runs [s].
    pub shared_cpu_s: Option<f64>,
    /// Largest memory of its tasks [bytes].
    pub peak_memory_bytes: Option<u64>,
    /// Names of its tasks.
    pub keys: Vec<(String, String)>,
}

/// What the split costs and saves in processor time, forecast and measured.
#[derive(Debug, Clone, PartialEq, Default, Serialize)]
pub struct Load {
    /// The account of the stages.
    #[serde(flatten)]
    pub account: LoadAccount,
    /// Whole runs that were measured.
    pub whole_runs: usize,
    /// Mean processor time of one [s]; null without any.
    pub whole_cpu_s: Option<f64>,
    /// max(X, Y) times that: what the same costs where nothing is stored, measured [s]; null without any.
    pub unsplit_cpu_s: Option<f64>,
    /// Unsplit over split, both measured [-]; null without whole runs.
    pub ratio_measured: Option<f64>,
}

/// Collects the results of a graph whose tasks have these states.
///
/// # Errors
/// When a stored summary cannot be read.
pub fn collect(workspace: &Workspace, graph: &Graph, states: &[State]) -> Result<Results, StorageError> {
    let mut summaries = BTreeMap::new();
    for (index, (task, state)) in graph.tasks.iter().zip(states).enumerate() {
        if let State::Stored(folder) = state {
            let place = workspace.place(&task.group(), folder).join("summary.json");
            summaries.insert(index, Summary::read(&place)?);
        }
    }
    let rows: Vec<ResultRow> = graph.runs.iter().map(|run| row(graph, states, &summaries, run)).collect();
    let names: BTreeSet<&String> = rows.iter().flat_map(|row| row.measures.keys()).collect();
    Ok(Results { measures: names.into_iter().cloned().collect(), load: load(graph, &summaries), rows, summaries })
}

fn row(graph: &Graph, states: &[State], summaries: &BTreeMap<usize, Summary>, run: &Run) -> ResultRow {
    let is_fine = |index: &&usize| matches!(states[**index], State::Stored(_) | State::NotNeeded);
    let first = run.tasks.iter().find(|index| !is_fine(index));
    // What stopped a held-up stage is more telling than that it is held up.
    let mut cause = first.copied();
    while let Some(State::HeldUp(by)) = cause.map(|index| &states[index]) {
        cause = Some(*by);
    }
    let mut measures = BTreeMap::new();
    for index in run.tasks.iter().filter(|index| graph.tasks[**index].is_leaf) {
        let task = &graph.tasks[*index];
        let Some(summary) = summaries.get(index) else { continue };
        let outputs = value_of(&task.outputs);
        for (name, value) in summary.measures.iter().filter(|(name, _)| is_asked(&outputs, name)) {
            let name = if graph.is_cut { format!("{}.{name}", task.stage) } else { name.clone() };
            measures.insert(name, value.clone());
        }
    }
    let of = |is_leaf: bool| {
        let tasks = run.tasks.iter().filter(move |index| graph.tasks[**index].is_leaf == is_leaf);
        tasks.map(|index| cpu(summaries, *index)).sum::<Option<f64>>()
    };
    let memory = run.tasks.iter().filter_map(|index| summaries.get(index)?.stages.first()?.peak_memory_bytes).max();
    ResultRow {
        variant: run.variant,
        replicate: run.replicate,
        seed: run.seed,
        status: if run.refused.is_some() { "refused" } else { first.map_or("done", |index| states[*index].word()) },
        reason: match (&run.refused, cause) {
            (Some(refusal), _) => one_line(refusal),
            (None, Some(index)) => reason(graph, &states[index], index),
            (None, None) => String::new(),
        },
        measures,
        own_cpu_s: of(true),
        shared_cpu_s: of(false),
        peak_memory_bytes: memory,
        keys: run.tasks.iter().map(|index| (graph.tasks[*index].stage.clone(), graph.tasks[*index].name())).collect(),
    }
}

fn reason(graph: &Graph, state: &State, index: usize) -> String {
    let stage = graph.tasks[index].group();
    match state {
        State::Failed(failure) => {
            format!("{stage} (exit {}): {}", failure.exit_code, one_line(&failure.reason))
        }
        State::Begun => format!("{stage} was begun and has not ended"),
        State::Lacking(outputs) => format!("{stage} lacks {}", outputs.join(", ")),
        _ => String::new(),
    }
}

/// A text of several lines as one cell of a table.
fn one_line(text: &str) -> String {
    text.lines().map(str::trim).collect::<Vec<_>>().join(" ")
}

/// Whether the measure a summary calls `name` is asked for: a stored result may have more of them.
fn is_asked(outputs: &Value, name: &str) -> bool {
    let asked = outputs["measures"].as_array().into_iter().flatten();
    asked.filter_map(|measure| measure["name"].as_str()).any(|asked| name.starts_with(asked))
}

fn cpu(summaries: &BTreeMap<usize, Summary>, index: usize) -> Option<f64> {
    summaries.get(&index)?.stages.first()?.cpu_s
}

/// What the split costs and saves, from all stored tasks.
fn load(graph: &Graph, summaries: &BTreeMap<usize, Summary>) -> Option<Load> {
    if !graph.is_cut {
        return None;
    }
    let of = |wanted: &dyn Fn(usize) -> bool| {
        let found = (0..graph.tasks.len()).filter(|index| wanted(*index));
        found.filter_map(|index| cpu(summaries, index)).collect::<Vec<f64>>()
    };
    let upstream = of(&|index| !graph.tasks[index].is_whole && !graph.tasks[index].is_leaf);
    let downstream = of(&|index| !graph.tasks[index].is_whole && graph.tasks[index].is_leaf);
    let whole = of(&|index| graph.tasks[index].is_whole);
    // Chains of stages upstream of one another count once: as often as their first stage is computed.
    let is_first = |index: &usize| {
        let task = &graph.tasks[*index];
        !task.is_whole && !task.is_leaf && task.upstream.is_empty() && summaries.contains_key(index)
    };
    let chains = (0..graph.tasks.len()).filter(is_first).count();
    let account = LoadAccount::of(&upstream, chains, &downstream)?;
    let memory = summaries.values().filter_map(|summary| summary.stages.first()?.peak_memory_bytes).max();
    let whole_mean = (!whole.is_empty()).then(|| whole.iter().sum::<f64>() / whole.len() as f64);
    let unsplit = whole_mean.map(|mean| mean * account.upstream_runs.max(account.downstream_runs) as f64);
    Some(Load {
        whole_runs: whole.len(),
        whole_cpu_s: whole_mean,
        unsplit_cpu_s: unsplit,
        ratio_measured: unsplit.map(|unsplit| unsplit / account.split_cpu_s),
        account: LoadAccount { peak_memory_bytes: memory, ..account },
    })
}

impl Load {
    /// In words.
    #[must_use]
    pub fn to_text(&self) -> String {
        let account = &self.account;
        let mut text = format!(
            "load: A X + B Y with the median B = {:.1} s x {} + {:.1} s x {} = {:.1} s of processor time; measured {:.1} s ({:+.1} %)\n\
             unsplit by forecast (A + B) max(X, Y) = {:.1} s: {:.2} times",
            account.upstream_cpu_s,
            account.upstream_runs,
            account.median_downstream_cpu_s(),
            account.downstream_runs,
            account.split_forecast_cpu_s,
            account.split_cpu_s,
            100.0 * (account.split_cpu_s / account.split_forecast_cpu_s - 1.0),
            account.unsplit_forecast_cpu_s,
            account.ratio
        );
        if let (Some(whole), Some(unsplit), Some(ratio)) = (self.whole_cpu_s, self.unsplit_cpu_s, self.ratio_measured) {
            text += &format!(
                "; unsplit by {} whole runs of {whole:.1} s on average: {unsplit:.1} s, {ratio:.2} times",
                self.whole_runs
            );
        }
        text
    }
}

impl Results {
    /// Where the last stage of a run that is done, and its summary, are: of each run and each last stage.
    pub(super) fn leaves<'a>(&'a self, graph: &'a Graph) -> impl Iterator<Item = (usize, usize, &'a Summary)> + 'a {
        graph.runs.iter().enumerate().flat_map(move |(run, of)| {
            let leaves = of.tasks.iter().filter(|index| graph.tasks[**index].is_leaf);
            leaves.filter_map(move |index| Some((run, *index, self.summaries.get(index)?)))
        })
    }

    /// Writes `results.csv`, `summary.csv` and `load.json` into the workspace.
    ///
    /// # Errors
    /// When the disk refuses.
    pub fn write(&self, workspace: &Workspace, campaign: &Campaign, variants: &[Variant]) -> Result<(), CampaignError> {
        let root = &workspace.root;
        write_whole(&root.join("results.csv"), &self.table(campaign, variants, &root.join("results.csv"))?)?;
        write_whole(&root.join("summary.csv"), &self.over_replicates(campaign, variants, &root.join("summary.csv"))?)?;
        if let Some(load) = &self.load {
            let mut text = serde_json::to_vec_pretty(load).expect("a load is plain numbers");
            text.push(b'\n');
            write_whole(&root.join("load.json"), &text)?;
        }
        Ok(())
    }

    /// One row a run. Times and memory, which differ from one computation to the next, are the last columns.
    fn table(&self, campaign: &Campaign, variants: &[Variant], place: &Path) -> Result<Vec<u8>, StorageError> {
        let columns = columns(campaign);
        let stages: Vec<&String> = self
            .rows
            .iter()
            .find(|row| !row.keys.is_empty())
            .map_or_else(Vec::new, |row| row.keys.iter().map(|(stage, _)| stage).collect());
        let mut header = vec!["variant".to_owned()];
        header.extend(columns.iter().map(|column| column.header()));
        header.extend(["replicate", "seed", "status", "reason"].map(str::to_owned));
        header.extend(self.measures.iter().cloned());
        header.extend(stages.iter().map(|stage| format!("key.{stage}")));
        header.extend(["own_cpu_s", "shared_cpu_s", "peak_memory_bytes"].map(str::to_owned));
        let mut rows = vec![header];
        for row in &self.rows {
            let variant = &variants[row.variant];
            let mut cells = vec![variant.number.to_string()];
            cells.extend(variant.values.iter().map(|value| value.cell.clone()));
            cells.extend([row.replicate.to_string(), row.seed.to_string(), row.status.to_owned(), row.reason.clone()]);
            cells.extend(self.measures.iter().map(|name| cell(row.measures.get(name))));
            let key = |stage: &&String| row.keys.iter().find(|(other, _)| other == *stage).map(|(_, key)| key.clone());
            cells.extend(stages.iter().map(|stage| key(stage).unwrap_or_default()));
            let time = |seconds: Option<f64>| seconds.map_or_else(String::new, |seconds| format!("{seconds:.2}"));
            cells.extend([time(row.own_cpu_s), time(row.shared_cpu_s)]);
            cells.push(row.peak_memory_bytes.map_or_else(String::new, |bytes| bytes.to_string()));
            rows.push(cells);
        }
        csv_of(&rows, place)
    }

    /// One row a variant and measure: mean and 95 % interval over replicates.
    fn over_replicates(
        &self,
        campaign: &Campaign,
        variants: &[Variant],
        place: &Path,
    ) -> Result<Vec<u8>, StorageError> {
        let columns = columns(campaign);
        let mut header = vec!["variant".to_owned()];
        header.extend(columns.iter().map(|column| column.header()));
        let of_figure = [
            "measure",
            "count",
            "mean",
            "standard_deviation",
            "interval_95_low",
            "interval_95_high",
            "minimum",
            "maximum",
        ];
        header.extend(of_figure.map(str::to_owned));
        let mut rows = vec![header];
        for (variant, figures) in self.by_variant() {
            for (name, figure) in figures {
                let variant = &variants[variant];
                let mut cells = vec![variant.number.to_string()];
                cells.extend(variant.values.iter().map(|value| value.cell.clone()));
                let optional = |value: Option<f64>| value.map_or_else(String::new, |value| value.to_string());
                cells.extend([name, figure.count.to_string(), figure.mean.to_string()]);
                cells.push(optional(figure.standard_deviation));
                cells.extend([0, 1].map(|end| optional(figure.interval_95.map(|interval| interval[end]))));
                cells.extend([figure.minimum.to_string(), figure.maximum.to_string()]);
                rows.push(cells);
            }
        }
        csv_of(&rows, place)
    }

    /// Figures over the replicates of each variant, in the order of variants.
    pub(super) fn by_variant(&self) -> Vec<(usize, BTreeMap<String, ReplicateFigure>)> {
        let variants: BTreeSet<usize> = self.rows.iter().map(|row| row.variant).collect();
        let figures_of = |variant: usize| {
            let rows = self.rows.iter().filter(|row| row.variant == variant);
            (variant, figures(rows.map(|row| &row.measures)))
        };
        variants.into_iter().map(figures_of).collect()
    }
}

fn cell(value: Option<&Value>) -> String {
    match value {
        Some(Value::String(text)) => text.clone(),
        Some(Value::Null) | None => String::new(),
        Some(other) => other.to_string(),
    }
}

fn csv_of(rows: &[Vec<String>], place: &Path) -> Result<Vec<u8>, StorageError> {
    let mut writer = csv::Writer::from_writer(Vec::new());
    for row in rows {
        writer.write_record(row).map_err(|error| StorageError::mismatch(place, error.to_string()))?;
    }
    writer.into_inner().map_err(|error| StorageError::mismatch(place, error.to_string()))
}

/// What a folder takes on the disk [bytes].
#[must_use]
pub fn size_of(folder: &Path) -> u64 {
    let mut size = 0;
    let mut open: Vec<PathBuf> = vec![folder.to_path_buf()];
    while let Some(path) = open.pop() {
        for entry in fs::read_dir(&path).into_iter().flatten().flatten() {
            match entry.metadata() {
                Ok(found) if found.is_dir() => open.push(entry.path()),
                Ok(found) => size += found.len(),
                Err(_) => {}
            }
        }
    }
    size
}
