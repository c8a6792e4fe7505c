//! What a case has left behind, as a stage's result.

use super::launch::Finished;
use super::record::Recordings;
use super::record::samples::Sample;
use super::replay::Prepared;
use super::{Schedule, files, series};
use crate::backend::frames::{Frame, FrameFiles};
use crate::backend::native::touching::{Touching, touching};
use crate::backend::stage::{EndReason, GateResults, Identity, StageRequest, StageResult};
use crate::backend::{BackendError, PartEvent, Removal, RemovalCause};
use crate::gate::id_map::IdMap;
use crate::gate::stream::format::StoredEvent;
use crate::geometry::part::Trigger;
use crate::math::Vec3;
use crate::output::final_state;
use crate::output::lammps::DumpReader;
use crate::output::timing::{Phase, ProcessUse, Timing};
use crate::particle::{ParticleId, ParticleState};
use crate::plan::Plan;
use crate::scene::backend::BackendName;
use crate::scene::{MeasureKind, Scene};
use crate::storage::StorageError;
use std::collections::BTreeSet;
use std::fs;
use std::path::Path;
use std::time::{Duration, Instant};

/// Everything that a result is made of.
#[derive(Debug)]
pub struct Collected<'a> {
    /// The stage.
    pub scene: &'a Scene,
    /// Its plan.
    pub plan: &'a Plan,
    /// How it was asked for.
    pub request: &'a StageRequest<'a>,
    /// When things happened.
    pub schedule: Schedule,
    /// The case.
    pub case: &'a Path,
    /// Version of LIGGGHTS.
    pub version: String,
    /// What entered.
    pub prepared: Prepared,
    /// What was recorded.
    pub recordings: Recordings,
    /// What was printed and used.
    pub finished: Finished,
    /// False where it was interrupted.
    pub ended: bool,
    /// What should be known about the case.
    pub warnings: Vec<String>,
    /// When the stage was begun.
    pub started: Instant,
}

/// The result of a stage.
///
/// # Errors
/// When particles are missing that nothing has taken out, and what files say.
pub fn collect(run: Collected) -> Result<StageResult, BackendError> {
    let Collected { scene, request, schedule, case, ended, .. } = run;
    let mut recordings = run.recordings;
    let (steps, reading) = (run.finished.steps, Instant::now());
    let events = part_events(scene, &schedule, &run.finished)?;
    let mut result = StageResult {
        identity: Identity {
            backend: BackendName::Liggghts,
            version: run.version,
            threads: u64::from(scene.liggghts.ranks),
            simd: None,
        },
        warnings: run.warnings,
        end: run.finished.end.unwrap_or(EndReason::Interrupted),
        time: schedule.time(steps),
        steps,
        present: presence(scene, &events, steps, &schedule),
        particles: Vec::new(),
        contacts: Vec::new(),
        wall_contacts: Vec::new(),
        feeds: run.prepared.feed_reports(steps)?,
        removed: Vec::new(),
        events,
        gates: GateResults::default(),
        wall_s: 0.0,
        own_steps: steps,
        particle_steps: 0.0,
        timing: Timing::default(),
        used: ProcessUse { cpu_s: run.finished.cpu_s, peak_memory_bytes: run.finished.peak_memory_bytes },
    };
    let told = run.finished.warnings.iter().filter(|warning| !is_known(warning));
    result.warnings.extend(told.map(|warning| format!("LIGGGHTS: {warning}")));
    if !ended {
        result.end = EndReason::Interrupted;
        result.wall_s = run.started.elapsed().as_secs_f64();
        return Ok(result);
    }
    recordings.read_up_to(steps)?;
    let mut states = States { scene, schedule, case, prepared: &run.prepared };
    result.particles = states.at(steps)?;
    result.removed = removals(&states)?;
    states.check(&result, &run.finished)?;
    let rows = series::convert(scene, &states.schedule, case, request.folder, &result.removed, &run.prepared)?;
    result.particle_steps = series::particle_steps(&rows);
    states.write_frames(request.folder, &result)?;
    final_state::write(request.folder, &result.particles)?;
    if scene.measures.iter().any(|measure| matches!(measure.kind, MeasureKind::CoordinationNumber { .. })) {
        let Touching { pairs, walls } = touching(scene, run.plan, &result.particles, &result.present, result.time);
        (result.contacts, result.wall_contacts) = (pairs, walls);
    }
    let stored = stored_events(scene, &result.events);
    let present: IdMap<()> = result.particles.iter().map(|particle| (particle.id, ())).collect();
    recordings.settle(&present);
    result.gates.recorded = recordings.finish(stored, true)?;
    result.warnings.extend(taken_without_record(&result));
    result.gates.replayed = run.prepared.finish(case, steps)?;
    let wall = run.started.elapsed();
    result.wall_s = wall.as_secs_f64();
    result.timing.add(Phase::External, Duration::from_secs_f64(run.finished.wall_s));
    result.timing.add(Phase::Output, reading.elapsed());
    result.timing.close(wall);
    Ok(result)
}

