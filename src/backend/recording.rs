//! What every backend does alike when it records a gate.

use super::BackendError;
use super::native::feed_numbers;
use super::stage::{RecordResult, StageRequest};
use crate::gate::Cadence;
use crate::gate::quality::CrossingStatistics;
use crate::gate::record::{RecordTally, Recorder, Role, stored_paths};
use crate::gate::stream::format;
use crate::gate::stream::format::{Origin, StoredEvent};
use crate::gate::stream::writer::{Closing, StreamWriter};
use crate::scene::Scene;
use crate::scene::gate::Gate;
use crate::stage::split::Recording;
use crate::storage::StorageError;
use serde_json::json;
use std::fs;
use std::path::{Path, PathBuf};

/// Paths are stored from so many largest diameters farther upstream than asked for: a ghost enters up to a hand-over before it
/// reaches the generation plane.
const ENTRY_MARGIN: f64 = 0.25;
/// Speed at a gate over sqrt(g d) that this margin allows for where hand-overs lie many time steps apart: an allowance for dense
/// flow through an outlet of a few diameters; who is faster enters on a shorter path.
const ENTRY_SPEED: f64 = 3.0;

/// Who computes what is recorded.
#[derive(Debug, Clone, Copy)]
pub struct Computed<'a> {
    /// Name of the backend.
    pub backend: &'a str,
    /// Its version.
    pub version: &'a str,
    /// Version of what changes its numbers.
    pub numerics_version: u32,
    /// Time step [s].
    pub timestep: f64,
    /// When it looks at its gates.
    pub cadence: Cadence,
    /// Whether contacts are recorded.
    pub contacts: bool,
    /// Contact laws in words, and what their memories mean.
    pub laws: &'a str,
}

/// What is known of a stream before its first crossing.
///
/// # Errors
/// When the scene's start checkpoint cannot be read.
pub fn origin(
    scene: &Scene,
    order: &Recording,
    request: &StageRequest,
    computed: &Computed,
) -> Result<Origin, StorageError> {
    let gate = &order.gate;
    Ok(Origin {
        gate: gate.name.clone(),
        plane: gate.plane,
        passage: gate.passage,
        gravity: scene.gravity,
        exclusion: (!order.observes).then_some(gate.exclusion),
        paths: stored_paths(gate.paths, computed.cadence),
        role: if order.observes { format::Role::Observed } else { format::Role::HandOver },
        stage: request.stage.to_owned(),
        stage_key: request.key.to_owned(),
        backend: computed.backend.to_owned(),
        backend_version: computed.version.to_owned(),
        numerics_version: computed.numerics_version,
        timestep: computed.timestep,
        materials: scene.materials.materials.clone(),
        contacts: computed.contacts,
        part_names: scene.parts.iter().map(|part| part.name.clone()).collect(),
        body: scene.body,
        feeds: feed_names(scene, request)?,
        laws: computed.laws.to_owned(),
        provenance: Vec::new(),
    })
}

/// Names of feeds by number; those that particles of replayed streams have beyond the scene's own bear the stream's name.
fn feed_names(scene: &Scene, request: &StageRequest) -> Result<Vec<String>, StorageError> {
    let mut names: Vec<String> = scene.feeds.iter().map(|feed| feed.name.clone()).collect();
    let own = feed_numbers(scene)? as usize;
    (names.len()..own).for_each(|number| names.push(format!("start {number}")));
    for order in request.replays {
        let end = (order.feed_offset + order.feed_numbers) as usize;
        (names.len()..end).for_each(|number| names.push(format!("{} {number}", order.name)));
    }
    Ok(names)
}

/// A recorder of `order`, which follows paths a little longer than they are asked for.
#[must_use]
pub fn recorder(scene: &Scene, order: &Recording, timestep: f64, cadence: Cadence) -> Recorder {
    let role = if order.observes { Role::Observe } else { Role::HandOver };
    let largest = scene.largest_diameter();
    let periods = scene.domain.periods();
    let mut watched = order.gate.clone();
    watched.plane = watched.plane.over_borders(&periods);
    if let Some(paths) = &mut watched.paths {
        paths.length += ENTRY_MARGIN * largest;
        if cadence.look > 1 {
            let speed = ENTRY_SPEED * (scene.gravity.norm() * largest).sqrt();
            paths.length += speed * timestep * cadence.hand_over as f64;
        }
    }
    Recorder::new(&watched, role, scene.gravity, timestep, largest, cadence).with_periods(periods)
}

/// Figures of the crossings of `gate`. The generation zone is the replay's; the path's length, or else that of the exclusion
/// zone, stands for it.
#[must_use]
pub fn statistics(scene: &Scene, gate: &Gate) -> CrossingStatistics {
    let length = gate.paths.map_or(gate.exclusion.length, |paths| paths.length);
    CrossingStatistics::new(gate.plane.normal, &scene.gravity, scene.body, length)
}

/// Folder of the stream of `gate`.
#[must_use]
pub fn stream_place(request: &StageRequest, gate: &Gate) -> PathBuf {
    request.folder.join("streams").join(&gate.name)
}

/// Starts a stream at `place`; what a run into this folder left there that was killed before it could say that it was done is
/// removed.
///
/// # Errors
/// When the disk refuses.
pub fn start_stream(place: &Path, origin: Origin) -> Result<StreamWriter, StorageError> {
    if place.exists() {
        fs::remove_dir_all(place).map_err(|source| StorageError::system("remove", place, source))?;
    }
    StreamWriter::create(place, origin)
}

/// Closes the stream of a run that came to its end; an interrupted one goes on later.
///
/// # Errors
/// When the disk refuses.
pub fn close(
    order: Recording,
    tally: RecordTally,
    statistics: &CrossingStatistics,
    writer: StreamWriter,
    events: Vec<StoredEvent>,
    ended: bool,
) -> Result<RecordResult, BackendError> {
    let crossings = statistics.figures();
    let quality = json!({"recorded": tally, "crossings": crossings, "free_flow": tally.free_flow});
    let manifest = if ended { Some(writer.finish(Closing { events, quality })?) } else { None };
    Ok(RecordResult { gate: order.gate, observed: order.observes, tally, crossings, manifest })
}
