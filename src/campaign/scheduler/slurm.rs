//! On a cluster with Slurm: tasks that wait for the same are an array job, tasks downstream wait for those upstream in Slurm's own
//! queue, so that a campaign goes on when its scheduler is gone. Which job computes which task is written down in the workspace; one
//! that is started again finds its jobs there. Whether a result is there the workspace alone decides.

use super::{Board, Outcome};
use crate::campaign::CampaignError;
use crate::campaign::slurm::{
    ArrayJob, ArrayRequest, Cluster, Commands, Prerequisite, Site, SlurmError, Submission, TaskId, TaskScript,
    TaskState, write_tasks,
};
use crate::campaign::status::State;
use crate::campaign::workspace::Failure;
use crate::exit_code;
use crate::output::tally::Tally;
use crate::storage::StorageError;
use crate::storage::staging::write_whole;
use serde::{Deserialize, Serialize};
use std::collections::{BTreeMap, BTreeSet};
use std::ffi::OsString;
use std::fs;
use std::path::PathBuf;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

/// First and longest time between two looks at the queue.
const LOOKS: [Duration; 2] = [Duration::from_millis(500), Duration::from_secs(15)];
/// Looks at which the result of a task that ended well may still be on its way through a network file system.
const LATE_LOOKS: u32 = 8;
/// Memory asked for over what is predicted [-], and beside it [bytes].
const MEMORY_MARGIN: (f64, f64) = (1.5, 200e6);
/// Memory asked for where nothing is known [bytes].
const UNKNOWN_MEMORY: f64 = 2e9;

/// What is asked of it.
#[derive(Debug)]
pub struct Request {
    /// What the cluster wants to know.
    pub site: Site,
    /// How Slurm's commands are called.
    pub commands: Commands,
    /// This program.
    pub program: PathBuf,
}

impl From<SlurmError> for CampaignError {
    fn from(error: SlurmError) -> Self {
        match error {
            SlurmError::Storage(error) => Self::Storage(error),
            other => Self::Slurm(other),
        }
    }
}

/// An array of tasks that was submitted.
#[derive(Debug, Clone, Serialize, Deserialize)]
struct Submitted {
    /// Names of its tasks, line by line.
    names: Vec<String>,
    /// Its jobs.
    submission: Submission,
}

/// Computes all tasks that are due. Interrupted, it leaves its jobs in the queue: they go on.
///
/// # Errors
/// When something was begun or lacks outputs and it is not said what to do with it, Slurm refuses, or the disk does.
pub fn run(
    board: Board<'_>,
    request: &Request,
    tally: &mut Tally,
    interrupted: &AtomicBool,
) -> Result<Outcome, CampaignError> {
    let cluster = Cluster::connect(request.commands.clone())?;
    let mut scheduler = Scheduler::new(board, request, cluster)?;
    scheduler.look_at_queue()?;
    scheduler.expect_the_live();
    scheduler.board.take_up()?;
    let mut pause = LOOKS[0];
    loop {
        scheduler.submit(tally)?;
        scheduler.board.show(tally, scheduler.running());
        if interrupted.load(Ordering::Relaxed) || !scheduler.is_waiting() {
            break;
        }
        std::thread::sleep(pause);
        pause = LOOKS[1].min(pause.mul_f64(1.2));
        scheduler.look_at_queue()?;
        scheduler.board.refresh();
        scheduler.judge(tally)?;
    }
    Ok(scheduler.board.outcome(interrupted.load(Ordering::Relaxed)))
}

struct Scheduler<'a> {
    board: Board<'a>,
    request: &'a Request,
    cluster: Cluster,
    /// Tasks of the graph by their names.
    index: BTreeMap<String, usize>,
    submitted: Vec<Submitted>,
    /// The last job of each task, and what Slurm says of it.
    jobs: BTreeMap<usize, (TaskId, TaskState)>,
    /// Looks since a task ended in Slurm without a fact in the workspace.
    late: BTreeMap<usize, u32>,
}

impl<'a> Scheduler<'a> {
    fn new(board: Board<'a>, request: &'a Request, cluster: Cluster) -> Result<Self, CampaignError> {
        let index = board.graph.tasks.iter().enumerate().map(|(index, task)| (task.name(), index)).collect();
        let place = board.workspace.root.join(RECORD);
        let submitted = match fs::read(&place) {
            Ok(text) => serde_json::from_slice(&text)
                .map_err(|error| StorageError::unusable(&place, format!("it is no list of jobs ({error})")))?,
            Err(_) => Vec::new(),
        };
        Ok(Self { board, request, cluster, index, submitted, jobs: BTreeMap::new(), late: BTreeMap::new() })
    }