/// Warnings of what our decks do on purpose, and empty ones.
fn is_known(warning: &str) -> bool {
    // Contacts are recorded of meshes only, and planes are meshes where they are.
    warning.trim().is_empty() || warning.starts_with("Compute wall/gran/local detected primitive wall")
}

/// Whether more was taken out at exclusion planes than recorded: the deck looks where a particle is at a sample, the recorder where it
/// passed, which differs at the rim of an opening.
fn taken_without_record(result: &StageResult) -> Option<String> {
    let taken = result.removed.iter().filter(|removal| removal.cause == RemovalCause::Gate).count() as u64;
    let recorded: u64 = result.gates.recorded.iter().map(|gate| gate.tally.excluded).sum();
    (taken != recorded).then(|| {
        format!(
            "LIGGGHTS took out {taken} particles behind gates, {recorded} of them recorded: the others are in no stage beyond; give the \
             gate an aperture whose rim nothing passes"
        )
    })
}

/// Parts that came and went, as printed.
fn part_events(scene: &Scene, schedule: &Schedule, finished: &Finished) -> Result<Vec<PartEvent>, BackendError> {
    let event = |event: &super::launch::Event| {
        let part = scene.parts.iter().position(|part| part.name == event.part);
        let part = part.and_then(|part| u16::try_from(part).ok());
        let unknown =
            || BackendError::Incapable(format!("the deck speaks of a part '{}' that is not there", event.part));
        Ok(PartEvent { part: part.ok_or_else(unknown)?, present: event.present, time: schedule.time(event.step) })
    };
    finished.events.iter().map(event).collect()
}

/// Whether each part is there at time step `step`.
fn presence(scene: &Scene, events: &[PartEvent], step: u64, schedule: &Schedule) -> Vec<bool> {
    let mut present: Vec<bool> = scene.parts.iter().map(|part| matches!(part.appears, Trigger::Always)).collect();
    // Half a time step: what happens at a step belongs to it.
    let until = schedule.time(step) + 0.5 * schedule.timestep;
    for event in events.iter().filter(|event| event.time < until) {
        present[usize::from(event.part)] = event.present;
    }
    present
}

fn stored_events(scene: &Scene, events: &[PartEvent]) -> Vec<StoredEvent> {
    let stored = |event: &PartEvent| StoredEvent {
        part: scene.parts[usize::from(event.part)].name.clone(),
        present: event.present,
        time: event.time,
    };
    events.iter().map(stored).collect()
}

/// Dumps of a case as particles.
struct States<'a> {
    scene: &'a Scene,
    schedule: Schedule,
    case: &'a Path,
    prepared: &'a Prepared,
}

