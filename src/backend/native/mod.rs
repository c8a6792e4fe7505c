//! Our own solver as a backend: makes it from a scene and its plan, drives it, writes what the scene asks for.

mod background;
pub mod calibrate;
mod checkpoint_file;
mod end;
pub mod feeds;
mod frames;
pub mod gate;
pub mod processor;
mod series;
pub mod setup;
pub mod touching;

use super::BackendError;
use super::stage::{EndReason, Identity, StageRequest, StageResult};
use crate::dem::inspect::Partner;
pub use crate::dem::presence::PartEvent;
pub use crate::dem::removal::{Removal, RemovalCause};
use crate::dem::simulation::{Setup, Simulation};
use crate::dem::watchdog::Stop;
use crate::output::progress::{Progress, Status};
use crate::output::timing::{Phase, ProcessUse, Timing};
use crate::scene::Scene;
use crate::scene::backend::BackendName;
use crate::storage::StorageError;
use checkpoint_file::CheckpointFile;
use end::EndWatch;
use gate::HandOver;
use std::path::Path;
use std::sync::atomic::Ordering;
use std::time::Instant;

/// Name of the backend in summaries.
pub const NAME: &str = "native";
/// Counts changes that may change a bit of a result: part of every key.
pub const NUMERICS_VERSION: u32 = 5;

/// Computes a stage from its start or its checkpoint to its end.
///
/// # Errors
/// See [`BackendError`]. Whatever was written before the error stays readable.
pub fn run(scene: &Scene, setup: Setup, request: &StageRequest) -> Result<StageResult, BackendError> {
    let (started, before) = (Instant::now(), ProcessUse::now());
    let checkpoint = CheckpointFile::new(request.folder, request.key);
    let mut end = EndWatch::default();
    let resumed = if request.resume { checkpoint.load(setup.clone(), &mut end)? } else { None };
    let from_checkpoint = resumed.is_some();
    let (mut simulation, held) = match resumed {
        Some((simulation, reader)) => (simulation, Some(reader)),
        None => (start(scene, setup)?, None),
    };
    let mut hand_over = HandOver::open(scene, request, &simulation, held.as_ref())?;
    if !from_checkpoint {
        simulation.prepare();
        hand_over.look(&mut simulation)?;
    }
    let mut driver = Driver {
        frames: frames::FrameOutput::open(scene, request.folder, &simulation, from_checkpoint)?,
        series: series::SeriesOutput::open(scene, request.folder, &simulation, from_checkpoint)?,
        checkpoint,
        checkpoint_every: scene.output.checkpoint_interval.map(|interval| steps_in(interval, &simulation)),
        timing: Timing::default(),
        particle_steps: 0.0,
        end,
        hand_over,
    };
    if !from_checkpoint {
        driver.write_due(&simulation, scene)?;
    }
    let first_step = simulation.steps_done();
    let mut progress = Progress::on_stderr(request.verbosity, simulation.time(), scene.end.time);
    let outcome = driver.drive(&mut simulation, scene, request, &mut progress);
    progress.finish(status(&simulation, first_step));
    match outcome {
        Ok(end) => {
            driver.write_last(&simulation, scene)?;
            driver.result(simulation, end, first_step, started, &before)
        }
        Err(error) => {
            // The state at which an unstable run was stopped is there to be looked at, not to be continued.
            if matches!(error, BackendError::Unstable { .. } | BackendError::Gate { .. }) {
                drop(driver.write_state(&simulation, scene));
            }
            Err(error)
        }
    }
}

fn start(scene: &Scene, setup: Setup) -> Result<Simulation, BackendError> {
    match &scene.start_checkpoint {
        None => Ok(Simulation::new(setup)),
        Some(path) => {
            let record = checkpoint_file::record_for_start(path, &setup)?;
            let refuse = |error| BackendError::Checkpoint(format!("cannot start from {}: {error}", path.display()));
            Simulation::start_from(setup, &record).map_err(refuse)
        }
    }
}

/// Digest of a checkpoint that is to be started from.
///
/// # Errors
/// When the file cannot be read.
pub fn digest_of_start(path: &Path) -> Result<String, StorageError> {
    let bytes = std::fs::read(path).map_err(|source| StorageError::system("read", path, source))?;
    Ok(blake3::hash(&bytes).to_hex().to_string())
}

/// Feed numbers in the identities of a run's particles that its own feeds give or that a start checkpoint's particles get behind
/// those.
///
/// # Errors
/// When the checkpoint cannot be read.
pub fn feed_numbers(scene: &Scene) -> Result<u32, StorageError> {
    let of_start = scene.start_checkpoint.as_deref().map(checkpoint_file::feed_numbers).transpose()?;
    Ok(scene.feeds.len() as u32 + of_start.unwrap_or(0))
}

/// When something is written: every so many time steps, from step 0.
#[derive(Debug, Clone, Copy)]
struct Schedule {
    every: u64,
}

impl Schedule {
    /// Every `interval` [s] of plant time; only at step 0 where there is none.
    fn new(interval: Option<f64>, simulation: &Simulation) -> Self {
        Self { every: interval.map_or(u64::MAX, |interval| steps_in(interval, simulation)) }
    }

    fn is_due(self, step: u64) -> bool {
        step.is_multiple_of(self.every)
    }

    /// The last step not after `step` at which it is due. What an interrupted run has written later than that, at its end,
    /// does not belong to a run that goes on.
    fn last_due(self, step: u64) -> u64 {
        step - step % self.every
    }
}

/// Whole time steps in an interval of plant time, at least one.
fn steps_in(interval: f64, simulation: &Simulation) -> u64 {
    (interval / simulation.setup().timestep).round().max(1.0) as u64
}

