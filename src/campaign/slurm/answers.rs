//! What Slurm's commands print, as values.

use super::array::TaskId;
use super::state::{TaskState, exit_status};

/// What a cluster says of its settings.
#[derive(Debug, Clone, PartialEq)]
pub struct Settings {
    /// Most tasks in one array.
    pub max_array_size: u64,
    /// How long squeue knows jobs that have ended [s].
    pub min_job_age: f64,
    /// True where sacct knows them, too.
    pub accounting: bool,
}

pub(super) fn read_settings(text: &str) -> Result<Settings, String> {
    let value = |name: &str| {
        let find = |line: &str| {
            let (key, value) = line.split_once('=')?;
            (key.trim() == name).then(|| value.trim().to_owned())
        };
        text.lines().find_map(find).ok_or_else(|| format!("{name} is missing"))
    };
    // Numbers of seconds carry their unit.
    let number = |name: &str| {
        let text = value(name)?;
        let first = text.split_whitespace().next().unwrap_or_default();
        first.parse::<u64>().map_err(|_| format!("{name} is \"{text}\", which is no number"))
    };
    let max_array_size = number("MaxArraySize")?;
    if max_array_size == 0 {
        return Err("MaxArraySize is 0, so the cluster takes no arrays of jobs".to_owned());
    }
    Ok(Settings {
        max_array_size,
        min_job_age: number("MinJobAge")? as f64,
        accounting: value("AccountingStorageType")?.contains("slurmdbd"),
    })
}

/// Job, number of the task and state from a line of squeue. An array whose tasks were cancelled before they started has one line without
/// a number, for all of them.
pub(super) fn read_squeue(line: &str) -> Option<(u64, Option<u64>, TaskState)> {
    let fields: Vec<&str> = line.split('|').map(str::trim).collect();
    let [job, index, state, reason, status, ..] = fields[..] else { return None };
    let index = if index == "N/A" { None } else { Some(index.parse().ok()?) };
    Some((job.parse().ok()?, index, TaskState::from_words(state, reason, exit_status(status)?)?))
}

/// Task and state from a line of sacct; `Some(None)` for tasks that have not started, which stand together in one line.
pub(super) fn read_sacct(line: &str) -> Option<Option<(TaskId, TaskState)>> {
    let fields: Vec<&str> = line.split('|').map(str::trim).collect();
    let [name, state, status] = fields[..] else { return None };
    let Some((job, index)) = name.split_once('_').filter(|(_, index)| !index.starts_with('[')) else {
        return Some(None);
    };
    let task = TaskId { job: job.parse().ok()?, index: index.parse().ok()? };
    Some(Some((task, TaskState::from_words(state, "", exit_status(status)?)?)))
}

#[cfg(test)]
mod tests {
    use super::*;

    const CONFIG: &str = "Configuration data as of 2026-01-01T00:00:00\nAccountingStorageType   = accounting_storage/slurmdbd\n\
                          MaxArraySize            = 1001\nMinJobAge               = 300 sec\n";

    #[test]
    fn settings_are_read() {
        let settings = read_settings(CONFIG).unwrap();
        assert_eq!(settings, Settings { max_array_size: 1001, min_job_age: 300.0, accounting: true });
        assert!(!read_settings(&CONFIG.replace("slurmdbd", "none")).unwrap().accounting);
    }

    #[test]
    fn settings_that_cannot_be_read_are_named() {
        let refused = |text: &str| read_settings(text).unwrap_err();
        assert_eq!(refused("MinJobAge = 3 sec"), "MaxArraySize is missing");
        assert!(refused(&CONFIG.replace("1001", "many")).contains("no number"));
        assert!(refused(&CONFIG.replace("1001", "0")).contains("takes no arrays"));
    }

    #[test]
    fn lines_of_squeue() {
        let failed = TaskState::Failed { exit_code: 3, signal: 0 };
        assert_eq!(read_squeue("4|2|FAILED|NonZeroExitCode|768|"), Some((4, Some(2), failed)));
        assert_eq!(read_squeue("4|0|COMPLETED|None|0|"), Some((4, Some(0), TaskState::Done)));
        assert_eq!(read_squeue("4|N/A|CANCELLED|Resources|0|"), Some((4, None, TaskState::Cancelled)));
        assert_eq!(read_squeue("slurm is ill"), None);
    }

    #[test]
    fn lines_of_sacct() {
        let task = TaskId { job: 4, index: 2 };
        assert_eq!(read_sacct("4_2|CANCELLED by 0|0:15"), Some(Some((task, TaskState::Cancelled))));
        assert_eq!(read_sacct("4_2|OUT_OF_MEMORY|0:125"), Some(Some((task, TaskState::OutOfMemory))));
        assert_eq!(read_sacct("4_[3-5%2]|PENDING|0:0"), Some(None));
        assert_eq!(read_sacct("4_2|COMPLETED"), None);
    }
}
