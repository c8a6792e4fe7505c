//! Streams on their way from stage to stage: where they lie, whether they fit, what identifies them.

use super::stage::StageOutcome;
use super::{RunError, stage_folder};
use crate::backend::native::ReplayOrder;
use crate::gate::stream::format::{Expected, Manifest};
use crate::gate::stream::reader::StreamReader;
use crate::scene::Scene;
use crate::scene::gate::StreamSource;
use crate::stage::split::StageJob;
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
}

impl StreamInput {
    /// What happened to parts upstream: name, whether it is there from then on, plant time [s].
    pub fn events(&self) -> Vec<(String, bool, f64)> {
        self.manifest.events.iter().map(|event| (event.part.clone(), event.present, event.time)).collect()
    }
}

/// Where a stage stores what it records at a gate.
pub fn stream_folder(stage: &Path, gate: &str) -> PathBuf {
    stage.join("streams").join(gate)
}

/// The streams that enter stage number `index`.
///
/// # Errors
/// When one is missing, damaged, or does not fit the scene.
pub fn inputs(
    scene: &Scene,
    jobs: &[StageJob],
    index: usize,
    outcomes: &[Option<StageOutcome>],
    out: &Path,
    accept: bool,
) -> Result<Vec<StreamInput>, RunError> {
    let job = &jobs[index];
    let mut inputs = Vec::new();
    for replay in &job.replays {
        let (name, place, expected_plane) = match &replay.source {
            StreamSource::Gate(gate) => {
                let gate = &scene.gates[*gate];
                let source =
                    jobs.iter().position(|other| other.records.iter().any(|record| record.gate.name == gate.name));
                let source =
                    source.ok_or_else(|| RunError::Stream(format!("no stage records gate '{}'", gate.name)))?;
                let stage = outcomes.get(source).and_then(Option::as_ref).map(|outcome| outcome.folder.clone());
                let stage = stage.unwrap_or_else(|| stage_folder(out, &jobs[source].name));
                let place = stream_folder(&stage, &gate.name);
                if !place.exists() {
                    return Err(RunError::Stream(format!(
                        "stage '{}' needs the stream of gate '{}', which is not there ({}); run stage '{}' first, or leave --stage out",
                        job.name,
                        gate.name,
                        place.display(),
                        jobs[source].name
                    )));
                }
                (gate.name.clone(), place, Some(&gate.plane))
            }
            StreamSource::Folder(folder) => {
                let name =
                    folder.file_name().map_or_else(|| "stream".to_owned(), |name| name.to_string_lossy().into_owned());
                (name, folder.clone(), None)
            }
        };
        let reader = StreamReader::open(&place).map_err(|error| RunError::Stream(error.to_string()))?;
        let expected = Expected {
            materials: &scene.materials,
            body: scene.body,
            gravity: scene.gravity,
            plane: expected_plane,
            stage_key: None,
        };
        let manifest = reader.manifest().clone();
        let misfits = manifest.misfits(&expected);
        if !misfits.is_empty() && !accept {
            return Err(RunError::Stream(format!(
                "the stream {} does not fit the scene:\n  {}\nrecord it again, or use it as it is with --accept-stream",
                place.display(),
                misfits.join("\n  ")
            )));
        }
        inputs.push(StreamInput { name, digest: manifest.digest(), place, manifest, misfits });
    }
    Ok(inputs)
}

/// The order to replay each stream of a stage, with identities that do not meet.
pub fn replays(job: &StageJob, inputs: &[StreamInput]) -> Vec<ReplayOrder> {
    let own = job.scene.feeds.len() as u32;
    let mut next = own;
    let mut used: Vec<&StreamSource> = Vec::new();
    job.replays
        .iter()
        .zip(inputs)
        .map(|(replay, input)| {
            let width =
                input.manifest.origin.feeds.len() as u32 * u32::try_from(replay.loops).unwrap_or(u32::MAX).max(1);
            // A stream of this scene keeps its identities, unless it comes a second time.
            let keeps = matches!(replay.source, StreamSource::Gate(_)) && !used.contains(&&replay.source);
            let feed_offset = if keeps { 0 } else { next };
            used.push(&replay.source);
            next = next.max(feed_offset + width);
            ReplayOrder {
                name: input.name.clone(),
                replay: replay.clone(),
                stream: input.place.clone(),
                feed_offset,
                feed_numbers: width,
            }
        })
        .collect()
}
