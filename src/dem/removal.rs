//! Particles that leave a run, counted by cause.

use crate::particle::ParticleId;
use serde::{Deserialize, Serialize};

/// A particle that left.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Removal {
    /// Which.
    pub id: ParticleId,
    /// Mass [kg].
    pub mass: f64,
    /// Plant time [s].
    pub time: f64,
    /// Last position [m].
    pub position: [f64; 3],
    /// Why.
    pub cause: RemovalCause,
}

/// Why a particle left.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum RemovalCause {
    /// Through the domain's lower x border.
    LowerX,
    /// Through the domain's upper x border.
    UpperX,
    /// Through the domain's lower y border.
    LowerY,
    /// Through the domain's upper y border.
    UpperY,
    /// Through the domain's lower z border.
    LowerZ,
    /// Through the domain's upper z border.
    UpperZ,
    /// It was asked for.
    Asked,
    /// At the exclusion plane of a gate that had recorded it.
    Gate,
    /// By the fate that a gate or a replay gives to particles that leave the ordinary course.
    Fate,
}

impl RemovalCause {
    /// In words.
    #[must_use]
    pub const fn text(self) -> &'static str {
        match self {
            Self::LowerX => "through the lower x border of the domain",
            Self::UpperX => "through the upper x border of the domain",
            Self::LowerY => "through the lower y border of the domain",
            Self::UpperY => "through the upper y border of the domain",
            Self::LowerZ => "through the lower z border of the domain",
            Self::UpperZ => "through the upper z border of the domain",
            Self::Asked => "taken out",
            Self::Gate => "through a gate",
            Self::Fate => "deleted at a gate",
        }
    }

    /// The border of `axis` that was crossed.
    #[must_use]
    pub const fn border(axis: usize, upper: bool) -> Self {
        match (axis, upper) {
            (0, false) => Self::LowerX,
            (0, true) => Self::UpperX,
            (1, false) => Self::LowerY,
            (1, true) => Self::UpperY,
            (_, false) => Self::LowerZ,
            (_, true) => Self::UpperZ,
        }
    }
}
