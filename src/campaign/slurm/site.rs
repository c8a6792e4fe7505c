//! The site file: what one cluster wants to know of every job, as TOML. Read with the machinery of scenes, so everything
//! that is wrong is found at once, with its line.

use crate::scene::Finding;
use crate::scene::diagnostics::{Place, Report};
use crate::scene::quantity::Dimension;
use crate::scene::reader::{Limit, Reader};
use crate::scene::tree::{self, Node, Value};
use std::path::Path;

/// Lead of the signal at the end of the wall time, where the file does not say it [s].
pub const DEFAULT_SIGNAL_LEAD: u32 = 60;

/// So much earlier than asked for may Slurm send the signal [s] (`man sbatch`, `--signal`).
const SIGNAL_EARLINESS: f64 = 60.0;

/// Longest lead that Slurm takes [s].
const LONGEST_LEAD: f64 = 65535.0;

/// Longest wall time [s]: a year, above which a number is a slip.
const LONGEST_WALL_TIME: f64 = 366.0 * 86400.0;

/// A site file is written by hand; what is larger [bytes] is something else.
const LARGEST: u64 = 1 << 20;

/// What a cluster wants to know of every task.
#[derive(Debug, Clone, PartialEq)]
pub struct Site {
    /// Account that is charged; `None` for the user's default.
    pub account: Option<String>,
    /// Partition; `None` for the cluster's default.
    pub partition: Option<String>,
    /// Quality of service.
    pub qos: Option<String>,
    /// Reservation.
    pub reservation: Option<String>,
    /// Features that a node must have, as sbatch writes them: `avx512&ib`.
    pub constraint: Option<String>,
    /// Environment modules to load, in this order.
    pub modules: Vec<String>,
    /// Lines of bash that run before the task.
    pub setup: Vec<String>,
    /// Words that take the place of `mpirun`; empty for `mpirun` itself.
    pub launcher: Vec<String>,
    /// Wall time of one go of a task [s]; a task that needs longer is interrupted, queued again and goes on.
    pub wall_time: f64,
    /// So long before the end of the wall time a task is asked to write its checkpoint [s].
    pub signal_lead: u32,
    /// Memory of a task [bytes], in place of what the plan expects.
    pub memory: Option<u64>,
    /// Processors of a task or of each of its MPI ranks, in place of what the campaign asks for.
    pub cpus: Option<u32>,
    /// Most tasks in one array, where the cluster allows more.
    pub max_array_size: Option<u64>,
    /// Most tasks of an array that run at the same time.
    pub throttle: Option<u64>,
    /// Further options of sbatch, one an entry.
    pub sbatch: Vec<String>,
}

impl Site {
    /// Reads a site file.
    ///
    /// # Errors
    /// Everything that is wrong with it, in the file's order; [`crate::scene::diagnostics::render`] makes text of it.
    pub fn read(path: &Path) -> Result<Self, Vec<Finding>> {
        let shown = path.display().to_string();
        let text = match std::fs::metadata(path) {
            Ok(found) if !found.is_file() => Err("it is no file".to_owned()),
            Ok(found) if found.len() > LARGEST => Err(format!("it has {} bytes, more than any site file", found.len())),
            Ok(_) => std::fs::read_to_string(path).map_err(|error| error.to_string()),
            Err(error) => Err(error.to_string()),
        };
        text.map_or_else(|reason| Err(unreadable(&shown, &reason)), |text| Self::from_text(&text, &shown))
    }

    /// Reads the text of a site file, which findings call `file`.
    ///
    /// # Errors
    /// As [`Site::read`].
    pub fn from_text(text: &str, file: &str) -> Result<Self, Vec<Finding>> {
        let report = Report::new(file, text);
        let root = tree::parse(text, &report);
        // What follows a syntax error is anybody's guess.
        let site = report.is_empty().then(|| resolve(Reader::root(&root, "site file", &report)));
        site.filter(|_| report.is_empty()).ok_or_else(|| report.into_findings())
    }
}

fn unreadable(file: &str, reason: &str) -> Vec<Finding> {
    let report = Report::new(file, "");
    report.error(
        "file-unreadable",
        &Place::in_file(0..0),
        format!("the site file \"{file}\" cannot be read: {reason}"),
        "name a TOML file that says at least `wall_time = \"2 h\"`; docs/slurm.md has an example",
    );
    report.into_findings()
}

