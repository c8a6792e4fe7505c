//! Streams on their way from stage to stage: where they lie, whether they fit, what identifies them.

use super::RunError;
use crate::backend::native;
use crate::backend::stage::ReplayOrder;
use crate::gate::stream::format::{Expected, Manifest};
use crate::gate::stream::reader::StreamReader;
use crate::scene::Scene;
use crate::scene::gate::{Replay, StreamSource};
use crate::stage::split::StageJob;
use crate::storage::StorageError;
use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

/// A stream that enters a stage.
#[derive(Debug, Clone)]
pub struct StreamInput {
    /// Its name: the gate's, or the folder's.
    pub name: String,
    /// Where it lies.
    pub place: PathBuf,
    /// Digest of its content.
    pub digest: String,
    /// Its manifest.
    pub manifest: Manifest,
    /// What of it does not fit, and was accepted.
    pub misfits: Vec<String>,
    /// Where its particles come from; `None` for a stored stream.
    pub descent: Option<Descent>,
}

/// Through which gates the particles of a gate's stream have come.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Descent {
    /// The gate, as an index into the scene's.
    gate: usize,
    /// The job that records it.
    recorder: usize,
    /// This gate and all those upstream whose streams are replayed on the way to it.
    gates: BTreeSet<usize>,
}

impl Descent {
    fn of(scene: &Scene, jobs: &[StageJob], gate: usize) -> Option<Self> {
        let recorder = recorder_of(scene, jobs, gate)?;
        let mut gates = BTreeSet::from([gate]);
        for replay in &jobs[recorder].replays {
            if let StreamSource::Gate(upstream) = replay.source {
                gates.extend(Self::of(scene, jobs, upstream)?.gates);
            }
        }
        Some(Self { gate, recorder, gates })
    }

    /// Whether one particle can be in both streams: they are the same, or have come through the same gate into different stages.
    fn meets(&self, other: &Self) -> bool {
        self.gate == other.gate || (self.recorder != other.recorder && !self.gates.is_disjoint(&other.gates))
    }
}

impl StreamInput {
    /// What happened to parts upstream: name, whether it is there from then on, plant time [s].
    pub fn events(&self) -> Vec<(String, bool, f64)> {
        self.manifest.events.iter().map(|event| (event.part.clone(), event.present, event.time)).collect()
    }
}

/// The job that records gate number `gate`.
pub fn recorder_of(scene: &Scene, jobs: &[StageJob], gate: usize) -> Option<usize> {
    let name = &scene.gates[gate].name;
    jobs.iter().position(|job| job.records.iter().any(|record| record.gate.name == *name))
}

/// Where a stage stores what it records at a gate.
pub fn stream_folder(stage: &Path, gate: &str) -> PathBuf {
    stage.join("streams").join(gate)
}

/// The streams that enter stage number `index`; `places` are the folders of all stages' results.
///
/// # Errors
/// When one is missing, damaged, or does not fit the scene.
pub fn inputs(
    scene: &Scene,
    jobs: &[StageJob],
    index: usize,
    places: &[PathBuf],
    accept: bool,
) -> Result<Vec<StreamInput>, RunError> {
    let input = |replay: &Replay| {
        let (name, place, plane, descent) = match &replay.source {
            StreamSource::Gate(gate) => {
                let descent = Descent::of(scene, jobs, *gate);
                let descent = descent
                    .ok_or_else(|| RunError::Stream(format!("no stage records gate '{}'", scene.gates[*gate].name)))?;
                let (recorder, name) = (descent.recorder, &scene.gates[*gate].name);
                let place = recorded(&jobs[index], &jobs[recorder], name, &places[recorder])?;
                (scene.gates[*gate].name.clone(), place, Some(&scene.gates[*gate].plane), Some(descent))
            }
            StreamSource::Folder(folder) => {
                let name = folder.file_name().map_or("stream".into(), |name| name.to_string_lossy());
                (name.into_owned(), folder.clone(), None, None)
            }
        };
        let manifest =
            StreamReader::open(&place).map_err(|error| RunError::Stream(error.to_string()))?.manifest().clone();
        let expected =
            Expected { materials: &scene.materials, body: scene.body, gravity: scene.gravity, plane, stage_key: None };
        let misfits = manifest.misfits(&expected);
        if !misfits.is_empty() && !accept {
            return Err(RunError::Stream(format!(
                "the stream {} does not fit the scene:\n  {}\nrecord it again, or use it as it is with --accept-stream",
                place.display(),
                misfits.join("\n  ")
            )));
        }
        Ok(StreamInput { name, digest: manifest.digest(), place, manifest, misfits, descent })
    };
    jobs[index].replays.iter().map(input).collect()
}

/// Where the stage `recorder`, whose results are in `folder`, has stored what passes `gate`, for the stage `asking`.
fn recorded(asking: &StageJob, recorder: &StageJob, gate: &str, folder: &Path) -> Result<PathBuf, RunError> {
    let place = stream_folder(folder, gate);
    if place.exists() {
        return Ok(place);
    }
    Err(RunError::Stream(format!(
        "stage '{}' needs the stream of gate '{gate}', which is not there ({}); run stage '{}' first, or leave --stage out",
        asking.name,
        place.display(),
        recorder.name
    )))
}

/// The order to replay each stream of a stage, with identities that do not meet.
///
/// # Errors
/// When a checkpoint to start from cannot be read.
pub fn replays(job: &StageJob, inputs: &[StreamInput]) -> Result<Vec<ReplayOrder>, StorageError> {
    let own = native::feed_numbers(&job.scene)?;
    let mut next = own;
    let mut used: Vec<&Descent> = Vec::new();
    let orders = job
        .replays
        .iter()
        .zip(inputs)
        .map(|(replay, input)| {
            let width =
                input.manifest.origin.feeds.len() as u32 * u32::try_from(replay.loops).unwrap_or(u32::MAX).max(1);
            // A stream of this scene keeps its identities, unless they are taken: by the same particles on another way, or by
            // loops and stored streams, whose identities lie beyond those of the scene's feeds.
            let is_free = |own: &Descent| used.iter().all(|other| !own.meets(other));
            let keeps = input.descent.as_ref().is_some_and(is_free) && (width <= own || next == own);
            let feed_offset = if keeps { 0 } else { next };
            used.extend(&input.descent);
            next = next.max(feed_offset + width);
            ReplayOrder {
                name: input.name.clone(),
                replay: replay.clone(),
                stream: input.place.clone(),
                feed_offset,
                feed_numbers: width,
            }
        })
        .collect();
    Ok(orders)
}
