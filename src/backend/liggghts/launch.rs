//! Runs a case: starts LIGGGHTS, drains what it prints, watches it, and ends it when it must end.
//!
//! No trust in an exit status: a case has come to its end when its deck has said so at the time step that was asked for. Whatever
//! happens, nothing that was started is left behind: at an error, an interrupt or a panic it is ended here, and where this process is
//! killed the system ends it (`setpriv --pdeathsig`).

use super::super::BackendError;
use super::drain::{News, drain_errors, drain_output};
use super::explain::explain;
use super::files;
use super::probe::{self, Tools};
use super::processes::{Ended, Family};
use super::screen::Screen;
use super::watch::{Trouble, Watch};
use crate::backend::stage::EndReason;
use crate::output::progress::{Progress, Verbosity};
use crate::storage::StorageError;
use std::ffi::OsString;
use std::fs::File;
use std::io;
use std::os::unix::process::{CommandExt, ExitStatusExt};
use std::path::Path;
use std::process::{Command, Stdio};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Receiver, channel};
use std::sync::{Arc, Mutex};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

/// A case to be run.
#[derive(Debug, Clone, Copy)]
pub struct Launch<'a> {
    /// Its folder.
    pub case: &'a Path,
    /// MPI ranks.
    pub ranks: u32,
    /// Options handed on to mpirun.
    pub mpirun: &'a [String],
    /// Wall time after which it is stopped [s]; infinite for none.
    pub time_limit: f64,
    /// Time steps that it does if nothing ends it earlier.
    pub steps: u64,
    /// Time step [s].
    pub timestep: f64,
    /// Set from outside to end it.
    pub interrupted: &'a AtomicBool,
    /// How much is said.
    pub verbosity: Verbosity,
}

/// A part appeared or disappeared.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Event {
    /// The part.
    pub part: String,
    /// It is there from now on.
    pub present: bool,
    /// Time step.
    pub step: u64,
}

/// Particles were deleted.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Deleted {
    /// The region or group whose particles were deleted.
    pub what: String,
    /// How many, more than none.
    pub count: u64,
    /// Time step.
    pub step: u64,
}

/// What was printed, and what was used.
#[derive(Debug, Clone, Default)]
pub struct Finished {
    /// Last time step printed.
    pub steps: u64,
    /// Particles in the box then, ghosts among them.
    pub atoms: u64,
    /// Why it ended; `None` where it was interrupted.
    pub end: Option<EndReason>,
    /// Parts that appeared or disappeared, in the order of time.
    pub events: Vec<Event>,
    /// Deletions, in the order of time.
    pub deleted: Vec<Deleted>,
    /// Warnings in LIGGGHTS' words, each once.
    pub warnings: Vec<String>,
    /// Wall time [s].
    pub wall_s: f64,
    /// Processor time of all ranks [s].
    pub cpu_s: Option<f64>,
    /// Sum of the largest memories of its processes [bytes].
    pub peak_memory_bytes: Option<u64>,
}

/// How a case ended.
#[derive(Debug, Clone)]
pub enum Outcome {
    /// It came to its end.
    Finished(Finished),
    /// It was ended from outside; what it has written up to the step printed last is there.
    Interrupted(Finished),
}

/// Longest time between two looks around.
const TICK: Duration = Duration::from_millis(20);
/// Time between two calls of the caller's own work.
const CALL_INTERVAL: Duration = Duration::from_millis(100);
/// Time between two looks at the free space.
const SPACE_INTERVAL: Duration = Duration::from_secs(1);
/// Longest that it may take to end after its own error; the ranks of one that has failed may wait for it for ever.
const AFTER_ERROR: Duration = Duration::from_secs(5);
/// Longest that the pipes may stay open after the process has ended.
const PIPES: Duration = Duration::from_secs(5);

/// What is called while a case runs.
pub type Each<'a> = dyn FnMut(u64) -> Result<(), BackendError> + 'a;