/// Reads every key; what is missing or wrong has its finding, and any value.
fn resolve(reader: Reader<'_>) -> Site {
    let wall_time = reader.need_quantity("wall_time", Dimension::Time, Limit::Within(0.0, LONGEST_WALL_TIME));
    let lead = reader.quantity("signal_lead", Dimension::Time, Limit::Within(0.0, LONGEST_LEAD));
    let signal_lead = lead.map_or(DEFAULT_SIGNAL_LEAD, |lead| lead.ceil() as u32);
    check_lead(&reader, wall_time, signal_lead);
    let site = Site {
        account: word(&reader, "account"),
        partition: word(&reader, "partition"),
        qos: word(&reader, "qos"),
        reservation: word(&reader, "reservation"),
        constraint: word(&reader, "constraint"),
        modules: lines(&reader, "modules", "\"gcc/12\""),
        setup: lines(&reader, "setup", "\"export NAME=value\""),
        launcher: lines(&reader, "launcher", "\"srun\""),
        wall_time: wall_time.unwrap_or_default(),
        signal_lead,
        memory: memory(&reader),
        cpus: count(&reader, "cpus", 8).map(|count| u32::try_from(count).unwrap_or(u32::MAX)),
        max_array_size: count(&reader, "max_array_size", 1000),
        throttle: count(&reader, "throttle", 50),
        sbatch: options(&reader),
    };
    reader.finish();
    site
}

/// Slurm may send the signal early, and a task that is signalled as it starts would never get on.
fn check_lead(reader: &Reader<'_>, wall_time: Option<f64>, signal_lead: u32) {
    let Some(wall_time) = wall_time else { return };
    let least = f64::from(signal_lead) + SIGNAL_EARLINESS;
    if wall_time <= least {
        reader.report.error(
            "out-of-range",
            &reader.place_of("wall_time"),
            format!(
                "a wall time of {wall_time} s leaves no time to compute: the checkpoint is asked for {signal_lead} s before its \
                 end, and Slurm may do so {SIGNAL_EARLINESS} s early"
            ),
            format!("give `wall_time` well more than {least} s, or a shorter `signal_lead`"),
        );
    }
}

/// A word that may stand behind an option of sbatch.
fn word(reader: &Reader<'_>, key: &'static str) -> Option<String> {
    let text = reader.text(key)?;
    let is_plain = |c: char| c.is_ascii_graphic() && !"\"'\\#`$".contains(c);
    if text.is_empty() || !text.chars().all(is_plain) {
        reader.report.error(
            "bad-name",
            &reader.place_of(key),
            format!("`{key}` cannot be \"{}\"", text.escape_debug()),
            "write it as sbatch takes it, without blanks, quotes, `#`, `$` and backslashes; leave the key out for the default",
        );
        return None;
    }
    Some(text.to_owned())
}

/// An array of texts that are one line each; empty where it is not given.
fn lines(reader: &Reader<'_>, key: &'static str, example: &str) -> Vec<String> {
    placed_lines(reader, key, example).into_iter().map(|(text, _)| text.to_owned()).collect()
}

fn placed_lines<'a>(reader: &Reader<'a>, key: &'static str, example: &str) -> Vec<(&'a str, &'a Place)> {
    let Some(node) = reader.node(key) else { return Vec::new() };
    let Value::Array(items) = &node.value else {
        reader.wrong_type(key, node, "an array of strings", &format!("[{example}]"));
        return Vec::new();
    };
    let line = |item: &'a Node| match &item.value {
        Value::Text(text) if text.trim().is_empty() || text.chars().any(|c| c.is_control() && c != '\t') => {
            reader.report.error(
                "bad-name",
                &item.place,
                format!("`{key}` cannot hold \"{}\": each entry is one line that is not empty", text.escape_debug()),
                "write one entry a line",
            );
            None
        }
        Value::Text(text) => Some((text.as_str(), &item.place)),
        _ => {
            reader.wrong_type(key, item, "an array of strings", &format!("[{example}]"));
            None
        }
    };
    items.iter().filter_map(line).collect()
}

