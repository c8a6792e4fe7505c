//! Reads a stream, one chunk at a time; trusts nothing it has not checked.

use super::check;
use super::columns::from_columns;
use super::format::{CHUNK_KIND, ChunkEntry, Counts, Manifest, content_digest, is_chunk_file};
use super::identities::Identities;
use crate::gate::crossing::Crossing;
use crate::particle::ParticleId;
use crate::storage::StorageError;
use crate::storage::columns::{ColumnEntry, ColumnReader, read_all};
use crate::storage::staging::STAGING_SUFFIX;
use std::collections::BTreeSet;
use std::fs;
use std::io;
use std::path::{Path, PathBuf};

const NEXT: &str = "record the stream again";

/// A stream that is whole as far as its manifest and the sizes of its files tell. Holds nothing but the manifest.
#[derive(Debug, Clone)]
pub struct StreamReader {
    place: PathBuf,
    manifest: Manifest,
}

/// What [`StreamReader::verify`] has checked.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Checked {
    /// Chunk files.
    pub chunks: u64,
    /// Their size [bytes].
    pub bytes: u64,
    /// Crossings, contacts, motions, mass and range, counted again.
    pub counts: Counts,
}

impl StreamReader {
    /// Opens the stream in the folder `place`: reads its manifest, and compares the files there with it.
    ///
    /// # Errors
    /// When there is no stream, its manifest is foreign, edited, or of a newer format, or a chunk is missing, too many, or of
    /// another size.
    pub fn open(place: &Path) -> Result<Self, StorageError> {
        if !place.exists() {
            let mut unfinished = place.as_os_str().to_owned();
            unfinished.push(STAGING_SUFFIX);
            let reason = if Path::new(&unfinished).exists() {
                "the run that records it has not finished it; finish that run with --resume"
            } else {
                "there is no such folder"
            };
            return Err(StorageError::unusable(place, reason));
        }
        let manifest = Manifest::read(place)?;
        let reader = Self { place: place.to_path_buf(), manifest };
        reader.check_files()?;
        reader.check_sums()?;
        Ok(reader)
    }

    /// The stream's folder.
    #[must_use]
    pub fn place(&self) -> &Path {
        &self.place
    }

    /// Its manifest.
    #[must_use]
    pub const fn manifest(&self) -> &Manifest {
        &self.manifest
    }

    /// Number of chunks.
    #[must_use]
    pub const fn chunk_count(&self) -> usize {
        self.manifest.chunks.len()
    }

    fn check_files(&self) -> Result<(), StorageError> {
        let mut known = BTreeSet::new();
        for ChunkEntry { file, bytes, .. } in &self.manifest.chunks {
            let path = self.place.join(file);
            if !is_chunk_file(file) || !known.insert(file.as_str()) {
                return Err(self.refuse(format!("its manifest lists the chunk {file:?}, which cannot be; {NEXT}")));
            }
            let size = fs::metadata(&path).map_err(|source| match source.kind() {
                io::ErrorKind::NotFound => self.refuse(format!("its chunk {file} is missing; {NEXT}")),
                _ => StorageError::system("read", &path, source),
            })?;
            let size = size.len();
            if size == *bytes {
                continue;
            }
            let swapped = self.manifest.chunks.iter().find(|other| other.bytes == size && other.file != *file);
            let reason = match swapped {
                Some(other) => format!("its size is that of {}: files were swapped", other.file),
                None if size < *bytes => format!("it is truncated: {size} bytes of {bytes}"),
                None => format!("it has {size} bytes where the manifest says {bytes}"),
            };
            return Err(StorageError::unusable(&path, format!("{reason}; {NEXT}")));
        }
        let failed = |source| StorageError::system("read", &self.place, source);
        for entry in fs::read_dir(&self.place).map_err(failed)? {
            let name = entry.map_err(failed)?.file_name().to_string_lossy().into_owned();
            if is_chunk_file(&name) && !known.contains(name.as_str()) {
                return Err(self.refuse(format!("{name} does not belong to it: its manifest does not list it; {NEXT}")));
            }
        }
        Ok(())
    }

    /// The chunks' counts add up to the stream's.
    fn check_sums(&self) -> Result<(), StorageError> {
        let Manifest { counts, chunks, .. } = &self.manifest;
        let sum =
            |value: fn(&ChunkEntry) -> u64| chunks.iter().try_fold(0_u64, |sum, chunk| sum.checked_add(value(chunk)));
        let sums = [
            ("crossings", sum(|chunk| chunk.crossings), counts.crossings),
            ("contacts", sum(|chunk| chunk.contacts), counts.contacts),
            ("motions of paths", sum(|chunk| chunk.motions), counts.motions),
        ];
        if let Some((what, sum, total)) = sums.iter().find(|(_, sum, total)| *sum != Some(*total)) {
            let sum = sum.map_or("more than can be".to_owned(), |sum| sum.to_string());
            return Err(self.refuse(format!("its manifest counts {total} {what}, its chunks {sum}; {NEXT}")));
        }
        Ok(())
    }

