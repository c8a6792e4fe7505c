//! The same bits whatever the number of threads, and however often a run is killed, interrupted and resumed.

use super::common::{Answer, BEADS, Bench, FLOOR, Frame, assert_same, interrupt, kill, seeded};
use std::collections::BTreeMap;
use std::fs;
use std::sync::OnceLock;

/// More than 3000 particles, so that the work falls into several chunks; a bin whose floor, a mesh, opens once the bed is
/// slow, a mesh that stirs it, a stream besides the fill, and a border below through which particles leave.
const BIN: &str = r#"
[domain]
min_mm = [-55, -55, -12]
max_mm = [55, 55, 160]

[[feed]]
name = "fill"
kind = "fill"
particle = "bead"
region = { shape = "box", min_mm = [-50, -50, 51], max_mm = [50, 50, 150] }
amount = 3150
velocity_m_per_s = [0, 0, -1]

[[feed]]
name = "stream"
kind = "stream"
particle = "bead"
face = { shape = "disc", centre_mm = [0, 0, 155], normal = [0, 0, -1], radius_mm = 30 }
rate = "4000 1/s"
velocity_m_per_s = [0, 0, -1]
until = "30 ms"

[[part]]
name = "stirrer"
material = "wall"
shape = "stl"
file = "stirrer.stl"
motion = [{ kind = "rotate", origin_mm = [0, 0, 0], axis = [0, 0, 1], rate = "120 rpm" }]

[[part]]
name = "gate"
material = "wall"
shape = "box"
min_mm = [-60, -60, -4]
max_mm = [60, 60, -1]
disappears = { at_rest = { speed = "0.6 m/s", hold = "2 ms", not_before = "40 ms" } }

[[part]]
name = "left"
material = "wall"
shape = "plane"
point_mm = [-50, 0, 0]
normal = [1, 0, 0]

[[part]]
name = "right"
material = "wall"
shape = "plane"
point_mm = [50, 0, 0]
normal = [-1, 0, 0]

[end]
time = "110 ms"

[output]
frames = "10 ms"
formats = ["vtp", "lammps"]
contacts = true
series = "1 ms"
energy = true
checkpoints = "7 ms"

[[measure]]
name = "outflow"
kind = "mass-flow-rate"
point_mm = [0, 0, -6]
normal = [0, 0, -1]

[[measure]]
name = "packing"
kind = "solid-fraction"
region = { min_mm = [-40, -40, 10], max_mm = [40, 40, 40] }
"#;

/// A blade of two triangles in the bed, off the axis.
fn stirrer() -> String {
    let corners = [[10.0, -2.0, 10.0], [40.0, 2.0, 10.0], [40.0, 2.0, 50.0], [10.0, -2.0, 50.0]];
    let facet = |indices: [usize; 3]| {
        let vertices: String = indices
            .iter()
            .map(|&k| format!("vertex {} {} {}\n", corners[k][0] * 1e-3, corners[k][1] * 1e-3, corners[k][2] * 1e-3))
            .collect();
        format!("facet normal 0 0 0\nouter loop\n{vertices}endloop\nendfacet\n")
    };
    format!("solid blade\n{}{}endsolid blade\n", facet([0, 1, 2]), facet([0, 2, 3]))
}

fn bin() -> Bench {
    let bench = Bench::with(&[BIN]);
    fs::write(bench.path("stirrer.stl"), stirrer()).unwrap();
    bench
}

/// The undisturbed run on one thread, computed once for all tests.
fn undisturbed() -> &'static BTreeMap<String, Vec<u8>> {
    static RESULT: OnceLock<BTreeMap<String, Vec<u8>>> = OnceLock::new();
    RESULT.get_or_init(|| {
        let bench = bin();
        let summary = bench.run("a", &[]);
        // The scene must do what it is here for.
        summary.conserves_particles();
        assert!(summary.number("/stages/0/particles") > 2000.0, "{:#}", summary.0);
        assert!(summary.sum("/feeds", "inserted_count") > 3200.0, "{:#}", summary.0);
        assert!(summary.sum("/removed", "count") > 20.0, "{:#}", summary.0);
        assert_eq!(summary.word("/events/0/what"), "part 'gate' disappeared");
        assert!(bench.series("a").last("outflow.mass_beyond_kg") > 0.0);
        bench.result("a")
    })
}

#[test]
fn two_threads_give_the_bits_of_one() {
    let bench = bin();
    let answer = bench.tollgate(&["run", "scene.toml", "--threads", "2", "--out", "a"]);
    assert_eq!(answer.code, 0, "{answer:?}");
    assert_same(undisturbed(), &bench.result("a"));
}

