//! The script that sbatch gets: one task of an array, its key a line of a file. Its text is `templates/slurm/task_array.sh`.

use super::error::SlurmError;
use super::site::Site;
use crate::backend::liggghts::probe::LAUNCHER_VARIABLE;
use crate::exit_code;
use crate::storage::staging;
use std::ffi::{OsStr, OsString};
use std::os::unix::ffi::OsStrExt;
use std::path::{Path, PathBuf};

const TEMPLATE: &str = include_str!("../../../templates/slurm/task_array.sh");

/// Slurm counts memory in these [bytes].
const MEGABYTE: u64 = 1 << 20;

/// A script for an array of tasks.
#[derive(Debug, Clone)]
pub struct TaskScript<'a> {
    /// What the cluster wants.
    pub site: &'a Site,
    /// Words of the command; the task's key follows them, then `--threads` and the number of processors.
    pub command: &'a [OsString],
    /// The file with the keys, one a line, as [`write_tasks`] writes it.
    pub tasks: &'a Path,
    /// Folder of the logs.
    pub logs: &'a Path,
    /// What the tasks are, in a line of comment.
    pub title: &'a str,
    /// Threads of a task, one a processor; the site may say it, too, and then it counts.
    pub threads: u32,
    /// MPI ranks of a task; 1 without MPI. Each has so many threads.
    pub ranks: u32,
    /// Memory of a task \[bytes\]; the site may say it, too, and then it counts.
    pub memory: u64,
}

impl TaskScript<'_> {
    /// Its text.
    ///
    /// # Errors
    /// Where the folder a relative path starts from is gone.
    pub fn render(&self) -> Result<String, SlurmError> {
        let cpus = self.site.cpus.unwrap_or(self.threads).max(1);
        let memory = self.site.memory.unwrap_or(self.memory).div_ceil(MEGABYTE).max(1);
        let title: String = self.title.chars().map(|c| if c.is_control() { ' ' } else { c }).collect();
        let mut command: Vec<String> = self.command.iter().map(|word| quoted(word)).collect();
        command.extend(["\"$key\"".to_owned(), "--threads".to_owned(), cpus.to_string()]);
        let values = [
            ("title", title),
            ("ranks", self.ranks.max(1).to_string()),
            ("cpus", cpus.to_string()),
            ("memory", memory.to_string()),
            ("time", wall_time(self.site.wall_time)),
            ("lead", self.site.signal_lead.to_string()),
            ("options", options(self.site)),
            ("tasks", quoted(absolute(self.tasks)?.as_os_str())),
            ("logs", quoted(absolute(self.logs)?.as_os_str())),
            ("site", preparations(self.site)),
            ("command", command.join(" ")),
            ("checkpoint", exit_code::INTERRUPTED.to_string()),
        ];
        Ok(fill(TEMPLATE, &values))
    }

    /// Writes it to a file, whose folder is made where it is missing, and makes the folder of the logs.
    ///
    /// # Errors
    /// As [`TaskScript::render`], and where the disk refuses.
    pub fn write(&self, path: &Path) -> Result<(), SlurmError> {
        let text = self.render()?;
        std::fs::create_dir_all(self.logs)
            .map_err(|source| crate::storage::StorageError::system("make the folder", self.logs, source))?;
        Ok(staging::write_whole(path, text.as_bytes())?)
    }
}

/// Writes the file with the keys of an array's tasks, one a line.
///
/// # Errors
/// Where a key is no word of letters, digits, `_`, `-` and `.`, or the disk refuses.
pub fn write_tasks(path: &Path, keys: &[String]) -> Result<(), SlurmError> {
    let is_plain =
        |key: &&String| !key.is_empty() && key.chars().all(|c| c.is_ascii_alphanumeric() || "_-.".contains(c));
    if let Some(key) = keys.iter().find(|key| !is_plain(key)) {
        return Err(SlurmError::refused(format!("{key:?} cannot be the name of a task: names are hexadecimal")));
    }
    let text: String = keys.iter().flat_map(|key| [key.as_str(), "\n"]).collect();
    Ok(staging::write_whole(path, text.as_bytes())?)
}

fn absolute(path: &Path) -> Result<PathBuf, SlurmError> {
    std::path::absolute(path).map_err(|error| SlurmError::bad_path("the path", path, &error.to_string()))
}

/// Days, hours, minutes and seconds, as sbatch reads them. Slurm counts in minutes and rounds up.
fn wall_time(seconds: f64) -> String {
    let seconds = seconds.ceil() as u64;
    format!("{}-{:02}:{:02}:{:02}", seconds / 86400, seconds / 3600 % 24, seconds / 60 % 60, seconds % 60)
}

/// Lines for sbatch that only some sites have.
fn options(site: &Site) -> String {
    let words = [
        ("account", &site.account),
        ("partition", &site.partition),
        ("qos", &site.qos),
        ("reservation", &site.reservation),
        ("constraint", &site.constraint),
    ];
    let words = words.iter().filter_map(|(name, word)| word.as_ref().map(|word| format!("#SBATCH --{name}={word}\n")));
    let further = site.sbatch.iter().map(|option| format!("#SBATCH {option}\n"));
    words.chain(further).collect()
}

/// What runs before the task.
fn preparations(site: &Site) -> String {
    let mut text = String::new();
    if !site.modules.is_empty() {
        // `module` is a function of login shells.
        text += "[ \"$(type -t module)\" = function ] || . /etc/profile\n";
    }
    for module in &site.modules {
        let name = quoted(OsStr::new(module));
        let complaint = quoted(OsStr::new(&format!("the module {module} cannot be loaded")));
        text += &format!("module load {name} || {{ echo {complaint} >&2; exit 3; }}\n");
    }
    if !site.launcher.is_empty() {
        text += &format!("export {LAUNCHER_VARIABLE}={}\n", quoted(OsStr::new(&site.launcher.join("\n"))));
    }
    site.setup.iter().for_each(|line| text += &format!("{line}\n"));
    text
}

/// As bash reads it as one word, whatever is in it.
fn quoted(word: &OsStr) -> String {
    let bytes = word.as_bytes();
    match word.to_str().filter(|text| !text.chars().any(char::is_control)) {
        Some(text)
            if !text.is_empty() && text.chars().all(|c| c.is_ascii_alphanumeric() || "/._-+=:,@%".contains(c)) =>
        {
            text.to_owned()
        }
        Some(text) => format!("'{}'", text.replace('\'', r"'\''")),
        None => {
            let byte = |byte: &u8| match byte {
                b'\'' | b'\\' => format!("\\{}", char::from(*byte)),
                b' '..=b'~' => char::from(*byte).to_string(),
                _ => format!("\\{byte:03o}"),
            };
            format!("$'{}'", bytes.iter().map(byte).collect::<String>())
        }
    }
}

/// The template with its places filled in; each stands once in a line at most. A line that is nothing but a place vanishes
/// where it is empty.
fn fill(template: &str, values: &[(&str, String)]) -> String {
    let mut filled = String::with_capacity(2 * template.len());
    for line in template.lines() {
        let found = values.iter().find_map(|(name, value)| {
            let place = format!("{{{{{name}}}}}");
            line.split_once(&place).map(|(before, after)| (before, value, after))
        });
        match found {
            Some(("", value, "")) => {
                filled.push_str(value.trim_end_matches('\n'));
                if value.is_empty() {
                    continue;
                }
            }
            Some((before, value, after)) => filled.extend([before, value, after]),
            None => filled.push_str(line),
        }
        filled.push('\n');
    }
    filled
}

#[cfg(test)]
mod tests;
