//! What goes wrong with LIGGGHTS: each fault is provoked, told in the user's words with the right exit status, and leaves nothing behind.
//! A stand-in takes the program's place only where the fault is in the program itself.

use crate::launching::{Case, ENDLESS, FLOOR, HERE, SERIAL, Way, error, finished, in_process, run, said};
use std::fs;
use std::os::unix::fs::{PermissionsExt, symlink};
use std::os::unix::process::CommandExt;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};
use tollgate::backend::BackendError;
use tollgate::exit_code;

pub const PROGRAM_VARIABLE: &str = "TOLLGATE_LIGGGHTS";
const ENDLESSLY: Way = Way { ranks: 1, steps: 100 * ENDLESS, time_limit: 60.0 };

/// A program that takes LIGGGHTS' place.
pub fn stand_in(folder: &Path, script: &str) -> PathBuf {
    let path = folder.join("stand-in");
    fs::write(&path, format!("#!/bin/sh\n{script}\n")).unwrap();
    fs::set_permissions(&path, fs::Permissions::from_mode(0o755)).unwrap();
    path
}

/// The text of a failed case, which is of LIGGGHTS' own making and has all that is needed to go on.
fn failure(case: &Case, way: Way) -> String {
    let error = error(case, way);
    let text = error.to_string();
    assert!(matches!(error, BackendError::Failed { .. }) && error.exit_code() == exit_code::BACKEND_FAILED, "{text}");
    assert!(text.contains(&format!("the case is kept in {}; run it by hand", case.path().display())), "{text}");
    assert!(text.contains("screen.txt"), "{text}");
    text
}

fn assert_says(text: &str, all: &[&str]) {
    for wanted in all {
        assert!(text.contains(wanted), "{wanted:?} is missing in:\n{text}");
    }
}

/// A text STL of one triangle.
fn triangle(corners: [&str; 3]) -> String {
    let [a, b, c] = corners;
    format!(
        "solid a\nfacet normal 0 0 1\nouter loop\nvertex {a}\nvertex {b}\nvertex {c}\nendloop\nendfacet\nendsolid a\n"
    )
}

const MESH: &str = "fix hopper all mesh/surface file meshes/hopper.stl type 1";

fn case_with_mesh(stl: Option<&str>) -> Case {
    let case = Case::new(4, &[(FLOOR, MESH)]);
    fs::create_dir(case.path().join("meshes")).unwrap();
    if let Some(stl) = stl {
        fs::write(case.path().join("meshes/hopper.stl"), stl).unwrap();
    }
    case
}

fn wait_until(what: &str, condition: impl Fn() -> bool) {
    let started = Instant::now();
    while !condition() {
        assert!(started.elapsed() < Duration::from_secs(20), "in vain: {what}");
        std::thread::sleep(Duration::from_millis(20));
    }
}

/// A case that runs in a process of its own, and does so already.
fn running(case: &Case, way: Way) -> Child {
    let child = in_process(case.path(), way).stdout(Stdio::null()).stderr(Stdio::piped()).spawn().unwrap();
    let screen = case.path().join("screen.txt");
    wait_until("time steps", || fs::read_to_string(&screen).is_ok_and(|text| text.contains("Loop time")));
    child
}

fn signal(pid: i32, name: &str) {
    assert!(Command::new("kill").args([name, &pid.to_string()]).status().unwrap().success());
}

/// Number of the process of a case that is LIGGGHTS.
fn liggghts_of(case: &Case) -> i32 {
    let is_it = |pid: &i32| fs::read_to_string(format!("/proc/{pid}/comm")).is_ok_and(|name| name.trim() == "liggghts");
    *case.processes().iter().find(|pid| is_it(pid)).unwrap()
}

#[test]
fn a_missing_program_says_how_to_get_it() {
    let case = Case::new(1, &[]);
    let output = in_process(case.path(), SERIAL).env(PROGRAM_VARIABLE, "/nowhere/liggghts").output().unwrap();
    let text = said(&output, exit_code::NO_BACKEND);
    assert_says(
        &text,
        &["LIGGGHTS is not installed", "/nowhere/liggghts", "apt-get install liggghts", PROGRAM_VARIABLE],
    );
    assert!(!case.path().join("screen.txt").exists());
}

#[test]
fn a_program_without_its_starters_says_so() {
    let case = Case::new(1, &[]);
    let folder = tempfile::tempdir().unwrap();
    for name in ["liggghts", "stdbuf"] {
        symlink(Path::new("/usr/bin").join(name), folder.path().join(name)).unwrap();
    }
    let output = in_process(case.path(), SERIAL).env("PATH", folder.path()).output().unwrap();
    assert_says(&said(&output, exit_code::NO_BACKEND), &["setpriv", "apt-get install util-linux"]);
    symlink("/usr/bin/setpriv", folder.path().join("setpriv")).unwrap();
    let output = in_process(case.path(), Way { ranks: 2, ..SERIAL }).env("PATH", folder.path()).output().unwrap();
    assert_says(&said(&output, exit_code::NO_BACKEND), &["mpirun", "apt-get install openmpi-bin"]);
}

