//! Pairs of particles that both sleep: what they do to each other is computed once and added from then on.
//!
//! Lists are cut into the blocks of the widest instruction set, so that who rests never depends on the one in use. A block of which
//! every particle sleeps is computed like any other, with velocities of zero; its memories are put back, so that the same bits come
//! out whenever it is computed again.

use super::particles::{Path, Velocity};
use crate::math::lanes::{LaneVector, Lanes, MOST_LANES};
use std::ops::Range;

/// Whether a run of pairs rests.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Rest {
    /// Somebody in each block is awake.
    Moving,
    /// All sleep, and what they do to each other is not known yet.
    New,
    /// All sleep, and it is known.
    Known,
}

/// Blocks of a list, one after the other, that rest alike.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Run {
    /// Entries of the list.
    pub pairs: Range<usize>,
    /// Whether they rest.
    pub rest: Rest,
}

/// Forces and torques of the pairs of a list that rest. Components are as long as whole blocks, or empty until somebody sleeps.
#[derive(Debug, Clone, Default)]
pub struct RestingPairs {
    /// Of each block, whether it is known.
    known: Vec<bool>,
    /// On owners [N]; on partners the opposite.
    force: [Vec<f64>; 3],
    /// On owners and on partners [N m].
    torques: [[Vec<f64>; 3]; 2],
    /// Whether all blocks were found to rest.
    complete: bool,
}

impl Run {
    /// The first `count` pairs, none of them at rest.
    #[must_use]
    pub const fn moving(count: usize) -> Self {
        Self { pairs: 0..count, rest: Rest::Moving }
    }
}

impl RestingPairs {
    /// Forgets everything: the list has changed.
    pub fn forget(&mut self) {
        self.known.clear();
        self.complete = false;
    }

    /// Whether all pairs of the list were found to rest when it was cut into runs.
    #[must_use]
    pub const fn is_complete(&self) -> bool {
        self.complete
    }

    /// Cuts a list of `count` pairs into runs; `particles` are owners and partners, as long as whole blocks. What was new is known
    /// the next time.
    pub fn runs(&mut self, particles: [&[u32]; 2], count: usize, velocities: &[Velocity]) -> Vec<Run> {
        let asleep = |index: &u32| velocities[*index as usize].path == Path::Asleep;
        let [owners, partners] = particles.map(|list| list.chunks_exact(MOST_LANES));
        self.known.resize(owners.len(), false);
        let mut runs: Vec<Run> = Vec::new();
        for (block, (owners, partners)) in owners.zip(partners).enumerate() {
            let rests = owners.iter().all(asleep) && partners.iter().all(asleep);
            let rest = match (rests, self.known[block]) {
                (false, _) => Rest::Moving,
                (true, false) => Rest::New,
                (true, true) => Rest::Known,
            };
            self.known[block] = rests;
            let pairs = block * MOST_LANES..count.min((block + 1) * MOST_LANES);
            match runs.last_mut() {
                Some(run) if run.rest == rest => run.pairs.end = pairs.end,
                _ => runs.push(Run { pairs, rest }),
            }
        }
        self.complete = runs.iter().all(|run| run.rest != Rest::Moving);
        if runs.iter().any(|run| run.rest == Rest::New) {
            let length = self.known.len() * MOST_LANES;
            let components = self.force.iter_mut().chain(self.torques.iter_mut().flatten());
            components.for_each(|list| list.resize(length, 0.0));
        }
        runs
    }

    /// Keeps what the pairs from the entry `from` on, one a lane, do to their owners, and the torques on both [N, N m].
    #[inline(always)]
    pub(super) fn keep<L: Lanes>(&mut self, from: usize, force: &LaneVector<L>, torques: &[LaneVector<L>; 2]) {
        force.write_to(&mut self.force, from);
        torques.iter().zip(&mut self.torques).for_each(|(torque, lists)| torque.write_to(lists, from));
    }

    /// What was kept.
    #[inline(always)]
    pub(super) fn kept<L: Lanes>(&self, from: usize) -> (LaneVector<L>, [LaneVector<L>; 2]) {
        let [own, partner] = &self.torques;
        (
            LaneVector::read_from(&self.force, from),
            [LaneVector::read_from(own, from), LaneVector::read_from(partner, from)],
        )
    }
}
