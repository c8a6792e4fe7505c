//! Frames are written while the solver goes on: none is lost, and a writer that fails stops the run.

use super::common::{Answer, BEADS, Bench, FLOOR, interrupt};
use std::fs;

/// Far longer than anybody waits.
const END: &str = "[end]\ntime = \"1000 s\"\n";
const OUTPUT: &str = "[output]\nframes = \"1 ms\"\nseries = \"1 ms\"\ncontacts = true\n";
const RUN: &[&str] = &["run", "scene.toml", "--set", "solver.timestep=50 us", "--threads", "1", "--out", "a"];

#[test]
fn an_interrupted_run_has_every_frame_that_was_due_and_the_last_state() {
    let bench = Bench::with(&[FLOOR, BEADS, END, OUTPUT]);
    let mut child = bench.start(RUN);
    assert!(bench.wait_for_rows(&mut child, "a", 20));
    interrupt(&child);
    Answer::from(child.wait_with_output().unwrap()).ended(130, &["interrupted", "--resume"]);
    let steps = bench.summary("a").number("/stages/0/steps") as u64;
    // Every 20 time steps of 50 us, and the state at which it was interrupted.
    let mut due: Vec<u64> = (0..=steps).step_by(20).collect();
    due.extend(Some(steps).filter(|last| !last.is_multiple_of(20)));
    assert!(due.len() > 20);
    let shown = bench.shown_files("a");
    for name in ["particles", "contacts"] {
        let names: Vec<&str> =
            shown.iter().filter(|shown| shown.name == name).map(|shown| shown.file.as_str()).collect();
        let expected: Vec<String> = due.iter().map(|step| format!("frames/{name}_{step:06}.vtp")).collect();
        assert_eq!(names, expected);
    }
    assert_eq!(shown.last().unwrap().time, bench.summary("a").number("/outcome/time_s"));
}

#[test]
fn a_run_that_cannot_write_its_frames_is_stopped_and_says_why() {
    let bench = Bench::with(&[FLOOR, BEADS, END, OUTPUT]);
    let mut child = bench.start(RUN);
    let frames = bench.path("a/frames");
    assert!(bench.wait(&mut child, || frames.join("particles_000100.vtp").exists()));
    // A file where the folder was: not even who may do everything can write into it. The run may make the folder anew between the two.
    let is_blocked =
        |attempt| fs::rename(&frames, bench.path(&format!("a/{attempt}"))).is_ok() && fs::write(&frames, "").is_ok();
    assert!((0..1000).any(is_blocked));
    Answer::from(child.wait_with_output().unwrap()).refused(8, &["a/frames"]);
}