#[test]
fn another_version_is_stopped_at_its_first_line() {
    let case = Case::new(1, &[]);
    let banner = "echo 'LIGGGHTS (Version LIGGGHTS-PUBLIC 3.6.1, compiled 2018 by x)'; sleep 100";
    let program = stand_in(case.path(), banner);
    let started = Instant::now();
    let output = in_process(case.path(), SERIAL).env(PROGRAM_VARIABLE, &program).output().unwrap();
    let text = said(&output, exit_code::NO_BACKEND);
    assert_says(&text, &["is LIGGGHTS 3.6.1", "3.8.x is needed", "apt-get install liggghts"]);
    assert!(started.elapsed() < Duration::from_secs(20));
    case.assert_deserted();
}

#[test]
fn a_missing_mesh_is_named_with_its_line() {
    let text = failure(&case_with_mesh(None), SERIAL);
    let line = crate::launching::deck(1, &[]).lines().position(|line| line == FLOOR).unwrap() + 1;
    assert_says(&text, &["a part's mesh is not there", "meshes/hopper.stl", &format!("in.liggghts:{line}: {MESH}")]);
}

#[test]
fn a_damaged_mesh_is_named_with_its_line() {
    assert_says(&failure(&case_with_mesh(Some("garbage\n")), SERIAL), &["cannot be read", MESH]);
}

#[test]
fn a_mesh_outside_of_the_box_is_named() {
    // all of it outside; and a part of it
    for far in [["1 1 1", "2 1 1", "1 2 1"], ["0 0 0", "2 0 0", "0 0.01 0"]] {
        let text = failure(&case_with_mesh(Some(&triangle(far))), SERIAL);
        assert_says(&text, &["a part reaches out of the box", "(id hopper)", MESH, "make [domain] large enough"]);
    }
}

#[test]
fn deck_errors_have_their_line() {
    let faults = [
        ("thermo ${nope}", "a variable is used that is not defined"),
        ("termo 500", "there is no such command"),
        ("fix drum all wiggle 3", "this LIGGGHTS does not know the fix"),
        ("next nope", "a variable is used that is not defined"),
        ("read_data nope.data add", "a file of the case is not there"),
        ("include nope.in", "a file of the case is not there"),
        ("pair_style gran model hertzz tangential history", "does not know the contact model"),
        ("unfix nothing", "LIGGGHTS stopped with an error"),
    ];
    let line = crate::launching::deck(1, &[]).lines().position(|line| line == HERE).unwrap() + 1;
    for (fault, meaning) in faults {
        let text = failure(&Case::new(4, &[(HERE, fault)]), SERIAL);
        assert_says(&text, &[meaning, &format!("at in.liggghts:{line}: {fault}")]);
    }
}

#[test]
fn errors_of_ranks_have_their_line_too() {
    // one that all ranks find, and one that one of them finds
    for (fault, meaning) in [("fix drum all wiggle 3", "does not know the fix"), ("include nope.in", "is not there")] {
        let text = failure(&Case::new(4, &[(HERE, fault)]), Way { ranks: 2, ..SERIAL });
        assert_says(&text, &[meaning, fault, "mpirun -np 2"]);
    }
}

#[test]
fn a_batch_is_named_by_its_file() {
    let batches = "variable step equal 7\ninclude batches/${step}.in";
    let case = Case::new(4, &[(HERE, batches)]);
    fs::create_dir(case.path().join("batches")).unwrap();
    fs::write(case.path().join("batches/7.in"), "# enters\nread_data batches/7.data add\n").unwrap();
    let outside = "LIGGGHTS\n\n1 atoms\n\nAtoms\n\n4 1 0.004 2500 5 0 0\n";
    fs::write(case.path().join("batches/7.data"), outside).unwrap();
    let place = "at batches/7.in:2: read_data batches/7.data add";
    assert_says(&failure(&case, SERIAL), &["a particle would enter outside of the box", place]);
    fs::write(case.path().join("batches/7.data"), outside.replace("4 1 0.004 2500 5 0 0", "1 1 0.004 2500 0 0 0.05"))
        .unwrap();
    assert_says(&failure(&case, SERIAL), &["a number that is taken", place]);
}