fn status(simulation: &Simulation, first_step: u64) -> Status {
    Status {
        time: simulation.time(),
        steps: simulation.steps_done() - first_step,
        particles: simulation.particle_count() as u64,
    }
}

/// Drives a simulation and everything that is written beside it.
struct Driver {
    frames: frames::FrameOutput,
    series: series::SeriesOutput,
    checkpoint: CheckpointFile,
    checkpoint_every: Option<u64>,
    timing: Timing,
    particle_steps: f64,
    end: EndWatch,
    hand_over: HandOver,
}

impl Driver {
    fn drive(
        &mut self,
        simulation: &mut Simulation,
        scene: &Scene,
        request: &StageRequest,
        progress: &mut Progress,
    ) -> Result<EndReason, BackendError> {
        let first_step = simulation.steps_done();
        loop {
            if let Some(reason) = self.end.reached(simulation, scene) {
                return Ok(reason);
            }
            if request.interrupted.load(Ordering::Relaxed) {
                return Ok(EndReason::Interrupted);
            }
            if let Err(stop) = simulation.step() {
                return Err(self.hand_over.squeezed(simulation, &stop).unwrap_or_else(|| stop.into()));
            }
            self.look_at_gates(simulation)?;
            self.particle_steps += simulation.particle_count() as f64;
            progress.update(status(simulation, first_step));
            self.write_due(simulation, scene)?;
        }
    }

    /// Lets the gates act; the time of what the solver counts itself is left to it.
    fn look_at_gates(&mut self, simulation: &mut Simulation) -> Result<(), BackendError> {
        if self.hand_over.is_idle() {
            return Ok(());
        }
        let (started, counted) = (Instant::now(), simulation.phase_times().total());
        let outcome = self.hand_over.look(simulation);
        let counted = simulation.phase_times().total() - counted;
        self.timing.add(Phase::Gates, started.elapsed().saturating_sub(counted));
        outcome
    }

    /// Writes what is due at the present step.
    fn write_due(&mut self, simulation: &Simulation, scene: &Scene) -> Result<(), BackendError> {
        let started = Instant::now();
        self.frames.write_due(simulation, scene)?;
        self.series.write_due(simulation, scene)?;
        let step = simulation.steps_done();
        if self.checkpoint_every.is_some_and(|every| step > 0 && step.is_multiple_of(every)) {
            // Who resumes from it counts on every frame up to it.
            self.frames.wait()?;
            self.checkpoint.save(simulation, &self.end, &self.hand_over)?;
        }
        self.timing.add(Phase::Output, started.elapsed());
        Ok(())
    }

    /// Writes the last state of a run that ended by itself or was interrupted.
    fn write_last(&mut self, simulation: &Simulation, scene: &Scene) -> Result<(), BackendError> {
        let started = Instant::now();
        self.write_state(simulation, scene)?;
        self.checkpoint.save(simulation, &self.end, &self.hand_over)?;
        self.timing.add(Phase::Output, started.elapsed());
        Ok(())
    }

    /// Frame and row of the present state; all frames are written afterwards.
    fn write_state(&mut self, simulation: &Simulation, scene: &Scene) -> Result<(), StorageError> {
        self.frames.write_last(simulation, scene)?;
        self.series.write_last(simulation, scene)?;
        self.frames.wait()
    }

    fn result(
        mut self,
        simulation: Simulation,
        end: EndReason,
        first_step: u64,
        started: Instant,
        before: &ProcessUse,
    ) -> Result<StageResult, BackendError> {
        let gates = self.hand_over.finish(&simulation, end != EndReason::Interrupted)?;
        let phases = simulation.phase_times();
        self.timing.add(Phase::Neighbour, phases.neighborhood);
        self.timing.add(Phase::Contacts, phases.contacts);
        self.timing.add(Phase::Integration, phases.integration);
        self.timing.add(Phase::Feeds, phases.feeds);
        self.timing.add(Phase::Other, phases.watchdog);
        let wall = started.elapsed();
        self.timing.close(wall);
        let (mut contacts, mut wall_contacts) = (Vec::new(), Vec::new());
        for (i, j) in simulation.touching() {
            match j {
                Partner::Particle(other) => contacts.push((i, other)),
                Partner::Part { .. } => wall_contacts.push(i),
            }
        }
        Ok(StageResult {
            identity: Identity {
                backend: BackendName::Native,
                version: env!("CARGO_PKG_VERSION").to_owned(),
                threads: simulation.setup().threads as u64,
                simd: Some(simulation.setup().simd),
            },
            warnings: Vec::new(),
            end,
            time: simulation.time(),
            steps: simulation.steps_done(),
            present: (0..simulation.setup().parts.len()).map(|part| simulation.is_present(part as u16)).collect(),
            particles: simulation.particles(),
            contacts,
            wall_contacts,
            feeds: simulation.feed_reports(),
            removed: simulation.removed().to_vec(),
            events: simulation.part_events().to_vec(),
            wall_s: wall.as_secs_f64(),
            own_steps: simulation.steps_done() - first_step,
            particle_steps: self.particle_steps,
            timing: self.timing,
            gates,
            used: ProcessUse::since(before),
        })
    }
}

impl From<Stop> for BackendError {
    fn from(stop: Stop) -> Self {
        let mut what = stop.to_string();
        if let Some(id) = stop.particle.filter(|id| !what.contains(&format!("particle {} of feed", id.serial()))) {
            what += &format!(" (the fastest is particle {} of feed {})", id.serial(), id.feed());
        }
        Self::Unstable { what, time: stop.time, steps: stop.step }
    }
}
