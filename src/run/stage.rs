//! One stage: its key, its folder, its backend, its measures, its summary.

use super::folder::{Claim, RunFolder};
use super::streams::{self, StreamInput};
use super::{RunError, RunRequest, picture, summary};
use crate::analysis::{MeasureResult, Observed, evaluate};
use crate::backend::BackendError;
use crate::backend::incoming::judged;
use crate::backend::native::processor::Processor;
use crate::backend::stage::{EndReason, Kick, StageRequest, StageResult};
use crate::backend::{liggghts, native};
use crate::exit_code;
use crate::output::progress::Progress;
use crate::output::summary::Summary;
use crate::output::timing::reset_peak_memory;
use crate::plan::Plan;
use crate::scene::Scene;
use crate::scene::backend::BackendName;
use crate::stage::key::{Choices, ReplayChoice, StageKey};
use crate::stage::split::{StageJob, take_events};
use crate::storage::StorageError;
use std::path::{Path, PathBuf};
use std::sync::atomic::AtomicBool;

/// What all stages of a run share.
#[derive(Debug)]
pub struct StageOrder<'a> {
    /// The command line.
    pub request: &'a RunRequest,
    /// The plan of the whole scene: one time step and one set of models for all stages.
    pub plan: &'a Plan,
    /// What the native solver takes of the processor.
    pub processor: Processor,
    /// A particle is moved at the start.
    pub kick: Option<Kick>,
    /// What the user is warned of before the run.
    pub warnings: Vec<String>,
    /// Set from outside to end the run.
    pub interrupted: &'a AtomicBool,
}

/// A stage whose result is there.
#[derive(Debug)]
pub struct StageOutcome {
    /// Its name.
    pub stage: String,
    /// Its folder.
    pub folder: PathBuf,
    /// Its summary.
    pub summary: Summary,
    /// True where an earlier run had done it.
    pub was_done: bool,
    /// Wall time by phase, as a table; empty where nothing was computed.
    pub timing: String,
    /// Why it was not taken from a run that was to be used again.
    pub not_reused: Vec<String>,
}

impl StageOutcome {
    /// A stage that an earlier run has done.
    fn done(name: &str, folder: &Path, summary: Summary) -> Self {
        Self {
            stage: name.to_owned(),
            folder: folder.to_path_buf(),
            summary,
            was_done: true,
            timing: String::new(),
            not_reused: Vec::new(),
        }
    }
}

/// Runs a stage into `place`, unless its result is there already or in a run that may be used again.
pub fn run(order: &StageOrder, job: &StageJob, place: &Path, inputs: &[StreamInput]) -> Result<StageOutcome, RunError> {
    let mut job = job.clone();
    // A part may stand upstream of one stream only: what happened to it is looked for in all of them. The parts of a stored stream
    // were upstream wherever it was recorded.
    let events: Vec<_> = inputs.iter().flat_map(StreamInput::events).collect();
    let stored = inputs.iter().filter(|input| input.descent.is_none());
    job.upstream_parts.extend(stored.flat_map(|input| input.manifest.origin.part_names.iter().cloned()));
    take_events(&mut job.scene, &job.upstream_parts, &events);
    let streams: Vec<&str> = inputs.iter().map(|input| input.digest.as_str()).collect();
    let kick = order.kick.filter(|_| inputs.is_empty());
    let key = stage_key(order.plan, &job, &streams, kick)?;
    let mut not_reused = Vec::new();
    for root in order.request.reuse.iter().filter(|_| !place.exists()) {
        let other = super::stage_folder(root, &job.name);
        if let Some(summary) = RunFolder::finished_elsewhere(&other, &key)?
            && summary.outcome.exit_code == exit_code::DONE
        {
            return Ok(StageOutcome::done(&job.name, &other, summary));
        }
        let differences = RunFolder::differences_elsewhere(&other, &key);
        if !differences.is_empty() {
            let (name, from) = (&job.name, root.display());
            not_reused
                .push(format!("stage '{name}' was not taken from {from}, which differs: {}", differences.join("; ")));
        }
    }
    let folder = RunFolder::claim(place, &key, Claim::new(order.request.resume))?;
    if let Some(summary) = folder.finished()? {
        if summary.outcome.exit_code == exit_code::UNSTABLE {
            return Err(RunError::StoppedBefore(summary.outcome.reason));
        }
        return Ok(StageOutcome { not_reused, ..StageOutcome::done(&job.name, place, summary) });
    }
    Ok(StageOutcome { not_reused, ..compute(order, &job, place, inputs, &key, &folder)? })
}

/// A stage that an earlier command has run into `place`.
pub fn found(name: &str, place: &Path) -> Result<Option<StageOutcome>, RunError> {
    let path = place.join("summary.json");
    if !path.exists() {
        return Ok(None);
    }
    Ok(Some(StageOutcome::done(name, place, Summary::read(&path)?)))
}