#[test]
fn a_run_killed_again_and_again_ends_as_the_undisturbed_one() {
    let bench = bin();
    // The first kill comes before the first checkpoint at 7 ms: the run starts over, and what it wrote is gone.
    let mut moments = vec![4];
    moments.extend(seeded(20, 3, 100).iter().map(|row| row + 8));
    moments.sort_unstable();
    let mut further: &[&str] = &[];
    for rows in moments {
        let command = [&["run", "scene.toml", "--threads", "1", "--out", "a"], further].concat();
        let mut child = bench.start(&command);
        let going = bench.wait_for_rows(&mut child, "a", rows);
        kill(&mut child);
        assert!(going, "the run ended before row {rows}");
        assert!(!bench.path("a/summary.json").exists());
        further = &["--resume"];
    }
    bench.tollgate(&["run", "scene.toml", "--out", "a"]).refused(2, &["unfinished", "--resume"]);
    bench.run("a", &["--resume"]);
    assert_same(undisturbed(), &bench.result("a"));
}

#[test]
fn an_interrupted_run_says_so_and_goes_on_to_the_same_end() {
    let bench = bin();
    let mut further: &[&str] = &[];
    for rows in [3, 66] {
        let command = [&["run", "scene.toml", "--threads", "2", "--out", "a"], further].concat();
        let mut child = bench.start(&command);
        assert!(bench.wait_for_rows(&mut child, "a", rows));
        interrupt(&child);
        let answer = Answer::from(child.wait_with_output().unwrap());
        answer.ended(130, &["interrupted", "--resume"]);
        let summary = bench.summary("a");
        assert_eq!(summary.word("/outcome/reason"), "interrupted");
        assert_eq!(summary.number("/outcome/exit_code"), 130.0);
        // The last state was written, whenever it was.
        let last = Frame::all(&bench.text("a/dump.particles.lammpstrj")).pop().unwrap();
        assert_eq!(last.step as f64, summary.number("/stages/0/steps"));
        bench.tollgate(&["run", "scene.toml", "--out", "a"]).refused(2, &["unfinished", "--resume"]);
        further = &["--resume"];
    }
    bench.run("a", &["--resume"]);
    assert_same(undisturbed(), &bench.result("a"));
}

/// What a checkpoint holds beside a bed of particles: images beyond a border, the place of a moving part, a spin in the plane,
/// how long particles have been slow, feeds between two insertions.
#[test]
fn every_kind_of_scene_resumes_to_the_bit() {
    let output =
        "[output]\nseries = \"1 ms\"\nformats = [\"vtp\", \"lammps\"]\nframes = \"9 ms\"\ncheckpoints = \"5 ms\"\n";
    let end = "[end]\ntime = \"0.2 s\"\nat_rest = { speed = \"1 m/s\", hold = \"0.15 s\" }\n";
    let periodic = FLOOR.replace("100]", "100]\nboundary = { x = \"periodic\", y = \"periodic\" }");
    let moved = "motion = [{ kind = \"oscillate\", amplitude_mm = [0, 0, 1], frequency = \"20 Hz\" }, { kind = \"conveyor\", velocity_m_per_s = [0.3, 0, 0] }]\n";
    let turns = BEADS.replace("amount = 60", "amount = 400\ninterval = \"13 ms\"\nuntil = \"100 ms\"");
    let plane = "dimensions = 2\nthickness_mm = 5\n";
    let linear = "\"linear\"\ncharacteristic_velocity = \"1 m/s\"";
    for (name, sections, top, law) in [
        ("periodic", [&periodic, BEADS], "gravity_m_per_s2 = [30, -20, -9.81]\n", "\"hertz-mindlin\""),
        ("moved", [&format!("{FLOOR}{moved}"), BEADS], "", "\"hertz-mindlin\""),
        ("turns", [FLOOR, &turns], "", "\"hertz-mindlin\""),
        ("plane", [FLOOR, BEADS], plane, linear),
    ] {
        let bench = Bench::with(&[sections[0], sections[1], end, output]);
        let text = bench.text("scene.toml").replace("\"hertz-mindlin\"", law);
        fs::write(bench.path("scene.toml"), format!("{top}{text}")).unwrap();
        bench.run("whole", &[]);
        bench.run_killed("killed", seeded(name.len() as u64, 1, 60)[0] + 10);
        assert_same(&bench.result("whole"), &bench.result("killed"));
    }
}
