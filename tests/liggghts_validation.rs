//! LIGGGHTS against itself unsplit and against the native solver, on a real discharge: replicates in every combination of codes,
//! and every pair of modes at dense cuts. Needs Debian's `liggghts`. An hour of computing: `./validate` runs these.
#![expect(clippy::unwrap_used, reason = "a test fails by panicking")]
#![expect(clippy::print_stdout, reason = "what is printed becomes a page of docs/validation")]

#[path = "common/replicates.rs"]
mod replicates;

use replicates::{CHUTE, Order, PLANES, compared, disagreement, pairs_of_modes, print, whole_runs};
use std::path::{Path, PathBuf};

/// Runs on LIGGGHTS, split and whole, that each other combination is compared with: rates scatter by 2.5 %, the margin is 4 %; with ten a
/// side a difference of 1.5 % is inconclusive, and a comparison asks for 11.
const REFERENCE_RUNS: u64 = 16;
/// Runs of the other combinations.
const RUNS: u64 = 10;
/// M: time steps between two samples of LIGGGHTS.
const SAMPLE: u64 = 20;

/// The small hopper `out` so often with buffer and recorded paths, stored every `every` time steps, and `liggghts` where these keys say so.
fn runs(out: &str, replicates: u64, every: u64, keys: &[&str]) -> PathBuf {
    let mut order = Order::new("scene.toml", out).set("output.frames", "1 s").set("gate.outlet.paths.every", every);
    for key in keys {
        order = order.set(key, "liggghts");
    }
    order.replicates = replicates;
    order.run();
    order.out
}

fn whole_on_liggghts() -> PathBuf {
    let mut order = Order::new("scene.toml", "lig-whole").set("output.frames", "1 s").set("backend", "liggghts");
    (order.whole, order.replicates) = (true, REFERENCE_RUNS);
    order.run();
    order.out
}

/// Prints each comparison of runs with others, and fails if any of the measures differs.
fn assert_agreement(measures: &[&str], comparisons: &[(&str, &Path, &Path)]) {
    let mut disagreements = Vec::new();
    for (what, runs, reference) in comparisons {
        let comparison = compared(runs, reference);
        print(what, &comparison);
        disagreements.extend(disagreement(&comparison, what, measures));
    }
    assert!(disagreements.is_empty(), "{disagreements:#?}");
}

#[test]
#[ignore = "half an hour: ./validate"]
fn every_combination_of_codes_agrees() {
    let (native, whole) = (whole_runs(), whole_on_liggghts());
    let native_split = runs("lig-native", RUNS, SAMPLE / 2, &[]);
    let split = runs("lig-split", REFERENCE_RUNS, SAMPLE, &["backend"]);
    // Its heaps scatter most, by 1.6 deg.
    let forth = runs("lig-mixed-NL", RUNS + 2, SAMPLE / 2, &["stage.chute.backend"]);
    let back = runs("lig-mixed-LN", RUNS, SAMPLE, &["stage.hopper.backend"]);
    assert_agreement(
        &CHUTE,
        &[
            ("LIGGGHTS: split against whole", &split, &whole),
            ("whole: LIGGGHTS against native", &whole, &native),
            ("split: LIGGGHTS against native", &split, &native_split),
            ("native upstream, LIGGGHTS downstream, against the whole run on LIGGGHTS", &forth, &whole),
            ("LIGGGHTS upstream, native downstream, against the whole run on the native solver", &back, &native),
        ],
    );
}

/// Runs of the main example: its rates scatter by 2.5 %, its heaps by 0.5 deg.
const EXAMPLE_RUNS: u64 = 10;

/// The main example with its chute at 40 deg, on LIGGGHTS where these keys say so.
fn example(out: &str, keys: &[&str], every: u64, whole: bool) -> PathBuf {
    let mut order = Order::new("../../../examples/sinter-chute/scene.toml", out)
        .set("output.frames", "1 s")
        .set("gate.outlet.paths.every", every);
    for key in keys {
        order = order.set(key, "liggghts");
    }
    order.stages = if whole { vec!["chute-40".to_owned()] } else { vec!["hopper".to_owned(), "chute-40".to_owned()] };
    (order.whole, order.replicates) = (whole, EXAMPLE_RUNS);
    order.run();
    order.out
}

#[test]
#[ignore = "four hours: ./validate"]
fn the_main_example_agrees() {
    let run = |name: &str, keys: &[&str], every: u64| {
        let out = |form: &str| format!("example-{name}-{form}");
        (example(&out("split"), keys, every, false), example(&out("whole"), keys, every, true))
    };
    let (split, whole) = run("liggghts", &["backend"], SAMPLE);
    let (native_split, native_whole) = run("native", &[], SAMPLE / 2);
    let forth = example("example-mixed-NL", &["stage.chute-40.backend"], SAMPLE / 2, false);
    let back = example("example-mixed-LN", &["stage.hopper.backend"], SAMPLE, false);
    assert_agreement(
        &["gate.outlet.mass_flow_rate", "chute-40.heap", "chute-40.centre_x", "chute-40.centre_z"],
        &[
            ("LIGGGHTS: split against whole", &split, &whole),
            ("whole: LIGGGHTS against native", &whole, &native_whole),
            ("split: LIGGGHTS against native", &split, &native_split),
            ("native: split against whole", &native_split, &native_whole),
            ("native upstream, LIGGGHTS downstream, against the whole run on LIGGGHTS", &forth, &whole),
            ("LIGGGHTS upstream, native downstream, against the whole run on the native solver", &back, &native_whole),
        ],
    );
}

#[test]
#[ignore = "half an hour: ./validate"]
fn runs_split_at_dense_cuts_agree_with_whole_runs() {
    let whole = whole_on_liggghts();
    for (height, length) in PLANES.into_iter().filter(|(height, _)| *height < 205.0) {
        let mut split = Order::new("scene.toml", &format!("ligrep-{height}"))
            .set("backend", "liggghts")
            .set("output.frames", "1 s")
            .set("gate.outlet.point_mm", format!("[0, 0, {height}]"))
            .set("gate.outlet.exclusion.length_mm", length)
            .set("gate.outlet.paths.every", SAMPLE)
            .set("solver.overlap_limit", 1);
        split.replicates = RUNS;
        split.run();
        let what = format!("plane at {height} mm, buffer of {length} mm, recorded");
        assert_agreement(&CHUTE, &[(&what, &split.out, &whole)]);
    }
}

#[test]
#[ignore = "an hour: ./validate"]
fn every_pair_of_modes_at_dense_cuts() {
    pairs_of_modes("liggghts", &["recorded", "ballistic", "constant"], SAMPLE);
}