impl States<'_> {
    /// A particle as we know it: what does not change is ours to the last bit.
    fn own(&self, tag: u32, position: Vec3, velocity: Vec3, spin: Vec3) -> Option<ParticleState> {
        let entered = self.prepared.particles.get((tag as usize).checked_sub(1)?)?;
        let id = self.prepared.tags.id(tag)?;
        let (material, radius, density) = (entered.material, entered.radius, entered.density);
        Some(ParticleState { id, material, radius, density, position, velocity, spin })
    }

    /// All particles at time step `step`, by ascending identity, and the forces on them without gravity.
    fn with_forces(&self, step: u64) -> Result<(Vec<ParticleState>, Vec<Vec3>), BackendError> {
        let path = self.case.join(files::FRAMES).join(format!("{step}.bin"));
        let mut sample = Sample::default();
        sample.read(&path, step)?;
        let mut found = Vec::new();
        for row in sample.rows() {
            let state = self.own(row.tag, row.position, row.velocity, row.spin);
            let state = state.ok_or_else(|| {
                StorageError::unusable(&path, format!("it has a particle with id {} that never entered", row.tag))
            })?;
            let weight = self.scene.gravity * self.scene.body.mass(state.radius, state.density);
            found.push((state, row.force - weight));
        }
        found.sort_unstable_by_key(|(state, _)| state.id);
        Ok(found.into_iter().unzip())
    }

    fn at(&self, step: u64) -> Result<Vec<ParticleState>, BackendError> {
        Ok(self.with_forces(step)?.0)
    }

    /// Everybody who entered must be there or have left in a way that is known: a code's own exit status is no evidence.
    fn check(&self, result: &StageResult, finished: &Finished) -> Result<(), BackendError> {
        let gone: BTreeSet<ParticleId> = result.removed.iter().map(|removal| removal.id).collect();
        let here: BTreeSet<ParticleId> = result.particles.iter().map(|particle| particle.id).collect();
        let entered = self.prepared.entered_before(finished.steps);
        let missing: Vec<ParticleId> =
            entered.iter().copied().filter(|id| !gone.contains(id) && !here.contains(id)).collect();
        let broken = result.particles.iter().find(|particle| {
            let numbers = particle.position.iter().chain(particle.velocity.iter()).chain(particle.spin.iter());
            !numbers.copied().all(f64::is_finite)
        });
        let what = match (missing.first(), broken) {
            (Some(first), _) => format!(
                "{} of {} particles are missing at the end although nothing took them out, the first is particle {} of feed {}: \
                 LIGGGHTS has lost them, as particles that left its box between two batches; enlarge the scene's domain, or look \
                 for a part that lets particles through",
                missing.len(),
                entered.len(),
                first.serial(),
                first.feed()
            ),
            (None, Some(broken)) => format!(
                "particle {} of feed {} has a place or speed that is not a number: the run became unstable; choose a smaller time step",
                broken.id.serial(),
                broken.id.feed()
            ),
            (None, None) => return Ok(()),
        };
        let settings = &self.scene.liggghts;
        let rerun = super::launch::command_line(self.case, settings.ranks, &settings.mpirun);
        let case = self.case.to_path_buf();
        Err(BackendError::Failed { what, case, rerun, time: result.time, steps: result.steps })
    }

    /// Turns the case's frames into those of a result folder, and removes them there.
    fn write_frames(&mut self, folder: &Path, result: &StageResult) -> Result<(), BackendError> {
        let frames = self.case.join(files::FRAMES);
        let failed = |source| StorageError::system("read", &frames, source);
        let mut steps: Vec<u64> = Vec::new();
        for entry in fs::read_dir(&frames).map_err(failed)? {
            let name = entry.map_err(failed)?.file_name();
            steps.extend(name.to_str().and_then(|name| name.strip_suffix(".bin")?.parse::<u64>().ok()));
        }
        steps.sort_unstable();
        let mut files = FrameFiles::open(self.scene, folder, self.schedule.timestep, None)?;
        for step in steps {
            if self.scene.output.vtp || self.scene.output.lammps {
                let (particles, forces) = self.with_forces(step)?;
                let frame = Frame {
                    step,
                    time: self.schedule.time(step),
                    particles: &particles,
                    forces: &forces,
                    ghosts: self.prepared.ghosts_at(step, &particles),
                    present: &presence(self.scene, &result.events, step, &self.schedule),
                    loads: &[],
                    contacts: None,
                };
                files.write(&frame)?;
            }
            let path = frames.join(format!("{step}.bin"));
            if step != result.steps {
                fs::remove_file(&path).map_err(|source| StorageError::system("remove", &path, source))?;
            }
        }
        Ok(())
    }
}

/// Who was taken out, where, when and why.
fn removals(states: &States) -> Result<Vec<Removal>, BackendError> {
    let folder = states.case.join(files::REMOVED);
    let mut removed = Vec::new();
    if !folder.exists() {
        return Ok(removed);
    }
    let failed = |source| StorageError::system("read", &folder, source);
    for entry in fs::read_dir(&folder).map_err(failed)? {
        let path = entry.map_err(failed)?.path();
        let name = path.file_stem().map(|name| name.to_string_lossy().into_owned()).unwrap_or_default();
        let mut dump = DumpReader::open(&path)?;
        while let Some(frame) = dump.next_frame()? {
            for row in dump.particles(&states.scene.body)? {
                let tag = u32::try_from(row.id.0).unwrap_or(u32::MAX);
                let own = states.own(tag, row.position, row.velocity, row.spin).ok_or_else(|| {
                    StorageError::unusable(&path, format!("it has a particle with id {tag} that never entered"))
                })?;
                removed.push(Removal {
                    id: own.id,
                    mass: states.scene.body.mass(own.radius, own.density),
                    time: states.schedule.time(frame.step),
                    position: own.position.into(),
                    cause: cause(states.scene, &name, &own.position),
                });
            }
        }
    }
    removed.sort_by(|a, b| a.time.total_cmp(&b.time).then(a.id.cmp(&b.id)));
    Ok(removed)
}

/// Why a particle at `place` was taken out, by the name of the file that says so.
fn cause(scene: &Scene, name: &str, place: &Vec3) -> RemovalCause {
    if name == "domain" {
        let bounds = &scene.domain.bounds;
        let (below, above) = (
            [0, 1, 2].map(|axis| bounds.minimum[axis] - place[axis]),
            [0, 1, 2].map(|axis| place[axis] - bounds.maximum[axis]),
        );
        let farthest = |ways: [f64; 3]| (0..3).max_by(|a, b| ways[*a].total_cmp(&ways[*b])).unwrap_or(0);
        let (low, high) = (farthest(below), farthest(above));
        return if below[low] > above[high] {
            RemovalCause::border(low, false)
        } else {
            RemovalCause::border(high, true)
        };
    }
    if name.ends_with(".returning") || name.ends_with(".sitting") { RemovalCause::Fate } else { RemovalCause::Gate }
}
