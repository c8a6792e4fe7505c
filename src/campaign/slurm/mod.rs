//! Tasks on a cluster with Slurm: a [site file](Site) says what the cluster wants, a [script](TaskScript) computes an array of tasks, and
//! [`Cluster`] submits it and says how far it is. Whether a result is there, the workspace alone decides.

mod answers;
mod array;
mod cluster;
mod commands;
mod error;
mod script;
mod site;
mod state;

pub use answers::Settings;
pub use array::{ArrayJob, ArrayRequest, Prerequisite, Submission, TaskId};
pub use cluster::Cluster;
pub use commands::Commands;
pub use error::SlurmError;
pub use script::{TaskScript, write_tasks};
pub use site::{DEFAULT_SIGNAL_LEAD, Site};
pub use state::TaskState;
