//! What may be written where: results are never overwritten, and only what belongs together is continued.

use super::common::{BEADS, Bench, FLOOR, assert_same, kill};
use std::fs;

const END: &str = "[end]\ntime = \"20 ms\"\n";
const OUTPUT: &str = "[output]\nframes = \"5 ms\"\nseries = \"1 ms\"\n";

#[test]
fn the_same_run_is_done_and_another_is_refused_with_the_difference() {
    let bench = Bench::with(&[FLOOR, BEADS, END, OUTPUT]);
    bench.run("a", &[]);
    let before = bench.changes("a");
    let result = bench.result("a");
    let done = |further: &[&str]| {
        let answer = bench.tollgate(&[&["run", "scene.toml", "--out", "a"], further].concat());
        assert_eq!(answer.code, 0, "{answer:?}");
        assert!(answer.err.contains("this run was done before; nothing was computed"), "{answer:?}");
    };
    done(&[]);
    done(&["--resume"]);
    done(&["--threads", "2"]);
    // Comments and the title say nothing about the result.
    let text = bench.text("scene.toml");
    fs::write(bench.path("scene.toml"), format!("title = \"another name\"\n# a comment\n{text}")).unwrap();
    done(&[]);
    let refused = |further: &[&str], words: &[&str]| {
        for resume in [&[][..], &["--resume"]] {
            let arguments = [&["run", "scene.toml", "--out", "a"], further, resume].concat();
            bench.tollgate(&arguments).refused(2, words);
        }
    };
    refused(&["--seed", "4"], &["never overwritten", "seed: 3 then, 4 now"]);
    refused(&["--set", "material.glass.density=2600 kg/m3"], &["density: 2500.0 then, 2600.0 now"]);
    refused(&["--set", "end.time=30 ms"], &["end.time: 0.02 then, 0.03 now"]);
    refused(&["--set", "feed.fill.amount=61"], &["feeds.fill", "60 then, 61 now"]);
    refused(&["--model", "rolling_resistance=off"], &["rolling_resistance"]);
    refused(&["--set", "output.series=2 ms"], &["this very run, but with other outputs"]);
    assert_eq!(bench.changes("a"), before, "a refusal touched the folder");
    assert_same(&result, &bench.result("a"));
}

#[test]
fn foreign_folders_are_left_alone() {
    let bench = Bench::with(&[FLOOR, BEADS, END]);
    fs::create_dir(bench.path("mine")).unwrap();
    fs::write(bench.path("mine/thesis.tex"), "years of work").unwrap();
    for further in [&[][..], &["--resume"], &["--force"]] {
        let arguments = [&["run", "scene.toml", "--out", "mine"], further].concat();
        bench.tollgate(&arguments).refused(2, &["mine", "not empty", "--out"]);
    }
    assert_eq!(fs::read_dir(bench.path("mine")).unwrap().count(), 1);
    bench.tollgate(&["run", "scene.toml", "--out", "scene.toml"]).refused(2, &["is a file", "--out"]);
    // An empty folder is welcome, and so is one in which a run was killed while it made its first file.
    fs::create_dir(bench.path("empty")).unwrap();
    bench.run("empty", &[]);
    fs::create_dir(bench.path("begun")).unwrap();
    fs::write(bench.path("begun/run.json.staging"), "{\"key\":").unwrap();
    bench.run("begun", &["--resume"]);
    let mut begun = bench.result("begun");
    begun.remove("run.json.staging");
    assert_same(&bench.result("empty"), &begun);
}

#[test]
fn a_folder_is_computed_by_one_process_at_a_time() {
    let bench = Bench::with(&[FLOOR, BEADS, "[end]\ntime = \"10 s\"\n", OUTPUT]);
    let mut child = bench.start(&["run", "scene.toml", "--out", "a", "--threads", "1"]);
    assert!(bench.wait_for_rows(&mut child, "a", 1));
    bench.tollgate(&["run", "scene.toml", "--out", "a", "--resume"]).refused(2, &["another process"]);
    kill(&mut child);
}

#[test]
fn only_staging_files_of_a_killed_run_are_no_obstacle() {
    let bench = Bench::with(&[FLOOR, BEADS, END, OUTPUT]);
    bench.run("a", &[]);
    let undisturbed = bench.result("a");
    // As if killed while the first checkpoint was being written: nothing is whole but the record.
    fs::create_dir_all(bench.path("b/frames")).unwrap();
    fs::copy(bench.path("a/run.json"), bench.path("b/run.json")).unwrap();
    for name in ["state.checkpoint.staging", "frames.pvd.staging", "frames/particles_000000.vtp.staging", "series.csv"]
    {
        fs::write(bench.path("b").join(name), "half of a").unwrap();
    }
    // Whole, but of a time that the run has not come to again.
    fs::write(bench.path("b/frames/particles_999999.vtp"), "old").unwrap();
    bench.run("b", &["--resume"]);
    assert_same(&undisturbed, &bench.result("b"));
    // As if killed between the last checkpoint and the summary.
    fs::remove_file(bench.path("b/summary.json")).unwrap();
    bench.run("b", &["--resume"]);
    assert_same(&undisturbed, &bench.result("b"));
}

#[test]
fn damaged_edited_and_foreign_checkpoints_are_refused() {
    let bench = Bench::with(&[FLOOR, BEADS, END, OUTPUT]);
    bench.run("a", &[]);
    bench.run("other", &["--seed", "8"]);
    let whole = bench.bytes("a/state.checkpoint");
    fs::remove_file(bench.path("a/summary.json")).unwrap();
    let refused = |bytes: &[u8], words: &[&str]| {
        fs::write(bench.path("a/state.checkpoint"), bytes).unwrap();
        // Twice: the first refusal must not turn the folder into something else.
        for _ in 0..2 {
            bench.tollgate(&["run", "scene.toml", "--out", "a", "--resume"]).refused(5, words);
        }
        let from = ["run", "scene.toml", "--from", "a/state.checkpoint", "--out", "c"];
        if words != ["another scene"] {
            bench.tollgate(&from).refused(5, words);
            fs::remove_dir_all(bench.path("c")).unwrap();
        }
    };
    refused(&whole[..whole.len() / 2], &["state.checkpoint", "truncated"]);
    refused(&whole[..20], &["state.checkpoint", "truncated"]);
    refused(b"", &["not a checkpoint"]);
    let mut edited = whole.clone();
    let last = edited.len() - 5;
    edited[last] ^= 1;
    refused(&edited, &["state.checkpoint", "damaged"]);
    let mut edited = whole.clone();
    edited[70] ^= 1;
    refused(&edited, &["header was edited or damaged"]);
    refused(&bench.bytes("other/state.checkpoint"), &["another scene"]);
    fs::write(bench.path("a/state.checkpoint"), &whole).unwrap();
    let record = bench.bytes("a/run.json");
    fs::write(bench.path("a/run.json"), &record[..record.len() / 2]).unwrap();
    bench.tollgate(&["run", "scene.toml", "--out", "a", "--resume"]).refused(2, &["run.json is damaged", "--out"]);
    fs::write(bench.path("a/run.json"), &record).unwrap();
    bench.run("a", &["--resume"]);
    bench.run("fresh", &[]);
    assert_same(&bench.result("fresh"), &bench.result("a"));
}
