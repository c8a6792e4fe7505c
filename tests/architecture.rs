//! The shape of the source tree: imports point down the list of rooms, files have one subject, nothing is left half
//! done. Every violation is listed with its file and line.
#![expect(clippy::unwrap_used, reason = "a test fails by panicking")]

use regex::Regex;
use std::collections::BTreeSet;
use std::fs;
use std::path::{Path, PathBuf};

/// Rooms from top to bottom; a room may import the rooms of lower rows. Its own row only where [`BESIDE`] says so.
const ROOMS: [&[&str]; 17] = [
    &["main", "cli"],
    &["campaign"],
    &["run"],
    &["verify"],
    &["report"],
    &["analysis"],
    &["backend"],
    &["output"],
    &["plan"],
    &["stage"],
    &["gate"],
    &["scene"],
    &["dem", "breakage"],
    &["shape"],
    &["storage"],
    &["geometry"],
    &["particle", "material", "units", "math", "exit_code"],
];

/// Rooms that may import particular rooms of their own row.
const BESIDE: [(&str, &[&str]); 6] = [
    ("main", &["cli"]),
    ("dem", &["breakage"]),
    ("particle", &["math", "units"]),
    ("material", &["math", "units"]),
    ("units", &["math"]),
    ("cli", &[]),
];

/// Rooms that may import less than the rows below them.
const ONLY: [(&str, &[&str]); 4] =
    [("geometry", &["math"]), ("shape", &["math", "geometry"]), ("math", &[]), ("exit_code", &[])];

/// What of `dem` describes rather than computes, and may be used from above.
const DESCRIPTIVE_DEM: [&str; 3] = ["law", "feed", "timescale"];

/// Who may run the solver: the backend made of it, and the suite that checks it contact by contact.
const RUNS_THE_SOLVER: [&str; 2] = ["src/backend/native", "src/verify"];

/// Longest file before its tests [lines].
const FILE_LIMIT: usize = 500;

#[derive(Debug, PartialEq, Eq)]
struct Violation {
    place: String,
    what: String,
}

#[test]
fn the_source_tree_keeps_its_shape() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let mut violations = Vec::new();
    let mut files = 0;
    for folder in ["src", "tests", "benches"] {
        for path in rust_files(&root.join(folder)) {
            let name = path.strip_prefix(root).unwrap().to_str().unwrap().replace('\\', "/");
            violations.extend(check(&name, &fs::read_to_string(&path).unwrap()));
            files += 1;
        }
    }
    assert!(files > 10, "only {files} files found under {}", root.display());
    let list: Vec<String> = violations.iter().map(|found| format!("{}: {}", found.place, found.what)).collect();
    assert!(list.is_empty(), "{} violations:\n{}", list.len(), list.join("\n"));
}

fn rust_files(folder: &Path) -> Vec<PathBuf> {
    let Ok(entries) = fs::read_dir(folder) else { return Vec::new() };
    let mut paths: Vec<PathBuf> = entries.map(|entry| entry.unwrap().path()).collect();
    paths.sort();
    let mut files = Vec::new();
    for path in paths {
        if path.is_dir() {
            files.extend(rust_files(&path));
        } else if path.extension().is_some_and(|extension| extension == "rs") {
            files.push(path);
        }
    }
    files
}

/// All violations of one file; `name` is its path from the repository's root.
fn check(name: &str, source: &str) -> Vec<Violation> {
    let bare = without_comments_and_text(source);
    let mut violations = unfinished(name, &bare);
    if !name.starts_with("src/") || name.ends_with("/tests.rs") || name.contains("/tests/") {
        return violations;
    }
    let code = without_test_modules(&bare);
    let length = code.trim_end().lines().count();
    let before_tests = bare.lines().position(|line| line.trim() == "#[cfg(test)]").unwrap_or(length).min(length);
    if before_tests > FILE_LIMIT {
        let what = format!("{before_tests} lines before the tests; the limit is {FILE_LIMIT}: split it by subject");
        violations.push(Violation { place: format!("{name}:{before_tests}"), what });
    }
    for (line, path) in imports(&code, &module_path(name)) {
        if let Some(what) = forbidden(name, &path) {
            violations.push(Violation { place: format!("{name}:{line}"), what });
        }
    }
    violations
}

