//! LIGGGHTS as a backend: a stage becomes a deck with everything it reads, Debian's binary runs it, and what it wrote becomes the
//! stage's result.
//!
//! All gate logic is that of [`crate::gate`]: crossings are found by the same recorder in samples every M time steps, ghosts are
//! timed by the same replayer. What LIGGGHTS does is to move the particles.

mod capability;
mod collect;
pub mod deck;
mod drain;
mod explain;
pub mod feeds;
pub mod launch;
pub mod parameters;
pub mod probe;
mod processes;
pub mod record;
pub mod replay;
mod run;
pub mod screen;
mod series;
pub mod tags;
mod watch;

use crate::backend::BackendError;
use crate::gate::Cadence;
use crate::scene::backend::LiggghtsSettings;
use crate::storage::StorageError;
pub use capability::{refusals, verdict};
pub use run::{Rendered, render, run};
use serde_json::{Value, json};

/// Name of the backend in summaries.
pub const NAME: &str = "liggghts";
/// Counts changes of decks that may change a number of a result: part of every key.
pub const NUMERICS_VERSION: u32 = 3;

/// Columns of every particle dump of a deck, in this order.
///
/// Forces are those of the time step with gravity, as LIGGGHTS keeps them.
pub const COLUMNS: &str = "id type radius density x y z vx vy vz omegax omegay omegaz fx fy fz tqx tqy tqz";

/// What belongs into the key of a stage that LIGGGHTS computes: its version, and what it is told that may change a number or what
/// is recorded.
///
/// # Errors
/// When LIGGGHTS is missing, or a template of the user's own cannot be read.
pub fn key_content(settings: &LiggghtsSettings) -> Result<Value, BackendError> {
    let mut templates = Vec::new();
    if let Some(folder) = &settings.templates {
        for name in deck::template::Templates::names() {
            let path = folder.join(name);
            if path.exists() {
                let bytes = std::fs::read(&path).map_err(|source| StorageError::system("read", &path, source))?;
                templates.push(json!([name, blake3::hash(&bytes).to_hex().as_str()]));
            }
        }
    }
    Ok(json!({
        "version": probe::probe()?.version,
        "sample_every": settings.sample_every,
        "batch_every": settings.batch_every,
        "contacts": settings.contacts,
        "ranks": settings.ranks,
        "processors": settings.processors,
        "skin": settings.skin,
        "lines": settings.lines.iter().map(|(place, lines)| json!([place.text(), lines])).collect::<Vec<_>>(),
        "templates": templates,
    }))
}

/// When things happen in a case.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Schedule {
    /// Time step [s].
    pub timestep: f64,
    /// M and K: samples at multiples of `look`, insertions and removals at multiples of `hand_over`, which is one of `look`.
    pub cadence: Cadence,
    /// Time steps of the whole stage, a multiple of K.
    pub steps: u64,
}

impl Schedule {
    /// The first batch at or after plant time `time` [s], as a time step.
    #[must_use]
    pub fn batch_at(&self, time: f64) -> u64 {
        let step = (time / self.timestep - 1e-6).ceil().max(0.0) as u64;
        step.next_multiple_of(self.cadence.hand_over)
    }

    /// Plant time of a time step [s].
    #[must_use]
    pub fn time(&self, step: u64) -> f64 {
        step as f64 * self.timestep
    }
}

/// A number as it stands in a deck: the shortest text that reads back to the same bits.
#[must_use]
pub fn deck_number(value: f64) -> String {
    if value == 0.0 || (1e-4..1e15).contains(&value.abs()) { format!("{value}") } else { format!("{value:e}") }
}

/// Names of files and folders in a case.
pub mod files {
    /// The deck.
    pub const DECK: &str = "in.liggghts";
    /// Meshes of the parts, `NAME.stl`.
    pub const MESHES: &str = "meshes";
    /// What enters at a batch: `STEP.in`, which is included there, and `STEP.data`; none where nothing enters, but for `0.in`.
    pub const BATCHES: &str = "batches";
    /// Time steps of the batches at which anything enters, in their folder.
    pub const ENTERING: &str = "entering";
    /// Ghosts on recorded paths, as atomfile variables px py pz qx qy qz wx wy wz, and `release`: one section a sample, from step 0.
    pub const PATHS: &str = "paths";
    /// Samples at the gates, `GATE/STEP.bin`, with [`super::COLUMNS`].
    pub const SAMPLES: &str = "samples";
    /// Contacts at the gates, `GATE.pairs` and `GATE.walls`, text dumps of local computes.
    pub const CONTACTS: &str = "contacts";
    /// States of ghosts when they became ordinary particles, a text dump.
    pub const ARRIVALS: &str = "arrivals.dump";
    /// Particles that were taken out, `GATE.dump` and `domain.dump`, text dumps with [`super::COLUMNS`].
    pub const REMOVED: &str = "removed";
    /// Frames, `STEP.bin`, with [`super::COLUMNS`]; that of the last time step is always there.
    pub const FRAMES: &str = "frames";
    /// Rows of what is recorded in time.
    pub const SERIES: &str = "series.txt";
    /// LIGGGHTS' own log.
    pub const LOG: &str = "log.liggghts";
    /// What it printed.
    pub const SCREEN: &str = "screen.txt";
    /// Its numbers of particles against ours.
    pub const TAGS: &str = "tags.csv";
}

/// Groups of particles in a deck.
pub mod groups {
    /// Ordinary particles.
    pub const ACTIVE: &str = "active";
    /// Ghosts at constant velocity: `fix nve/noforce`.
    pub const CONSTANT: &str = "ghost_constant";
    /// Ghosts in free fall: `fix nve` without forces but gravity.
    pub const BALLISTIC: &str = "ghost_ballistic";
    /// Ghosts on recorded paths: `fix nve/noforce`, set at every sample.
    pub const RECORDED: &str = "ghost_recorded";
    /// Ghosts that become ordinary particles at this sample.
    pub const RELEASED: &str = "released";
}
