//! What a scene can ask for, each kind once through the binary, against what must come out of it.

use super::common::{BEADS, Bench, FLOOR, Frame, mean};

const DUMP: &str = "[output]\nformats = [\"lammps\"]\nseries = \"1 ms\"\n";

fn frames(bench: &Bench, out: &str) -> Vec<Frame> {
    Frame::all(&bench.text(&format!("{out}/dump.particles.lammpstrj")))
}

#[test]
fn another_seed_gives_other_places_and_is_recorded() {
    let bench = Bench::with(&[FLOOR, BEADS, "[end]\ntime = \"2 ms\"\n", DUMP]);
    let (a, b) = (bench.run("a", &[]), bench.run("b", &["--seed", "77"]));
    assert_eq!((a.number("/scene/seed"), b.number("/scene/seed")), (3.0, 77.0));
    assert_eq!(b.at("/scene/overrides"), &serde_json::json!(["seed=77"]));
    let places = |out: &str| frames(&bench, out)[0].column("x");
    assert!(places("a").iter().zip(places("b")).all(|(one, other)| *one != other));
}

/// One bead on a slope of 30 deg, as gravity that is turned: without rolling resistance it rolls faster. The closed form of
/// pure rolling is a = g sin(30 deg) / (1 + 2/5); with resistance (constant torque mu_r R F_n) it is less by
/// mu_r g cos(30 deg) / (1 + 2/5).
#[test]
fn a_model_that_is_turned_off_does_not_act() {
    let floor = FLOOR.replace("[50, 50, 100]", "[500, 50, 100]");
    let feed = "[[feed]]\nname = \"one\"\nkind = \"file\"\nfile = \"one.csv\"\n[end]\ntime = \"0.2 s\"\n";
    let bench = Bench::with(&[&floor, feed, DUMP]);
    std::fs::write(bench.path("one.csv"), "x_m,y_m,z_m,radius_m,material\n0,0,0.003,0.003,glass\n").unwrap();
    let (sine, cosine) = (0.5_f64, 0.75_f64.sqrt());
    let gravity = format!("gravity_m_per_s2=[{}, 0, {}]", 9.81 * sine, -9.81 * cosine);
    let mut runs = Vec::new();
    for (out, further) in [("on", &[][..]), ("off", &["--model", "rolling_resistance=off"])] {
        let summary = bench.run(out, &[&["--set", &gravity], further].concat());
        assert_eq!(summary.list("/scene/overrides").len(), 1 + further.len() / 2);
        runs.push(frames(&bench, out).pop().unwrap().column("vx")[0] / 0.2);
    }
    let roll = |resistance: f64| 9.81 * (sine - resistance * cosine) / 1.4;
    // The bead starts just touching and sinks in by 1e-3 of its radius, bouncing once or twice, and slips for the first
    // few milliseconds of 200: 2 %.
    approx::assert_relative_eq!(runs[1], roll(0.0), max_relative = 0.02);
    approx::assert_relative_eq!(runs[0], roll(0.05), max_relative = 0.02);
    assert!(bench.summary("off").list("/warnings").iter().any(|w| w.as_str().unwrap().contains("rolling_resistance")));
}

#[test]
fn discs_stay_in_their_plane() {
    let scene = r#"
[domain]
min_mm = [-40, -10, -10]
max_mm = [40, 10, 100]

[[feed]]
name = "fill"
kind = "fill"
particle = "bead"
region = { shape = "box", min_mm = [-30, -1, 3], max_mm = [30, 1, 60] }
amount = 60

[[part]]
name = "floor"
material = "wall"
shape = "plane"
point_mm = [0, 0, 0]
normal = [0, 0, 1]

[end]
time = "60 ms"
"#;
    let bench = Bench::with(&[scene, DUMP]);
    let text = bench.text("scene.toml");
    let text = text
        .replace("version = 1", "version = 1\ndimensions = 2\nthickness_mm = 5")
        .replace("\"hertz-mindlin\"", "\"linear\"\ncharacteristic_velocity = \"1 m/s\"");
    std::fs::write(bench.path("scene.toml"), text).unwrap();
    let summary = bench.run("a", &[]);
    summary.conserves_particles();
    let last = frames(&bench, "a").pop().unwrap();
    assert_eq!(last.len(), 60);
    for column in ["y", "vy", "fy", "omegax", "omegaz"] {
        assert!(last.column(column).iter().all(|&value| value == 0.0), "{column}");
    }
    assert!(last.column("omegay").iter().any(|&spin| spin != 0.0));
    // Mass of a disc: density times pi r^2 times thickness, to the rounding of a handful of products.
    for (mass, radius) in last.column("mass").iter().zip(last.column("radius")) {
        let disc = 2500.0 * std::f64::consts::PI * radius * radius * 5e-3;
        approx::assert_relative_eq!(*mass, disc, max_relative = 1e-14);
    }
}

