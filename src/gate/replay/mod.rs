//! The replayer: brings a stream's crossings into a stage as ghosts that become ordinary particles.
//!
//! Where stream and stage have the same time step and backend, and the stream is neither moved nor timed by creation, the replay
//! is exact: a particle is released at its crossing's own time step (shifted by whole ones) with the stored bits. Where it is
//! only moved, the same, up to the round-off of the move. In every other case it is released at the first time step at or
//! after its passage, with the passage moved on to it.
//!
//! A stage that looks at its gates every few time steps only ([`Cadence`]) releases at looks: what should be released between
//! two of them is released at the later one, moved on to it, and ghosts that no record leads head for that.
//!
//! Chunks of the stream are read when the first of their ghosts is due; what is due much later is read again then. So only
//! what is near in time is held.

mod schedule;
mod supply;
#[cfg(test)]
mod tests;

use super::Cadence;
use super::crossing::{Crossing, Motion, StoredContact};
use super::id_map::IdMap;
use crate::geometry::plane::GatePlane;
use crate::math::Vec3;
use crate::particle::{Body, ParticleId, ParticleState};
use crate::scene::gate::{PassingPoint, PathMode, Replay, Transform};
use crate::storage::StorageError;
use schedule::{Begins, Times, Timetable};
use serde::Serialize;
use std::collections::{BTreeMap, BTreeSet};
use supply::Supply;

/// Chunks of crossings in order of (time step, identity).
pub trait CrossingSource: std::fmt::Debug {
    /// Number of chunks.
    fn chunk_count(&self) -> usize;
    /// All crossings of chunk `index`.
    ///
    /// # Errors
    /// When it cannot be read.
    fn chunk(&mut self, index: usize) -> Result<Vec<Crossing>, StorageError>;
}

/// What a replayer needs to know of a stream.
#[derive(Debug, Clone, PartialEq)]
pub struct StreamFacts {
    /// Storage plane.
    pub plane: GatePlane,
    /// Point whose passage was recorded.
    pub passage: PassingPoint,
    /// Time step of the recorded run [s].
    pub timestep: f64,
    /// Time steps between two stored motions of a path; `None` without paths.
    pub every: Option<u64>,
    /// Plant time of the first passage [s].
    pub first_passage: f64,
    /// Plant time of the last passage [s].
    pub last_passage: f64,
    /// True where the solver that recorded the stream also computes the stage, so that its grid states are states of that solver.
    pub same_backend: bool,
    /// First and last time step of each chunk.
    pub chunks: Vec<(u64, u64)>,
    /// Number of feed numbers that the stream uses: the distance between the identities of two loops.
    pub namespace: u32,
}

/// The stage into which a stream is replayed.
#[derive(Debug, Clone, Copy)]
pub struct ReplayStage {
    /// Time step [s].
    pub timestep: f64,
    /// Gravity [m/s2].
    pub gravity: Vec3,
    /// Body of the particles.
    pub body: Body,
    /// Time steps at which ghosts can enter and be released.
    pub cadence: Cadence,
    /// Added to the feed numbers of the stream's particles; 0 keeps their identities.
    pub feed_offset: u32,
    /// Largest diameter of the stream's particles [m].
    pub largest_diameter: f64,
    /// Time step of the stage's first state; [`Replayer::due`] is called for it before the first time step.
    pub start_step: u64,
    /// Moves a crossing from the storage plane to the calculation plane.
    pub transform: fn(&Transform, Crossing) -> Crossing,
}

/// A ghost that enters.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct GhostEntry {
    /// The particle, at `motion`.
    pub state: ParticleState,
    /// Its motion now.
    pub motion: Motion,
    /// How it moves on.
    pub path: PathMode,
}

/// A ghost that becomes an ordinary particle.
#[derive(Debug, Clone, PartialEq)]
pub struct Release {
    /// The state it gets. A compliant ghost stays where it is: then this is what was recorded.
    pub state: ParticleState,
    /// Force by its contacts [N].
    pub force: Vec3,
    /// Torque by its contacts [N m].
    pub torque: Vec3,
    /// Its contacts, whose memories go on where the partner is present.
    pub contacts: Vec<StoredContact>,
    /// Whether the state is the stored one bit for bit.
    pub exact: bool,
}

/// What is to be done after a time step, in this order.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Due {
    /// Ghosts that enter, ascending in (look, identity).
    pub insert: Vec<GhostEntry>,
    /// Compliant ghosts that are no longer moved, but bound to their paths.
    pub tether: Vec<ParticleId>,
    /// Ghosts that are released, in ascending order of identity.
    pub release: Vec<Release>,
}

