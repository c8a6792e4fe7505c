//! The recorder: watches a gate and turns passages into crossings.
//!
//! A crossing is the first time that the passing point's distance s from the plane changes from < 0 to >= 0 inside of the
//! aperture. s = 0 exactly at a time step has passed; a path that turns just before has not.
//!
//! Only particles near the plane are kept in a table: those before it, within the path length, and those that have passed and
//! are still in the run. All others need not even be shown ([`Recorder::view`]).
//!
//! Before the gate's first crossing only the newest motions of every path are kept, back to the last look at which ghosts enter:
//! downstream there is nobody yet on whom a ghost could act, and a hopper may rest above its closed outlet for long.
//! Residents that the downstream stage has of its own meet ghosts with correspondingly short paths until then.

mod checkpoint;
mod fate;
pub mod passage;
pub mod profile;
#[cfg(test)]
mod tests;

pub use checkpoint::RecorderState;
pub use fate::RecordTally;

use super::Cadence;
use super::crossing::{Crossing, Motion, Passage, Seen, StoredContact};
use super::id_map::IdMap;
use crate::math::Vec3;
use crate::particle::{ParticleId, ParticleState};
use crate::scene::gate::{ExclusionMode, Fate, Gate, PassingPoint, PathRecording};
use profile::FreeFlowProfile;
use std::ops::RangeInclusive;

/// Motions, `every` so many time steps, that are kept of a path before the first crossing: a ghost enters at the last hand-over
/// before the first release, and those who touch that particle must be there when it becomes free.
const fn motions_before_first_crossing(cadence: Cadence, every: u64) -> usize {
    cadence.hand_over.div_ceil(every) as usize + 2
}

/// How a recorder of this `cadence` stores paths that are to be stored as `asked`: at looks only.
#[must_use]
pub fn stored_paths(asked: Option<PathRecording>, cadence: Cadence) -> Option<PathRecording> {
    let every = |paths: PathRecording| paths.every.max(1).next_multiple_of(cadence.look);
    asked.map(|paths| PathRecording { every: every(paths), ..paths })
}

/// |a - g| above this share of |g| means that a particle is in contact.
const CONTACT_ACCELERATION: f64 = 1e-9;

/// What a recorder may do to the run that it watches.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Role {
    /// The run hands its particles over: they are frozen, taken out, or stop it as the gate says.
    HandOver,
    /// The run is recorded as a whole; nothing is changed.
    Observe,
}

/// What a look found, all in ascending order of identity.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Look {
    /// Particles that passed in this time step; [`Recorder::crossing`] is called for each.
    pub crossed: Vec<ParticleId>,
    /// Those of them that go on as ghosts (modes `constant` and `ballistic`).
    pub freeze: Vec<ParticleId>,
    /// Recorded particles beyond the exclusion plane, to be taken out; only at hand-overs.
    pub exclude: Vec<ParticleId>,
    /// Particles to be taken out by their fate; only at hand-overs.
    pub delete: Vec<ParticleId>,
    /// Why the run must end, by the fate of a particle.
    pub error: Option<String>,
}

/// Watches a gate.
#[derive(Debug, Clone)]
pub struct Recorder {
    gate: Gate,
    role: Role,
    gravity: Vec3,
    timestep: f64,
    cadence: Cadence,
    /// Periods of the domain along x, y, z [m], where it has them.
    periods: [Option<f64>; 3],
    /// Distance before the plane within which particles are kept in the table [m].
    band: f64,
    /// From a centre to the passing point, per radius.
    to_passing_point: Vec3,
    before: IdMap<Approach>,
    after: IdMap<Gone>,
    /// Beyond the plane without having passed: counted already.
    sitting: IdMap<()>,
    /// Crossings of the last look, by identity.
    fresh: Vec<Fresh>,
    looked: bool,
    tally: RecordTally,
    profile: FreeFlowProfile,
}

/// A particle before the plane.
#[derive(Debug, Clone, PartialEq)]
struct Approach {
    step: u64,
    distance: f64,
    motion: Motion,
    path: Vec<Motion>,
    path_start: u64,
}

/// A particle that has been recorded and may still be in the run.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
struct Gone {
    /// Whether it is before the plane again.
    returned: bool,
}

