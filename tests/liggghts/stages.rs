//! Stages on LIGGGHTS, from the command line to the result folder: split, mixed with the native solver, whole, on two ranks;
//! broken off, failed, asked for again.

use crate::launching::processes_in;
use crate::program::{Answer, Bench, Frame, Summary, assert_same, files, interrupt, kill, number, rows};
use serde_json::{Value, json};
use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::Path;
use std::process::Command;
use std::time::{Duration, Instant};
use tollgate::output::final_state;

/// The small hopper, shortened: it discharges, and stops in the midst of it.
const PLANT: &[&str] = &[
    "feed.fill.amount=120",
    "end.time=0.2 s",
    "output.energy=false",
    "output.frames=20 ms",
    "output.formats=[\"vtp\", \"lammps\"]",
];
/// The same as a short rain through a gate high up in the barrel: 800 time steps, a fifth of the cost.
const RAIN: &[&str] = &[
    "feed.fill.amount=100",
    "feed.fill.region.start_mm=[0, 0, 250]",
    "part.plate.disappears.at_rest.not_before=1 ms",
    "gate.outlet.point_mm=[0, 0, 240]",
    "gate.outlet.aperture.radius_mm=30",
    "end.time=30 ms",
    "output.energy=false",
];
const LIGGGHTS: &[&str] = &["--backend", "liggghts"];
/// Time steps between two batches, times the scene's time step [s].
const BATCH: f64 = 100.0 * 4e-5;

fn plant() -> Bench {
    let bench = Bench::new();
    let source = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/scenes/gate/hopper.toml");
    fs::copy(source, bench.path("scene.toml")).unwrap();
    bench
}

/// Settings as arguments, and further ones.
fn with<'a>(settings: &[&'a str], further: &[&[&'a str]]) -> Vec<&'a str> {
    let settings = settings.iter().flat_map(|setting| ["--set", *setting]);
    settings.chain(further.concat()).collect()
}

fn gate<'a>(summary: &'a Summary, part: &str) -> &'a Value {
    summary.at(&format!("/gates/0/{part}/0"))
}

fn stage<'a>(summary: &'a Summary, name: &str) -> &'a Value {
    summary.list("/stages").iter().find(|stage| stage["name"] == name).unwrap()
}

/// Everything that was recorded was inserted and activated, once, and nothing else; no bar is wider than 1e-12 m and 1e-12 m/s.
/// How many that were.
fn assert_all_arrived(summary: &Summary) -> u64 {
    let (recorded, replayed) = (gate(summary, "recorded"), gate(summary, "replayed"));
    let (arrivals, tally) = (&replayed["arrivals"], &replayed["tally"]);
    let count = recorded["stream"]["crossings"].as_u64().unwrap();
    assert!(count >= 20, "next to nothing passed: {recorded:#}");
    for other in [&arrivals["recorded"]["count"], &arrivals["arrived"]["count"], &arrivals["bit_equal"]] {
        assert_eq!(*other, count, "{arrivals:#}");
    }
    for name in ["expected", "inserted", "released"] {
        assert_eq!(tally[name], count, "{tally:#}");
    }
    assert_eq!(arrivals["arrived"]["mass_kg"], arrivals["recorded"]["mass_kg"]);
    assert_eq!(arrivals["exceptions"], json!([]), "{arrivals:#}");
    assert_eq!((&arrivals["each_once"], &arrivals["sums_exact"]), (&json!(true), &json!(true)), "{arrivals:#}");
    for name in ["largest_deviation_m", "largest_deviation_m_s"] {
        assert!(number(&arrivals[name]) <= 1e-12, "{arrivals:#}");
    }
    count
}

/// Particles are where they must be: what was fed is upstream or was taken out behind the gate; what passed is downstream.
fn assert_accounts(summary: &Summary, fed: u64, passed: u64) {
    let taken = gate(summary, "recorded")["tally"]["excluded"].as_u64().unwrap();
    assert!(taken > 0, "nobody reached the exclusion plane");
    assert_eq!(stage(summary, "hopper")["particles"], fed - taken);
    assert_eq!(stage(summary, "heap")["particles"], passed);
    let removed = summary.list("/removed");
    assert_eq!(removed.len(), 1, "{removed:?}");
    assert_eq!((&removed[0]["cause"], &removed[0]["count"]), (&json!("hopper: through a gate"), &json!(taken)));
}

