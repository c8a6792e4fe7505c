//! On this computer: fills the cores, respects the memory, goes on where a task fails.

use super::{Board, Outcome};
use crate::backend::native::processor::physical_cores;
use crate::campaign::CampaignError;
use crate::campaign::claim::Holder;
use crate::campaign::status::State;
use crate::campaign::workspace::Failure;
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

/// What is asked of it.
#[derive(Debug, Clone, Default)]
pub struct Request {
    /// Tasks at a time; `None` for one a physical core.
    pub jobs: Option<usize>,
    /// This program.
    pub program: PathBuf,
}

/// A process that computes a task.
struct Running {
    task: usize,
    child: Child,
    threads: usize,
    memory: f64,
}

/// Computes all tasks that are due.
///
/// # Errors
/// When something was begun or lacks outputs and it is not said what to do with it, or the disk refuses.
pub fn run(
    mut board: Board<'_>,
    request: &Request,
    tally: &mut Tally,
    interrupted: &AtomicBool,
) -> Result<Outcome, CampaignError> {
    board.take_up()?;
    let (cores, memory) = (physical_cores(), available_memory() * MEMORY_SHARE);
    let mut scheduler = Scheduler { board, request, running: Vec::new(), cores, memory };
    scheduler.until_done(tally, interrupted)?;
    Ok(scheduler.board.outcome(interrupted.load(Ordering::Relaxed)))
}

struct Scheduler<'a> {
    board: Board<'a>,
    request: &'a Request,
    running: Vec<Running>,
    cores: usize,
    memory: f64,
}

impl Scheduler<'_> {
    fn until_done(&mut self, tally: &mut Tally, interrupted: &AtomicBool) -> Result<(), CampaignError> {
        let mut looked = Instant::now();
        let mut was_told = false;
        loop {
            let may_start = self.board.stopped.is_none() && !interrupted.load(Ordering::Relaxed);
            if may_start {
                self.start_what_can(tally)?;
            } else if !was_told {
                was_told = true;
                self.tell_all();
            }
            self.board.show(tally, self.running.len());
            if self.running.is_empty() && (!may_start || !self.board.is_waiting()) {
                return Ok(());
            }
            std::thread::sleep(LOOK);
            let ended = self.wait(tally)?;
            if ended || looked.elapsed() >= LOOK_AROUND {
                looked = Instant::now();
                self.board.refresh();
            }
        }
    }

    /// Starts tasks while there are cores and memory: what has most downstream of it first, then in the order of variants.
    fn start_what_can(&mut self, tally: &mut Tally) -> Result<(), CampaignError> {
        let jobs = self.request.jobs.unwrap_or(self.cores).max(1);
        let is_here = |index: &usize| self.running.iter().any(|running| running.task == *index);
        let is_ready =
            |index: &usize| self.board.states[*index] == State::Due && !is_here(index) && self.board.is_ready(*index);
        let mut ready: Vec<usize> = (0..self.board.states.len()).filter(is_ready).collect();
        ready.sort_by_key(|index| std::cmp::Reverse(self.board.graph.tasks[*index].users));
        for (position, index) in ready.iter().enumerate() {
            let free_jobs = jobs.saturating_sub(self.running.len());
            let used: usize = self.running.iter().map(|running| running.threads).sum();
            let free_cores = self.cores.saturating_sub(used).max(usize::from(free_jobs > 0));
            if free_jobs == 0 {
                return Ok(());
            }
            let memory = self.board.graph.tasks[*index].forecast.memory_bytes.unwrap_or(0.0);
            let taken: f64 = self.running.iter().map(|running| running.memory).sum();
            if !self.running.is_empty() && taken + memory > self.memory {
                return Ok(());
            }
            // Fewer tasks than cores share them: threads change no bit.
            let shared = (free_cores / (ready.len() - position).min(free_jobs)).max(1);
            let threads = self.board.graph.tasks[*index].cores.unwrap_or(shared);
            if !self.running.is_empty() && threads > free_cores {
                return Ok(());
            }
            self.start(*index, threads, memory)?;
            tally.say(&format!(
                "started {} {}",
                self.board.graph.tasks[*index].group(),
                self.board.graph.tasks[*index].name()
            ));
        }
        Ok(())
    }

    fn start(&mut self, index: usize, threads: usize, memory: f64) -> Result<(), CampaignError> {
        let task = &self.board.graph.tasks[index];
        let name = task.name();
        self.board.write_order(index)?;
        let log = self.board.workspace.log(&name);
        let folder = log.parent().expect("a log is in a folder");
        fs::create_dir_all(folder).map_err(|source| StorageError::system("make the folder", folder, source))?;
        let file = File::options().create(true).append(true).open(&log);
        let file = file.map_err(|source| StorageError::system("create", &log, source))?;
        let copy = file.try_clone().map_err(|source| StorageError::system("open", &log, source))?;
        let child = Command::new(&self.request.program)
            .args(["campaign", "task"])
            .arg(&self.board.workspace.root)
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
        let task = &self.board.graph.tasks[index];
        let (group, name) = (task.group(), task.name());
        let code = status.code().and_then(|code| u8::try_from(code).ok());
        match (code, status.signal()) {
            (Some(exit_code::DONE | exit_code::INTERRUPTED), _) => {}
            (Some(exit_code::SYSTEM), _) => {
                self.board.stopped = Some(format!("stage {group}: {}", self.board.last_words(&name)));
                // Begun and not ended, not failed.
                self.board.killed[index] = true;
            }
            (Some(code), _) => {
                if self.board.workspace.failure(&name).is_none() {
                    let reason = format!("its process ended with exit status {code}: {}", self.board.last_words(&name));
                    let host = Holder::this_process().host;
                    self.board.workspace.note_failure(&name, &Failure { exit_code: code, reason, host })?;
                }
                let reason = self.board.workspace.failure(&name).map_or_else(String::new, |failure| failure.reason);
                tally.say(&format!("failed: {group} {name}: {}", reason.lines().next().unwrap_or_default()));
            }
            (None, signal) => {
                self.board.killed[index] = true;
                let number = signal.map_or_else(String::new, |signal| format!(" by signal {signal}"));
                tally.say(&format!("killed{number}: {group} {name}; go on with --resume"));
            }
        }
        Ok(())
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
}

/// Memory that programs can take without swapping [bytes]; without limit where the system does not tell.
fn available_memory() -> f64 {
    let text = fs::read_to_string("/proc/meminfo").unwrap_or_default();
    let line = text.lines().find_map(|line| line.strip_prefix("MemAvailable:"));
    let kibibytes = line.and_then(|line| line.trim().strip_suffix(" kB")?.parse::<f64>().ok());
    kibibytes.map_or(f64::INFINITY, |kibibytes| 1024.0 * kibibytes)
}
