//! Arrays: all tasks run, each with its key, in parts where they must be; what waits for what.

use crate::cluster::{MAX_ARRAY_SIZE, Slurm, ends, jobs, states, wait_for, wait_until};
use std::fs;
use tollgate::campaign::slurm::{Prerequisite, TaskState};

#[test]
fn twelve_tasks_run_in_three_parts_whatever_the_workspace_is_called() {
    let slurm = Slurm::start();
    let cluster = slurm.cluster();
    assert_eq!(cluster.settings().max_array_size, MAX_ARRAY_SIZE);
    let workspace = slurm.workspace("it's a \"50%a\" $HOME é", "echo \"$1 $3 $PWD\" > \"$0/$1\"; pwd");
    let submission = workspace.submit(&cluster, "heap", 12, None);
    let counts: Vec<u64> = submission.jobs.iter().map(|job| job.count).collect();
    assert_eq!(counts, [5, 5, 2]);
    assert_eq!(ends(&cluster, &submission), vec![TaskState::Done; 12]);
    for (line, task) in submission.tasks() {
        let key = format!("k{line}");
        let folder = workspace.path("").to_str().unwrap().trim_end_matches('/').to_owned();
        assert_eq!(workspace.left(&key).as_deref(), Some(format!("{key} 1 {folder}\n").as_str()));
        let log = workspace.log(task);
        assert!(log.contains(&format!("key {key} on")) && log.contains(&folder), "{log}");
        assert_eq!(fs::read_to_string(workspace.path(&format!("logs/{key}.log"))).unwrap(), log);
    }
}

#[test]
fn variants_wait_for_the_task_that_they_need() {
    let slurm = Slurm::start();
    let cluster = slurm.cluster();
    // The second of three is the one that is waited for.
    let upstream =
        slurm.workspace("upstream", "[ $1 != k1 ] || until [ -e \"$0/go\" ]; do sleep 0.05; done; echo > \"$0/$1\"");
    let first = upstream.submit(&cluster, "fill", 3, None);
    let needed = [Prerequisite::Task(first.task(1).unwrap())];
    let variants = slurm.workspace("variants", "[ -e \"$0/../upstream/k1\" ] && echo > \"$0/$1\"");
    let second = variants.after(&cluster, "variants", 6, &needed);
    // These wait for each of those, one by one.
    let third = variants.after(&cluster, "measure", 6, &[Prerequisite::SameLine(second.clone())]);
    wait_for(&upstream.path("k0"));
    wait_for(&upstream.path("k2"));
    let waits = TaskState::Pending { reason: "Dependency".into() };
    assert_eq!(states(&cluster, &second), vec![waits.clone(); 6]);
    assert_eq!(states(&cluster, &third), vec![waits; 6]);
    assert_eq!(states(&cluster, &first)[1], TaskState::Running);
    fs::write(upstream.path("go"), "").unwrap();
    assert_eq!(ends(&cluster, &third), vec![TaskState::Done; 6]);
    assert_eq!(ends(&cluster, &second), vec![TaskState::Done; 6]);
    assert_eq!(jobs(&second).len(), 2);
}

#[test]
fn a_throttle_keeps_tasks_waiting() {
    let slurm = Slurm::start();
    let cluster = slurm.cluster();
    let workspace = slurm.workspace("w", "echo > \"$0/$1\"; until [ -e \"$0/go\" ]; do sleep 0.05; done");
    let submission = workspace.submit(&cluster, "heap", 3, Some(1));
    wait_for(&workspace.path("k0"));
    // A processor is free, and nobody takes it.
    let limited = TaskState::Pending { reason: "JobArrayTaskLimit".into() };
    wait_until("the others wait for the limit", || {
        states(&cluster, &submission)[1..] == [limited.clone(), limited.clone()]
    });
    assert!(!workspace.path("k1").exists());
    fs::write(workspace.path("go"), "").unwrap();
    assert_eq!(ends(&cluster, &submission), vec![TaskState::Done; 3]);
}
