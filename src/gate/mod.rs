//! The gate: what passes it is recorded once and replayed as often as wanted.
//!
//! `record` watches a plane and turns passages into crossings, `stream` stores them, `replay` brings them back as
//! ghosts that become ordinary particles, `ledger` and `quality` say what came through and how good a place to cut it was.
//! Nothing here knows who computes: a backend shows particles and carries out what is asked.

pub mod crossing;
pub mod ghost;
pub mod id_map;
pub mod ledger;
pub mod quality;
pub mod record;
pub mod replay;
pub mod stream;

/// How often a run looks at its gates, in time steps.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Cadence {
    /// Time steps between two looks at who passes and who is released.
    pub look: u64,
    /// Time steps between two looks at what must enter or leave a run at a gate, a multiple of `look`. Each of these may renew the
    /// neighbour lists, so it is not made at every look: a ghost enters up to so many steps before its path reaches the generation
    /// plane, and a particle is taken out up to so many steps after it has passed the exclusion plane.
    pub hand_over: u64,
}

impl Cadence {
    /// Of our own solver.
    pub const NATIVE: Self = Self { look: 1, hand_over: HAND_OVER_STEPS };
}

/// Time steps between two looks at what must enter or leave a run at a gate. Each look may renew the neighbour lists, so
/// it is not made at every step: a ghost enters up to so many steps before its path reaches the generation plane, and a
/// particle is taken out up to so many steps after it has passed the exclusion plane.
pub const HAND_OVER_STEPS: u64 = 32;
