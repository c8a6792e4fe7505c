//! Running the binary, and reading what it leaves behind.

use serde_json::Value;
use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Output, Stdio};
use std::time::{Duration, Instant};
use tempfile::TempDir;

/// Wall time after which a run that should have come somewhere is given up.
const PATIENCE: Duration = Duration::from_secs(300);

/// What every scene here shares: soft beads, so that time steps are long, and rigid walls. Top-level keys go before it.
const MATERIALS: &str = r#"
[contact]
law = "hertz-mindlin"
rolling = "cdt"

[material.glass]
density = "2500 kg/m3"
youngs_modulus = "1 MPa"
poissons_ratio = 0.25

[material.wall]
youngs_modulus = "rigid"

[[pair]]
between = ["glass", "glass"]
restitution = 0.5
friction = 0.5
rolling_friction = 0.05

[[pair]]
between = ["glass", "wall"]
restitution = 0.5
friction = 0.4
rolling_friction = 0.05

# So soft that impacts go deep; what the law says of them is not what is looked at here.
[solver]
overlap_limit = 0.4

[particle.bead]
material = "glass"
diameter = { uniform_mm = [4, 6] }
"#;

/// A floor at z = 0, in a domain of 100 mm edge above it.
pub const FLOOR: &str = r#"
[domain]
min_mm = [-50, -50, -10]
max_mm = [50, 50, 100]

[[part]]
name = "floor"
material = "wall"
shape = "plane"
point_mm = [0, 0, 0]
normal = [0, 0, 1]
"#;

/// A handful of beads over the floor.
pub const BEADS: &str = r#"
[[feed]]
name = "fill"
kind = "fill"
particle = "bead"
region = { shape = "box", min_mm = [-20, -20, 3], max_mm = [20, 20, 40] }
amount = 60
"#;

/// A folder that holds scenes and runs.
pub struct Bench {
    folder: TempDir,
}

impl Bench {
    pub fn new() -> Self {
        Self { folder: tempfile::tempdir().unwrap() }
    }

    /// With `scene.toml` of the shared materials and `sections`.
    pub fn with(sections: &[&str]) -> Self {
        let bench = Self::new();
        bench.write_scene("scene.toml", sections);
        bench
    }

    pub fn write_scene(&self, name: &str, sections: &[&str]) {
        let text = format!("version = 1\nseed = 3\n{MATERIALS}{}", sections.concat());
        fs::write(self.path(name), text).unwrap();
    }

