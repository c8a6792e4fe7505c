//! Exit statuses, and what is said with them.

use super::common::{BEADS, Bench, FLOOR, Frame};
use std::fs;
use std::process::Command;

const END: &str = "[end]\ntime = \"20 ms\"\n";

#[test]
fn mistakes_of_the_user_are_status_2() {
    let bench = Bench::with(&[FLOOR, BEADS, END]);
    bench.tollgate(&["run"]).refused(2, &["SCENE"]);
    bench.tollgate(&["walk", "scene.toml"]).refused(2, &["walk"]);
    bench.tollgate(&["run", "scene.toml", "--threads", "0"]).refused(2, &["threads"]);
    bench.tollgate(&["run", "scene.toml", "--threads", "many"]).refused(2, &["many"]);
    bench.tollgate(&["run", "scene.toml", "--set", "seed"]).refused(2, &["KEY=VALUE"]);
    bench.tollgate(&["run", "scene.toml", "--model", "spin=perhaps"]).refused(2, &["NAME=on"]);
    bench.tollgate(&["run", "none.toml"]).refused(2, &["none.toml"]);
    bench.tollgate(&["run", "scene.toml", "--set", "end.tme=1 s"]).refused(2, &["tme", "time"]);
    bench.tollgate(&["run", "scene.toml", "--set", "end.time=-1 s"]).refused(2, &["end.time=-1 s"]);
    bench.tollgate(&["run", "scene.toml", "--set", "end.time=inf s"]).refused(2, &["inf"]);
    bench.tollgate(&["run", "scene.toml", "--model", "rolling_resistence=off"]).refused(2, &["rolling_resistence"]);
    bench.tollgate(&["run", "scene.toml", "--from", "none.checkpoint"]).refused(2, &["none.checkpoint"]);
    assert!(!bench.path("runs").exists(), "a mistake left a folder");
    assert_eq!(bench.tollgate(&["check", "scene.toml", "--set", &format!("title={}", "long ".repeat(20_000))]).code, 0);
    bench.tollgate(&["run", "scene.toml", "--set", &format!("seed={}", "9".repeat(100_000))]).refused(2, &["seed"]);
    let help = bench.tollgate(&["run", "--help"]);
    assert!(help.code == 0 && help.out.contains("--resume"), "{help:?}");
}

/// Ten times the limit of stability: neighbours that touch shoot each other away.
const COARSE: &[&str] = &["--set", "solver.timestep=2 ms", "--set", "output.frames=2 ms", "--set", "end.time=2 s"];

#[test]
fn a_refused_plan_runs_when_forced_and_the_watchdog_stops_it_readably() {
    let output = "[output]\nseries = \"2 ms\"\nformats = [\"vtp\", \"lammps\"]\n";
    let bench = Bench::with(&[FLOOR, BEADS, END, output]);
    let run = [&["run", "scene.toml", "--out", "a", "--threads", "1"], COARSE].concat();
    bench.tollgate(&run).refused(2, &["--force", "contacts gain energy from nothing"]);
    assert!(!bench.path("a").exists());
    let forced = [&run[..], &["--force"]].concat();
    let stopped = bench.tollgate(&forced);
    // Time, particle, cause, what next.
    stopped.refused(7, &["unstable", " s (step ", "particle ", "of feed", "solver.timestep"]);
    let summary = bench.summary("a");
    assert_eq!(summary.number("/outcome/exit_code"), 7.0);
    assert!(stopped.err.contains(summary.word("/outcome/reason")), "{stopped:?}\n{:#}", summary.0);
    let time = summary.number("/outcome/time_s");
    assert!(time > 0.0 && (summary.number("/stages/0/steps") * 2e-3 - time).abs() < 1e-9);
    // Up to the state at which it was stopped, everything can be read.
    assert_eq!(bench.series("a").last("time_s"), time);
    let frames = Frame::all(&bench.text("a/dump.particles.lammpstrj"));
    assert_eq!(frames.last().unwrap().step as f64, summary.number("/stages/0/steps"));
    assert!(frames.last().unwrap().len() > 0);
    assert!(bench.text("a/frames.pvd").ends_with("</VTKFile>\n"));
    // It would end so again: nothing is computed, nothing overwritten.
    let before = bench.result("a");
    for further in [&[][..], &["--resume"]] {
        let again = bench.tollgate(&[&forced[..], further].concat());
        again.refused(7, &["nothing was computed", summary.word("/outcome/reason")]);
    }
    super::common::assert_same(&before, &bench.result("a"));
}

/// Mounts a file system of `size` on `place`; false where one may not.
fn mount(place: &std::path::Path, size: &str) -> bool {
    fs::create_dir(place).unwrap();
    let options = format!("size={size}");
    let mount = Command::new("mount").args(["-t", "tmpfs", "-o", &options, "tmpfs"]).arg(place).output();
    mount.is_ok_and(|output| output.status.success())
}

#[test]
fn a_full_disk_is_status_8_and_the_run_resumes_once_there_is_room() {
    let output = "[output]\nframes = \"1 ms\"\nformats = [\"lammps\"]\ncheckpoints = \"2 ms\"\n";
    let bench = Bench::with(&[FLOOR, BEADS, END, output]);
    bench.run("undisturbed", &[]);
    let disk = bench.path("disk");
    // A folder that no one may write to, where one may not mount.
    if !mount(&disk, "160k") {
        let answer = bench.tollgate(&["run", "scene.toml", "--out", "/proc/tollgate"]);
        answer.refused(8, &["cannot create /proc/tollgate"]);
        return;
    }
    let full = bench.tollgate(&["run", "scene.toml", "--out", "disk/a"]);
    let series_ends = bench.text("disk/a/series.csv").lines().count();
    let grown = Command::new("mount").args(["-o", "remount,size=16m"]).arg(&disk).status().unwrap().success();
    let resumed = bench.tollgate(&["run", "scene.toml", "--out", "disk/a", "--resume"]);
    let results = (resumed.code == 0).then(|| (bench.result("undisturbed"), bench.result("disk/a")));
    assert!(Command::new("umount").arg(&disk).status().unwrap().success());
    full.refused(8, &["cannot write", "--resume"]);
    assert!(series_ends > 1, "the disk was full before anything happened");
    assert!(grown && resumed.code == 0, "{resumed:?}");
    let (undisturbed, resumed) = results.unwrap();
    super::common::assert_same(&undisturbed, &resumed);
}
