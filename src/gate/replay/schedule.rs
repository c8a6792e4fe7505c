//! When a crossing's ghost enters, and when it becomes an ordinary particle.

use super::{ReplayStage, StreamFacts};
use crate::gate::crossing::{Crossing, Motion};
use crate::gate::ghost::{self, Anchor, Entry, RecordedPath, StreamTime};
use crate::math::Vec3;
use crate::scene::gate::{PassingPoint, PathMode, Replay, Timing};

/// Time steps that no run reaches, but that can be added up and are exact as real numbers.
const FARTHEST: u64 = 1 << 52;

/// What happens to a stream's crossings in a stage: everything but the crossings themselves.
#[derive(Debug, Clone)]
pub(super) struct Timetable {
    pub(super) facts: StreamFacts,
    pub(super) replay: Replay,
    pub(super) stage: ReplayStage,
    /// The calculation plane's point and normal.
    plane: (Vec3, Vec3),
    /// Distance of the passing point behind the centre, per radius.
    reach: f64,
}

/// Times of one crossing, in time steps of the stage before any shift.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Times {
    /// Entry, in time steps; minus infinity where there is none so early.
    pub(super) entry: f64,
    /// Time step of the release.
    pub(super) release: i64,
    /// Time of the passage [s], shift and creation timing included.
    pub(super) passage: f64,
    pub(super) begins: Begins,
}

/// How a ghost's path begins.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Begins {
    /// At the generation plane.
    Zone,
    /// At the highest point of a ballistic path.
    Apex,
    /// At the release: no path leads upstream.
    Release,
    /// At the start of a recorded path that is shorter than the generation zone.
    PathStart,
}

impl Timetable {
    pub(super) fn new(facts: StreamFacts, replay: Replay, stage: ReplayStage, plane: (Vec3, Vec3)) -> Self {
        let down = stage.gravity.try_normalize(0.0).unwrap_or_else(Vec3::zeros);
        let reach = match facts.passage {
            PassingPoint::Centre => 0.0,
            // The stream's own plane: there the lowest point was looked for.
            PassingPoint::LowestPoint => down.dot(&facts.plane.normal),
        };
        Self { facts, replay, stage, plane, reach }
    }

    /// True where time steps of stream and stage are the same.
    pub(super) fn same_steps(&self) -> bool {
        self.facts.timestep.to_bits() == self.stage.timestep.to_bits()
    }

    /// True where the stored grid states are states of this stage's time steps.
    pub(super) fn on_grid(&self) -> bool {
        self.same_steps() && self.facts.same_backend && self.replay.timing == Timing::Arrival
    }

    pub(super) fn is_exact(&self) -> bool {
        self.on_grid() && self.replay.transform.is_identity()
    }

    /// Whether the ghost follows a stored path.
    pub(super) fn follows_record(&self) -> bool {
        matches!(self.replay.path, PathMode::Recorded | PathMode::Compliant)
    }

    pub(super) fn in_window(&self, crossing: &Crossing) -> bool {
        let [from, until] = self.replay.window;
        (from..=until).contains(&crossing.passage.time)
    }

    /// Distance of a particle's passing point from the calculation plane [m].
    pub(super) fn distance(&self, position: &Vec3, radius: f64) -> f64 {
        (position - self.plane.0).dot(&self.plane.1) + radius * self.reach
    }

    /// Times of a crossing that has gone through the transform, before any shift.
    pub(super) fn times(&self, crossing: &Crossing) -> Times {
        let dt = self.stage.timestep;
        let (lead, begins) = self.lead(crossing, || self.anchor(crossing));
        let stored = crossing.passage.time;
        let passage = match self.replay.timing {
            Timing::Arrival => stored,
            Timing::Creation => stored + lead,
        };
        let arrival = if self.on_grid() { crossing.step as i64 } else { first_step_at(passage, dt) };
        let release = next_multiple(arrival, self.stage.cadence.look);
        let mut times = Times { entry: 0.0, release, passage, begins };
        times.entry = if self.heads_for_release() && !self.follows_record() {
            let (lead, begins) = self.lead(crossing, || self.release_anchor(crossing, &times));
            times.begins = begins;
            release as f64 - lead / dt
        } else if self.on_grid() {
            arrival as f64 - lead / dt
        } else {
            (passage - lead) / dt
        };
        times.entry = times.entry.min((release - 1) as f64);
        times
    }

