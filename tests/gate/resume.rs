//! Runs that are broken off and gone on with, and results that are used again.

use crate::common::{Answer, Bench, assert_same, copy_folder, interrupt, kill, rows, seeded};
use std::collections::BTreeMap;
use std::fs;
use std::path::Path;
use std::sync::OnceLock;

/// The small hopper, shortened; checkpoints fall into both stages, and between chunks.
const SHORT: [&str; 8] = [
    "--set",
    "feed.fill.amount=120",
    "--set",
    "end.time=0.2 s",
    "--set",
    "output.checkpoints=10 ms",
    "--set",
    "output.frames=10 ms",
];
/// Rows of both stages' series together: one a millisecond, from 0 to 200 ms.
const ROWS: usize = 2 * 201;

fn arguments<'a>(out: &'a str, further: &[&'a str]) -> Vec<&'a str> {
    [&["run", "scene.toml", "--threads", "1", "--out", out], &SHORT[..], further].concat()
}

/// The undisturbed run, computed once for all tests of this file.
fn undisturbed() -> &'static BTreeMap<String, Vec<u8>> {
    static RESULT: OnceLock<BTreeMap<String, Vec<u8>>> = OnceLock::new();
    RESULT.get_or_init(|| {
        let bench = Bench::hopper();
        let summary = bench.run("a", &SHORT);
        // The scene must do what it is here for: it discharges, and stops in the midst of it.
        let crossings = summary.recorded("outlet")["stream"]["crossings"].as_u64().unwrap();
        assert!((60..120).contains(&crossings), "{crossings}");
        bench.result("a")
    })
}

/// Rows in the series of all stages.
fn rows_of_stages(out: &Path) -> usize {
    ["hopper", "heap"].iter().map(|stage| rows(&out.join("stages").join(stage).join("series.csv"))).sum()
}

/// Catches whatever a checkpoint forgets of the gates: crossings that no chunk holds yet, half a path, the memory of what returned,
/// the place in the stream, the ledger, the watch on backing up.
#[test]
fn a_run_killed_anywhere_is_resumed_to_the_same_bits() {
    let bench = Bench::hopper();
    let expected = undisturbed();
    let mut points = seeded(2026, 20, ROWS);
    points.sort_unstable();
    let mut broken_off = 0;
    for (number, point) in points.iter().enumerate() {
        let out = format!("killed-{number}");
        let mut child = bench.start(&arguments(&out, &[]));
        let place = bench.path(&out);
        bench.wait(&mut child, || rows_of_stages(&place) >= *point);
        kill(&mut child);
        if !place.join("summary.json").exists() {
            broken_off += 1;
            bench.tollgate(&arguments(&out, &[])).refused(2, &["unfinished", "--resume"]);
        }
        let answer = bench.tollgate(&arguments(&out, &["--resume"]));
        assert_eq!(answer.code, 0, "at row {point}: {answer:?}");
        assert_same(expected, &bench.result(&out));
        fs::remove_dir_all(place).unwrap();
    }
    assert!(broken_off >= 15, "only {broken_off} runs were broken off before their end");
}

/// One run killed again and again, each time a little later.
#[test]
fn a_run_killed_again_and_again_ends_the_same() {
    let bench = Bench::hopper();
    let mut further: &[&str] = &[];
    for point in [3, 130, 215, 330] {
        let mut child = bench.start(&arguments("a", further));
        let place = bench.path("a");
        assert!(bench.wait(&mut child, || rows_of_stages(&place) >= point), "it ended before row {point}");
        kill(&mut child);
        further = &["--resume"];
    }
    let answer = bench.tollgate(&arguments("a", &["--resume"]));
    assert_eq!(answer.code, 0, "{answer:?}");
    assert_same(undisturbed(), &bench.result("a"));
}

#[test]
fn an_interrupted_run_goes_on_in_either_stage() {
    let bench = Bench::hopper();
    let mut further: &[&str] = &[];
    for (point, stages) in [(150, 1), (260, 2)] {
        let mut child = bench.start(&arguments("a", further));
        let place = bench.path("a");
        assert!(bench.wait(&mut child, || rows_of_stages(&place) >= point), "it ended before row {point}");
        interrupt(&child);
        let answer = Answer::from(child.wait_with_output().unwrap());
        answer.ended(130, &["interrupted", "--resume"]);
        assert_eq!(answer.out.contains("no stream yet"), stages == 1, "{}", answer.out);
        let summary = bench.summary("a");
        assert_eq!((summary.word("/outcome/reason"), summary.number("/outcome/exit_code")), ("interrupted", 130.0));
        assert_eq!(summary.list("/stages").len(), stages);
        // A stream is whole or absent.
        let stream = bench.path("a/stages/hopper/streams/outlet");
        assert_eq!(stream.exists(), stages == 2, "the stream of a stage that has not ended");
        further = &["--resume"];
    }
    let answer = bench.tollgate(&arguments("a", &["--resume"]));
    assert_eq!(answer.code, 0, "{answer:?}");
    assert_same(undisturbed(), &bench.result("a"));
}

