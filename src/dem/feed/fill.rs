//! Random fill of a region: random sequential addition, repeated while the region empties.
//!
//! Particles are tried in rounds. A round takes particles in the order of their serial numbers up to a share of the
//! region, then tries the largest of them first, because a large one finds no place among small ones already there.
//! The order of trying changes where a particle comes, never its size or identity.

use super::Amount;
use super::queue::{Candidate, Outcome, Queue, Site};
use super::region::RegionSampler;
use super::report::{FeedReport, Shortfall};
use super::{FeedKind, Region};
use crate::particle::Body;
use serde::{Deserialize, Serialize};

/// Places tried for a particle at each insertion, inside the region.
pub const ATTEMPTS: u64 = 300;
/// So many particles in a row without a place end a size range for this insertion: with [`ATTEMPTS`] each, the share of
/// the region that is free for such a size is below 1 / 5 000 with a certainty of 95 %.
const FAILURES_IN_A_ROW: u32 = 50;
/// Smaller particles are tried again from this share of the radius that found no place.
const NEXT_SIZE: f64 = 0.8;
/// Share of the region offered to the first round and to the later ones. Random sequential addition of equal spheres
/// ends at 0.38 of a volume and that of equal discs at 0.547 of an area (Torquato and Stillinger, 2010); wide size
/// distributions go further.
const FIRST_ROUND: f64 = 0.45;
const FIRST_ROUND_OF_DISCS: f64 = 0.6;
const NEXT_ROUND: f64 = 0.05;
/// So many rounds in a row of nothing but particles too large for the region end an insertion.
const BARREN_ROUNDS: u32 = 100;

#[derive(Debug, Clone)]
pub(super) struct Fill {
    name: String,
    queue: Queue,
    sampler: RegionSampler,
    /// Volume of the region [m3], or area [m2].
    measure: f64,
    /// Attempts for a particle, more where a region's bounding box is larger than itself.
    attempts: u64,
    amount: Amount,
    start: f64,
    interval: f64,
    until: f64,
    pub progress: FillProgress,
}

/// How far a fill has come, beyond its queue.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
pub(super) struct FillProgress {
    /// Number of the next insertion, from 0.
    next_insertion: u64,
    /// Insertions done.
    insertions: u64,
}

impl Fill {
    pub fn new(name: String, kind: &FeedKind, queue: Queue) -> Option<Self> {
        let FeedKind::Fill { region, amount, start, interval, until, .. } = kind else { return None };
        let body = queue.body();
        Some(Self {
            name,
            sampler: RegionSampler::new(region.clone(), body),
            measure: region.measure(body),
            attempts: attempts_in(region),
            queue: queue.limited(Some(*amount)),
            amount: *amount,
            start: *start,
            interval: *interval,
            until: *until,
            progress: FillProgress::default(),
        })
    }

    pub const fn queue(&self) -> &Queue {
        &self.queue
    }

    pub const fn queue_mut(&mut self) -> &mut Queue {
        &mut self.queue
    }

    /// Plant time of the next insertion [s]; infinite when none will come.
    pub fn next_time(&self) -> f64 {
        let number = self.progress.next_insertion;
        // 0 times an infinite interval is no number
        let time = if number == 0 { self.start } else { self.start + number as f64 * self.interval };
        if self.queue.is_complete() || time > self.until { f64::INFINITY } else { time }
    }

    pub fn is_finished(&self) -> bool {
        self.next_time() == f64::INFINITY
    }

    pub fn insert(&mut self, time: f64, site: &mut Site) {
        // an interval shorter than a time step: one insertion, and the missed ones are not made up for
        while self.next_time() <= time {
            let passed = if self.interval > 0.0 { ((time - self.start) / self.interval).floor() } else { 0.0 };
            self.progress.next_insertion = (self.progress.next_insertion + 1).max(passed as u64);
            if self.interval <= 0.0 {
                break;
            }
        }
        self.progress.insertions += 1;
        let mut left_over = Vec::new();
        let mut candidates = self.first_round();
        let mut barren_rounds = 0;
        while !candidates.is_empty() && barren_rounds < BARREN_ROUNDS {
            let offered = candidates.len();
            let (placed, refused) = self.round(candidates, site);
            barren_rounds = if placed == 0 { barren_rounds + 1 } else { 0 };
            // those too large for the region say nothing about how full it is
            let is_full = 2 * refused.len() > offered;
            left_over.extend(refused);
            candidates = if is_full { Vec::new() } else { self.draw_share(NEXT_ROUND) };
        }
        left_over.sort_unstable_by_key(|candidate| candidate.serial);
        self.queue.progress.waiting = left_over;
    }

