//! What a child process costs: user processor time and wall time.

use std::fs::{self, File};
use std::path::Path;
use std::process::{Command, Stdio};
use std::time::Instant;

/// Clock ticks per second in proc(5): 100 on every Linux, whatever the kernel itself counts in.
const TICKS: f64 = 100.0;

/// Cost of a run.
#[derive(Debug, Clone, Copy)]
pub struct Cost {
    /// User processor time of the process and all its children [s], to 10 ms.
    pub user: f64,
    /// Wall time [s].
    pub wall: f64,
}

/// Runs a command to its end, what it says into `log`; that text, and what it cost.
///
/// # Panics
/// When it cannot be started, or fails.
pub fn timed(command: &mut Command, log: &Path) -> (String, Cost) {
    let file = File::create(log).unwrap_or_else(|error| panic!("{}: {error}", log.display()));
    let errors = file.try_clone().expect("a second handle of the log");
    command.stdin(Stdio::null()).stdout(file).stderr(errors);
    let (before, started) = (user_time_of_children(), Instant::now());
    let status = command.status().unwrap_or_else(|error| panic!("{command:?}: {error}"));
    let cost = Cost { user: user_time_of_children() - before, wall: started.elapsed().as_secs_f64() };
    let text = String::from_utf8_lossy(&fs::read(log).expect("the log")).into_owned();
    let complaint = text.lines().find(|line| line.contains("ERROR"));
    assert!(status.success() && complaint.is_none(), "{command:?}: {status}\n{}", complaint.unwrap_or(&text));
    (text, cost)
}

/// Field 16 of proc(5), `cutime`: of all children that have ended, with theirs. The command in field 2 may hold spaces.
fn user_time_of_children() -> f64 {
    let stat = fs::read_to_string("/proc/self/stat").expect("Linux' proc file system");
    let after_command = stat.rfind(')').map_or("", |end| &stat[end + 1..]);
    let ticks = after_command.split_ascii_whitespace().nth(13).and_then(|field| field.parse::<f64>().ok());
    ticks.expect("cutime in /proc/self/stat") / TICKS
}
