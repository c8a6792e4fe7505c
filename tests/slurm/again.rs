//! A task whose wall time is over writes a checkpoint, is queued again and goes on, while others wait for it.

use crate::cluster::{Slurm, ends, states, wait_for, wait_until};
use std::fs;
use tollgate::campaign::slurm::{Prerequisite, TaskState};

/// Goes on at the second time, as one does that has a checkpoint.
const TASK: &str = "if [ -e \"$0/checkpoint\" ]; then echo finished > \"$0/$1\"; exit 0; fi; \
                    trap 'sleep 0.2; echo > \"$0/checkpoint\"; exit 130' TERM; echo > \"$0/started\"; while :; do sleep 0.05; done";

/// Ignores that it should write a checkpoint.
const DEAF: &str = "trap '' TERM; echo > \"$0/started\"; while :; do sleep 0.05; done";

/// One test for both, since Slurm looks at wall times every 30 s only. Its file is called so that it starts first.
#[test]
fn a_task_goes_on_after_its_wall_time_while_others_wait_and_one_that_overruns_it_is_ended() {
    let slurm = Slurm::start();
    let cluster = slurm.cluster();
    let deaf = slurm.workspace("deaf", DEAF);
    let overrun = deaf.submit(&cluster, "deaf", 1, None);
    let workspace = slurm.workspace("it's w", TASK);
    let first = workspace.submit(&cluster, "long", 1, None);
    let task = first.task(0).unwrap();
    let after = [Prerequisite::All(first.clone())];
    let dependents = slurm.workspace("dependents", "echo > \"$0/$1\"");
    let second = dependents.after(&cluster, "after", 2, &after);
    wait_for(&workspace.path("started"));
    wait_for(&deaf.path("started"));
    // The signal is due 60 s before the end.
    slurm.set_end(task, "now+60");
    slurm.set_end(overrun.task(0).unwrap(), "now");
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
    assert_eq!(ends(&cluster, &overrun), [TaskState::TimedOut]);
}
