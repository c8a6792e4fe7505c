//! Feeds: what brings particles into a scene.

pub mod draw;
pub mod fill;
pub mod fresh;
pub mod initial_state;
mod queue;
pub mod region;
pub mod report;
pub mod runner;
pub mod size;
pub mod stream;

pub use initial_state::InitialStateError;
pub use report::{FeedReport, GradingRow, Shortfall};
pub use runner::{FeedRunner, FeedRunnerState, Occupancy};

use crate::geometry::part::TriangleMesh;
use crate::math::Vec3;
use crate::particle::ParticleState;
use serde::ser::SerializeStruct;
use serde::{Serialize, Serializer};
use std::sync::Arc;

/// A feed of the scene.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Feed {
    /// Name in the scene.
    pub name: String,
    /// What it does.
    pub kind: FeedKind,
}

impl Feed {
    /// The same feed where another stage has it: it brings nothing, and keeps its place in the list, which is in the identities
    /// of its particles.
    #[must_use]
    pub fn elsewhere(&self) -> Self {
        Self { name: self.name.clone(), kind: FeedKind::File { particles: Arc::default() } }
    }
}

/// Kinds of feeds.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub enum FeedKind {
    /// Random fill of a region without overlaps; repeated while the region empties, until the amount is reached.
    Fill {
        /// Index into the scene's particle classes.
        class: usize,
        /// Where.
        region: Region,
        /// How much in all.
        amount: Amount,
        /// Velocity at insertion [m/s].
        velocity: Vec3,
        /// Plant time of the first insertion [s].
        start: f64,
        /// Time between two insertions into the region [s]; infinite for one only.
        interval: f64,
        /// Plant time after which it gives up [s].
        until: f64,
    },
    /// A stream through a face.
    Stream {
        /// Index into the scene's particle classes.
        class: usize,
        /// The face through which the particles come.
        face: Face,
        /// How much a second.
        rate: Rate,
        /// How much in all; `None` for no limit.
        amount: Option<Amount>,
        /// Velocity at insertion [m/s].
        velocity: Vec3,
        /// Plant time of the first insertion [s].
        start: f64,
        /// Plant time of the last insertion [s].
        until: f64,
    },
    /// Particles from an initial-state file, all at time 0.
    File {
        /// The particles, validated; ids set. All who hold the feed share them, as there may be millions, and it is written down by
        /// their number and a digest of their bits.
        #[serde(serialize_with = "as_digest")]
        particles: Arc<[ParticleState]>,
    },
}

/// Particles as their number and the blake3 digest of the bits of id, material, radius, density, position, velocity and spin, each
/// particle's in turn.
fn as_digest<S: Serializer>(particles: &Arc<[ParticleState]>, serializer: S) -> Result<S::Ok, S::Error> {
    let mut hasher = blake3::Hasher::new();
    for ParticleState { id, material, radius, density, position, velocity, spin } in particles.iter() {
        hasher.update(&id.0.to_le_bytes());
        hasher.update(&material.to_le_bytes());
        let numbers = [radius, density].into_iter().chain(position).chain(velocity).chain(spin);
        for number in numbers {
            hasher.update(&number.to_le_bytes());
        }
    }
    let mut digest = serializer.serialize_struct("InitialState", 2)?;
    digest.serialize_field("count", &particles.len())?;
    digest.serialize_field("blake3", hasher.finalize().to_hex().as_str())?;
    digest.end()
}

/// An amount of particles.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub enum Amount {
    /// By number.
    Count(u64),
    /// By mass [kg].
    Mass(f64),
}

/// An amount of particles in a second.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub enum Rate {
    /// By number [1/s].
    Count(f64),
    /// By mass [kg/s].
    Mass(f64),
}

/// A region to fill; spheres lie inside it as a whole.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub enum Region {
    /// Axis-aligned box.
    Box {
        /// Lower corner [m].
        minimum: Vec3,
        /// Upper corner [m].
        maximum: Vec3,
    },
    /// Cylinder.
    Cylinder {
        /// First end of the axis [m].
        start: Vec3,
        /// Second end of the axis [m].
        end: Vec3,
        /// Radius [m].
        radius: f64,
    },
    /// The inside of a closed surface.
    Inside(TriangleMesh),
}

/// A flat face through which a stream comes: particle centres lie in it at insertion.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub enum Face {
    /// Disc.
    Disc {
        /// Centre [m].
        centre: Vec3,
        /// Unit normal [-].
        normal: Vec3,
        /// Radius [m]; spheres lie inside it as a whole.
        radius: f64,
    },
    /// Parallelogram centre +- side_a / 2 +- side_b / 2.
    Rectangle {
        /// Centre [m].
        centre: Vec3,
        /// First edge [m].
        side_a: Vec3,
        /// Second edge [m].
        side_b: Vec3,
    },
}