fn compute(
    order: &StageOrder,
    job: &StageJob,
    place: &Path,
    inputs: &[StreamInput],
    key: &StageKey,
    folder: &RunFolder,
) -> Result<StageOutcome, RunError> {
    let replays = streams::replays(job, inputs)?;
    let stage = StageRequest {
        folder: place,
        key: &key.key,
        stage: &job.name,
        resume: order.request.resume,
        verbosity: order.request.verbosity,
        interrupted: order.interrupted,
        records: &job.records,
        replays: &replays,
        kick: order.kick.filter(|_| inputs.is_empty()),
    };
    reset_peak_memory();
    let mut warned = order.warnings.clone();
    for input in inputs {
        let accepted = |misfit: &String| format!("stream '{}' was accepted although {misfit}", input.name);
        warned.extend(input.misfits.iter().map(accepted));
    }
    let doubts = doubts(&stage, inputs);
    let mut progress = Progress::on_stderr(order.request.verbosity, 0.0, job.scene.end.time);
    doubts.iter().for_each(|doubt| progress.say(&format!("warning: {}: {doubt}", job.name)));
    drop(progress);
    let result = match computed(order, job, &stage).map_err(|error| error.with_doubts(&doubts)) {
        Ok(result) => result,
        Err(error) => {
            // What went wrong first is what the user must hear of, also where the disk takes no summary any more.
            drop(summary::of_failure(order, job, &error, warned).write(&folder.summary_path()));
            return Err(error.into());
        }
    };
    // Of an external code that was interrupted no state has been read: it starts over.
    let has_state = job.backend == BackendName::Native || result.end != EndReason::Interrupted;
    let measures = if has_state { measured(&job.scene, &result, place)? } else { Vec::new() };
    if has_state {
        picture::draw(&job.scene, &result, &measures, place)?;
    }
    let summary = summary::of(order, job, &result, &measures, warned, place)?;
    summary.write(&folder.summary_path())?;
    Ok(StageOutcome { was_done: false, timing: result.timing.table(), ..StageOutcome::done(&job.name, place, summary) })
}

/// What the streams tell of their cuts before anything is computed: a user may rather not wait for the result.
fn doubts(stage: &StageRequest, inputs: &[StreamInput]) -> Vec<String> {
    let mut doubts = Vec::new();
    for (order, input) in stage.replays.iter().zip(inputs) {
        let quality = judged(&input.manifest, None, order.replay.path);
        let warnings = quality.into_iter().flat_map(|quality| quality.warnings);
        doubts.extend(warnings.map(|warning| format!("gate '{}': {warning}", order.name)));
    }
    doubts
}

/// Lets the job's backend compute it.
fn computed(order: &StageOrder, job: &StageJob, request: &StageRequest) -> Result<StageResult, BackendError> {
    match job.backend {
        BackendName::Native => {
            let mut setup = native::setup::setup(&job.scene, order.plan, order.processor);
            setup.momentum = !request.records.is_empty() || !request.replays.is_empty();
            native::run(&job.scene, setup, request)
        }
        BackendName::Liggghts => liggghts::run(&job.scene, order.plan, request),
    }
}

/// The key of a stage whose replayed streams are called `streams`.
pub fn stage_key(plan: &Plan, job: &StageJob, streams: &[&str], kick: Option<Kick>) -> Result<StageKey, RunError> {
    let scene = &job.scene;
    if let Some(missing) = scene.start_checkpoint.as_ref().filter(|path| !path.is_file()) {
        let shown = missing.display();
        return Err(RunError::Folder(format!(
            "there is no checkpoint {shown} to start from; run what writes it first"
        )));
    }
    let models: Vec<&str> = plan.models.iter().filter(|model| model.on).map(|model| model.name).collect();
    let start = scene.start_checkpoint.as_deref().map(native::digest_of_start).transpose()?;
    let external = match job.backend {
        BackendName::Native => None,
        BackendName::Liggghts => Some(liggghts::key_content(&scene.liggghts)?),
    };
    let replays: Vec<ReplayChoice> = job.replays.iter().map(ReplayChoice::from).collect();
    let choices = Choices {
        backend: job.backend.text(),
        numerics_version: match job.backend {
            BackendName::Native => native::NUMERICS_VERSION,
            BackendName::Liggghts => liggghts::NUMERICS_VERSION,
        },
        timestep: plan.timestep.chosen,
        skin: plan.skin.skin,
        models: &models,
        start: start.as_deref(),
        records: &job.records,
        replays: &replays,
        streams,
        kick: kick.map(|kick| (kick.length, kick.draw)),
        materials: &job.materials,
        external: external.as_ref(),
    };
    Ok(StageKey::new(scene, &choices))
}

fn measured(scene: &Scene, result: &StageResult, folder: &Path) -> Result<Vec<MeasureResult>, StorageError> {
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
