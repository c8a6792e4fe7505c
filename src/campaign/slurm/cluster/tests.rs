//! How Slurm is talked to, on commands that only say their lines; `tests/slurm` has the real ones.

use super::*;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::time::Duration;

/// A folder of commands that are shell scripts.
struct Stubs {
    folder: tempfile::TempDir,
}

const CONFIG: &str =
    "echo 'AccountingStorageType = accounting_storage/slurmdbd'; echo 'MaxArraySize = 5'; echo 'MinJobAge = 9 sec'";

impl Stubs {
    fn new() -> Self {
        let stubs = Self { folder: tempfile::tempdir().unwrap() };
        stubs.add("scontrol", CONFIG);
        stubs
    }

    fn path(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    /// Each notes its arguments in `NAME.calls`.
    fn add(&self, name: &str, body: &str) {
        let text = format!("#!/bin/sh\ncd {:?}\necho \"$@\" >> {name}.calls\n{body}\n", self.folder.path());
        // Not by this process: a command that another thread is just starting would hold the file open, and it could not be run.
        let write = "printf %s \"$1\" > \"$0\"; chmod +x \"$0\"";
        let status = Command::new("sh").args(["-c", write]).arg(self.path(name)).arg(text).status();
        assert!(status.unwrap().success());
    }

    fn calls(&self, name: &str) -> Vec<String> {
        let text = fs::read_to_string(self.path(&format!("{name}.calls"))).unwrap_or_default();
        text.lines().map(str::to_owned).collect()
    }

    fn cluster(&self) -> Cluster {
        let search = format!("{}:/usr/bin:/bin", self.folder.path().display());
        let commands = Commands::default().with_variable("PATH", search);
        Cluster::connect(commands.with_patience(Duration::from_secs(2), Duration::from_millis(1))).unwrap()
    }
}

fn request(count: u64) -> ArrayRequest<'static> {
    ArrayRequest {
        script: Path::new("/w/script.sh"),
        count,
        name: "heap",
        workspace: Path::new("/w"),
        logs: Path::new("/w/logs"),
        after: &[],
        throttle: None,
        max_array_size: None,
    }
}

/// Numbers that count up from 41 with each call.
const NUMBERS: &str = "echo $(( 40 + $(wc -l < sbatch.calls) ))";

#[test]
fn an_array_is_submitted_in_parts() {
    let stubs = Stubs::new();
    stubs.add("sbatch", &format!("{NUMBERS}';cluster'"));
    let cluster = stubs.cluster();
    let submission = cluster.submit(&ArrayRequest { throttle: Some(4), ..request(7) }).unwrap();
    let job = |job, first, count| ArrayJob { job, first, count };
    assert_eq!(submission.jobs, [job(41, 0, 5), job(42, 5, 2)]);
    let calls = stubs.calls("sbatch");
    assert!(calls[0].contains("--array=0-4%2 --chdir=/w --output=/w/logs/%A_%a.log /w/script.sh 0"), "{calls:?}");
    assert!(calls[1].contains("--array=0-1%2 ") && calls[1].ends_with("/w/script.sh 5"), "{calls:?}");
    assert_eq!(cluster.submit(&ArrayRequest { max_array_size: Some(4), ..request(7) }).unwrap().jobs.len(), 2);
    assert!(cluster.submit(&request(0)).is_err());
}

#[test]
fn a_part_that_is_refused_takes_those_before_it_along() {
    let stubs = Stubs::new();
    stubs.add(
        "sbatch",
        &format!("[ $(wc -l < sbatch.calls) -lt 3 ] || {{ echo 'no more jobs' >&2; exit 1; }}\n{NUMBERS}"),
    );
    stubs.add("scancel", "");
    let error = stubs.cluster().submit(&request(12)).unwrap_err();
    assert!(error.to_string().contains("no more jobs") && error.to_string().contains("sbatch --parsable"), "{error}");
    assert_eq!(stubs.calls("scancel"), ["--quiet 41 42"]);
}

const AWAY: &str = "echo 'slurm_load_jobs error: Unable to contact slurm controller (connect failure)' >&2; exit 1";

#[test]
fn an_unreachable_controller_is_waited_for() {
    let stubs = Stubs::new();
    stubs.add("squeue", &format!("[ $(wc -l < squeue.calls) -gt 3 ] || {{ {AWAY}; }}\necho '7|0|RUNNING|None|0|'"));
    stubs.add("sacct", "");
    let states = stubs.cluster().states(&[ArrayJob { job: 7, first: 0, count: 1 }]).unwrap();
    assert_eq!(states.into_values().collect::<Vec<_>>(), [TaskState::Running]);
    assert_eq!(stubs.calls("squeue").len(), 4);
}

#[test]
fn patience_ends() {
    let stubs = Stubs::new();
    stubs.add("squeue", AWAY);
    let error = stubs.cluster().states(&[ArrayJob { job: 7, first: 0, count: 1 }]).unwrap_err();
    assert!(
        matches!(error, SlurmError::Unreachable { .. }) && error.to_string().contains("connect failure"),
        "{error}"
    );
}

