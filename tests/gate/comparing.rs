//! `compare` of split runs against whole ones.

use crate::common::{Answer, Bench};
use serde_json::Value;

const SHORT: [&str; 8] = [
    "--set",
    "feed.fill.amount=100",
    "--set",
    "end.time=0.25 s",
    "--set",
    "output.frames=0.1 s",
    "--replicates",
    "3",
];

fn replicates(bench: &Bench, out: &str, further: &[&str]) {
    let answer = bench.attempt(out, &[&SHORT[..], further].concat());
    assert_eq!(answer.code, 0, "{answer:?}");
}

fn compare(bench: &Bench, one: &str, reference: &str, further: &[&str]) -> (Answer, Value) {
    let answer = bench.tollgate(&[&["compare", one, "--with", reference, "--json"], further].concat());
    let found = serde_json::from_str(&answer.out).unwrap_or_else(|error| panic!("{error}: {answer:?}"));
    (answer, found)
}

fn measure<'a>(found: &'a Value, name: &str) -> &'a Value {
    let measures = found["measures"].as_array().unwrap();
    measures.iter().find(|one| one["name"].as_str().unwrap().ends_with(name)).unwrap_or_else(|| panic!("no {name}: {found:#}"))
}

/// Catches a comparison that pairs measures of different stages, takes both sides for one, or is blind to an error that was put in:
/// here the replay is 8 mm beside, or lets a window of the stream through.
#[test]
fn split_and_whole_agree_and_a_planted_error_does_not() {
    let bench = Bench::hopper();
    replicates(&bench, "whole", &["--whole"]);
    replicates(&bench, "split", &[]);
    replicates(&bench, "beside", &["--reuse", "split/replicates/001", "--reuse", "split/replicates/002", "--reuse",
        "split/replicates/003", "--set", "stage.heap.replay.outlet.place={ move_mm = [8, 0, 0] }"]);
    let (answer, found) = compare(&bench, "split", "whole", &[]);
    assert!([0, 6].contains(&answer.code), "{answer:?}");
    let verdict = found["verdict"].as_str().unwrap();
    assert!(["agrees", "inconclusive"].contains(&verdict), "{found:#}");
    assert_eq!(answer.code == 0, verdict == "agrees");
    // The runs differ by round-off that chaos has had little time to carry: the means are closer than the scatter of the seeds.
    for axis in ["centre_x", "centre_y", "centre_z"] {
        let one = measure(&found, axis);
        assert_eq!((&one["runs"]["count"], &one["reference"]["count"]), (&3.into(), &3.into()), "{one:#}");
        assert!(one["difference"].as_f64().unwrap().abs() < 2e-3, "{one:#}");
    }
    let (answer, found) = compare(&bench, "beside", "whole", &[]);
    assert_eq!(answer.code, 6, "{answer:?}");
    assert_eq!(found["verdict"], "differs", "{found:#}");
    let x = measure(&found, "centre_x");
    assert_eq!(x["verdict"], "differs", "{x:#}");
    let difference = x["difference"].as_f64().unwrap();
    assert!((difference - 8e-3).abs() < 3e-3, "{difference}");
    let low = x["interval_95"][0].as_f64().unwrap();
    assert!(low > 0.0 && low < difference, "{x:#}");
    // In words, with the verdict in the last line.
    let words = bench.tollgate(&["compare", "beside", "--with", "whole"]);
    assert_eq!(words.code, 6);
    assert!(words.out.lines().last().unwrap().starts_with("differs"), "{}", words.out);
}