    /// Asks Slurm about the jobs of all tasks that have no result.
    fn look_at_queue(&mut self) -> Result<(), CampaignError> {
        let is_open = |name: &String| {
            self.index.get(name).is_some_and(|index| {
                !matches!(self.board.states[*index], State::Stored(_) | State::NotNeeded | State::Failed(_))
            })
        };
        let mut asked: Vec<ArrayJob> = Vec::new();
        for one in &self.submitted {
            let has_open =
                |job: &&ArrayJob| job.tasks().any(|(line, _)| one.names.get(line as usize).is_some_and(is_open));
            asked.extend(one.submission.jobs.iter().filter(has_open));
        }
        if asked.is_empty() {
            self.jobs.clear();
            return Ok(());
        }
        let states = self.cluster.states(&asked)?;
        self.jobs.clear();
        // Later submissions of a task stand for it.
        for one in &self.submitted {
            for (line, id) in one.submission.tasks() {
                let index = one.names.get(line as usize).and_then(|name| self.index.get(name));
                if let (Some(index), Some(state)) = (index, states.get(&id)) {
                    self.jobs.insert(*index, (id, state.clone()));
                }
            }
        }
        Ok(())
    }

    /// What waits or runs in Slurm will go on by itself, also where it was begun: it is queued again with its checkpoint.
    fn expect_the_live(&mut self) {
        let live: BTreeSet<usize> =
            self.jobs.iter().filter(|(_, (_, state))| state.is_live()).map(|(index, _)| *index).collect();
        self.board.expected = (0..self.board.graph.tasks.len()).map(|index| live.contains(&index)).collect();
    }

    fn is_live(&self, index: usize) -> bool {
        self.jobs.get(&index).is_some_and(|(_, state)| state.is_live())
    }

    fn running(&self) -> usize {
        self.jobs.values().filter(|(_, state)| *state == TaskState::Running).count()
    }

    fn is_waiting(&self) -> bool {
        self.board.is_waiting() || (0..self.board.states.len()).any(|index| self.is_live(index))
    }

    /// Submits what is due and not in the queue, upstream first. What waits for a task that another process computes comes later.
    fn submit(&mut self, tally: &mut Tally) -> Result<(), CampaignError> {
        let mut groups: BTreeMap<(Vec<usize>, u32, u64), Vec<usize>> = BTreeMap::new();
        let mut depth: BTreeMap<usize, usize> = BTreeMap::new();
        for (index, task) in self.board.graph.tasks.iter().enumerate() {
            if self.board.states[index] != State::Due || self.is_live(index) || self.late.contains_key(&index) {
                continue;
            }
            let missing: Vec<usize> = task
                .upstream
                .iter()
                .copied()
                .filter(|by| !matches!(self.board.states[*by], State::Stored(_)))
                .collect();
            let is_known = |by: &usize| self.is_live(*by) || depth.contains_key(by);
            if !missing.iter().all(is_known) {
                continue;
            }
            depth.insert(index, missing.iter().map(|by| depth.get(by).map_or(0, |depth| depth + 1)).max().unwrap_or(0));
            let ranks = task.cores.map_or(1, |cores| u32::try_from(cores).unwrap_or(u32::MAX));
            let predicted =
                task.forecast.memory_bytes.map_or(UNKNOWN_MEMORY, |bytes| bytes * MEMORY_MARGIN.0 + MEMORY_MARGIN.1);
            // In steps, so that tasks of about the same size are one array.
            let memory = (predicted / 256e6).ceil() * 256e6;
            groups.entry((missing, ranks, memory as u64)).or_default().push(index);
        }
        let mut order: Vec<_> = groups.into_iter().collect();
        order.sort_by_key(|(_, members)| depth[&members[0]]);
        for ((missing, ranks, memory), members) in order {
            self.submit_array(&missing, ranks, memory, &members)?;
            tally.say(&format!("submitted {} stages as an array", members.len()));
        }
        Ok(())
    }

