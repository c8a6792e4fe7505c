//! What a replay gives, against the whole run.

use crate::common::{Bench, DT, Drop, FLOOR, Frames, assert_faultless};

/// Diameter of the beads [m].
const D: f64 = 4e-3;
/// The gate plane [m].
const PLANE: f64 = 0.1;

const OUTPUT: &str = "[end]\ntime = \"0.2 s\"\n[output]\nframes = \"1 ms\"\nformats = [\"lammps\"]\n";

/// Beads that never touch, above the plane: slow and fast ones, oblique ones, spinning ones; one is thrown upward where there is
/// gravity to bring it back.
fn rain(gravity: bool) -> Vec<Drop> {
    let fast = if gravity { 0.0 } else { -0.6 };
    let drop = |k: u32| {
        let k = f64::from(k);
        let place = [-90.0 + 20.0 * k, 12.0 * (k % 3.0), 103.0 + 7.0 * k];
        let up = if gravity && k == 4.0 { 0.7 } else { 0.0 };
        let velocity = [0.03 * (k - 5.0), 0.02 * (k % 4.0), up + fast - 0.07 * k];
        Drop { place, velocity, spin: [3.0 * k, -20.0 * (k % 2.0), 7.0] }
    };
    (0..10).map(drop).collect()
}

/// The rain through one gate, `path` in the replay and `exclusion` behind the plane.
fn cut(gravity: bool, path: &str, exclusion: &str) -> Bench {
    let bench = Bench::new();
    let drops = bench.drops("rain", &rain(gravity));
    let gate = format!(
        "[[gate]]\nname = \"plane\"\npoint_mm = [0, 0, 100]\nnormal = [0, 0, -1]\npaths = {{ every = 1, length_mm = 6 }}\n\
         exclusion = {{ mode = \"{exclusion}\", length_mm = 6 }}\n\
         [[stage]]\nname = \"above\"\nparts = []\nfeeds = [\"rain\"]\nrecords = [\"plane\"]\n\
         [[stage]]\nname = \"below\"\nparts = [\"floor\"]\nfeeds = []\n\
         [[stage.replay]]\ngate = \"plane\"\npath = \"{path}\"\nlength_mm = 6\n"
    );
    let top = if gravity { "" } else { "gravity_m_per_s2 = [0, 0, 0]\n" };
    bench.write_scene("scene.toml", top, &[FLOOR, &drops, OUTPUT, &gate]);
    bench
}

/// Compares the downstream with the whole run: every particle beyond the plane is there, ghosts and particles alike are where they
/// are in the whole run, and from the passage on nothing differs by a bit. Returns how many ghosts have been seen.
fn compare(whole: &Frames, below: &Frames) -> usize {
    let mut ghosts = 0;
    for (step, frame) in &whole.0 {
        let there = &below.0[step];
        for (id, row) in frame {
            let Some(replayed) = there.get(id) else {
                assert!(row.place[2] > PLANE, "{id} is beyond the plane at {step} and not in the replay");
                continue;
            };
            // The bar: 1e-10 of a diameter until the first contact downstream. A ghost is told backwards from its passage, over
            // some thousand steps: round-off of that many additions of numbers of 0.1 m stays below 1e-14 m.
            let deviation = row.distance(replayed);
            assert!(deviation <= 1e-10 * D, "{id} at {step}: {deviation:e} m off");
            if row.place[2] <= PLANE {
                assert_eq!(row, replayed, "{id} at {step}: not the bits of the whole run");
            } else {
                ghosts += 1;
            }
        }
        assert!(there.keys().all(|id| frame.contains_key(id)), "somebody at {step} whom the whole run does not know");
    }
    ghosts
}

/// Catches a release at the wrong step, a lost spin, a path told from the passage instead of from the grid state, an exclusion
/// that changes those still before the plane.
fn replays_exactly(gravity: bool, path: &str, exclusion: &str) {
    let bench = cut(gravity, path, exclusion);
    let summary = bench.run("split", &[]);
    assert_faultless(summary.replayed("plane", "below"), 10);
    bench.run("whole", &["--whole"]);
    let (whole, below, above) =
        (bench.frames("whole", "below"), bench.frames("split", "below"), bench.frames("split", "above"));
    assert!(compare(&whole, &below) > 20, "the ghosts were not seen");
    let mut shown = 0;
    for (step, frame) in &above.0 {
        for (id, row) in frame.iter().filter(|(_, row)| row.place[2] > PLANE) {
            assert_eq!(row, whole.row(*step, *id), "upstream of the plane, {id} at {step}");
            shown += 1;
        }
    }
    assert!(shown > 200, "{shown}");
    // All have met the floor: the whole run and the replay were the same also then.
    let (_, last) = whole.last();
    assert!(last.values().all(|row| row.place[2] < PLANE), "{last:?}");
    assert!(gravity || last.values().any(|row| row.velocity[2] > 0.0), "{last:?}");
}

#[test]
fn free_particles_without_gravity_are_exact_on_constant_paths() {
    replays_exactly(false, "constant", "constant");
}

