//! The checkpoint of a run: the solver's record in a column file, renamed into place as a whole.

use super::end::EndWatch;
use super::gate::HandOver;
use crate::backend::BackendError;
use crate::dem::checkpoint::{INTEGER_COLUMNS, REAL_COLUMNS, SimulationRecord};
use crate::dem::simulation::{Setup, Simulation};
use crate::particle::{Body, ParticleId};
use crate::storage::StorageError;
use crate::storage::columns::{ColumnReader, ColumnWriter};
use std::path::{Path, PathBuf};

/// Kind of column file.
const KIND: &str = "checkpoint";

/// The checkpoint file of a run.
#[derive(Debug)]
pub struct CheckpointFile {
    path: PathBuf,
    key: String,
}

impl CheckpointFile {
    /// `state.checkpoint` in `folder`, for runs of this key.
    pub fn new(folder: &Path, key: &str) -> Self {
        Self { path: folder.join("state.checkpoint"), key: key.to_owned() }
    }

    /// Replaces the file by the present state.
    pub fn save(&self, simulation: &Simulation, end: &EndWatch, gates: &HandOver) -> Result<(), StorageError> {
        let record = simulation.record();
        let end = serde_json::to_string(end).expect("plain numbers become JSON");
        let mut writer = ColumnWriter::new(KIND);
        writer.attribute("key", self.key.as_str());
        writer.attribute("progress", record.progress.as_str());
        writer.attribute("end_watch", end);
        writer.attribute("time_s", simulation.time());
        let setup = simulation.setup();
        writer.attribute("body", body_text(setup));
        for (name, column) in &record.reals {
            writer.column(name, column.as_slice());
        }
        for (name, column) in &record.integers {
            writer.column(name, column.as_slice());
        }
        gates.save(simulation, &mut writer);
        writer.write(&self.path)
    }

    /// The simulation to continue, and the open checkpoint for what else stands in it; `None` where none was written yet.
    pub fn load(&self, setup: Setup, end: &mut EndWatch) -> Result<Option<(Simulation, ColumnReader)>, BackendError> {
        if !self.path.exists() {
            return Ok(None);
        }
        let reader = ColumnReader::open(&self.path, KIND)?;
        let refuse =
            |reason: String| BackendError::Checkpoint(format!("cannot resume from {}: {reason}", self.path.display()));
        if reader.attribute_text("key")? != self.key {
            return Err(refuse("it belongs to another scene, time step or version; choose another --out".to_owned()));
        }
        *end = serde_json::from_str(reader.attribute_text("end_watch")?).map_err(|error| refuse(error.to_string()))?;
        let record = record_of(&reader)?;
        let simulation = Simulation::resume(setup, &record).map_err(|error| refuse(error.to_string()))?;
        Ok(Some((simulation, reader)))
    }
}

/// The record in the checkpoint file of another run, for a start under `setup`.
pub fn record_for_start(path: &Path, setup: &Setup) -> Result<SimulationRecord, BackendError> {
    let reader = ColumnReader::open(path, KIND)?;
    let refuse = |reason: String| BackendError::Checkpoint(format!("cannot start from {}: {reason}", path.display()));
    let body = reader.attribute_text("body")?;
    if body != body_text(setup) {
        let wanted = body_text(setup);
        return Err(refuse(format!("its particles are {body}, and those of this scene are {wanted}")));
    }
    Ok(record_of(&reader)?)
}

/// How many feed numbers the particles in the checkpoint file of another run take, from 0 on.
pub fn feed_numbers(path: &Path) -> Result<u32, StorageError> {
    let ids = ColumnReader::open(path, KIND)?.u64s("id")?;
    Ok(ids.into_iter().map(|id| ParticleId(id).feed() + 1).max().unwrap_or(0))
}

fn body_text(setup: &Setup) -> String {
    match setup.body {
        Body::Sphere => "spheres".to_owned(),
        Body::Disc { thickness } => format!("discs of {thickness:?} m"),
    }
}

fn record_of(reader: &ColumnReader) -> Result<SimulationRecord, StorageError> {
    let mut record = SimulationRecord { progress: reader.attribute_text("progress")?.to_owned(), ..Default::default() };
    for name in REAL_COLUMNS {
        record.reals.push((name, reader.f64s(name)?));
    }
    for name in INTEGER_COLUMNS {
        record.integers.push((name, reader.u64s(name)?));
    }
    Ok(record)
}