/// Words that mean that something is missing or hidden.
fn unfinished(name: &str, bare: &str) -> Vec<Violation> {
    let banned = Regex::new(r"(?-u:\b)(?:todo|unimplemented)(?-u:\s)*!|#!?\[(?-u:\s)*allow(?-u:\s)*\(").unwrap();
    let reason = |word: &str| {
        if word.contains("allow") { "use #[expect(.., reason = \"..\")] instead of" } else { "not done yet:" }
    };
    banned
        .find_iter(bare)
        .map(|found| Violation {
            place: format!("{name}:{}", line_of(bare, found.start())),
            what: format!("{} {}", reason(found.as_str()), found.as_str()),
        })
        .collect()
}

/// Why a file may not import `path` (segments after `crate`), if it may not.
fn forbidden(name: &str, path: &[String]) -> Option<String> {
    let own = room_of(name);
    let target = path.first().map(String::as_str)?;
    if own == "lib" {
        return None;
    }
    let Some(own_row) = row(own) else { return Some(format!("the room {own:?} is not in the table of rooms")) };
    let Some(target_row) = row(target) else {
        return Some(format!("crate::{target} is not in the table of rooms"));
    };
    if own == target {
        return None;
    }
    let beside = BESIDE.iter().any(|(room, others)| *room == own && others.contains(&target));
    let narrowed = ONLY.iter().find(|(room, _)| *room == own).is_some_and(|(_, rooms)| !rooms.contains(&target));
    if narrowed || (target_row <= own_row && !beside) {
        return Some(format!("{own} must not import {target}: {}", path.join("::")));
    }
    let describes = path.get(1).is_some_and(|second| DESCRIPTIVE_DEM.contains(&second.as_str()));
    if target == "dem" && !describes && !RUNS_THE_SOLVER.iter().any(|place| is_within(name, place)) {
        return Some(format!("{own} must not import the solver: {}", path.join("::")));
    }
    None
}

fn is_within(name: &str, place: &str) -> bool {
    name.strip_prefix(place).is_some_and(|rest| rest.starts_with('/') || rest == ".rs")
}

fn row(room: &str) -> Option<usize> {
    ROOMS.iter().position(|rooms| rooms.contains(&room))
}

fn room_of(name: &str) -> &str {
    name.trim_start_matches("src/").split('/').next().unwrap_or_default().trim_end_matches(".rs")
}

/// Module path of a file: `src/dem/law/mod.rs` is `dem::law`.
fn module_path(name: &str) -> Vec<String> {
    let inner = name.trim_start_matches("src/").trim_end_matches(".rs");
    let mut path: Vec<String> = inner.split('/').map(str::to_owned).collect();
    if path.last().is_some_and(|last| last == "mod") || path == ["lib"] {
        path.pop();
    }
    path
}

/// Line and path (segments after `crate`) of everything the code names by `crate::` or `super::`.
fn imports(code: &str, module: &[String]) -> BTreeSet<(usize, Vec<String>)> {
    let start = Regex::new(r"(?-u:\b)(?:crate|super|tollgate)(?-u:\s)*::").unwrap();
    let mut found = BTreeSet::new();
    for begin in start.find_iter(code) {
        // The rest of a path that has been followed already: super::super::.
        if code[..begin.start()].trim_end().ends_with("::") {
            continue;
        }
        let above = &module[..module.len().saturating_sub(1)];
        let prefix = if begin.as_str().starts_with("super") { above } else { &[] };
        let line = line_of(code, begin.start());
        let mut paths = Vec::new();
        read_tree(&code[begin.end()..], prefix, &mut paths);
        found.extend(paths.into_iter().map(|path| (line, path)));
    }
    found
}

