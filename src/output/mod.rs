//! What a run writes: frames, dumps, series, summary, checkpoints; and its progress and timing while it goes on.
//!
//! Every file is either replaced as a whole (staging name, then rename) or only ever grows by whole frames or rows, so
//! that a run killed at any moment leaves readable files. Nothing here knows a solver: writers take plain slices.
//! `docs/formats.md` lists every file with its columns and units.

pub mod final_state;
pub mod lammps;
pub mod progress;
pub mod pvd;
pub mod series;
pub mod stream_export;
pub mod summary;
pub mod tally;
pub mod timing;
pub mod vtp;
