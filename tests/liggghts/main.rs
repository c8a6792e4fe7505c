//! What runs on the installed LIGGGHTS.
#![expect(clippy::unwrap_used, reason = "a test fails by panicking")]

mod cross;
mod suite;
