//! Gates as their users meet them: scenes that are cut, run stage by stage, broken off, tampered with, and compared with the
//! whole. One target, so that it is linked once.
#![expect(clippy::unwrap_used, reason = "a test fails by panicking")]

#[path = "../common/draw.rs"]
mod draw;
#[path = "../common/program.rs"]
mod program;

mod backing_up;
mod common;
mod comparing;
mod exact;
mod fates;
mod ledger;
mod plants;
mod refusals;
mod replicates;
mod resume;
