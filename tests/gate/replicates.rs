//! The same run several times.

use crate::common::{Bench, Summary, assert_same, kill, number};

const SHORT: [&str; 6] = ["--set", "feed.fill.amount=80", "--set", "end.time=0.2 s", "--set", "output.frames=10 ms"];

fn arguments<'a>(out: &'a str, further: &[&'a str]) -> Vec<&'a str> {
    [&["run", "scene.toml", "--threads", "1", "--out", out], &SHORT[..], further].concat()
}

fn run(bench: &Bench, out: &str, further: &[&str]) -> Summary {
    let answer = bench.tollgate(&arguments(out, further));
    assert_eq!(answer.code, 0, "{answer:?}");
    bench.summary(out)
}

/// Catches replicates that share a seed, a mean over other runs than those in the folders, and a first replicate that is not the
/// run without replicates.
#[test]
fn replicates_have_seeds_of_their_own_and_statistics() {
    let bench = Bench::hopper();
    let over = run(&bench, "r", &["--replicates", "3"]);
    let each: Vec<Summary> = (1..=3).map(|k| bench.summary(&format!("r/replicates/00{k}"))).collect();
    let seeds: Vec<f64> = each.iter().map(|summary| summary.number("/scene/seed")).collect();
    assert_eq!(seeds, [1.0, 2.0, 3.0]);
    let name = "heap.centre_z_m";
    let heights: Vec<f64> = each.iter().map(|summary| number(&summary.at("/measures")[name])).collect();
    assert!(heights[0] != heights[1] && heights[1] != heights[2], "{heights:?}");
    let mean = heights.iter().sum::<f64>() / 3.0;
    assert!((number(&over.at("/measures")[name]) / mean - 1.0).abs() < 1e-14, "{:#}", over.at("/measures"));
    let statistics = &over.at("/replicates")[name];
    assert_eq!(statistics["count"], 3, "{statistics:#}");
    let deviation = (heights.iter().map(|height| (height - mean).powi(2)).sum::<f64>() / 2.0).sqrt();
    let found = statistics["standard_deviation"].as_f64().unwrap_or_else(|| panic!("{statistics:#}"));
    assert!((found / deviation - 1.0).abs() < 1e-9, "{found} is not {deviation}");
    run(&bench, "alone", &[]);
    // But for what the summaries say of the command line.
    let files = |out: &str| {
        let mut files = bench.result(out);
        files.retain(|name, _| !name.ends_with("summary.json"));
        files
    };
    assert_same(&files("alone"), &files("r/replicates/001"));
}

/// Catches a kick of another length, of several particles, or none; and two replicates with the same kick.
#[test]
fn a_kick_moves_one_particle_by_its_length_and_nothing_else() {
    let bench = Bench::hopper();
    for whole in [&[][..], &["--whole"]] {
        let out = format!("kicked{}", whole.len());
        let stage = if whole.is_empty() { "hopper" } else { "heap" };
        run(&bench, &out, &[&["--perturb", "1nm", "--replicates", "2"], whole].concat());
        let plain = format!("plain{}", whole.len());
        run(&bench, &plain, whole);
        let reference = bench.frames(&plain, stage);
        let mut kicks = Vec::new();
        for replicate in ["001", "002"] {
            let kicked = bench.frames(&format!("{out}/replicates/{replicate}"), stage);
            assert_eq!(kicked.0[&0].len(), reference.0[&0].len());
            let moved: Vec<_> = reference.0[&0].iter().filter(|(id, row)| kicked.row(0, **id) != *row).collect();
            assert_eq!(moved.len(), 1, "{moved:?}");
            let (id, before) = moved[0];
            let after = kicked.row(0, *id);
            // Places of 0.3 m are rounded to 6e-17 m.
            assert!((before.distance(after) - 1e-9).abs() < 2e-16, "{:e}", before.distance(after));
            assert_eq!((before.velocity, before.spin, before.radius), (after.velocity, after.spin, after.radius));
            kicks.push((*id, after.place));
            // It is felt in the end.
            let (_, end) = kicked.last();
            assert_ne!(end, reference.last().1);
        }
        assert_ne!(kicks[0], kicks[1]);
    }
}

#[test]
fn replicates_that_were_killed_are_resumed_to_the_same_bits() {
    let bench = Bench::hopper();
    run(&bench, "undisturbed", &["--replicates", "3"]);
    let mut child = bench.start(&arguments("killed", &["--replicates", "3"]));
    let second = bench.path("killed/replicates/002/stages/hopper/series.csv");
    assert!(bench.wait(&mut child, || std::fs::read(&second).is_ok_and(|bytes| bytes.len() > 5000)));
    kill(&mut child);
    bench.tollgate(&arguments("killed", &["--replicates", "3"])).refused(2, &["--resume"]);
    run(&bench, "killed", &["--replicates", "3", "--resume"]);
    assert_same(&bench.result("undisturbed"), &bench.result("killed"));
    // Once more changes nothing; a fourth is added to three.
    let again = bench.tollgate(&arguments("killed", &["--replicates", "3"]));
    assert!(again.code == 0 && again.err.contains("nothing was computed"), "{again:?}");
    let more = run(&bench, "killed", &["--replicates", "4", "--resume"]);
    assert_eq!(more.at("/replicates")["heap.centre_z_m"]["count"], 4);
}
