//! How tasks end, and what is said of it.

use crate::cluster::{Slurm, ends, states, wait_for, wait_until};
use tollgate::campaign::slurm::{
    ArrayJob, ArrayRequest, Cluster, Commands, Prerequisite, SlurmError, TaskId, TaskState,
};

#[test]
fn a_failed_task_keeps_its_dependents_from_starting_and_nobody_else() {
    let slurm = Slurm::start();
    let cluster = slurm.cluster();
    let workspace = slurm.workspace("w", "[ $1 != k1 ] || exit 3; echo > \"$0/$1\"");
    let first = workspace.submit(&cluster, "fill", 3, None);
    let after = |line| [Prerequisite::Task(first.task(line).unwrap())];
    let hopeless = workspace.after(&cluster, "hopeless", 2, &after(1));
    let others = slurm.workspace("others", "echo > \"$0/$1\"").after(&cluster, "others", 2, &after(2));
    let failed = TaskState::Failed { exit_code: 3, signal: 0 };
    assert_eq!(ends(&cluster, &first), [TaskState::Done, failed, TaskState::Done]);
    assert_eq!(ends(&cluster, &others), vec![TaskState::Done; 2]);
    assert_eq!(ends(&cluster, &hopeless), vec![TaskState::DependencyNeverSatisfied; 2]);
    cluster.cancel(&hopeless.jobs).unwrap();
    wait_until("the hopeless are gone", || slurm.command("squeue", &["--noheader"]).stdout.is_empty());
    assert_eq!(states(&cluster, &hopeless), vec![TaskState::DependencyNeverSatisfied; 2], "the reason is kept");
}

#[test]
fn states_of_tasks_that_run_wait_end_and_are_cancelled() {
    let slurm = Slurm::start();
    let cluster = slurm.cluster();
    let workspace = slurm.workspace(
        "w",
        "case $1 in k0) exit 0 ;; k1) exit 7 ;; k2) kill -9 $PPID ;; *) echo > \"$0/$1\"; exec sleep 1000 ;; esac",
    );
    let submission = workspace.submit(&cluster, "heap", 6, None);
    // On two processors, the fourth and fifth run, and the sixth has no place.
    wait_for(&workspace.path("k3"));
    wait_for(&workspace.path("k4"));
    let failed = |exit_code, signal| TaskState::Failed { exit_code, signal };
    let expected = [TaskState::Done, failed(7, 0), failed(0, 9), TaskState::Running, TaskState::Running];
    wait_until("those before have ended", || states(&cluster, &submission)[..5] == expected);
    assert!(matches!(&states(&cluster, &submission)[5], TaskState::Pending { .. }));
    // One that runs and one that waits; what runs needs a moment to end.
    let tasks = [3, 5].map(|line| submission.task(line).unwrap());
    cluster.cancel_tasks(&tasks).unwrap();
    let cancelled = |line: usize| states(&cluster, &submission)[line] == TaskState::Cancelled;
    wait_until("both are cancelled", || cancelled(3) && cancelled(5));
    assert_eq!(states(&cluster, &submission)[4], TaskState::Running);
    cluster.cancel(&submission.jobs).unwrap();
    wait_until("all are cancelled", || cancelled(4));
    assert_eq!(states(&cluster, &submission)[..2], expected[..2], "what has ended stays as it is");
    // Nobody has heard of it; and together with one that is known.
    let strange = ArrayJob { job: 4711, first: 0, count: 1 };
    let unknown = TaskId { job: 4711, index: 0 };
    assert_eq!(cluster.states(&[strange]).unwrap()[&unknown], TaskState::Unknown);
    let mut all = submission.jobs.clone();
    all.push(strange);
    let found = cluster.states(&all).unwrap();
    assert_eq!((found.len(), &found[&unknown]), (7, &TaskState::Unknown));
    cluster.cancel(&all).unwrap();
    cluster.cancel(&[strange]).unwrap();
}

#[test]
fn a_site_that_the_cluster_does_not_know_is_refused_in_its_words() {
    let slurm = Slurm::start();
    let cluster = slurm.cluster();
    let workspace = slurm.workspace("w", "true");
    let site = "wall_time = \"1 h\"\naccount = \"chemeng\"\npartition = \"short\"\nmodules = [\"gcc/12\"]\nsbatch = [\"--nice=5\"]";
    let script = workspace.write("heap", 2, site);
    let text = std::fs::read_to_string(&script).unwrap();
    for line in ["#SBATCH --account=chemeng", "#SBATCH --partition=short", "#SBATCH --nice=5"] {
        assert!(text.lines().any(|found| found == line), "no {line} in\n{text}");
    }
    assert!(text.contains("\nmodule load gcc/12 ||"), "{text}");
    let logs = workspace.path("logs");
    let request = ArrayRequest {
        script: &script,
        count: 2,
        name: "heap",
        workspace: &workspace.path(""),
        logs: &logs,
        after: &[],
        throttle: None,
        max_array_size: None,
    };
    let error = cluster.submit(&request).unwrap_err();
    assert!(matches!(error, SlurmError::Failed { .. }), "{error:?}");
    assert!(error.to_string().contains("invalid partition specified: short"), "{error}");
    // A partition that exists, and everything else as before: the cluster keeps no accounts, and takes any name.
    let script = workspace.write("heap", 2, &site.replace("short", "main"));
    let submission = cluster.submit(&ArrayRequest { script: &script, ..request }).unwrap();
    // There are no modules here.
    assert_eq!(ends(&cluster, &submission), vec![TaskState::Failed { exit_code: 3, signal: 0 }; 2]);
    let task = submission.task(0).unwrap();
    assert!(workspace.log(task).contains("the module gcc/12 cannot be loaded"), "{}", workspace.log(task));
    let shown = slurm.command("scontrol", &["show", "job", &task.to_string()]);
    let shown = String::from_utf8(shown.stdout).unwrap();
    assert!(shown.contains("Account=chemeng") && shown.contains("Nice=5"), "{shown}");
}

#[test]
fn where_the_commands_are_missing_it_is_said_where_to_go() {
    let error = Cluster::connect(Commands::default().with_variable("PATH", "")).unwrap_err();
    assert!(matches!(error, SlurmError::Missing { .. }), "{error:?}");
    assert!(error.to_string().contains("Slurm's commands are not here"), "{error}");
}
