//! Arrays of tasks: what is asked for, how it is cut, and what it waits for.

use super::error::SlurmError;
use serde::{Deserialize, Serialize};
use std::ffi::OsString;
use std::fmt;
use std::os::unix::ffi::{OsStrExt, OsStringExt};
use std::path::Path;
use std::sync::atomic::{AtomicU64, Ordering};

/// One task of an array job.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
pub struct TaskId {
    /// Number of the array job.
    pub job: u64,
    /// Number of the task in it, from 0.
    pub index: u64,
}

impl fmt::Display for TaskId {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}_{}", self.job, self.index)
    }
}

/// An array job: its tasks 0 to `count` - 1 are the lines of the tasks file from `first` on, counted from 0.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub struct ArrayJob {
    /// Its number.
    pub job: u64,
    /// Line of the tasks file of its task 0, from 0.
    pub first: u64,
    /// How many tasks it has.
    pub count: u64,
}

/// What became of a request: one array job, or several where the cluster allows no array of that size.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct Submission {
    /// The array jobs, in the order of the tasks file.
    pub jobs: Vec<ArrayJob>,
}

impl Submission {
    /// The task of a line of the tasks file, counted from 0.
    #[must_use]
    pub fn task(&self, line: u64) -> Option<TaskId> {
        let job = self.jobs.iter().find(|job| (job.first..job.first + job.count).contains(&line))?;
        Some(TaskId { job: job.job, index: line - job.first })
    }

    /// All tasks with their lines.
    pub fn tasks(&self) -> impl Iterator<Item = (u64, TaskId)> {
        self.jobs.iter().flat_map(ArrayJob::tasks)
    }
}

impl ArrayJob {
    /// Its tasks with their lines of the tasks file.
    pub fn tasks(&self) -> impl Iterator<Item = (u64, TaskId)> + use<> {
        let Self { job, first, count } = *self;
        (0..count).map(move |index| (first + index, TaskId { job, index }))
    }
}

/// What must have ended well before the tasks of an array may start.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Prerequisite {
    /// One task.
    Task(TaskId),
    /// All tasks of a submission.
    All(Submission),
    /// For each task, the one of the same line in a submission that was cut in the same way.
    SameLine(Submission),
}

/// An array of tasks to be submitted.
#[derive(Debug, Clone, Copy)]
pub struct ArrayRequest<'a> {
    /// The script, as [`super::TaskScript`] renders it.
    pub script: &'a Path,
    /// How many tasks: lines of the script's tasks file, from its first.
    pub count: u64,
    /// What the jobs are called; a word.
    pub name: &'a str,
    /// Folder in which the tasks start.
    pub workspace: &'a Path,
    /// Folder of the logs, which must be there: `JOB_INDEX.log` of each task.
    pub logs: &'a Path,
    /// What must have ended well before. Slurm takes what it has forgotten for ended well.
    pub after: &'a [Prerequisite],
    /// Most tasks that run at the same time; where the array is cut, each part gets its share, at least 1.
    pub throttle: Option<u64>,
    /// Most tasks in one array, where the cluster allows more.
    pub max_array_size: Option<u64>,
}

/// `count` tasks in parts of at most `most`: first and number of each.
pub(super) fn cut(count: u64, most: u64) -> Vec<(u64, u64)> {
    let most = most.max(1);
    (0..count.div_ceil(most)).map(|part| (part * most, most.min(count - part * most))).collect()
}

/// What a part gets of a limit for all of them.
pub(super) fn share(limit: u64, parts: u64, part: u64) -> u64 {
    (limit / parts + u64::from(part < limit % parts)).max(1)
}

/// A name that no other submission has, by which a job is found where its number was lost on the way.
pub(super) fn unique_name(name: &str) -> String {
    static SERIAL: AtomicU64 = AtomicU64::new(0);
    let time = std::time::SystemTime::now().duration_since(std::time::UNIX_EPOCH).unwrap_or_default();
    let text = format!("{:?} {} {}", time, std::process::id(), SERIAL.fetch_add(1, Ordering::Relaxed));
    let digest = blake3::hash(text.as_bytes()).to_hex();
    let is_plain = |c: char| c.is_ascii_alphanumeric() || "_-.".contains(c);
    let name: String = name.chars().map(|c| if is_plain(c) { c } else { '_' }).collect();
    format!("{name}-{}", &digest[..8])
}

