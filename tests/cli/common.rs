//! Small scenes without gates, and what their runs leave behind.

pub use crate::program::{Answer, Bench, Frame, Summary, assert_same, interrupt, kill, seeded};

use crate::program::{number, rows};
use std::collections::BTreeMap;
use std::fs;
use std::process::Child;

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

impl Bench {
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

    pub fn bytes(&self, name: &str) -> Vec<u8> {
        fs::read(self.path(name)).unwrap_or_else(|error| panic!("{name}: {error}"))
    }

    /// Waits until the series of `out` has `count` rows; false where the run ended before.
    pub fn wait_for_rows(&self, child: &mut Child, out: &str, count: usize) -> bool {
        let series = self.path(out).join("series.csv");
        self.wait(child, || rows(&series) >= count)
    }

    /// Runs `scene.toml` into `out`, killed at a row of its series, and resumed.
    ///
    /// # Panics
    /// Where no attempt could be killed in time.
    pub fn run_killed(&self, out: &str, row: usize) {
        for _ in 0..5 {
            let mut child = self.start(&["run", "scene.toml", "--threads", "2", "--out", out]);
            let going = self.wait_for_rows(&mut child, out, row);
            kill(&mut child);
            if going && !self.path(out).join("summary.json").exists() {
                self.run(out, &["--resume"]);
                return;
            }
            fs::remove_dir_all(self.path(out)).unwrap();
        }
        panic!("every attempt ended before row {row}");
    }

    /// The entries of a run's collection, in its order. Each file of it must be there and whole, and no other in the folder.
    pub fn shown_files(&self, out: &str) -> Vec<Shown> {
        let attribute = |line: &str, name: &str| {
            let (_, rest) = line.split_once(&format!("{name}=\"")).unwrap();
            rest.split_once('"').unwrap().0.to_owned()
        };
        let collection = self.text(&format!("{out}/frames.pvd"));
        assert!(collection.ends_with("</VTKFile>\n"), "{collection}");
        let entry = |line| {
            let (time, name) = (attribute(line, "timestep").parse().unwrap(), attribute(line, "name"));
            Shown { time, name, file: attribute(line, "file") }
        };
        let shown: Vec<Shown> = collection.lines().filter(|line| line.starts_with("<DataSet")).map(entry).collect();
        for Shown { file, .. } in &shown {
            let bytes = self.bytes(&format!("{out}/{file}"));
            let text = String::from_utf8_lossy(&bytes);
            assert!(text.starts_with("<?xml") && text.trim_end().ends_with("</VTKFile>"), "{file}");
        }
        let files = fs::read_dir(self.path(&format!("{out}/frames"))).unwrap().count();
        assert_eq!(files, shown.len(), "frames that nothing refers to");
        shown
    }

    pub fn series(&self, out: &str) -> Series {
        Series::of(&self.text(&format!("{out}/series.csv")))
    }
}

impl Summary {
    pub fn sum(&self, list: &str, key: &str) -> f64 {
        self.list(list).iter().map(|entry| number(&entry[key])).sum()
    }

    /// What is inserted is inside or has left: counts.
    pub fn conserves_particles(&self) {
        let inserted = self.sum("/feeds", "inserted_count");
        assert_eq!(inserted, self.number("/stages/0/particles") + self.sum("/removed", "count"), "{:#}", self.0);
    }
}

/// An entry of a run's collection of frames.
#[derive(Debug)]
pub struct Shown {
    pub time: f64,
    pub name: String,
    pub file: String,
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

impl Frame {
    pub fn len(&self) -> usize {
        self.words("id").len()
    }
}

/// Mean of some numbers; there is at least one.
pub fn mean(values: &[f64]) -> f64 {
    assert!(!values.is_empty());
    values.iter().sum::<f64>() / values.len() as f64
}
