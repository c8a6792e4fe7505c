//! LIGGGHTS itself: what is written for it is run by the binary, and what it writes is read. One target, so that it is linked once.
#![expect(clippy::unwrap_used, reason = "a test fails by panicking")]

mod deck;
