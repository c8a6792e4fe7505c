//! The processes of a case: what they use, and how they end, all of them.

use crate::output::timing::ProcessUse;
use rustix::process::{Pid, Signal, WaitId, WaitIdOptions, kill_process, kill_process_group, waitid};
use std::collections::BTreeMap;
use std::fs;
use std::io;
use std::process::{Child, ExitStatus};
use std::time::{Duration, Instant};

/// Longest that a process asked to end may take before it is killed: time enough for the time step it is at.
const PATIENCE: Duration = Duration::from_secs(3);
/// First and longest interval between two looks at the memory in use: a short run is seen, a long one hardly disturbed.
const FIRST_LOOK: Duration = Duration::from_millis(5);
const LONGEST_LOOK: Duration = Duration::from_secs(1);

/// A process as proc(5) shows it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
struct Process {
    pid: i32,
    parent: i32,
    /// It has ended and waits to be asked for its status.
    has_ended: bool,
    /// Start in clock ticks since the system's: tells it from a later one with the same number.
    start: u64,
}

impl Process {
    fn of(pid: i32) -> Option<Self> {
        Self::parse(pid, &fs::read_to_string(format!("/proc/{pid}/stat")).ok()?)
    }

    /// Fields 3, 4 and 22 of proc(5); the command in field 2 may hold spaces and brackets itself.
    fn parse(pid: i32, stat: &str) -> Option<Self> {
        let mut fields = stat[stat.rfind(')')? + 1..].split_ascii_whitespace();
        let state = fields.next()?;
        let parent = fields.next()?.parse().ok()?;
        let start = fields.nth(17)?.parse().ok()?;
        Some(Self { pid, parent, has_ended: matches!(state, "Z" | "X"), start })
    }

    fn is_still_there(&self) -> bool {
        Self::of(self.pid).is_some_and(|now| now.start == self.start && !now.has_ended)
    }
}

/// All processes below `root`.
fn descendants(root: i32) -> Vec<Process> {
    let Ok(entries) = fs::read_dir("/proc") else { return Vec::new() };
    let all: Vec<Process> =
        entries.flatten().filter_map(|entry| Process::of(entry.file_name().to_str()?.parse().ok()?)).collect();
    let mut found: Vec<Process> = Vec::new();
    let mut parents = vec![root];
    while let Some(parent) = parents.pop() {
        for child in all.iter().filter(|process| process.parent == parent) {
            parents.push(child.pid);
            found.push(*child);
        }
    }
    found
}

/// A started process with all that it starts. Dropped before it has ended, it is killed.
#[derive(Debug)]
pub(super) struct Family {
    child: Child,
    has_descendants: bool,
    peaks: BTreeMap<i32, u64>,
    next_look: Instant,
    interval: Duration,
    ended: Option<Ended>,
}

/// How it ended.
#[derive(Debug, Clone, Copy)]
pub(super) struct Ended {
    pub status: ExitStatus,
    /// Processor time of it and of all whose status it has asked for [s].
    pub cpu_s: Option<f64>,
}

impl Family {
    /// Of a child that leads a process group of its own; `has_descendants` where it starts others.
    pub fn new(child: Child, has_descendants: bool) -> Self {
        let next_look = Instant::now() + FIRST_LOOK;
        Self { child, has_descendants, peaks: BTreeMap::new(), next_look, interval: FIRST_LOOK, ended: None }
    }

    fn pid(&self) -> Pid {
        Pid::from_child(&self.child)
    }

    /// Looks at the memory in use, now and then; to be called often.
    pub fn look(&mut self) {
        let now = Instant::now();
        if now < self.next_look {
            return;
        }
        self.interval = (2 * self.interval).min(LONGEST_LOOK);
        self.next_look = now + self.interval;
        let root = self.pid().as_raw_pid();
        let mut pids = vec![root];
        if self.has_descendants {
            pids.extend(descendants(root).iter().map(|process| process.pid));
        }
        for pid in pids {
            if let Some(bytes) = ProcessUse::of_family(pid).peak_memory_bytes {
                self.peaks.entry(pid).and_modify(|peak| *peak = bytes.max(*peak)).or_insert(bytes);
            }
        }
    }

