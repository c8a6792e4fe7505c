//! Who computes a stage, and what the external codes are told.

use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::path::PathBuf;

/// A backend by name.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Default, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum BackendName {
    /// Our own solver.
    #[default]
    Native,
    /// LIGGGHTS, Debian's package.
    Liggghts,
}

impl BackendName {
    /// Every backend.
    pub const ALL: [Self; 2] = [Self::Native, Self::Liggghts];

    /// As it is written.
    #[must_use]
    pub const fn text(self) -> &'static str {
        match self {
            Self::Native => "native",
            Self::Liggghts => "liggghts",
        }
    }
}

/// What LIGGGHTS is told beside the scene: `[liggghts]`.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct LiggghtsSettings {
    /// M: time steps between two looks at the gates.
    pub sample_every: u64,
    /// K: time steps between two insertions or removals, and between two looks at what waits for rest; a multiple of M.
    pub batch_every: u64,
    /// Whether the contacts of crossings are recorded.
    pub contacts: bool,
    /// MPI ranks.
    pub ranks: u32,
    /// Ranks along x, y, z; `None` for a choice by the shape of the domain.
    pub processors: Option<[u32; 3]>,
    /// Neighbour skin [m]; `None` for the plan's choice.
    pub skin: Option<f64>,
    /// Raw lines of the user's own for the deck, by place.
    pub lines: BTreeMap<DeckPlace, Vec<String>>,
    /// Folder with templates that replace ours, file by file.
    pub templates: Option<PathBuf>,
    /// Options handed on to mpirun.
    pub mpirun: Vec<String>,
    /// Wall time after which a stage is stopped [s]; infinite for none.
    pub time_limit: f64,
    /// Keep what was sampled at the gates after it has been read.
    pub keep_samples: bool,
}

impl Default for LiggghtsSettings {
    fn default() -> Self {
        Self {
            sample_every: 20,
            batch_every: 100,
            contacts: true,
            ranks: 1,
            processors: None,
            skin: None,
            lines: BTreeMap::new(),
            templates: None,
            mpirun: Vec::new(),
            time_limit: f64::INFINITY,
            keep_samples: false,
        }
    }
}

/// Where a user's own lines go in a deck.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum DeckPlace {
    /// After the system: units, boundaries, neighbour lists.
    AfterSystem,
    /// After materials and pair style.
    AfterMaterials,
    /// After the walls.
    AfterWalls,
    /// After integration and gravity.
    AfterIntegration,
    /// Before the first time step.
    BeforeRun,
    /// After the last time step.
    AfterRun,
}

impl DeckPlace {
    /// Every place.
    pub const ALL: [Self; 6] = [
        Self::AfterSystem,
        Self::AfterMaterials,
        Self::AfterWalls,
        Self::AfterIntegration,
        Self::BeforeRun,
        Self::AfterRun,
    ];

    /// Its key in the scene.
    #[must_use]
    pub const fn text(self) -> &'static str {
        match self {
            Self::AfterSystem => "after_system",
            Self::AfterMaterials => "after_materials",
            Self::AfterWalls => "after_walls",
            Self::AfterIntegration => "after_integration",
            Self::BeforeRun => "before_run",
            Self::AfterRun => "after_run",
        }
    }
}