/// Follows a path or a `use` tree from its first segment; returns what is left of the text.
fn read_tree<'a>(text: &'a str, prefix: &[String], paths: &mut Vec<Vec<String>>) -> &'a str {
    let mut rest = text.trim_start();
    let mut path = prefix.to_vec();
    loop {
        if let Some(inside) = rest.strip_prefix('{') {
            rest = inside.trim_start();
            while !rest.is_empty() && !rest.starts_with('}') {
                let before = rest.len();
                rest = read_tree(rest, &path, paths).trim_start();
                rest = rest.strip_prefix(',').unwrap_or(rest).trim_start();
                if rest.len() == before {
                    break;
                }
            }
            return rest.strip_prefix('}').unwrap_or(rest);
        }
        let length = rest.find(|c: char| !(c.is_alphanumeric() || c == '_' || c == '*')).unwrap_or(rest.len());
        let (segment, after) = rest.split_at(length);
        match segment {
            "" | "self" => {}
            "super" => drop(path.pop()),
            _ => path.push(segment.to_owned()),
        }
        let after = after.trim_start();
        match after.strip_prefix("::") {
            Some(next) if !next.trim_start().starts_with('<') => rest = next.trim_start(),
            _ => {
                paths.push(path);
                let renamed = after.strip_prefix("as ").map(str::trim_start);
                let is_name = |c: char| c.is_alphanumeric() || c == '_';
                return renamed.map_or(after, |name| name.trim_start_matches(is_name));
            }
        }
    }
}

fn line_of(text: &str, at: usize) -> usize {
    1 + text[..at].matches('\n').count()
}

/// The source with comments, strings and characters blanked; lines stay where they are.
fn without_comments_and_text(source: &str) -> String {
    let pattern = concat!(
        r##"(?s)//[^\n]*|/\*.*?\*/|b?r#+".*?"#+|b?r"[^"]*"|b?"(?:\\.|[^"\\])*""##,
        r"|b?'(?:\\u\{[0-9a-fA-F]+\}|\\x..|\\.|[^'\\\n])'"
    );
    let blank = |found: &regex::Captures| {
        found[0].chars().map(|character| if character == '\n' { '\n' } else { ' ' }).collect::<String>()
    };
    Regex::new(pattern).unwrap().replace_all(source, blank).into_owned()
}

/// Blanks the modules under `#[cfg(test)]`; expects source without comments and text.
fn without_test_modules(bare: &str) -> String {
    // The build of `regex` has no Unicode tables: classes are asked for in ASCII.
    let start =
        r"#\[cfg\(test\)\](?-u:\s)*(?:#\[[^\]]*\](?-u:\s)*)*(?:pub(?:\([a-z]+\))?(?-u:\s)+)?mod(?-u:\s+\w+\s*)\{";
    let start = Regex::new(start).unwrap();
    let mut code = bare.to_owned();
    while let Some(found) = start.find(&code) {
        let (begin, open) = (found.start(), found.end());
        let mut depth = 1;
        let close = code[open..].find(|c| {
            depth += i32::from(c == '{') - i32::from(c == '}');
            depth == 0
        });
        let end = close.map_or(code.len(), |close| open + close + 1);
        let blank: String = code[begin..end].chars().map(|c| if c == '\n' { '\n' } else { ' ' }).collect();
        code.replace_range(begin..end, &blank);
    }
    code
}

mod the_checker {
    use super::*;

    fn found(name: &str, source: &str) -> Vec<String> {
        check(name, source).into_iter().map(|violation| format!("{}: {}", violation.place, violation.what)).collect()
    }

    #[test]
    fn sees_an_upward_import_wherever_it_hides() {
        let cases = [
            "use crate::scene::Scene;",
            "use crate::{math::Vec3, scene::{self, Scene}};",
            "pub use crate::scene::*;",
            "fn f() { let x = crate::scene::read(1); }",
            "fn f(x: &super::super::scene::Scene) {}",
            "use super::{super::scene::Scene, law};",
            "use crate :: scene :: Scene ;",
            "#[cfg(test)]\nmod tests { fn f() { } }\nuse crate::scene::Scene;",
            "const QUOTE: char = '\"'; use crate::scene::Scene; const OTHER: char = '\"';",
            "fn f<'a>(x: &'a str, y: &'a crate::scene::Scene) {}",
        ];
        for source in cases {
            let violations = found("src/dem/step.rs", source);
            assert_eq!(violations.len(), 1 + source.matches("self, ").count(), "{source}\n{violations:?}");
            assert!(violations[0].contains("dem must not import scene"), "{violations:?}");
        }
        assert_eq!(
            found("src/dem/step.rs", "//! Doc.\n\nuse crate::math::Vec3;\nuse crate::run::Run;\n"),
            ["src/dem/step.rs:4: dem must not import run: run::Run"]
        );
    }