/// The last frame of a stage's dump.
fn last_frame(bench: &Bench, stage: &str) -> Frame {
    Frame::all(&bench.text(&format!("{stage}/dump.particles.lammpstrj"))).pop().unwrap()
}

/// The files of a stage that LIGGGHTS computed are those of any other, and agree with each other.
fn assert_files(bench: &Bench, stage: &str, particles: usize) {
    let series = bench.text(&format!("{stage}/series.csv"));
    let columns = [
        "time_s,step,particles,inserted,removed,mass_kg,kinetic_energy_J,rotational_energy_J,rms_speed_m_per_s,maximum_speed_m_per_s",
        "plate.force_x_N,plate.force_y_N,plate.force_z_N",
    ];
    let header = series.lines().next().unwrap();
    assert!(header.starts_with(columns[0]) && header.contains(columns[1]), "{header}");
    assert_eq!(rows(&bench.path(&format!("{stage}/series.csv"))), 200, "one row a millisecond");
    for row in series.lines().skip(1) {
        let counts: Vec<u64> = row.split(',').skip(2).take(3).map(|count| count.parse().unwrap()).collect();
        assert_eq!(counts[0], counts[1] - counts[2], "particles are not those inserted less those removed: {row}");
    }
    assert!(series.lines().last().unwrap().starts_with("0.2,5000,"));

    let frames = bench.text(&format!("{stage}/frames.pvd"));
    let named: Vec<&str> = frames.split("file=\"").skip(1).map(|rest| rest.split('"').next().unwrap()).collect();
    assert_eq!(named.iter().filter(|name| name.contains("particles_")).count(), 11, "every 20 ms, and the first");
    named.iter().for_each(|name| assert!(bench.path(&format!("{stage}/{name}")).exists(), "no {name}"));

    let frame = last_frame(bench, stage);
    let from_dump: BTreeSet<u64> = frame.words("id").iter().map(|id| id.parse().unwrap()).collect();
    let last = final_state::read(&bench.path(&format!("{stage}/final.columns"))).unwrap();
    assert_eq!(last.iter().map(|particle| particle.id.0).collect::<BTreeSet<_>>(), from_dump);
    assert_eq!((frame.step, last.len()), (5000, particles));
    assert!(bench.text(&format!("{stage}/picture.svg")).matches("<circle").count() > particles / 2);
    assert!(bench.path(&format!("{stage}/case/in.liggghts")).exists());
}

/// The measured centre of mass is that of the last frame. Tolerance: sums of a hundred numbers round to 1e-15 m.
fn assert_centre(bench: &Bench, out: &str, summary: &Summary) {
    let frame = last_frame(bench, &format!("{out}/stages/heap"));
    let masses: Vec<f64> = frame.column("radius").iter().map(|radius| radius.powi(3)).collect();
    let moment: f64 = frame.column("z").iter().zip(&masses).map(|(z, mass)| z * mass).sum();
    let centre = moment / masses.iter().sum::<f64>();
    assert!((summary.number("/measures/heap.centre_z_m") - centre).abs() < 1e-12, "not {centre}");
}

