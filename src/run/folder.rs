//! The result folder of a run: never overwritten; the same key is done, another one is refused with the difference.

use super::RunError;
use crate::exit_code;
use crate::output::summary::Summary;
use crate::stage::key::{StageKey, differences, value_of};
use crate::storage::StorageError;
use crate::storage::staging::{STAGING_SUFFIX, write_whole};
use serde_json::{Value, json};
use std::fs::{self, File, TryLockError};
use std::path::{Path, PathBuf};

/// Differences shown to the user.
const MOST_DIFFERENCES: usize = 6;

/// Name of the file that says which run a folder belongs to.
const RECORD: &str = "run.json";

/// What is accepted of a folder that holds this run unfinished.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Claim {
    /// Nothing.
    Fresh,
    /// It is gone on with.
    Resume,
    /// A part of the run is added; what is there is looked at part by part.
    Part,
}

impl Claim {
    /// By the word on the command line.
    pub const fn new(resume: bool) -> Self {
        if resume { Self::Resume } else { Self::Fresh }
    }
}

/// A claimed result folder.
#[derive(Debug)]
pub struct RunFolder {
    path: PathBuf,
    /// Held while the run is computed, so that no second process writes into the folder; the system frees it with the process.
    _lock: Option<File>,
}

/// What a run or a campaign is called after: the folder of a file called `usual`, or another file.
#[must_use]
pub fn name_of(file: &Path, usual: &str) -> String {
    let full = file.canonicalize().unwrap_or_else(|_| file.to_path_buf());
    let named = if full.file_name().is_some_and(|name| name == usual) { full.parent() } else { Some(full.as_path()) };
    let stem = named.and_then(Path::file_stem);
    stem.map_or_else(|| "scene".to_owned(), |stem| stem.to_string_lossy().into_owned())
}

/// Whether anything but the beginnings of a record is in the folder.
fn is_used(path: &Path) -> bool {
    let beginnings = format!("{RECORD}{STAGING_SUFFIX}");
    fs::read_dir(path).is_ok_and(|entries| entries.flatten().any(|entry| entry.file_name() != beginnings.as_str()))
}

/// Locks a folder; `None` where its file system has no locks.
fn lock(path: &Path) -> Result<Option<File>, RunError> {
    let folder = File::open(path).map_err(|source| StorageError::system("open", path, source))?;
    match folder.try_lock() {
        Ok(()) => Ok(Some(folder)),
        Err(TryLockError::WouldBlock) => Err(RunError::Folder(format!(
            "another process is computing into the folder {}; wait for it, or choose another --out",
            path.display()
        ))),
        Err(TryLockError::Error(_)) => Ok(None),
    }
}

impl RunFolder {
    /// Makes the folder, or accepts it where it belongs to the same run.
    pub fn claim(path: &Path, key: &StageKey, claim: Claim) -> Result<Self, RunError> {
        let shown = path.display();
        if path.exists() && !path.is_dir() {
            return Err(RunError::Folder(format!("{shown} is a file, not a folder; choose another --out")));
        }
        if !path.join(RECORD).exists() && is_used(path) {
            return Err(RunError::Folder(format!(
                "the folder {shown} is not empty and holds no run of tollgate; choose another --out"
            )));
        }
        fs::create_dir_all(path).map_err(|source| StorageError::system("create", path, source))?;
        let folder = Self { path: path.to_path_buf(), _lock: lock(path)? };
        let record = folder.record_path();
        if record.exists() {
            folder.check_same(key, claim)?;
            return Ok(folder);
        }
        let content = json!({
            "key": key.key, "outputs_key": key.outputs_key, "tollgate_version": env!("CARGO_PKG_VERSION"), "content": value_of(&key.content),
            "outputs": value_of(&key.outputs),
        });
        write_whole(&record, format!("{content}\n").as_bytes())?;
        Ok(folder)
    }

    fn check_same(&self, key: &StageKey, claim: Claim) -> Result<(), RunError> {
        let shown = self.path.display();
        let record = self.record_path();
        let text = fs::read_to_string(&record).map_err(|source| StorageError::system("read", &record, source))?;
        let held: Value = serde_json::from_str(&text).map_err(|error| {
            RunError::Folder(format!("{} is damaged ({error}); choose another --out", record.display()))
        })?;
        if held["key"] != key.key.as_str() {
            let changes = differences(&held["content"], &value_of(&key.content), MOST_DIFFERENCES).join("\n  ");
            return Err(RunError::Folder(format!(
                "the folder {shown} holds another run, which is never overwritten; choose another --out, or remove it. What differs:\n  {changes}"
            )));
        }
        if held["outputs_key"] != key.outputs_key.as_str() {
            return Err(RunError::Folder(format!(
                "the folder {shown} holds this very run, but with other outputs or measures, which cannot be added afterwards; choose another --out"
            )));
        }
        if claim == Claim::Fresh && self.finished()?.is_none() {
            return Err(RunError::Folder(format!(
                "the folder {shown} holds this run unfinished; go on with --resume, or choose another --out"
            )));
        }
        Ok(())
    }

    /// The summary in `path`, where an earlier run of this key ended there by itself.
    pub fn finished_elsewhere(path: &Path, key: &StageKey) -> Result<Option<Summary>, StorageError> {
        let folder = Self { path: path.to_path_buf(), _lock: None };
        let Ok(text) = fs::read_to_string(folder.record_path()) else { return Ok(None) };
        let held: Value = serde_json::from_str(&text).unwrap_or_default();
        if held["key"] != key.key.as_str() || held["outputs_key"] != key.outputs_key.as_str() {
            return Ok(None);
        }
        folder.finished()
    }

    /// What differs from the run in `path`, in words; empty where there is none.
    pub fn differences_elsewhere(path: &Path, key: &StageKey) -> Vec<String> {
        let Ok(text) = fs::read_to_string(path.join(RECORD)) else { return Vec::new() };
        let held: Value = serde_json::from_str(&text).unwrap_or_default();
        differences(&held["content"], &value_of(&key.content), MOST_DIFFERENCES)
    }

    /// The summary of an earlier run that ended by itself: it would end so again.
    pub fn finished(&self) -> Result<Option<Summary>, StorageError> {
        let path = self.summary_path();
        if !path.exists() {
            return Ok(None);
        }
        let summary = Summary::read(&path)?;
        let ended = matches!(summary.outcome.exit_code, exit_code::DONE | exit_code::UNSTABLE);
        Ok(ended.then_some(summary))
    }

    /// Where the summary stands.
    pub fn summary_path(&self) -> PathBuf {
        self.path.join("summary.json")
    }

    fn record_path(&self) -> PathBuf {
        self.path.join(RECORD)
    }
}
