//! Running the binary in a temporary folder, and reading what it leaves behind. Each target that drives the program adds its own
//! scenes and readers to these types.

use crate::draw::Draw;
use serde_json::Value;
use std::borrow::Cow;
use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Output, Stdio};
use std::time::{Duration, Instant, SystemTime};
use tempfile::TempDir;

/// Wall time after which a run that should have come somewhere is given up.
const PATIENCE: Duration = Duration::from_secs(300);

/// A folder that holds scenes and runs.
pub struct Bench {
    folder: TempDir,
}

impl Bench {
    pub fn new() -> Self {
        Self { folder: tempfile::tempdir().unwrap() }
    }

    pub fn path(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    pub fn text(&self, name: &str) -> String {
        fs::read_to_string(self.path(name)).unwrap_or_else(|error| panic!("{name}: {error}"))
    }

    pub fn json(&self, name: &str) -> Value {
        serde_json::from_str(&self.text(name)).unwrap()
    }

    fn command(&self, arguments: &[&str]) -> Command {
        let mut command = Command::new(env!("CARGO_BIN_EXE_tollgate"));
        command.current_dir(self.folder.path()).args(arguments).stdin(Stdio::null());
        command
    }

    /// Runs the binary to its end.
    pub fn tollgate(&self, arguments: &[&str]) -> Answer {
        Answer::from(self.command(arguments).output().unwrap())
    }

    /// `run scene.toml` on one thread into `out`.
    pub fn attempt(&self, out: &str, further: &[&str]) -> Answer {
        self.tollgate(&[&["run", "scene.toml", "--threads", "1", "--out", out], further].concat())
    }

    /// The same, expected to end with 0.
    pub fn run(&self, out: &str, further: &[&str]) -> Summary {
        let answer = self.attempt(out, further);
        assert_eq!(answer.code, 0, "{answer:?}");
        self.summary(out)
    }

    /// Starts the binary in the background.
    pub fn start(&self, arguments: &[&str]) -> Child {
        self.command(arguments).stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap()
    }

    /// Waits until `holds`; false where the run ended before.
    pub fn wait(&self, child: &mut Child, holds: impl Fn() -> bool) -> bool {
        let started = Instant::now();
        while !holds() {
            if child.try_wait().unwrap().is_some() {
                return false;
            }
            assert!(started.elapsed() < PATIENCE, "the run came nowhere");
            std::thread::sleep(Duration::from_micros(300));
        }
        true
    }

    pub fn summary(&self, out: &str) -> Summary {
        Summary(self.json(&format!("{out}/summary.json")))
    }

    /// Everything that a run left and that may not depend on when and how it was computed: all files, but for times.
    pub fn result(&self, out: &str) -> BTreeMap<String, Vec<u8>> {
        let contents = |(name, path): (String, PathBuf)| {
            let mut bytes = fs::read(path).unwrap();
            if name.ends_with("summary.json") {
                let mut summary: Value = serde_json::from_slice(&bytes).unwrap();
                forget_times(&mut summary);
                bytes = serde_json::to_vec_pretty(&summary).unwrap();
            }
            (name, bytes)
        };
        files(&self.path(out)).into_iter().map(contents).collect()
    }

    /// The files in a folder with the times of their last change.
    pub fn changes(&self, folder: &str) -> BTreeMap<String, SystemTime> {
        let changed = |(name, path): (String, PathBuf)| (name, path.metadata().unwrap().modified().unwrap());
        files(&self.path(folder)).into_iter().map(changed).collect()
    }
}

/// Takes out of a summary what was measured on a clock, or says how it was computed.
fn forget_times(summary: &mut Value) {
    let top = summary.as_object_mut().unwrap();
    top.remove("timing_s");
    top.remove("load");
    for stage in top.get_mut("stages").and_then(Value::as_array_mut).into_iter().flatten() {
        let stage = stage.as_object_mut().unwrap();
        for key in ["wall_s", "cpu_s", "particle_steps_per_s", "peak_memory_bytes", "threads"] {
            assert!(stage.remove(key).is_some(), "no {key}");
        }
    }
}

/// All files of a folder and of the folders in it, by their names from there.
pub fn files(folder: &Path) -> Vec<(String, PathBuf)> {
    let mut found = Vec::new();
    for entry in fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        let name = path.file_name().unwrap().to_str().unwrap().to_owned();
        if path.is_dir() {
            found.extend(files(&path).into_iter().map(|(inner, path)| (format!("{name}/{inner}"), path)));
        } else {
            found.push((name, path));
        }
    }
    found
}

/// A picture without its caption, which tells processor times, and those are nobody's result; any other file as it is.
fn comparable<'a>(name: &str, bytes: &'a [u8]) -> Cow<'a, [u8]> {
    if !name.ends_with("picture.svg") {
        return bytes.into();
    }
    let lines = bytes.split_inclusive(|&byte| byte == b'\n').filter(|line| !line.starts_with(b"<text"));
    lines.collect::<Vec<_>>().concat().into()
}

