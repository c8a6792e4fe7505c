//! Writes a stream, chunk by chunk, into a staging folder that is renamed when it is complete.

use super::check;
use super::columns::{columns, infinite_row};
use super::format::{CHUNK_KIND, ChunkEntry, Counts, MANIFEST_FILE, Manifest, Origin, StoredEvent};
use super::format::{chunk_file, content_digest, is_chunk_file};
use super::reader::read_chunk;
use crate::gate::crossing::Crossing;
use crate::particle::ParticleId;
use crate::storage::StorageError;
use crate::storage::columns::{ColumnEntry, ColumnWriter};
use crate::storage::staging::STAGING_SUFFIX;
use std::ffi::OsString;
use std::fs::{self, File};
use std::io;
use std::path::{Path, PathBuf};

/// A chunk is sealed at so many crossings,
pub const CHUNK_CROSSINGS: usize = 8192;
/// or at so many motions of paths (4 MB). Fixed numbers only: a resumed run seals the same chunks.
pub const CHUNK_MOTIONS: usize = 32_768;

/// What is known of a stream when its stage has ended.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Closing {
    /// What happened to parts, in order of time.
    pub events: Vec<StoredEvent>,
    /// Ledger and quality of the cut.
    pub quality: serde_json::Value,
}

/// A stream under construction, in the folder `PLACE.staging`.
#[derive(Debug)]
pub struct StreamWriter {
    place: PathBuf,
    staging: PathBuf,
    manifest: Manifest,
    pending: Vec<Crossing>,
    pending_motions: usize,
    last: Option<(u64, ParticleId)>,
}

impl StreamWriter {
    /// Starts the stream whose final folder is `place`. What an earlier writer left unfinished is removed.
    ///
    /// # Errors
    /// When there is something at `place`, or the disk refuses.
    pub fn create(place: &Path, origin: Origin) -> Result<Self, StorageError> {
        if place.exists() {
            let source = io::Error::new(io::ErrorKind::AlreadyExists, "it is there already; choose another place");
            return Err(StorageError::system("create the stream", place, source));
        }
        let writer = Self::empty(place, origin);
        if writer.staging.exists() {
            writer.clear(|_| true)?;
        }
        fs::create_dir_all(&writer.staging)
            .map_err(|source| StorageError::system("make the folder", &writer.staging, source))?;
        Ok(writer)
    }

    /// Continues a stream that had `sealed` chunks, and then the crossings `pending`, when its stage was saved. Chunks that
    /// were sealed later are removed, those before are read and checked.
    ///
    /// # Errors
    /// When a chunk is missing, damaged or does not fit, or the disk refuses.
    pub fn resume(place: &Path, origin: Origin, sealed: usize, pending: Vec<Crossing>) -> Result<Self, StorageError> {
        let mut writer = Self::empty(place, origin);
        // The process may have been killed after the stream was finished, and before that was saved.
        if place.exists() && !writer.staging.exists() {
            fs::rename(place, &writer.staging).map_err(|source| StorageError::system("reopen", place, source))?;
        }
        fs::create_dir_all(&writer.staging)
            .map_err(|source| StorageError::system("make the folder", &writer.staging, source))?;
        let kept: Vec<String> = (0..sealed).map(chunk_file).collect();
        writer.clear(|name| !kept.iter().any(|kept| kept == name))?;
        for file in kept {
            let path = writer.staging.join(&file);
            let (crossings, entries) = read_chunk(&path)?;
            if let Some(fault) = check::fault(&writer.manifest.origin, &crossings, writer.last) {
                return Err(StorageError::unusable(&path, format!("{fault}; resume from the start")));
            }
            writer.last = crossings.last().map(|last| (last.step, last.state.id)).or(writer.last);
            writer.enter(file, &crossings, &entries)?;
        }
        for crossing in pending {
            writer.push(crossing)?;
        }
        Ok(writer)
    }

    fn empty(place: &Path, origin: Origin) -> Self {
        let mut name: OsString = place.file_name().unwrap_or_default().to_owned();
        name.push(STAGING_SUFFIX);
        Self {
            place: place.to_path_buf(),
            staging: place.with_file_name(name),
            manifest: Manifest::new(origin),
            pending: Vec::new(),
            pending_motions: 0,
            last: None,
        }
    }

