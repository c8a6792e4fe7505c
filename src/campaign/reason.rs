//! The dry run: what would run, what is used again, and why; what it will cost.

use super::file::Campaign;
use super::status::{State, states};
use super::task::{Graph, Task};
use super::variant::{Variant, columns, label};
use super::workspace::{Contents, Workspace};
use super::{claim::Watch, results};
use crate::output::summary::Summary;
use crate::run::{RunRequest, prepare};
use crate::stage::key::{differences, value_of};
use crate::storage::staging::STAGING_SUFFIX;
use serde::Serialize;
use serde_json::Value;
use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::fs;
use std::path::Path;

/// Rows of a table for people; `--json` has all of them.
const MOST_ROWS: usize = 30;
/// Tasks for which the nearest stored result is looked for.
const MOST_COMPARED: usize = 12;
/// Stored results that a task is compared with.
const MOST_CANDIDATES: usize = 20;
/// Differences that are told of one.
const MOST_DIFFERENCES: usize = 4;
/// One particle in a frame [bytes]: id, material, diameter, position, velocity, spin, force as the writer of frames stores them.
const FRAME_BYTES_A_PARTICLE: f64 = 100.0;

/// What a campaign would do.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct DryRun {
    /// Name of the campaign.
    pub campaign: String,
    /// Its folder.
    pub workspace: String,
    /// Variants that are meant.
    pub variants: usize,
    /// Runs of each.
    pub replicates: u64,
    /// Variants whose scenes cannot run, and why.
    pub refused: Vec<(String, String)>,
    /// One a task.
    pub tasks: Vec<Row>,
    /// What the tasks to be run are expected to cost.
    pub cost: Cost,
}

/// A task in the dry run.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Row {
    /// The stage, marked where it is a whole run.
    pub stage: String,
    /// Name of its result.
    pub name: String,
    /// True where it would be computed.
    pub runs: bool,
    /// Its state: `done`, `due`, `begun`, `failed`, `running`, `held up`, `lacks outputs`, `not needed`.
    pub state: &'static str,
    /// Why.
    pub reason: String,
    /// The first variant that needs it.
    pub variant: String,
    /// How many variants and replicates need it.
    pub users: usize,
}

/// What is expected to be needed.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize)]
pub struct Cost {
    /// Stages to be computed.
    pub tasks: usize,
    /// Processor time [h]; null where nothing is known about the speed.
    pub processor_h: Option<f64>,
    /// Largest memory of a task [bytes]; null where nothing is known.
    pub memory_bytes: Option<f64>,
    /// Disk [bytes].
    pub disk_bytes: f64,
    /// Disk that is free where the workspace is [bytes]; null where the system does not tell.
    pub free_bytes: Option<f64>,
}

/// Looks at everything and changes nothing.
#[must_use]
pub fn dry_run(
    workspace: &Workspace,
    campaign: &Campaign,
    variants: &[Variant],
    meant: usize,
    graph: &Graph,
    rerun: super::scheduler::Rerun,
) -> DryRun {
    let states = states(workspace, graph, &mut Watch::default());
    let contents = Contents::of(workspace);
    let columns = columns(campaign);
    let mut first: Vec<Option<String>> = vec![None; graph.tasks.len()];
    for run in &graph.runs {
        for index in run.tasks.iter().chain(&run.whole) {
            first[*index].get_or_insert_with(|| {
                let label = label(&columns, &variants[run.variant]);
                if campaign.replicates > 1 { format!("{label}, replicate {}", run.replicate) } else { label }
            });
        }
    }
    let mut compared = 0;
    let row = |(index, (task, state)): (usize, (&Task, &State))| {
        let runs = would_run(state, rerun);
        let reason = reason(workspace, campaign, &contents, graph, task, state, &mut compared);
        Row {
            stage: task.group(),
            name: task.name(),
            runs,
            state: state.word(),
            reason,
            variant: first[index].clone().unwrap_or_default(),
            users: task.users,
        }
    };
    let tasks: Vec<Row> = graph.tasks.iter().zip(&states).enumerate().map(row).collect();
    let due: Vec<&Task> = graph.tasks.iter().zip(&tasks).filter(|(_, row)| row.runs).map(|(task, _)| task).collect();
    let refusal = |run: &super::task::Run| Some((label(&columns, &variants[run.variant]), run.refused.clone()?));
    DryRun {
        refused: graph.runs.iter().filter_map(refusal).collect(),
        campaign: campaign.name.clone(),
        workspace: workspace.root.display().to_string(),
        variants: meant,
        replicates: campaign.replicates,
        cost: cost(workspace, &contents, &due),
        tasks,
    }
}