/// What a replayer has counted.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize)]
pub struct ReplayTally {
    /// Crossings of the stream times loops.
    pub expected: u64,
    /// Of these outside of the window.
    pub outside_window: u64,
    /// Of these with a passage before the stage begins.
    pub before_start: u64,
    /// Ghosts that entered.
    pub inserted: u64,
    /// Ghosts that were released.
    pub released: u64,
    /// Ghosts that began in the midst of their path, because it enters the zone before the stage begins.
    pub begun_at_start: u64,
    /// Ballistic ghosts that began at their highest point.
    pub apex_starts: u64,
    /// Ghosts without any path upstream: they moved along the plane or back (constant, ballistic), or none was stored.
    pub without_entry: u64,
    /// Ghosts whose recorded path is shorter than the generation zone.
    pub short_paths: u64,
}

/// Replays a stream.
#[derive(Debug)]
pub struct Replayer {
    table: Timetable,
    supply: Supply,
    /// Read, but not yet in: by look and identity.
    pending: BTreeMap<(u64, ParticleId), Ghost>,
    ghosts: IdMap<Ghost>,
    tethers: BTreeSet<(u64, ParticleId)>,
    releases: BTreeSet<(u64, ParticleId)>,
    /// The next time step at which anything is due.
    next: u64,
    tally: ReplayTally,
}

/// A crossing on its way.
#[derive(Debug, Clone)]
struct Ghost {
    crossing: Crossing,
    times: Times,
    shift: i64,
    release: u64,
    clipped: bool,
    /// Time step at which it is bound to its path instead of moved along it; none for other modes, and where that would be its
    /// release.
    tether: Option<u64>,
}

impl Replayer {
    /// A replayer of the stream `source`; reads all of it once.
    ///
    /// # Errors
    /// When the stream cannot be read, or is not made for this replay.
    pub fn new(
        source: Box<dyn CrossingSource>,
        facts: StreamFacts,
        replay: &Replay,
        stage: ReplayStage,
    ) -> Result<Self, StorageError> {
        supply::check(&facts, replay, &stage)?;
        let plane = supply::calculation_plane(&facts.plane, replay, &stage);
        let table = Timetable::new(facts, replay.clone(), stage, plane);
        let supply = Supply::new(source, &table)?;
        let mut replayer = Self {
            table,
            supply,
            pending: BTreeMap::new(),
            ghosts: IdMap::default(),
            tethers: BTreeSet::new(),
            releases: BTreeSet::new(),
            next: 0,
            tally: ReplayTally::default(),
        };
        replayer.reset();
        Ok(replayer)
    }

    fn reset(&mut self) {
        self.pending.clear();
        self.ghosts.clear();
        self.tethers.clear();
        self.releases.clear();
        self.tally = self.supply.rewind();
        self.next = 0;
    }

    /// What is due after time step `step`; to be called for the stage's first state and then after every time step.
    ///
    /// # Errors
    /// When the stream cannot be read.
    pub fn due(&mut self, step: u64) -> Result<Due, StorageError> {
        if step < self.next {
            return Ok(Due::default());
        }
        self.load(step)?;
        let insert = self.enter(step);
        let tether = self.tether(step);
        let release = self.release(step);
        self.set_next();
        Ok(Due { insert, tether, release })
    }

    fn set_next(&mut self) {
        let pending = self.pending.first_key_value().map(|((look, _), _)| *look);
        let tether = self.tethers.first().map(|(step, _)| *step);
        let release = self.releases.first().map(|(step, _)| *step);
        let candidates = [self.supply.next_look(), pending, tether, release];
        self.next = candidates.into_iter().flatten().min().unwrap_or(u64::MAX);
    }

    /// Reads the crossings whose ghosts enter at `step` or soon after.
    fn load(&mut self, step: u64) -> Result<(), StorageError> {
        let taken = self.supply.take(step, &self.table)?;
        self.tally.before_start += taken.before_start;
        for one in taken.ghosts {
            self.pending.insert((one.look, one.ghost.crossing.state.id), one.ghost);
        }
        Ok(())
    }

    fn enter(&mut self, step: u64) -> Vec<GhostEntry> {
        let mut entries = Vec::new();
        while let Some(first) = self.pending.first_entry()
            && first.key().0 <= step
        {
            let mut ghost = first.remove();
            let id = ghost.crossing.state.id;
            let motion = self.table.motion(&ghost.crossing, &ghost.times, ghost.shift, step as i64);
            let Motion { position, velocity, spin, .. } = motion;
            let state = ParticleState { position, velocity, spin, ..ghost.crossing.state };
            entries.push(GhostEntry { state, motion, path: self.table.replay.path });
            self.count(&ghost);
            if self.table.replay.path == PathMode::Compliant {
                let (from, to) = (step as i64, ghost.release as i64);
                let tether = self.table.tether_step(&ghost.crossing, ghost.shift, from, to);
                ghost.tether = (tether < to).then_some(tether as u64);
                self.tethers.extend(ghost.tether.map(|step| (step, id)));
            }
            self.releases.insert((ghost.release, id));
            self.ghosts.insert(id, ghost);
        }
        entries
    }