/// Free flight through periodic borders: nothing leaves, momentum stays, and places stay inside.
#[test]
fn a_periodic_domain_loses_nothing() {
    let domain = FLOOR
        .replace("max_mm = [50, 50, 100]", "max_mm = [50, 50, 100]\nboundary = { x = \"periodic\", y = \"periodic\" }");
    let bench = Bench::with(&[&domain, BEADS, "[end]\ntime = \"0.2 s\"\n", DUMP]);
    let gravity = "gravity_m_per_s2=[30, -20, -9.81]";
    let summary = bench.run("a", &["--set", gravity]);
    assert_eq!(summary.number("/stages/0/particles"), 60.0);
    assert!(summary.list("/removed").is_empty());
    let last = frames(&bench, "a").pop().unwrap();
    for axis in ["x", "y"] {
        assert!(last.column(axis).iter().all(|place| (-0.05..=0.05).contains(place)), "{axis}");
    }
    // At 30 m/s2 less friction 0.4 g, for 0.2 s, a bead goes at least 0.5 * 26 * 0.2^2 = 0.52 m: five times around.
    assert!(mean(&last.column("vx")) > 0.2 * (30.0 - 0.4 * 9.81 - 2.0));
}

/// Beads on a belt end up at its speed and the belt's frame stays; a floor that swings carries beads to and fro.
#[test]
fn a_conveyor_carries_and_an_oscillating_part_returns() {
    let belt = "motion = [{ kind = \"conveyor\", velocity_m_per_s = [0.3, 0, 0] }]\n";
    let end =
        "[end]\ntime = \"0.25 s\"\n[output]\nframes = \"10 ms\"\nformats = [\"vtp\", \"lammps\"]\nseries = \"1 ms\"\n";
    let floor = FLOOR.replace("[50, 50, 100]", "[250, 50, 100]");
    let bench = Bench::with(&[&floor, belt, BEADS, end]);
    bench.run("belt", &[]);
    let speeds = frames(&bench, "belt").pop().unwrap().column("vx");
    // Those that roll on the belt go slower for a while; friction 0.4 g takes 0.3 / 3.9 = 77 ms to carry a sliding bead.
    assert!((mean(&speeds) - 0.3).abs() < 0.1, "{}", mean(&speeds));
    assert!(speeds.iter().all(|&speed| speed < 0.3 + 0.25));
    let power = bench.series("belt");
    assert!(power.column("floor.power_W").iter().any(|&power| power < 0.0), "a belt gives power to what it carries");

    // A swing of 1 mm at 20 Hz: over whole periods the mean force is the weight's.
    let swing = "motion = [{ kind = \"oscillate\", amplitude_mm = [0, 0, 1], frequency = \"20 Hz\" }]\n";
    bench.write_scene("scene.toml", &[FLOOR, swing, BEADS, &end.replace("0.25 s", "0.5 s")]);
    let summary = bench.run("swing", &[]);
    summary.conserves_particles();
    let series = bench.series("swing");
    let weight = series.last("mass_kg") * 9.81;
    let settled = &series.column("floor.force_z_N")[300..500];
    // 1 ms samples of a force with impacts, over four periods: 20 %.
    approx::assert_relative_eq!(-mean(settled), weight, max_relative = 0.2);
}

#[test]
fn parts_come_and_go_at_their_times() {
    let lid = r#"
appears = "10 ms"
disappears = "30 ms"
"#;
    let bench = Bench::with(&[FLOOR, lid, BEADS, "[end]\ntime = \"60 ms\"\n", DUMP]);
    let summary = bench.run("a", &[]);
    let events: Vec<(f64, &str)> = summary
        .list("/events")
        .iter()
        .map(|event| (event["time_s"].as_f64().unwrap(), event["what"].as_str().unwrap()))
        .collect();
    assert_eq!(events.len(), 2);
    let step = summary.number("/stages/0/timestep_s");
    for ((time, what), (due, said)) in
        events.into_iter().zip([(0.01, "part 'floor' appeared"), (0.03, "part 'floor' disappeared")])
    {
        assert_eq!(what, said);
        // At the first whole step not before.
        assert!((due - 1e-12..due + step).contains(&time), "{time} for {due}");
    }
    let force = bench.series("a");
    for (time, force) in force.column("time_s").iter().zip(force.column("floor.force_z_N")) {
        assert!(*force == 0.0 || (0.01..0.03 + 2.0 * step).contains(time), "{force} N at {time} s");
    }
    // Without a floor they fall out of the domain: -10 mm is reached in sqrt(2 (40 + 10) mm / g) = 101 ms by all; some here.
    assert!(summary.sum("/removed", "count") > 0.0);
    assert_eq!(summary.word("/removed/0/cause"), "through the lower z border of the domain");
    summary.conserves_particles();
}