/// Two results are the same to the last byte; says which file is not, and where.
pub fn assert_same(one: &BTreeMap<String, Vec<u8>>, other: &BTreeMap<String, Vec<u8>>) {
    let names = |files: &BTreeMap<String, Vec<u8>>| files.keys().cloned().collect::<Vec<_>>();
    assert_eq!(names(one), names(other));
    for (name, bytes) in one {
        let (a, b) = (comparable(name, bytes), comparable(name, &other[name]));
        if a == b {
            continue;
        }
        let (a, b) = (String::from_utf8_lossy(&a), String::from_utf8_lossy(&b));
        let line = a.lines().zip(b.lines()).position(|(a, b)| a != b);
        let shown =
            |text: &str| text.lines().nth(line.unwrap_or(0)).unwrap_or_default().chars().take(200).collect::<String>();
        panic!("{name} differs, first in line {line:?}:\n{}\n{}", shown(&a), shown(&b));
    }
}

/// Interrupts a run as Ctrl-C does.
pub fn interrupt(child: &Child) {
    assert!(Command::new("kill").args(["-INT", &child.id().to_string()]).status().unwrap().success());
}

/// Ends a run as a power cut does.
pub fn kill(child: &mut Child) {
    child.kill().unwrap();
    child.wait().unwrap();
}

/// Rows of a table without its header; 0 where it is not there yet.
pub fn rows(table: &Path) -> usize {
    let bytes = fs::read(table).unwrap_or_default();
    bytes.iter().filter(|&&byte| byte == b'\n').count().saturating_sub(1)
}

/// A few numbers that are the same at every repetition.
pub fn seeded(seed: u64, count: usize, below: usize) -> Vec<usize> {
    let mut draw = Draw(seed);
    (0..count).map(|_| (draw.bits() >> 33) as usize % below).collect()
}

/// What the binary said.
#[derive(Debug)]
pub struct Answer {
    pub code: i32,
    pub out: String,
    pub err: String,
}

impl From<Output> for Answer {
    fn from(output: Output) -> Self {
        Self {
            code: output.status.code().unwrap_or(-1),
            out: String::from_utf8(output.stdout).unwrap(),
            err: String::from_utf8(output.stderr).unwrap(),
        }
    }
}

impl Answer {
    /// Ended with this status, and these words on stderr.
    pub fn ended(&self, code: i32, words: &[&str]) {
        assert_eq!(self.code, code, "{self:?}");
        for word in words {
            assert!(self.err.contains(word), "no {word:?} in: {}", self.err);
        }
    }

    /// The same, and nothing on stdout.
    pub fn refused(&self, code: i32, words: &[&str]) {
        self.ended(code, words);
        assert!(self.out.is_empty(), "{self:?}");
    }
}

/// A run's `summary.json`.
#[derive(Debug, Clone)]
pub struct Summary(pub Value);

impl Summary {
    pub fn at(&self, pointer: &str) -> &Value {
        self.0.pointer(pointer).unwrap_or_else(|| panic!("no {pointer} in {:#}", self.0))
    }

    pub fn number(&self, pointer: &str) -> f64 {
        number(self.at(pointer))
    }

    pub fn word(&self, pointer: &str) -> &str {
        self.at(pointer).as_str().unwrap_or_else(|| panic!("{pointer} is {}", self.at(pointer)))
    }

    pub fn list(&self, pointer: &str) -> &[Value] {
        self.at(pointer).as_array().unwrap_or_else(|| panic!("{pointer} is {}", self.at(pointer)))
    }
}

/// A JSON number.
pub fn number(value: &Value) -> f64 {
    value.as_f64().unwrap_or_else(|| panic!("{value} is no number"))
}

/// One frame of a LAMMPS dump: columns by name.
pub struct Frame {
    pub step: u64,
    names: Vec<String>,
    rows: Vec<Vec<String>>,
}

impl Frame {
    /// All frames of a dump.
    pub fn all(text: &str) -> Vec<Self> {
        let words = |line: &str| line.split(' ').map(str::to_owned).collect::<Vec<_>>();
        let frame = |text: &str| {
            let mut lines = text.lines();
            let step = lines.next().unwrap().parse().unwrap();
            let header = lines.find_map(|line| line.strip_prefix("ITEM: ATOMS ")).unwrap();
            Self { step, names: words(header), rows: lines.map(words).collect() }
        };
        text.split("ITEM: TIMESTEP\n").skip(1).map(frame).collect()
    }

    /// A column as it is written.
    pub fn words(&self, name: &str) -> Vec<&str> {
        let place =
            self.names.iter().position(|other| other == name).unwrap_or_else(|| panic!("{name}: {:?}", self.names));
        self.rows.iter().map(|row| row[place].as_str()).collect()
    }

    pub fn column(&self, name: &str) -> Vec<f64> {
        self.words(name).into_iter().map(|word| word.parse().unwrap()).collect()
    }
}