    /// The crossings of chunk `index`, checked.
    ///
    /// # Errors
    /// When there is no such chunk, it cannot be read, or is not what was recorded.
    pub fn chunk(&self, index: usize) -> Result<Vec<Crossing>, StorageError> {
        let entry = self.manifest.chunks.get(index);
        let entry = entry.ok_or_else(|| self.refuse(format!("it has no chunk {index}")))?;
        let path = self.place.join(&entry.file);
        let (crossings, columns) = read_chunk(&path)?;
        let refuse = |reason: String| StorageError::unusable(&path, format!("{reason}; {NEXT}"));
        let digest = content_digest(&columns);
        if digest != entry.blake3 {
            let other = self.manifest.chunks.iter().find(|other| other.blake3 == digest);
            return Err(refuse(other.map_or("it holds other crossings than were recorded".to_owned(), |other| {
                format!("it holds the crossings of {}: files were swapped", other.file)
            })));
        }
        if let Some(fault) = check::fault(&self.manifest.origin, &crossings, None) {
            return Err(refuse(fault));
        }
        let counts = check::count(&self.manifest.origin, &crossings, 0.0);
        let stated = (entry.crossings, entry.contacts, entry.motions, Some(entry.range));
        if (counts.crossings, counts.contacts, counts.motions, counts.range) != stated {
            return Err(refuse("its counts or range are not those in the manifest".to_owned()));
        }
        Ok(crossings)
    }

    /// All crossings in their order; one chunk in memory. After an error there is nothing more.
    pub fn crossings(&self) -> impl Iterator<Item = Result<Crossing, StorageError>> + '_ {
        let mut failed = false;
        let chunks = (0..self.chunk_count()).map_while(move |index| {
            let chunk = if failed { return None } else { self.chunk(index) };
            failed = chunk.is_err();
            Some(chunk)
        });
        chunks.flat_map(|chunk| match chunk {
            Ok(crossings) => Either::Crossings(crossings.into_iter()),
            Err(error) => Either::Failure(Some(error)),
        })
    }

    /// Checks every byte: digests, order, counts, and what must hold of each crossing. `progress` is told the chunks done.
    ///
    /// # Errors
    /// With the first thing that is wrong.
    pub fn verify(&self, mut progress: impl FnMut(u64)) -> Result<Checked, StorageError> {
        let mut checked = Checked::default();
        let mut seen = Identities::default();
        let mut last: Option<(u64, ParticleId)> = None;
        for (index, entry) in self.manifest.chunks.iter().enumerate() {
            let crossings = self.chunk(index)?;
            let refuse = |reason: String| StorageError::unusable(&self.place.join(&entry.file), reason);
            let first = crossings.first().map(|first| (first.step, first.state.id));
            if last.is_some() && last >= first {
                return Err(refuse(format!("its crossings do not follow those of the chunk before; {NEXT}")));
            }
            last = crossings.last().map(|last| (last.step, last.state.id));
            if let Some(twice) = crossings.iter().find(|crossing| !seen.insert(crossing.state.id)) {
                let id = twice.state.id;
                let (serial, feed) = (id.serial(), id.feed());
                return Err(refuse(format!("particle {serial} of feed {feed} crosses a second time; {NEXT}")));
            }
            checked.counts.continued(&check::count(&self.manifest.origin, &crossings, checked.counts.mass));
            checked.chunks += 1;
            checked.bytes += entry.bytes;
            progress(checked.chunks);
        }
        let stated = self.manifest.counts;
        if (checked.counts.mass - stated.mass).abs() > MASS_ROUNDING * stated.mass.abs() {
            let reason = format!("its manifest says {} kg, its crossings have {} kg", stated.mass, checked.counts.mass);
            return Err(self.refuse(format!("{reason}; {NEXT}")));
        }
        if checked.counts.range != stated.range {
            return Err(self.refuse(format!("its range of steps and times is not that of its crossings; {NEXT}")));
        }
        Ok(checked)
    }

    fn refuse(&self, reason: String) -> StorageError {
        StorageError::unusable(&self.place, reason)
    }
}

/// The sum is made in the same order; another computer's r^3 may differ by some roundings.
const MASS_ROUNDING: f64 = 1e-12;

enum Either {
    Crossings(std::vec::IntoIter<Crossing>),
    Failure(Option<StorageError>),
}

impl Iterator for Either {
    type Item = Result<Crossing, StorageError>;

    fn next(&mut self) -> Option<Self::Item> {
        match self {
            Self::Crossings(crossings) => crossings.next().map(Ok),
            Self::Failure(error) => error.take().map(Err),
        }
    }
}

/// The crossings of a chunk file, and what its header says about its columns.
pub(super) fn read_chunk(path: &Path) -> Result<(Vec<Crossing>, Vec<ColumnEntry>), StorageError> {
    let reader = match ColumnReader::open(path, CHUNK_KIND) {
        Err(StorageError::System { source, .. }) if source.kind() == io::ErrorKind::NotFound => {
            return Err(StorageError::unusable(path, format!("it is missing; {NEXT}")));
        }
        opened => opened?,
    };
    let entries = reader.columns().to_vec();
    let crossings = from_columns(path, &mut read_all(&reader)?, "")?;
    Ok((crossings, entries))
}