#[test]
fn every_end_condition_ends_as_stated() {
    let open = FLOOR.split("[[part]]").next().unwrap();
    let bench = Bench::with(&[open, BEADS, "[end]\ntime = \"1 s\"\n", DUMP]);
    let time = bench.run("time", &["--set", "end.time=11 ms"]);
    assert_eq!(time.word("/outcome/reason"), "time");
    // The end is reached to half a step, whatever time / step is.
    assert!((time.number("/outcome/time_s") - 0.011).abs() <= 0.5 * time.number("/stages/0/timestep_s"));
    assert_eq!(bench.series("time").last("step"), time.number("/stages/0/steps"));
    let empty = bench.run("empty", &["--set", "end.empty=true"]);
    assert_eq!(empty.word("/outcome/reason"), "empty");
    assert_eq!((empty.number("/stages/0/particles"), empty.sum("/removed", "count")), (0.0, 60.0));
    // The highest centre starts at most at 40 mm - 2 mm and leaves at -10 mm; the lowest one needs at least 12 mm.
    let fall = |height: f64| (2.0 * height / 9.81).sqrt();
    assert!((fall(0.012)..fall(0.048) + 1e-3).contains(&empty.number("/outcome/time_s")));
    let picture = bench.text("empty/picture.svg");
    assert!(picture.starts_with("<svg") && picture.trim_end().ends_with("</svg>"), "{picture}");
    assert!(!picture.contains("NaN") && !picture.contains("inf"));
    let count = bench.run("count", &["--set", "end.left_count=7"]);
    assert_eq!(count.word("/outcome/reason"), "count");
    // The run ends at the first step at which seven have left; several may leave in one step, but hardly many.
    assert!((7.0..10.0).contains(&count.sum("/removed", "count")));
    bench.write_scene("scene.toml", &[FLOOR, BEADS, "[end]\ntime = \"3 s\"\n", DUMP]);
    let rest = bench.run("rest", &["--set", "end.at_rest={ speed = \"20 mm/s\", hold = \"20 ms\" }"]);
    assert_eq!(rest.word("/outcome/reason"), "at rest");
    let series = bench.series("rest");
    let end = rest.number("/outcome/time_s");
    for (time, speed) in series.column("time_s").iter().zip(series.column("rms_speed_m_per_s")) {
        assert!(*speed < 0.02 || *time < end - 0.019, "{speed} m/s at {time} s of {end} s");
    }
    // First row, first frame: intervals longer than the run leave the first and the last state.
    let long =
        bench.run("long", &["--set", "end.time=3 ms", "--set", "output.series=1 h", "--set", "output.frames=1 h"]);
    assert_eq!(bench.series("long").column("step"), [0.0, long.number("/stages/0/steps")]);
    assert_eq!(frames(&bench, "long").len(), 2);
}

#[test]
fn a_shortfall_is_a_warning_with_its_cause() {
    let bench = Bench::with(&[FLOOR, BEADS, "[end]\ntime = \"2 ms\"\n", DUMP]);
    // 60 spheres of 5 mm are 3.9 cm3 in 59 cm3; 900 would be the densest packing, more than random insertion can do.
    let answer = bench.tollgate(&["run", "scene.toml", "--out", "a", "--set", "feed.fill.amount=600"]);
    assert_eq!(answer.code, 0, "{answer:?}");
    let summary = bench.summary("a");
    summary.conserves_particles();
    let missing = 600.0 - summary.number("/feeds/0/inserted_count");
    assert!(missing > 0.0);
    let shortfall = summary.word("/feeds/0/shortfall");
    assert!(shortfall.starts_with(&format!("{missing} particles are missing: ")), "{shortfall}");
    assert!(answer.err.contains(&format!("warning: feed 'fill': {shortfall}")), "{answer:?}");
    assert!(summary.list("/warnings").iter().any(|warning| warning.as_str().unwrap().contains(shortfall)));
}

#[test]
fn a_mass_and_a_grading_are_asked_against_inserted() {
    let bench = Bench::with(&[FLOOR, BEADS, "[end]\ntime = \"1 ms\"\n", DUMP]);
    let sieve = r#"particle.bead.diameter={ sieve = { by = "mass", sizes_mm = [2, 3, 4], fractions = [0.4, 0.6] } }"#;
    let summary = bench.run("a", &["--set", "feed.fill.amount=20 g", "--set", sieve]);
    assert_eq!(summary.number("/feeds/0/asked_mass_kg"), 0.02);
    assert!(summary.at("/feeds/0/asked_count").is_null());
    // The last particle decides: the mass is met to half of the largest one's.
    let largest = 2500.0 * std::f64::consts::PI / 6.0 * 0.004_f64.powi(3);
    assert!((summary.number("/feeds/0/inserted_mass_kg") - 0.02).abs() <= largest, "{:#}", summary.at("/feeds/0"));
    approx::assert_relative_eq!(
        bench.series("a").last("mass_kg"),
        summary.number("/feeds/0/inserted_mass_kg"),
        max_relative = 1e-12
    );
    let grading = summary.list("/feeds/0/grading");
    assert_eq!(grading.len(), 2);
    for (row, (from, asked)) in grading.iter().zip([(0.002, 0.4), (0.003, 0.6)]) {
        let number = |key: &str| row[key].as_f64().unwrap();
        assert_eq!((number("from_m"), number("asked_fraction")), (from, asked));
        // About 480 + 340 drawn particles: a share of mass scatters by about 2 %; three times that.
        assert!((number("inserted_fraction") - asked).abs() < 0.06, "{row}");
    }
}