/// A whole number above 0.
fn count(reader: &Reader<'_>, key: &'static str, example: u64) -> Option<u64> {
    let count = reader.integer(key, example)?;
    if count == 0 {
        reader.report.error(
            "out-of-range",
            &reader.place_of(key),
            format!("`{key}` must be at least 1, and is 0"),
            "correct the value, or leave the key out",
        );
        return None;
    }
    Some(count)
}

/// Units of memory, one of them in bytes. Slurm's MB is 1024 times 1024 bytes, and so is ours here.
const MEMORY_UNITS: [(&str, u64); 6] =
    [("MB", 1 << 20), ("MiB", 1 << 20), ("GB", 1 << 30), ("GiB", 1 << 30), ("TB", 1 << 40), ("TiB", 1 << 40)];

/// Memory [bytes].
fn memory(reader: &Reader<'_>) -> Option<u64> {
    let text = reader.text("memory")?;
    let read = |(unit, factor): (&str, u64)| {
        let number: f64 = text.trim().strip_suffix(unit)?.trim_end().parse().ok()?;
        let bytes = number * factor as f64;
        // At least the megabyte that Slurm counts in, and no slip.
        ((1 << 20) as f64..(1_u64 << 50) as f64).contains(&bytes).then_some(bytes as u64)
    };
    let found = MEMORY_UNITS.into_iter().find_map(read);
    if found.is_none() {
        reader.report.error(
            "bad-quantity",
            &reader.place_of("memory"),
            format!("`memory` cannot read \"{}\" as an amount of memory", text.escape_debug()),
            "write a number and MB, GB or TB, for example `memory = \"4 GB\"`",
        );
    }
    found
}

/// Options that the script or the submission gives, and what to use instead.
const OWN_OPTIONS: [(&str, &str, &str); 22] = [
    ("--account", "-A", "the key `account`"),
    ("--array", "-a", "the keys `max_array_size` and `throttle`"),
    ("--chdir", "-D", "nothing: tasks start in the workspace"),
    ("--constraint", "-C", "the key `constraint`"),
    ("--cpus-per-task", "-c", "the key `cpus`"),
    ("--dependency", "-d", "nothing: tasks wait for what they need"),
    ("--error", "-e", "nothing: logs are in the workspace"),
    ("--job-name", "-J", "nothing: jobs are found by their names"),
    ("--kill-on-invalid-dep", "", "nothing: tasks that can never start are found and cancelled"),
    ("--mem", "", "the key `memory`"),
    ("--no-requeue", "", "nothing: tasks that need longer than the wall time are queued again"),
    ("--nodes", "-N", "nothing: a task has one node"),
    ("--ntasks", "-n", "nothing: the scene says how many MPI ranks there are"),
    ("--open-mode", "", "nothing: logs are continued"),
    ("--output", "-o", "nothing: logs are in the workspace"),
    ("--parsable", "", "nothing: it is always given"),
    ("--partition", "-p", "the key `partition`"),
    ("--qos", "-q", "the key `qos`"),
    ("--requeue", "", "nothing: it is always given"),
    ("--reservation", "", "the key `reservation`"),
    ("--signal", "", "the key `signal_lead`"),
    ("--time", "-t", "the key `wall_time`"),
];

/// Further options of sbatch.
fn options(reader: &Reader<'_>) -> Vec<String> {
    let mut options = Vec::new();
    for (text, place) in placed_lines(reader, "sbatch", "\"--gres=gpu:1\"") {
        let name = text.split(|c: char| c == '=' || c.is_whitespace()).next().unwrap_or_default();
        let is_own = |(long, short, _): &&(&str, &str, &str)| {
            name == *long || (!short.is_empty() && !name.starts_with("--") && name.starts_with(short))
        };
        if !text.starts_with('-') {
            reader.report.error(
                "bad-name",
                place,
                format!("`sbatch` cannot hold \"{text}\", which is no option"),
                "write options as in a script, without `#SBATCH`: \"--gres=gpu:1\"",
            );
        } else if let Some((long, _, instead)) = OWN_OPTIONS.iter().find(is_own) {
            reader.report.error(
                "key-not-here",
                place,
                format!("`sbatch` must not hold {long}, which the script gives itself"),
                format!("remove it; in its place there is {instead}"),
            );
        } else {
            options.push(text.to_owned());
        }
    }
    options
}

#[cfg(test)]
mod tests;
