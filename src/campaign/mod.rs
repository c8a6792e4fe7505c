//! Many runs of one plant: variants over any key of its scene, every stage computed once however many variants share it.
//!
//! A campaign file (`file`) becomes variants (`variant`); each variant and replicate is a scene of its own, whose stages are
//! tasks with keys (`task`). Two variants whose stages have the same key share the task, so what is upstream of all of them is
//! computed once, without anybody having said so. Results lie in the workspace under their keys (`workspace`): facts on disk,
//! whole or absent. A task that is being computed is claimed (`claim`). `scheduler` decides what runs when, `work` computes one
//! task in a process of its own, `status` says where everything stands, `reason` why something runs or is used again and what it
//! will cost, `results` makes the tables, `figures` the pictures, and `clean` finds what nobody refers to.

pub mod claim;
pub mod clean;
mod factors;
pub mod figures;
pub mod file;
pub mod latin_hypercube;
pub mod reason;
pub mod results;
pub mod scheduler;
pub mod slurm;
pub mod status;
pub mod task;
pub mod variant;
pub mod work;
pub mod workspace;

use crate::exit_code;
use crate::run::RunError;
use crate::scene::Finding;
use crate::storage::StorageError;

/// Why a campaign cannot go on.
#[derive(Debug)]
pub enum CampaignError {
    /// Its file, or the scene of one of its variants, is wrong.
    Findings(Vec<Finding>),
    /// Variants whose scenes cannot run: which, and why.
    Variants(Vec<(String, RunError)>),
    /// What was asked for does not fit the campaign, or the workspace.
    Request(String),
    /// A task cannot be computed for a reason that is not its own.
    Run(RunError),
    /// Slurm refuses, or is not there.
    Slurm(slurm::SlurmError),
    /// The disk or the system failed us.
    Storage(StorageError),
}

impl CampaignError {
    /// The exit status of a command that ends with this error.
    #[must_use]
    pub fn exit_code(&self) -> u8 {
        match self {
            Self::Findings(_) | Self::Request(_) => exit_code::USAGE,
            Self::Variants(variants) => variants.first().map_or(exit_code::USAGE, |(_, error)| error.exit_code()),
            Self::Run(error) => error.exit_code(),
            Self::Slurm(error) => error.exit_code(),
            Self::Storage(error) => error.exit_code(),
        }
    }
}

impl std::fmt::Display for CampaignError {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::Findings(findings) => write!(f, "{}", RunError::Scene(findings.clone())),
            Self::Variants(variants) => {
                let lines: Vec<String> = variants.iter().map(|(which, error)| format!("{which}: {error}")).collect();
                write!(f, "{}", lines.join("\n"))
            }
            Self::Request(text) => write!(f, "{text}"),
            Self::Run(error) => write!(f, "{error}"),
            Self::Slurm(error) => write!(f, "{error}"),
            Self::Storage(error) => write!(f, "{error}"),
        }
    }
}

impl std::error::Error for CampaignError {}

impl From<StorageError> for CampaignError {
    fn from(error: StorageError) -> Self {
        Self::Storage(error)
    }
}
