//! The scene: what was asked for, validated and in SI units.
//!
//! [`read`] parses the file into a tree that knows where everything stands (`tree`), reads it key by key (`reader`,
//! `resolve`) and checks what must hold between keys (`rules`). It finds everything that is wrong at once.

pub mod backend;
pub mod diagnostics;
pub(crate) mod extent;
pub mod gate;
pub mod layout;
mod meshes;
pub(crate) mod quantity;
pub(crate) mod reach;
mod read;
pub(crate) mod reader;
mod resolve;
mod rules;
pub(crate) mod schema;
pub(crate) mod tree;

pub use diagnostics::{Finding, Severity};
pub use quantity::quantity_in;
pub use read::{Source, read, read_text};

use crate::dem::feed::{Feed, FeedKind};
use crate::dem::law::LawSettings;
use crate::geometry::part::{AtRest, Part};
use crate::material::MaterialTable;
use crate::math::{Bounds, Vec3};
use crate::particle::{Body, ParticleClass};
use serde::Serialize;
use std::path::PathBuf;

/// A scene: valid by construction ([`read`] is the way to one), SI units throughout.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Scene {
    /// Short name: `title` of the file, else the folder's or file's name.
    pub name: String,
    /// Seed of every random draw.
    pub seed: u64,
    /// Sphere in space, or disc in the plane y = 0.
    pub body: Body,
    /// Gravity [m/s2].
    pub gravity: Vec3,
    /// Particles whose centre is outside of it leave the run.
    pub domain: Domain,
    /// Materials and pairs.
    pub materials: MaterialTable,
    /// Contact laws.
    pub law: LawSettings,
    /// Particle classes.
    pub classes: Vec<ParticleClass>,
    /// Feeds, in the scene's order; a feed's index is its number in particle ids.
    pub feeds: Vec<Feed>,
    /// Parts, in the scene's order.
    pub parts: Vec<Part>,
    /// Time step and the solver's knobs.
    pub solver: SolverSettings,
    /// When the run ends: at the first of these.
    pub end: EndConditions,
    /// What is written.
    pub output: OutputSettings,
    /// What is measured.
    pub measures: Vec<Measure>,
    /// Gates, in the scene's order.
    pub gates: Vec<gate::Gate>,
    /// Stages in the scene's order, or as the gates imply them; none where there is neither gate nor stage.
    pub stages: Vec<gate::StageOutline>,
    /// Who computes stages that do not say it themselves.
    pub backend: backend::BackendName,
    /// What LIGGGHTS is told, where it computes.
    pub liggghts: backend::LiggghtsSettings,
    /// Start from another run's checkpoint instead of an empty scene.
    pub start_checkpoint: Option<PathBuf>,
}

impl Scene {
    /// Whether it has stages. One that only replays stored streams has stages and no gate.
    #[must_use]
    pub const fn is_cut(&self) -> bool {
        !(self.gates.is_empty() && self.stages.is_empty())
    }

    /// The largest diameter of any particle that a class or an initial state can bring [m]; 0 without particles.
    #[must_use]
    pub fn largest_diameter(&self) -> f64 {
        let classes = self.classes.iter().map(|class| extent::diameter_range(&class.diameter).1);
        let files = self.feeds.iter().flat_map(|feed| match &feed.kind {
            FeedKind::File { particles } => &particles[..],
            _ => &[],
        });
        classes.chain(files.map(|particle| 2.0 * particle.radius)).fold(0.0, f64::max)
    }
}

/// The domain and its borders.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Domain {
    /// Extent [m].
    pub bounds: Bounds,
    /// Whether x, y, z repeat periodically; else particles leave there.
    pub periodic: [bool; 3],
}

impl Domain {
    /// Periods along x, y, z \[m\]; `None` along open axes.
    #[must_use]
    pub fn periods(&self) -> [Option<f64>; 3] {
        let size = self.bounds.size();
        std::array::from_fn(|axis| self.periodic[axis].then_some(size[axis]))
    }

