//! Streams that enter a LIGGGHTS case: ghosts enter in batches, move by themselves or along recorded paths, and become ordinary
//! particles at the sample in which their release is due.
//!
//! Recorded paths and releases are atomfile variables with one section a sample. What was found on the binary (3.8.0):
//! `group released variable release` takes an atomfile variable, `next` and `set` work in `run .. pre no every M ".."`, sections may
//! hold 0 lines, `set group ghost_recorded ..` takes an empty group ("0 settings made") but no empty box ("Set command with no atoms
//! existing"), and all of them work before the first `run`. A run with an empty box needs a wall of type 1 ("Atom types must start
//! from 1").
//! A variable reads its first section where it is defined, and every tag in a section must be present by then: so
//! [`define`] belongs after the first batch, and sample 0 is [`STEER_SET`] and [`RELEASE`] without the [`STEER_NEXT`] and
//! [`RELEASE_NEXT`] that all later samples begin with.

mod arrivals;
mod batches;
mod paths;

use super::feeds::BatchFeeds;
use super::tags::Tags;
use super::{NAME, Schedule, files, groups};
use crate::backend::BackendError;
use crate::backend::incoming::{self, Solver};
use crate::backend::stage::{ReplayOrder, ReplayResult};
use crate::dem::feed::FeedReport;
use crate::gate::replay::{Due, Replayer};
use crate::math::{Bounds, Vec3};
use crate::particle::{ParticleId, ParticleState};
use crate::scene::gate::PathMode;
use crate::scene::{Domain, Scene};
use crate::storage::StorageError;
use batches::Batch;
use paths::{Paths, Steered};
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

/// Atomfile variables of recorded ghosts, which are also the names of their files: places, velocities, spins.
pub const STEERED: [&str; 9] = ["px", "py", "pz", "qx", "qy", "qz", "wx", "wy", "wz"];
/// Atomfile variable, and name of its file, that is 1 for the ghosts that are released at a sample.
pub const RELEASES: &str = "release";
/// Goes on to the next sample of the paths: only in a case with recorded ghosts, and not at sample 0.
pub const STEER_NEXT: &str = "next px py pz qx qy qz wx wy wz";
/// Puts recorded ghosts where they belong: only in a case with recorded ghosts. Without any particle in the box `set` would be an
/// error; the single quotes let it stand within the double ones of `run .. every`.
pub const STEER_SET: &str = "if '${present} > 0' then 'set group ghost_recorded x v_px y v_py z v_pz vx v_qx vy v_qy vz v_qz omegax v_wx \
     omegay v_wy omegaz v_wz'";
/// Goes on to the next sample of the releases: not at sample 0.
pub const RELEASE_NEXT: &str = "next release";
/// Finds the ghosts that are released at this sample and makes them ordinary particles; for every group of ghosts of the case
/// [`leave`] follows, and then the dump of the group `released`. The group must have been defined, `group released subtract all all`.
pub const RELEASE: [&str; 3] =
    ["group released subtract released all", "group released variable release", "group active union active released"];
/// Dump of what has arrived, after all groups are as they should be.
pub const ARRIVALS_DUMP: &str = "write_dump released custom arrivals.dump id type radius density x y z vx vy vz omegax omegay omegaz \
     modify append yes sort id format '%d %d %.17g %.17g %.17g %.17g %.17g %.17g %.17g %.17g %.17g %.17g %.17g'";

/// The command that takes released particles out of a group of ghosts.
#[must_use]
pub fn leave(ghosts: &str) -> String {
    format!("group {ghosts} subtract {ghosts} released")
}

/// The commands that define the variables, after the first batch has entered.
#[must_use]
pub fn define(recorded: bool) -> Vec<String> {
    let steered = STEERED.iter().copied().filter(|_| recorded);
    let files = steered.chain([RELEASES]).map(|name| format!("variable {name} atomfile {}/{name}", files::PATHS));
    files.chain(recorded.then(|| "variable present equal count(all)".to_owned())).collect()
}

