//! Killed at any moment, shared by two, out of disk: nothing is lost, nothing runs twice, the table comes out the same.

use super::common::{FLOORS, SMALL, bench, results, run, seeded, starts};
use crate::program::{Bench, interrupt, kill};
use std::fs;
use std::process::Command;
use std::time::{Duration, Instant};

const THREE: &str = r#"
[[axis]]
name = "floor"
keys = "part.floor.point_mm"
values = [[0, 0, 140], [0, 0, 150], [0, 0, 160]]
"#;

/// Processes that hold claims.
fn workers(bench: &Bench) -> Vec<u32> {
    let claims = fs::read_dir(bench.path("out/claims")).into_iter().flatten().flatten();
    let process = |entry: fs::DirEntry| {
        let text = fs::read_to_string(entry.path()).ok()?;
        let holder: serde_json::Value = serde_json::from_str(text.lines().next()?).ok()?;
        holder["process"].as_u64().and_then(|process| u32::try_from(process).ok())
    };
    claims.filter_map(process).collect()
}

fn kill_hard(process: u32) {
    // It may have ended in between.
    drop(Command::new("kill").args(["-9", &process.to_string()]).output());
}

/// Waits until no process holds a claim any more.
fn wait_for_workers(bench: &Bench) {
    let started = Instant::now();
    let is_alive = |process: &u32| {
        let stat = fs::read_to_string(format!("/proc/{process}/stat")).unwrap_or_default();
        stat.rsplit_once(") ").is_some_and(|(_, rest)| !rest.starts_with('Z'))
    };
    while workers(bench).iter().any(is_alive) {
        assert!(started.elapsed() < Duration::from_secs(60), "a worker outlives its campaign");
        std::thread::sleep(Duration::from_millis(10));
    }
}

/// Kills the campaign, or one of the processes that compute for it, and resumes it each time.
#[test]
fn killed_at_twenty_moments_and_resumed_the_table_is_the_same() {
    let undisturbed = bench(&[SMALL, THREE]);
    let begun = Instant::now();
    assert_eq!(run(&undisturbed, &[]).code, 0);
    let duration = begun.elapsed();
    let expected = results(&undisturbed);
    let disturbed = bench(&[SMALL, THREE]);
    let moments = seeded(7, 2 * 20, 1000);
    for (count, moment) in moments.chunks(2).enumerate() {
        // The last moments find it further on: what was finished stays.
        let further: &[&str] = if disturbed.path("out").exists() { &["--resume"] } else { &[] };
        let mut child = disturbed.start(&[&["campaign", "run", ".", "--out", "out"], further].concat());
        std::thread::sleep(duration.mul_f64(moment[0] as f64 / 1000.0 / 4.0));
        if count % 3 == 0 {
            let running = workers(&disturbed);
            if !running.is_empty() {
                kill_hard(running[moment[1] % running.len()]);
            }
            // Ended by itself, or by the kill that follows.
            std::thread::sleep(Duration::from_millis(20));
        }
        if count % 2 == 0 {
            workers(&disturbed).into_iter().for_each(kill_hard);
        }
        kill(&mut child);
        wait_for_workers(&disturbed);
        if count % 4 == 3 {
            // From time to time everything but the last stages is there, so that these are met, too.
            drop(fs::remove_dir_all(disturbed.path("out/stages/heap")));
        }
    }
    let last = run(&disturbed, &["--resume"]);
    assert_eq!(last.code, 0, "{last:?}");
    assert_eq!(results(&disturbed), expected);
    assert!(fs::read_dir(disturbed.path("out/claims")).unwrap().next().is_none(), "claims are given back");
}

#[test]
fn what_was_begun_is_gone_on_with_only_when_asked() {
    let bench = bench(&[SMALL, FLOORS]);
    let mut child = bench.start(&["campaign", "run", ".", "--out", "out"]);
    assert!(bench.wait(&mut child, || !workers(&bench).is_empty()));
    interrupt(&child);
    let answer = child.wait_with_output().unwrap();
    assert_eq!(answer.status.code(), Some(130), "{answer:?}");
    assert!(String::from_utf8_lossy(&answer.stderr).contains("go on with the same command and --resume"));
    run(&bench, &[]).refused(2, &["1 stages were begun and have not ended", "--resume"]);
    let resumed = run(&bench, &["--resume"]);
    assert_eq!(resumed.code, 0, "{resumed:?}");
}

#[test]
fn two_at_once_compute_nothing_twice_and_lose_nothing() {
    let alone = bench(&[SMALL, THREE]);
    assert_eq!(run(&alone, &[]).code, 0);
    let shared = bench(&[SMALL, THREE]);
    let both: Vec<_> = (0..2).map(|_| shared.start(&["campaign", "run", ".", "--out", "out"])).collect();
    for child in both {
        let answer = child.wait_with_output().unwrap();
        assert_eq!(answer.status.code(), Some(0), "{answer:?}");
    }
    assert_eq!(starts(&shared), [1; 4], "each stage was begun once");
    assert_eq!(results(&shared), results(&alone));
}

/// A disk of its own, gone with the test.
struct Disk<'a>(&'a Bench);

impl<'a> Disk<'a> {
    /// `None` where this user may mount nothing.
    fn mount(bench: &'a Bench, size: &str) -> Option<Self> {
        fs::create_dir(bench.path("out")).unwrap();
        let options = format!("size={size}");
        let mount =
            Command::new("mount").args(["-t", "tmpfs", "-o", &options, "tmpfs"]).arg(bench.path("out")).output();
        mount.is_ok_and(|mount| mount.status.success()).then_some(Self(bench))
    }
}

impl Drop for Disk<'_> {
    fn drop(&mut self) {
        drop(Command::new("umount").arg("-l").arg(self.0.path("out")).output());
    }
}

#[test]
fn a_full_disk_is_told_and_when_there_is_room_it_goes_on() {
    let alone = bench(&[SMALL, FLOORS]);
    assert_eq!(run(&alone, &[]).code, 0);
    let full = bench(&[SMALL, FLOORS]);
    let Some(disk) = Disk::mount(&full, "900k") else {
        // A user without the right to mount sees the same errors in the tests of runs, whose disks answer as /dev/full does.
        eprintln!("no disk of our own may be mounted here");
        return;
    };
    let answer = run(&full, &[]);
    answer.ended(8, &["No space left on device"]);
    let grown = Command::new("mount").args(["-o", "remount,size=200m"]).arg(full.path("out")).status().unwrap();
    assert!(grown.success());
    let resumed = run(&full, &["--resume"]);
    assert_eq!(resumed.code, 0, "{resumed:?}");
    assert_eq!(results(&full), results(&alone));
    drop(disk);
}