/// LIGGGHTS or the native solver, upstream and downstream, in every combination.
#[test]
fn stages_take_each_others_streams_whoever_computes_them() {
    let bench = plant();
    let split = bench.run("a", &with(PLANT, &[LIGGGHTS]));
    let passed = assert_all_arrived(&split);
    let arrivals = &gate(&split, "replayed")["arrivals"];
    assert_eq!((&arrivals["arrived"], &gate(&split, "replayed")["exact"]), (&arrivals["recorded"], &json!(true)));
    assert_eq!(arrivals["recorded"]["count"], passed);
    assert_accounts(&split, 120, passed);
    assert_files(&bench, "a/stages/hopper", stage(&split, "hopper")["particles"].as_u64().unwrap() as usize);
    assert_files(&bench, "a/stages/heap", passed as usize);
    assert_centre(&bench, "a", &split);
    for one in ["hopper", "heap"] {
        assert_eq!(
            (&stage(&split, one)["backend"], &stage(&split, one)["version"]),
            (&json!("liggghts"), &json!("3.8.0"))
        );
    }
    let events = split.list("/events");
    assert_eq!(events.len(), 2, "{events:?}");
    let batch = number(&events[0]["time_s"]) / BATCH;
    assert!((batch - batch.round()).abs() < 1e-9, "parts go between batches: {events:?}");
    assert_eq!(events[0]["time_s"], events[1]["time_s"]);
    assert_eq!(events[1]["what"], "heap: part 'plate' disappeared");
    assert!(
        gate(&split, "replayed")["momentum"].is_null() && gate(&split, "replayed")["quality"]["overlaps"].is_null()
    );

    let native = bench.run("n", &with(PLANT, &[]));
    let down = bench.run("b", &with(PLANT, &[&["--backend", "heap=liggghts", "--reuse", "n"]]));
    assert_accounts(&down, 120, assert_all_arrived(&down));
    assert_eq!(gate(&down, "recorded")["stream"]["digest"], gate(&native, "recorded")["stream"]["digest"]);
    assert_eq!(
        (&stage(&down, "hopper")["backend"], &stage(&down, "heap")["backend"]),
        (&json!("native"), &json!("liggghts"))
    );
    let up = bench.run("c", &with(PLANT, &[&["--backend", "hopper=liggghts", "--reuse", "a"]]));
    assert_accounts(&up, 120, assert_all_arrived(&up));
    assert_eq!(gate(&up, "recorded")["stream"]["digest"], gate(&split, "recorded")["stream"]["digest"]);
    assert_eq!(
        (&stage(&up, "hopper")["backend"], &stage(&up, "heap")["backend"]),
        (&json!("liggghts"), &json!("native"))
    );

    // One run on each side tells nothing of the scatter, and that is what it says.
    let answer = bench.tollgate(&["compare", "n", "--with", "a"]);
    assert_eq!(answer.code, 6, "{answer:?}");
    for words in ["heap.centre_z", "gate.outlet.discharge", "one run on each side", "inconclusive"] {
        assert!(answer.out.contains(words), "{answer:?}");
    }
}

#[test]
fn who_comes_back_over_the_gate_is_counted_and_kept_in_the_books() {
    let bench = plant();
    // Over a floor 7 mm behind the gate: above the exclusion plane, so they bounce, and the fastest come back.
    let bounce = [
        "part.floor.point_mm=[0, 0, 233]",
        "stage.hopper.parts=[\"cone\", \"barrel\", \"plate\", \"floor\"]",
        "gate.outlet.returning=\"delete\"",
        "end.time=60 ms",
    ];
    let summary = bench.run("r", &with(&[RAIN, &bounce].concat(), &[LIGGGHTS, &["--stage", "hopper"]]));
    let tally = &gate(&summary, "recorded")["tally"];
    let deleted = tally["deleted"].as_u64().unwrap();
    assert!(deleted > 0 && deleted <= tally["returned"].as_u64().unwrap(), "{tally:#}");
    assert_eq!((&tally["lost_after_crossing"], &tally["excluded"]), (&json!(0), &json!(0)), "{tally:#}");
    assert_eq!(
        tally["recorded"].as_u64().unwrap(),
        deleted + tally["still_in_run"].as_u64().unwrap(),
        "those taken out stay on record: {tally:#}"
    );
    assert_eq!(stage(&summary, "hopper")["particles"], 100 - deleted);
    let removed = summary.list("/removed");
    assert_eq!(removed.len(), 1, "{removed:?}");
    assert_eq!((&removed[0]["cause"], &removed[0]["count"]), (&json!("hopper: deleted at a gate"), &json!(deleted)));
}