#[test]
fn an_interrupt_ends_patience() {
    static INTERRUPTED: std::sync::atomic::AtomicBool = std::sync::atomic::AtomicBool::new(true);
    let stubs = Stubs::new();
    stubs.add("squeue", AWAY);
    let mut cluster = stubs.cluster();
    let patient = Commands::default().with_variable("PATH", format!("{}:/bin", stubs.folder.path().display()));
    cluster.commands = patient.with_interrupt(&INTERRUPTED);
    assert!(cluster.states(&[ArrayJob { job: 7, first: 0, count: 1 }]).is_err());
    assert_eq!(stubs.calls("squeue").len(), 1);
}

#[test]
fn a_job_that_was_taken_without_an_answer_is_not_submitted_twice() {
    let stubs = Stubs::new();
    stubs.add("sbatch", "echo 'Socket timed out on send/recv operation' >&2; exit 1");
    stubs.add("squeue", "echo '43|'; echo '43|'");
    let submission = stubs.cluster().submit(&request(2)).unwrap();
    assert_eq!((submission.jobs[0].job, stubs.calls("sbatch").len()), (43, 1));
    let name = stubs.calls("sbatch")[0].split_once("--job-name=").unwrap().1.split(' ').next().unwrap().to_owned();
    assert!(stubs.calls("squeue")[0].contains(&format!("--name={name}")));
    // And again where it was not.
    stubs.add(
        "sbatch",
        "[ $(wc -l < sbatch.calls) -gt 2 ] || { echo 'Socket timed out on send/recv operation' >&2; exit 1; }\necho 44",
    );
    stubs.add("squeue", "");
    assert_eq!(stubs.cluster().submit(&request(2)).unwrap().jobs[0].job, 44);
}

#[test]
fn what_squeue_has_forgotten_is_asked_of_sacct() {
    let stubs = Stubs::new();
    stubs.add("squeue", "echo '7|0|RUNNING|None|0|'");
    stubs.add("sacct", "echo '7_0|COMPLETED|0:0'; echo '7_1|OUT_OF_MEMORY|0:125'; echo '7_[3-4]|PENDING|0:0'");
    let jobs = [ArrayJob { job: 7, first: 0, count: 3 }];
    let states: Vec<TaskState> = stubs.cluster().states(&jobs).unwrap().into_values().collect();
    assert_eq!(states, [TaskState::Running, TaskState::OutOfMemory, TaskState::Unknown]);
    // Without accounts it is not asked, and what is forgotten is not known.
    stubs.add("scontrol", &CONFIG.replace("slurmdbd", "none"));
    stubs.add("squeue", "echo 'slurm_load_jobs error: Invalid job id specified' >&2; exit 1");
    let states: Vec<TaskState> = stubs.cluster().states(&jobs).unwrap().into_values().collect();
    assert_eq!((states, stubs.calls("sacct").len()), (vec![TaskState::Unknown; 3], 1));
}

#[test]
fn tasks_that_were_cancelled_before_they_started_are_told_together() {
    let stubs = Stubs::new();
    stubs.add("squeue", "echo '7|0|COMPLETED|None|0|'; echo '7|N/A|CANCELLED|Resources|0|'");
    stubs.add("sacct", "echo '7_1|FAILED|3:0'");
    let states = stubs.cluster().states(&[ArrayJob { job: 7, first: 0, count: 3 }]).unwrap();
    let failed = TaskState::Failed { exit_code: 3, signal: 0 };
    assert_eq!(states.into_values().collect::<Vec<_>>(), [TaskState::Done, failed, TaskState::Cancelled]);
}

#[test]
fn what_cannot_be_read_is_shown() {
    let stubs = Stubs::new();
    stubs.add("squeue", "echo 'Welcome to the cluster'");
    stubs.add("sbatch", "echo 'Submitted batch job 4'");
    let cluster = stubs.cluster();
    let error = cluster.states(&[ArrayJob { job: 7, first: 0, count: 1 }]).unwrap_err().to_string();
    assert!(error.contains("Welcome to the cluster") && error.contains("--states=all"), "{error}");
    let error = cluster.submit(&request(2)).unwrap_err().to_string();
    assert!(error.contains("Submitted batch job 4"), "{error}");
}

#[test]
fn missing_commands_are_told_with_the_place_to_go() {
    let folder = tempfile::tempdir().unwrap();
    let error = Cluster::connect(Commands::default().with_variable("PATH", folder.path())).unwrap_err();
    assert!(matches!(error, SlurmError::Missing { command: "scontrol" }), "{error:?}");
    assert!(error.to_string().contains("run this where `sbatch` works"), "{error}");
}

#[test]
fn settings_of_the_user_do_not_reach_the_commands() {
    // The environment of this process is not ours to change; what is taken out of it is told by name.
    for (variable, is_taken) in
        [("SBATCH_PARTITION", true), ("SQUEUE_FORMAT", true), ("SLURM_CONF", false), ("PATH", false)]
    {
        assert_eq!(crate::campaign::slurm::commands::is_setting(OsStr::new(variable)), is_taken, "{variable}");
    }
}
