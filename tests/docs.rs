//! What the documentation shows runs: commands against the program, scenes against the reader, links and lists against the tree.
//!
//! Marked commands (```` ```sh runnable ````) run in one temporary folder a page, in the page's order; a block that is called
//! ```` ```toml NAME ```` is there under that name. A `toml` block that starts with `version` is a whole scene; any other is judged
//! by what it says, not by what it leaves out. One that is called `campaign.toml` is a campaign, or a piece of one.
#![expect(clippy::unwrap_used, reason = "a test fails by panicking")]

use regex::Regex;
use std::collections::BTreeSet;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;
use tollgate::scene::{Finding, Severity, read_text};

const PROGRAM: &str = env!("CARGO_BIN_EXE_tollgate");
/// What a fragment may lack: a whole scene has it elsewhere.
const LACKING: [&str; 6] =
    ["missing-key", "unknown-name", "pair-missing", "density-missing", "elasticity-missing", "characteristic-velocity"];

/// A fenced block.
#[derive(Debug, Clone, PartialEq)]
struct Block {
    /// Line of its first line of text, from 1.
    line: usize,
    /// What stands behind the fence.
    language: String,
    text: String,
}

/// All fenced blocks of a page.
fn blocks(page: &str) -> Result<Vec<Block>, String> {
    let mut found: Vec<Block> = Vec::new();
    let mut open: Option<Block> = None;
    for (number, line) in page.lines().enumerate() {
        match (line.strip_prefix("```"), &mut open) {
            (Some(language), None) => {
                open = Some(Block { line: number + 2, language: language.trim().to_owned(), text: String::new() });
            }
            (Some(_), Some(_)) => found.extend(open.take()),
            (None, Some(block)) => {
                block.text += line;
                block.text.push('\n');
            }
            (None, None) => {}
        }
    }
    match open {
        Some(block) => Err(format!("the block of line {} has no end", block.line)),
        None => Ok(found),
    }
}

fn root() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR"))
}

/// README, ARCHITECTURE, CHANGELOG and all of docs and examples.
fn pages() -> Vec<PathBuf> {
    let mut pages = Vec::new();
    let mut folders = vec![root().join("docs"), root().join("examples")];
    while let Some(folder) = folders.pop() {
        for entry in fs::read_dir(&folder).unwrap() {
            let path = entry.unwrap().path();
            if path.is_dir() {
                folders.push(path);
            } else if path.extension().is_some_and(|extension| extension == "md") {
                pages.push(path);
            }
        }
    }
    pages.extend(["README.md", "ARCHITECTURE.md", "CHANGELOG.md"].map(|name| root().join(name)));
    pages.sort();
    pages
}

fn name_of(page: &Path) -> String {
    page.strip_prefix(root()).unwrap().display().to_string()
}

fn blocks_of(page: &Path) -> Vec<Block> {
    blocks(&fs::read_to_string(page).unwrap()).unwrap_or_else(|reason| panic!("{}: {reason}", page.display()))
}

/// The commands of a block that is marked to be run, as a script; `None` for any other block.
fn script(block: &Block) -> Option<String> {
    let mut words = block.language.split_whitespace();
    match (words.next()?, words.next()) {
        ("sh", Some("runnable")) => Some(block.text.clone()),
        ("console", Some("runnable")) => Some(
            block.text.lines().filter_map(|line| line.strip_prefix("$ ")).map(|line| format!("{line}\n")).collect(),
        ),
        _ => None,
    }
}

/// Runs a script in `folder` with the program under test first in the search path.
fn run_script(script: &str, folder: &Path) -> Result<(), String> {
    let own = Path::new(PROGRAM).parent().unwrap();
    let others = std::env::var_os("PATH").unwrap_or_default();
    let search = std::env::join_paths(std::iter::once(own.to_path_buf()).chain(std::env::split_paths(&others)));
    let output =
        Command::new("sh").args(["-euc", script]).current_dir(folder).env("PATH", search.unwrap()).output().unwrap();
    if output.status.success() {
        return Ok(());
    }
    Err(format!("{}\n{}{}", output.status, text(&output.stdout), text(&output.stderr)))
}

fn text(bytes: &[u8]) -> String {
    String::from_utf8_lossy(bytes).into_owned()
}

/// Why a `toml` block is wrong, if it is.
fn wrong_scene(block: &str, base: &Path) -> Option<String> {
    let is_whole = block.lines().any(|line| line.starts_with("version"));
    let findings = read_text(block, "scene.toml", base, &[]).err()?;
    let counts = |f: &Finding| f.severity == Severity::Error && (is_whole || !LACKING.contains(&f.rule));
    let wrong: Vec<String> =
        findings.iter().filter(|f| counts(f)).map(|f| format!("{}: {}; {}", f.line, f.what, f.next)).collect();
    (!wrong.is_empty()).then(|| wrong.join("\n"))
}

