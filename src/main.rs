//! The `tollgate` command line.

mod cli;

use std::process::ExitCode;

fn main() -> ExitCode {
    // A panic is our own bug, and has an exit status of its own; its message stands on stderr already.
    std::panic::catch_unwind(cli::main).unwrap_or_else(|_| ExitCode::from(tollgate::exit_code::BUG))
}