    /// Sum of the largest memories in use [bytes], as far as they were seen.
    pub fn peak_memory_bytes(&self) -> Option<u64> {
        (!self.peaks.is_empty()).then(|| self.peaks.values().sum())
    }

    /// How it ended, once it has.
    pub fn has_ended(&mut self) -> io::Result<Option<Ended>> {
        if self.ended.is_none() {
            let look = WaitIdOptions::EXITED | WaitIdOptions::NOHANG | WaitIdOptions::NOWAIT;
            if waitid(WaitId::Pid(self.pid()), look)?.is_some() {
                // Its times are there only until its status is asked for.
                let cpu_s = ProcessUse::of_family(self.pid().as_raw_pid()).cpu_s;
                self.ended = self.child.try_wait()?.map(|status| Ended { status, cpu_s });
            }
        }
        Ok(self.ended)
    }

    /// Ends all of them: asks, waits, kills. Nothing of it is left afterwards.
    pub fn end(&mut self) -> io::Result<Ended> {
        if let Some(ended) = self.ended {
            return Ok(ended);
        }
        let below = descendants(self.pid().as_raw_pid());
        if self.has_ended()?.is_none() {
            // Gone already is as good.
            let _ = kill_process_group(self.pid(), Signal::TERM);
        }
        let asked = Instant::now();
        let mut ended = self.has_ended()?;
        while ended.is_none() && asked.elapsed() < PATIENCE {
            std::thread::sleep(Duration::from_millis(10));
            ended = self.has_ended()?;
        }
        if ended.is_none() {
            let _ = kill_process_group(self.pid(), Signal::KILL);
        }
        for process in below.iter().filter(|process| process.is_still_there()) {
            if let Some(pid) = Pid::from_raw(process.pid) {
                let _ = kill_process(pid, Signal::KILL);
            }
        }
        match ended {
            Some(ended) => Ok(ended),
            None => {
                let ended = Ended { status: self.child.wait()?, cpu_s: None };
                self.ended = Some(ended);
                Ok(ended)
            }
        }
    }
}

impl Drop for Family {
    fn drop(&mut self) {
        if self.ended.is_none() {
            drop(self.end());
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::os::unix::process::CommandExt;
    use std::process::{Command, Stdio};

    fn shell(script: &str) -> Family {
        let mut command = Command::new("sh");
        command.args(["-c", script]).process_group(0).stdout(Stdio::null());
        Family::new(command.spawn().unwrap(), true)
    }

    #[test]
    fn the_systems_table_is_read_by_its_definition() {
        let stat = "42 (a ) b) Z 7 3 4 5 6 7 8 9 10 11 12 13 14 15 16 17 18 19 99 20 21";
        assert_eq!(Process::parse(42, stat), Some(Process { pid: 42, parent: 7, has_ended: true, start: 99 }));
        assert_eq!(Process::parse(42, "42 (a"), None);
    }

    #[test]
    fn those_who_do_not_listen_are_killed_with_all_below_them() {
        // one that ignores the request, and one in a group of its own
        let mut family = shell("trap '' TERM; setsid sh -c 'sleep 1000' & while :; do sleep 0.1; done");
        std::thread::sleep(Duration::from_millis(300));
        let below = descendants(family.pid().as_raw_pid());
        assert!(below.len() >= 2, "{below:?}");
        family.end().unwrap();
        std::thread::sleep(Duration::from_millis(100));
        let left: Vec<&Process> = below.iter().filter(|process| process.is_still_there()).collect();
        assert!(left.is_empty(), "{left:?}");
    }

    #[test]
    fn time_and_memory_of_children_are_counted() {
        let mut family = shell(
            "i=0; while [ $i -lt 200000 ]; do i=$((i+1)); done; sh -c 'i=0; while [ $i -lt 200000 ]; do i=$((i+1)); done'",
        );
        let ended = loop {
            family.look();
            if let Some(ended) = family.has_ended().unwrap() {
                break ended;
            }
            std::thread::sleep(Duration::from_millis(2));
        };
        assert!(ended.status.success());
        // two counting loops take some 0.1 s each; a clock tick is 0.01 s
        assert!(ended.cpu_s.unwrap() > 0.02, "{ended:?}");
        assert!(family.peak_memory_bytes().unwrap() > 100_000);
    }
}