/// Where Slurm writes what a task prints.
pub(super) fn log_pattern(logs: &Path) -> Result<OsString, SlurmError> {
    let folder = std::path::absolute(logs)
        .map_err(|error| SlurmError::bad_path("the folder of logs", logs, &error.to_string()))?;
    let bytes = folder.as_os_str().as_bytes();
    if bytes.contains(&b'\\') || bytes.iter().any(u8::is_ascii_control) {
        let reason = "with a backslash or a control character in its path, Slurm names no logs; choose another folder";
        return Err(SlurmError::bad_path("the folder of logs", logs, reason));
    }
    // A percent sign starts one of Slurm's own names.
    let mut pattern = Vec::with_capacity(bytes.len() + 16);
    for &byte in bytes {
        pattern.extend(if byte == b'%' { &b"%%"[..] } else { std::slice::from_ref(&byte) });
    }
    pattern.extend_from_slice(b"/%A_%a.log");
    Ok(OsString::from_vec(pattern))
}

/// The dependency of a part, in sbatch's words.
pub(super) fn dependency(after: &[Prerequisite], first: u64, count: u64) -> Result<Option<String>, SlurmError> {
    let mut ended: Vec<String> = Vec::new();
    let mut same_line = Vec::new();
    for prerequisite in after {
        match prerequisite {
            Prerequisite::Task(task) => ended.push(task.to_string()),
            Prerequisite::All(submission) => ended.extend(submission.jobs.iter().map(|job| job.job.to_string())),
            Prerequisite::SameLine(submission) => {
                let fits = |job: &&ArrayJob| job.first == first && job.count == count;
                let job = submission.jobs.iter().find(fits).ok_or_else(|| {
                    SlurmError::refused(
                        "an array whose tasks wait for those of another one by one must be as long and cut as it is; submit it \
                         with the same number of tasks and the same `max_array_size`",
                    )
                })?;
                same_line.push(job.job.to_string());
            }
        }
    }
    let kinds = [("afterok", ended), ("aftercorr", same_line)];
    let kinds =
        kinds.iter().filter(|(_, jobs)| !jobs.is_empty()).map(|(kind, jobs)| format!("{kind}:{}", jobs.join(":")));
    let text = kinds.collect::<Vec<_>>().join(",");
    Ok((!text.is_empty()).then_some(text))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn submission(jobs: &[(u64, u64, u64)]) -> Submission {
        Submission { jobs: jobs.iter().map(|&(job, first, count)| ArrayJob { job, first, count }).collect() }
    }

    #[test]
    fn an_array_is_cut_into_parts_that_the_cluster_takes() {
        assert_eq!(cut(12, 5), [(0, 5), (5, 5), (10, 2)]);
        assert_eq!(cut(5, 5), [(0, 5)]);
        assert_eq!(cut(0, 5), []);
        assert_eq!(cut(2, 0), [(0, 1), (1, 1)]);
    }

    #[test]
    fn parts_share_the_limit_of_running_tasks() {
        let shares = |limit, parts| (0..parts).map(|part| share(limit, parts, part)).collect::<Vec<_>>();
        assert_eq!(shares(8, 3), [3, 3, 2]);
        assert_eq!(shares(2, 3), [1, 1, 1], "a part without a share would never run");
    }

    #[test]
    fn lines_lead_to_tasks() {
        let submission = submission(&[(7, 0, 5), (8, 5, 2)]);
        assert_eq!(submission.task(6).map(|task| task.to_string()).as_deref(), Some("8_1"));
        assert_eq!(submission.task(7), None);
        assert_eq!(submission.tasks().map(|(line, task)| (line, task.to_string())).last(), Some((6, "8_1".to_owned())));
    }

    #[test]
    fn dependencies_are_told_in_the_words_of_sbatch() {
        let both = submission(&[(7, 0, 5), (8, 5, 2)]);
        let task = Prerequisite::Task(TaskId { job: 3, index: 1 });
        let all = Prerequisite::All(both.clone());
        let text = |after: &[Prerequisite], first, count| dependency(after, first, count).unwrap();
        assert_eq!(text(&[], 0, 5), None);
        assert_eq!(text(&[task.clone(), all], 0, 5).as_deref(), Some("afterok:3_1:7:8"));
        let same = Prerequisite::SameLine(both);
        assert_eq!(text(&[task, same.clone()], 5, 2).as_deref(), Some("afterok:3_1,aftercorr:8"));
        assert!(dependency(&[same], 0, 7).is_err());
    }

    #[test]
    fn logs_are_named_whatever_the_path() {
        assert_eq!(log_pattern(Path::new("/a b/50%a's")).unwrap(), "/a b/50%%a's/%A_%a.log");
        assert!(log_pattern(Path::new("/a\\b")).is_err() && log_pattern(Path::new("/a\nb")).is_err());
    }

    #[test]
    fn no_two_jobs_have_the_same_name() {
        let (one, other) = (unique_name("two words"), unique_name("two words"));
        assert!(one != other && one.starts_with("two_words-"), "{one} {other}");
    }
}
