//! How Slurm's commands are called: with formats of our own, untouched by the user's settings, and again where the controller
//! is busy or away for a moment.

use super::error::SlurmError;
use std::ffi::{OsStr, OsString};
use std::io;
use std::process::{Command, Stdio};
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

/// How long an unreachable controller is waited for, unless asked for otherwise.
const PATIENCE: Duration = Duration::from_secs(300);
/// First pause before a command is given again; each further one is twice as long.
const FIRST_PAUSE: Duration = Duration::from_secs(1);
/// Longest pause.
const LONGEST_PAUSE: Duration = Duration::from_secs(30);

/// Variables by which users change what the commands do and print. A setting for sbatch would also outdo the script.
const SETTINGS: [&str; 6] = ["SBATCH_", "SQUEUE_", "SACCT_", "SCONTROL_", "SCANCEL_", "SINFO_"];
/// The same, of all commands together.
const COMMON_SETTINGS: [&str; 2] = ["SLURM_TIME_FORMAT", "SLURM_BITSTR_LEN"];

/// What the commands say where the controller is not there, or too busy. The texts are those of Slurm 22.05.
const UNREACHABLE: [&str; 8] = [
    "Unable to contact slurm controller",
    "Slurm backup controller in standby mode",
    "Slurm temporarily unable to accept job",
    "Socket timed out on send/recv operation",
    "Zero Bytes were transmitted or received",
    "Transport endpoint is not connected",
    "Resource temporarily unavailable",
    "Connection refused",
];

/// Calls Slurm's commands.
#[derive(Debug, Clone)]
pub struct Commands {
    environment: Vec<(OsString, OsString)>,
    patience: Duration,
    first_pause: Duration,
    interrupted: Option<&'static AtomicBool>,
}

impl Default for Commands {
    /// Those of the search path; an unreachable controller is waited for up to five minutes.
    fn default() -> Self {
        Self { environment: Vec::new(), patience: PATIENCE, first_pause: FIRST_PAUSE, interrupted: None }
    }
}

impl Commands {
    /// With a variable in the commands' environment: `PATH` for where they are, `SLURM_CONF` for another cluster.
    #[must_use]
    pub fn with_variable(mut self, name: impl Into<OsString>, value: impl Into<OsString>) -> Self {
        self.environment.push((name.into(), value.into()));
        self
    }

    /// Waits so long for an unreachable controller, with pauses that grow from `first_pause`.
    #[must_use]
    pub const fn with_patience(mut self, patience: Duration, first_pause: Duration) -> Self {
        self.patience = patience;
        self.first_pause = first_pause;
        self
    }

    /// Waits no longer for an unreachable controller once `flag` is set.
    #[must_use]
    pub const fn with_interrupt(mut self, flag: &'static AtomicBool) -> Self {
        self.interrupted = Some(flag);
        self
    }

    /// Sleeps for a pause; false where it was interrupted.
    fn sleep(&self, pause: Duration) -> bool {
        const TICK: Duration = Duration::from_millis(50);
        let started = Instant::now();
        let is_interrupted = || self.interrupted.is_some_and(|flag| flag.load(Ordering::Relaxed));
        while started.elapsed() < pause && !is_interrupted() {
            std::thread::sleep(TICK.min(pause.saturating_sub(started.elapsed())));
        }
        !is_interrupted()
    }

    /// Does what may fail because of an unreachable controller until it does not, or patience ends.
    pub(super) fn patiently<T>(&self, mut attempt: impl FnMut() -> Result<T, SlurmError>) -> Result<T, SlurmError> {
        let started = Instant::now();
        let mut pause = self.first_pause;
        loop {
            match attempt() {
                Err(SlurmError::Unreachable { command, stderr, .. }) => {
                    let waited = started.elapsed();
                    if waited + pause > self.patience || !self.sleep(pause) {
                        return Err(SlurmError::Unreachable { command, stderr, waited });
                    }
                }
                other => return other,
            }
            pause = (2 * pause).min(LONGEST_PAUSE);
        }
    }

    /// What a command prints, which is repeated where the controller is unreachable.
    pub(super) fn run(&self, command: &'static str, arguments: &[OsString]) -> Result<String, SlurmError> {
        self.patiently(|| self.once(command, arguments))
    }

    /// What a command prints.
    pub(super) fn once(&self, name: &'static str, arguments: &[OsString]) -> Result<String, SlurmError> {
        let mut command = Command::new(name);
        command.args(arguments).stdin(Stdio::null());
        for (variable, _) in std::env::vars_os().filter(|(variable, _)| is_setting(variable)) {
            command.env_remove(variable);
        }
        command.envs(self.environment.iter().map(|(name, value)| (name, value)));
        let shown = || shown(name, arguments);
        let output = command.output().map_err(|error| match error.kind() {
            io::ErrorKind::NotFound | io::ErrorKind::NotADirectory => SlurmError::Missing { command: name },
            _ => SlurmError::Failed { command: shown(), status: "not started".to_owned(), stderr: error.to_string() },
        })?;
        if output.status.success() {
            return Ok(String::from_utf8_lossy(&output.stdout).into_owned());
        }
        let stderr = String::from_utf8_lossy(&output.stderr).into_owned();
        if UNREACHABLE.iter().any(|text| stderr.contains(text)) {
            return Err(SlurmError::Unreachable { command: shown(), stderr, waited: Duration::ZERO });
        }
        Err(SlurmError::Failed { command: shown(), status: output.status.to_string(), stderr })
    }
}

pub(super) fn is_setting(variable: &OsStr) -> bool {
    variable.to_str().is_some_and(|name| {
        COMMON_SETTINGS.contains(&name) || SETTINGS.iter().any(|beginning| name.starts_with(beginning))
    })
}

/// A command as it is shown in messages.
pub(super) fn shown(name: &str, arguments: &[OsString]) -> String {
    let words = std::iter::once(name.into()).chain(arguments.iter().map(|argument| argument.to_string_lossy()));
    words.collect::<Vec<_>>().join(" ")
}
