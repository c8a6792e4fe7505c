//! A stream on disk, as a replayer in a scene of the native solver reads it.

use crate::backend::native::NAME;
use crate::gate::crossing::Crossing;
use crate::gate::replay::{CrossingSource, StreamFacts};
use crate::gate::stream::format::Manifest;
use crate::gate::stream::reader::StreamReader;
use crate::storage::StorageError;

/// A stored stream with the scene's numbers of materials.
#[derive(Debug)]
pub struct StoredStream {
    pub reader: StreamReader,
    /// For each material of the stream its number here.
    pub materials: Vec<Option<u16>>,
}

impl CrossingSource for StoredStream {
    fn chunk_count(&self) -> usize {
        self.reader.chunk_count()
    }

    fn chunk(&mut self, index: usize) -> Result<Vec<Crossing>, StorageError> {
        let mut crossings = self.reader.chunk(index)?;
        for crossing in &mut crossings {
            let own = self.materials.get(usize::from(crossing.state.material)).copied().flatten();
            crossing.state.material = own.ok_or_else(|| {
                StorageError::unusable(self.reader.place(), "it has particles of a material that the scene lacks")
            })?;
        }
        Ok(crossings)
    }
}

/// What a replayer must know of a stream before it reads it.
pub fn facts(manifest: &Manifest) -> StreamFacts {
    let origin = &manifest.origin;
    let range = manifest.counts.range;
    StreamFacts {
        plane: origin.plane,
        passage: origin.passage,
        timestep: origin.timestep,
        every: origin.paths.map(|paths| paths.every),
        first_passage: range.map_or(0.0, |range| range.first_time),
        last_passage: range.map_or(0.0, |range| range.last_time),
        native: origin.backend == NAME && origin.provenance.is_empty(),
        chunks: manifest.chunks.iter().map(|chunk| (chunk.range.first_step, chunk.range.last_step)).collect(),
        namespace: origin.feeds.len() as u32,
    }
}

/// Largest overlap over the radius at the crossings of a stream [-]; 0 where it does not say.
pub fn largest_overlap(manifest: &Manifest) -> f64 {
    manifest.quality["crossings"]["largest_overlap_share"].as_f64().unwrap_or(0.0)
}
