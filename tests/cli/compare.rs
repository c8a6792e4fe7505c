//! Two sets of runs against each other, from the runs to the exit code.

use super::common::{BEADS, Bench, FLOOR};
use serde_json::Value;

const END: &str = "[end]\ntime = \"60 ms\"\n[output]\nseries = \"10 ms\"\n";
const MEASURES: &str = "[[measure]]\nname = \"bed\"\nkind = \"centre-of-mass\"\n\
                        [[measure]]\nname = \"sizes\"\nkind = \"size-distribution\"\n";

/// Runs of the same scene with other seeds: `name`/0, `name`/1, ...
fn set(bench: &Bench, name: &str, seeds: std::ops::Range<u64>, further: &[&str]) -> Vec<String> {
    seeds
        .map(|seed| {
            let out = format!("{name}/{seed}");
            let text = seed.to_string();
            bench.run(&out, &[&["--seed", text.as_str()], further].concat());
            out
        })
        .collect()
}

fn compare(bench: &Bench, runs: &[String], reference: &[String], further: &[&str]) -> super::common::Answer {
    let mut arguments = vec!["compare"];
    arguments.extend(runs.iter().map(String::as_str));
    arguments.push("--with");
    arguments.extend(reference.iter().map(String::as_str));
    arguments.extend(further);
    bench.tollgate(&arguments)
}

#[test]
fn sets_agree_differ_or_leave_it_open() {
    let bench = Bench::with(&[FLOOR, BEADS, END, MEASURES]);
    let (a, b) = (set(&bench, "a", 1..5, &[]), set(&bench, "b", 11..15, &[]));
    // Smaller beads of 3 to 4 mm instead of 4 to 6.
    let small = set(&bench, "small", 1..5, &["--set", "particle.bead.diameter={ uniform_mm = [3, 4] }"]);
    let wide = ["--margin", "bed_x=20mm", "--margin", "bed_y=20mm", "--margin", "bed_z=20mm"];
    let sizes = ["10", "50", "90"].map(|d| ["mass", "number"].map(|by| format!("sizes_d{d}_by_{by}=2mm")));
    let mut margins: Vec<&str> = wide.to_vec();
    for margin in sizes.iter().flatten() {
        margins.extend(["--margin", margin.as_str()]);
    }
    let agrees = compare(&bench, &a, &b, &margins);
    assert_eq!(agrees.code, 0, "{agrees:?}");
    assert!(agrees.out.contains("4 runs against 4 runs (reference)"), "{}", agrees.out);
    assert!(agrees.out.lines().last().unwrap().starts_with("agrees: all 9 lie within"), "{}", agrees.out);
    // The default margins are another question; that d50 has fallen by a third is none.
    let differs = compare(&bench, &small, &b, &["--json"]);
    assert_eq!(differs.code, 6, "{}", differs.err);
    let found: Value = serde_json::from_str(&differs.out).unwrap();
    assert_eq!(found["verdict"], "differs");
    let measures = found["measures"].as_array().unwrap();
    let d50 = measures.iter().find(|measure| measure["name"] == "sizes_d50_by_mass").unwrap();
    assert_eq!(
        (&d50["verdict"], &d50["unit"], d50["runs"]["count"].as_u64()),
        (&"differs".into(), &"m".into(), Some(4))
    );
    let difference = d50["difference"].as_f64().unwrap();
    // About 5.2 mm against 3.6 mm by mass.
    assert!((-2.2e-3..-1.0e-3).contains(&difference), "{difference}");
    let [low, high] = [0, 1].map(|end| d50["interval_95"][end].as_f64().unwrap());
    assert!(low < difference && difference < high && high < 0.0);
    let single = compare(&bench, &a[..1], &b[..1], &[]);
    assert_eq!(single.code, 6, "{single:?}");
    assert!(
        single.out.contains("nothing is known of the scatter") && single.out.contains("inconclusive"),
        "{}",
        single.out
    );
}

#[test]
fn a_comparison_is_kept_with_its_picture() {
    let bench = Bench::with(&[FLOOR, BEADS, END, MEASURES]);
    let (a, b) = (set(&bench, "a", 1..3, &[]), set(&bench, "b", 3..5, &[]));
    let answer = compare(&bench, &a, &b, &["--out", "found", "--json"]);
    assert_eq!(answer.out, bench.text("found/comparison.json"), "the same on stdout and in the file");
    assert!(bench.text("found/comparison.svg").contains("bed_z"));
    let again = compare(&bench, &a, &b, &["--out", "found", "--margin", "bed_x=1mm"]);
    again.refused(2, &["never overwritten"]);
}

#[test]
fn everything_wrong_is_said_at_once() {
    let bench = Bench::with(&[FLOOR, BEADS, END, MEASURES]);
    let a = set(&bench, "a", 1..2, &[]);
    let answer = bench.tollgate(&["compare", "a/1", "nowhere", "--with", "a/1", "elsewhere"]);
    answer
        .refused(2, &["nowhere is no result of a run", "elsewhere is no result of a run", "a/1 stands on both sides"]);
    let b = set(&bench, "b", 2..3, &[]);
    let answer = compare(&bench, &a, &b, &["--margin", "bedx=1mm", "--margin", "bed_x=2deg"]);
    answer.refused(2, &["no measure is called \"bedx\"; known are bed_x", "is an angle; a length is wanted"]);
    bench.tollgate(&["compare", "a/1"]).refused(2, &["--with"]);
    bench.tollgate(&["compare", "a/1", "--with", "b/2", "--margin", "bed_x"]).refused(2, &["NAME=VALUE"]);
    std::fs::write(bench.path("b/2/summary.json"), "{").unwrap();
    compare(&bench, &a, &b, &[]).refused(5, &["b/2/summary.json"]);
}