/// Why a block of a campaign is wrong, if it is; files that it names are beside those of the tests.
fn wrong_campaign(block: &str) -> Option<String> {
    let is_whole = block.lines().any(|line| line.starts_with("version"));
    let text = if is_whole { block.to_owned() } else { format!("version = 1\n{block}") };
    match tollgate::campaign::file::read_text(&text, &root().join("tests/campaigns/campaign.toml")) {
        Ok(_) => None,
        Err(error) => Some(error.to_string()),
    }
}

#[test]
fn commands_of_the_documentation_run() {
    let mut ran = 0;
    for page in pages() {
        let folder = tempfile::tempdir().unwrap();
        for block in blocks_of(&page) {
            if let Some(("toml", name)) = block.language.split_once(' ') {
                fs::write(folder.path().join(name), &block.text).unwrap();
            }
            let Some(script) = script(&block) else { continue };
            ran += 1;
            if let Err(reason) = run_script(&script, folder.path()) {
                panic!("{}:{}: {script}{reason}", name_of(&page), block.line);
            }
        }
    }
    assert!(ran >= 3, "only {ran} blocks are marked to be run");
}

#[test]
fn scenes_of_the_documentation_are_read() {
    let mut read = 0;
    for page in pages() {
        for block in blocks_of(&page).iter().filter(|block| block.language.split(' ').next() == Some("toml")) {
            read += 1;
            let is_campaign = block.language.ends_with(" campaign.toml");
            let wrong = if is_campaign { wrong_campaign(&block.text) } else { wrong_scene(&block.text, root()) };
            if let Some(wrong) = wrong {
                panic!("{}:{}:\n{wrong}", name_of(&page), block.line);
            }
        }
    }
    assert!(read >= 2, "only {read} scenes found");
}

/// The long command of the first page is not run: its folder is there, and its scene has no error.
#[test]
fn the_example_of_the_first_page_passes_its_check() {
    let page = fs::read_to_string(root().join("README.md")).unwrap();
    let command = Regex::new(r"(?m)^cargo run --release -- run (examples/[a-z-]+)$").unwrap();
    let example = command.captures(&page).expect("README.md shows the example's command")[1].to_owned();
    let output = Command::new(PROGRAM).args(["check", &example]).current_dir(root()).output().unwrap();
    assert!(output.status.success(), "{}", text(&output.stderr));
    assert!(text(&output.stdout).starts_with("0 errors"), "{}", text(&output.stdout));
}

/// Pictures are left out: they are made by long runs.
#[test]
fn links_lead_somewhere() {
    let link = Regex::new(r"(!?)\[[^\]]*\]\(([^)#]+)(?:#[^)]*)?\)").unwrap();
    let mut dead = Vec::new();
    for page in pages() {
        for found in link.captures_iter(&fs::read_to_string(&page).unwrap()) {
            let target = &found[2];
            let is_here = found[1].is_empty() && !target.contains("://");
            if is_here && !page.parent().unwrap().join(target).exists() {
                dead.push(format!("{}: {target}", name_of(&page)));
            }
        }
    }
    assert!(dead.is_empty(), "{}", dead.join("\n"));
}

/// Source files that a page names in backticks are there; NAME stands for one to be written.
#[test]
fn named_source_files_exist() {
    let named = Regex::new(r"`((?:src|tests|benches|templates|examples|liggghts_inputs)/[A-Za-z0-9_./-]+)`").unwrap();
    let mut gone = Vec::new();
    for page in pages() {
        for found in named.captures_iter(&fs::read_to_string(&page).unwrap()) {
            if !found[1].contains("NAME") && !root().join(&found[1]).exists() {
                gone.push(format!("{}: {}", name_of(&page), &found[1]));
            }
        }
    }
    assert!(gone.is_empty(), "{}", gone.join("\n"));
}

#[test]
fn every_exit_code_is_explained() {
    let page = fs::read_to_string(root().join("README.md")).unwrap();
    let source = fs::read_to_string(root().join("src/exit_code.rs")).unwrap();
    let constant = Regex::new(r"pub const ([A-Z_]+): u8 = ([0-9]+);").unwrap();
    let missing: Vec<String> = constant
        .captures_iter(&source)
        .filter(|found| !page.contains(&format!("\n| {} | ", &found[2])))
        .map(|found| found[1].to_owned())
        .collect();
    assert!(constant.is_match(&source) && missing.is_empty(), "README.md does not explain {missing:?}");
}

/// Everything that a run with all outputs writes stands in `docs/formats.md`: files, columns, arrays, fields.
#[test]
fn the_page_of_formats_knows_everything_that_is_written() {
    let folder = tempfile::tempdir().unwrap();
    let script = "tollgate init box && tollgate run box --out out --set end.time='0.004 s' --set end.at_rest.not_before='0 s' \
                  --set end.at_rest.hold='1 ms' --set output.series='2 ms' \
                  --set 'output.formats=[\"vtp\", \"lammps\"]' --set output.contacts=true --set output.energy=true";
    run_script(script, folder.path()).unwrap();
    judge_names(written(&folder.path().join("out")));
}

