//! Who computes what when, on this computer: fills the cores, respects the memory, goes on where a task fails.
//!
//! Every task is a process of its own. The scheduler knows nothing that is not on disk: two of them on one campaign, or one that
//! is started again, see the same facts, and the claims decide who computes what.

use super::CampaignError;
use super::claim::{Holder, Watch};
use super::file::Campaign;
use super::status::{State, states};
use super::task::{Graph, Task};
use super::workspace::{Failure, Workspace};
use crate::backend::native::processor::physical_cores;
use crate::exit_code;
use crate::output::tally::Tally;
use crate::storage::StorageError;
use rustix::process::{Pid, Signal, kill_process};
use std::fs::{self, File};
use std::os::unix::process::ExitStatusExt as _;
use std::path::PathBuf;
use std::process::{Child, Command, ExitStatus, Stdio};
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

/// Time between two looks at the processes.
const LOOK: Duration = Duration::from_millis(50);
/// Time between two looks at what other schedulers have done.
const LOOK_AROUND: Duration = Duration::from_secs(2);
/// Share of the available memory that predicted needs may fill.
const MEMORY_SHARE: f64 = 0.9;

/// What is asked of a scheduler.
#[derive(Debug, Clone, Default)]
pub struct Request {
    /// Tasks at a time; `None` for one a physical core.
    pub jobs: Option<usize>,
    /// What is computed although something of it is there.
    pub rerun: Rerun,
    /// This program.
    pub program: PathBuf,
}

/// What is computed although something of it is there.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Rerun {
    /// What failed, from its start.
    pub failed: bool,
    /// What lacks outputs that are asked for now, from its start.
    pub outputs: bool,
    /// What was begun and has not ended, from its last checkpoint.
    pub resume: bool,
}

/// How a campaign ended.
#[derive(Debug, Clone, PartialEq)]
pub struct Outcome {
    /// States of all tasks.
    pub states: Vec<State>,
    /// True where it was interrupted.
    pub was_interrupted: bool,
    /// Why no further task was started: the system failed.
    pub stopped: Option<String>,
    /// True where the scenes of some variants cannot run.
    pub has_refused: bool,
}

impl Outcome {
    /// The exit status of the campaign.
    #[must_use]
    pub fn exit_code(&self) -> u8 {
        let is_done = |state: &State| matches!(state, State::Stored(_) | State::NotNeeded);
        if self.stopped.is_some() {
            exit_code::SYSTEM
        } else if self.was_interrupted {
            exit_code::INTERRUPTED
        } else if self.states.iter().all(is_done) && !self.has_refused {
            exit_code::DONE
        } else {
            exit_code::VARIANTS_FAILED
        }
    }
}

/// A process that computes a task.
struct Running {
    task: usize,
    child: Child,
    threads: usize,
    memory: f64,
}

/// Computes all tasks of a graph that are due.
///
/// # Errors
/// When something was begun or lacks outputs and the request does not say what to do with it, or the disk refuses.
pub fn run(
    workspace: &Workspace,
    campaign: &Campaign,
    graph: &Graph,
    request: &Request,
    tally: &mut Tally,
    interrupted: &AtomicBool,
) -> Result<Outcome, CampaignError> {
    let mut scheduler = Scheduler {
        workspace,
        campaign,
        graph,
        request,
        watch: Watch::default(),
        states: Vec::new(),
        running: Vec::new(),
        killed: vec![false; graph.tasks.len()],
        stopped: None,
        cores: physical_cores(),
        memory: available_memory() * MEMORY_SHARE,
    };
    scheduler.states = states(workspace, graph, &mut scheduler.watch);
    scheduler.take_up()?;
    scheduler.until_done(tally, interrupted)?;
    Ok(Outcome {
        states: states(workspace, graph, &mut scheduler.watch),
        was_interrupted: interrupted.load(Ordering::Relaxed),
        stopped: scheduler.stopped,
        has_refused: graph.runs.iter().any(|run| run.refused.is_some()),
    })
}

