//! Where the time of a run goes: wall time by phase; processor time and memory of the process.
//!
//! Only ever reported. Nothing measured here may decide anything that changes a result.

use std::collections::BTreeMap;
use std::fs;
use std::time::{Duration, Instant};

/// A phase of a run.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Phase {
    /// Neighbour search.
    Neighbour,
    /// Contacts between particles and with parts.
    Contacts,
    /// Motion of the particles.
    Integration,
    /// Insertion and removal.
    Feeds,
    /// Recording, ghosts and what else is done at gates.
    Gates,
    /// Writing of files, as far as the solver waits for it.
    Output,
    /// An external code at work.
    External,
    /// Everything else.
    Other,
}

impl Phase {
    /// All phases, in the order of a time step.
    pub const ALL: [Self; 8] = [
        Self::Neighbour,
        Self::Contacts,
        Self::Integration,
        Self::Feeds,
        Self::Gates,
        Self::Output,
        Self::External,
        Self::Other,
    ];

    /// Name in tables and in `summary.json`.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Neighbour => "neighbour",
            Self::Contacts => "contacts",
            Self::Integration => "integration",
            Self::Feeds => "feeds",
            Self::Gates => "gates",
            Self::Output => "output",
            Self::External => "external",
            Self::Other => "other",
        }
    }
}

/// Wall time by phase.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Timing {
    spent: [Duration; Phase::ALL.len()],
}

impl Timing {
    /// Runs `work` and counts its wall time to `phase`.
    pub fn measure<T>(&mut self, phase: Phase, work: impl FnOnce() -> T) -> T {
        let start = Instant::now();
        let result = work();
        self.add(phase, start.elapsed());
        result
    }

    /// Counts a duration to `phase`.
    pub fn add(&mut self, phase: Phase, duration: Duration) {
        self.spent[phase as usize] += duration;
    }

    /// Wall time of `phase`.
    #[must_use]
    pub const fn spent(&self, phase: Phase) -> Duration {
        self.spent[phase as usize]
    }

    /// Wall time of all phases.
    #[must_use]
    pub fn total(&self) -> Duration {
        self.spent.iter().sum()
    }

    /// Sets `Other` to what is left of the wall time `wall` of the whole.
    pub fn close(&mut self, wall: Duration) {
        self.spent[Phase::Other as usize] = Duration::ZERO;
        self.spent[Phase::Other as usize] = wall.saturating_sub(self.total());
    }

    /// Seconds by name, as `summary.json` has them.
    #[must_use]
    pub fn seconds(&self) -> BTreeMap<String, f64> {
        Phase::ALL.iter().map(|&phase| (phase.name().to_owned(), self.spent(phase).as_secs_f64())).collect()
    }

    /// The table for people: phase, seconds, share; without phases that there were none of.
    #[must_use]
    pub fn table(&self) -> String {
        let total = self.total().as_secs_f64().max(f64::MIN_POSITIVE);
        Phase::ALL
            .iter()
            .filter(|&&phase| !self.spent(phase).is_zero())
            .map(|&phase| {
                let seconds = self.spent(phase).as_secs_f64();
                format!("{:<12} {seconds:>10.2} s {:>5.1} %\n", phase.name(), 100.0 * seconds / total)
            })
            .collect()
    }
}

/// What the process has used so far.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct ProcessUse {
    /// Processor time of all threads [s].
    pub cpu_s: Option<f64>,
    /// Largest memory in use [bytes].
    pub peak_memory_bytes: Option<u64>,
}

impl ProcessUse {
    /// What has been used since `before`; the largest memory is that since [`reset_peak_memory`].
    #[must_use]
    pub fn since(before: &Self) -> Self {
        let now = Self::now();
        Self { cpu_s: now.cpu_s.zip(before.cpu_s).map(|(now, then)| now - then), ..now }
    }

    /// Asks the system; a field is empty where it does not tell.
    #[must_use]
    pub fn now() -> Self {
        Self::of("self", 2)
    }

    /// What a process has used, with the processor time of its children that have ended and whose status it has asked for. Of one
    /// that has ended itself the memory is no longer known.
    #[must_use]
    pub fn of_family(pid: i32) -> Self {
        Self::of(&pid.to_string(), 4)
    }

