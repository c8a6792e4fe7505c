//! What the exit status of `tollgate` means. One constant a class; documented in `README.md`.

/// Done.
pub const DONE: u8 = 0;
/// Our own bug.
pub const BUG: u8 = 1;
/// The command line or the scene is wrong.
pub const USAGE: u8 = 2;
/// No backend can do what the scene needs.
pub const NO_BACKEND: u8 = 3;
/// A backend failed.
pub const BACKEND_FAILED: u8 = 4;
/// A stream or checkpoint is unusable.
pub const STREAM_UNUSABLE: u8 = 5;
/// Out of tolerance, or inconclusive.
pub const OUT_OF_TOLERANCE: u8 = 6;
/// The watchdog stopped an unstable run.
pub const UNSTABLE: u8 = 7;
/// The disk or the system failed us.
pub const SYSTEM: u8 = 8;
/// Some variants of a campaign failed.
pub const VARIANTS_FAILED: u8 = 9;
/// Interrupted; what was finished stays usable with `--resume`.
pub const INTERRUPTED: u8 = 130;
