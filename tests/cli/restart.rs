//! Fill once, then discharge: a start from another run's checkpoint, with its contacts.

use super::common::{Bench, Frame, Series, mean};
use std::fs;

const BIN: &str = r#"
[domain]
min_mm = [-25, -25, -60]
max_mm = [25, 25, 130]

[[part]]
name = "bin"
material = "wall"
shape = "cylinder"
start_mm = [0, 0, 0]
end_mm = [0, 0, 120]
radius_mm = 20

[[part]]
name = "floor"
material = "wall"
shape = "box"
min_mm = [-24, -24, -4]
max_mm = [24, 24, 0]
"#;

const FILL: &str = r#"
[[feed]]
name = "fill"
kind = "fill"
particle = "bead"
region = { shape = "cylinder", start_mm = [0, 0, 0], end_mm = [0, 0, 100], radius_mm = 20 }
amount = 350
"#;

const OUTPUT: &str = "[output]\nformats = [\"lammps\"]\nseries = \"1 ms\"\nenergy = true\n";

/// A run that goes on in one piece to 0.5 s, a fill to 0.4 s, and a start from the fill's end.
#[test]
fn a_bed_started_from_a_checkpoint_lies_as_it_would_have_lain() {
    let bench = Bench::with(&[BIN, FILL, "[end]\ntime = \"0.4 s\"\n", OUTPUT]);
    bench.write_scene("discharge.toml", &[BIN, "[end]\ntime = \"0.1 s\"\n", OUTPUT]);
    let step: &[&str] = &["--set", "solver.timestep=20 us", "--model", "rolling_resistance=off"];
    let filled = bench.run("fill", step);
    bench.run("whole", &[step, &["--set", "end.time=0.5 s"]].concat());
    let discharge = |out: &str, further: &[&str]| {
        let from = ["run", "discharge.toml", "--from", "fill/state.checkpoint", "--threads", "1", "--out", out];
        bench.tollgate(&[&from, step, further].concat())
    };
    let dry = discharge("rest", &["--dry-run"]);
    assert!(dry.code == 0 && !bench.path("rest").exists(), "{dry:?}");
    let answer = discharge("rest", &[]);
    assert_eq!(answer.code, 0, "{answer:?}");
    let summary = bench.summary("rest");
    assert_eq!(summary.at("/stages/0/particles"), filled.at("/stages/0/particles"));
    assert!(summary.word("/scene/started_from").ends_with("fill/state.checkpoint"));
    let (whole, rest) = (bench.series("whole"), bench.series("rest"));
    // The same time steps: row k of the rest is row 400 + k of the whole. Particles, contacts and their memories are handed
    // over; what differs is that at a start the laws see the velocities themselves and not their estimate one step ahead.
    // Of 50 time steps to the first row that concerns one, and of its forces only the dashpots' change in that step: below
    // (1/50) of (time step / contact time of about 100 steps) squared = 2e-6 of the energy; ten times that for what it grows
    // to. Rolling resistance is off: its torque has the direction of the spin whatever its size, so that round-off turns it.
    let start = whole.column("time_s").iter().position(|time| (time - 0.4).abs() < 1e-9).unwrap();
    let energies = |series: &Series, from: usize| series.column("kinetic_energy_J")[from..from + 10].to_vec();
    let (one, other) = (energies(&whole, start), energies(&rest, 0));
    for (row, (one, other)) in one.iter().zip(&other).enumerate() {
        assert!((one - other).abs() <= 2e-5 * one, "row {row}: {one:e} and {other:e} J");
        assert_eq!(whole.column("contacts")[start + row], rest.column("contacts")[row], "row {row}");
    }
    // That this can be told: the same particles without the memory of their contacts give way, and move much faster.
    let last = Frame::all(&bench.text("fill/dump.particles.lammpstrj")).pop().unwrap();
    fs::write(bench.path("state.csv"), initial_state(&last)).unwrap();
    let file = "[[feed]]\nname = \"state\"\nkind = \"file\"\nfile = \"state.csv\"\n";
    bench.write_scene("forgotten.toml", &[BIN, file, "[end]\ntime = \"10 ms\"\n", OUTPUT]);
    let forgotten =
        bench.tollgate(&[&["run", "forgotten.toml", "--threads", "1", "--out", "forgotten"], step].concat());
    assert_eq!(forgotten.code, 0, "{forgotten:?}");
    assert!(mean(&energies(&bench.series("forgotten"), 1)) > 10.0 * mean(&one));
    // Under changed geometry: the floor is gone, and they fall out.
    let mut text = bench.text("discharge.toml");
    text = text
        .replace("name = \"floor\"", "name = \"floor\"\ndisappears = \"0 s\"")
        .replace("time = \"0.1 s\"", "time = \"0.3 s\"\nempty = true");
    fs::write(bench.path("discharge.toml"), text).unwrap();
    let answer = discharge("open", &[]);
    assert_eq!(answer.code, 0, "{answer:?}");
    let opened = bench.summary("open");
    assert!(opened.sum("/removed", "count") > 0.9 * 350.0, "{:#}", opened.0);
    assert_eq!(opened.sum("/removed", "count") + opened.number("/stages/0/particles"), 350.0);
    // Free fall bounds the speed: from the top of the bed to the lower border of the domain.
    let fall = (2.0_f64 * 9.81 * 0.180).sqrt();
    let open = bench.series("open");
    assert!(open.column("maximum_speed_m_per_s").iter().all(|&speed| speed < 1.05 * fall));
    // Nothing shoots off when the floor goes: within the first millisecond no more energy than gravity gives.
    let mass = open.column("mass_kg")[0];
    let gain = open.column("kinetic_energy_J")[1] - open.column("kinetic_energy_J")[0];
    let gravity = 0.5 * mass * (9.81 * 1e-3_f64).powi(2);
    // The springs that the bed's weight has loaded are released too: as much again, and half as much as a margin.
    let elastic = open.column("elastic_energy_J")[0];
    assert!(gain < 1.5 * gravity + elastic, "{gain:e} J from {gravity:e} J and {elastic:e} J");
}

