//! The bed: its start state, and 5000 steps of it in LIGGGHTS and in tollgate.

use crate::state::{read_dump, write_liggghts, write_table};
use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::time::Instant;
use tollgate::math::{Vec3, vec3};
use tollgate::particle::ParticleState;

/// A bed of so many spheres in a box with a square floor.
#[derive(Debug, Clone, Copy)]
pub struct Bed {
    pub count: usize,
    /// Edge of the floor [m].
    pub width: f64,
    /// Height of the box [m]: a quarter of it is spheres when they are put in.
    pub height: f64,
    /// Steps of the fill deck until all lie.
    fall: u32,
}

impl Bed {
    pub const TWENTY_THOUSAND: Self = Self { count: 20_000, width: 0.100, height: 0.280, fall: 6000 };
    pub const HUNDRED_THOUSAND: Self = Self { count: 100_000, width: 0.170, height: 0.480, fall: 9000 };

    /// Folder of this bed's files; survives between runs.
    pub fn folder(&self) -> PathBuf {
        let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("target/liggghts_bed").join(self.count.to_string());
        fs::create_dir_all(&folder).unwrap();
        folder
    }

    /// Edges of the box [m].
    pub fn size(&self) -> Vec3 {
        vec3(self.width, self.width, self.height)
    }

    /// The settled start state; made by LIGGGHTS once and kept for as long as the deck that makes it stays the same.
    pub fn start(&self) -> Vec<ParticleState> {
        let folder = self.folder();
        let (dump, kept) = (folder.join("fill_bed.dump"), folder.join("fill_bed.in"));
        let deck = fs::read_to_string(deck("fill_bed.in")).unwrap();
        if !dump.exists() || fs::read_to_string(&kept).ok().as_ref() != Some(&deck) {
            let staged = folder.join("fill_bed.dump.new");
            let [count, fall] = [self.count.to_string(), self.fall.to_string()];
            let [width, height] = [self.width, self.height].map(|edge| edge.to_string());
            let variables = [
                ("count", count.as_str()),
                ("settle", fall.as_str()),
                ("width", width.as_str()),
                ("height", height.as_str()),
                ("state", "fill_bed.dump.new"),
            ];
            run_liggghts("fill_bed.in", &folder, &variables);
            assert_eq!(read_dump(&staged).len(), self.count, "LIGGGHTS did not bring all spheres in");
            fs::rename(staged, &dump).unwrap();
            fs::write(kept, deck).unwrap();
        }
        let states = read_dump(&dump);
        write_liggghts(&folder.join("fill_bed.data"), &states, &self.size());
        write_table(&folder.join("fill_bed.csv"), &states);
        states
    }

    /// State after `steps` steps in LIGGGHTS, and the wall time [s].
    pub fn run_liggghts(&self, steps: u64) -> (Vec<ParticleState>, f64) {
        let folder = self.folder();
        let state = folder.join("settled_bed.dump");
        let _ = fs::remove_file(&state);
        let steps = steps.to_string();
        let [width, height] = [self.width, self.height].map(|edge| edge.to_string());
        let variables = [("steps", steps.as_str()), ("width", width.as_str()), ("height", height.as_str())];
        let started = Instant::now();
        run_liggghts("settled_bed.in", &folder, &variables);
        (read_dump(&state), started.elapsed().as_secs_f64())
    }
}

fn deck(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("liggghts_inputs").join(name)
}

/// Runs a deck of `liggghts_inputs/` in `folder`. LIGGGHTS reports most trouble on its standard output only, and a run that
/// lost its way may still exit with 0: so the callers check count and finiteness of what it wrote.
fn run_liggghts(name: &str, folder: &Path, variables: &[(&str, &str)]) {
    let mut command = Command::new("stdbuf");
    command.args(["-oL", "liggghts", "-in"]).arg(deck(name)).current_dir(folder);
    for (variable, value) in variables {
        command.args(["-var", variable, value]);
    }
    let output = command.output().expect("liggghts (Debian package `liggghts`) is needed for this test");
    let text = String::from_utf8_lossy(&output.stdout);
    let error = text.lines().find(|line| line.contains("ERROR"));
    assert!(output.status.success() && error.is_none(), "{name}: {:?}, {}", output.status, error.unwrap_or(&text));
}