/// Kinds of ghosts that a case has.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Ghosts {
    /// At constant velocity.
    pub constant: bool,
    /// In free fall.
    pub ballistic: bool,
    /// On recorded paths.
    pub recorded: bool,
}

impl Ghosts {
    /// True where there are any.
    #[must_use]
    pub const fn any(self) -> bool {
        self.constant || self.ballistic || self.recorded
    }
}

/// A particle of a case.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Entered {
    /// Radius [m].
    pub radius: f64,
    /// Density [kg/m3].
    pub density: f64,
    /// Index into the scene's materials; its type in LIGGGHTS is one more.
    pub material: u16,
    /// Index into the replays of the stream that it belongs to; `None` for one of a feed.
    pub stream: Option<u16>,
    /// Time step of the batch with which it enters.
    pub step: u64,
    /// Time step of the sample at which it is released; `u64::MAX` for one that is never a ghost, or still one at the end.
    pub release: u64,
}

/// What enters a case, all of it written.
#[derive(Debug)]
pub struct Prepared {
    /// LIGGGHTS' numbers of all particles.
    pub tags: Tags,
    /// Kinds of ghosts.
    pub ghosts: Ghosts,
    /// Number of particles that enter, if the case runs to its last time step.
    pub entered: u64,
    /// Time step of the last batch with which anything enters.
    pub last_entry: u64,
    /// What the feeds bring, if the case runs to its last time step.
    pub feeds: Vec<FeedReport>,
    /// All particles, in the order of their tags.
    pub particles: Vec<Entered>,
    /// Box around everything that enters, as it enters [m]: LIGGGHTS refuses what enters outside of its own.
    pub extent: Bounds,
    scene: Scene,
    orders: Vec<ReplayOrder>,
    schedule: Schedule,
}

/// Tells what enters a case, and writes its batches, paths and table of tags.
///
/// # Errors
/// When LIGGGHTS cannot do what the streams or feeds ask for, or a file cannot be read or written.
pub fn prepare(
    scene: &Scene,
    replays: &[ReplayOrder],
    schedule: &Schedule,
    case: &Path,
) -> Result<Prepared, BackendError> {
    refuse(scene, replays)?;
    let ghosts = Ghosts {
        constant: replays.iter().any(|order| order.replay.path == PathMode::Constant),
        ballistic: replays.iter().any(|order| order.replay.path == PathMode::Ballistic),
        recorded: replays.iter().any(|order| order.replay.path == PathMode::Recorded),
    };
    let streams = replays.iter().map(|order| Ok(incoming::open(scene, order, solver(schedule))?.1));
    let mut preparation = Preparation {
        schedule: *schedule,
        batches: case.join(files::BATCHES),
        paths: ghosts.any().then(|| Paths::create(&case.join(files::PATHS), ghosts.recorded)).transpose()?,
        feeds: BatchFeeds::new(scene, *schedule),
        modes: replays.iter().map(|order| order.replay.path).collect(),
        streams: streams.collect::<Result<_, StorageError>>()?,
        on_their_way: BTreeMap::new(),
        domain: scene.domain,
        tags: Tags::default(),
        particles: Vec::new(),
        extent: Bounds::EMPTY,
        last_entry: 0,
        entering: Vec::new(),
    };
    for step in (0..=schedule.steps).step_by(schedule.cadence.look as usize) {
        preparation.sample(step)?;
    }
    preparation.paths.take().map_or(Ok(()), Paths::close)?;
    let Preparation { batches: folder, feeds, tags, particles, extent, last_entry, entering, .. } = preparation;
    batches::write_steps(&folder, &entering)?;
    tags.write(&case.join(files::TAGS))?;
    Ok(Prepared {
        ghosts,
        entered: particles.len() as u64,
        last_entry,
        feeds: feeds.reports(),
        tags,
        particles,
        extent,
        scene: scene.clone(),
        orders: replays.to_vec(),
        schedule: *schedule,
    })
}

const fn solver(schedule: &Schedule) -> Solver {
    Solver { backend: NAME, timestep: schedule.timestep, cadence: schedule.cadence }
}