    pub fn path(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    pub fn text(&self, name: &str) -> String {
        fs::read_to_string(self.path(name)).unwrap_or_else(|error| panic!("{name}: {error}"))
    }

    pub fn bytes(&self, name: &str) -> Vec<u8> {
        fs::read(self.path(name)).unwrap_or_else(|error| panic!("{name}: {error}"))
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

    /// Runs `scene.toml` on one thread into `out`, and expects exit status 0.
    pub fn run(&self, out: &str, further: &[&str]) -> Summary {
        let answer = self.tollgate(&[&["run", "scene.toml", "--threads", "1", "--out", out], further].concat());
        assert_eq!(answer.code, 0, "{answer:?}");
        self.summary(out)
    }

    /// Starts the binary in the background.
    pub fn start(&self, arguments: &[&str]) -> Child {
        self.command(arguments).stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap()
    }

    /// Waits until the series of `out` has `rows` rows; false where the run ended before.
    pub fn wait_for_rows(&self, child: &mut Child, out: &str, rows: usize) -> bool {
        let path = self.path(out).join("series.csv");
        self.wait(child, || fs::read(&path).is_ok_and(|bytes| bytes.iter().filter(|&&b| b == b'\n').count() > rows))
    }

    /// Waits until `holds`; false where the run ended before.
    pub fn wait(&self, child: &mut Child, holds: impl Fn() -> bool) -> bool {
        let started = Instant::now();
        while !holds() {
            if child.try_wait().unwrap().is_some() {
                return false;
            }
            assert!(started.elapsed() < PATIENCE, "the run came nowhere");
            std::thread::sleep(Duration::from_millis(1));
        }
        true
    }

    /// Runs `scene.toml` into `out`, killed at a row of its series, and resumed.
    ///
    /// # Panics
    /// Where no attempt could be killed in time.
    pub fn run_killed(&self, out: &str, row: usize) {
        for _ in 0..5 {
            let mut child = self.start(&["run", "scene.toml", "--threads", "2", "--out", out]);
            let going = self.wait_for_rows(&mut child, out, row);
            child.kill().unwrap();
            child.wait().unwrap();
            if going && !self.path(out).join("summary.json").exists() {
                self.run(out, &["--resume"]);
                return;
            }
            fs::remove_dir_all(self.path(out)).unwrap();
        }
        panic!("every attempt ended before row {row}");
    }

    pub fn summary(&self, out: &str) -> Summary {
        Summary(serde_json::from_str(&self.text(&format!("{out}/summary.json"))).unwrap())
    }

    pub fn series(&self, out: &str) -> Series {
        Series::of(&self.text(&format!("{out}/series.csv")))
    }

    /// Everything that a run left and that may not depend on when and how it was computed: all files but the summary's times.
    pub fn result(&self, out: &str) -> BTreeMap<String, Vec<u8>> {
        let mut files = BTreeMap::new();
        collect(&self.path(out), "", &mut files);
        let summary = self.summary(out).without_times();
        files.insert("summary.json".to_owned(), serde_json::to_vec_pretty(&summary).unwrap());
        files
    }
}

fn collect(folder: &Path, prefix: &str, files: &mut BTreeMap<String, Vec<u8>>) {
    for entry in fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        let name = format!("{prefix}{}", path.file_name().unwrap().to_str().unwrap());
        if path.is_dir() {
            collect(&path, &format!("{name}/"), files);
        } else {
            files.insert(name, fs::read(&path).unwrap());
        }
    }
}

/// Two results are the same to the last byte; says which file is not.
pub fn assert_same(one: &BTreeMap<String, Vec<u8>>, other: &BTreeMap<String, Vec<u8>>) {
    let names = |files: &BTreeMap<String, Vec<u8>>| files.keys().cloned().collect::<Vec<_>>();
    assert_eq!(names(one), names(other));
    for (name, bytes) in one {
        if name.ends_with(".json") {
            assert_eq!(String::from_utf8_lossy(bytes), String::from_utf8_lossy(&other[name]), "{name}");
        }
        assert!(*bytes == other[name], "{name} differs");
    }
}

pub fn interrupt(child: &Child) {
    assert!(Command::new("kill").args(["-INT", &child.id().to_string()]).status().unwrap().success());
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
    /// Refused with this status and these words, and nothing on stdout.
    pub fn refused(&self, code: i32, words: &[&str]) {
        assert_eq!(self.code, code, "{self:?}");
        for word in words {
            assert!(self.err.contains(word), "no {word:?} in: {}", self.err);
        }
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
        self.at(pointer).as_f64().unwrap_or_else(|| panic!("{pointer} is {}", self.at(pointer)))
    }

    pub fn word(&self, pointer: &str) -> &str {
        self.at(pointer).as_str().unwrap_or_else(|| panic!("{pointer} is {}", self.at(pointer)))
    }

    pub fn list(&self, pointer: &str) -> &[Value] {
        self.at(pointer).as_array().unwrap()
    }

    pub fn sum(&self, list: &str, key: &str) -> f64 {
        self.list(list).iter().map(|entry| entry[key].as_f64().unwrap()).sum()
    }

    /// What is inserted is inside or has left: counts.
    pub fn conserves_particles(&self) {
        let inserted = self.sum("/feeds", "inserted_count");
        assert_eq!(inserted, self.number("/stages/0/particles") + self.sum("/removed", "count"), "{:#}", self.0);
    }

    fn without_times(&self) -> Value {
        let mut value = self.0.clone();
        value.as_object_mut().unwrap().remove("timing_s");
        let stage = value.pointer_mut("/stages/0").unwrap().as_object_mut().unwrap();
        for key in ["wall_s", "cpu_s", "particle_steps_per_s", "peak_memory_bytes", "threads"] {
            assert!(stage.remove(key).is_some(), "no {key}");
        }
        value
    }
}

/// A run's `series.csv`.
pub struct Series {
    columns: BTreeMap<String, Vec<f64>>,
}

impl Series {
    fn of(text: &str) -> Self {
        let mut reader = csv::Reader::from_reader(text.as_bytes());
        let names: Vec<String> = reader.headers().unwrap().iter().map(str::to_owned).collect();
        let mut columns: BTreeMap<String, Vec<f64>> = names.iter().map(|name| (name.clone(), Vec::new())).collect();
        for record in reader.records() {
            for (name, field) in names.iter().zip(&record.unwrap()) {
                columns.get_mut(name).unwrap().push(field.parse().unwrap());
            }
        }
        Self { columns }
    }

    pub fn column(&self, name: &str) -> &[f64] {
        self.columns.get(name).unwrap_or_else(|| panic!("no {name} in {:?}", self.columns.keys()))
    }

    pub fn last(&self, name: &str) -> f64 {
        *self.column(name).last().unwrap()
    }
}

/// One frame of a LAMMPS dump: columns by name.
pub struct Frame {
    pub step: u64,
    names: Vec<String>,
    rows: Vec<Vec<f64>>,
}

impl Frame {
    /// All frames of a dump.
    pub fn all(text: &str) -> Vec<Self> {
        let frames = text.split("ITEM: TIMESTEP\n").skip(1);
        let frame = |text: &str| {
            let mut lines = text.lines();
            let step = lines.next().unwrap().parse().unwrap();
            let header = lines.find_map(|line| line.strip_prefix("ITEM: ATOMS ")).unwrap();
            let rows = lines.map(|line| line.split(' ').map(|field| field.parse().unwrap()).collect()).collect();
            Self { step, names: header.split(' ').map(str::to_owned).collect(), rows }
        };
        frames.map(frame).collect()
    }

    pub fn len(&self) -> usize {
        self.rows.len()
    }

    pub fn column(&self, name: &str) -> Vec<f64> {
        let place =
            self.names.iter().position(|other| other == name).unwrap_or_else(|| panic!("{name}: {:?}", self.names));
        self.rows.iter().map(|row| row[place]).collect()
    }
}

/// Mean of some numbers; there is at least one.
pub fn mean(values: &[f64]) -> f64 {
    assert!(!values.is_empty());
    values.iter().sum::<f64>() / values.len() as f64
}