/// Runs a case to its end. `each` is called now and then with the time step reached: what belongs to earlier
/// steps is written.
///
/// # Errors
/// [`BackendError::Incapable`] where LIGGGHTS or what starts it is missing or of another version; [`BackendError::Unstable`] where
/// numbers are no longer finite; [`BackendError::Output`] where the disk is full; [`BackendError::Failed`] for everything else;
/// what `each` returns.
pub fn run(launch: &Launch, each: &mut Each<'_>) -> Result<Outcome, BackendError> {
    let program = probe::path()?;
    if let Some(missing) = Tools::find().missing(launch.ranks) {
        return Err(missing.into());
    }
    let started = Instant::now();
    let mut running = Running::start(launch, &program)?;
    let outcome = running.drive(each);
    // Also after an error of the caller's own: nothing may be left behind.
    let ended =
        running.family.end().map_err(|source| StorageError::system("wait for LIGGGHTS in", launch.case, source))?;
    let rest = running.drain();
    running.progress.finish(running.watch.status());
    let stopped = outcome?;
    rest?;
    let finished = Finished {
        wall_s: started.elapsed().as_secs_f64(),
        cpu_s: ended.cpu_s,
        peak_memory_bytes: running.family.peak_memory_bytes(),
        ..running.watch.finished()
    };
    match stopped {
        Some(Stop::Interrupted) => Ok(Outcome::Interrupted(finished)),
        Some(Stop::Trouble(trouble)) => Err(running.trouble(&trouble)),
        None => running.judge(&ended).map_or(Ok(Outcome::Finished(finished)), Err),
    }
}

/// The command that runs a case by hand.
#[must_use]
pub fn command_line(case: &Path, ranks: u32, mpirun: &[String]) -> String {
    let program = quoted(&probe::program().to_string_lossy());
    let place = std::path::absolute(case).unwrap_or_else(|_| case.to_path_buf());
    let mut line = format!("cd {} && ", quoted(&place.to_string_lossy()));
    if ranks > 1 {
        line += &format!("mpirun -np {ranks} ");
        if rustix::process::geteuid().is_root() {
            line += "--allow-run-as-root ";
        }
        if ranks as usize > std::thread::available_parallelism().map_or(1, std::num::NonZero::get) {
            line += "--oversubscribe ";
        }
        for option in mpirun {
            line += &format!("{} ", quoted(option));
        }
    }
    line + &format!("{program} -in {}", files::DECK)
}

/// As a shell reads it as one word.
fn quoted(word: &str) -> String {
    let is_plain = |c: char| c.is_ascii_alphanumeric() || "/._-+=:,@%".contains(c);
    if !word.is_empty() && word.chars().all(is_plain) {
        word.to_owned()
    } else {
        format!("'{}'", word.replace('\'', r"'\''"))
    }
}

/// The process that is started.
fn command(launch: &Launch, program: &Path) -> Command {
    let mut words: Vec<OsString> = Vec::new();
    let guard = |signal: &str| ["setpriv", "--pdeathsig", signal].map(OsString::from);
    if launch.ranks > 1 {
        // mpirun ends its ranks when it is asked to end; where it is killed, theirs is the second guard.
        words.extend(guard("TERM"));
        words.extend(probe::launcher());
        words.extend(["-n".into(), launch.ranks.to_string().into()]);
        words.extend(launch.mpirun.iter().map(OsString::from));
    }
    words.extend(guard("KILL"));
    words.extend(["stdbuf".into(), "-oL".into(), program.into()]);
    words.extend(["-echo", "both", "-in", files::DECK, "-log", files::LOG].map(OsString::from));
    let mut command = Command::new(&words[0]);
    command.args(&words[1..]).current_dir(launch.case).process_group(0);
    command.stdin(Stdio::null()).stdout(Stdio::piped()).stderr(Stdio::piped());
    command.env("LC_ALL", "C").env("OMP_NUM_THREADS", "1");
    if launch.ranks > 1 {
        // Defaults of Open MPI's that an option of the user's overrides: more ranks than cores may be asked for; two runs must not
        // sit on the same cores; a rank that waits must leave its core to others, or ranks on a busy computer take ten times as long;
        // and a rank's guard needs its starter to stay, which is no passing thread.
        let defaults = [
            ("rmaps_base_oversubscribe", "1"),
            ("hwloc_base_binding_policy", "none"),
            ("mpi_yield_when_idle", "1"),
            ("odls_base_num_threads", "0"),
        ];
        for (name, value) in defaults.map(|(name, value)| (format!("OMPI_MCA_{name}"), value)) {
            if std::env::var_os(&name).is_none() {
                command.env(name, value);
            }
        }
        command.env("OMPI_ALLOW_RUN_AS_ROOT", "1").env("OMPI_ALLOW_RUN_AS_ROOT_CONFIRM", "1");
    }
    command
}

/// Why a case was stopped before its end.
enum Stop {
    Interrupted,
    Trouble(Trouble),
}

