//! What passed the gates of a run, from the streams in its result folder.

use crate::analysis::compare::GateRecord;
use crate::gate::stream::reader::StreamReader;
use crate::output::summary::Summary;
use crate::storage::StorageError;
use std::fs;
use std::path::Path;

/// The records of all gates of the run in `folder`, by name; none where it holds no streams. Where several whole runs in one
/// folder observed the same gate, the first one counts.
///
/// # Errors
/// When a stream cannot be used.
pub fn load_gate_records(folder: &Path) -> Result<Vec<GateRecord>, StorageError> {
    let summary = folder.join("summary.json");
    if !summary.exists() {
        return Ok(Vec::new());
    }
    let mut records: Vec<GateRecord> = Vec::new();
    for stage in Summary::read(&summary)?.stages {
        let streams = super::stage_folder(folder, &stage.name).join("streams");
        let Ok(entries) = fs::read_dir(&streams) else { continue };
        let mut places: Vec<_> = entries.flatten().map(|entry| entry.path()).collect();
        places.retain(|place| place.join("manifest.json").is_file());
        places.sort();
        for place in places {
            let record = record(&place)?;
            if !records.iter().any(|held| held.gate == record.gate) {
                records.push(record);
            }
        }
    }
    Ok(records)
}

fn record(place: &Path) -> Result<GateRecord, StorageError> {
    let reader = StreamReader::open(place)?;
    let origin = &reader.manifest().origin;
    let mut record = GateRecord {
        gate: origin.gate.clone(),
        times: Vec::new(),
        masses: Vec::new(),
        normal_speeds: Vec::new(),
        diameters: Vec::new(),
    };
    for crossing in reader.crossings() {
        let crossing = crossing?;
        record.times.push(crossing.passage.time);
        record.masses.push(origin.body.mass(crossing.state.radius, crossing.state.density));
        record.normal_speeds.push(crossing.passage.velocity.dot(&origin.plane.normal));
        record.diameters.push(2.0 * crossing.state.radius);
    }
    Ok(record)
}