    /// What waits since the last insertion, and new particles up to the share of the first round.
    fn first_round(&mut self) -> Vec<(Candidate, f64)> {
        let waiting = std::mem::take(&mut self.queue.progress.waiting);
        let mut candidates: Vec<_> =
            waiting.into_iter().map(|candidate| (candidate, self.queue.radius(candidate.serial))).collect();
        let offered: f64 = candidates.iter().map(|&(_, radius)| self.body_measure(radius)).sum();
        let share = match self.queue.body() {
            Body::Sphere => FIRST_ROUND,
            Body::Disc { .. } => FIRST_ROUND_OF_DISCS,
        };
        candidates.extend(self.draw_share(share - offered / self.measure));
        candidates
    }

    /// New particles up to a share of the region; at least one where the share is above zero.
    fn draw_share(&mut self, share: f64) -> Vec<(Candidate, f64)> {
        let mut room = share * self.measure;
        let mut drawn = Vec::new();
        while room > 0.0 {
            let Some((candidate, radius)) = self.queue.draw() else { break };
            room -= self.body_measure(radius);
            drawn.push((candidate, radius));
        }
        drawn
    }

    /// Tries all candidates, the largest first: how many found a place, and those that may find one another time.
    fn round(&mut self, mut candidates: Vec<(Candidate, f64)>, site: &mut Site) -> (usize, Vec<Candidate>) {
        candidates.sort_by(|(a, a_radius), (b, b_radius)| b_radius.total_cmp(a_radius).then(a.serial.cmp(&b.serial)));
        let mut placed = 0;
        let mut refused = Vec::new();
        let mut failures = 0;
        let mut largest = f64::INFINITY;
        let sampler = &self.sampler;
        for (mut candidate, radius) in candidates {
            if radius > largest {
                refused.push(candidate);
                continue;
            }
            let place = |numbers| sampler.place(numbers, radius);
            match self.queue.try_places(&mut candidate, radius, self.attempts, place, site) {
                Outcome::Placed => {
                    placed += 1;
                    failures = 0;
                }
                Outcome::TooLarge => {}
                Outcome::NoRoom => {
                    refused.push(candidate);
                    failures += 1;
                    if failures == FAILURES_IN_A_ROW {
                        largest = NEXT_SIZE * radius;
                        failures = 0;
                    }
                }
            }
        }
        (placed, refused)
    }

    fn body_measure(&self, radius: f64) -> f64 {
        match self.queue.body() {
            Body::Sphere => Body::Sphere.mass(radius, 1.0),
            Body::Disc { .. } => Body::Disc { thickness: 1.0 }.mass(radius, 1.0),
        }
    }

    pub fn report(&self) -> FeedReport {
        let tally = &self.queue.progress.tally;
        let reached = match self.amount {
            Amount::Count(_) => 0.0,
            // the amount counts as reached within the round-off of the sum
            Amount::Mass(mass) => 1e-9 * mass,
        };
        let missing = tally.missing(self.amount, reached);
        FeedReport {
            name: self.name.clone(),
            asked: self.amount,
            inserted_count: tally.count,
            inserted_mass: tally.mass(),
            grading: tally.grading(self.queue.sampler()),
            shortfall: missing.map(|missing| Shortfall { missing, cause: self.cause() }),
        }
    }

    fn cause(&self) -> String {
        if self.progress.insertions == 0 {
            return format!(
                "the first insertion is due at {} s: let the run last longer, or start it earlier",
                self.start
            );
        }
        if self.queue.progress.too_large > 0 {
            return format!(
                "{} particles do not fit into the region at all (diameters up to {:.4} mm): enlarge the region, or take \
                 smaller particles",
                self.queue.progress.too_large,
                2e3 * self.queue.largest_radius()
            );
        }
        let next = self.next_time();
        if next.is_finite() {
            return format!(
                "the region was full at {} insertions, and the next one is due at {next} s: give the run more time, shorten \
                 the interval or enlarge the region",
                self.progress.insertions
            );
        }
        if self.interval.is_finite() {
            return format!(
                "the time window ended at {} s after {} insertions into a region that was full: prolong the window, shorten \
                 the interval or enlarge the region",
                self.until, self.progress.insertions
            );
        }
        format!(
            "the region is full: random insertion fills no more than about {} of it, and there is one insertion only; \
             enlarge the region, or give an interval so that it is filled again while it empties",
            match self.queue.body() {
                Body::Sphere => "0.38 of the volume with equal spheres",
                Body::Disc { .. } => "0.55 of the area with equal discs",
            }
        )
    }
}

fn attempts_in(region: &Region) -> u64 {
    // points beside a mesh cost little; they must not use up the attempts
    (ATTEMPTS as f64 / region.hit_share()).min(20.0 * ATTEMPTS as f64) as u64
}
