//! The corpus of scenes: bad ones say which findings they must get, good ones must resolve.
//!
//! A file of `scenes/bad` holds cases apart by a line `+++`. In a case, `#^ text` is a finding of the line above, and
//! `#! --set key=value` an override of the case. Every finding must be stated, and every stated one found.

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};
use tollgate::scene::{Finding, diagnostics, read, read_text};

const BAD: &str = "tests/scenes/bad";
const GOOD: &str = "tests/scenes/good";

fn files(folder: &str) -> Vec<PathBuf> {
    let mut found: Vec<PathBuf> = std::fs::read_dir(folder)
        .unwrap_or_else(|error| panic!("{folder}: {error}"))
        .map(|entry| entry.expect("an entry").path())
        .filter(|path| path.extension().is_some_and(|extension| extension == "toml"))
        .collect();
    found.sort();
    assert!(!found.is_empty(), "{folder} holds no scenes");
    found
}

/// What a case states: (line, text); line 0 for overrides.
fn stated(case: &str) -> Vec<(usize, String)> {
    let mut found = Vec::new();
    let mut above = 0;
    for (index, line) in case.lines().enumerate() {
        if let Some(text) = line.strip_prefix("#^ ") {
            found.push((above, text.to_owned()));
        } else {
            above = if line.starts_with("#! ") { 0 } else { index + 1 };
        }
    }
    found
}

fn settings(case: &str) -> Vec<(String, String)> {
    let set = |line: &str| {
        let (key, value) = line.strip_prefix("#! --set ")?.split_once('=')?;
        Some((key.to_owned(), value.to_owned()))
    };
    case.lines().filter_map(set).collect()
}

fn findings(case: &str) -> Vec<Finding> {
    match read_text(case, "scene.toml", Path::new(BAD), &settings(case)) {
        Ok((_, warnings)) => warnings,
        Err(findings) => findings,
    }
}

#[test]
fn bad_scenes_get_exactly_the_findings_they_state() {
    let mut wrong = Vec::new();
    for path in files(BAD) {
        let text = std::fs::read_to_string(&path).expect("a readable file");
        for (number, case) in text.split("\n+++\n").enumerate() {
            let mut expected = stated(case);
            assert!(!expected.is_empty(), "{} case {number} states nothing", path.display());
            let mut got: Vec<(usize, String)> = findings(case).into_iter().map(|f| (f.line, f.what)).collect();
            expected.sort();
            got.sort();
            if expected != got {
                wrong.push(format!("{} case {number}\n  stated {expected:#?}\n  found {got:#?}", path.display()));
            }
        }
    }
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}

#[test]
fn every_finding_has_a_bad_scene() {
    let mut met: BTreeSet<&str> = BTreeSet::new();
    for path in files(BAD) {
        let text = std::fs::read_to_string(&path).expect("a readable file");
        for case in text.split("\n+++\n") {
            met.extend(findings(case).iter().map(|finding| finding.rule));
        }
    }
    // A scene that is not there cannot stand in the corpus.
    let missing = read(Path::new("tests/scenes/nowhere"), &[]).expect_err("there is no such scene");
    assert_eq!(missing.len(), 1);
    assert!(missing[0].what.starts_with("the scene \"tests/scenes/nowhere\" cannot be read: "), "{}", missing[0].what);
    met.insert(missing[0].rule);
    let without: Vec<&&str> = diagnostics::ALL_IDS.iter().filter(|id| !met.contains(**id)).collect();
    assert!(without.is_empty(), "no bad scene for {without:?}");
}

#[test]
fn every_finding_says_what_to_do_next_and_is_explained() {
    let page = std::fs::read_to_string("docs/rules.md").expect("the page of rules");
    for id in diagnostics::ALL_IDS {
        assert!(page.contains(&format!("`{id}`")), "docs/rules.md does not explain `{id}`");
    }
    for path in files(BAD) {
        let text = std::fs::read_to_string(&path).expect("a readable file");
        for case in text.split("\n+++\n") {
            for finding in findings(case) {
                assert!(!finding.next.is_empty(), "{}: {}", path.display(), finding.what);
                let rendered = diagnostics::render(std::slice::from_ref(&finding), case);
                assert!(rendered.contains(finding.rule) && rendered.contains("next: "), "{rendered}");
                if finding.line > 0 {
                    let place = format!("scene.toml:{}:{}", finding.line, finding.column);
                    assert!(rendered.contains(&place), "{place} is not in\n{rendered}");
                }
            }
        }
    }
}

#[test]
fn good_scenes_resolve() {
    for path in files(GOOD) {
        match read(&path, &[]) {
            Ok((_, warnings)) => assert!(
                warnings.iter().all(|warning| warning.rule == "stl-open"),
                "{}",
                diagnostics::render(&warnings, &std::fs::read_to_string(&path).expect("readable"))
            ),
            Err(findings) => {
                panic!("{}", diagnostics::render(&findings, &std::fs::read_to_string(&path).expect("readable")))
            }
        }
    }
}

#[test]
fn the_default_scene_resolves_without_a_warning() {
    let (scene, warnings) = read(Path::new("templates/scene.default.toml"), &[]).expect("a valid scene");
    assert_eq!(warnings, []);
    assert_eq!(scene.name, "box");
    assert!(scene.output.frame_interval.is_some() && !scene.measures.is_empty());
}