/// Refuses what LIGGGHTS cannot do.
fn refuse(scene: &Scene, replays: &[ReplayOrder]) -> Result<(), BackendError> {
    if let Some(order) = replays.iter().find(|order| order.replay.path == PathMode::Compliant) {
        return Err(BackendError::Incapable(format!(
            "stream '{}': LIGGGHTS has no ghosts that yield (path \"compliant\"); use path \"recorded\", or compute this stage with \
             the native solver",
            order.name
        )));
    }
    if scene.start_checkpoint.is_some() {
        return Err(BackendError::Incapable(
            "LIGGGHTS cannot start from a checkpoint of the native solver; start from an initial-state file (a feed of kind \
             \"file\"), or compute this stage with the native solver"
                .to_owned(),
        ));
    }
    Ok(())
}

/// A case in preparation.
struct Preparation<'a> {
    schedule: Schedule,
    batches: PathBuf,
    paths: Option<Paths>,
    feeds: BatchFeeds<'a>,
    streams: Vec<Replayer>,
    modes: Vec<PathMode>,
    /// Ghosts that are there, by tag: identity and stream.
    on_their_way: BTreeMap<u32, (ParticleId, usize)>,
    domain: Domain,
    tags: Tags,
    particles: Vec<Entered>,
    extent: Bounds,
    last_entry: u64,
    /// Time steps of the batches behind the first one at which anything enters.
    entering: Vec<u64>,
}

impl Preparation<'_> {
    /// One look. Whatever enters at time step 0 is there at its sample, what enters later is not.
    fn sample(&mut self, step: u64) -> Result<(), BackendError> {
        let due = self.streams.iter_mut().map(|stream| stream.due(step)).collect::<Result<Vec<Due>, _>>()?;
        if step == 0 {
            self.batch(step, &due)?;
        }
        self.steer(step, &due)?;
        if step > 0 && step < self.schedule.steps && step.is_multiple_of(self.schedule.cadence.hand_over) {
            self.batch(step, &due)?;
        }
        Ok(())
    }

    fn batch(&mut self, step: u64, due: &[Due]) -> Result<(), BackendError> {
        let mut batch = Batch::default();
        let occupied = due.iter().any(|due| !due.insert.is_empty()) || !self.particles.is_empty();
        for state in self.feeds.batch(step, occupied)? {
            let tag = self.enter(step, &state, None);
            batch.add(tag, state, groups::ACTIVE);
        }
        for (index, due) in due.iter().enumerate() {
            for entry in &due.insert {
                let inside = self.domain.wrapped(&entry.state.position);
                let entering = ParticleState { position: inside, ..entry.state };
                let tag = self.enter(step, &entering, Some(index));
                self.on_their_way.insert(tag, (entry.state.id, index));
                let (group, state) = match self.modes[index] {
                    PathMode::Constant => (groups::CONSTANT, entering),
                    PathMode::Ballistic => (groups::BALLISTIC, entering),
                    PathMode::Recorded | PathMode::Compliant => {
                        let Steered { velocity, spin, .. } = self.steered(tag, entry.state.id, index, step);
                        (groups::RECORDED, ParticleState { velocity, spin, ..entering })
                    }
                };
                batch.add(tag, state, group);
            }
        }
        if step > 0 {
            if batch.is_empty() {
                return Ok(());
            }
            self.entering.push(step);
        }
        Ok(batch.write(&self.batches, step, &self.schedule)?)
    }

    fn enter(&mut self, step: u64, state: &ParticleState, stream: Option<usize>) -> u32 {
        let ParticleState { id, radius, density, material, position, .. } = *state;
        let stream = stream.map(|index| index as u16);
        self.particles.push(Entered { radius, density, material, stream, step, release: u64::MAX });
        let mut reach = Vec3::from_element(radius);
        // Nobody reaches over a periodic border: there is the other side.
        (0..3).filter(|axis| self.domain.periodic[*axis]).for_each(|axis| reach[axis] = 0.0);
        self.extent.include(&(position - reach));
        self.extent.include(&(position + reach));
        self.last_entry = step;
        self.tags.add(id)
    }

    /// Where a recorded ghost is at a sample, and the velocity that takes it on a straight line to where it is at the next one: its
    /// path is continuous. The spin is the mean of both, since contacts only see its average.
    fn steered(&self, tag: u32, id: ParticleId, stream: usize, step: u64) -> Steered {
        let look = self.schedule.cadence.look;
        let at = |step| self.streams[stream].motion_to_release(id, step);
        let (Some(now), Some(next)) = (at(step), at(step + look)) else {
            unreachable!("a ghost on its way has a motion up to its release")
        };
        let span = look as f64 * self.schedule.timestep;
        Steered {
            tag,
            position: self.domain.wrapped(&now.position),
            velocity: (next.position - now.position) / span,
            spin: (now.spin + next.spin) * 0.5,
        }
    }

    /// Writes the sample of all ghosts, and lets go those that are released.
    fn steer(&mut self, step: u64, due: &[Due]) -> Result<(), BackendError> {
        let Some(mut paths) = self.paths.take() else { return Ok(()) };
        let mut released: BTreeMap<u32, &ParticleState> = BTreeMap::new();
        for state in due.iter().flat_map(|due| &due.release).map(|release| &release.state) {
            let tag = self.tags.tag(state.id).expect("what is released has entered");
            self.particles[tag as usize - 1].release = step;
            released.insert(tag, state);
        }
        let follows = |stream: usize| self.modes[stream] == PathMode::Recorded;
        let ghosts = self.on_their_way.iter().filter(|(_, (_, stream))| follows(*stream));
        let steered: Vec<Steered> = ghosts
            .map(|(&tag, &(id, stream))| match released.get(&tag) {
                Some(ParticleState { position, velocity, spin, .. }) => {
                    Steered { tag, position: *position, velocity: *velocity, spin: *spin }
                }
                None => self.steered(tag, id, stream, step),
            })
            .collect();
        let released: Vec<u32> = released.into_keys().collect();
        paths.sample(&steered, &released)?;
        self.paths = Some(paths);
        for tag in released {
            self.on_their_way.remove(&tag);
        }
        Ok(())
    }
}

