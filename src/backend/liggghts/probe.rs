//! Which LIGGGHTS there is, and what it can do, asked of the program itself.

use super::super::BackendError;
use super::screen;
use std::collections::{BTreeMap, BTreeSet};
use std::ffi::{OsStr, OsString};
use std::fmt;
use std::io::Read;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::sync::{Mutex, PoisonError};
use std::time::{Duration, Instant};

/// Names another program than the `liggghts` of the search path.
pub const PROGRAM_VARIABLE: &str = "TOLLGATE_LIGGGHTS";
/// Versions whose decks, prints and files are known begin so.
pub const KNOWN_VERSIONS: &str = "3.8.";
/// How to get it.
pub const HOW_TO_INSTALL: &str = "apt-get install liggghts";
/// Longest that a program may take to say what it can do.
const PATIENCE: Duration = Duration::from_secs(60);

/// What a deck is made of.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Kind {
    /// Kinds of particles.
    Atom,
    /// Pair styles.
    Pair,
    /// Models of the normal force.
    Normal,
    /// Models of the tangential force.
    Tangential,
    /// Models of cohesion.
    Cohesion,
    /// Models of rolling resistance.
    Rolling,
    /// Fixes.
    Fix,
    /// Computes.
    Compute,
    /// Regions.
    Region,
    /// Dumps.
    Dump,
    /// Commands that are compiled in one by one.
    Command,
}

impl Kind {
    /// Every kind.
    pub const ALL: [Self; 11] = [
        Self::Atom,
        Self::Pair,
        Self::Normal,
        Self::Tangential,
        Self::Cohesion,
        Self::Rolling,
        Self::Fix,
        Self::Compute,
        Self::Region,
        Self::Dump,
        Self::Command,
    ];

    /// As the program's own list calls it.
    #[must_use]
    pub const fn heading(self) -> &'static str {
        match self {
            Self::Atom => "Atom styles",
            Self::Pair => "Pair styles",
            Self::Normal => "Normal models for pair gran",
            Self::Tangential => "Tangential models for pair gran",
            Self::Cohesion => "Cohesion models for pair gran",
            Self::Rolling => "Rolling models for pair gran",
            Self::Fix => "Fix styles",
            Self::Compute => "Compute styles",
            Self::Region => "Region styles",
            Self::Dump => "Dump styles",
            Self::Command => "Command styles",
        }
    }

    /// What decks need of it.
    #[must_use]
    pub const fn needed(self) -> &'static [&'static str] {
        match self {
            Self::Atom => &["granular"],
            Self::Pair => &["gran"],
            Self::Normal => &["hertz", "hooke", "hertz/stiffness", "hooke/stiffness"],
            Self::Tangential => &["history", "no_history"],
            Self::Cohesion => &[],
            Self::Rolling => &["cdt", "epsd2"],
            Self::Fix => &[
                "gravity",
                "mesh/surface",
                "move/mesh",
                "nve",
                "nve/noforce",
                "nve/sphere",
                "property/global",
                "setforce",
                "wall/gran",
            ],
            Self::Compute => &["pair/gran/local", "reduce", "wall/gran/local"],
            Self::Region => &["block", "intersect", "plane", "union"],
            Self::Dump => &["custom", "local"],
            Self::Command => &["create_box", "delete_atoms", "read_data", "run", "set", "write_dump"],
        }
    }
}

/// Compiled styles by kind.
pub type Styles = BTreeMap<Kind, BTreeSet<String>>;

/// What was found.
#[derive(Debug, Clone, PartialEq)]
pub struct Probe {
    /// The program.
    pub path: PathBuf,
    /// Its version, as in 3.8.0.
    pub version: String,
    /// What is compiled in.
    pub styles: Styles,
    /// Programs that a case is started with.
    pub tools: Tools,
}

impl Probe {
    /// True where a style is compiled in.
    #[must_use]
    pub fn knows(&self, kind: Kind, style: &str) -> bool {
        self.styles.get(&kind).is_some_and(|styles| styles.contains(style))
    }

    /// What decks need and the program lacks.
    #[must_use]
    pub fn lacking(&self) -> Vec<(Kind, &'static str)> {
        let needed = Kind::ALL.into_iter().flat_map(|kind| kind.needed().iter().map(move |&style| (kind, style)));
        needed.filter(|&(kind, style)| !self.knows(kind, style)).collect()
    }
}

/// Variable that names what starts several ranks in place of mpirun: its words, one a line.
pub const LAUNCHER_VARIABLE: &str = "TOLLGATE_MPI_LAUNCHER";