    /// Time from the entry to the anchor [s], and how the path begins.
    fn lead(&self, crossing: &Crossing, anchor: impl FnOnce() -> Anchor) -> (f64, Begins) {
        if self.follows_record() {
            return self.recorded_lead(crossing);
        }
        let anchor = anchor();
        let way = self.replay.length + self.distance(&anchor.position, crossing.state.radius);
        let speed = anchor.velocity.dot(&self.plane.1);
        let entry = match self.replay.path {
            PathMode::Ballistic => ghost::ballistic_entry(way, speed, self.stage.gravity.dot(&self.plane.1)),
            _ => ghost::constant_entry(way, speed),
        };
        match entry {
            Entry::Zone(lead) => (lead.max(0.0), Begins::Zone),
            Entry::Apex(lead) => (lead, Begins::Apex),
            Entry::Nowhere => (0.0, Begins::Release),
        }
    }

    /// From the last stored motion that is not yet in the generation zone, or from the path's start.
    fn recorded_lead(&self, crossing: &Crossing) -> (f64, Begins) {
        let outside = |motion: &Motion| self.distance(&motion.position, crossing.state.radius) < -self.replay.length;
        let last_outside = crossing.path.iter().rposition(outside);
        let begins = match (last_outside, crossing.path.is_empty()) {
            (Some(_), _) => Begins::Zone,
            (None, false) => Begins::PathStart,
            (None, true) => return (0.0, Begins::Release),
        };
        let start = self.path(crossing).step_of(last_outside.unwrap_or(0));
        let end = if self.on_grid() { crossing.step as f64 } else { crossing.passage.time / self.facts.timestep };
        ((end - start as f64) * self.facts.timestep, begins)
    }

    /// True where a constant or ballistic ghost heads for its state at the release instead of its passage: where the release is
    /// the grid state, and where the way from the passage to the release is that of many time steps.
    fn heads_for_release(&self) -> bool {
        self.on_grid() || self.stage.cadence.look > 1
    }

    fn release_anchor(&self, crossing: &Crossing, times: &Times) -> Anchor {
        let Motion { position, velocity, spin, .. } = self.released(crossing, times).0;
        Anchor { position, velocity, spin }
    }

    /// The grid state where that is one of this stage, or else the passage.
    fn anchor(&self, crossing: &Crossing) -> Anchor {
        let (state, passage) = (&crossing.state, &crossing.passage);
        if self.on_grid() {
            Anchor { position: state.position, velocity: state.velocity, spin: state.spin }
        } else {
            Anchor { position: passage.position, velocity: passage.velocity, spin: passage.spin }
        }
    }

