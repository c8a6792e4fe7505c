//! A scene that is read, planned and cut: what every way of running it starts from.

use super::stage::{self, StageOrder};
use super::{RunError, RunReport, RunRequest, streams, summary};
use crate::backend::liggghts;
use crate::backend::native::processor::Processor;
use crate::backend::stage::Kick;
use crate::gate::stream::reader::StreamReader;
use crate::plan::choose::{BackendVerdict, Capabilities, verdict};
use crate::plan::{Plan, plan};
use crate::scene::backend::BackendName;
use crate::scene::gate::StreamSource;
use crate::scene::{self, Scene};
use crate::stage::key::StageKey;
use crate::stage::split::{StageJob, stage_jobs, whole_jobs};
use std::path::{Path, PathBuf};
use std::sync::atomic::AtomicBool;

/// A scene with its plan and its jobs.
#[derive(Debug, Clone)]
pub struct Prepared {
    /// The scene.
    pub scene: Scene,
    /// What follows from it: one time step and one set of models for all jobs.
    pub plan: Plan,
    /// Its stages, or its whole runs, upstream first.
    pub jobs: Vec<StageJob>,
    /// What the user is warned of before the run.
    pub(super) warnings: Vec<String>,
}

/// Reads, plans and cuts the scene of a request.
///
/// # Errors
/// When the scene is wrong, the plan refuses it, or a backend cannot do what it is to compute.
pub fn prepare(request: &RunRequest) -> Result<Prepared, RunError> {
    let (scene, warnings) = scene::read(&request.scene, &request.settings).map_err(RunError::Scene)?;
    let jobs = match (scene.is_cut(), request.whole) {
        (false, _) => vec![StageJob::uncut(&scene)],
        (true, true) => whole_jobs(&scene),
        (true, false) => stage_jobs(&scene),
    };
    let plan = accepted_plan(&scene, &jobs, request.force)?;
    let warnings = summary::warnings(&warnings, &plan);
    Ok(Prepared { scene, plan, jobs, warnings })
}

impl Prepared {
    /// The key of each job by what it is made of: streams of the scene's own gates stand there as the recipe of the stage that
    /// records them, because their digests are known only once that stage has been run.
    ///
    /// # Errors
    /// When a stored stream or a checkpoint cannot be read.
    pub fn recipes(&self) -> Result<Vec<StageKey>, RunError> {
        let mut recipes: Vec<StageKey> = Vec::new();
        for job in &self.jobs {
            let mut names: Vec<String> = Vec::new();
            for replay in &job.replays {
                names.push(match &replay.source {
                    StreamSource::Gate(gate) => {
                        let name = &self.scene.gates[*gate].name;
                        let recorder = self.recorder(*gate)?;
                        format!("{}/{name}", recipes[recorder].key)
                    }
                    StreamSource::Folder(folder) => {
                        let stream = StreamReader::open(folder).map_err(|error| RunError::Stream(error.to_string()))?;
                        stream.manifest().digest()
                    }
                });
            }
            let names: Vec<&str> = names.iter().map(String::as_str).collect();
            recipes.push(stage::stage_key(&self.plan, job, &names, None)?);
        }
        Ok(recipes)
    }

    /// The jobs whose streams enter job number `index`, each once, ascending.
    ///
    /// # Errors
    /// When no job records a gate that is replayed.
    pub fn upstream(&self, index: usize) -> Result<Vec<usize>, RunError> {
        let gates = self.jobs[index].replays.iter().filter_map(|replay| match replay.source {
            StreamSource::Gate(gate) => Some(gate),
            StreamSource::Folder(_) => None,
        });
        let mut recorders = gates.map(|gate| self.recorder(gate)).collect::<Result<Vec<usize>, RunError>>()?;
        recorders.sort_unstable();
        recorders.dedup();
        Ok(recorders)
    }

    fn recorder(&self, gate: usize) -> Result<usize, RunError> {
        let name = &self.scene.gates[gate].name;
        let found = streams::recorder_of(&self.scene, &self.jobs, gate);
        found.ok_or_else(|| RunError::Stream(format!("no stage records gate '{name}'")))
    }

    /// Runs job number `index` alone into `place`; `places` are the folders of all jobs' results, of which those upstream of it
    /// must be there.
    ///
    /// # Errors
    /// As [`super::run`].
    pub fn run_job(
        &self,
        request: &RunRequest,
        index: usize,
        place: &Path,
        places: &[PathBuf],
        interrupted: &AtomicBool,
    ) -> Result<RunReport, RunError> {
        let order = self.order(request, None, interrupted);
        let inputs = streams::inputs(&self.scene, &self.jobs, index, places, request.accept_stream)?;
        let outcome = stage::run(&order, &self.jobs[index], place, &inputs)?;
        Ok(RunReport {
            folder: place.to_path_buf(),
            was_done: outcome.was_done,
            timing: outcome.timing,
            summary: outcome.summary,
        })
    }

    /// What all jobs of a run share.
    pub(super) fn order<'a>(
        &'a self,
        request: &'a RunRequest,
        kick: Option<Kick>,
        interrupted: &'a AtomicBool,
    ) -> StageOrder<'a> {
        StageOrder {
            request,
            plan: &self.plan,
            processor: Processor::new(request.threads, request.simd),
            kick,
            warnings: self.warnings.clone(),
            interrupted,
        }
    }
}

/// The plan of a scene, unless it refuses, or a backend cannot do what it is to compute.
fn accepted_plan(scene: &Scene, jobs: &[StageJob], force: bool) -> Result<Plan, RunError> {
    let mut plan = plan(scene, None);
    let verdicts = jobs.iter().map(|job| match job.backend {
        BackendName::Native => verdict(&job.scene, &Capabilities::native()),
        BackendName::Liggghts => liggghts::verdict(&job.scene, &job.records, &job.replays),
    });
    let failing: Vec<BackendVerdict> = verdicts.filter(|verdict| !verdict.can()).collect();
    if !failing.is_empty() {
        plan.backends = failing;
        return Err(RunError::NoBackend(Box::new(plan)));
    }
    if plan.is_refused() && !force {
        return Err(RunError::Refused(Box::new(plan)));
    }
    Ok(plan)
}