#[test]
fn an_error_at_a_sample_is_found_in_its_quotes() {
    let case = Case::new(4, &[("\"group below region low\"", "\"group below region deep\"")]);
    assert_says(&failure(&case, SERIAL), &["Group region ID does not exist", "group below region deep (in run 100)"]);
}

#[test]
fn values_that_are_missing_or_refused_are_named() {
    let friction = "fix m4 all property/global coefficientFriction peratomtypepair 1 0.5";
    let text = failure(&Case::new(4, &[(friction, "")]), SERIAL);
    assert_says(&text, &["a value of a material or a pair is missing", "coefficientFriction"]);
    let text = failure(&Case::new(4, &[("5.e6", "1.e3")]), SERIAL);
    assert_says(&text, &["softer than LIGGGHTS takes", "soft_particles yes"]);
}

#[test]
fn numbers_that_are_none_stop_the_run_at_once() {
    // two spheres at the same place; LIGGGHTS itself would go on and exit with 0, or crash
    let change = ("single 0.02 0 0.02 ", "single 0 0 0.01 ");
    for ranks in [1, 2] {
        let case = Case::new(ENDLESS, &[change]);
        let error = error(&case, Way { ranks, ..ENDLESSLY });
        let BackendError::Unstable { steps: ..=200, .. } = error else { panic!("{error:?}") };
        assert_eq!(error.exit_code(), exit_code::UNSTABLE);
        assert_says(&error.to_string(), &["is not a number", "smaller time step", "the case is kept in"]);
    }
}

#[test]
fn lost_particles_are_counted() {
    // one is shot through the side of the box
    let shot = ("group active id > 0", "group active id > 0\ngroup one id 2\nvelocity one set 100 0 0");
    let finished = finished(run(Case::new(4, &[shot]).path(), SERIAL).unwrap());
    let deleted: u64 = finished.deleted.iter().map(|deleted| deleted.count).sum();
    assert_eq!((finished.atoms, deleted), (1, 1), "of three one was deleted, one is lost");
    let warned = [shot, ("lost ignore", "lost warn")];
    let warnings = crate::launching::finished(run(Case::new(4, &warned).path(), SERIAL).unwrap()).warnings;
    assert!(warnings.iter().any(|text| text.starts_with("Lost atoms")), "{warnings:?}");
    let text = failure(&Case::new(4, &[shot, ("lost ignore", "lost error")]), SERIAL);
    assert_says(&text, &["particles left the box", "Lost atoms"]);
}

/// Every disk that is full answers as /dev/full does.
#[test]
fn a_screen_that_cannot_be_written_stops_the_run() {
    let case = Case::new(ENDLESS, &[]);
    symlink("/dev/full", case.path().join("screen.txt")).unwrap();
    let error = error(&case, ENDLESSLY);
    assert_eq!(error.exit_code(), exit_code::SYSTEM);
    assert_says(&error.to_string(), &["cannot write", "screen.txt", "No space left on device", "free some space"]);
}

/// A small disk of its own, where the system lets us have one; LIGGGHTS itself writes on as if nothing were.
#[test]
fn a_full_disk_stops_the_run() {
    let case = Case::new(ENDLESS, &[]);
    let mount = format!("mount -t tmpfs -o size=300k none {}", case.path().display());
    let options: &[&str] = &["--user", "--map-root-user", "--mount"];
    let Some(options) = [&options[2..], options].into_iter().find(|options| {
        Command::new("unshare").args(*options).args(["sh", "-c", &mount]).status().is_ok_and(|status| status.success())
    }) else {
        eprintln!("no disk of our own may be had here; /dev/full stands for it in the test above");
        return;
    };
    let entry = in_process(case.path(), ENDLESSLY);
    let deck = fs::read_to_string(case.path().join("in.liggghts")).unwrap();
    let script = format!("{mount} && printf %s \"$DECK\" >\"$0/in.liggghts\" && exec \"$@\"");
    let mut command = Command::new("unshare");
    command.args(options).args(["sh", "-c", &script]).arg(case.path()).arg(entry.get_program()).args(entry.get_args());
    command.envs(entry.get_envs().filter_map(|(name, value)| Some((name, value?)))).env("DECK", deck);
    let text = said(&command.output().unwrap(), exit_code::SYSTEM);
    assert_says(&text, &["no", "space", "free some space, then use --resume"]);
    case.assert_deserted();
}

#[test]
fn a_killed_child_is_told() {
    for ranks in [1, 2] {
        let case = Case::new(ENDLESS, &[]);
        let child = running(&case, Way { ranks, ..ENDLESSLY });
        signal(liggghts_of(&case), "-KILL");
        let text = said(&child.wait_with_output().unwrap(), exit_code::BACKEND_FAILED);
        assert_says(
            &text,
            &["LIGGGHTS was killed (signal 9)", "memory", "the last time step printed is", "the case is kept in"],
        );
        case.assert_deserted();
    }
}

