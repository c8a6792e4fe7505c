//! Atomfile variables: paths of recorded ghosts and releases, written sample by sample.

use super::batches::number;
use super::{RELEASES, STEERED};
use crate::math::Vec3;
use crate::storage::StorageError;
use std::fs::File;
use std::io::{BufWriter, Write};
use std::path::{Path, PathBuf};

/// What a recorded ghost is set to at a sample.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Steered {
    /// Its tag.
    pub tag: u32,
    /// Place [m].
    pub position: Vec3,
    /// Velocity up to the next sample [m/s].
    pub velocity: Vec3,
    /// Spin up to the next sample [rad/s].
    pub spin: Vec3,
}

/// The files of the variables, open for writing.
#[derive(Debug)]
pub struct Paths {
    /// Files in the order of [`STEERED`]; none where no ghost follows a record.
    steered: Vec<Section>,
    releases: Section,
}

#[derive(Debug)]
struct Section {
    place: PathBuf,
    file: BufWriter<File>,
}

impl Section {
    fn create(place: PathBuf) -> Result<Self, StorageError> {
        let file = File::create(&place).map_err(|source| StorageError::system("create", &place, source))?;
        Ok(Self { place, file: BufWriter::new(file) })
    }

    fn write(&mut self, rows: impl ExactSizeIterator<Item = (u32, f64)>) -> Result<(), StorageError> {
        let file = &mut self.file;
        let outcome = writeln!(file, "{}", rows.len())
            .and_then(|()| rows.into_iter().try_for_each(|(tag, value)| writeln!(file, "{tag} {}", number(value))));
        outcome.map_err(|source| StorageError::system("write", &self.place, source))
    }

    fn close(mut self) -> Result<(), StorageError> {
        // One section more than there are samples: `next` behind the last one would remove the variable.
        self.write(std::iter::empty())?;
        self.file.flush().map_err(|source| StorageError::system("write", &self.place, source))
    }
}

impl Paths {
    /// Makes the files; those of the paths only where ghosts follow a record.
    pub fn create(folder: &Path, recorded: bool) -> Result<Self, StorageError> {
        std::fs::create_dir_all(folder).map_err(|source| StorageError::system("make the folder", folder, source))?;
        let steered = STEERED.iter().filter(|_| recorded).map(|name| Section::create(folder.join(name)));
        Ok(Self { steered: steered.collect::<Result<_, _>>()?, releases: Section::create(folder.join(RELEASES))? })
    }

    /// Writes the next sample, tags ascending: all recorded ghosts, and the tags of the ghosts that are released.
    pub fn sample(&mut self, ghosts: &[Steered], released: &[u32]) -> Result<(), StorageError> {
        for (index, file) in self.steered.iter_mut().enumerate() {
            let axis = index % 3;
            file.write(ghosts.iter().map(|ghost| {
                let value = [&ghost.position, &ghost.velocity, &ghost.spin][index / 3][axis];
                (ghost.tag, value)
            }))?;
        }
        self.releases.write(released.iter().map(|tag| (*tag, 1.0)))
    }

    /// Finishes the files.
    pub fn close(self) -> Result<(), StorageError> {
        self.steered.into_iter().chain([self.releases]).try_for_each(Section::close)
    }
}
