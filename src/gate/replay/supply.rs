//! What comes when: the chunks of a stream, read when they are needed, loop by loop.

use super::schedule::{Timetable, first_step_at, floor_multiple, next_multiple};
use super::{CrossingSource, Ghost, ReplayStage, ReplayTally, StreamFacts};
use crate::gate::Cadence;
use crate::gate::crossing::{ContactPartner, Crossing, Passage};
use crate::geometry::plane::GatePlane;
use crate::math::Vec3;
use crate::particle::{ParticleId, ParticleState};
use crate::scene::gate::{Clock, PathMode, Replay, Timing};
use crate::storage::StorageError;
use std::collections::BTreeSet;
use std::path::Path;

/// Looks that are read ahead at least, so that chunks are not read again at every one.
const LOOKS_AHEAD: i64 = 64;
/// Number of feed numbers that an identity can hold.
const FEEDS: u64 = 1 << 24;

/// The chunks of a stream under the settings of a replay.
#[derive(Debug)]
pub(super) struct Supply {
    source: Box<dyn CrossingSource>,
    /// Earliest time step, before any shift, at which a ghost of each chunk can enter; `None` where all are outside of the window.
    earliest: Vec<Option<i64>>,
    /// Time steps of the stage by which the first loop is shifted, and the distance between two loops.
    shift: i64,
    period: i64,
    hand_over: u64,
    /// Whether all crossings have their release, before any shift, at their own time step.
    stored: bool,
    crossings: u64,
    outside_window: u64,
    loops: u64,
    start: i64,
    /// Chunks to be read: (look at which to, loop, chunk).
    queue: BTreeSet<(i64, u64, usize)>,
    /// First loop that is not in the queue yet.
    next_loop: u64,
}

/// A ghost that has been read, and the look at which it enters.
#[derive(Debug)]
pub(super) struct Taken {
    pub(super) look: u64,
    pub(super) ghost: Ghost,
}

/// What reading brought.
#[derive(Debug, Default)]
pub(super) struct Delivery {
    pub(super) ghosts: Vec<Taken>,
    pub(super) before_start: u64,
}

impl Supply {
    pub(super) fn new(mut source: Box<dyn CrossingSource>, table: &Timetable) -> Result<Self, StorageError> {
        let (mut crossings, mut outside_window, mut stored) = (0, 0, true);
        let (mut first, mut last) = (f64::INFINITY, f64::NEG_INFINITY);
        let mut earliest = Vec::with_capacity(source.chunk_count());
        for index in 0..source.chunk_count() {
            let mut chunk_earliest: Option<i64> = None;
            for crossing in source.chunk(index)? {
                crossings += 1;
                if !table.in_window(&crossing) {
                    outside_window += 1;
                    continue;
                }
                first = first.min(crossing.passage.time);
                last = last.max(crossing.passage.time);
                let crossing = moved(table, crossing);
                let times = table.times(&crossing);
                stored &= table.releases_stored(&crossing, &times);
                let entry = times.entry.floor() as i64;
                chunk_earliest = Some(chunk_earliest.map_or(entry, |earliest| earliest.min(entry)));
            }
            earliest.push(chunk_earliest);
        }
        let (dt, Cadence { look, hand_over }) = (table.stage.timestep, table.stage.cadence);
        let shift = match table.replay.clock {
            Clock::FirstPassage if first.is_finite() => -floor_multiple((first / dt).floor() as i64, look),
            Clock::FirstPassage | Clock::Plant => 0,
        };
        // Whole looks, so that every loop is as exact as the first.
        let between = if first.is_finite() { first_step_at(last - first + table.replay.gap, dt).max(1) } else { 1 };
        let period = next_multiple(between, look);
        let (loops, start) = (table.replay.loops, table.stage.start_step as i64);
        let (queue, next_loop) = (BTreeSet::new(), 0);
        Ok(Self {
            source,
            earliest,
            shift,
            period,
            hand_over,
            stored,
            crossings,
            outside_window,
            loops,
            start,
            queue,
            next_loop,
        })
    }

    /// True where all crossings inside the window are released with their stored states.
    pub(super) const fn releases_stored(&self) -> bool {
        self.stored
    }

    /// Begins again; what is known at the beginning of the tally.
    pub(super) fn rewind(&mut self) -> ReplayTally {
        self.queue.clear();
        self.next_loop = 0;
        self.open_loops();
        ReplayTally {
            expected: self.crossings * self.loops,
            outside_window: self.outside_window * self.loops,
            ..ReplayTally::default()
        }
    }

    fn loop_shift(&self, round: u64) -> i64 {
        self.shift.saturating_add((round as i64).saturating_mul(self.period))
    }

    /// Puts loops into the queue until one is there that begins after the earliest known look.
    fn open_loops(&mut self) {
        let Some(first) = self.earliest.iter().flatten().min() else { return };
        while self.next_loop < self.loops {
            let round = self.next_loop;
            let shift = self.loop_shift(round);
            let begins = self.clipped(first.saturating_add(shift));
            if self.queue.first().is_some_and(|(look, ..)| *look < begins) {
                return;
            }
            for (chunk, earliest) in self.earliest.iter().enumerate() {
                if let Some(earliest) = earliest {
                    self.queue.insert((self.clipped(earliest.saturating_add(shift)), round, chunk));
                }
            }
            self.next_loop += 1;
        }
    }

    fn clipped(&self, entry: i64) -> i64 {
        floor_multiple(entry, self.hand_over).max(self.start)
    }