fn would_run(state: &State, rerun: super::scheduler::Rerun) -> bool {
    match state {
        State::Due => true,
        State::Begun => rerun.resume,
        State::Failed(_) => rerun.failed,
        State::Lacking(_) => rerun.outputs,
        State::HeldUp(_) => rerun.failed || rerun.outputs,
        State::Stored(_) | State::Running(_) | State::NotNeeded => false,
    }
}

fn reason(
    workspace: &Workspace,
    campaign: &Campaign,
    contents: &Contents,
    graph: &Graph,
    task: &Task,
    state: &State,
    compared: &mut usize,
) -> String {
    match state {
        State::Stored(folder) => format!("stored in stages/{}/{folder}", task.group()),
        State::Lacking(outputs) => {
            format!("what is stored lacks {}; --rerun outputs computes it again", outputs.join(", "))
        }
        State::Running(holder) => format!("process {} on {} is computing it", holder.process, holder.host),
        State::Begun => "it was begun and has not ended; --resume goes on with it".to_owned(),
        State::Failed(failure) => {
            let line = failure.reason.lines().next().unwrap_or_default();
            format!("it failed (exit {}): {line}; --rerun failed computes it again", failure.exit_code)
        }
        State::HeldUp(by) => format!("waits for {} {}", graph.tasks[*by].group(), graph.tasks[*by].name()),
        State::NotNeeded => "everything downstream of it is stored".to_owned(),
        State::Due => {
            let Some(stored) =
                contents.stages.get(&task.group()).filter(|names| names.iter().any(|name| is_result(name)))
            else {
                return "new: no result of this stage is stored".to_owned();
            };
            *compared += 1;
            if *compared > MOST_COMPARED {
                return "new: no stored result has its key".to_owned();
            }
            let names = stored.iter().filter(|name| is_result(name)).take(MOST_CANDIDATES);
            nearest(workspace, campaign, task, names).unwrap_or_else(|| "new: no stored result has its key".to_owned())
        }
    }
}

fn is_result(name: &str) -> bool {
    !name.ends_with(STAGING_SUFFIX)
}

/// What tells a task from the stored result that it is most like.
fn nearest<'a>(
    workspace: &Workspace,
    campaign: &Campaign,
    task: &Task,
    names: impl Iterator<Item = &'a String>,
) -> Option<String> {
    let request = RunRequest {
        scene: campaign.scene.clone(),
        settings: task.settings.clone(),
        whole: task.is_whole,
        ..RunRequest::default()
    };
    let prepared = prepare(&request).ok()?;
    let index = prepared.jobs.iter().position(|job| job.name == task.stage)?;
    let mut content = value_of(&prepared.recipes().ok()?.swap_remove(index).content);
    drop_streams(&mut content);
    let found = names.filter_map(|name| {
        let text = fs::read(workspace.place(&task.group(), name).join("run.json")).ok()?;
        let mut held: Value = serde_json::from_slice(&text).ok()?;
        drop_streams(&mut held["content"]);
        let all = differences(&held["content"], &content, MOST_DIFFERENCES + 1);
        Some((all.len(), name.clone(), all))
    });
    let (count, name, mut differences) = found.min_by_key(|(count, name, _)| (*count, name.clone()))?;
    if count == 0 {
        return Some(format!("what is upstream of it differs from that of stored {name}"));
    }
    if differences.len() > MOST_DIFFERENCES {
        differences.truncate(MOST_DIFFERENCES);
        differences.push("...".to_owned());
    }
    Some(format!("new: differs from stored {name} in {}", differences.join("; ")))
}

/// Streams have digests where they were computed, and recipes where they are planned: they are told apart by what is upstream.
fn drop_streams(content: &mut Value) {
    if let Some(choices) = content.get_mut("choices").and_then(Value::as_object_mut) {
        choices.remove("streams");
    }
}

/// What some tasks will cost: as stored results of their stage did, else as the plan expects.
fn cost(workspace: &Workspace, contents: &Contents, due: &[&Task]) -> Cost {
    let mut known: BTreeMap<String, Option<Measured>> = BTreeMap::new();
    let mut cost = Cost { tasks: due.len(), processor_h: Some(0.0), memory_bytes: Some(0.0), ..Cost::default() };
    for task in due {
        let group = task.group();
        let measured = *known.entry(group.clone()).or_insert_with(|| measured(workspace, contents, &group));
        let processor = measured.and_then(|measured| measured.cpu_s).or(task.forecast.wall_s);
        let memory = measured.and_then(|measured| measured.memory_bytes).or(task.forecast.memory_bytes);
        cost.processor_h = cost.processor_h.zip(processor).map(|(sum, seconds)| sum + seconds / 3600.0);
        cost.memory_bytes = cost.memory_bytes.zip(memory).map(|(largest, bytes)| largest.max(bytes));
        let planned = task.forecast.particles * task.forecast.frames * FRAME_BYTES_A_PARTICLE;
        cost.disk_bytes += measured.map_or(planned, |measured| measured.disk_bytes);
    }
    cost.free_bytes = free_bytes(&workspace.root);
    cost
}