#[test]
fn free_particles_under_gravity_are_exact_on_ballistic_paths() {
    replays_exactly(true, "ballistic", "ballistic");
}

#[test]
fn free_particles_are_exact_on_recorded_paths() {
    replays_exactly(true, "recorded", "buffer");
}

/// A constant path under gravity is wrong by g tau^2 / 2, by definition; a check that finds nothing of it sees nothing at all.
#[test]
fn a_constant_path_under_gravity_is_off_by_what_gravity_does_in_the_zone() {
    let bench = cut(true, "constant", "constant");
    bench.run("split", &[]);
    bench.run("whole", &["--whole"]);
    let (whole, below) = (bench.frames("whole", "below"), bench.frames("split", "below"));
    let crossings = bench.crossings("split/stages/above/streams/plane");
    let mut checked = 0;
    for (step, frame) in &below.0 {
        for (id, ghost) in frame.iter().filter(|(_, row)| row.place[2] > PLANE) {
            let crossing = crossings.iter().find(|row| row["id"].parse() == Ok(*id)).unwrap();
            let release = (crossing["time_s"].parse::<f64>().unwrap() / DT).ceil();
            let lead = (release - *step as f64) * DT;
            let expected = 0.5 * crate::common::G * lead * lead;
            let off = ghost.place[2] - whole.row(*step, *id).place[2];
            // The path ends in the grid state, whose step is known here; round-off alone is left.
            assert!((off - expected).abs() < 1e-13 && expected > 0.0, "{id} at {step}: {off:e} m, not {expected:e} m");
            checked += 1;
        }
    }
    assert!(checked > 10, "{checked}");
}

/// The dense case: friction, rolling resistance, a part that goes when the bed rests, particles in contact at the gate. `buffer`,
/// `recorded`, every step stored: all arrive bit for bit, and the replay starts at round-off from the whole run.
#[test]
fn a_dense_discharge_starts_at_round_off_from_the_whole_run() {
    let bench = Bench::hopper();
    let summary = bench.run("split", &[]);
    let recorded = summary.recorded("outlet");
    let count = recorded["stream"]["crossings"].as_u64().unwrap();
    assert!(count > 60, "the hopper has hardly discharged: {recorded:#}");
    assert!(recorded["crossings"]["contact_share"].as_f64().unwrap() >= 0.3, "not dense: {recorded:#}");
    assert_faultless(summary.replayed("outlet", "heap"), count);
    bench.run("whole", &["--whole"]);
    let (whole, heap) = (bench.frames("whole", "heap"), bench.frames("split", "heap"));
    let first = bench.crossings("split/stages/hopper/streams/outlet")[0]["time_s"].parse::<f64>().unwrap();
    let timestep = summary.stage("heap")["timestep_s"].as_f64().unwrap();
    let (mut frames, mut worst) = (0, 0.0_f64);
    for (step, frame) in whole.0.range((first / timestep) as u64..).take(8) {
        for (id, row) in &heap.0[step] {
            worst = worst.max(row.distance(&frame[id]));
        }
        frames += usize::from(!heap.0[step].is_empty());
    }
    assert!(frames >= 7, "{frames} frames with particles");
    // The bar: below 1e-9 d. Round-off grows in collisions, by a factor of some ten each; eight frames are 14 ms, in which
    // a particle that fell off the rim meets another one or two.
    assert!(worst < 1e-9 * D, "{worst:e} m off");
}

/// In a plane problem particles are discs that move in x and z and turn about y. Catches a mass or inertia of spheres.
#[test]
fn a_plane_problem_is_exact_too() {
    for (path, exclusion) in [("ballistic", "ballistic"), ("recorded", "buffer")] {
        let bench = cut(true, path, exclusion);
        let flat = |drop: Drop| {
            let ([x, _, z], [u, _, w], [_, b, _]) = (drop.place, drop.velocity, drop.spin);
            Drop { place: [x, 0.0, z], velocity: [u, 0.0, w], spin: [0.0, b, 0.0] }
        };
        bench.drops("rain", &rain(true).into_iter().map(flat).collect::<Vec<_>>());
        let scene =
            bench.text("scene.toml").replace("\"hertz-mindlin\"", "\"linear\"\ncharacteristic_velocity = \"1 m/s\"");
        let scene = format!("dimensions = 2\nthickness_mm = 5\n{scene}");
        std::fs::write(bench.path("scene.toml"), scene).unwrap();
        let summary = bench.run("split", &[]);
        assert_faultless(summary.replayed("plane", "below"), 10);
        let passed = summary.recorded("plane")["stream"]["mass_kg"].as_f64().unwrap();
        // Ten discs of 2 mm radius and 5 mm thickness, 2500 kg/m3.
        let mass = 10.0 * std::f64::consts::PI * 2e-3_f64.powi(2) * 5e-3 * 2500.0;
        assert!((passed / mass - 1.0).abs() < 1e-12, "{passed} kg are not {mass} kg");
        bench.run("whole", &["--whole"]);
        assert!(compare(&bench.frames("whole", "below"), &bench.frames("split", "below")) > 20);
    }
}