/// The words that start several ranks: those of the environment, else `mpirun`. A number of ranks follows them as `-n 4`, which mpirun
/// and srun understand.
#[must_use]
pub fn launcher() -> Vec<OsString> {
    let words = std::env::var(LAUNCHER_VARIABLE).unwrap_or_default();
    let words: Vec<OsString> = words.lines().filter(|word| !word.is_empty()).map(OsString::from).collect();
    if words.is_empty() { vec!["mpirun".into()] } else { words }
}

/// Programs that a case is started with, where they are there.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Tools {
    /// Starts several ranks; Debian's liggghts brings it. What [`launcher`] names, where it is another.
    pub mpirun: Option<PathBuf>,
    /// Lets lines through as they are printed; of coreutils.
    pub stdbuf: Option<PathBuf>,
    /// Ends what was started when its starter dies; of util-linux.
    pub setpriv: Option<PathBuf>,
}

impl Tools {
    /// Those of the search path.
    #[must_use]
    pub fn find() -> Self {
        let find = |name: &str| find(OsStr::new(name));
        Self { mpirun: self::find(&launcher()[0]), stdbuf: find("stdbuf"), setpriv: find("setpriv") }
    }

    /// What is missing to start a case on so many ranks, and how to get it.
    #[must_use]
    pub fn missing(&self, ranks: u32) -> Option<Unusable> {
        let missing = |name, package| Some(Unusable::Tool { name, package });
        match self {
            Self { stdbuf: None, .. } => missing("stdbuf", "coreutils"),
            Self { setpriv: None, .. } => missing("setpriv", "util-linux"),
            Self { mpirun: None, .. } if ranks > 1 => missing("mpirun", "openmpi-bin"),
            _ => None,
        }
    }
}

/// Why there is no LIGGGHTS to work with.
#[derive(Debug, Clone, PartialEq)]
pub enum Unusable {
    /// It is not there.
    Missing {
        /// The program that was looked for.
        program: PathBuf,
    },
    /// It is there and does not answer as LIGGGHTS does.
    Silent {
        /// The program.
        program: PathBuf,
        /// What happened.
        reason: String,
    },
    /// It is of a version whose decks and prints are not known.
    Version {
        /// The program.
        program: PathBuf,
        /// Its version.
        found: String,
    },
    /// A program that starts it is not there.
    Tool {
        /// Its name.
        name: &'static str,
        /// Debian's package.
        package: &'static str,
    },
}

impl fmt::Display for Unusable {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Missing { program } => write!(
                f,
                "LIGGGHTS is not installed: there is no program {}; install it with `{HOW_TO_INSTALL}`, or name it in {PROGRAM_VARIABLE}",
                program.display()
            ),
            Self::Silent { program, reason } => {
                write!(f, "{} is no usable LIGGGHTS: {reason}; install it with `{HOW_TO_INSTALL}`", program.display())
            }
            Self::Version { program, found } => write!(
                f,
                "{} is LIGGGHTS {found}; version {KNOWN_VERSIONS}x is needed: `{HOW_TO_INSTALL}`, or name it in {PROGRAM_VARIABLE}",
                program.display()
            ),
            Self::Tool { name, package } => {
                write!(f, "{name}, which LIGGGHTS is started with, is not installed: `apt-get install {package}`")
            }
        }
    }
}

impl std::error::Error for Unusable {}

impl From<Unusable> for BackendError {
    fn from(unusable: Unusable) -> Self {
        Self::Incapable(unusable.to_string())
    }
}

/// The program that is asked for: that of the environment, else `liggghts`.
#[must_use]
pub fn program() -> OsString {
    std::env::var_os(PROGRAM_VARIABLE).filter(|name| !name.is_empty()).unwrap_or_else(|| "liggghts".into())
}

/// Where a program is: a path as it stands, a name in the search path.
#[must_use]
pub fn find(program: &OsStr) -> Option<PathBuf> {
    let name = Path::new(program);
    if name.components().count() > 1 {
        let path = std::path::absolute(name).ok()?;
        return is_program(&path).then_some(path);
    }
    let folders = std::env::var_os("PATH")?;
    std::env::split_paths(&folders).map(|folder| folder.join(name)).find(|path| is_program(path))
}

fn is_program(path: &Path) -> bool {
    use std::os::unix::fs::PermissionsExt;
    path.metadata().is_ok_and(|file| file.is_file() && file.permissions().mode() & 0o111 != 0)
}

/// The program's place.
///
/// # Errors
/// Where there is none.
pub fn path() -> Result<PathBuf, Unusable> {
    let program = program();
    find(&program).ok_or_else(|| Unusable::Missing { program: program.into() })
}

/// Refuses a version that is not known.
///
/// # Errors
/// Where it is another.
pub fn check_version(program: &Path, version: &str) -> Result<(), Unusable> {
    if version.starts_with(KNOWN_VERSIONS) {
        return Ok(());
    }
    Err(Unusable::Version { program: program.to_path_buf(), found: version.to_owned() })
}

