//! Scenes with gates, and what their runs leave behind.

pub use crate::program::{Answer, Bench, Summary, assert_same, interrupt, kill, number, rows, seeded};

use crate::program::{Frame, files};
use serde_json::Value;
use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::Path;

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

impl Bench {
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
}

/// Copies a folder with all that is in it.
pub fn copy_folder(from: &Path, to: &Path) {
    for (name, path) in files(from) {
        let place = to.join(name);
        fs::create_dir_all(place.parent().unwrap()).unwrap();
        fs::copy(path, place).unwrap();
    }
}

impl Summary {
    fn gate(&self, name: &str) -> &Value {
        let gates = self.list("/gates");
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
        self.list("/warnings").iter().any(|warning| warning.as_str().unwrap().contains(words))
    }

    pub fn stage(&self, name: &str) -> &Value {
        let stages = self.list("/stages");
        stages.iter().find(|stage| stage["name"] == name).unwrap_or_else(|| panic!("no stage {name}"))
    }
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
        let places = |frame: &Frame| {
            let vectors = |names: [&str; 3]| {
                let [x, y, z] = names.map(|name| frame.column(name));
                move |row: usize| [x[row], y[row], z[row]]
            };
            let (place, velocity) = (vectors(["x", "y", "z"]), vectors(["vx", "vy", "vz"]));
            let (force, spin) = (vectors(["fx", "fy", "fz"]), vectors(["omegax", "omegay", "omegaz"]));
            let ids = frame.words("id").into_iter().map(|id| id.parse().unwrap());
            let row = |(index, radius)| Row {
                place: place(index),
                velocity: velocity(index),
                force: force(index),
                spin: spin(index),
                radius,
            };
            ids.zip(frame.column("radius").into_iter().enumerate().map(row)).collect()
        };
        Self(Frame::all(text).iter().map(|frame| (frame.step, places(frame))).collect())
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
