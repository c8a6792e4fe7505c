//! A timed stream through a face.
//!
//! Particle k is due at start + k / rate, or by mass at start + (mass of the particles before it) / rate: what is due is
//! a function of time, so that the mean rate has no drift whatever the time step. What finds no place waits and is tried
//! again at the next step.

use super::queue::{Candidate, Outcome, Queue, Site};
use super::report::{FeedReport, Shortfall};
use super::{Amount, Face, FeedKind, Rate};
use serde::{Deserialize, Serialize};

/// Places tried for a particle at each step.
pub const ATTEMPTS: u64 = 20;
/// So many particles in a row without a place end the attempts of this step: the next step comes soon.
const FAILURES_IN_A_ROW: u32 = 8;
/// No more than this many particles wait individually; the rest of a backlog is not even made yet.
const LARGEST_WAITING: usize = 64;
/// A due time within this share of the window before its end counts as its end, so that a rate times a window that is a
/// whole number gives that number.
const WINDOW: f64 = 1.0 - 1e-12;

#[derive(Debug, Clone)]
pub(super) struct Stream {
    name: String,
    queue: Queue,
    face: Face,
    rate: Rate,
    start: f64,
    until: f64,
    pub progress: StreamProgress,
}

/// How far a stream has come, beyond its queue.
#[derive(Debug, Clone, PartialEq, Eq, Default, Serialize, Deserialize)]
pub(super) struct StreamProgress {
    /// Past the end of its time window.
    closed: bool,
    /// Steps at which a particle found no place.
    crowded_steps: u64,
}

impl Stream {
    pub fn new(name: String, kind: &FeedKind, queue: Queue) -> Option<Self> {
        let FeedKind::Stream { face, rate, amount, start, until, .. } = kind else { return None };
        Some(Self {
            name,
            queue: queue.limited(*amount),
            face: face.clone(),
            rate: *rate,
            start: *start,
            until: *until,
            progress: StreamProgress::default(),
        })
    }

    pub const fn queue(&self) -> &Queue {
        &self.queue
    }

    pub const fn queue_mut(&mut self) -> &mut Queue {
        &mut self.queue
    }

    pub fn is_finished(&self) -> bool {
        self.progress.closed || self.queue.is_complete()
    }

    pub fn is_due(&self, time: f64) -> bool {
        !self.is_finished()
            && time >= self.start
            && (!self.queue.progress.waiting.is_empty() || self.next_is_due(time) || time >= self.until)
    }

    /// Whether the next particle to be made is due.
    fn next_is_due(&self, time: f64) -> bool {
        let after_start = match self.rate {
            Rate::Count(rate) => self.queue.progress.next_serial as f64 / rate,
            Rate::Mass(rate) => self.queue.drawn_mass() / rate,
        };
        !self.queue.is_drawn() && self.has_passed(after_start, time)
    }

    /// Whether a due time, counted from the start [s], is past at `time` and inside the window.
    fn has_passed(&self, after_start: f64, time: f64) -> bool {
        after_start <= time - self.start && after_start < (self.until - self.start) * WINDOW
    }

    pub fn insert(&mut self, time: f64, site: &mut Site) {
        let mut still_waiting = Vec::new();
        let mut failures = 0;
        let mut waiting = std::mem::take(&mut self.queue.progress.waiting).into_iter();
        while failures < FAILURES_IN_A_ROW {
            let Some((mut candidate, radius)) = self.next_candidate(&mut waiting, still_waiting.len(), time) else {
                break;
            };
            let (face, body) = (&self.face, self.queue.body());
            let place = |numbers| face.place(numbers, radius, body);
            match self.queue.try_places(&mut candidate, radius, ATTEMPTS, place, site) {
                Outcome::Placed => failures = 0,
                Outcome::TooLarge => {}
                Outcome::NoRoom => {
                    failures += 1;
                    still_waiting.push(candidate);
                }
            }
        }
        self.progress.crowded_steps += u64::from(!still_waiting.is_empty());
        still_waiting.extend(waiting);
        self.queue.progress.waiting = still_waiting;
        self.progress.closed = time >= self.until;
    }

    fn next_candidate(
        &mut self,
        waiting: &mut impl Iterator<Item = Candidate>,
        still_waiting: usize,
        time: f64,
    ) -> Option<(Candidate, f64)> {
        if let Some(candidate) = waiting.next() {
            return Some((candidate, self.queue.radius(candidate.serial)));
        }
        if still_waiting >= LARGEST_WAITING || !self.next_is_due(time) {
            return None;
        }
        self.queue.draw()
    }

    pub fn report(&self, last_time: f64) -> FeedReport {
        let tally = &self.queue.progress.tally;
        let asked = self.asked_by(last_time);
        // what is due comes in whole particles: less than one of them is not missing
        let missing = tally.missing(asked, self.queue.mass(self.queue.largest_radius()));
        FeedReport {
            name: self.name.clone(),
            asked,
            inserted_count: tally.count,
            inserted_mass: tally.mass(),
            grading: tally.grading(self.queue.sampler()),
            shortfall: missing.map(|missing| Shortfall { missing, cause: self.cause() }),
        }
    }

    /// What the stream was to bring by `time`.
    fn asked_by(&self, time: f64) -> Amount {
        let elapsed = (time.min(self.until) - self.start).max(0.0);
        match self.rate {
            Rate::Count(rate) => {
                // the particle whose due time was last: from the product, corrected by the very test that lets it in
                let mut count = (rate * elapsed).floor() as u64 + 1;
                while count > 0 && !self.has_passed((count - 1) as f64 / rate, time) {
                    count -= 1;
                }
                while self.has_passed(count as f64 / rate, time) {
                    count += 1;
                }
                Amount::Count(if self.queue.is_drawn() { count.min(self.queue.progress.next_serial) } else { count })
            }
            Rate::Mass(rate) => {
                let due = rate * elapsed;
                Amount::Mass(if self.queue.is_drawn() { due.min(self.queue.drawn_mass()) } else { due })
            }
        }
    }

    fn cause(&self) -> String {
        if self.queue.progress.too_large > 0 {
            return format!(
                "{} particles do not fit through the face at all (diameters up to {:.4} mm): enlarge the face, or take \
                 smaller particles",
                self.queue.progress.too_large,
                2e3 * self.queue.largest_radius()
            );
        }
        format!(
            "the face was too crowded at {} steps: raise the velocity, enlarge the face, lower the rate, or make way behind it",
            self.progress.crowded_steps
        )
    }
}
