//! Campaigns as their users meet them: variants of a small hopper whose discharge is recorded once; failing, killed, shared by
//! two, changed, cleaned. One target, so that it is linked once.
#![expect(clippy::unwrap_used, reason = "a test fails by panicking")]

#[path = "../common/draw.rs"]
mod draw;
#[expect(dead_code, reason = "shared with the other targets")]
#[path = "../common/program.rs"]
mod program;

mod broken_off;
mod common;
mod example;
mod failing;
mod files;
mod reuse;
