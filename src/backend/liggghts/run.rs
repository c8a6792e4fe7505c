//! A stage on LIGGGHTS: rendered, run, read back.

use super::collect::{self, Collected};
use super::deck::{self, DeckOrder};
use super::launch::{self, Launch, Outcome};
use super::record::Recordings;
use super::replay::{self, Prepared};
use super::{Schedule, probe, refusals};
use crate::backend::BackendError;
use crate::backend::stage::{StageRequest, StageResult};
use crate::gate::Cadence;
use crate::plan::Plan;
use crate::scene::Scene;
use crate::storage::StorageError;
use std::fs;
use std::path::Path;
use std::time::Instant;

/// A case that is ready to be run.
#[derive(Debug)]
pub struct Rendered {
    /// The command that runs it by hand.
    pub command: String,
    /// What should be known about it.
    pub warnings: Vec<String>,
    /// When things happen in it.
    pub schedule: Schedule,
    /// What enters it.
    pub prepared: Prepared,
}

/// Writes the case of a stage into the folder `case`.
///
/// # Errors
/// [`BackendError::Incapable`] with everything that LIGGGHTS cannot do of the stage; else what a stream or the disk says.
pub fn render(scene: &Scene, plan: &Plan, request: &StageRequest, case: &Path) -> Result<Rendered, BackendError> {
    let settings = &scene.liggghts;
    let cadence = Cadence { look: settings.sample_every, hand_over: settings.batch_every };
    let timestep = plan.timestep.chosen;
    let steps = ((scene.end.time / timestep - 1e-6).ceil() as u64).next_multiple_of(cadence.hand_over);
    let schedule = Schedule { timestep, cadence, steps };
    let refusals = refusals(scene, request.records, request.replays.iter().map(|order| &order.replay));
    if !refusals.is_empty() {
        return Err(BackendError::Incapable(format!(
            "LIGGGHTS cannot compute stage '{}':\n  {}",
            request.stage,
            refusals.join("\n  ")
        )));
    }
    fs::create_dir_all(case).map_err(|source| StorageError::system("create", case, source))?;
    let prepared = replay::prepare(scene, request.replays, &schedule, case)?;
    let order = DeckOrder {
        scene,
        stage: request.stage,
        schedule,
        skin: settings.skin.unwrap_or(plan.skin.skin),
        records: request.records,
        ghosts: prepared.ghosts,
        particles_to_come: prepared.entered,
        last_entry: prepared.last_entry,
        bounds: deck::bounds(scene, &schedule).union(&prepared.extent),
        settings,
    };
    deck::write(&order, case)?;
    let command = launch::command_line(case, settings.ranks, &settings.mpirun);
    Ok(Rendered { command, warnings: warnings(scene, request, &prepared), schedule, prepared })
}

/// Computes a stage from its start to its end. A case of an earlier attempt is begun anew; one that fails is kept.
///
/// # Errors
/// See [`BackendError`].
pub fn run(scene: &Scene, plan: &Plan, request: &StageRequest) -> Result<StageResult, BackendError> {
    let started = Instant::now();
    if request.kick.is_some() {
        return Err(BackendError::Incapable(
            "--perturb moves a particle of the native solver; on LIGGGHTS use --replicates alone, which takes other seeds".to_owned(),
        ));
    }
    let probe = probe::probe()?;
    let case = request.folder.join("case");
    if case.exists() {
        fs::remove_dir_all(&case).map_err(|source| StorageError::system("remove", &case, source))?;
    }
    let Rendered { schedule, prepared, warnings, .. } = render(scene, plan, request, &case)?;
    let mut recordings = Recordings::open(scene, request, &schedule, &case, &prepared.tags, &probe.version)?;
    let settings = &scene.liggghts;
    let launch = Launch {
        case: &case,
        ranks: settings.ranks,
        mpirun: &settings.mpirun,
        time_limit: settings.time_limit,
        steps: schedule.steps,
        timestep: schedule.timestep,
        interrupted: request.interrupted,
        verbosity: request.verbosity,
    };
    let outcome = launch::run(&launch, &mut |step| {
        // The sample of the step that was printed last may be half written, or not yet.
        match step.checked_sub(schedule.cadence.look) {
            Some(whole) => recordings.read_up_to(whole),
            None => Ok(()),
        }
    })?;
    let (finished, ended) = match outcome {
        Outcome::Finished(finished) => (finished, true),
        Outcome::Interrupted(finished) => (finished, false),
    };
    let version = probe.version;
    let case = &case;
    collect::collect(Collected {
        scene,
        plan,
        request,
        schedule,
        case,
        version,
        prepared,
        recordings,
        finished,
        ended,
        warnings,
        started,
    })
}

/// What a user of LIGGGHTS should know of this case.
fn warnings(scene: &Scene, request: &StageRequest, prepared: &Prepared) -> Vec<String> {
    let mut warnings = Vec::new();
    if prepared.ghosts.any() {
        warnings.push(
            "LIGGGHTS cannot be given the histories of contacts: those of arriving particles build up while they travel as ghosts".to_owned(),
        );
    }
    for order in request.replays {
        warnings.push(format!(
            "stream '{}': while LIGGGHTS runs nobody looks for particles that go back upstream (`leaving`) or for a downstream that backs \
             up to the gate (`backing_up`)",
            order.name
        ));
    }
    if scene.output.energy {
        warnings.push("LIGGGHTS keeps no energy budget: series.csv has its kinetic energies only".to_owned());
    }
    if scene.output.contacts {
        warnings.push("frames of LIGGGHTS stages have no contact lines".to_owned());
    }
    warnings
}