    #[test]
    fn lets_downward_imports_pass_and_whatever_is_not_code() {
        let passes = [
            ("src/dem/step.rs", "use crate::{geometry::part::Part, math::Vec3, particle::ParticleState};"),
            ("src/dem/law/hertz.rs", "use super::super::contact::Contact; use super::LawSettings;"),
            ("src/scene/mod.rs", "use crate::dem::law::LawSettings; use crate::dem::{feed::Feed, timescale};"),
            ("src/backend/native/mod.rs", "use crate::dem::simulation::Simulation;"),
            ("src/backend/native.rs", "use crate::dem::simulation::Simulation;"),
            (
                "src/dem/step.rs",
                "/// See [`crate::scene::Scene`].\n/* crate::run */ const X: &str = \"crate::run::x\";",
            ),
            (
                "src/dem/step.rs",
                "#[cfg(test)]\nmod tests {\n    use crate::scene::Scene;\n    fn f() { if a { b } }\n}",
            ),
            ("src/dem/tests.rs", "use crate::scene::Scene;"),
            ("src/lib.rs", "pub mod scene;"),
            ("src/particle.rs", "use crate::math::Vec3;"),
        ];
        for (name, source) in passes {
            assert_eq!(found(name, source), Vec::<String>::new(), "{name}: {source}");
        }
    }

    #[test]
    fn keeps_the_solver_to_those_who_may_run_it() {
        for name in ["src/scene/mod.rs", "src/analysis/heap.rs", "src/run.rs", "src/backend/native_like.rs"] {
            for source in ["use crate::dem::simulation::Simulation;", "use crate::dem;", "use crate::dem::*;"] {
                let violations = found(name, source);
                assert!(
                    violations.len() == 1 && violations[0].contains("must not import the solver"),
                    "{violations:?}"
                );
            }
        }
    }

    #[test]
    fn keeps_the_ground_floor_in_order() {
        assert_eq!(found("src/geometry/stl.rs", "use crate::particle::ParticleId;").len(), 1);
        assert_eq!(found("src/geometry/stl.rs", "use crate::math::Vec3;").len(), 0);
        assert_eq!(found("src/math/mod.rs", "use crate::exit_code::DONE;").len(), 1);
        assert_eq!(found("src/material.rs", "use crate::particle::ParticleId;").len(), 1);
        assert_eq!(found("src/new_room.rs", "use crate::math::Vec3;").len(), 1, "a room nobody placed");
        assert_eq!(found("src/run.rs", "use crate::new_room::X;").len(), 1);
    }

    #[test]
    fn sees_what_is_not_done_and_what_is_hushed() {
        let words = ["todo", "unimplemented"].map(|word| format!("fn f() {{\n    {word}!()\n}}"));
        for source in words.iter().map(String::as_str).chain(["\n#[allow(dead_code)]", "\n#![ allow (x)]"]) {
            for name in ["src/math/mod.rs", "tests/a.rs"] {
                let violations = found(name, source);
                assert_eq!(violations.len(), 1, "{source}");
                assert!(violations[0].starts_with(&format!("{name}:2: ")), "{violations:?}");
            }
        }
        assert!(found("src/math/mod.rs", "// todo! later\n#[expect(dead_code, reason = \"#[allow(x)]\")]").is_empty());
    }

    #[test]
    fn counts_the_lines_before_the_tests() {
        let code = "const A: u8 = 1;\n";
        let tests = "#[cfg(test)]\nmod tests {\n";
        let long = |lines: usize| code.repeat(lines) + tests + &code.repeat(900) + "}\n";
        assert!(found("src/math/mod.rs", &long(FILE_LIMIT)).is_empty());
        let violations = found("src/math/mod.rs", &long(FILE_LIMIT + 1));
        assert!(violations.len() == 1 && violations[0].starts_with("src/math/mod.rs:501: "), "{violations:?}");
    }
}