fn judge_names(names: BTreeSet<String>) {
    let page = fs::read_to_string(root().join("docs/formats.md")).unwrap();
    let known: BTreeSet<&str> =
        Regex::new("`([^`\n]+)`").unwrap().captures_iter(&page).map(|c| c.get(1).unwrap().as_str()).collect();
    let unknown: Vec<String> = names.into_iter().filter(|name| !known.contains(name.as_str())).collect();
    assert!(unknown.is_empty(), "docs/formats.md does not explain {unknown:?}");
}

/// The same of a scene that is cut: folders of stages and streams, gates with their ledgers and accounts, load, replicates.
#[test]
fn the_page_of_formats_knows_everything_about_gates() {
    const CUT: &str = "[[gate]]\nname = \"middle\"\npoint_mm = [0, 0, 60]\nnormal = [0, 0, -1]\n\
                       [[stage]]\nname = \"upper\"\nrecords = [\"middle\"]\n\
                       [[stage]]\nname = \"lower\"\n[[stage.replay]]\ngate = \"middle\"\n";
    let folder = tempfile::tempdir().unwrap();
    run_script("tollgate init box", folder.path()).unwrap();
    let scene = folder.path().join("box/scene.toml");
    fs::write(&scene, fs::read_to_string(&scene).unwrap() + CUT).unwrap();
    // From 10 to 60 mm above the gate: all fall through it within 0.11 s.
    let script = "tollgate run box --out out --replicates 2 --set end.time='0.3 s' --set feed.fill.amount=60 \
                  --set feed.fill.region.min_mm=[-50,-50,70]";
    run_script(script, folder.path()).unwrap();
    let out = folder.path().join("out");
    let all = json(&out.join("summary.json"));
    let figure = all["replicates"].as_object().unwrap().values().next().unwrap();
    let mut names: BTreeSet<String> = figure.as_object().unwrap().keys().cloned().collect();
    let one = out.join("replicates/001");
    names.extend(files_of_stages(&one));
    let summary = json(&one.join("summary.json"));
    for part in ["gates", "load"] {
        fields_below(&summary[part], &mut names);
    }
    let manifest = json(&one.join("stages/upper/streams/middle/manifest.json"));
    for part in [&manifest, &manifest["origin"], &manifest["counts"], &manifest["chunks"][0]] {
        names.extend(part.as_object().unwrap().keys().cloned());
    }
    let replayed = &summary["gates"][0]["replayed"][0];
    assert_eq!(replayed["arrivals"]["arrived"]["count"], 60, "{summary:#}");
    assert!(replayed["energy"]["entries"][0].is_object() && names.contains("sums_exact") && names.contains("ratio"));
    judge_names(names);
}

fn json(path: &Path) -> serde_json::Value {
    serde_json::from_slice(&fs::read(path).unwrap()).unwrap()
}

/// Names of all fields at any depth.
fn fields_below(value: &serde_json::Value, names: &mut BTreeSet<String>) {
    for (name, value) in value.as_object().into_iter().flatten() {
        names.insert(name.clone());
        fields_below(value, names);
    }
    value.as_array().into_iter().flatten().for_each(|value| fields_below(value, names));
}

/// Names of all files below a result of several stages, as the page of formats spells them, and the folders they are in.
fn files_of_stages(out: &Path) -> BTreeSet<String> {
    let mut names = BTreeSet::new();
    let stage = Regex::new("^stages/[^/]+/").unwrap();
    let stream = Regex::new("^stages/STAGE/streams/[^/]+/").unwrap();
    let mut folders = vec![out.to_path_buf()];
    while let Some(folder) = folders.pop() {
        for entry in fs::read_dir(&folder).unwrap().map(|entry| entry.unwrap().path()) {
            if entry.is_dir() {
                folders.push(entry);
                continue;
            }
            let below = entry.strip_prefix(out).unwrap().to_str().unwrap();
            let named = stage.replace(below, "stages/STAGE/");
            let named = stream.replace(&named, "stages/STAGE/streams/GATE/").into_owned();
            let (place, file) = ["stages/STAGE/streams/GATE/", "stages/STAGE/", ""]
                .into_iter()
                .find_map(|place| Some((place, named.strip_prefix(place)?)))
                .unwrap();
            names.insert(plain(file));
            names.extend((!place.is_empty()).then(|| place.to_owned()));
        }
    }
    names
}

