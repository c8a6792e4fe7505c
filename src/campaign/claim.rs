//! Claims: who computes a task. Files that are made exclusively, with a heartbeat; they hold on network file systems, because
//! nothing but the exclusive creation of a name and changes of content as seen by the looker decide.
//!
//! A claim is the file `TASK.GENERATION` with the highest generation. Its holder changes it every [`HEARTBEAT`]. Who sees one
//! unchanged for [`PATIENCE`], by its own clock, or sees that its process on this very computer is gone, may create the next
//! generation: one of all who try succeeds. A holder that has been given up notices at its next heartbeat, and ends.

use crate::storage::StorageError;
use serde::{Deserialize, Serialize};
use std::collections::HashMap;
use std::fs::{self, OpenOptions};
use std::io::{ErrorKind, Write};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

/// Time between two changes of a claim.
pub const HEARTBEAT: Duration = Duration::from_secs(5);
/// A claim that has not changed for so long is given up: twelve heartbeats, more than caches of network file systems keep
/// (Linux NFS: attributes up to 60 s for folders, 3 s after a change for files; see nfs(5), `acregmax`).
pub const PATIENCE: Duration = Duration::from_secs(60);

/// Who holds a claim.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct Holder {
    /// Name of the computer.
    pub host: String,
    /// What tells one start of that computer from another.
    boot: String,
    /// The process.
    pub process: u32,
    /// When it was started, in the system's ticks: numbers of processes are used again.
    started: String,
}

impl Holder {
    /// This process.
    #[must_use]
    pub fn this_process() -> Self {
        Self {
            host: rustix::system::uname().nodename().to_string_lossy().into_owned(),
            boot: boot(),
            process: std::process::id(),
            started: started(std::process::id()).unwrap_or_default(),
        }
    }

    /// True where it was a process of this computer and is no more.
    fn is_gone(&self) -> bool {
        self.boot == boot() && started(self.process).as_ref() != Some(&self.started)
    }
}

fn boot() -> String {
    fs::read_to_string("/proc/sys/kernel/random/boot_id").map_or_else(|_| String::new(), |id| id.trim().to_owned())
}

/// When a process was started: field 22 of its `stat`, proc(5). A process that has ended and is not yet waited for is gone.
fn started(process: u32) -> Option<String> {
    let stat = fs::read_to_string(format!("/proc/{process}/stat")).ok()?;
    let mut fields = stat.rsplit_once(") ")?.1.split(' ');
    let is_over = fields.next().is_some_and(|state| ["Z", "X"].contains(&state));
    if is_over { None } else { fields.nth(18).map(str::to_owned) }
}

/// What is known about a task's claim.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Claimed {
    /// Nobody holds it.
    Free,
    /// Somebody does.
    By(Holder),
    /// Somebody did, and is gone or silent.
    GivenUp(Holder),
}

/// Looks at claims, and remembers since when each has been unchanged.
#[derive(Debug, Default)]
pub struct Watch {
    seen: HashMap<PathBuf, (String, Instant)>,
}

impl Watch {
    /// What is known about the claim of `task` in the folder `claims`, one of whose files are `names`.
    pub fn look(&mut self, claims: &Path, task: &str, names: &[String]) -> Claimed {
        let Some(generation) = highest(task, names) else { return Claimed::Free };
        let path = claims.join(format!("{task}.{generation}"));
        let Ok(text) = fs::read_to_string(&path) else { return Claimed::Free };
        let holder = text.lines().next().and_then(|line| serde_json::from_str::<Holder>(line).ok());
        let now = Instant::now();
        let entry = self.seen.entry(path).or_insert_with(|| (text.clone(), now));
        if entry.0 != text {
            *entry = (text, now);
        }
        let is_silent = now.duration_since(entry.1) >= PATIENCE;
        match holder {
            Some(holder) if is_silent || holder.is_gone() => Claimed::GivenUp(holder),
            Some(holder) => Claimed::By(holder),
            // Written a moment ago, or never: the clock decides.
            None => {
                let unknown =
                    Holder { host: "unknown".to_owned(), boot: String::new(), process: 0, started: String::new() };
                if is_silent { Claimed::GivenUp(unknown) } else { Claimed::By(unknown) }
            }
        }
    }
}