    /// Removes files of the staging folder, of those that a writer makes.
    fn clear(&self, unwanted: impl Fn(&str) -> bool) -> Result<(), StorageError> {
        let failed = |source| StorageError::system("tidy up", &self.staging, source);
        for entry in fs::read_dir(&self.staging).map_err(failed)? {
            let entry = entry.map_err(failed)?;
            let name = entry.file_name().to_string_lossy().into_owned();
            let whole = name.strip_suffix(STAGING_SUFFIX).unwrap_or(&name);
            if (is_chunk_file(whole) || whole == MANIFEST_FILE) && unwanted(&name) {
                fs::remove_file(entry.path()).map_err(failed)?;
            }
        }
        Ok(())
    }

    /// Adds the next crossing; they come in ascending order of (step, id).
    ///
    /// # Errors
    /// When it is not the next, is not finite, or names a part or material that the stream does not; when the disk refuses.
    pub fn push(&mut self, crossing: Crossing) -> Result<(), StorageError> {
        if let Some(fault) = check::fault(&self.manifest.origin, std::slice::from_ref(&crossing), self.last) {
            return Err(StorageError::mismatch(&self.place, fault));
        }
        self.last = Some((crossing.step, crossing.state.id));
        self.pending_motions += crossing.path.len();
        self.pending.push(crossing);
        if self.pending.len() >= CHUNK_CROSSINGS || self.pending_motions >= CHUNK_MOTIONS {
            self.seal()?;
        }
        Ok(())
    }

    /// Crossings that are in no chunk yet: what a checkpoint must keep.
    #[must_use]
    pub fn pending(&self) -> &[Crossing] {
        &self.pending
    }

    /// Number of chunks that are safely on the disk.
    #[must_use]
    pub const fn sealed(&self) -> usize {
        self.manifest.chunks.len()
    }

    /// Crossings so far.
    #[must_use]
    pub const fn crossings(&self) -> u64 {
        self.manifest.counts.crossings + self.pending.len() as u64
    }

    fn seal(&mut self) -> Result<(), StorageError> {
        let pending = std::mem::take(&mut self.pending);
        self.pending_motions = 0;
        let file = chunk_file(self.sealed());
        let path = self.staging.join(&file);
        let mut container = ColumnWriter::new(CHUNK_KIND);
        for (name, column) in columns(&pending) {
            if let Some(row) = infinite_row(&column) {
                let reason = format!("row {row} of column {name:?} is not a finite number");
                return Err(StorageError::mismatch(&path, reason));
            }
            container.column(name, column);
        }
        let entries = container.write_described(&path)?;
        self.enter(file, &pending, &entries)
    }

    /// Enters a chunk file into the manifest.
    fn enter(&mut self, file: String, crossings: &[Crossing], entries: &[ColumnEntry]) -> Result<(), StorageError> {
        let path = self.staging.join(&file);
        let own = check::count(&self.manifest.origin, crossings, self.manifest.counts.mass);
        let Some(range) = own.range else {
            return Err(StorageError::unusable(&path, "it holds no crossing; resume from the start"));
        };
        let bytes = fs::metadata(&path).map_err(|source| StorageError::system("read", &path, source))?.len();
        let Counts { crossings, contacts, motions, .. } = own;
        let blake3 = content_digest(entries);
        self.manifest.chunks.push(ChunkEntry { file, bytes, crossings, contacts, motions, range, blake3 });
        self.manifest.counts.continued(&own);
        Ok(())
    }

    /// Seals what is left, writes the manifest and puts the stream at its place.
    ///
    /// # Errors
    /// When the disk refuses; there is no stream at its place then.
    pub fn finish(mut self, closing: Closing) -> Result<Manifest, StorageError> {
        if !self.pending.is_empty() {
            self.seal()?;
        }
        let Closing { events, quality } = closing;
        (self.manifest.events, self.manifest.quality) = (events, quality);
        self.manifest.write(&self.staging)?;
        let failed = |source| StorageError::system("finish the stream", &self.place, source);
        File::open(&self.staging).and_then(|folder| folder.sync_all()).map_err(failed)?;
        fs::rename(&self.staging, &self.place).map_err(failed)?;
        let parent = self.place.parent().filter(|folder| !folder.as_os_str().is_empty());
        let parent = parent.unwrap_or_else(|| Path::new("."));
        File::open(parent).and_then(|folder| folder.sync_all()).map_err(failed)?;
        Ok(self.manifest)
    }
}