/// A crossing of the last look, without what only the solver knows.
#[derive(Debug, Clone)]
struct Fresh {
    id: ParticleId,
    step: u64,
    passage: Passage,
    path: Vec<Motion>,
    path_start: u64,
}

impl Approach {
    /// Adds the present motion to the path if it is to be stored. Before the gate's first crossing (`started` false) only the newest
    /// motions are kept.
    fn prolong(&mut self, paths: Option<PathRecording>, cadence: Cadence, started: bool) {
        let Some(paths) = paths else { return };
        if self.distance < -paths.length {
            self.path.clear();
        } else if self.step.is_multiple_of(paths.every) {
            if self.path.is_empty() {
                self.path_start = self.step;
            }
            if !started && self.path.len() >= motions_before_first_crossing(cadence, paths.every) {
                self.path.remove(0);
                self.path_start += paths.every;
            }
            self.path.push(self.motion);
        }
    }
}

impl Approach {
    /// Moves the path by whole `periods` [m] so that it leads on to the motion `end`, an `interval` [s] after its last one.
    fn end_at(&mut self, end: &Motion, interval: f64, periods: &[Option<f64>; 3]) {
        let turns = end.position - passage::unwrapped(&self.motion, end, interval, periods).position;
        if turns != Vec3::zeros() {
            self.path.iter_mut().chain([&mut self.motion]).for_each(|motion| motion.position += turns);
        }
    }
}

impl Recorder {
    /// A recorder of `gate` for a run with `gravity` [m/s2] and `timestep` [s] whose largest particle has `largest_diameter` [m];
    /// it is shown the particles at every look of `cadence`, whose `hand_over` is a multiple of its `look`.
    #[must_use]
    pub fn new(gate: &Gate, role: Role, gravity: Vec3, timestep: f64, largest_diameter: f64, cadence: Cadence) -> Self {
        let path_length = gate.paths.map_or(0.0, |paths| paths.length);
        // Nothing moves a quarter of a diameter in a time step, or a diameter between two looks; so nobody comes over the plane
        // unseen.
        let travel = if cadence.look == 1 { 0.25 * largest_diameter } else { largest_diameter };
        let down = gravity.try_normalize(0.0).unwrap_or_else(Vec3::zeros);
        Self {
            role,
            gravity,
            timestep,
            cadence,
            periods: [None; 3],
            band: path_length.max(travel),
            to_passing_point: match gate.passage {
                PassingPoint::Centre => Vec3::zeros(),
                PassingPoint::LowestPoint => down,
            },
            before: IdMap::default(),
            after: IdMap::default(),
            sitting: IdMap::default(),
            fresh: Vec::new(),
            looked: false,
            tally: RecordTally::default(),
            profile: FreeFlowProfile::new(gate.exclusion.length, largest_diameter),
            gate: Gate { paths: stored_paths(gate.paths, cadence), ..gate.clone() },
        }
    }

    /// The same recorder in a domain with `periods` along x, y, z [m]: a particle may leave it at one side and come in at the
    /// other between two looks. Its path is stored as if it had gone straight on, up to where it is when it passes.
    #[must_use]
    pub fn with_periods(mut self, periods: [Option<f64>; 3]) -> Self {
        self.periods = periods;
        self
    }

    /// Distance before the plane within which particles are followed [m].
    #[must_use]
    pub const fn band(&self) -> f64 {
        self.band
    }

    /// Distances of the passing point from the plane [m] within which particles matter after time step `step`, when nothing
    /// must be seen elsewhere; at other time steps and once somebody came back, beyond it too ([`Recorder::view`]).
    #[must_use]
    pub fn zone(&self) -> RangeInclusive<f64> {
        // A band twice as wide, for a distance that is known up to round-off only.
        -2.0 * self.band..=2.0 * self.gate.exclusion.length
    }

    /// Distances [m] within which particles must be seen after time step `step`; `None` where those within [`Recorder::zone`]
    /// suffice. At the hand-over whoever is behind the plane, and one that came back over it is followed wherever it goes.
    #[must_use]
    pub fn view(&self, step: u64) -> Option<RangeInclusive<f64>> {
        let anywhere = self.tally.returned > 0;
        let from = if anywhere { f64::NEG_INFINITY } else { *self.zone().start() };
        step.is_multiple_of(self.cadence.hand_over).then_some(from..=f64::INFINITY)
    }

