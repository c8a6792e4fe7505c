//! Why Slurm could not be asked or did not do what was asked for, and what to do.

use crate::exit_code;
use crate::storage::StorageError;
use std::fmt;
use std::time::Duration;

/// What went wrong with Slurm.
#[derive(Debug)]
pub enum SlurmError {
    /// One of Slurm's commands is not in the search path.
    Missing {
        /// The command.
        command: &'static str,
    },
    /// A command could not be started, or ended with a failure of its own.
    Failed {
        /// The command with its arguments.
        command: String,
        /// How it ended.
        status: String,
        /// What it said.
        stderr: String,
    },
    /// Slurm's controller did not answer for as long as we were ready to wait.
    Unreachable {
        /// The command with its arguments.
        command: String,
        /// What it said last.
        stderr: String,
        /// How long it was tried.
        waited: Duration,
    },
    /// A command succeeded, and what it printed is not what it should be.
    Unreadable {
        /// The command with its arguments.
        command: String,
        /// What it printed, or its beginning.
        output: String,
        /// What is wrong with it.
        reason: String,
    },
    /// A request that cannot be handed to Slurm as it is.
    Refused {
        /// What is wrong with it, and what to do.
        reason: String,
    },
    /// A file for Slurm cannot be written.
    Storage(StorageError),
}

impl SlurmError {
    /// The exit status of a command that ends with this error.
    #[must_use]
    pub const fn exit_code(&self) -> u8 {
        match self {
            Self::Refused { .. } => exit_code::USAGE,
            Self::Storage(error) => error.exit_code(),
            _ => exit_code::SYSTEM,
        }
    }

    pub(super) fn refused(reason: impl Into<String>) -> Self {
        Self::Refused { reason: reason.into() }
    }

    /// About a file that Slurm needs by name.
    pub(super) fn bad_path(what: &str, path: &std::path::Path, reason: &str) -> Self {
        Self::refused(format!("{what} {path:?} cannot be given to Slurm: {reason}"))
    }

    pub(super) fn unreadable(command: &str, output: &str, reason: impl Into<String>) -> Self {
        const SHOWN: usize = 200;
        let mut shown: String = output.chars().take(SHOWN).collect();
        if shown.len() < output.len() {
            shown.push('…');
        }
        Self::Unreadable { command: command.to_owned(), output: shown, reason: reason.into() }
    }
}

impl fmt::Display for SlurmError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Missing { command } => write!(
                f,
                "Slurm's commands are not here: there is no {command} in PATH; run this where `sbatch` works, such as the \
                 cluster's login node"
            ),
            Self::Failed { command, status, stderr } => {
                write!(f, "`{command}` failed ({status}): {}", said(stderr))
            }
            Self::Unreachable { command, stderr, waited } => write!(
                f,
                "Slurm's controller has not answered for {} s (`{command}`): {}; try again later: what is submitted goes on",
                waited.as_secs(),
                said(stderr)
            ),
            Self::Unreadable { command, output, reason } => write!(
                f,
                "`{command}` printed what cannot be read: {reason}; it was {output:?}; is this a version of Slurm's that is not \
                 known here, or a wrapper of the site's?"
            ),
            Self::Refused { reason } => f.write_str(reason),
            Self::Storage(error) => error.fmt(f),
        }
    }
}

fn said(stderr: &str) -> &str {
    let text = stderr.trim();
    if text.is_empty() { "it said nothing" } else { text }
}

impl std::error::Error for SlurmError {
    fn source(&self) -> Option<&(dyn std::error::Error + 'static)> {
        match self {
            Self::Storage(error) => Some(error),
            _ => None,
        }
    }
}

impl From<StorageError> for SlurmError {
    fn from(error: StorageError) -> Self {
        Self::Storage(error)
    }
}
