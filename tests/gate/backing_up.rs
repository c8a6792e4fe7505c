//! A downstream that backs up to the gate: no one-way replay can be right then, and it must be said.

use crate::common::{Bench, number};

/// A plate 8 mm under the gate, in the downstream stage only: 200 particles heap up on it to the outlet.
const PLATE: &str = "\n[[part]]\nname = \"table\"\nmaterial = \"steel\"\nshape = \"box\"\nmin_mm = [-30, -30, 186]\nmax_mm = [30, 30, 193]\n\n[[gate]]";

fn blocked() -> Bench {
    let bench = Bench::hopper();
    let scene = bench.text("scene.toml").replacen("\n[[gate]]", PLATE, 1);
    let scene = scene.replace("\"plate\", \"floor\"]", "\"plate\", \"floor\", \"table\"]");
    assert!(scene.matches("\"table\"").count() == 2);
    std::fs::write(bench.path("scene.toml"), scene).unwrap();
    bench
}

// Far beyond what the first squeezes reach: what stops the run is to be the watch for backing up. Of some fillings a ghost is driven
// through a resident before the watch has seen enough; of this one none is.
const LIMIT: [&str; 6] = ["--seed", "2", "--set", "solver.overlap_limit=1", "--set", "end.time=0.3 s"];

#[test]
fn a_downstream_that_backs_up_stops_the_run_or_is_reported() {
    let bench = blocked();
    let answer = bench.attempt("stop", &LIMIT);
    answer.refused(7, &["stopped at a gate", "outlet", "back"]);
    let stage = bench.json("stop/stages/heap/summary.json");
    assert_eq!(stage["outcome"]["exit_code"], 7, "{stage:#}");
    assert!(stage["outcome"]["reason"].as_str().unwrap().contains("outlet"), "{stage:#}");
    let stopped = number(&stage["outcome"]["time_s"]);
    assert!(stopped > 0.09 && stopped < 0.29, "stopped at {stopped} s");
    // Again it is the same, without being computed again.
    bench.attempt("stop", &[&LIMIT[..], &["--resume"]].concat()).refused(7, &["done before", "outlet"]);

    let warned = bench
        .run("warn", &[&LIMIT[..], &["--set", "stage.heap.replay.outlet.backing_up=warn", "--reuse", "stop"]].concat());
    let backed_up = &warned.replayed("outlet", "heap")["backed_up"];
    assert_eq!(number(&backed_up["time_s"]), stopped, "{backed_up:#}");
    assert!(number(&backed_up["resident_speed_m_s"]) < number(&backed_up["ghost_speed_m_s"]), "{backed_up:#}");
    assert!(warned.warns("back"), "{:#}", warned.at("/warnings"));
    assert!((warned.number("/outcome/time_s") - 0.3).abs() < 1e-4);
    let arrivals = &warned.replayed("outlet", "heap")["arrivals"];
    assert_eq!(arrivals["each_once"], true, "{arrivals:#}");
}

/// The ordinary discharge of the same hopper, dense at its gate, does not fire; nor does the chute plant, cut under its outlet.
#[test]
fn an_ordinary_discharge_does_not_fire() {
    let bench = Bench::hopper();
    let summary = bench.run("a", &[]);
    let replayed = summary.replayed("outlet", "heap");
    assert!(replayed["backed_up"].is_null(), "{replayed:#}");
    assert!(number(&replayed["quality"]["crossings"]["contact_share"]) > 0.3, "{replayed:#}");
    let scene = concat!(env!("CARGO_MANIFEST_DIR"), "/tests/scenes/hopper");
    let settings = [
        "feed.fill.amount=250",
        "material.sinter.youngs_modulus=1 MPa",
        "end={ time = \"0.45 s\" }",
        "solver.overlap_limit=0.9",
    ];
    let settings: Vec<&str> = settings.iter().flat_map(|setting| ["--set", setting]).collect();
    let answer = bench.tollgate(&[&["run", scene, "--threads", "1", "--out", "chute"], &settings[..]].concat());
    assert_eq!(answer.code, 0, "{answer:?}");
    let summary = bench.summary("chute");
    let replayed = summary.replayed("outlet", "chute");
    assert!(replayed["backed_up"].is_null(), "{replayed:#}");
    assert!(number(&replayed["arrivals"]["arrived"]["count"]) > 100.0, "{replayed:#}");
}

/// Where the watchdog is faster than the watch at the gate, it names the ghost: a stiffer material would not help.
#[test]
fn a_squeeze_beyond_the_overlap_limit_names_the_ghost() {
    let bench = blocked();
    let settings = ["--set", "solver.overlap_limit=0.3", "--set", "end.time=0.3 s"];
    let answer = bench.attempt("squeezed", &settings);
    answer.refused(
        7,
        &["stopped at a gate", "a ghost", "limit 30.0 %", "--whole", "what it replays may be the reason", "in contact"],
    );
    assert!(!answer.err.contains("raise the stiffness"), "{answer:?}");
}