struct Scheduler<'a> {
    workspace: &'a Workspace,
    campaign: &'a Campaign,
    graph: &'a Graph,
    request: &'a Request,
    watch: Watch,
    states: Vec<State>,
    running: Vec<Running>,
    /// Tasks whose process was killed while this scheduler watched: not started again by it.
    killed: Vec<bool>,
    stopped: Option<String>,
    cores: usize,
    memory: f64,
}

impl Scheduler<'_> {
    /// What was begun, failed or lacks outputs is taken up, or refused.
    fn take_up(&mut self) -> Result<(), CampaignError> {
        let of = |wanted: fn(&State) -> bool| {
            let found = self.graph.tasks.iter().zip(&self.states).filter(move |(_, state)| wanted(state));
            found.map(|(task, _)| task).collect::<Vec<&Task>>()
        };
        if self.request.rerun.failed {
            for task in of(|state| matches!(state, State::Failed(_))) {
                self.workspace.forget_failure(&task.group(), &task.name())?;
            }
        }
        let begun = of(|state| matches!(state, State::Begun));
        if !self.request.rerun.resume && !begun.is_empty() {
            return Err(CampaignError::Request(format!(
                "{} stages were begun and have not ended ({}): go on with --resume",
                begun.len(),
                some(&begun)
            )));
        }
        let lacking: Vec<&Vec<String>> = self
            .states
            .iter()
            .filter_map(|state| match state {
                State::Lacking(outputs) => Some(outputs),
                _ => None,
            })
            .collect();
        if let (false, Some(first)) = (self.request.rerun.outputs, lacking.first()) {
            return Err(CampaignError::Request(format!(
                "{} stored stages lack outputs that are asked for now ({}); compute them again with --rerun outputs, or take these outputs back",
                lacking.len(),
                first.join(", ")
            )));
        }
        self.refresh();
        Ok(())
    }

    /// The states as the disk tells them; what is to be computed although something of it is there becomes due.
    fn refresh(&mut self) {
        self.states = states(self.workspace, self.graph, &mut self.watch);
        for index in 0..self.states.len() {
            let is_taken_up = match &self.states[index] {
                State::Begun => !self.killed[index],
                State::Lacking(_) => self.request.rerun.outputs,
                State::HeldUp(_) => true,
                _ => false,
            };
            if is_taken_up {
                self.states[index] = State::Due;
            }
            let stops =
                |state: &State| matches!(state, State::Failed(_) | State::Lacking(_) | State::HeldUp(_) | State::Begun);
            let upstream = &self.graph.tasks[index].upstream;
            if self.states[index] == State::Due
                && let Some(by) = upstream.iter().find(|by| stops(&self.states[**by]))
            {
                self.states[index] = State::HeldUp(*by);
            }
        }
    }

    fn until_done(&mut self, tally: &mut Tally, interrupted: &AtomicBool) -> Result<(), CampaignError> {
        let mut looked = Instant::now();
        let mut was_told = false;
        loop {
            let may_start = self.stopped.is_none() && !interrupted.load(Ordering::Relaxed);
            if may_start {
                self.start_what_can(tally)?;
            } else if !was_told {
                was_told = true;
                self.tell_all();
            }
            self.show(tally);
            if self.running.is_empty() && (!may_start || !self.is_waiting()) {
                return Ok(());
            }
            std::thread::sleep(LOOK);
            let ended = self.wait(tally)?;
            if ended || looked.elapsed() >= LOOK_AROUND {
                looked = Instant::now();
                self.refresh();
            }
        }
    }

    /// Whether something is still to come: due, or computed by somebody.
    fn is_waiting(&self) -> bool {
        let is_open = |(state, killed): (&State, &bool)| matches!(state, State::Due | State::Running(_)) && !killed;
        self.states.iter().zip(&self.killed).any(is_open)
    }

    /// Starts tasks while there are cores and memory: what has most downstream of it first, then in the order of variants.
    fn start_what_can(&mut self, tally: &mut Tally) -> Result<(), CampaignError> {
        let jobs = self.request.jobs.unwrap_or(self.cores).max(1);
        let is_here = |index: &usize| self.running.iter().any(|running| running.task == *index);
        let is_ready = |index: &usize| {
            let is_there = |upstream: &usize| matches!(self.states[*upstream], State::Stored(_));
            self.states[*index] == State::Due
                && !self.killed[*index]
                && !is_here(index)
                && self.graph.tasks[*index].upstream.iter().all(is_there)
        };
        let mut ready: Vec<usize> = (0..self.states.len()).filter(is_ready).collect();
        ready.sort_by_key(|index| std::cmp::Reverse(self.graph.tasks[*index].users));
        for (position, index) in ready.iter().enumerate() {
            let free_jobs = jobs.saturating_sub(self.running.len());
            let used: usize = self.running.iter().map(|running| running.threads).sum();
            let free_cores = self.cores.saturating_sub(used).max(usize::from(free_jobs > 0));
            if free_jobs == 0 {
                return Ok(());
            }
            let memory = self.graph.tasks[*index].forecast.memory_bytes.unwrap_or(0.0);
            let taken: f64 = self.running.iter().map(|running| running.memory).sum();
            if !self.running.is_empty() && taken + memory > self.memory {
                return Ok(());
            }
            // Fewer tasks than cores share them: threads change no bit.
            let shared = (free_cores / (ready.len() - position).min(free_jobs)).max(1);
            let threads = self.graph.tasks[*index].cores.unwrap_or(shared);
            if !self.running.is_empty() && threads > free_cores {
                return Ok(());
            }
            self.start(*index, threads, memory)?;
            tally.say(&format!("started {} {}", self.graph.tasks[*index].group(), self.graph.tasks[*index].name()));
        }
        Ok(())
    }

    fn start(&mut self, index: usize, threads: usize, memory: f64) -> Result<(), CampaignError> {
        let task = &self.graph.tasks[index];
        let name = task.name();
        let place = |index: &usize| {
            let other = &self.graph.tasks[*index];
            let folder = match &self.states[*index] {
                State::Stored(folder) => folder.clone(),
                _ => other.name(),
            };
            (other.stage.clone(), PathBuf::from("stages").join(other.group()).join(folder))
        };
        self.workspace.write_order(self.campaign, task, task.upstream.iter().map(place).collect())?;
        let log = self.workspace.log(&name);
        let folder = log.parent().expect("a log is in a folder");
        fs::create_dir_all(folder).map_err(|source| StorageError::system("make the folder", folder, source))?;
        let file = File::options().create(true).append(true).open(&log);
        let file = file.map_err(|source| StorageError::system("create", &log, source))?;
        let copy = file.try_clone().map_err(|source| StorageError::system("open", &log, source))?;
        let child = Command::new(&self.request.program)
            .args(["campaign", "task"])
            .arg(&self.workspace.root)
            .arg(&name)
            .args(["--threads", &threads.to_string(), "--parent", &std::process::id().to_string()])
            .stdin(Stdio::null())
            .stdout(file)
            .stderr(copy)
            .spawn()
            .map_err(|source| StorageError::system("start", &self.request.program, source))?;
        self.running.push(Running { task: index, child, threads, memory });
        Ok(())
    }

    /// Looks after the processes; whether one has ended.
    fn wait(&mut self, tally: &mut Tally) -> Result<bool, CampaignError> {
        let mut ended = Vec::new();
        for (place, running) in self.running.iter_mut().enumerate() {
            match running.child.try_wait() {
                Ok(Some(status)) => ended.push((place, status)),
                Ok(None) => {}
                Err(source) => return Err(StorageError::system("wait for", &self.request.program, source).into()),
            }
        }
        for (place, status) in ended.iter().rev() {
            let running = self.running.remove(*place);
            self.ended(running.task, *status, tally)?;
        }
        Ok(!ended.is_empty())
    }

    fn ended(&mut self, index: usize, status: ExitStatus, tally: &mut Tally) -> Result<(), CampaignError> {
        let task = &self.graph.tasks[index];
        let (group, name) = (task.group(), task.name());
        let code = status.code().and_then(|code| u8::try_from(code).ok());
        match (code, status.signal()) {
            (Some(exit_code::DONE | exit_code::INTERRUPTED), _) => {}
            (Some(exit_code::SYSTEM), _) => {
                self.stopped = Some(format!("stage {group}: {}", self.last_words(&name)));
                // Begun and not ended, not failed.
                self.killed[index] = true;
            }
            (Some(code), _) => {
                if self.workspace.failure(&name).is_none() {
                    let reason = format!("its process ended with exit status {code}: {}", self.last_words(&name));
                    let host = Holder::this_process().host;
                    self.workspace.note_failure(&name, &Failure { exit_code: code, reason, host })?;
                }
                let reason = self.workspace.failure(&name).map_or_else(String::new, |failure| failure.reason);
                tally.say(&format!("failed: {group} {name}: {}", reason.lines().next().unwrap_or_default()));
            }
            (None, signal) => {
                self.killed[index] = true;
                let number = signal.map_or_else(String::new, |signal| format!(" by signal {signal}"));
                tally.say(&format!("killed{number}: {group} {name}; go on with --resume"));
            }
        }
        Ok(())
    }

    /// The last line of a task's log.
    fn last_words(&self, name: &str) -> String {
        let text = fs::read_to_string(self.workspace.log(name)).unwrap_or_default();
        let line = text.lines().rev().find(|line| !line.trim().is_empty());
        line.unwrap_or("it said nothing").trim().to_owned()
    }

    /// Asks all processes to end with a checkpoint.
    fn tell_all(&self) {
        for running in &self.running {
            if let Some(process) = i32::try_from(running.child.id()).ok().and_then(Pid::from_raw) {
                // One that has just ended needs no telling.
                let _ = kill_process(process, Signal::TERM);
            }
        }
    }

    fn show(&self, tally: &mut Tally) {
        let mut done = (0, 0.0);
        let mut all = (0, 0.0);
        let mut failed = 0;
        for (task, state) in self.graph.tasks.iter().zip(&self.states) {
            if *state == State::NotNeeded {
                continue;
            }
            all = (all.0 + 1, all.1 + task.forecast.particle_steps);
            match state {
                State::Stored(_) => done = (done.0 + 1, done.1 + task.forecast.particle_steps),
                State::Failed(_) | State::HeldUp(_) => {
                    failed += 1;
                    all.1 -= task.forecast.particle_steps;
                }
                _ => {}
            }
        }
        tally.update(done.0, all.0, self.running.len(), failed, done.1 / f64::max(all.1, f64::MIN_POSITIVE));
    }
}

/// The groups of some tasks, the first few of them.
fn some(tasks: &[&Task]) -> String {
    let names: Vec<String> = tasks.iter().take(3).map(|task| format!("{} {}", task.group(), task.name())).collect();
    let more = if tasks.len() > names.len() { ", ..." } else { "" };
    format!("{}{more}", names.join(", "))
}

/// Memory that programs can take without swapping [bytes]; without limit where the system does not tell.
fn available_memory() -> f64 {
    let text = fs::read_to_string("/proc/meminfo").unwrap_or_default();
    let line = text.lines().find_map(|line| line.strip_prefix("MemAvailable:"));
    let kibibytes = line.and_then(|line| line.trim().strip_suffix(" kB")?.parse::<f64>().ok());
    kibibytes.map_or(f64::INFINITY, |kibibytes| 1024.0 * kibibytes)
}