#[test]
fn a_whole_plant_keeps_everybody_and_observes_its_gate() {
    let bench = plant();
    let summary = bench.run("w", &with(PLANT, &[LIGGGHTS, &["--whole"]]));
    assert_eq!(summary.list("/stages").len(), 1);
    assert_eq!(stage(&summary, "heap")["particles"], 120);
    assert_eq!(summary.list("/removed").len(), 0);
    let recorded = gate(&summary, "recorded");
    assert_eq!((&recorded["role"], &recorded["tally"]["excluded"]), (&json!("observed"), &json!(0)));
    assert!(recorded["stream"]["crossings"].as_u64().unwrap() >= 60, "{recorded:#}");
    assert_files(&bench, "w/stages/heap", 120);
    assert_centre(&bench, "w", &summary);
}

/// The beads come over the border on their way, some of them at the gate or as ghosts. Not one touches another before the belt:
/// up to there both codes compute the same parabolas.
#[test]
fn periodic_borders_are_no_borders_at_a_gate() {
    let bench = Bench::new();
    let source = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/scenes/gate/periodic.toml");
    fs::copy(source, bench.path("scene.toml")).unwrap();
    let native = bench.run("n", &[]);
    for (out, further) in [
        ("recorded", &[][..]),
        ("ballistic", &["--set", "stage.down.replay.0.path=ballistic"]),
        ("ranks", &["--np", "2"]),
    ] {
        let summary = bench.run(out, &[LIGGGHTS, further].concat());
        let arrivals = &gate(&summary, "replayed")["arrivals"];
        assert_eq!(
            (&arrivals["arrived"]["count"], &arrivals["exceptions"]),
            (&json!(150), &json!([])),
            "{out}: {arrivals:#}"
        );
        assert_eq!(arrivals["bit_equal"], if out == "ballistic" { 0 } else { 150 }, "{out}: {arrivals:#}");
        for removed in summary.list("/removed") {
            assert!(!removed["cause"].as_str().unwrap().contains(" y "), "{out}: {removed}");
        }
        let mean = |summary: &Summary| number(&gate(summary, "recorded")["crossings"]["mean_normal_speed_m_s"]);
        // Two explicit integrators of free fall; LIGGGHTS' samples are joined by a cubic, of which a parabola is one.
        assert!((mean(&summary) - mean(&native)).abs() < 1e-9, "{} {}", mean(&summary), mean(&native));
        // The belt carries most of them off: they meet it where they do on the native solver. Who stays is chance from the first contacts on;
        // 9 is twice the scatter of the difference of two draws of 150 that go with 93 %, sqrt(2 150 0.93 0.07) = 4.4.
        let left = |summary: &Summary| {
            let rows = summary.list("/removed");
            rows.iter()
                .filter(|row| row["cause"].as_str().unwrap().contains(" x "))
                .map(|row| row["count"].as_f64().unwrap())
                .sum::<f64>()
        };
        assert!((left(&summary) - left(&native)).abs() <= 9.0, "{} {}", left(&summary), left(&native));
    }
    let arrivals = &gate(&native, "replayed")["arrivals"];
    assert_eq!((&arrivals["bit_equal"], &arrivals["each_once"]), (&json!(150), &json!(true)), "{arrivals:#}");
}

#[test]
fn two_ranks_hand_over_the_same_bits() {
    let bench = plant();
    let ranks = ["--set", "liggghts.ranks=2", "--set", "liggghts.processors=[1, 1, 2]"];
    let two = bench.run("two", &with(RAIN, &[LIGGGHTS, &ranks]));
    assert_accounts(&two, 100, assert_all_arrived(&two));
    assert_eq!(stage(&two, "hopper")["threads"], 2);
    for stage in ["hopper", "heap"] {
        let log = bench.text(&format!("two/stages/{stage}/case/log.liggghts"));
        assert!(log.contains("1 by 1 by 2 MPI processor grid"), "{log}");
    }
}

/// All files but those in which LIGGGHTS itself wrote down times.
fn lasting(bench: &Bench, out: &str) -> BTreeMap<String, Vec<u8>> {
    let mut result = bench.result(out);
    result.retain(|name, _| !["log.liggghts", "screen.txt"].iter().any(|times| name.ends_with(times)));
    result
}

