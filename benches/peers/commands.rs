//! Command lines of the codes.

use crate::code::Job;
use crate::process::{Cost, timed};
use crate::scene::{Scene, deck, root};
use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;
use tollgate::math::lanes::SimdLevel;

/// Debian's own Python, which YADE's modules are built for.
pub const PYTHON: &str = "/usr/bin/python3";

/// `tollgate run` as a user calls it, into a folder of results.
pub fn tollgate(job: &Job, simd: Option<SimdLevel>, folder: &Path, log: &Path) -> (Cost, PathBuf) {
    let scene = folder.join("scene.toml");
    fs::copy(job.scene.deck(), &scene).expect("the scene file in its folder");
    let out = folder.join("out");
    let options = Options { settings: &job.settings(), threads: job.threads, simd };
    let (cost, state) = run_scene(job.tollgate, &scene, options, &out, log);
    let summary = fs::read_to_string(out.join("summary.json")).expect("summary.json");
    let summary: serde_json::Value = serde_json::from_str(&summary).expect("a summary in JSON");
    let stage = &summary["stages"][0];
    assert_eq!(stage["steps"].as_u64(), Some(job.steps), "steps of tollgate, {}", log.display());
    assert_eq!(stage["particles"].as_u64(), Some(job.count as u64), "spheres of tollgate, {}", log.display());
    (cost, state)
}

/// How tollgate is to run a scene.
#[derive(Debug, Clone, Copy)]
pub struct Options<'a> {
    /// Keys and values beside the scene file.
    pub settings: &'a [(String, String)],
    pub threads: u32,
    /// Instruction set, where it is not the best one.
    pub simd: Option<SimdLevel>,
}

/// Runs a scene file into `out`, which is made anew; its cost and its dump.
pub fn run_scene(program: &Path, scene: &Path, options: Options, out: &Path, log: &Path) -> (Cost, PathBuf) {
    drop(fs::remove_dir_all(out));
    let mut command = Command::new(program);
    command.arg("run").arg(scene).arg("--out").arg(out).args(["--threads", &options.threads.to_string()]);
    if let Some(level) = options.simd {
        command.args(["--simd", level.name()]);
    }
    for (key, value) in options.settings {
        command.arg("--set").arg(format!("{key}={value}"));
    }
    (timed(&mut command, log).1, out.join("dump.particles.lammpstrj"))
}

/// LIGGGHTS up to the name of the file that receives the state.
pub fn liggghts(job: &Job) -> Command {
    let deck = if job.scene.has_machine() {
        deck("liggghts_hopper.in")
    } else {
        root().join("liggghts_inputs/settled_bed.in")
    };
    of_lammps_family("liggghts", &deck, job, &[("skin", job.scene.skins[0]), ("bin", job.scene.bin)])
}

/// LAMMPS likewise.
pub fn lammps(job: &Job) -> Command {
    let Scene { dashpot, skins, two_sizes, .. } = *job.scene;
    let [small, big] = two_sizes.unwrap_or_default();
    of_lammps_family(
        "lmp",
        &deck("lammps_box.in"),
        job,
        &[("skin", skins[1]), ("dashpot", dashpot), ("small", small), ("big", big)],
    )
}

fn of_lammps_family(program: &str, deck: &Path, job: &Job, own: &[(&str, f64)]) -> Command {
    let scene = job.scene;
    let mut command = Command::new(if job.threads > 1 { "mpirun" } else { "stdbuf" });
    if job.threads > 1 {
        command.args(["-np", &job.threads.to_string(), "stdbuf"]);
        // mpirun refuses root otherwise, as in a container
        command.env("OMPI_ALLOW_RUN_AS_ROOT", "1").env("OMPI_ALLOW_RUN_AS_ROOT_CONFIRM", "1");
    }
    command.env("OMP_NUM_THREADS", "1").args(["-oL", program, "-in"]).arg(deck);
    let mut set = |name: &str, value: String| {
        command.args(["-var", name, &value]);
    };
    set("steps", job.steps.to_string());
    set("step", scene.timestep_in_seconds());
    set("ranks", job.threads.to_string());
    for (axis, [edge, down]) in [["width", "down_x"], ["depth", "down_y"], ["height", "down_z"]].iter().enumerate() {
        set(edge, scene.size[axis].to_string());
        set(down, scene.down[axis].to_string());
    }
    own.iter().for_each(|(name, value)| set(name, value.to_string()));
    command.args(["-var", "state"]);
    command
}

/// YADE up to the name of the file that receives the state.
pub fn yade(job: &Job) -> Command {
    let texts = |numbers: [f64; 3]| numbers.map(|number| number.to_string());
    let mut command = Command::new(PYTHON);
    command.arg(root().join("yade_scripts/box.py")).env("OMP_NUM_THREADS", job.threads.to_string());
    command.arg("--size").args(texts(job.scene.size)).arg("--down").args(texts(job.scene.down));
    command.args(["--step", &job.scene.timestep_in_seconds(), "--steps", &job.steps.to_string()]);
    command.args(["--skin", &job.scene.yade_skin.to_string(), "--state"]);
    command
}