struct Running<'a> {
    launch: &'a Launch<'a>,
    family: Family,
    news: Receiver<News>,
    output: Option<JoinHandle<Screen>>,
    errors: Option<JoinHandle<Vec<u8>>>,
    watch: Watch,
    progress: Progress,
    started: Instant,
    next_space: Instant,
}

impl<'a> Running<'a> {
    fn start(launch: &'a Launch<'a>, program: &Path) -> Result<Self, BackendError> {
        let place = launch.case.join(files::SCREEN);
        let file = File::create(&place).map_err(|source| StorageError::system("create", &place, source))?;
        let file = Arc::new(Mutex::new(file));
        let mut child = command(launch, program)
            .spawn()
            .map_err(|source| StorageError::system("start LIGGGHTS in", launch.case, source))?;
        let (sender, news) = channel();
        let output = child.stdout.take().map(|pipe| {
            let (file, sender) = (Arc::clone(&file), sender.clone());
            std::thread::spawn(move || drain_output(pipe, &file, &sender))
        });
        let errors = child.stderr.take().map(|pipe| std::thread::spawn(move || drain_errors(pipe, &file, &sender)));
        let started = Instant::now();
        Ok(Self {
            launch,
            family: Family::new(child, launch.ranks > 1),
            news,
            output,
            errors,
            watch: Watch::new(launch.timestep, program),
            progress: Progress::on_stderr(launch.verbosity, 0.0, launch.steps as f64 * launch.timestep),
            started,
            next_space: started + SPACE_INTERVAL,
        })
    }

    /// Until the process has ended, or must be ended.
    fn drive(&mut self, each: &mut Each<'_>) -> Result<Option<Stop>, BackendError> {
        let (mut called, mut told) = (Instant::now(), None);
        loop {
            // What is printed waits meanwhile: a look at every line would cost more than the line.
            std::thread::sleep(TICK);
            while let Ok(news) = self.news.try_recv() {
                self.take(news)?;
            }
            if self.launch.interrupted.load(Ordering::Relaxed) {
                return Ok(Some(Stop::Interrupted));
            }
            if let Some(trouble) = self.watch.trouble() {
                return Ok(Some(Stop::Trouble(trouble)));
            }
            self.progress.update(self.watch.status());
            self.family.look();
            if self.has_ended()? {
                return Ok(None);
            }
            if self.started.elapsed().as_secs_f64() > self.launch.time_limit {
                return Ok(Some(Stop::Trouble(Trouble::TimeLimit)));
            }
            if self.watch.has_error_for(AFTER_ERROR) {
                return Ok(None);
            }
            self.look_at_space()?;
            let step = self.watch.step();
            if step != told && called.elapsed() >= CALL_INTERVAL {
                each(step.unwrap_or(0))?;
                (called, told) = (Instant::now(), step);
            }
        }
    }

    fn has_ended(&mut self) -> Result<bool, BackendError> {
        let ended = self.family.has_ended();
        ended
            .map(|ended| ended.is_some())
            .map_err(|source| StorageError::system("wait for LIGGGHTS in", self.launch.case, source).into())
    }

    fn take(&mut self, news: News) -> Result<(), BackendError> {
        match news {
            News::Printed(line) => {
                if let Some(text) = self.watch.take(line) {
                    self.progress.say(&text);
                }
                Ok(())
            }
            News::Unwritten(source) => {
                Err(StorageError::system("write", &self.launch.case.join(files::SCREEN), source).into())
            }
        }
    }

    /// LIGGGHTS does not notice a full disk: what it writes is missing, and its exit status is 0.
    fn look_at_space(&mut self) -> Result<(), StorageError> {
        if Instant::now() < self.next_space {
            return Ok(());
        }
        self.next_space = Instant::now() + SPACE_INTERVAL;
        check_space(self.launch.case)
    }

    /// What was printed last, once the process has ended.
    fn drain(&mut self) -> Result<(), BackendError> {
        let deadline = Instant::now() + PIPES;
        // A pipe that somebody else holds open must not hold us.
        while let Ok(news) = self.news.recv_timeout(deadline.saturating_duration_since(Instant::now())) {
            self.take(news)?;
        }
        Ok(())
    }