/// Catches a summary that cannot be read again, a child that outlives its parent, a half case that is taken for a whole one, a first stage that is computed again.
#[test]
fn a_run_broken_off_leaves_no_process_and_is_resumed_with_the_stage_it_was_in() {
    let bench = plant();
    bench.run("expected", &with(PLANT, &[LIGGGHTS]));
    let begun = [&["run", "scene.toml", "--threads", "1", "--out", "a"], &with(PLANT, &[LIGGGHTS])[..]].concat();
    let start = |stage: &str, further: &[&str]| {
        let case = bench.path(&format!("a/stages/{stage}/case"));
        // What an earlier attempt has left there does not count.
        drop(fs::remove_file(case.join("screen.txt")));
        let mut child = bench.start(&[&begun[..], further].concat());
        let runs = || fs::read_to_string(case.join("screen.txt")).is_ok_and(|text| text.contains("Loop time"));
        assert!(bench.wait(&mut child, runs), "it ended before stage {stage}");
        (child, case)
    };
    // Ctrl-C: nothing of the stage is taken over.
    for (stage, further) in [("hopper", &[][..]), ("heap", &["--resume"])] {
        let (child, case) = start(stage, further);
        interrupt(&child);
        Answer::from(child.wait_with_output().unwrap()).ended(130, &["interrupted", "--resume"]);
        assert!(processes_in(&case).is_empty());
        assert_eq!(bench.summary("a").word("/outcome/reason"), "interrupted");
    }
    let (mut child, case) = start("heap", &["--resume"]);
    assert!(!processes_in(&case).is_empty());
    kill(&mut child);
    let killed = Instant::now();
    while !processes_in(&case).is_empty() {
        assert!(killed.elapsed() < Duration::from_secs(10), "{:?} outlive it", processes_in(&case));
        std::thread::sleep(Duration::from_millis(20));
    }
    let outcome = &bench.json("a/stages/heap/summary.json")["outcome"];
    assert_eq!(outcome["exit_code"], 130, "it ended before it was killed: {outcome}");
    let first = bench.changes("a/stages/hopper");
    bench.attempt("a", &with(PLANT, &[LIGGGHTS])).refused(2, &["unfinished", "--resume"]);
    bench.run("a", &with(PLANT, &[LIGGGHTS, &["--resume"]]));
    assert_eq!(bench.changes("a/stages/hopper"), first, "the first stage was touched");
    assert_same(&lasting(&bench, "expected"), &lasting(&bench, "a"));
}

#[test]
fn a_failed_stage_keeps_its_case_and_says_how_to_run_it() {
    let bench = plant();
    let broken = ["--set", "liggghts.lines.before_run=[\"not_a_command\"]"];
    let answer = bench.attempt("a", &with(RAIN, &[LIGGGHTS, &broken, &["--stage", "hopper"]]));
    let command = format!(
        "cd {}/a/stages/hopper/case && liggghts -in in.liggghts",
        bench.path("").canonicalize().unwrap().display()
    );
    answer.ended(4, &["Unknown command: not_a_command", "in.liggghts:", "lines of your own", &command]);
    let case = bench.path("a/stages/hopper/case");
    assert!(bench.text("a/stages/hopper/case/in.liggghts").contains("\nnot_a_command\n"));
    assert_eq!(bench.summary("a").number("/outcome/exit_code"), 4.0);
    // What it says leads to the same place.
    let by_hand = Command::new("sh").args(["-c", &command]).output().unwrap();
    assert!(String::from_utf8_lossy(&by_hand.stdout).contains("not_a_command") && case.exists(), "{by_hand:?}");
}

