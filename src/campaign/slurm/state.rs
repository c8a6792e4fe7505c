//! What Slurm says about a task, in one type for all of its commands.

use serde::Serialize;
use std::fmt;

/// How far a task is, as Slurm sees it.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case", tag = "state")]
pub enum TaskState {
    /// It waits.
    Pending {
        /// For what, in Slurm's word: `Resources`, `Priority`, `Dependency`, `BeginTime` (also before it starts anew).
        reason: String,
    },
    /// It runs, is about to, or is just ending.
    Running,
    /// Its script ended with 0.
    Done,
    /// Its script failed.
    Failed {
        /// Its exit status, where it was not a signal.
        exit_code: u8,
        /// The signal that ended it; 0 for none.
        signal: u8,
    },
    /// Its wall time was over and it had not ended by itself.
    TimedOut,
    /// It took more memory than it had asked for.
    OutOfMemory,
    /// Somebody cancelled it.
    Cancelled,
    /// Its node failed, or was taken for another job.
    NodeFailure,
    /// It waits for a task that failed, and will never start. It stays in the queue until it is cancelled, and is told as such also
    /// then.
    DependencyNeverSatisfied,
    /// Slurm does not know it, or not any more.
    Unknown,
}

impl TaskState {
    /// True where Slurm may still do something with it by itself.
    #[must_use]
    pub const fn is_live(&self) -> bool {
        matches!(self, Self::Pending { .. } | Self::Running)
    }

    /// From the words of squeue or sacct. `None` for a state that is not known here.
    pub(super) fn from_words(state: &str, reason: &str, (exit_code, signal): (u8, u8)) -> Option<Self> {
        let failed = Self::Failed { exit_code, signal };
        // sacct adds who has cancelled it.
        Some(match state.split_whitespace().next().unwrap_or_default() {
            "PENDING" if reason == "DependencyNeverSatisfied" => Self::DependencyNeverSatisfied,
            "PENDING" | "REQUEUED" | "REQUEUE_FED" | "REQUEUE_HOLD" | "RESV_DEL_HOLD" | "SPECIAL_EXIT" => {
                Self::Pending { reason: reason.to_owned() }
            }
            "RUNNING" | "CONFIGURING" | "COMPLETING" | "SUSPENDED" | "STOPPED" | "SIGNALING" | "STAGE_OUT"
            | "RESIZING" => Self::Running,
            "COMPLETED" => Self::Done,
            "FAILED" => failed,
            "TIMEOUT" | "DEADLINE" => Self::TimedOut,
            "OUT_OF_MEMORY" => Self::OutOfMemory,
            "CANCELLED" if reason == "DependencyNeverSatisfied" => Self::DependencyNeverSatisfied,
            "CANCELLED" => Self::Cancelled,
            "NODE_FAIL" | "BOOT_FAIL" | "LAUNCH_FAILED" | "PREEMPTED" => Self::NodeFailure,
            "REVOKED" => Self::Unknown,
            _ => return None,
        })
    }
}

/// Exit status and signal from `3:0`, as sacct writes them, or from the number that `wait` gives, as squeue does.
pub(super) fn exit_status(text: &str) -> Option<(u8, u8)> {
    if let Some((exit_code, signal)) = text.split_once(':') {
        return Some((exit_code.parse().ok()?, signal.parse().ok()?));
    }
    let status: u32 = text.parse().ok()?;
    // Bit 7 tells of a dump of memory.
    Some((u8::try_from(status >> 8 & 0xff).ok()?, u8::try_from(status & 0x7f).ok()?))
}

impl fmt::Display for TaskState {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Pending { reason } => write!(f, "pending ({reason})"),
            Self::Running => f.write_str("running"),
            Self::Done => f.write_str("done"),
            Self::Failed { exit_code, signal: 0 } => write!(f, "failed (exit status {exit_code})"),
            Self::Failed { signal, .. } => write!(f, "failed (signal {signal})"),
            Self::TimedOut => f.write_str("wall time over"),
            Self::OutOfMemory => f.write_str("out of memory"),
            Self::Cancelled => f.write_str("cancelled"),
            Self::NodeFailure => f.write_str("node failed or taken away"),
            Self::DependencyNeverSatisfied => f.write_str("never to start: what it waits for failed"),
            Self::Unknown => f.write_str("unknown to Slurm"),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn exit_statuses_are_read_in_both_spellings() {
        assert_eq!(exit_status("3:0"), Some((3, 0)));
        assert_eq!(exit_status("0:9"), Some((0, 9)));
        assert_eq!(exit_status("768"), Some((3, 0)));
        assert_eq!(exit_status("9"), Some((0, 9)));
        assert_eq!(exit_status("139"), Some((0, 11)), "with a dump of memory");
        assert_eq!(exit_status("N/A"), None);
    }

    #[test]
    fn states_of_all_kinds() {
        let state = |state, reason| TaskState::from_words(state, reason, (3, 0));
        let pending = |reason: &str| Some(TaskState::Pending { reason: reason.into() });
        assert_eq!(state("PENDING", "Priority"), pending("Priority"));
        assert_eq!(state("REQUEUE_HOLD", "job_requeued_in_held_state"), pending("job_requeued_in_held_state"));
        assert_eq!(state("PENDING", "DependencyNeverSatisfied"), Some(TaskState::DependencyNeverSatisfied));
        assert_eq!(state("CANCELLED by 1000", ""), Some(TaskState::Cancelled));
        assert_eq!(state("FAILED", ""), Some(TaskState::Failed { exit_code: 3, signal: 0 }));
        assert_eq!(state("TIMEOUT", ""), Some(TaskState::TimedOut));
        assert_eq!(state("OUT_OF_MEMORY", ""), Some(TaskState::OutOfMemory));
        assert_eq!(state("NODE_FAIL", ""), Some(TaskState::NodeFailure));
        assert_eq!(state("COMPLETING", ""), Some(TaskState::Running));
        assert_eq!(state("SLEEPWALKING", ""), None);
    }

    #[test]
    fn only_waiting_and_running_tasks_are_live() {
        assert!(TaskState::Running.is_live() && TaskState::Pending { reason: "Priority".into() }.is_live());
        assert!(!TaskState::DependencyNeverSatisfied.is_live() && !TaskState::Unknown.is_live());
    }
}