/// Asks the program for its version and styles; once in a process, since it takes a noticeable time to answer.
///
/// # Errors
/// Where it is missing, does not answer, or is of another version.
pub fn probe() -> Result<Probe, Unusable> {
    static ANSWER: Mutex<Option<Probe>> = Mutex::new(None);
    let path = path()?;
    let mut answer = ANSWER.lock().unwrap_or_else(PoisonError::into_inner);
    match &*answer {
        Some(known) if known.path == path => Ok(known.clone()),
        _ => Ok(answer.insert(ask(path)?).clone()),
    }
}

fn ask(path: PathBuf) -> Result<Probe, Unusable> {
    let text = help(&path).map_err(|reason| Unusable::Silent { program: path.clone(), reason })?;
    let Some(version) = text.lines().find_map(screen::version) else {
        let first: String = text.lines().next().unwrap_or_default().chars().take(80).collect();
        let reason = format!("`-h` does not tell its version but {first:?}");
        return Err(Unusable::Silent { program: path, reason });
    };
    check_version(&path, &version)?;
    Ok(Probe { version, styles: styles(&text), tools: Tools::find(), path })
}

/// What it prints at `-h`, which is less than a pipe holds.
fn help(program: &Path) -> Result<String, String> {
    let mut command = Command::new(program);
    command.arg("-h").env("LC_ALL", "C").stdin(Stdio::null()).stdout(Stdio::piped()).stderr(Stdio::null());
    let mut child = command.spawn().map_err(|error| format!("it cannot be started ({error})"))?;
    let started = Instant::now();
    while child.try_wait().map_err(|error| error.to_string())?.is_none() {
        if started.elapsed() > PATIENCE {
            drop(child.kill());
            drop(child.wait());
            return Err(format!("it did not answer `-h` within {} s", PATIENCE.as_secs()));
        }
        std::thread::sleep(Duration::from_millis(5));
    }
    let mut bytes = Vec::new();
    if let Some(mut output) = child.stdout.take() {
        output.read_to_end(&mut bytes).map_err(|error| error.to_string())?;
    }
    Ok(String::from_utf8_lossy(&bytes).into_owned())
}

/// The lists under `* HEADING`: words in columns, up to the next heading.
fn styles(text: &str) -> Styles {
    let mut styles = Styles::new();
    let mut kind = None;
    for line in text.lines() {
        if let Some(heading) = line.strip_prefix("* ") {
            let heading = heading.trim().trim_end_matches(':');
            kind = Kind::ALL.into_iter().find(|kind| kind.heading() == heading);
        } else if let Some(kind) = kind {
            styles.entry(kind).or_default().extend(line.split_ascii_whitespace().map(str::to_owned));
        }
    }
    styles
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lists_are_read_up_to_the_next_heading() {
        let text = "LIGGGHTS (Version LIGGGHTS-PUBLIC 3.8.0, x)\n\n* Pair styles:\n\ngran   soft\nline/lj\n\n* Surface models for pair gran:\n\ndefault\n\n* Fix styles\n\nnve\n";
        let styles = styles(text);
        assert_eq!(styles[&Kind::Pair], ["gran", "soft", "line/lj"].map(str::to_owned).into());
        assert_eq!(styles[&Kind::Fix], ["nve".to_owned()].into());
        assert_eq!(styles.len(), 2);
    }

    #[test]
    fn what_is_lacking_is_named() {
        let styles = Kind::ALL.map(|kind| (kind, kind.needed().iter().map(|&style| style.to_owned()).collect()));
        let mut probe =
            Probe { path: "x".into(), version: "3.8.0".into(), styles: styles.into(), tools: Tools::default() };
        assert!(probe.lacking().is_empty());
        probe.styles.get_mut(&Kind::Rolling).unwrap().remove("cdt");
        assert_eq!(probe.lacking(), [(Kind::Rolling, "cdt")]);
        assert!(probe.tools.missing(1).unwrap().to_string().contains("coreutils"));
    }

    #[test]
    fn programs_are_found_as_the_shell_finds_them() {
        assert!(find(OsStr::new("sh")).is_some_and(|path| path.ends_with("sh")));
        assert_eq!(find(OsStr::new("no-such-program-at-all")), None);
        assert_eq!(find(OsStr::new("/etc/passwd")), None, "a file is no program");
    }

    #[test]
    fn other_versions_are_refused() {
        assert!(check_version(Path::new("x"), "3.8.0").is_ok());
        let refused = check_version(Path::new("x"), "4.0.0").unwrap_err().to_string();
        assert!(refused.contains("4.0.0") && refused.contains("3.8.x is needed"), "{refused}");
    }
}