/// A result counts for what it was computed from, and for nothing else.
#[test]
fn only_what_changes_a_result_is_computed_again() {
    let bench = plant();
    let order = |settings: &[&'static str]| with(RAIN, &[LIGGGHTS, &["--stage", "hopper"], &with(settings, &[])]);
    bench.run("a", &order(&[]));
    let before = bench.changes("a/stages");
    fs::write(bench.path("scene.toml"), bench.text("scene.toml") + "# a comment\n").unwrap();
    for setting in ["title=another", "liggghts.mpirun=[\"--oversubscribe\"]", "liggghts.time_limit=1 h"] {
        bench.run("a", &order(&[setting]));
        assert_eq!(bench.changes("a/stages"), before, "{setting}");
    }
    for (setting, words) in [
        ("liggghts.sample_every=10", "sample_every"),
        ("liggghts.lines.before_run=[\"print hello\"]", "lines.before_run"),
    ] {
        bench.attempt("a", &order(&[setting])).refused(2, &["holds another run", words]);
    }
    // Likewise where it is used again.
    let reuse = |out: &str, setting: &'static str| {
        let answer = bench.attempt(out, &[&order(&[setting])[..], &["--reuse", "a"]].concat());
        assert_eq!(answer.code, 0, "{answer:?}");
        answer
    };
    reuse("b", "liggghts.mpirun=[\"--oversubscribe\"]");
    assert!(!bench.path("b/stages/hopper").exists());
    let answer = reuse("c", "liggghts.sample_every=10");
    assert!(answer.err.contains("was not taken from a") && answer.err.contains("sample_every"), "{answer:?}");
    assert!(bench.path("c/stages/hopper/summary.json").exists());
}

/// A deck is a result by itself: what it computes by hand is what a run computes.
#[test]
fn a_rendered_deck_runs_by_hand_to_the_same_state() {
    let bench = plant();
    bench.run("a", &with(RAIN, &[LIGGGHTS, &["--stage", "hopper"]]));
    let order = |stage: &'static str| {
        [&["deck", "scene.toml", "--out", "decks", "--stage", stage], &with(RAIN, &[LIGGGHTS])[..]].concat()
    };
    let answer = bench.tollgate(&order("hopper"));
    answer.ended(0, &[]);
    let (stage, command) = answer.out.trim_end().split_once(": ").unwrap();
    assert_eq!(stage, "hopper");
    let deck = "case/in.liggghts";
    assert_eq!(bench.text(&format!("a/stages/hopper/{deck}")), bench.text("decks/hopper/in.liggghts"));
    assert!(Command::new("sh").args(["-c", command]).output().unwrap().status.success(), "{command}");
    let last = |case: &str| fs::read(bench.path(case).join("frames/800.bin")).unwrap();
    assert!(last("a/stages/hopper/case") == last("decks/hopper"), "another last state");

    let before = bench.changes("decks");
    let Answer { code, err, .. } = bench.tollgate(&order("hopper"));
    assert!(code == 2 && err.contains("is there already"), "{code}: {err}");
    assert_eq!(bench.changes("decks"), before);
    bench.tollgate(&order("heap")).refused(5, &["needs the stream of gate 'outlet'", "run stage 'hopper' first"]);
    assert!(files(&bench.path("decks")).iter().all(|(name, _)| name.starts_with("hopper/")));
    // With the run that recorded it, it can.
    bench.tollgate(&[&order("heap")[..], &["--run", "a"]].concat()).ended(0, &[]);
    assert!(bench.path("decks/heap/in.liggghts").exists() && bench.path("decks/heap/paths/release").exists());
}

#[test]
fn without_liggghts_nothing_is_begun_and_it_says_what_to_install() {
    let bench = plant();
    let arguments = [&["run", "scene.toml", "--out", "a"], &with(RAIN, &[LIGGGHTS])[..]].concat();
    let mut command = Command::new(env!("CARGO_BIN_EXE_tollgate"));
    command.current_dir(bench.path("")).args(arguments).env(crate::faults::PROGRAM_VARIABLE, "/nowhere/liggghts");
    let answer = Answer::from(command.output().unwrap());
    answer.refused(3, &["LIGGGHTS is not installed", "/nowhere/liggghts", "apt-get install liggghts"]);
    assert!(!bench.path("a/stages").exists());
    // The folder is none that must be removed first.
    bench.run("a", &with(RAIN, &[LIGGGHTS, &["--stage", "hopper", "--resume"]]));
}