#[test]
fn a_crash_is_told() {
    let case = Case::new(ENDLESS, &[]);
    let child = running(&case, ENDLESSLY);
    signal(liggghts_of(&case), "-SEGV");
    assert_says(&said(&child.wait_with_output().unwrap(), exit_code::BACKEND_FAILED), &["crashed (signal 11)"]);
    case.assert_deserted();
}

/// It ends with exit status 0 then.
#[test]
fn a_child_that_is_asked_to_end_has_not_finished() {
    let case = Case::new(ENDLESS, &[]);
    let child = running(&case, ENDLESSLY);
    signal(liggghts_of(&case), "-TERM");
    assert_says(&said(&child.wait_with_output().unwrap(), exit_code::BACKEND_FAILED), &["asked from outside to stop"]);
    case.assert_deserted();
}

#[test]
fn a_killed_orchestrator_leaves_no_orphans() {
    for ranks in [1, 2, 4] {
        let case = Case::new(ENDLESS, &[]);
        let mut orchestrator = running(&case, Way { ranks, ..ENDLESSLY });
        assert!(case.processes().len() >= ranks as usize);
        orchestrator.kill().unwrap();
        orchestrator.wait().unwrap();
        case.assert_deserted();
    }
}

/// Ranks outlive mpirun's own death by no means of its own.
#[test]
fn a_killed_mpirun_leaves_no_orphans() {
    let case = Case::new(ENDLESS, &[]);
    let child = running(&case, Way { ranks: 2, ..ENDLESSLY });
    let is_mpirun =
        |pid: &i32| fs::read_to_string(format!("/proc/{pid}/comm")).is_ok_and(|name| name.trim() == "mpirun");
    signal(*case.processes().iter().find(|pid| is_mpirun(pid)).unwrap(), "-KILL");
    assert_says(&said(&child.wait_with_output().unwrap(), exit_code::BACKEND_FAILED), &["killed (signal 9)"]);
    case.assert_deserted();
}

/// A locale with decimal commas would be read and written by LIGGGHTS: it does not get one.
#[test]
fn another_locale_does_not_reach_liggghts() {
    let case = Case::new(4, &[]);
    let script = "env | grep '^LC_ALL=' >locale.txt; exec /usr/bin/liggghts \"$@\"";
    let program = stand_in(case.path(), script);
    let mut command = in_process(case.path(), SERIAL);
    command.env("LANG", "de_DE.UTF-8").env("LC_ALL", "de_DE.UTF-8").env("LC_NUMERIC", "de_DE.UTF-8");
    said(&command.env(PROGRAM_VARIABLE, &program).output().unwrap(), exit_code::DONE);
    assert_eq!(fs::read_to_string(case.path().join("locale.txt")).unwrap(), "LC_ALL=C\n");
    assert!(fs::read_to_string(case.path().join("screen.txt")).unwrap().contains("0.05 0.05 0.1"));
}

#[test]
fn an_exit_status_of_zero_is_not_trusted() {
    let end = "print \"tollgate end time ${st}\"";
    assert_says(&failure(&Case::new(4, &[(end, "")]), SERIAL), &["at time step 400 without a word"]);
    let text = failure(&Case::new(3, &[]), SERIAL);
    assert_says(&text, &["ended at time step 300", "400 were asked for"]);
    let mut hasty = in_process(Case::new(1, &[]).path(), SERIAL);
    let folder = tempfile::tempdir().unwrap();
    let case = Case::new(1, &[]);
    hasty.env("TOLLGATE_TEST_CASE", case.path()).env(PROGRAM_VARIABLE, stand_in(folder.path(), "exit 0"));
    let text = said(&hasty.output().unwrap(), exit_code::BACKEND_FAILED);
    assert_says(&text, &["before its first time step", "its deck was not at its end"]);
}

/// A full pipe would stop the program for ever.
#[test]
fn megabytes_of_output_do_not_block() {
    let case = Case::new(1, &[]);
    let noise = "yes 'WARNING: noise on stderr and stdout' | head -c 8000000 | tee /dev/stderr; exit 3";
    let program = stand_in(case.path(), noise);
    let mut command = in_process(case.path(), SERIAL);
    let child = command.env(PROGRAM_VARIABLE, &program).process_group(0).stderr(Stdio::piped()).spawn().unwrap();
    let text = said(&child.wait_with_output().unwrap(), exit_code::BACKEND_FAILED);
    assert_says(&text, &["exit status: 3", "noise on stderr"]);
    assert_eq!(fs::metadata(case.path().join("screen.txt")).unwrap().len(), 16_000_000);
}