/// The moment after the stream has been put into place, and before the stage's summary says so.
#[test]
fn a_run_killed_between_stream_and_summary_is_resumed_to_the_same_bits() {
    let bench = Bench::hopper();
    bench.run("a", &SHORT);
    for name in ["a/stages/heap", "a/stages/hopper/picture.svg", "a/stages/hopper/summary.json", "a/summary.json"] {
        let path = bench.path(name);
        if path.is_dir() { fs::remove_dir_all(path).unwrap() } else { fs::remove_file(path).unwrap() }
    }
    let answer = bench.tollgate(&arguments("a", &["--resume"]));
    assert_eq!(answer.code, 0, "{answer:?}");
    assert_same(undisturbed(), &bench.result("a"));
    // Likewise in the last stage, and where only the summary of the whole is missing.
    fs::remove_file(bench.path("a/stages/heap/summary.json")).unwrap();
    fs::remove_file(bench.path("a/summary.json")).unwrap();
    assert_eq!(bench.tollgate(&arguments("a", &["--resume"])).code, 0);
    assert_same(undisturbed(), &bench.result("a"));
    fs::remove_file(bench.path("a/summary.json")).unwrap();
    assert_eq!(bench.tollgate(&arguments("a", &["--resume"])).code, 0);
    assert_same(undisturbed(), &bench.result("a"));
}

#[test]
fn what_is_done_is_not_computed_again() {
    let bench = Bench::hopper();
    bench.run("a", &SHORT);
    let before = bench.changes("a/stages");
    let again = bench.tollgate(&arguments("a", &[]));
    assert_eq!(again.code, 0, "{again:?}");
    assert!(again.err.contains("was done before; nothing was computed"), "{again:?}");
    // A comment, and another name of the file.
    let text = bench.text("scene.toml");
    fs::write(bench.path("scene.toml"), format!("# Changed.\n{}", text.replace("\n[end]", "\n# When it ends.\n[end]")))
        .unwrap();
    let again = bench.tollgate(&arguments("a", &["--resume"]));
    assert!(again.code == 0 && again.err.contains("nothing was computed"), "{again:?}");
    // Only one stage, which is done.
    let again = bench.tollgate(&arguments("a", &["--stage", "heap"]));
    assert!(again.code == 0 && again.err.contains("nothing was computed"), "{again:?}");
    assert_eq!(before, bench.changes("a/stages"), "files were written again");
    // Another floor is another run.
    let other = bench.tollgate(&arguments("a", &["--set", "part.floor.point_mm=[0, 0, 150]"]));
    other.refused(2, &["never overwritten", "floor"]);
    assert_eq!(before, bench.changes("a/stages"));
}

/// A stage that is finished stays as it is while the other is gone on with.
#[test]
fn a_finished_stage_stays_while_the_other_goes_on() {
    let bench = Bench::hopper();
    let mut child = bench.start(&arguments("a", &[]));
    let place = bench.path("a");
    assert!(bench.wait(&mut child, || rows_of_stages(&place) >= 300));
    kill(&mut child);
    let before = bench.changes("a/stages/hopper");
    assert_eq!(bench.tollgate(&arguments("a", &["--resume"])).code, 0);
    assert_eq!(before, bench.changes("a/stages/hopper"));
    assert_same(undisturbed(), &bench.result("a"));
}

#[test]
fn stages_are_taken_from_another_run_where_their_keys_are_the_same() {
    let bench = Bench::hopper();
    bench.run("old", &SHORT);
    // Another floor: only what lies below is new.
    let floor = ["--set", "part.floor.point_mm=[0, 0, 150]", "--reuse", "old"];
    let answer = bench.tollgate(&arguments("floor", &floor));
    assert_eq!(answer.code, 0, "{answer:?}");
    assert!(!bench.path("floor/stages/hopper").exists() && bench.path("floor/stages/heap/summary.json").exists());
    let (old, new) = (bench.summary("old"), bench.summary("floor"));
    assert_eq!(new.recorded("outlet"), old.recorded("outlet"), "the same stream");
    assert!(new.number("/measures/heap.centre_z_m") > old.number("/measures/heap.centre_z_m"));
    // The same as a run that computes everything.
    let answer = bench.tollgate(&arguments("alone", &floor[..2]));
    assert_eq!(answer.code, 0, "{answer:?}");
    let (mut with, mut without) = (bench.result("floor"), bench.result("alone"));
    for result in [&mut with, &mut without] {
        result.retain(|name, _| name.starts_with("stages/heap/"));
    }
    assert_same(&without, &with);
    // Another friction against the steel: everything is new.
    let friction = ["--set", "pair.1.friction=0.3", "--reuse", "old"];
    let answer = bench.tollgate(&arguments("friction", &friction));
    assert_eq!(answer.code, 0, "{answer:?}");
    assert!(bench.path("friction/stages/hopper/summary.json").exists());
    let digest = |out: &str| bench.summary(out).recorded("outlet")["stream"]["digest"].clone();
    assert_ne!(digest("friction"), digest("old"));
    // Said, with what differs.
    assert!(
        bench.summary("friction").warns("stage 'hopper' was not taken from old"),
        "{:#}",
        bench.summary("friction").at("/warnings")
    );
    // A stage of the same key whose stream is damaged is no use.
    copy_folder(&bench.path("old"), &bench.path("damaged"));
    fs::remove_file(bench.path("damaged/stages/hopper/streams/outlet/chunk-000000.columns")).unwrap();
    let answer = bench.tollgate(&arguments("c", &["--set", "part.floor.point_mm=[0, 0, 150]", "--reuse", "damaged"]));
    answer.refused(5, &["chunk-000000.columns is missing"]);
}
