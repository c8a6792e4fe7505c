//! A task whose wall time is over writes a checkpoint, is queued again and goes on, while others wait for it.

use crate::cluster::{Slurm, ends, states, wait_for, wait_until};
use std::fs;
use tollgate::campaign::slurm::{Prerequisite, TaskState};

/// Goes on at the second time, as one does that has a checkpoint.
const TASK: &str = "if [ -e \"$0/checkpoint\" ]; then echo finished > \"$0/$1\"; exit 0; fi; \
                    trap 'sleep 0.2; echo > \"$0/checkpoint\"; exit 130' USR1; echo > \"$0/started\"; while :; do sleep 0.05; done";

#[test]
fn a_task_goes_on_after_its_wall_time_and_its_dependents_wait() {
    let slurm = Slurm::start();
    let cluster = slurm.cluster();
    let workspace = slurm.workspace("it's w", TASK);
    let first = workspace.submit(&cluster, "long", 1, None);
    let task = first.task(0).unwrap();
    let after = [Prerequisite::All(first.clone())];
    let dependents = slurm.workspace("dependents", "echo > \"$0/$1\"");
    let second = dependents.after(&cluster, "after", 2, &after);
    wait_for(&workspace.path("started"));
    // Slurm looks at wall times every 30 s, and sends the signal then: it is due 60 s before the end.
    slurm.set_end(task, "now+60");
    let again = TaskState::Pending { reason: "BeginTime".into() };
    wait_until("it is queued again", || states(&cluster, &first) == std::slice::from_ref(&again));
    assert!(workspace.path("checkpoint").exists());
    let waits = TaskState::Pending { reason: "Dependency".into() };
    assert_eq!(states(&cluster, &second), vec![waits; 2]);
    assert_eq!(ends(&cluster, &first), [TaskState::Done]);
    assert_eq!(workspace.left("k0").as_deref(), Some("finished\n"));
    assert_eq!(ends(&cluster, &second), vec![TaskState::Done; 2]);
    let log = workspace.log(task);
    for part in ["go 1,", "wall time over, checkpoint written, queued again", "go 2,"] {
        assert!(log.contains(part), "no {part:?} in\n{log}");
    }
    assert!(fs::read_to_string(workspace.path("logs/k0.log")).unwrap() == log);
}

#[test]
fn a_task_that_overruns_its_wall_time_is_told_as_such() {
    let slurm = Slurm::start();
    let cluster = slurm.cluster();
    let workspace = slurm.workspace("w", "trap '' USR1; echo > \"$0/started\"; while :; do sleep 0.05; done");
    let submission = workspace.submit(&cluster, "deaf", 1, None);
    let task = submission.task(0).unwrap();
    wait_for(&workspace.path("started"));
    assert_eq!(states(&cluster, &submission), [TaskState::Running]);
    slurm.set_end(task, "now");
    assert_eq!(ends(&cluster, &submission), [TaskState::TimedOut]);
}
