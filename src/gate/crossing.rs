//! One passage of a particle through a gate plane, with all that is needed to continue it.

use crate::math::Vec3;
use crate::particle::{ParticleId, ParticleState};

/// A particle's motion at one time step.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Motion {
    /// Centre [m].
    pub position: Vec3,
    /// Velocity of the centre [m/s].
    pub velocity: Vec3,
    /// Own rotation [rad/s].
    pub spin: Vec3,
    /// Acceleration of the centre [m/s2].
    pub acceleration: Vec3,
    /// Acceleration of the rotation [rad/s2].
    pub spin_acceleration: Vec3,
}

/// A particle as a recorder sees it after a time step.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Seen {
    /// Identity.
    pub id: ParticleId,
    /// Radius [m].
    pub radius: f64,
    /// Its motion.
    pub motion: Motion,
}

/// The passage itself: s = 0, between two time steps.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Passage {
    /// Plant time [s].
    pub time: f64,
    /// Centre [m].
    pub position: Vec3,
    /// Velocity of the centre [m/s].
    pub velocity: Vec3,
    /// Own rotation [rad/s].
    pub spin: Vec3,
}

/// The other body of a stored contact.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum ContactPartner {
    /// A particle.
    Particle(ParticleId),
    /// A part.
    Part {
        /// Index into the stream's names of parts.
        part: u16,
        /// Triangle; 0 where the part has none.
        element: u32,
    },
}

/// A contact of a particle at its crossing, as seen from that particle.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct StoredContact {
    /// The other body.
    pub partner: ContactPartner,
    /// Contact point [m].
    pub point: Vec3,
    /// Unit normal towards the other body [-].
    pub normal: Vec3,
    /// Overlap [m].
    pub overlap: f64,
    /// Normal force on the particle [N], a vector along the normal.
    pub normal_force: Vec3,
    /// Tangential force on the particle [N].
    pub tangential_force: Vec3,
    /// Memory of the tangential law as the solver keeps it: half a time step ahead, displacement [m] or force [N] by the law.
    pub tangential_memory: Vec3,
    /// Memory of the rolling law as the solver keeps it [N m].
    pub rolling_memory: Vec3,
}

/// A crossing: the first time that a particle passes a gate.
#[derive(Debug, Clone, PartialEq)]
pub struct Crossing {
    /// Time step of `state`: the first computed state at or after the plane.
    pub step: u64,
    /// Grid state, to the last bit.
    pub state: ParticleState,
    /// Force on it by its contacts at that step [N].
    pub force: Vec3,
    /// Torque on it by its contacts at that step [N m].
    pub torque: Vec3,
    /// The passage.
    pub passage: Passage,
    /// Its contacts at that step.
    pub contacts: Vec<StoredContact>,
    /// Its path: motions at `path_start`, `path_start` + k, ..., the last one before `step`; empty where none is stored.
    pub path: Vec<Motion>,
    /// Time step of the path's first motion.
    pub path_start: u64,
}