/// The name of a file or a column, with what depends on the scene or the time replaced as on the page of formats.
fn plain(name: &str) -> String {
    let numbered = Regex::new("(^|/)0_container").unwrap().replace(name, "${1}INDEX_PART").into_owned();
    let named = Regex::new("^container").unwrap().replace(&numbered, "PART").into_owned();
    let chunk = Regex::new("^chunk-[0-9]+").unwrap().replace(&named, "chunk-000000").into_owned();
    if chunk.starts_with("chunk-") {
        chunk
    } else {
        Regex::new("[0-9]{6,}").unwrap().replace(&chunk, "NNNNNN").into_owned()
    }
}

/// Names of all files, columns, arrays and fields under a result folder, as the page of formats spells them.
fn written(out: &Path) -> BTreeSet<String> {
    let mut names = BTreeSet::new();
    for (folder, prefix) in [(out.to_path_buf(), ""), (out.join("frames"), "frames/")] {
        for entry in fs::read_dir(folder).unwrap().map(|entry| entry.unwrap()) {
            if entry.path().is_file() {
                names.insert(format!("{prefix}{}", plain(&entry.file_name().to_string_lossy())));
            }
        }
    }
    let series = fs::read_to_string(out.join("series.csv")).unwrap();
    names.extend(series.lines().next().unwrap().split(',').map(plain));
    let dump = fs::read_to_string(out.join("dump.particles.lammpstrj")).unwrap();
    let columns = dump.lines().find_map(|line| line.strip_prefix("ITEM: ATOMS ")).unwrap();
    names.extend(columns.split(' ').map(str::to_owned));
    let array = Regex::new("Name=\"([^\"]+)\"").unwrap();
    for entry in fs::read_dir(out.join("frames")).unwrap() {
        let frame = text(&fs::read(entry.unwrap().path()).unwrap());
        names.extend(array.captures_iter(&frame).map(|found| found[1].to_owned()));
    }
    // VTK's own words for places and cells
    names.retain(|name| !["Points", "connectivity", "offsets"].contains(&name.as_str()));
    for file in ["summary.json", "run.json"] {
        let value = json(&out.join(file));
        let fields = |value: &serde_json::Value| value.as_object().map(|map| map.keys().cloned().collect::<Vec<_>>());
        names.extend(fields(&value).unwrap());
        for key in ["scene", "outcome", "timing_s"] {
            names.extend(fields(&value[key]).unwrap_or_default());
        }
        for key in ["stages", "feeds"] {
            names.extend(fields(&value[key][0]).unwrap_or_default());
        }
    }
    names
}

mod the_extractor {
    use super::*;

    #[test]
    fn finds_every_block_with_its_line() {
        let page = "a\n```toml\nx = 1\n```\nb\n```sh runnable\ntollgate init\n```\n";
        let toml = Block { line: 3, language: "toml".into(), text: "x = 1\n".into() };
        let sh = Block { line: 7, language: "sh runnable".into(), text: "tollgate init\n".into() };
        assert_eq!(blocks(page).unwrap(), [toml, sh]);
        assert!(blocks("```sh\nnever closed\n").is_err());
    }

    #[test]
    fn runs_marked_commands_only() {
        let block = |language: &str| Block { line: 1, language: language.into(), text: "$ one\ntwo\n".into() };
        assert_eq!(script(&block("sh runnable")).unwrap(), "$ one\ntwo\n");
        assert_eq!(script(&block("console runnable")).unwrap(), "one\n");
        assert_eq!(script(&block("sh")), None);
        assert_eq!(script(&block("toml runnable")), None);
    }

    #[test]
    fn a_broken_command_is_noticed() {
        let folder = tempfile::tempdir().unwrap();
        run_script("tollgate init box\ntollgate check box", folder.path()).unwrap();
        // in the middle of a block, too
        assert!(run_script("tollgate check nowhere\ntollgate check box", folder.path()).is_err());
        assert!(run_script("tollgate run box --no-such-option", folder.path()).is_err());
    }

    #[test]
    fn a_broken_scene_is_noticed() {
        let whole = fs::read_to_string(root().join("templates/scene.default.toml")).unwrap();
        assert_eq!(wrong_scene(&whole, root()), None);
        let broken = whole.replacen("law = ", "lore = ", 1);
        assert!(wrong_scene(&broken, root()).unwrap().contains("lore"));
        let fragment = "[material.glass]\nyoungs_modulus = \"10 MPa\"\npoissons_ratio = 0.25\n";
        assert_eq!(wrong_scene(fragment, root()), None);
        assert!(wrong_scene("[material.glass]\nyoung = 3\n", root()).is_some());
        assert!(wrong_scene("[material.glass]\nyoungs_modulus = \"10 mPam\"\n", root()).is_some());
        assert!(wrong_scene("[material.glass\n", root()).is_some());
        // what a fragment may lack, a whole scene may not
        assert!(wrong_scene("version = 1\n", root()).is_some());
    }
}
