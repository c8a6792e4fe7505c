//! Arrays of tasks on a real Slurm of one node, which each test starts for itself and stops again. The tests need Slurm's and munge's
//! programs and fail where they are missing (`./run-tests` installs them). The tasks are lines of shell in place of tollgate, but for
//! those of whole campaigns.
#![expect(clippy::unwrap_used, reason = "a test fails by panicking")]

mod again;
mod arrays;
mod campaign;
mod cluster;
mod ends;
