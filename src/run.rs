//! One run end to end: the only place that knows all layers.

pub mod comparison;
mod folder;
pub mod gate_records;
mod picture;
mod summary;

use crate::analysis::{MeasureResult, Observed, evaluate};
use crate::backend::{BackendError, native};
use crate::exit_code;
use crate::output::progress::Verbosity;
use crate::output::summary::Summary;
use crate::plan::{Plan, plan};
use crate::scene::{self, Finding, Scene};
use crate::stage::key::{Choices, StageKey};
use crate::storage::StorageError;
use folder::RunFolder;
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
    /// Run although the plan refuses.
    pub force: bool,
    /// Continue an unfinished run.
    pub resume: bool,
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
    /// The result folder, or the checkpoint to start from, cannot be used for this run.
    Folder(String),
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
            Self::Scene(_) | Self::Refused(_) | Self::Folder(_) => exit_code::USAGE,
            Self::NoBackend(_) => exit_code::NO_BACKEND,
            Self::StoppedBefore(_) => exit_code::UNSTABLE,
            Self::Backend(error) => error.exit_code(),
        }
    }
}

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

/// Runs a scene from its file to its summary.
///
/// # Errors
/// See [`RunError`]. An unstable run leaves a readable folder and a summary that says so.
pub fn run(request: &RunRequest, interrupted: &AtomicBool) -> Result<RunReport, RunError> {
    let (scene, warnings) = scene::read(&request.scene, &request.settings).map_err(RunError::Scene)?;
    let plan = accepted_plan(&scene, request.force)?;
    let key = stage_key(&scene, &plan)?;
    let path = request.out.clone().unwrap_or_else(|| Path::new("runs").join(folder::name_of(&request.scene)));
    let folder = RunFolder::claim(&path, &key, request.resume)?;
    if let Some(summary) = folder.finished()? {
        if summary.outcome.exit_code == exit_code::UNSTABLE {
            return Err(RunError::StoppedBefore(summary.outcome.reason));
        }
        return Ok(RunReport { folder: path, summary, was_done: true, timing: String::new() });
    }
    let threads = request.threads.unwrap_or_else(native::default_threads);
    let setup = native::setup::setup(&scene, &plan, threads);
    let stage = native::Request {
        folder: &path,
        key: &key.key,
        resume: request.resume,
        verbosity: request.verbosity,
        interrupted,
    };
    let warned = summary::warnings(&warnings, &plan);
    let result = match native::run(&scene, setup, &stage, &mut []) {
        Ok(result) => result,
        Err(error) => {
            // What went wrong first is what the user must hear of, also where the disk takes no summary any more.
            drop(summary::of_failure(request, &scene, &plan, &error, warned).write(&folder.summary_path()));
            return Err(error.into());
        }
    };
    let measures = measured(&scene, &result, &path)?;
    picture::draw(&scene, &result, &measures, &path)?;
    let summary = summary::of(request, &scene, &plan, &result, &measures, warned, threads);
    summary.write(&folder.summary_path())?;
    Ok(RunReport { folder: path, summary, was_done: false, timing: result.timing.table() })
}

/// The plan of a scene, unless it refuses or no backend can.
fn accepted_plan(scene: &Scene, force: bool) -> Result<Plan, RunError> {
    let plan = plan(scene, None);
    if !plan.backends.iter().any(|backend| backend.can()) {
        return Err(RunError::NoBackend(Box::new(plan)));
    }
    if plan.is_refused() && !force {
        return Err(RunError::Refused(Box::new(plan)));
    }
    Ok(plan)
}

fn stage_key(scene: &Scene, plan: &Plan) -> Result<StageKey, RunError> {
    if let Some(missing) = scene.start_checkpoint.as_ref().filter(|path| !path.is_file()) {
        let shown = missing.display();
        return Err(RunError::Folder(format!(
            "there is no checkpoint {shown} to start from; run what writes it first"
        )));
    }
    let models: Vec<&str> = plan.models.iter().filter(|model| model.on).map(|model| model.name).collect();
    let start = scene.start_checkpoint.as_deref().map(native::digest_of_start).transpose()?;
    let choices = Choices {
        backend: native::NAME,
        numerics_version: native::NUMERICS_VERSION,
        timestep: plan.timestep.chosen,
        skin: plan.skin.skin,
        models: &models,
        start: start.as_deref(),
    };
    Ok(StageKey::new(scene, &choices))
}

fn measured(scene: &Scene, result: &native::StageResult, folder: &Path) -> Result<Vec<MeasureResult>, StorageError> {
    let mass_series = summary::mass_series(scene, folder)?;
    let observed = Observed {
        body: scene.body,
        particles: &result.particles,
        contacts: &result.contacts,
        wall_contacts: &result.wall_contacts,
        mass_series: &mass_series,
    };
    Ok(evaluate(&scene.measures, &observed))
}