    /// How far the point that passes lies from the centre along the plane's normal, per radius.
    #[must_use]
    pub fn passing_point(&self) -> f64 {
        self.to_passing_point.dot(&self.gate.plane.normal)
    }

    /// Looks at particles after time step `step`, at all that [`Recorder::view`] asks for at least; to be called at every look of
    /// the cadence.
    pub fn look(&mut self, step: u64, particles: impl Iterator<Item = Seen>) -> Look {
        let mut look = Look::default();
        self.fresh.clear();
        let handing_over = step.is_multiple_of(self.cadence.hand_over);
        // The point of passage lies a fixed share of the radius along the normal.
        let reach = self.passing_point();
        let far = self.gate.exclusion.length;
        // Who is shown beyond what was asked for depends on the solver's lists: it must not count.
        let asked = self.view(step).unwrap_or_else(|| self.zone());
        for seen in particles {
            let distance = self.gate.plane.distance(&seen.motion.position) + seen.radius * reach;
            if !asked.contains(&distance) {
                continue;
            }
            if distance < 0.0 {
                self.see_before(step, &seen, distance, &mut look);
            } else if distance <= far || handing_over {
                self.see_behind(step, &seen, distance, handing_over, &mut look);
            }
        }
        if handing_over {
            // What was not seen now has left upstream or was taken out.
            self.before.retain(|_, approach| approach.step == step);
        }
        self.looked = true;
        self.finish(look)
    }

    fn see_before(&mut self, step: u64, seen: &Seen, distance: f64, look: &mut Look) {
        // Nobody is in both tables; most of those seen here have been seen here before.
        let approach = if distance < -self.band { None } else { self.before.get_mut(&seen.id) };
        if let Some(approach) = approach {
            if approach.step + self.cadence.look < step {
                // It was away: the path that was begun then is not this one.
                approach.path.clear();
            }
            let motion = passage::unwrapped(
                &approach.motion,
                &seen.motion,
                self.cadence.look as f64 * self.timestep,
                &self.periods,
            );
            (approach.step, approach.distance, approach.motion) = (step, distance, motion);
            approach.prolong(self.gate.paths, self.cadence, self.tally.recorded > 0);
        } else if self.after.contains_key(&seen.id) {
            self.see_returned(step, seen, distance, look);
        } else if distance >= -self.band {
            let mut approach = Approach { step, distance, motion: seen.motion, path: Vec::new(), path_start: step };
            approach.prolong(self.gate.paths, self.cadence, self.tally.recorded > 0);
            self.before.insert(seen.id, approach);
        }
    }

    fn see_behind(&mut self, step: u64, seen: &Seen, distance: f64, handing_over: bool, look: &mut Look) {
        if handing_over && self.flows_freely() && distance < self.gate.exclusion.length && self.in_aperture(seen) {
            let extra = (seen.motion.acceleration - self.gravity).norm();
            self.profile.count(distance, extra > CONTACT_ACCELERATION * self.gravity.norm());
        }
        if let Some(gone) = self.after.get_mut(&seen.id) {
            gone.returned = false;
            if handing_over && distance >= self.gate.exclusion.length {
                look.exclude.push(seen.id);
            }
            return;
        }
        match self.before.remove(&seen.id) {
            Some(approach) if approach.step + self.cadence.look == step => {
                self.pass(step, seen, distance, approach, look)
            }
            // It has not been seen at the last look: whatever it did, it did not pass here just now.
            Some(_) | None => self.see_sitting(step, seen, handing_over, look),
        }
    }

