//! One run end to end: the only place that knows all layers.
//!
//! scene -> plan -> stages (cut at the gates, or whole) -> each stage on its backend, its streams recorded and replayed -> measures ->
//! summary. A stage whose result is there under the same key is not computed again.

pub mod comparison;
pub mod deck;
mod folder;
pub mod gate_records;
pub mod gates;
mod load;
mod picture;
mod prepared;
mod replicates;
mod stage;
mod streams;
mod summary;

use crate::backend::BackendError;
use crate::backend::stage::Kick;
use crate::exit_code;
use crate::math::lanes::SimdLevel;
use crate::output::progress::Verbosity;
use crate::output::summary::Summary;
use crate::plan::Plan;
use crate::scene::{Finding, Scene};
use crate::stage::key::StageKey;
use crate::stage::split::{StageJob, why_not_whole};
use crate::storage::StorageError;
pub use folder::name_of;
use folder::{Claim, RunFolder};
pub use prepared::{Prepared, prepare};
use stage::{StageOrder, StageOutcome};
use std::path::{Path, PathBuf};
use std::sync::atomic::AtomicBool;

/// What is asked for on the command line.
#[derive(Debug, Clone, Default)]
pub struct RunRequest {
    /// Scene file, or the folder that holds `scene.toml`.
    pub scene: PathBuf,
    /// Changed settings, dotted key and value.
    pub settings: Vec<(String, String)>,
    /// Folder for the results; `None` for `runs/<scene>`.
    pub out: Option<PathBuf>,
    /// Threads; `None` for one a processor core.
    pub threads: Option<usize>,
    /// Instruction set of the native contact kernels; the fastest that is there where it is `None`.
    pub simd: Option<SimdLevel>,
    /// Run although the plan refuses.
    pub force: bool,
    /// Continue an unfinished run.
    pub resume: bool,
    /// Do not cut at the gates: each last stage with everything upstream of it in one run.
    pub whole: bool,
    /// Only these stages; empty for all. What is upstream of them must have been run.
    pub stages: Vec<String>,
    /// Folders of other runs, whose stages count as done where their keys are the same.
    pub reuse: Vec<PathBuf>,
    /// Use streams although they do not fit the scene.
    pub accept_stream: bool,
    /// How many runs that differ by their seed, or by their kick.
    pub replicates: u64,
    /// Moves one particle by this length [m] at the start.
    pub perturb: Option<f64>,
    /// How much is said while it runs.
    pub verbosity: Verbosity,
}

/// What a run left behind.
#[derive(Debug)]
pub struct RunReport {
    /// Folder of the results.
    pub folder: PathBuf,
    /// The content of its `summary.json`.
    pub summary: Summary,
    /// True where an earlier run had done all of it.
    pub was_done: bool,
    /// Wall time by phase, as a table; empty where nothing was computed.
    pub timing: String,
}

/// Why there is no result.
#[derive(Debug)]
pub enum RunError {
    /// The scene is wrong.
    Scene(Vec<Finding>),
    /// The plan refuses the run.
    Refused(Box<Plan>),
    /// No backend can do what the scene needs.
    NoBackend(Box<Plan>),
    /// What was asked for on the command line does not fit the scene.
    Request(String),
    /// The result folder, or the checkpoint to start from, cannot be used for this run.
    Folder(String),
    /// A stream is missing, damaged, or does not fit.
    Stream(String),
    /// The folder holds this very run, which the watchdog stopped, in these words.
    StoppedBefore(String),
    /// The backend failed; the folder holds what was written.
    Backend(BackendError),
}

impl RunError {
    /// The exit status of a command that ends with this error.
    #[must_use]
    pub const fn exit_code(&self) -> u8 {
        match self {
            Self::Scene(_) | Self::Refused(_) | Self::Folder(_) | Self::Request(_) => exit_code::USAGE,
            Self::NoBackend(_) => exit_code::NO_BACKEND,
            Self::Stream(_) => exit_code::STREAM_UNUSABLE,
            Self::StoppedBefore(_) => exit_code::UNSTABLE,
            Self::Backend(error) => error.exit_code(),
        }
    }
}

impl std::fmt::Display for RunError {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::Scene(findings) => {
                let place = |f: &Finding| if f.line > 0 { format!("{}:{}", f.file, f.line) } else { f.file.clone() };
                let line = |finding: &Finding| format!("{}: {}; {}", place(finding), finding.what, finding.next);
                write!(f, "{}", findings.iter().map(line).collect::<Vec<_>>().join("\n"))
            }
            Self::Refused(plan) => {
                let texts: Vec<&str> = plan.findings.iter().map(|finding| finding.text.as_str()).collect();
                write!(f, "the plan refuses this run: {}", texts.join("\n"))
            }
            Self::NoBackend(plan) => write!(f, "{}\nno backend can do what this scene needs", plan.to_text()),
            Self::Folder(text) | Self::Stream(text) | Self::Request(text) => write!(f, "{text}"),
            Self::StoppedBefore(reason) => {
                write!(f, "this run was done before; nothing was computed. Then: {reason}")
            }
            Self::Backend(error) => write!(f, "{error}"),
        }
    }
}

impl std::error::Error for RunError {}

impl From<BackendError> for RunError {
    fn from(error: BackendError) -> Self {
        Self::Backend(error)
    }
}

impl From<StorageError> for RunError {
    fn from(error: StorageError) -> Self {
        Self::Backend(BackendError::Output(error))
    }
}

