//! Scenes with gates, runs of them, and what they leave behind.

use serde_json::Value;
use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Output, Stdio};
use std::time::{Duration, Instant};
use tempfile::TempDir;

/// Wall time after which a run that should have come somewhere is given up.
const PATIENCE: Duration = Duration::from_secs(120);

/// Materials of the inline scenes: soft beads without rolling resistance, rigid walls, and a time step that is a round number.
const MATERIALS: &str = r#"
[contact]
law = "hertz-mindlin"

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

[[pair]]
between = ["glass", "wall"]
restitution = 0.5
friction = 0.4

[solver]
overlap_limit = 0.9
timestep = "1e-5 s"

[particle.bead]
material = "glass"
diameter_mm = 4
"#;

/// Time step of the inline scenes [s].
pub const DT: f64 = 1e-5;
/// Standard gravity as the scenes have it [m/s2].
pub const G: f64 = 9.81;

/// A domain of 400 mm edge and a floor at z = 0.
pub const FLOOR: &str = r#"
[domain]
min_mm = [-200, -200, -20]
max_mm = [200, 200, 380]

[[part]]
name = "floor"
material = "wall"
shape = "plane"
point_mm = [0, 0, 0]
normal = [0, 0, 1]
"#;

/// A particle at the start: place [mm], velocity [m/s], spin [rad/s].
#[derive(Debug, Clone, Copy)]
pub struct Drop {
    pub place: [f64; 3],
    pub velocity: [f64; 3],
    pub spin: [f64; 3],
}

impl Drop {
    pub const fn new(place: [f64; 3], velocity: [f64; 3]) -> Self {
        Self { place, velocity, spin: [0.0; 3] }
    }
}

/// A folder that holds scenes and runs.
pub struct Bench {
    folder: TempDir,
}

impl Bench {
    pub fn new() -> Self {
        Self { folder: tempfile::tempdir().unwrap() }
    }

    /// With the small hopper as `scene.toml`.
    pub fn hopper() -> Self {
        let bench = Self::new();
        let source = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/scenes/gate/hopper.toml");
        fs::copy(source, bench.path("scene.toml")).unwrap();
        bench
    }

    /// With `scene.toml` of the shared materials, `top` before them and `sections` after them.
    pub fn with(top: &str, sections: &[&str]) -> Self {
        let bench = Self::new();
        bench.write_scene("scene.toml", top, sections);
        bench
    }

    pub fn write_scene(&self, name: &str, top: &str, sections: &[&str]) {
        let text = format!("version = 1\nseed = 3\n{top}{MATERIALS}{}", sections.concat());
        fs::write(self.path(name), text).unwrap();
    }