    /// Records the passage of a particle if it leads through the aperture.
    fn pass(&mut self, step: u64, seen: &Seen, distance: f64, mut approach: Approach, look: &mut Look) {
        approach.end_at(&seen.motion, self.cadence.look as f64 * self.timestep, &self.periods);
        let (old, new) = (&approach.motion, &seen.motion);
        let along = |vector: &Vec3| vector.dot(&self.gate.plane.normal);
        let passage = if distance == 0.0 {
            let Motion { position, velocity, spin, .. } = *new;
            Passage { time: step as f64 * self.timestep, position, velocity, spin }
        } else if self.cadence.look > 1 {
            let interval = self.cadence.look as f64 * self.timestep;
            let start = (step - self.cadence.look) as f64 * self.timestep;
            let ends = [(approach.distance, along(&old.velocity)), (distance, along(&new.velocity))];
            let tau = passage::first_root(ends, interval);
            passage::state_between(old, new, tau, interval, start + tau)
        } else {
            let (speed, acceleration) = (along(&old.velocity), along(&old.acceleration));
            let tau = passage::substep(approach.distance, speed, acceleration, self.timestep);
            let time = ((step - 1) as f64).mul_add(self.timestep, tau);
            passage::state_at(old, new, tau, self.timestep, time)
        };
        let point = passage.position + self.to_passing_point * seen.radius;
        if !self.gate.plane.holds(&point) {
            return;
        }
        self.tally.recorded += 1;
        self.tally.grazing += u64::from(along(&new.velocity) <= 0.0);
        self.after.insert(seen.id, Gone { returned: false });
        self.sitting.remove(&seen.id);
        look.crossed.push(seen.id);
        let Approach { path, path_start, .. } = approach;
        self.fresh.push(Fresh { id: seen.id, step, passage, path, path_start });
    }

    /// The crossing of a particle of the last look's `crossed`, completed by what the solver knows of it.
    ///
    /// # Panics
    /// When the particle did not cross in the last look.
    pub fn crossing(
        &mut self,
        state: ParticleState,
        force: Vec3,
        torque: Vec3,
        contacts: Vec<StoredContact>,
    ) -> Crossing {
        let index = self.fresh.binary_search_by_key(&state.id, |fresh| fresh.id);
        let index = index.unwrap_or_else(|_| panic!("{:?} did not cross in the last look", state.id));
        let fresh = &mut self.fresh[index];
        self.tally.in_contact += u64::from(!contacts.is_empty());
        Crossing {
            step: fresh.step,
            state,
            force,
            torque,
            passage: fresh.passage,
            contacts,
            path: std::mem::take(&mut fresh.path),
            path_start: fresh.path_start,
        }
    }

    /// Puts what was found into order, and takes back what the role forbids.
    fn finish(&mut self, mut look: Look) -> Look {
        self.fresh.sort_unstable_by_key(|fresh| fresh.id);
        for list in [&mut look.crossed, &mut look.exclude, &mut look.delete] {
            list.sort_unstable();
        }
        if self.role == Role::Observe {
            return Look { crossed: look.crossed, ..Look::default() };
        }
        if self.gate.exclusion.mode != ExclusionMode::Buffer {
            look.freeze.clone_from(&look.crossed);
        }
        for id in &look.exclude {
            self.after.remove(id);
        }
        self.tally.excluded += look.exclude.len() as u64;
        self.tally.deleted += look.delete.len() as u64;
        for id in &look.delete {
            self.after.remove(id);
            self.sitting.remove(id);
        }
        look
    }

    /// True where particles behind the plane move as they would without the gate.
    fn flows_freely(&self) -> bool {
        self.role == Role::Observe || self.gate.exclusion.mode == ExclusionMode::Buffer
    }

    fn in_aperture(&self, seen: &Seen) -> bool {
        self.gate.plane.holds(&(seen.motion.position + self.to_passing_point * seen.radius))
    }

    /// Particles that left the run by other ways than [`Look::exclude`] and [`Look::delete`], as over the domain's border.
    pub fn count_removed(&mut self, ids: impl Iterator<Item = ParticleId>) {
        for id in ids {
            self.before.remove(&id);
            self.sitting.remove(&id);
            self.tally.lost_after_crossing += u64::from(self.after.remove(&id).is_some());
        }
    }

    /// Particles that have been recorded and have not left the run as far as is known, in no order.
    pub fn gone_through(&self) -> impl Iterator<Item = ParticleId> {
        self.after.keys().copied()
    }

    /// What has been counted.
    #[must_use]
    pub fn tally(&self) -> RecordTally {
        RecordTally { free_flow: self.profile.bins(), still_in_run: self.after.len() as u64, ..self.tally.clone() }
    }
}
