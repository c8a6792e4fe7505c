//! LIGGGHTS as a backend, on the real program: these tests need it and fail where it is missing (`./run-tests` installs it).
#![expect(clippy::unwrap_used, reason = "a test fails by panicking")]

#[path = "../common/draw.rs"]
mod draw;
#[expect(dead_code, reason = "shared with the other targets")]
#[path = "../common/program.rs"]
mod program;

mod cross;
mod deck;
mod doctor;
mod faults;
mod launching;
mod recording;
mod replay;
mod stages;
mod suite;
