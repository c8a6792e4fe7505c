//! A stage as every backend gets it, and what comes out of it.

use super::{PartEvent, Removal};
use crate::dem::feed::FeedReport;
use crate::gate::ledger::{ArrivalReport, EnergyAccount, MomentumAccount};
use crate::gate::quality::{BackedUp, CrossingFigures, Quality};
use crate::gate::record::RecordTally;
use crate::gate::replay::ReplayTally;
use crate::gate::stream::format::Manifest;
use crate::math::lanes::SimdLevel;
use crate::output::progress::Verbosity;
use crate::output::timing::{ProcessUse, Timing};
use crate::particle::{ParticleId, ParticleState};
use crate::scene::backend::BackendName;
use crate::scene::gate::{Gate, Replay};
use crate::stage::split::Recording;
use std::path::{Path, PathBuf};
use std::sync::atomic::AtomicBool;

/// How a stage is to be run.
#[derive(Debug, Clone, Copy)]
pub struct StageRequest<'a> {
    /// Folder for everything that is written; it exists.
    pub folder: &'a Path,
    /// Identifies scene, choices and version; a checkpoint of another key is refused.
    pub key: &'a str,
    /// Name of the stage.
    pub stage: &'a str,
    /// Continue from the folder's checkpoint, where there is one.
    pub resume: bool,
    /// How much is said.
    pub verbosity: Verbosity,
    /// Set from outside to end the run after the present time step.
    pub interrupted: &'a AtomicBool,
    /// Gates to be recorded.
    pub records: &'a [Recording],
    /// Streams to be replayed.
    pub replays: &'a [ReplayOrder],
    /// A particle is moved at the start.
    pub kick: Option<Kick>,
}

/// Moves one particle at the start, to see how a run answers to next to nothing.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Kick {
    /// How far [m].
    pub length: f64,
    /// Picks particle and direction, together with the scene's seed.
    pub draw: u64,
}

/// Who computed a stage.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Identity {
    /// Which backend.
    pub backend: BackendName,
    /// Its version.
    pub version: String,
    /// Threads or ranks.
    pub threads: u64,
    /// Instruction set of the contact kernels, where it is known.
    pub simd: Option<SimdLevel>,
}

/// What came out of a stage.
#[derive(Debug)]
pub struct StageResult {
    /// Who computed it.
    pub identity: Identity,
    /// Why it ended.
    pub end: EndReason,
    /// Plant time reached [s].
    pub time: f64,
    /// Time steps done since time 0.
    pub steps: u64,
    /// Whether each part is there at the end.
    pub present: Vec<bool>,
    /// Final particles, by ascending identity.
    pub particles: Vec<ParticleState>,
    /// Final pairs of particles in contact.
    pub contacts: Vec<(ParticleId, ParticleId)>,
    /// Final contacts with parts, one entry a contact.
    pub wall_contacts: Vec<ParticleId>,
    /// What each feed brought.
    pub feeds: Vec<FeedReport>,
    /// Particles that left.
    pub removed: Vec<Removal>,
    /// Parts that appeared or disappeared.
    pub events: Vec<PartEvent>,
    /// What came through the gates.
    pub gates: GateResults,
    /// Wall time of this process on the stage [s], and the time steps that it did.
    pub wall_s: f64,
    /// Time steps that this process did.
    pub own_steps: u64,
    /// Particles times steps of this process.
    pub particle_steps: f64,
    /// What the user should hear of beside the figures.
    pub warnings: Vec<String>,
    /// Wall time by phase.
    pub timing: Timing,
    /// Processor time and memory of this process.
    pub used: ProcessUse,
}

/// Why a run ended.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum EndReason {
    /// Its plant time is over.
    Time,
    /// The particles are at rest.
    AtRest,
    /// No particle is left.
    Empty,
    /// So many particles have left the domain.
    LeftCount,
    /// From outside; it can be resumed.
    Interrupted,
}

impl EndReason {
    /// In words, as `summary.json` has it.
    #[must_use]
    pub const fn text(self) -> &'static str {
        match self {
            Self::Time => "time",
            Self::AtRest => "at rest",
            Self::Empty => "empty",
            Self::LeftCount => "count",
            Self::Interrupted => "interrupted",
        }
    }
}

/// A stream that enters a stage.
#[derive(Debug, Clone, PartialEq)]
pub struct ReplayOrder {
    /// Its name: the gate's, or the folder's.
    pub name: String,
    /// How it is replayed.
    pub replay: Replay,
    /// Where it is stored.
    pub stream: PathBuf,
    /// Added to the feed numbers in its particles' identities.
    pub feed_offset: u32,
    /// How many feed numbers its particles take, from `feed_offset` on.
    pub feed_numbers: u32,
}

/// What came through the gates of a stage.
#[derive(Debug, Clone, Default)]
pub struct GateResults {
    /// Streams recorded.
    pub recorded: Vec<RecordResult>,
    /// Streams replayed.
    pub replayed: Vec<ReplayResult>,
    /// Momentum of the stage's particles, where there is a gate.
    pub momentum: Option<MomentumAccount>,
    /// Energy of the stage's particles, where there is a gate and losses are accounted for.
    pub energy: Option<EnergyAccount>,
}

/// A stream that a stage has recorded.
#[derive(Debug, Clone)]
pub struct RecordResult {
    /// The gate.
    pub gate: Gate,
    /// True where it was only looked at.
    pub observed: bool,
    /// What passed, and what became of it.
    pub tally: RecordTally,
    /// What the crossings were like.
    pub crossings: CrossingFigures,
    /// Manifest of the stream; `None` where the run did not come to its end.
    pub manifest: Option<Manifest>,
}

/// A stream that a stage has replayed.
#[derive(Debug, Clone)]
pub struct ReplayResult {
    /// Its name.
    pub name: String,
    /// How it was replayed.
    pub replay: Replay,
    /// True where particles were released with the stored bits at their own time steps.
    pub exact: bool,
    /// What the replayer counted.
    pub tally: ReplayTally,
    /// What arrived, against what was recorded.
    pub arrivals: ArrivalReport,
    /// How the cut is judged by its figures.
    pub quality: Option<Quality>,
    /// The downstream was found to back up.
    pub backed_up: Option<BackedUp>,
    /// Particles that went back upstream beyond the generation plane.
    pub left_upstream: Option<u64>,
}