    /// The look at which something has to be read.
    pub(super) fn next_look(&self) -> Option<u64> {
        self.queue.first().map(|(look, ..)| *look as u64)
    }

    /// Reads everything that enters at `step` or before, and what follows soon after in the same chunks.
    pub(super) fn take(&mut self, step: u64, table: &Timetable) -> Result<Delivery, StorageError> {
        let mut delivery = Delivery::default();
        while let Some(&(from, round, chunk)) = self.queue.first()
            && from <= step as i64
        {
            let (first, last) = table.facts.chunks.get(chunk).copied().unwrap_or((0, 0));
            let ratio = table.facts.timestep / table.stage.timestep;
            let ahead = (last.saturating_sub(first) as f64 * ratio / 2.0) as i64;
            let until = step as i64 + ahead.max(LOOKS_AHEAD * self.hand_over as i64);
            let crossings = self.source.chunk(chunk)?;
            self.queue.pop_first();
            let first_time = self.is_first(from, round, chunk);
            let mut next: Option<i64> = None;
            for crossing in crossings.into_iter().filter(|crossing| table.in_window(crossing)) {
                let Some(taken) = self.scheduled(crossing, round, table) else {
                    delivery.before_start += u64::from(first_time);
                    continue;
                };
                let look = taken.look as i64;
                if look > until {
                    next = Some(next.map_or(look, |next| next.min(look)));
                } else if look >= from {
                    delivery.ghosts.push(taken);
                }
            }
            if let Some(next) = next {
                self.queue.insert((next, round, chunk));
            }
            self.open_loops();
        }
        Ok(delivery)
    }

    /// Whether a chunk with this place in the queue has not been read for this loop.
    fn is_first(&self, from: i64, round: u64, chunk: usize) -> bool {
        let earliest = self.earliest.get(chunk).copied().flatten();
        earliest.is_some_and(|entry| self.clipped(entry.saturating_add(self.loop_shift(round))) == from)
    }

    /// When the ghost of a crossing enters in loop `round`; `None` where it is released before the stage begins.
    fn scheduled(&self, crossing: Crossing, round: u64, table: &Timetable) -> Option<Taken> {
        let shift = self.loop_shift(round);
        let crossing = renamed(moved(table, crossing), table, round);
        let times = table.times(&crossing);
        let release = times.release.saturating_add(shift);
        if release < self.start {
            return None;
        }
        let look = table.look(&crossing, &times, shift);
        let clipped = times.entry + (shift as f64) < self.start as f64;
        Some(Taken {
            look: look as u64,
            ghost: Ghost { crossing, times, shift, release: release as u64, clipped, tether: None },
        })
    }
}

/// The crossing at the calculation plane.
fn moved(table: &Timetable, crossing: Crossing) -> Crossing {
    if table.replay.transform.is_identity() {
        return crossing;
    }
    (table.stage.transform)(&table.replay.transform, crossing)
}

/// The crossing with the identities of the stage.
fn renamed(mut crossing: Crossing, table: &Timetable, round: u64) -> Crossing {
    let offset = table.stage.feed_offset + round as u32 * table.facts.namespace;
    if offset > 0 {
        let rename = |id: ParticleId| ParticleId::new(id.feed() + offset, id.serial());
        crossing.state.id = rename(crossing.state.id);
        for contact in &mut crossing.contacts {
            if let ContactPartner::Particle(partner) = &mut contact.partner {
                *partner = rename(*partner);
            }
        }
    }
    crossing
}

/// Point and normal of the calculation plane: the storage plane, moved as a crossing is, whose place is its point and whose
/// velocity is its normal.
pub(super) fn calculation_plane(plane: &GatePlane, replay: &Replay, stage: &ReplayStage) -> (Vec3, Vec3) {
    if replay.transform.is_identity() {
        return (plane.point, plane.normal);
    }
    let (position, velocity, spin) = (plane.point, plane.normal, Vec3::zeros());
    let id = ParticleId::new(0, 0);
    let state = ParticleState { id, material: 0, radius: 1.0, density: 1.0, position, velocity, spin };
    let marker = Crossing {
        step: 0,
        state,
        force: Vec3::zeros(),
        torque: Vec3::zeros(),
        passage: Passage { time: 0.0, position, velocity, spin },
        contacts: Vec::new(),
        path: Vec::new(),
        path_start: 0,
    };
    let moved = (stage.transform)(&replay.transform, marker);
    (moved.state.position, moved.state.velocity)
}

/// Refuses what a stream cannot give.
pub(super) fn check(facts: &StreamFacts, replay: &Replay, stage: &ReplayStage) -> Result<(), StorageError> {
    let follows_record = matches!(replay.path, PathMode::Recorded | PathMode::Compliant);
    let unusable = |reason: &str| Err(StorageError::unusable(Path::new("the stream"), reason));
    if follows_record && facts.every.is_none() {
        return unusable(
            "it has no paths; record it with `paths`, or replay it with path \"constant\" or \"ballistic\"",
        );
    }
    if follows_record && replay.timing == Timing::Creation {
        return unusable(
            "recorded paths have times of their own; use timing \"arrival\", or path \"constant\" or \"ballistic\"",
        );
    }
    let feeds = u64::from(facts.namespace).saturating_mul(replay.loops).saturating_add(u64::from(stage.feed_offset));
    if feeds > FEEDS {
        return unusable("so many loops need more identities than there are; use fewer loops");
    }
    Ok(())
}
