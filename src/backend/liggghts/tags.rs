//! LIGGGHTS' own numbers of particles, 1, 2, 3, ... in the order in which they enter, against ours.

use crate::gate::id_map::IdMap;
use crate::particle::ParticleId;
use crate::storage::{StorageError, staging::write_whole};
use std::fmt::Write;
use std::path::Path;

/// All particles of a case.
#[derive(Debug, Clone, Default)]
pub struct Tags {
    ids: Vec<ParticleId>,
    tags: IdMap<u32>,
}

impl Tags {
    /// The tag of a particle that enters now; LIGGGHTS asks for tags above all that there are.
    ///
    /// # Panics
    /// Beyond 2^31 particles, which LIGGGHTS cannot number.
    pub fn add(&mut self, id: ParticleId) -> u32 {
        self.ids.push(id);
        let tag = i32::try_from(self.ids.len()).expect("fewer than 2^31 particles") as u32;
        self.tags.insert(id, tag);
        tag
    }

    /// The tag of a particle.
    #[must_use]
    pub fn tag(&self, id: ParticleId) -> Option<u32> {
        self.tags.get(&id).copied()
    }

    /// The particle of a tag.
    #[must_use]
    pub fn id(&self, tag: u32) -> Option<ParticleId> {
        self.ids.get((tag as usize).checked_sub(1)?).copied()
    }

    /// All particles in the order of their tags.
    #[must_use]
    pub fn ids(&self) -> &[ParticleId] {
        &self.ids
    }

    /// Writes the table for whoever reads the case by hand.
    ///
    /// # Errors
    /// When it cannot be written.
    pub fn write(&self, path: &Path) -> Result<(), StorageError> {
        let mut text = "tag,feed,serial\n".to_owned();
        for (index, id) in self.ids.iter().enumerate() {
            let _ = writeln!(text, "{},{},{}", index + 1, id.feed(), id.serial());
        }
        write_whole(path, text.as_bytes())
    }
}
