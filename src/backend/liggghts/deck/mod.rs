//! The deck of a stage: one input script for LIGGGHTS, in sections from templates, and the meshes that it reads.

pub mod bounds;
mod events;
mod gates;
mod motion;
pub mod names;
mod output;
pub(super) mod parts;
mod processors;
mod refusals;
mod run;
mod sections;
pub mod template;
mod walls;

pub use super::replay::Ghosts;
pub use bounds::bounds;
pub use output::SERIES;
pub use refusals::refusals;
pub use sections::render;

use super::{Schedule, files};
use crate::backend::BackendError;
use crate::geometry::stl::write_stl_ascii;
use crate::math::Bounds;
use crate::scene::Scene;
use crate::scene::backend::LiggghtsSettings;
use crate::scene::gate::ExclusionMode;
use crate::stage::split::Recording;
use crate::storage::{StorageError, staging::write_whole};
use names::file_name;
use std::path::Path;

/// What a deck is made of.
#[derive(Debug, Clone, Copy)]
pub struct DeckOrder<'a> {
    /// The stage's scene.
    pub scene: &'a Scene,
    /// Name of the stage.
    pub stage: &'a str,
    /// When things happen.
    pub schedule: Schedule,
    /// Neighbour skin [m].
    pub skin: f64,
    /// Gates that are recorded.
    pub records: &'a [Recording],
    /// What replays bring.
    pub ghosts: Ghosts,
    /// Particles that enter by batches.
    pub particles_to_come: u64,
    /// Time step of the last batch at which something enters.
    pub last_entry: u64,
    /// LIGGGHTS' box, of [`bounds()`].
    pub bounds: Bounds,
    /// What the user says of LIGGGHTS.
    pub settings: &'a LiggghtsSettings,
}

impl DeckOrder<'_> {
    /// Ghosts of replays, and those that recorded particles become.
    fn all_ghosts(&self) -> Ghosts {
        let becomes = |mode: ExclusionMode| {
            self.records.iter().any(|recording| !recording.observes && recording.gate.exclusion.mode == mode)
        };
        Ghosts {
            constant: self.ghosts.constant || becomes(ExclusionMode::Constant),
            ballistic: self.ghosts.ballistic || becomes(ExclusionMode::Ballistic),
            recorded: self.ghosts.recorded,
        }
    }

    /// True where contacts are recorded.
    fn records_contacts(&self) -> bool {
        self.settings.contacts && !self.records.is_empty()
    }
}

/// Writes the deck, its meshes, and the folders that LIGGGHTS writes into.
///
/// # Errors
/// Where LIGGGHTS cannot do what the scene asks for, a template of the user's own is wrong, or the disk refuses.
pub fn write(order: &DeckOrder<'_>, case: &Path) -> Result<(), BackendError> {
    let refused = refusals(order.scene, order.records);
    if !refused.is_empty() {
        return Err(BackendError::Incapable(refused.join("\n")));
    }
    let text = render(order).map_err(BackendError::Incapable)?;
    let samples =
        order.records.iter().map(|recording| format!("{}/{}", files::SAMPLES, file_name(&recording.gate.name)));
    let others = [files::FRAMES, files::REMOVED, files::CONTACTS, files::BATCHES, files::MESHES].map(str::to_owned);
    for folder in samples.chain(others) {
        let path = case.join(folder);
        std::fs::create_dir_all(&path).map_err(|source| StorageError::system("create", &path, source))?;
    }
    for wall in parts::walls(order.scene, &order.schedule, !order.records_contacts()) {
        if let Some(mesh) = wall.mesh() {
            let path = case.join(files::MESHES).join(wall.file());
            let mut bytes = Vec::new();
            write_stl_ascii(mesh, &file_name(&wall.part.name), &mut bytes)
                .map_err(|source| StorageError::system("write", &path, source))?;
            write_whole(&path, &bytes)?;
        }
    }
    Ok(write_whole(&case.join(files::DECK), text.as_bytes())?)
}