    fn of(process: &str, times: usize) -> Self {
        let read = |name: &str| fs::read_to_string(format!("/proc/{process}/{name}")).ok();
        let ticks = fs::read("/proc/self/auxv").ok().and_then(|auxv| clock_ticks(&auxv)).unwrap_or(100.0);
        Self {
            cpu_s: read("stat").and_then(|stat| cpu_ticks(&stat, times)).map(|used| used as f64 / ticks),
            peak_memory_bytes: read("status").and_then(|status| peak_memory(&status)),
        }
    }
}

/// Lets the system count the largest memory in use anew, see proc(5), `clear_refs`. Where it does not, the largest since the
/// process began goes on to count.
pub fn reset_peak_memory() {
    drop(fs::write("/proc/self/clear_refs", "5"));
}

/// utime + stime, fields 14 and 15 of proc(5), with 4 `times` also cutime + cstime behind them; the command in field 2 may hold spaces
/// and brackets itself.
fn cpu_ticks(stat: &str, times: usize) -> Option<u64> {
    let after_command = &stat[stat.rfind(')')? + 1..];
    let fields: Vec<u64> =
        after_command.split_ascii_whitespace().skip(11).take(times).map_while(|field| field.parse().ok()).collect();
    (fields.len() == times).then(|| fields.iter().sum())
}

/// Clock ticks per second: entry `AT_CLKTCK` of getauxval(3), pairs of machine words.
fn clock_ticks(auxv: &[u8]) -> Option<f64> {
    const AT_CLKTCK: usize = 17;
    const WORD: usize = size_of::<usize>();
    let words: Vec<usize> = auxv.as_chunks::<WORD>().0.iter().map(|&word| usize::from_ne_bytes(word)).collect();
    words.chunks_exact(2).find(|pair| pair[0] == AT_CLKTCK && pair[1] > 0).map(|pair| pair[1] as f64)
}

fn peak_memory(status: &str) -> Option<u64> {
    let line = status.lines().find_map(|line| line.strip_prefix("VmHWM:"))?;
    line.trim().strip_suffix("kB")?.trim().parse::<u64>().ok()?.checked_mul(1024)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn phases_add_up_and_the_rest_is_other() {
        let mut timing = Timing::default();
        timing.add(Phase::Contacts, Duration::from_secs(3));
        timing.add(Phase::Contacts, Duration::from_secs(1));
        timing.add(Phase::Output, Duration::from_secs(1));
        assert_eq!(timing.measure(Phase::Feeds, || 7), 7);
        for _ in 0..2 {
            timing.close(Duration::from_secs(10));
            assert_eq!(timing.total(), Duration::from_secs(10));
        }
        assert_eq!(timing.seconds()["contacts"], 4.0);
        assert!(timing.table().contains("contacts           4.00 s  40.0 %"), "{}", timing.table());
        let order: Vec<usize> = Phase::ALL.iter().map(|&phase| phase as usize).collect();
        assert_eq!(order, (0..Phase::ALL.len()).collect::<Vec<_>>(), "a phase is its own place in the table");
    }

    #[test]
    fn the_systems_tables_are_read_by_their_definition() {
        let stat = "42 (a ) b) R 1 2 3 4 5 6 7 8 9 10 250 50 0 0";
        assert_eq!(cpu_ticks(stat, 2), Some(300));
        assert_eq!(cpu_ticks("1 (a) R 1 2 3 4 5 6 7 8 9 10 250 50 7 1", 4), Some(308));
        assert_eq!(cpu_ticks("42 (a", 2), None);
        assert_eq!(peak_memory("VmPeak:\t 9 kB\nVmHWM:\t    2048 kB\n"), Some(2048 * 1024));
        let words: [usize; 6] = [6, 4096, 17, 250, 0, 0];
        let auxv: Vec<u8> = words.iter().flat_map(|word| word.to_ne_bytes()).collect();
        assert_eq!(clock_ticks(&auxv), Some(250.0));
    }

    #[test]
    fn this_process_uses_memory_and_time() {
        let block = vec![1_u8; 64 << 20];
        let start = Instant::now();
        let mut sum = 0_u64;
        while start.elapsed() < Duration::from_millis(60) {
            sum = sum.wrapping_add(block.iter().map(|&byte| u64::from(byte)).sum());
        }
        assert!(sum > 0);
        let used = ProcessUse::now();
        assert!(used.peak_memory_bytes.unwrap() >= block.len() as u64);
        assert!(used.cpu_s.unwrap() > 0.0);
    }
}