/// A frame as an initial state, without contacts.
fn initial_state(frame: &Frame) -> String {
    let columns =
        ["x", "y", "z", "radius", "vx", "vy", "vz", "omegax", "omegay", "omegaz"].map(|name| frame.column(name));
    let mut text =
        "x_m,y_m,z_m,radius_m,vx_m_per_s,vy_m_per_s,vz_m_per_s,wx_rad_per_s,wy_rad_per_s,wz_rad_per_s,material\n"
            .to_owned();
    for row in 0..frame.len() {
        columns.iter().for_each(|column| text += &format!("{:?},", column[row]));
        text += "glass\n";
    }
    text
}

#[test]
fn the_key_knows_what_a_checkpoint_holds_not_where_it_lies() {
    let bench = Bench::with(&[BIN, FILL, "[end]\ntime = \"5 ms\"\n", OUTPUT]);
    bench.write_scene("next.toml", &[BIN, "[end]\ntime = \"5 ms\"\n", OUTPUT]);
    bench.run("a", &[]);
    bench.run("b", &["--seed", "9"]);
    let from = |checkpoint: &str, further: &[&str]| {
        let arguments = ["run", "next.toml", "--from", checkpoint, "--out", "c", "--threads", "1"];
        bench.tollgate(&[&arguments, further].concat())
    };
    assert_eq!(from("a/state.checkpoint", &[]).code, 0);
    fs::copy(bench.path("a/state.checkpoint"), bench.path("copy.checkpoint")).unwrap();
    let again = from("copy.checkpoint", &[]);
    assert!(again.code == 0 && again.err.contains("nothing was computed"), "{again:?}");
    from("b/state.checkpoint", &[]).refused(2, &["never overwritten", "choices.start"]);
    // A file of the same name with another content is another start.
    fs::copy(bench.path("b/state.checkpoint"), bench.path("copy.checkpoint")).unwrap();
    from("copy.checkpoint", &[]).refused(2, &["choices.start"]);
    // A scene that names it goes by its own folder.
    let text = bench.text("next.toml");
    fs::write(bench.path("next.toml"), format!("start_checkpoint = \"a/state.checkpoint\"\n{text}")).unwrap();
    let named = bench.tollgate(&["run", "next.toml", "--out", "c"]);
    assert!(named.code == 0 && named.err.contains("nothing was computed"), "{named:?}");
    // A resumed start is no second start.
    fs::remove_file(bench.path("c/summary.json")).unwrap();
    assert_eq!(from("a/state.checkpoint", &["--resume"]).code, 0);
    let z = mean(&Frame::all(&bench.text("a/dump.particles.lammpstrj")).pop().unwrap().column("z"));
    let frames = Frame::all(&bench.text("c/dump.particles.lammpstrj"));
    assert_eq!(mean(&frames[0].column("z")), z, "the start is not the checkpoint's state");
    assert_eq!(frames.len(), 2);
}

#[test]
fn particles_keep_their_material_by_name_and_their_body() {
    let bench = Bench::with(&[BIN, FILL, "[end]\ntime = \"5 ms\"\n", OUTPUT]);
    bench.run("a", &[]);
    let from = |scene: &str, out: &str| {
        bench.tollgate(&["run", scene, "--from", "a/state.checkpoint", "--out", out, "--threads", "1"])
    };
    // A material in front of the others moves their numbers, not the particles' material: its number is `type` - 1.
    bench.write_scene("more.toml", &[BIN, "[end]\ntime = \"1 ms\"\n", OUTPUT]);
    let text = bench.text("more.toml").replacen(
        "[material.glass]",
        "[material.air]\nyoungs_modulus = \"rigid\"\n\n[material.glass]",
        1,
    );
    fs::write(bench.path("more.toml"), &text).unwrap();
    let answer = from("more.toml", "more");
    assert_eq!(answer.code, 0, "{answer:?}");
    let kinds =
        |out: &str| Frame::all(&bench.text(&format!("{out}/dump.particles.lammpstrj"))).pop().unwrap().column("type");
    assert!(kinds("a").iter().all(|&kind| kind == 1.0));
    assert!(kinds("more").iter().all(|&kind| kind == 2.0));
    fs::write(bench.path("more.toml"), text.replace("glass", "slag")).unwrap();
    from("more.toml", "slag").refused(5, &["cannot start from", "'glass'"]);
    let plane = text.replace("version = 1", "version = 1\ndimensions = 2\nthickness_mm = 5");
    let plane = plane.replace("\"hertz-mindlin\"", "\"linear\"\ncharacteristic_velocity = \"1 m/s\"");
    let (before, rest) = plane.split_once("[[part]]").unwrap();
    let end = rest.find("[end]").unwrap();
    fs::write(bench.path("plane.toml"), format!("{before}{}", &rest[end..])).unwrap();
    from("plane.toml", "plane").refused(5, &["cannot start from", "spheres", "discs of 0.005 m"]);
}