    /// What is wrong although nothing stopped it, if anything is.
    fn judge(&mut self, ended: &Ended) -> Option<BackendError> {
        if let Some(trouble) = self.watch.trouble() {
            return Some(self.trouble(&trouble));
        }
        if let Some(error) = self.said().or_else(|| self.signalled(ended)) {
            return Some(error);
        }
        if let Err(error) = check_space(self.launch.case) {
            return Some(error.into());
        }
        if let Some(trouble) = self.watch.told_to_stop() {
            return Some(self.trouble(&trouble));
        }
        if !ended.status.success() {
            let last = self.last_errors();
            return Some(self.failed(&format!("LIGGGHTS ended with {}{last}", ended.status)));
        }
        let trouble = self.watch.unfinished(self.launch.steps)?;
        Some(self.trouble(&trouble))
    }

    /// Its own error.
    fn said(&mut self) -> Option<BackendError> {
        let screen = join(&mut self.output)?;
        let error = screen.error();
        (!error.is_empty()).then(|| self.failed(&explain(self.launch.case, &error, screen.recent())))
    }

    /// Ended by a signal: its own, or that of a rank, which mpirun tells in words.
    fn signalled(&mut self, ended: &Ended) -> Option<BackendError> {
        let of_rank = ended.status.code().filter(|&code| self.launch.ranks > 1 && code > 128).map(|code| code - 128);
        let signal = ended.status.signal().or(of_rank)?;
        let what = match signal {
            9 => "LIGGGHTS was killed (signal 9): by somebody, or by the system because the memory was used up; `dmesg` may tell".to_owned(),
            11 | 6 | 8 | 4 | 7 => format!("LIGGGHTS crashed (signal {signal}); what it printed last may tell why"),
            _ => format!("LIGGGHTS was ended from outside (signal {signal})"),
        };
        Some(self.failed(&what))
    }

    /// The last lines on stderr, for what has no other words.
    fn last_errors(&mut self) -> String {
        let bytes = join(&mut self.errors).unwrap_or_default();
        let text = String::from_utf8_lossy(&bytes);
        let lines: Vec<&str> = text.lines().filter(|line| line.chars().any(char::is_alphanumeric)).collect();
        let last = lines[lines.len().saturating_sub(12)..].join("\n  ");
        if last.is_empty() { String::new() } else { format!(":\n  {last}") }
    }

    fn trouble(&self, trouble: &Trouble) -> BackendError {
        let (launch, steps) = (self.launch, self.watch.step().unwrap_or(0));
        let rerun = command_line(launch.case, launch.ranks, launch.mpirun);
        match trouble {
            Trouble::Incapable(unusable) => unusable.clone().into(),
            Trouble::NotFinite { step } => BackendError::Unstable {
                what: format!(
                    "{}\nthe case is kept in {}; run it by hand with\n  {rerun}",
                    trouble.text(launch.time_limit),
                    launch.case.display()
                ),
                time: *step as f64 * launch.timestep,
                steps: *step,
            },
            _ => BackendError::Failed {
                what: format!("{}\nwhat it printed is in {}", trouble.text(launch.time_limit), files::SCREEN),
                case: launch.case.to_path_buf(),
                rerun,
                time: steps as f64 * launch.timestep,
                steps,
            },
        }
    }

    fn failed(&self, what: &str) -> BackendError {
        self.trouble(&Trouble::Failed(format!("{what}\nthe last time step printed is {}", self.watch.last_step())))
    }
}

/// Waits for a thread that is at its end, and for no other.
fn join<T>(thread: &mut Option<JoinHandle<T>>) -> Option<T> {
    let deadline = Instant::now() + TICK;
    while !thread.as_ref()?.is_finished() && Instant::now() < deadline {
        std::thread::sleep(Duration::from_millis(1));
    }
    thread.take().filter(JoinHandle::is_finished)?.join().ok()
}

/// # Errors
/// Where nothing more can be written into a folder.
fn check_space(folder: &Path) -> Result<(), StorageError> {
    let Ok(disk) = rustix::fs::statvfs(folder) else { return Ok(()) };
    let free = if rustix::process::geteuid().is_root() { disk.f_bfree } else { disk.f_bavail };
    if free > 0 {
        return Ok(());
    }
    Err(StorageError::system("write into", folder, io::ErrorKind::StorageFull.into()))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_command_line_is_what_a_shell_understands() {
        let line = command_line(Path::new("/tmp/my case"), 1, &[]);
        assert!(line.starts_with("cd '/tmp/my case' && ") && line.ends_with("liggghts -in in.liggghts"), "{line}");
        let line = command_line(Path::new("/c"), 9999, &["--bind-to".into(), "it's".into()]);
        assert!(line.contains("mpirun -np 9999") && line.contains(r"--oversubscribe --bind-to 'it'\''s' "), "{line}");
    }
}