/// The highest generation among the claims of `task`.
fn highest(task: &str, names: &[String]) -> Option<u64> {
    let generation = |name: &String| name.strip_prefix(task)?.strip_prefix('.')?.parse().ok();
    names.iter().filter_map(generation).max()
}

/// Names of all files in the folder `claims`.
#[must_use]
pub fn names(claims: &Path) -> Vec<String> {
    let Ok(entries) = fs::read_dir(claims) else { return Vec::new() };
    entries.flatten().filter_map(|entry| entry.file_name().into_string().ok()).collect()
}

/// A claim that this process holds; given back when it is dropped.
#[derive(Debug)]
pub struct Claim {
    path: PathBuf,
    older: Vec<PathBuf>,
    ended: Arc<AtomicBool>,
    heart: Option<JoinHandle<()>>,
}

impl Claim {
    /// Claims `task` in the folder `claims`; `None` where another holds it. `lost` is set when the claim is lost again.
    ///
    /// # Errors
    /// When the disk refuses.
    pub fn take(
        claims: &Path,
        task: &str,
        watch: &mut Watch,
        lost: &'static AtomicBool,
    ) -> Result<Option<Self>, StorageError> {
        fs::create_dir_all(claims).map_err(|source| StorageError::system("make the folder", claims, source))?;
        let names = names(claims);
        if matches!(watch.look(claims, task, &names), Claimed::By(_)) {
            return Ok(None);
        }
        let generation = highest(task, &names).map_or(0, |highest| highest + 1);
        let path = claims.join(format!("{task}.{generation}"));
        let mut file = match OpenOptions::new().write(true).create_new(true).open(&path) {
            Ok(file) => file,
            Err(error) if error.kind() == ErrorKind::AlreadyExists => return Ok(None),
            Err(source) => return Err(StorageError::system("create", &path, source)),
        };
        if let Err(source) = file.write_all(content(0).as_bytes()) {
            // A claim of nobody would hold everybody up until it is given up.
            drop(fs::remove_file(&path));
            return Err(StorageError::system("write", &path, source));
        }
        drop(file);
        let ended = Arc::new(AtomicBool::new(false));
        let next = claims.join(format!("{task}.{}", generation + 1));
        let heart = std::thread::spawn({
            let (path, ended) = (path.clone(), Arc::clone(&ended));
            move || beat(&path, &next, &ended, lost)
        });
        let older = (0..generation).map(|older| claims.join(format!("{task}.{older}"))).collect();
        Ok(Some(Self { path, older, ended, heart: Some(heart) }))
    }
}

impl Drop for Claim {
    fn drop(&mut self) {
        self.ended.store(true, Ordering::Relaxed);
        if let Some(heart) = self.heart.take() {
            heart.thread().unpark();
            drop(heart.join());
        }
        // Older ones first: the highest generation decides as long as it is there.
        self.older.iter().chain([&self.path]).for_each(|path| drop(fs::remove_file(path)));
    }
}

/// Changes the claim until it ends; where it is gone, or given up, it is lost.
fn beat(path: &Path, next: &Path, ended: &AtomicBool, lost: &AtomicBool) {
    for count in 1_u64.. {
        std::thread::park_timeout(HEARTBEAT);
        if ended.load(Ordering::Relaxed) {
            return;
        }
        // In place, and never creating: a claim that somebody has taken away must not come back.
        let written =
            OpenOptions::new().write(true).open(path).and_then(|mut file| file.write_all(content(count).as_bytes()));
        let is_gone = written.is_err_and(|error| error.kind() == ErrorKind::NotFound);
        if is_gone || next.exists() {
            lost.store(true, Ordering::Relaxed);
            return;
        }
    }
}

