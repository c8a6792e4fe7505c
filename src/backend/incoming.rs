//! Streams that enter a stage, whoever computes it: how they are read, and how what arrived is accounted for.

use super::BackendError;
use super::stage::ReplayOrder;
use crate::gate::Cadence;
use crate::gate::crossing::Crossing;
use crate::gate::ledger::{ArrivalBook, ArrivalReport, Exception};
use crate::gate::quality::{OverlapFigures, Quality, judge};
use crate::gate::record::RecordTally;
use crate::gate::replay::{CrossingSource, ReplayStage, Replayer, StreamFacts};
use crate::gate::stream::format::Manifest;
use crate::gate::stream::reader::StreamReader;
use crate::gate::stream::transform::Placement;
use crate::particle::{Body, ParticleId, ParticleState};
use crate::scene::Scene;
use crate::scene::gate::PathMode;
use crate::storage::StorageError;
use std::cell::Cell;

/// Who computes a stage, and in which steps.
#[derive(Debug, Clone, Copy)]
pub struct Solver {
    /// Its name, as streams have it.
    pub backend: &'static str,
    /// Time step [s].
    pub timestep: f64,
    /// When it looks at its gates.
    pub cadence: Cadence,
}

/// Opens a stream and its replayer at the stage's first state.
///
/// # Errors
/// When the stream cannot be read, or is not made for this replay.
pub fn open(scene: &Scene, order: &ReplayOrder, solver: Solver) -> Result<(Manifest, Replayer), StorageError> {
    let reader = StreamReader::open(&order.stream)?;
    let manifest = reader.manifest().clone();
    let stage = ReplayStage {
        timestep: solver.timestep,
        gravity: scene.gravity,
        body: scene.body,
        cadence: solver.cadence,
        feed_offset: order.feed_offset,
        largest_diameter: scene.largest_diameter(),
        start_step: 0,
        transform: |transform, crossing| {
            if transform.is_identity() { crossing } else { Placement::from(transform).crossing(&crossing) }
        },
    };
    let materials = manifest.material_numbers(&scene.materials);
    let source = StoredStream { reader, materials };
    let replayer = Replayer::new(Box::new(source), facts(&manifest, solver.backend), &order.replay, stage)?;
    Ok((manifest, replayer))
}

/// A stored stream with the scene's numbers of materials.
#[derive(Debug)]
struct StoredStream {
    reader: StreamReader,
    materials: Vec<Option<u16>>,
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

fn facts(manifest: &Manifest, backend: &str) -> StreamFacts {
    let origin = &manifest.origin;
    let range = manifest.counts.range;
    StreamFacts {
        plane: origin.plane,
        passage: origin.passage,
        timestep: origin.timestep,
        every: origin.paths.map(|paths| paths.every),
        first_passage: range.map_or(0.0, |range| range.first_time),
        last_passage: range.map_or(0.0, |range| range.last_time),
        same_backend: origin.backend == backend && origin.provenance.is_empty(),
        chunks: manifest.chunks.iter().map(|chunk| (chunk.range.first_step, chunk.range.last_step)).collect(),
        namespace: origin.feeds.len() as u32,
    }
}

/// Compares what arrived with what the stream holds; `finished` where no ghost was on its way at the end.
///
/// # Errors
/// When the stream cannot be read.
pub fn account(
    order: &ReplayOrder,
    book: ArrivalBook,
    finished: bool,
    body: Body,
) -> Result<ArrivalReport, BackendError> {
    let reader = StreamReader::open(&order.stream)?;
    let namespace = reader.manifest().origin.feeds.len() as u32;
    let placement = Placement::from(&order.replay.transform);
    let [from, until] = order.replay.window;
    let excuse = |time: f64| match () {
        () if time < from || time > until => Some(Exception::OutsideWindow),
        () if !finished => Some(Exception::OnItsWay),
        () => None,
    };
    let damage = &Cell::new(None);
    let recorded = (0..order.replay.loops.max(1)).flat_map(|turn| {
        let offset = order.feed_offset + turn as u32 * namespace;
        reader.crossings().map_while(move |crossing| match crossing {
            Ok(Crossing { state, passage, .. }) => {
                let id = ParticleId::new(state.id.feed() + offset, state.id.serial());
                Some((ParticleState { id, ..placement.state(&state) }, excuse(passage.time)))
            }
            Err(error) => {
                damage.set(Some(error));
                None
            }
        })
    });
    let arrivals = book.close(recorded, body);
    damage.take().map_or(Ok(arrivals), |error| Err(error.into()))
}

/// How the cut is judged, where the stream tells what came through it.
#[must_use]
pub fn judged(manifest: &Manifest, overlaps: Option<OverlapFigures>, path: PathMode) -> Option<Quality> {
    let figures = |name: &str| manifest.quality.get(name).cloned();
    let tally: RecordTally = serde_json::from_value(figures("recorded")?).ok()?;
    let crossings = serde_json::from_value(figures("crossings")?).ok()?;
    let exclusion = manifest.origin.exclusion?;
    Some(judge(crossings, &tally, overlaps, exclusion.mode, path))
}