    fn submit_array(
        &mut self,
        missing: &[usize],
        ranks: u32,
        memory: u64,
        members: &[usize],
    ) -> Result<(), CampaignError> {
        let root = std::path::absolute(&self.board.workspace.root)
            .map_err(|source| StorageError::system("find", &self.board.workspace.root, source))?;
        let folder = root.join("slurm");
        let number = self.submitted.len();
        let (script, tasks, logs) =
            (folder.join(format!("{number:04}.sh")), folder.join(format!("{number:04}.tasks")), folder.join("logs"));
        for index in members {
            self.board.write_order(*index)?;
        }
        let names: Vec<String> = members.iter().map(|index| self.board.graph.tasks[*index].name()).collect();
        write_tasks(&tasks, &names)?;
        let command: Vec<OsString> =
            vec![self.request.program.clone().into(), "campaign".into(), "task".into(), root.clone().into()];
        let title = format!("{}: {}", self.board.campaign.name, self.board.graph.tasks[members[0]].group());
        let task_script = TaskScript {
            site: &self.request.site,
            command: &command,
            tasks: &tasks,
            logs: &logs,
            title: &title,
            threads: 1,
            ranks,
            memory,
        };
        task_script.write(&script)?;
        let after: Vec<Prerequisite> =
            missing.iter().filter_map(|index| Some(Prerequisite::Task(self.jobs.get(index)?.0))).collect();
        let request = ArrayRequest {
            script: &script,
            count: members.len() as u64,
            name: &self.board.campaign.name,
            workspace: &root,
            logs: &logs,
            after: &after,
            throttle: self.request.site.throttle,
            max_array_size: self.request.site.max_array_size,
        };
        let submission = self.cluster.submit(&request)?;
        for (line, id) in submission.tasks() {
            let pending = TaskState::Pending { reason: "Submitted".to_owned() };
            self.jobs.insert(members[line as usize], (id, pending));
        }
        self.submitted.push(Submitted { names, submission });
        let text = serde_json::to_vec_pretty(&self.submitted).expect("a list of jobs is names and numbers");
        write_whole(&self.board.workspace.root.join(RECORD), &text)?;
        Ok(())
    }

    /// What ended in Slurm and left no fact in the workspace.
    fn judge(&mut self, tally: &mut Tally) -> Result<(), CampaignError> {
        let mut hopeless: Vec<TaskId> = Vec::new();
        let jobs: Vec<(usize, TaskId, TaskState)> =
            self.jobs.iter().map(|(index, (id, state))| (*index, *id, state.clone())).collect();
        for (index, id, state) in jobs {
            let is_settled = matches!(
                self.board.states[index],
                State::Stored(_) | State::Failed(_) | State::NotNeeded | State::Running(_)
            );
            if state == TaskState::DependencyNeverSatisfied {
                hopeless.push(id);
            }
            if is_settled || state.is_live() || state == TaskState::DependencyNeverSatisfied || self.board.killed[index]
            {
                self.late.remove(&index);
                continue;
            }
            let name = self.board.graph.tasks[index].name();
            let looks = self.late.entry(index).or_insert(0);
            *looks += 1;
            if *looks <= LATE_LOOKS && matches!(state, TaskState::Done | TaskState::Failed { .. }) {
                continue;
            }
            self.late.remove(&index);
            let code = match &state {
                TaskState::Failed { exit_code, .. } if *exit_code > 0 => *exit_code,
                _ => exit_code::SYSTEM,
            };
            match state {
                // Nothing of its own: it is gone on with when asked.
                TaskState::Cancelled | TaskState::NodeFailure | TaskState::Unknown => self.board.killed[index] = true,
                TaskState::Failed { exit_code: exit_code::SYSTEM, .. } => {
                    self.board.killed[index] = true;
                    self.board.stopped = Some(format!("stage {name}: {}", self.log_of(&name)));
                }
                TaskState::Failed { exit_code: exit_code::INTERRUPTED, .. } => self.board.killed[index] = true,
                _ => {
                    let reason = format!("Slurm's task {id}: {}: {}", words(&state), self.log_of(&name));
                    tally.say(&format!("failed: {reason}"));
                    let failure = Failure { exit_code: code, reason, host: "slurm".to_owned() };
                    self.board.workspace.note_failure(&name, &failure)?;
                }
            }
        }
        if !hopeless.is_empty() {
            self.cluster.cancel_tasks(&hopeless)?;
            hopeless.iter().for_each(|id| self.jobs.retain(|_, (other, _)| other != id));
        }
        self.board.refresh();
        Ok(())
    }

    /// The last line of a task's log.
    fn log_of(&self, name: &str) -> String {
        let place = self.board.workspace.root.join("slurm/logs").join(format!("{name}.log"));
        let text = fs::read_to_string(place).unwrap_or_default();
        text.lines().rev().find(|line| !line.trim().is_empty()).unwrap_or("it said nothing").trim().to_owned()
    }
}

/// Where it is written down which jobs compute which tasks.
const RECORD: &str = "slurm/jobs.json";

fn words(state: &TaskState) -> String {
    match state {
        TaskState::Done => "it ended well, and left no result".to_owned(),
        TaskState::Failed { exit_code, signal: 0 } => format!("it ended with exit status {exit_code}"),
        TaskState::Failed { signal, .. } => format!("it was ended by signal {signal}"),
        TaskState::TimedOut => {
            "its wall time was over before it had written a checkpoint; give a longer signal_lead".to_owned()
        }
        TaskState::OutOfMemory => {
            "it needed more memory than it had asked for; give `memory` in the site file".to_owned()
        }
        other => format!("{other}"),
    }
}