    /// Beads of 4 mm at the start, as a feed called `name`; returns its section of the scene.
    pub fn drops(&self, name: &str, drops: &[Drop]) -> String {
        let mut text = String::from(
            "x_m,y_m,z_m,radius_m,material,vx_m_per_s,vy_m_per_s,vz_m_per_s,wx_rad_per_s,wy_rad_per_s,wz_rad_per_s\n",
        );
        for Drop { place: [x, y, z], velocity: [u, v, w], spin: [a, b, c] } in drops {
            let (x, y, z) = (x * 1e-3, y * 1e-3, z * 1e-3);
            text += &format!("{x:?},{y:?},{z:?},0.002,glass,{u:?},{v:?},{w:?},{a:?},{b:?},{c:?}\n");
        }
        fs::write(self.path(&format!("{name}.csv")), text).unwrap();
        format!("[[feed]]\nname = \"{name}\"\nkind = \"file\"\nfile = \"{name}.csv\"\n")
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

    /// All frames of a stage.
    pub fn frames(&self, out: &str, stage: &str) -> Frames {
        Frames::of(&self.text(&format!("{out}/stages/{stage}/dump.particles.lammpstrj")))
    }

    /// The passages of a stream as its table shows them.
    pub fn crossings(&self, stream: &str) -> Vec<BTreeMap<String, String>> {
        let table = self.path("crossings-of-a-stream.csv");
        drop(fs::remove_file(&table));
        let answer = self.tollgate(&["stream", "export", stream, "--csv", table.to_str().unwrap()]);
        assert_eq!(answer.code, 0, "{answer:?}");
        let mut reader = csv::Reader::from_path(&table).unwrap();
        let rows = reader.deserialize().map(Result::unwrap).collect();
        drop(fs::remove_file(&table));
        rows
    }

    /// Everything that a run left and that may not depend on when and how it was computed: all files, but for times.
    pub fn result(&self, out: &str) -> BTreeMap<String, Vec<u8>> {
        let mut files = BTreeMap::new();
        collect(&self.path(out), "", &mut files);
        for (name, bytes) in &mut files {
            if name.ends_with("summary.json") {
                let mut summary: Value = serde_json::from_slice(bytes).unwrap();
                forget_times(&mut summary);
                *bytes = serde_json::to_vec_pretty(&summary).unwrap();
            }
        }
        files
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

/// Copies a folder with all that is in it.
pub fn copy_folder(from: &Path, to: &Path) {
    let mut files = BTreeMap::new();
    collect(from, "", &mut files);
    for (name, bytes) in files {
        let place = to.join(name);
        fs::create_dir_all(place.parent().unwrap()).unwrap();
        fs::write(place, bytes).unwrap();
    }
}

/// A file as text. The caption of a picture tells processor times, which are nobody's result.
fn comparable(name: &str, bytes: &[u8]) -> String {
    let text = String::from_utf8_lossy(bytes);
    let is_result = |line: &&str| !(name.ends_with("picture.svg") && line.starts_with("<text"));
    text.lines().filter(is_result).collect::<Vec<_>>().join("\n")
}

/// Two results are the same to the last byte; says which file is not, and where.
pub fn assert_same(one: &BTreeMap<String, Vec<u8>>, other: &BTreeMap<String, Vec<u8>>) {
    let names = |files: &BTreeMap<String, Vec<u8>>| files.keys().cloned().collect::<Vec<_>>();
    assert_eq!(names(one), names(other));
    for (name, bytes) in one {
        if *bytes == other[name] {
            continue;
        }
        let (a, b) = (comparable(name, bytes), comparable(name, &other[name]));
        if a == b {
            continue;
        }
        let line = a.lines().zip(b.lines()).position(|(a, b)| a != b);
        let shown =
            |text: &str| text.lines().nth(line.unwrap_or(0)).unwrap_or_default().chars().take(200).collect::<String>();
        panic!("{name} differs, first in line {line:?}:\n{}\n{}", shown(&a), shown(&b));
    }
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
    pub fn refused(&self, code: i32, words: &[&str]) {
        assert_eq!(self.code, code, "{self:?}");
        for word in words {
            assert!(self.err.contains(word), "no {word:?} in: {}", self.err);
        }
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

    fn gate(&self, name: &str) -> &Value {
        let gates = self.at("/gates").as_array().unwrap();
        gates.iter().find(|gate| gate["name"] == name).unwrap_or_else(|| panic!("no gate {name}: {:#}", self.0))
    }

    /// What was recorded at a gate.
    pub fn recorded(&self, gate: &str) -> &Value {
        &self.gate(gate)["recorded"][0]
    }

    /// What came of the replay of a gate's stream in a stage.
    pub fn replayed(&self, gate: &str, stage: &str) -> &Value {
        let replays = self.gate(gate)["replayed"].as_array().unwrap();
        replays.iter().find(|one| one["stage"] == stage).unwrap_or_else(|| panic!("{gate} is not in {stage}"))
    }

    pub fn warns(&self, words: &str) -> bool {
        self.at("/warnings").as_array().unwrap().iter().any(|warning| warning.as_str().unwrap().contains(words))
    }

    pub fn stage(&self, name: &str) -> &Value {
        let stages = self.at("/stages").as_array().unwrap();
        stages.iter().find(|stage| stage["name"] == name).unwrap_or_else(|| panic!("no stage {name}"))
    }
}

/// A JSON number.
pub fn number(value: &Value) -> f64 {
    value.as_f64().unwrap_or_else(|| panic!("{value} is no number"))
}

/// Every crossing arrived once with the stored bits: nothing is listed as an exception, number and mass are exact.
pub fn assert_faultless(replayed: &Value, count: u64) {
    let arrivals = &replayed["arrivals"];
    assert_eq!(arrivals["recorded"]["count"], count, "{arrivals:#}");
    assert_eq!(arrivals["arrived"], arrivals["recorded"], "{arrivals:#}");
    assert_eq!(arrivals["bit_equal"], count, "{arrivals:#}");
    assert_eq!(arrivals["exceptions"], serde_json::json!([]), "{arrivals:#}");
    assert_eq!((&arrivals["each_once"], &arrivals["sums_exact"]), (&true.into(), &true.into()), "{arrivals:#}");
}

/// A particle in a frame: its numbers as the dump has them, place, velocity, force, spin, radius.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Row {
    pub place: [f64; 3],
    pub velocity: [f64; 3],
    pub force: [f64; 3],
    pub spin: [f64; 3],
    pub radius: f64,
}

impl Row {
    pub fn distance(&self, other: &Self) -> f64 {
        (0..3).map(|axis| (self.place[axis] - other.place[axis]).powi(2)).sum::<f64>().sqrt()
    }
}

/// Frames by time step, particles by identity.
pub struct Frames(pub BTreeMap<u64, BTreeMap<u64, Row>>);

impl Frames {
    fn of(text: &str) -> Self {
        let mut frames = BTreeMap::new();
        for frame in text.split("ITEM: TIMESTEP\n").skip(1) {
            let mut lines = frame.lines();
            let step: u64 = lines.next().unwrap().parse().unwrap();
            let header = lines.find_map(|line| line.strip_prefix("ITEM: ATOMS ")).unwrap();
            let names: Vec<&str> = header.split(' ').collect();
            let rows = lines.map(|line| {
                let fields: Vec<&str> = line.split(' ').collect();
                let at = |name: &str| {
                    let index = names.iter().position(|other| *other == name);
                    fields[index.unwrap_or_else(|| panic!("no {name} in {names:?}"))]
                };
                let of = |name: &str| at(name).parse::<f64>().unwrap();
                let row = Row {
                    place: ["x", "y", "z"].map(of),
                    velocity: ["vx", "vy", "vz"].map(of),
                    force: ["fx", "fy", "fz"].map(of),
                    spin: ["omegax", "omegay", "omegaz"].map(of),
                    radius: of("radius"),
                };
                (at("id").parse::<u64>().unwrap(), row)
            });
            frames.insert(step, rows.collect());
        }
        Self(frames)
    }

    /// All identities that ever occur.
    pub fn ids(&self) -> BTreeSet<u64> {
        self.0.values().flat_map(|frame| frame.keys().copied()).collect()
    }

    /// Place of particle `id` at time step `step`.
    pub fn row(&self, step: u64, id: u64) -> &Row {
        self.0
            .get(&step)
            .unwrap_or_else(|| panic!("no frame {step}"))
            .get(&id)
            .unwrap_or_else(|| panic!("no {id} at {step}"))
    }

    pub fn last(&self) -> (&u64, &BTreeMap<u64, Row>) {
        self.0.last_key_value().unwrap()
    }
}

/// A few numbers that are the same at every repetition (Knuth's MMIX generator).
pub fn seeded(seed: u64, count: usize, below: u64) -> Vec<u64> {
    let mut state = seed;
    let mut next = || {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (state >> 33) % below
    };
    (0..count).map(|_| next()).collect()
}