    fn count(&mut self, ghost: &Ghost) {
        let tally = &mut self.tally;
        tally.inserted += 1;
        tally.begun_at_start += u64::from(ghost.clipped);
        match ghost.times.begins {
            Begins::Zone => {}
            Begins::Apex => tally.apex_starts += 1,
            Begins::Release => tally.without_entry += 1,
            Begins::PathStart => tally.short_paths += 1,
        }
    }

    fn tether(&mut self, step: u64) -> Vec<ParticleId> {
        let mut ids = Vec::new();
        while let Some(&(due, id)) = self.tethers.first()
            && due <= step
        {
            self.tethers.pop_first();
            ids.push(id);
        }
        ids
    }

    fn release(&mut self, step: u64) -> Vec<Release> {
        let mut releases = Vec::new();
        while let Some(&(due, id)) = self.releases.first()
            && due <= step
        {
            self.releases.pop_first();
            if let Some(ghost) = self.ghosts.remove(&id) {
                releases.push(self.released(ghost));
                self.tally.released += 1;
            }
        }
        releases
    }

    fn released(&self, ghost: Ghost) -> Release {
        let (motion, force, torque) = self.table.released(&ghost.crossing, &ghost.times);
        let exact = self.table.is_exact()
            && self.table.releases_stored(&ghost.crossing, &ghost.times)
            && self.table.replay.path != PathMode::Compliant;
        let Motion { position, velocity, spin, .. } = motion;
        let state = ParticleState { position, velocity, spin, ..ghost.crossing.state };
        Release { state, force, torque, contacts: ghost.crossing.contacts, exact }
    }

    /// Where a recorded or compliant ghost is on its path at time step `step`; `None` for other ghosts, which the solver moves,
    /// and for particles that are no ghosts.
    #[must_use]
    pub fn motion(&self, id: ParticleId, step: u64) -> Option<Motion> {
        if !self.table.follows_record() {
            return None;
        }
        let ghost = self.ghosts.get(&id)?;
        Some(self.table.motion(&ghost.crossing, &ghost.times, ghost.shift, step as i64))
    }

    /// Where a ghost is at time step `step` at or before its release: on its way, and at the release itself in the state that it
    /// will have then; `None` for particles that are no ghosts.
    #[must_use]
    pub fn motion_to_release(&self, id: ParticleId, step: u64) -> Option<Motion> {
        let ghost = self.ghosts.get(&id)?;
        if step >= ghost.release {
            return Some(self.table.released(&ghost.crossing, &ghost.times).0);
        }
        Some(self.table.motion(&ghost.crossing, &ghost.times, ghost.shift, step as i64))
    }

    /// True where every release has the stored bits.
    #[must_use]
    pub fn is_exact(&self) -> bool {
        self.table.is_exact() && self.supply.releases_stored() && self.table.replay.path != PathMode::Compliant
    }

    /// True when nothing is left to come: no ghost is on its way.
    #[must_use]
    pub fn is_finished(&self) -> bool {
        self.pending.is_empty() && self.ghosts.is_empty() && self.supply.next_look().is_none()
    }

    /// What has been counted.
    #[must_use]
    pub const fn tally(&self) -> ReplayTally {
        self.tally
    }

    /// Ghosts that are on their way now, in ascending order.
    #[must_use]
    pub fn ghosts(&self) -> Vec<ParticleId> {
        let mut ids: Vec<ParticleId> = self.ghosts.keys().copied().collect();
        ids.sort_unstable();
        ids
    }

    /// Compliant ghosts among [`Self::ghosts`] that are bound to their paths rather than moved along them, in ascending order.
    #[must_use]
    pub fn tethered(&self) -> Vec<ParticleId> {
        let waits = |ghost: &Ghost, id: ParticleId| ghost.tether.is_none_or(|step| self.tethers.contains(&(step, id)));
        let bound = |id: &ParticleId| self.ghosts.get(id).is_some_and(|ghost| !waits(ghost, *id));
        self.ghosts().into_iter().filter(bound).collect()
    }

    /// Goes to the state that this replayer has when [`Self::due`] has been called for every time step up to `step`.
    ///
    /// # Errors
    /// When the stream cannot be read.
    pub fn seek(&mut self, step: u64) -> Result<(), StorageError> {
        self.reset();
        // In the order of the time steps at which something is due, so that no more is held at once than in the run itself.
        self.set_next();
        while self.next <= step {
            let at = self.next.max(self.table.stage.start_step);
            self.due(at)?;
        }
        Ok(())
    }
}