#[derive(Debug, Clone, Copy)]
struct Measured {
    cpu_s: Option<f64>,
    memory_bytes: Option<f64>,
    disk_bytes: f64,
}

/// Of the first stored result of a stage.
fn measured(workspace: &Workspace, contents: &Contents, group: &str) -> Option<Measured> {
    let name = contents.stages.get(group)?.iter().find(|name| is_result(name))?;
    let place = workspace.place(group, name);
    let summary = Summary::read(&place.join("summary.json")).ok()?;
    let stage = summary.stages.first()?;
    Some(Measured {
        cpu_s: stage.cpu_s,
        memory_bytes: stage.peak_memory_bytes.map(|bytes| bytes as f64),
        disk_bytes: results::size_of(&place) as f64,
    })
}

/// What is free where `root` is or will be [bytes].
fn free_bytes(root: &Path) -> Option<f64> {
    let there = root.ancestors().find(|folder| folder.is_dir() || folder.as_os_str().is_empty())?;
    let folder = if there.as_os_str().is_empty() { Path::new(".") } else { there };
    let space = rustix::fs::statvfs(folder).ok()?;
    Some(space.f_bavail as f64 * space.f_frsize as f64)
}

impl DryRun {
    /// As text for a terminal.
    #[must_use]
    pub fn to_text(&self) -> String {
        let times = if self.replicates > 1 { format!(" x {} replicates", self.replicates) } else { String::new() };
        let mut text =
            format!("campaign {}: {} variants{times}, results in {}\n\n", self.campaign, self.variants, self.workspace);
        text += &self.groups();
        let width = self.tasks.iter().map(|row| row.stage.len()).max().unwrap_or(0);
        let shown = self.tasks.iter().filter(|row| row.runs).chain(self.tasks.iter().filter(|row| !row.runs));
        for row in shown.take(MOST_ROWS) {
            let what = match (row.runs, row.state) {
                (true, _) => "run",
                (false, "done") => "keep",
                (false, _) => "leave",
            };
            let many = if row.users > 1 { format!(" (for {} runs)", row.users) } else { String::new() };
            let _ = write!(text, "\n{what:<5} {:<width$}  {}{many}\n      {}", row.stage, row.variant, row.reason);
        }
        if self.tasks.len() > MOST_ROWS {
            let _ = write!(text, "\n... and {} more; --json lists all", self.tasks.len() - MOST_ROWS);
        }
        for (variant, refusal) in self.refused.iter().take(MOST_ROWS) {
            let _ = write!(text, "\nrefused {variant}: {refusal}");
        }
        let hours = self.cost.processor_h.map_or_else(|| "unknown".to_owned(), duration);
        let memory = self.cost.memory_bytes.map_or_else(|| "unknown".to_owned(), megabytes);
        let free = self.cost.free_bytes.map_or_else(String::new, |bytes| format!(" of {} free", megabytes(bytes)));
        let _ = write!(
            text,
            "\n\n{} stages to be computed: processor time at most {hours}, memory of the largest {memory}, disk {}{free}",
            self.cost.tasks,
            megabytes(self.cost.disk_bytes)
        );
        text
    }

    /// Each stage on a line: how many, how many of them run.
    fn groups(&self) -> String {
        let mut groups: BTreeMap<&str, (usize, usize, BTreeMap<&str, usize>)> = BTreeMap::new();
        for row in &self.tasks {
            let group = groups.entry(&row.stage).or_default();
            group.0 += 1;
            group.1 += usize::from(row.runs);
            *group.2.entry(row.state).or_insert(0) += 1;
        }
        let mut text = String::new();
        for (stage, (all, runs, states)) in groups {
            let states: Vec<String> = states.iter().map(|(word, count)| format!("{count} {word}")).collect();
            let _ = writeln!(text, "{stage}: {all} different, {runs} to be computed ({})", states.join(", "));
        }
        text
    }
}

/// Hours for people.
fn duration(hours: f64) -> String {
    match hours * 3600.0 {
        seconds if seconds < 120.0 => format!("{seconds:.0} s"),
        seconds if seconds < 7200.0 => format!("{:.0} min", seconds / 60.0),
        _ => format!("{hours:.1} h"),
    }
}

/// Bytes for people.
fn megabytes(bytes: f64) -> String {
    if bytes < 1e9 { format!("{:.0} MB", bytes / 1e6) } else { format!("{:.1} GB", bytes / 1e9) }
}
