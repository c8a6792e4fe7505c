//! `tollgate doctor`, where LIGGGHTS is there, is not, or is another.

use crate::faults::{PROGRAM_VARIABLE, stand_in};
use std::ffi::OsStr;
use std::process::Command;
use tollgate::backend::liggghts::probe::{self, Kind};

const PROGRAM: &str = env!("CARGO_BIN_EXE_tollgate");

/// What it says; it ends with 0 as long as our own solver works.
fn doctor(options: &[&str], liggghts: Option<&OsStr>) -> String {
    let mut command = Command::new(PROGRAM);
    command.arg("doctor").args(options).env_remove(PROGRAM_VARIABLE);
    liggghts.map(|program| command.env(PROGRAM_VARIABLE, program));
    let output = command.output().unwrap();
    assert!(output.status.success(), "{output:?}");
    String::from_utf8(output.stdout).unwrap()
}

fn json(liggghts: Option<&OsStr>) -> serde_json::Value {
    serde_json::from_str(&doctor(&["--json"], liggghts)).unwrap()
}

#[test]
fn debians_program_has_what_decks_need() {
    let found = probe::probe().unwrap();
    assert_eq!(found.lacking(), []);
    assert!(found.version.starts_with(probe::KNOWN_VERSIONS));
    assert!(found.knows(Kind::Cohesion, "sjkr") && !found.knows(Kind::Fix, "insert/stream/predefined"));
    assert_eq!(found.tools.missing(2), None);
    let text = doctor(&[], None);
    for wanted in
        ["native    works", "liggghts  has what decks need", "hertz/stiffness", "cdt, epsd", "mpirun: /", "yade "]
    {
        assert!(text.contains(wanted), "{wanted:?} is missing in:\n{text}");
    }
    let all = json(None);
    assert_eq!(all["liggghts"]["usable"], true);
    assert_eq!(all["liggghts"]["version"], found.version);
    assert!(all["liggghts"]["tools"]["setpriv"].is_string() && all["native"]["threads"].as_u64() > Some(0), "{all:#}");
}

#[test]
fn a_missing_program_is_no_failure_of_the_doctors() {
    let text = doctor(&[], Some(OsStr::new("/nowhere/liggghts")));
    assert!(text.contains("not usable") && text.contains("apt-get install liggghts"), "{text}");
    let all = json(Some(OsStr::new("/nowhere/liggghts")));
    assert_eq!((&all["liggghts"]["usable"], &all["native"]["usable"]), (&false.into(), &true.into()));
}

#[test]
fn programs_that_are_none_and_other_versions_are_told() {
    let folder = tempfile::tempdir().unwrap();
    let told = [
        (
            "echo 'LIGGGHTS (Version LIGGGHTS-PUBLIC 3.6.1, compiled 2018 by x)'",
            "is LIGGGHTS 3.6.1; version 3.8.x is needed",
        ),
        ("echo hello", "`-h` does not tell its version but \"hello\""),
        ("sleep 0.1; kill -9 $$", "no usable LIGGGHTS"),
    ];
    for (script, wanted) in told {
        let text = doctor(&[], Some(stand_in(folder.path(), script).as_os_str()));
        assert!(text.contains(wanted), "{wanted:?} is missing in:\n{text}");
    }
}

#[test]
fn what_a_program_lacks_is_named() {
    let folder = tempfile::tempdir().unwrap();
    let program = stand_in(folder.path(), "/usr/bin/liggghts \"$@\" | sed 's/epsd2/epsd9/; s/move.mesh /other /'");
    let text = doctor(&[], Some(program.as_os_str()));
    for wanted in ["LACKS WHAT DECKS NEED", "Rolling models for pair gran: epsd2", "Fix styles: move/mesh"] {
        assert!(text.contains(wanted), "{wanted:?} is missing in:\n{text}");
    }
    assert_eq!(json(Some(program.as_os_str()))["liggghts"]["lacking"].as_array().unwrap().len(), 2);
}
