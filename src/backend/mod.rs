//! Who computes a stage.

pub mod frames;
pub mod incoming;
pub mod liggghts;
pub mod native;
pub mod recording;
pub mod stage;

pub use native::{PartEvent, Removal, RemovalCause};

use crate::exit_code;
use crate::storage::StorageError;
use std::path::PathBuf;

/// Why a stage was not computed to its end.
#[derive(Debug)]
pub enum BackendError {
    /// The watchdog stopped an unstable run; everything written so far is readable.
    Unstable {
        /// What was seen, when, where, and what to change.
        what: String,
        /// Plant time reached [s].
        time: f64,
        /// Time steps done since time 0.
        steps: u64,
    },
    /// A gate stopped the run: a particle met a fate that the scene calls an error, or the downstream backs up to the gate.
    Gate {
        /// What was seen, where, and what to change.
        what: String,
        /// Plant time reached [s].
        time: f64,
        /// Time steps done since time 0.
        steps: u64,
    },
    /// The disk or system refused, or a file that should be continued cannot be used.
    Output(StorageError),
    /// A checkpoint does not fit what is asked of it.
    Checkpoint(String),
    /// An external code is not there, or cannot do what the stage needs.
    Incapable(String),
    /// An external code failed, or did not do what its exit status says.
    Failed {
        /// What happened, where, and what to do next, in the user's words.
        what: String,
        /// Its case, which is kept.
        case: PathBuf,
        /// The command that runs the case by hand.
        rerun: String,
        /// Plant time reached [s].
        time: f64,
        /// Time steps done since time 0.
        steps: u64,
    },
}

impl BackendError {
    /// Adds what was doubtful about the stage's streams from the start to an error that may come of it.
    #[must_use]
    pub fn with_doubts(mut self, doubts: &[String]) -> Self {
        if let Self::Unstable { what, .. } | Self::Gate { what, .. } | Self::Failed { what, .. } = &mut self
            && !doubts.is_empty()
        {
            what.push_str("\nwhat it replays may be the reason:");
            doubts.iter().for_each(|doubt| what.push_str(&format!("\n  {doubt}")));
        }
        self
    }

    /// The exit status of a command that ends with this error.
    #[must_use]
    pub const fn exit_code(&self) -> u8 {
        match self {
            Self::Unstable { .. } | Self::Gate { .. } => exit_code::UNSTABLE,
            Self::Output(error) => error.exit_code(),
            Self::Checkpoint(_) => exit_code::STREAM_UNUSABLE,
            Self::Incapable(_) => exit_code::NO_BACKEND,
            Self::Failed { .. } => exit_code::BACKEND_FAILED,
        }
    }
}

impl std::fmt::Display for BackendError {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::Unstable { what, .. } => write!(f, "the run is unstable and was stopped: {what}"),
            Self::Gate { what, .. } => write!(f, "the run was stopped at a gate: {what}"),
            Self::Output(error) => error.fmt(f),
            Self::Checkpoint(reason) | Self::Incapable(reason) => f.write_str(reason),
            Self::Failed { what, case, rerun, .. } => {
                write!(f, "{what}\nthe case is kept in {}; run it by hand with\n  {rerun}", case.display())
            }
        }
    }
}

impl std::error::Error for BackendError {}

impl From<StorageError> for BackendError {
    fn from(error: StorageError) -> Self {
        Self::Output(error)
    }
}
