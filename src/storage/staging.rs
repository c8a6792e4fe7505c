//! A file that is whole or absent: written beside its place under a staging name, renamed when complete.

use super::StorageError;
use std::fs::{self, File};
use std::io::{self, BufWriter, Write};
use std::path::{Path, PathBuf};

/// Ending of the names under which unfinished files are written.
pub const STAGING_SUFFIX: &str = ".staging";

/// A file under construction. Dropped without [`StagedFile::commit`], it leaves nothing behind.
#[derive(Debug)]
pub struct StagedFile {
    place: PathBuf,
    staging: PathBuf,
    writer: Option<BufWriter<File>>,
}

impl StagedFile {
    /// Starts a file whose final place is `place`; the folder is made where it is missing.
    ///
    /// # Errors
    /// When the folder or the staging file cannot be made.
    pub fn create(place: &Path) -> Result<Self, StorageError> {
        if let Some(folder) = place.parent().filter(|folder| !folder.as_os_str().is_empty()) {
            fs::create_dir_all(folder).map_err(|source| StorageError::system("make the folder", folder, source))?;
        }
        let mut name = place.file_name().unwrap_or_default().to_os_string();
        name.push(STAGING_SUFFIX);
        let staging = place.with_file_name(name);
        let file = File::create(&staging).map_err(|source| StorageError::system("create", &staging, source))?;
        Ok(Self { place: place.to_path_buf(), staging, writer: Some(BufWriter::with_capacity(1 << 18, file)) })
    }

    /// Puts the file at its place, replacing an older one in one step.
    ///
    /// # Errors
    /// When the disk refuses; an older file at the place is untouched then.
    pub fn commit(self) -> Result<(), StorageError> {
        self.finish(false)
    }

    /// [`StagedFile::commit`] that also outlasts a power failure: file and folder are synchronised with the disk.
    ///
    /// # Errors
    /// As [`StagedFile::commit`].
    pub fn commit_durably(self) -> Result<(), StorageError> {
        self.finish(true)
    }

    fn finish(mut self, durably: bool) -> Result<(), StorageError> {
        let failed = |source| StorageError::system("write", &self.place, source);
        if let Some(writer) = self.writer.take() {
            let file = writer.into_inner().map_err(|error| failed(error.into_error()))?;
            if durably {
                file.sync_all().map_err(failed)?;
            }
        }
        fs::rename(&self.staging, &self.place).map_err(failed)?;
        if durably {
            let folder = self.place.parent().filter(|folder| !folder.as_os_str().is_empty());
            let folder = folder.unwrap_or_else(|| Path::new("."));
            File::open(folder).and_then(|folder| folder.sync_all()).map_err(failed)?;
        }
        Ok(())
    }

    /// Names the file in an error of one of its writes.
    pub(crate) fn failed(&self, source: io::Error) -> StorageError {
        StorageError::system("write", &self.place, source)
    }
}

impl Write for StagedFile {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        self.writer.as_mut().map_or(Ok(0), |writer| writer.write(bytes))
    }

    fn flush(&mut self) -> io::Result<()> {
        self.writer.as_mut().map_or(Ok(()), Write::flush)
    }
}

impl Drop for StagedFile {
    fn drop(&mut self) {
        // After a commit the staging name is gone already; a failure to tidy up must not hide the first error.
        let _ = fs::remove_file(&self.staging);
    }
}

/// Writes a whole file in one go.
///
/// # Errors
/// When the disk refuses; an older file at the place is untouched then.
pub fn write_whole(place: &Path, bytes: &[u8]) -> Result<(), StorageError> {
    let mut file = StagedFile::create(place)?;
    file.write_all(bytes).map_err(|source| file.failed(source))?;
    file.commit()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn names(folder: &Path) -> Vec<String> {
        let mut names: Vec<_> =
            fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().file_name().into_string().unwrap()).collect();
        names.sort();
        names
    }

    #[test]
    fn absent_until_committed_and_whole_after() {
        let folder = tempfile::tempdir().unwrap();
        let place = folder.path().join("new/frame.vtp");
        let mut file = StagedFile::create(&place).unwrap();
        file.write_all(b"first").unwrap();
        assert!(!place.exists());
        file.commit_durably().unwrap();
        assert_eq!(fs::read(&place).unwrap(), b"first");
        assert_eq!(names(place.parent().unwrap()), ["frame.vtp"]);
    }

    #[test]
    fn an_abandoned_file_leaves_the_old_one_and_nothing_else() {
        let folder = tempfile::tempdir().unwrap();
        let place = folder.path().join("summary.json");
        write_whole(&place, b"old").unwrap();
        let mut file = StagedFile::create(&place).unwrap();
        file.write_all(b"half of the n").unwrap();
        drop(file);
        assert_eq!(fs::read(&place).unwrap(), b"old");
        assert_eq!(names(folder.path()), ["summary.json"]);
    }

    #[test]
    fn a_place_that_cannot_be_written_is_named() {
        let folder = tempfile::tempdir().unwrap();
        let blocker = folder.path().join("file");
        fs::write(&blocker, b"").unwrap();
        let error = StagedFile::create(&blocker.join("frame.vtp")).unwrap_err();
        assert!(error.to_string().contains("cannot make the folder"), "{error}");
    }
}