    /// `place` \[m\] moved by whole periods into the domain; along open axes it stays.
    #[must_use]
    pub fn wrapped(&self, place: &Vec3) -> Vec3 {
        let mut inside = *place;
        for (axis, period) in self.periods().into_iter().enumerate() {
            let (low, high) = (self.bounds.minimum[axis], self.bounds.maximum[axis]);
            if let Some(period) = period.filter(|_| !(low..high).contains(&place[axis])) {
                inside[axis] -= ((place[axis] - low) / period).floor() * period;
                // Rounding may have brought it to the border itself, which belongs to the other side.
                if inside[axis] >= high {
                    inside[axis] = low;
                }
            }
        }
        inside
    }
}

/// The solver's knobs.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct SolverSettings {
    /// Time step [s]; `None` for the plan's choice.
    pub timestep: Option<f64>,
    /// Share of the binding limit that the plan chooses [-].
    pub timestep_fraction: f64,
    /// Neighbour skin [m]; `None` for the plan's choice.
    pub skin: Option<f64>,
    /// Largest overlap the watchdog allows, as a share of the smaller radius [-].
    pub overlap_limit: f64,
    /// Speed at which particles are expected to hit something [m/s]; `None` for the plan's estimate.
    pub impact_speed: Option<f64>,
    /// When resting particles fall asleep; `None` where they never do.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub sleeping: Option<Sleeping>,
    /// Models forced on or off by name.
    pub forced_models: Vec<(String, bool)>,
}

/// When resting particles fall asleep.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Sleeping {
    /// Speed below which a particle may fall asleep [m/s].
    pub speed: f64,
    /// How long it must have been slow and balanced [s].
    pub hold: f64,
    /// Unbalanced force over the weight at which a sleeper wakes [-].
    pub unbalanced: f64,
}

/// When a run ends; `time` is always there.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct EndConditions {
    /// Plant time [s].
    pub time: f64,
    /// Once at rest.
    pub at_rest: Option<AtRest>,
    /// Once no particle is left (and all feeds have finished).
    pub empty: bool,
    /// Once so many particles have left the domain.
    pub left_count: Option<u64>,
}

/// What is written while a run goes on. Intervals in plant time [s].
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct OutputSettings {
    /// Particle frames; `None` for the first and last state only.
    pub frame_interval: Option<f64>,
    /// VTP frames and moved parts in one PVD.
    pub vtp: bool,
    /// LAMMPS text dump.
    pub lammps: bool,
    /// Contacts as lines in every VTP frame.
    pub contacts: bool,
    /// Rows of `series.csv`.
    pub series_interval: f64,
    /// Energy budget columns.
    pub energy: bool,
    /// Checkpoints; `None` for none but the last state.
    pub checkpoint_interval: Option<f64>,
}

/// A measure of the scene.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Measure {
    /// Name: its key in `summary.json`.
    pub name: String,
    /// What is measured.
    pub kind: MeasureKind,
}

/// Kinds of measures.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub enum MeasureKind {
    /// Angle of the free surface of the final state against the horizontal, seen along `across`.
    AngleOfRepose {
        /// Particles whose centres lie in here belong to the heap.
        region: Bounds,
        /// Horizontal axis along which the surface falls or rises (0 = x, 1 = y).
        along: usize,
    },
    /// Mass flow rate through a plane from the series of mass beyond it.
    MassFlowRate {
        /// A point of the plane [m].
        point: Vec3,
        /// Unit normal along the flow [-].
        normal: Vec3,
    },
    /// Mean contacts per particle, final state.
    CoordinationNumber {
        /// Particles whose centres lie in here.
        region: Bounds,
    },
    /// Share of the region's volume that is solid, final state.
    SolidFraction {
        /// The region.
        region: Bounds,
    },
    /// Centre of mass, final state.
    CentreOfMass {
        /// Particles whose centres lie in here.
        region: Bounds,
    },
    /// d10, d50, d90 by mass and number, final state.
    SizeDistribution {
        /// Particles whose centres lie in here.
        region: Bounds,
    },
}
