//! Computing one task, in a process of its own: claim it, compute it under its staging name, put the result in its place.

use super::CampaignError;
use super::claim::{Claim, Holder, Watch};
use super::workspace::{Failure, Order, Workspace};
use crate::exit_code;
use crate::math::lanes::SimdLevel;
use crate::output::progress::Verbosity;
use crate::run::{Prepared, RunError, RunReport, RunRequest, prepare};
use crate::storage::StorageError;
use std::fs::{self, File};
use std::path::PathBuf;
use std::sync::atomic::AtomicBool;

/// How computing a task ended.
#[derive(Debug)]
pub enum Ended {
    /// Its result is there, from now on or from before.
    Done,
    /// Another process is computing it.
    Elsewhere,
    /// It was interrupted; what there is of it will be gone on with.
    Interrupted,
    /// It failed, and that is noted.
    Failed(Failure),
}

impl Ended {
    /// The exit status of the process.
    #[must_use]
    pub const fn exit_code(&self) -> u8 {
        match self {
            Self::Done | Self::Elsewhere => exit_code::DONE,
            Self::Interrupted => exit_code::INTERRUPTED,
            Self::Failed(failure) => failure.exit_code,
        }
    }
}

/// Computes the task `name` of a workspace. `interrupted` ends it after its time step, with a checkpoint; it is also set where
/// the claim is lost to another process.
///
/// # Errors
/// When there is no such task, it is not what it was when it was ordered, or the disk refuses. A task that fails by itself is no
/// error: [`Ended::Failed`].
pub fn work(
    workspace: &Workspace,
    name: &str,
    threads: Option<usize>,
    simd: Option<SimdLevel>,
    interrupted: &'static AtomicBool,
) -> Result<Ended, CampaignError> {
    let order = workspace.order(name)?;
    let place = workspace.place(&order.group, name);
    if place.exists() {
        return Ok(Ended::Done);
    }
    let Some(claim) = Claim::take(&workspace.claims(), name, &mut Watch::default(), interrupted)? else {
        return Ok(Ended::Elsewhere);
    };
    // Whoever held the claim before may have finished in between.
    let ended =
        if place.exists() { Ok(Ended::Done) } else { compute(workspace, name, &order, threads, simd, interrupted) };
    drop(claim);
    ended
}

fn compute(
    workspace: &Workspace,
    name: &str,
    order: &Order,
    threads: Option<usize>,
    simd: Option<SimdLevel>,
    interrupted: &'static AtomicBool,
) -> Result<Ended, CampaignError> {
    let staging = workspace.staging(&order.group, name);
    let mut request = RunRequest {
        scene: order.scene.clone(),
        settings: order.settings.clone(),
        whole: order.is_whole,
        threads,
        simd,
        replicates: 1,
        verbosity: Verbosity::Verbose,
        ..RunRequest::default()
    };
    let computed = prepare(&request).and_then(|prepared| {
        let index = the_job(&prepared, order)?;
        // Killed before it had written what it is, a folder holds nothing to go on from.
        if staging.exists() && !staging.join("run.json").exists() {
            fs::remove_dir_all(&staging).map_err(|source| StorageError::system("remove", &staging, source))?;
        }
        request.resume = staging.exists();
        let places: Vec<PathBuf> = prepared.jobs.iter().map(|job| upstream_of(workspace, order, &job.name)).collect();
        prepared.run_job(&request, index, &staging, &places, interrupted)
    });
    match computed {
        Ok(RunReport { summary, .. }) if summary.outcome.exit_code == exit_code::DONE => {
            publish(workspace, name, order)?;
            Ok(Ended::Done)
        }
        Ok(RunReport { summary, .. }) if summary.outcome.exit_code == exit_code::INTERRUPTED => Ok(Ended::Interrupted),
        Ok(RunReport { summary, .. }) => failed(workspace, name, summary.outcome.exit_code, summary.outcome.reason),
        // A full disk, or a system that fails, is no fault of the variant: it is gone on with when there is room.
        Err(error) if error.exit_code() == exit_code::SYSTEM => Err(CampaignError::Run(error)),
        Err(error) => failed(workspace, name, error.exit_code(), error.to_string()),
    }
}

/// The job of the task; refused where the scene is not what it was when the task was ordered.
fn the_job(prepared: &Prepared, order: &Order) -> Result<usize, RunError> {
    let recipes = prepared.recipes()?;
    let found = prepared.jobs.iter().zip(&recipes).position(|(job, recipe)| {
        job.name == order.stage && recipe.key == order.key && recipe.outputs_key == order.outputs_key
    });
    found.ok_or_else(|| {
        RunError::Request(format!(
            "the scene {} has changed since this stage was ordered; start the campaign again",
            order.scene.display()
        ))
    })
}

fn upstream_of(workspace: &Workspace, order: &Order, stage: &str) -> PathBuf {
    order.upstream.get(stage).map_or_else(|| workspace.root.join("missing"), |place| workspace.root.join(place))
}

/// Puts the result in its place: from then on it is there, whole, also after a power failure.
fn publish(workspace: &Workspace, name: &str, order: &Order) -> Result<(), StorageError> {
    let (staging, place) = (workspace.staging(&order.group, name), workspace.place(&order.group, name));
    let sync = |path: &std::path::Path| {
        let synced = File::open(path).and_then(|file| file.sync_all());
        synced.map_err(|source| StorageError::system("synchronise", path, source))
    };
    sync(&staging.join("summary.json"))?;
    sync(&staging)?;
    fs::rename(&staging, &place).map_err(|source| StorageError::system("rename", &place, source))?;
    place.parent().map_or(Ok(()), sync)
}

fn failed(workspace: &Workspace, name: &str, exit_code: u8, reason: String) -> Result<Ended, CampaignError> {
    let failure = Failure { exit_code, reason, host: Holder::this_process().host };
    workspace.note_failure(name, &failure)?;
    Ok(Ended::Failed(failure))
}
