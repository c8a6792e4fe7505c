//! Stages: one solver run over one region and time. What identifies a stage's result stands in [`key`].

pub mod key;