/// Runs a scene from its file to its summary, as often as asked for.
///
/// # Errors
/// See [`RunError`]. An unstable run leaves a readable folder and a summary that says so.
pub fn run(request: &RunRequest, interrupted: &AtomicBool) -> Result<RunReport, RunError> {
    let out = request.out.clone().unwrap_or_else(|| Path::new("runs").join(name_of(&request.scene, "scene.toml")));
    if request.replicates > 1 {
        return replicates::run(request, &out, interrupted);
    }
    run_once(request, &out, 0, interrupted)
}

/// One run into the folder `out`; `draw` picks the particle that is kicked.
fn run_once(request: &RunRequest, out: &Path, draw: u64, interrupted: &AtomicBool) -> Result<RunReport, RunError> {
    let mut prepared = prepare(request)?;
    prepared.warnings.extend(unlike_the_stages(&prepared.scene, &prepared.jobs, request));
    let (scene, jobs) = (&prepared.scene, &prepared.jobs);
    let chosen = chosen(jobs, &request.stages, request.whole)?;
    if !scene.is_cut() {
        let order = prepared.order(request, kick_of(request, draw), interrupted);
        let outcome = stage::run(&order, &jobs[0], out, &[])?;
        return Ok(RunReport {
            folder: out.to_path_buf(),
            was_done: outcome.was_done,
            timing: outcome.timing,
            summary: outcome.summary,
        });
    }
    let order = prepared.order(request, kick_of(request, draw), interrupted);
    let key = StageKey::of_run(scene, request.whole, request.perturb.map(|length| (length, draw)));
    let claim = if request.stages.is_empty() { Claim::new(request.resume) } else { Claim::Part };
    let folder = RunFolder::claim(out, &key, claim)?;
    let (outcomes, failure) = run_stages(&order, scene, jobs, &chosen, out)?;
    let summary = summary::of_stages(&order, scene, jobs, &outcomes);
    summary.write(&folder.summary_path())?;
    if let Some(error) = failure {
        return Err(error);
    }
    picture::draw_stages(scene, jobs, &outcomes, &summary, out)?;
    Ok(RunReport {
        folder: out.to_path_buf(),
        was_done: outcomes.iter().all(|outcome| outcome.was_done),
        timing: outcomes.iter().map(|outcome| outcome.timing.as_str()).collect(),
        summary,
    })
}

/// Runs the chosen stages, upstream first, up to the first that does not come to its end; with what stopped that one.
fn run_stages(
    order: &StageOrder,
    scene: &Scene,
    jobs: &[StageJob],
    chosen: &[usize],
    out: &Path,
) -> Result<(Vec<StageOutcome>, Option<RunError>), RunError> {
    let mut outcomes: Vec<Option<StageOutcome>> = Vec::new();
    let mut places: Vec<PathBuf> = jobs.iter().map(|job| stage_folder(out, &job.name)).collect();
    let mut failure = None;
    for (index, job) in jobs.iter().enumerate() {
        let place = places[index].clone();
        outcomes.push(if chosen.contains(&index) {
            let inputs = streams::inputs(scene, jobs, index, &places, order.request.accept_stream)?;
            match stage::run(order, job, &place, &inputs) {
                Ok(outcome) => Some(outcome),
                // What the stages before it brought is told with what went wrong.
                Err(error @ RunError::Backend(_)) => {
                    failure = Some(error);
                    stage::found(&job.name, &place)?
                }
                Err(error) => return Err(error),
            }
        } else {
            stage::found(&job.name, &place)?
        });
        if let Some(outcome) = &outcomes[index] {
            places[index].clone_from(&outcome.folder);
        }
        let ended = outcomes[index].as_ref().map(|outcome| outcome.summary.outcome.exit_code);
        if failure.is_some() || ended.is_some_and(|code| code != exit_code::DONE) {
            break;
        }
    }
    Ok((outcomes.into_iter().flatten().collect(), failure))
}

/// Whole runs that are not the same plant as their stages, in words.
fn unlike_the_stages(scene: &Scene, jobs: &[StageJob], request: &RunRequest) -> Vec<String> {
    let text = |job: &StageJob| {
        let why = why_not_whole(scene, &job.name).filter(|_| request.whole)?;
        Some(format!("the whole run of '{}' is not what its stages are: {why}", job.name))
    };
    jobs.iter().filter_map(text).collect()
}

/// The kick of replicate number `draw`.
fn kick_of(request: &RunRequest, draw: u64) -> Option<Kick> {
    request.perturb.map(|length| Kick { length, draw })
}

/// Where a stage of a cut scene has its results.
fn stage_folder(run: &Path, stage: &str) -> PathBuf {
    run.join("stages").join(stage)
}

/// The stages to be run, upstream first.
fn chosen(jobs: &[StageJob], stages: &[String], whole: bool) -> Result<Vec<usize>, RunError> {
    if stages.is_empty() {
        return Ok((0..jobs.len()).collect());
    }
    let known: Vec<&str> = jobs.iter().map(|job| job.name.as_str()).collect();
    if let Some(unknown) = stages.iter().find(|name| !known.contains(&name.as_str())) {
        let whole = if whole { " (with --whole, a stage is one that no other follows)" } else { "" };
        return Err(RunError::Request(format!(
            "there is no stage '{unknown}'{whole}; the stages are {}",
            known.join(", ")
        )));
    }
    Ok((0..jobs.len()).filter(|&index| stages.contains(&jobs[index].name)).collect())
}