    pub(super) fn path<'a>(&self, crossing: &'a Crossing) -> RecordedPath<'a> {
        RecordedPath {
            crossing,
            every: self.facts.every.unwrap_or(1),
            timestep: self.facts.timestep,
            gravity: self.stage.gravity,
            body: self.stage.body,
        }
    }

    /// The stream's time at time step `step` of the stage, where the stream is shifted by `shift` time steps of the stage.
    pub(super) fn stream_time(&self, step: i64, shift: i64) -> StreamTime {
        if self.same_steps() {
            return StreamTime { step: step - shift, fraction: 0.0 };
        }
        let steps = (step - shift) as f64 * self.stage.timestep / self.facts.timestep;
        StreamTime { step: steps.floor() as i64, fraction: steps - steps.floor() }
    }

    /// Where the ghost is at time step `step` of the stage.
    pub(super) fn motion(&self, crossing: &Crossing, times: &Times, shift: i64, step: i64) -> Motion {
        if self.follows_record() {
            return self.path(crossing).motion(self.stream_time(step, shift));
        }
        let dt = self.stage.timestep;
        let (anchor, lead) = if self.heads_for_release() {
            (self.release_anchor(crossing, times), (times.release + shift - step) as f64 * dt)
        } else {
            (self.anchor(crossing), times.passage - (step - shift) as f64 * dt)
        };
        match self.replay.path {
            PathMode::Ballistic => ghost::ballistic(&anchor, lead, &self.stage.gravity),
            _ => ghost::constant(&anchor, lead),
        }
    }

    /// The look at which the ghost is put in: the last one before its path reaches the generation zone, but not before a recorded
    /// path begins, always before its release, and never before the start.
    pub(super) fn look(&self, crossing: &Crossing, times: &Times, shift: i64) -> i64 {
        let between = self.stage.cadence.hand_over;
        let before_release = floor_multiple(times.release + shift - 1, between);
        let entry = times.entry.floor() as i64;
        let mut look = floor_multiple(entry.saturating_add(shift), between);
        if times.begins == Begins::PathStart {
            let covered = self.stream_time(look, shift).step >= crossing.path_start as i64;
            look += if covered { 0 } else { between as i64 };
        }
        look.min(before_release).max(self.stage.start_step as i64)
    }

    /// Time step at which a compliant ghost is let go of its path: the first one at which it is within L2 less one largest
    /// diameter of the plane. The uppermost layer stays hard: it carries the pressure of what lies above.
    pub(super) fn tether_step(&self, crossing: &Crossing, shift: i64, look: i64, release: i64) -> i64 {
        let inner = -(self.replay.length - self.stage.largest_diameter);
        let path = self.path(crossing);
        let within = |motion: &Motion| self.distance(&motion.position, crossing.state.radius) > inner;
        let is_within = |step: i64| within(&path.motion(self.stream_time(step, shift)));
        // From the stored motion before the first one within.
        let first = crossing.path.iter().position(within).unwrap_or(crossing.path.len()).saturating_sub(1);
        let ratio = self.facts.timestep / self.stage.timestep;
        let near = (path.step_of(first) as f64 * ratio).floor() as i64 + shift;
        (near.max(look)..release).find(|&step| is_within(step)).unwrap_or(release)
    }

    /// True where the stored grid state is that of the release.
    pub(super) fn releases_stored(&self, crossing: &Crossing, times: &Times) -> bool {
        self.on_grid() && times.release == crossing.step as i64
    }

    /// State, contact force and torque at the release. Where the stored grid state is one of this stage, it is that or, between
    /// two looks, that moved on to the look under the stored force. Else it is the passage moved on to that time: without contacts
    /// known it falls freely in between, else under the stored force, which then goes on acting.
    pub(super) fn released(&self, crossing: &Crossing, times: &Times) -> (Motion, Vec3, Vec3) {
        let end = self.path(crossing).end();
        if self.on_grid() {
            let late = times.release - crossing.step as i64;
            let motion = if late == 0 { end } else { ghost::advanced(&end, late as f64 * self.stage.timestep) };
            return (motion, crossing.force, crossing.torque);
        }
        let later = times.release as f64 * self.stage.timestep - times.passage;
        let known = if crossing.contacts.is_empty() { 0.0 } else { 1.0 };
        let passage = &crossing.passage;
        let gravity = self.stage.body.in_plane(&self.stage.gravity);
        let start = Motion {
            position: passage.position,
            velocity: passage.velocity,
            spin: passage.spin,
            acceleration: gravity + (end.acceleration - gravity) * known,
            spin_acceleration: end.spin_acceleration * known,
        };
        (ghost::advanced(&start, later), crossing.force * known, crossing.torque * known)
    }
}

/// The last multiple of `of` at or before `step`.
pub(super) const fn floor_multiple(step: i64, of: u64) -> i64 {
    step.div_euclid(of as i64).saturating_mul(of as i64)
}

/// The first multiple of `of` at or after `step`.
pub(super) const fn next_multiple(step: i64, of: u64) -> i64 {
    floor_multiple(step.saturating_add(of as i64 - 1), of)
}

/// The first time step at or after `time` [s].
pub(super) fn first_step_at(time: f64, timestep: f64) -> i64 {
    let mut step = (time / timestep).ceil() as i64;
    if step.unsigned_abs() > FARTHEST {
        return step.clamp(-(FARTHEST as i64), FARTHEST as i64);
    }
    // The quotient is rounded: a time that is a time step's own stays there.
    while (step - 1) as f64 * timestep >= time {
        step -= 1;
    }
    while (step as f64 * timestep) < time {
        step += 1;
    }
    step
}
