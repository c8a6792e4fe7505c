//! The program as its users meet it: the binary, driven in temporary folders. One target, so that it is linked once.
#![expect(clippy::unwrap_used, reason = "a test fails by panicking")]

#[path = "../common/draw.rs"]
mod draw;
#[path = "../common/program.rs"]
mod program;

mod bits;
mod common;
mod compare;
mod exits;
mod folders;
mod frames;
mod memory;
mod restart;
mod scenes;
mod stream;
mod workflow;
