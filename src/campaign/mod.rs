//! Campaigns: many variants of a scene, computed task by task. A task is one stage run, named by its key.

pub mod slurm;