impl Prepared {
    /// What the feeds brought to a case that ended at a time step.
    ///
    /// # Errors
    /// Those of [`prepare`].
    pub fn feed_reports(&self, ended_at_step: u64) -> Result<Vec<FeedReport>, BackendError> {
        if ended_at_step >= self.schedule.steps {
            return Ok(self.feeds.clone());
        }
        let mut feeds = BatchFeeds::new(&self.scene, self.schedule);
        // No new refusal can come of particles that were no reason for one before.
        for step in (0..ended_at_step.max(1)).step_by(self.schedule.cadence.hand_over as usize) {
            feeds.batch(step, false)?;
        }
        Ok(feeds.reports())
    }

    /// Who has entered a case that ended at time step `end`: what would enter at its last one does not.
    #[must_use]
    pub fn entered_before(&self, end: u64) -> Vec<ParticleId> {
        let entered = self.tags.ids().iter().zip(&self.particles).filter(|(_, entered)| entered.step < end.max(1));
        entered.map(|(id, _)| *id).collect()
    }

    /// For each particle 1 where it is a ghost at time step `step`, else 0; `None` in a case without ghosts.
    #[must_use]
    pub fn ghosts_at(&self, step: u64, particles: &[ParticleState]) -> Option<Vec<u8>> {
        let release = |id| self.tags.tag(id).and_then(|tag| self.particles.get(tag as usize - 1));
        let is_ghost = |id| release(id).is_some_and(|entered| entered.stream.is_some() && entered.release > step);
        self.ghosts.any().then(|| particles.iter().map(|particle| u8::from(is_ghost(particle.id))).collect())
    }

    /// Compares what the case released with what its streams hold, and passes on what came of each replay.
    ///
    /// # Errors
    /// When the dump of arrivals or a stream cannot be read.
    pub fn finish(self, case: &Path, ended_at_step: u64) -> Result<Vec<ReplayResult>, BackendError> {
        arrivals::finish(self, case, ended_at_step)
    }
}