/// Content of a claim: the holder, and a count of one width, so that it can be written in place.
fn content(count: u64) -> String {
    let holder = serde_json::to_string(&Holder::this_process()).expect("a holder is texts and numbers");
    format!("{holder}\n{count:020}\n")
}

#[cfg(test)]
mod tests {
    use super::*;

    static NEVER: AtomicBool = AtomicBool::new(false);

    #[test]
    fn one_of_many_gets_it_and_gives_it_back() {
        let folder = tempfile::tempdir().unwrap();
        let take = || Claim::take(folder.path(), "a", &mut Watch::default(), &NEVER).unwrap();
        let held = std::thread::scope(|scope| {
            let all: Vec<_> = (0..8).map(|_| scope.spawn(take)).collect();
            all.into_iter().filter_map(|one| one.join().unwrap()).collect::<Vec<_>>()
        });
        assert_eq!(held.len(), 1);
        let other = Claim::take(folder.path(), "b", &mut Watch::default(), &NEVER).unwrap();
        assert!(other.is_some(), "another task");
        drop(held);
        assert!(take().is_some());
        drop(other);
        assert!(names(folder.path()).is_empty());
    }

    #[test]
    fn a_process_that_is_gone_has_given_up_and_its_successor_is_of_the_next_generation() {
        let folder = tempfile::tempdir().unwrap();
        let mut child = std::process::Command::new("true").spawn().unwrap();
        let gone =
            Holder { process: child.id(), started: started(child.id()).unwrap_or_default(), ..Holder::this_process() };
        child.wait().unwrap();
        let text = format!("{}\n{:020}\n", serde_json::to_string(&gone).unwrap(), 3);
        fs::write(folder.path().join("a.4"), text).unwrap();
        let mut watch = Watch::default();
        assert_eq!(watch.look(folder.path(), "a", &names(folder.path())), Claimed::GivenUp(gone));
        let claim = Claim::take(folder.path(), "a", &mut watch, &NEVER).unwrap().expect("a free claim");
        assert!(folder.path().join("a.5").exists());
        assert_eq!(watch.look(folder.path(), "a", &names(folder.path())), Claimed::By(Holder::this_process()));
        drop(claim);
        assert!(names(folder.path()).is_empty());
    }

    #[test]
    fn another_computer_is_given_up_only_when_it_is_silent() {
        let folder = tempfile::tempdir().unwrap();
        let far = Holder { boot: "another".to_owned(), host: "far".to_owned(), ..Holder::this_process() };
        fs::write(folder.path().join("a.0"), format!("{}\n0\n", serde_json::to_string(&far).unwrap())).unwrap();
        let mut watch = Watch::default();
        let look = |watch: &mut Watch| watch.look(folder.path(), "a", &names(folder.path()));
        assert_eq!(look(&mut watch), Claimed::By(far.clone()));
        // As if it had been seen long ago.
        watch.seen.values_mut().for_each(|(_, since)| *since = since.checked_sub(PATIENCE).unwrap());
        assert_eq!(look(&mut watch), Claimed::GivenUp(far.clone()));
        fs::write(folder.path().join("a.0"), format!("{}\n1\n", serde_json::to_string(&far).unwrap())).unwrap();
        assert_eq!(look(&mut watch), Claimed::By(far));
    }

    #[test]
    fn a_claim_that_is_taken_away_is_lost_and_does_not_come_back() {
        static LOST: AtomicBool = AtomicBool::new(false);
        let folder = tempfile::tempdir().unwrap();
        let claim = Claim::take(folder.path(), "a", &mut Watch::default(), &LOST).unwrap().unwrap();
        fs::remove_file(folder.path().join("a.0")).unwrap();
        let begun = Instant::now();
        while !LOST.load(Ordering::Relaxed) && begun.elapsed() < 3 * HEARTBEAT {
            claim.heart.as_ref().unwrap().thread().unpark();
            std::thread::sleep(Duration::from_millis(10));
        }
        assert!(LOST.load(Ordering::Relaxed));
        assert!(names(folder.path()).is_empty());
    }
}
