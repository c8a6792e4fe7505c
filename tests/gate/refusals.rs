//! What is no stream of this scene, or no stream at all, is refused with the reason; so is what the command line asks in vain.

use crate::common::{Bench, copy_folder};
use std::fs;
use std::io::{Read, Seek, SeekFrom, Write};
use std::path::Path;
use tollgate::storage::columns::ColumnReader;

/// The small hopper with few particles and a short end: a stream of some dozen crossings.
const SHORT: [&str; 4] = ["--set", "feed.fill.amount=80", "--set", "end.time=0.2 s"];
const STREAM: &str = "a/stages/hopper/streams/outlet";

/// With the upstream stage run into `a`.
fn upstream() -> Bench {
    let bench = Bench::hopper();
    let answer = bench.attempt("a", &[&SHORT[..], &["--stage", "hopper"]].concat());
    assert_eq!(answer.code, 0, "{answer:?}");
    let summary = bench.summary("a");
    assert_eq!(summary.word("/outcome/reason"), "1 of 2 stages not run yet");
    assert!(summary.recorded("outlet")["stream"]["crossings"].as_u64().unwrap() > 10);
    bench
}

fn downstream(bench: &Bench, further: &[&str]) -> crate::common::Answer {
    bench.attempt("a", &[&SHORT[..], &["--stage", "heap"], further].concat())
}

/// Flips the lowest bit of the first number of a column that is not 0.
fn flip(chunk: &Path, column: &str) {
    let reader = ColumnReader::open(chunk, "stream chunk").unwrap();
    let values = reader.vec3s(column).unwrap();
    let numbers: Vec<f64> = values.iter().flat_map(|vector| [vector.x, vector.y, vector.z]).collect();
    let bytes: Vec<u8> = numbers.iter().flat_map(|number| number.to_le_bytes()).collect();
    let mut content = fs::read(chunk).unwrap();
    let start = content.windows(bytes.len()).position(|window| window == bytes).unwrap();
    let index = numbers.iter().position(|number| *number != 0.0).unwrap();
    content[start + 8 * index] ^= 1;
    fs::write(chunk, content).unwrap();
}

/// Each damage is found by `stream check`, and by the stage that is to replay it; with the reason, and nothing is run.
#[test]
fn a_damaged_stream_is_refused_by_the_check_and_by_the_run() {
    let bench = upstream();
    let place = bench.path(STREAM);
    copy_folder(&place, &bench.path("sound"));
    let chunk = place.join("chunk-000000.columns");
    let manifest = place.join("manifest.json");
    let edit = |from: &str, to: &str| {
        let text = fs::read_to_string(&manifest).unwrap();
        assert!(text.contains(from), "no {from} in the manifest");
        fs::write(&manifest, text.replacen(from, to, 1)).unwrap();
    };
    let truncate = || {
        let length = chunk.metadata().unwrap().len();
        fs::OpenOptions::new().write(true).open(&chunk).unwrap().set_len(length - 8).unwrap();
    };
    let remove = || fs::remove_file(&chunk).unwrap();
    let foreign = || fs::write(place.join("chunk-000001.columns"), "x").unwrap();
    let crossings = format!("\"crossings\": {}", bench.summary("a").recorded("outlet")["stream"]["crossings"]);
    let text = fs::read_to_string(&manifest).unwrap();
    let major = if text.contains("\"format_major\": 1") { "\"format_major\": " } else { "\"format_major\":" };
    let force = || flip(&chunk, "force");
    let position = || flip(&chunk, "position");
    let count = || edit(&crossings, &crossings.replace(": ", ": 1"));
    let newer = || edit(&format!("{major}1"), &format!("{major}2"));
    let cut = || fs::write(&manifest, &text[..text.len() / 2]).unwrap();
    let damages: [(&str, &dyn Fn(), &str); 8] = [
        ("one bit of a force", &force, "damaged"),
        ("one bit of a position", &position, "damaged"),
        ("a truncated chunk", &truncate, "truncated"),
        ("a missing chunk", &remove, "chunk-000000.columns is missing"),
        ("a chunk too many", &foreign, "chunk-000001.columns"),
        ("an edited manifest", &count, "edited"),
        ("a newer major", &newer, "it has format 2.0"),
        ("half a manifest", &cut, "manifest.json"),
    ];
    for (name, damage, words) in damages {
        damage();
        let check = bench.tollgate(&["stream", "check", STREAM]);
        assert_eq!(check.code, 5, "{name}: {check:?}");
        assert!(check.err.contains(words), "{name}: no {words:?} in {}", check.err);
        // What an attempt before this one has left is gone on with.
        let run = downstream(&bench, &["--resume"]);
        assert_eq!(run.code, 5, "{name}: {run:?}");
        assert!(run.err.contains(words), "{name}: no {words:?} in {}", run.err);
        let accepted = downstream(&bench, &["--accept-stream", "--resume"]);
        assert_eq!(accepted.code, 5, "{name}: damage is never accepted: {accepted:?}");
        assert!(!bench.path("a/stages/heap/dump.particles.lammpstrj").exists() || name.contains("bit"), "{name}");
        fs::remove_dir_all(&place).unwrap();
        copy_folder(&bench.path("sound"), &place);
    }
    // Put right again, it runs, whatever was tried before.
    let answer = downstream(&bench, &["--resume"]);
    assert_eq!(answer.code, 0, "{answer:?}");
    let arrivals = bench.summary("a").replayed("outlet", "heap")["arrivals"].clone();
    assert_eq!(arrivals["bit_equal"], arrivals["recorded"]["count"], "{arrivals:#}");
}

/// A bit that flips on the disk while the downstream runs must not reach the ledger as a success either.
#[test]
fn a_stream_damaged_between_two_runs_is_not_taken_for_done() {
    let bench = upstream();
    assert_eq!(downstream(&bench, &[]).code, 0);
    let chunk = bench.path(STREAM).join("chunk-000000.columns");
    let mut file = fs::OpenOptions::new().read(true).write(true).open(&chunk).unwrap();
    let middle = file.metadata().unwrap().len() / 2;
    let mut byte = [0_u8];
    file.seek(SeekFrom::Start(middle)).unwrap();
    file.read_exact(&mut byte).unwrap();
    file.seek(SeekFrom::Start(middle)).unwrap();
    file.write_all(&[byte[0] ^ 4]).unwrap();
    drop(file);
    assert_eq!(bench.tollgate(&["stream", "check", STREAM]).code, 5);
    // Another output interval asks for the stage anew.
    let answer =
        bench.attempt("b", &[&SHORT[..], &["--set", "stage.heap.replay.outlet.leaving=keep", "--reuse", "a"]].concat());
    answer.refused(5, &["damaged"]);
}

#[test]
fn a_stream_of_other_materials_is_accepted_only_on_demand() {
    let bench = upstream();
    let text = bench.text("scene.toml");
    let from = text.find("[[gate]]").unwrap();
    let to = text.find("[[stage]]\nname = \"heap\"").unwrap();
    let scene =
        format!("{}{}", &text[..from], &text[to..]).replace("gate = \"outlet\"", &format!("stream = \"{STREAM}\""));
    let scene = scene.replace("name = \"heap\"\n", "name = \"heap\"\nfeeds = []\n");
    fs::write(bench.path("scene.toml"), scene).unwrap();
    let fits = bench.attempt("fits", &SHORT);
    assert_eq!(fits.code, 0, "{fits:?}");
    assert!(!bench.summary("fits").warns("accepted"));
    let heavier = [&SHORT[..], &["--set", "material.sinter.density=3000 kg/m3"]].concat();
    bench.attempt("refused", &heavier).refused(5, &["does not fit", "sinter", "--accept-stream"]);
    let accepted = bench.run("accepted", &[&heavier[..], &["--accept-stream"]].concat());
    assert!(accepted.warns("accepted although"), "{:#}", accepted.at("/warnings"));
    // Other gravity is another plant.
    let moon = [&SHORT[..], &["--set", "gravity_m_per_s2=[0, 0, -1.62]"]].concat();
    bench.attempt("moon", &moon).refused(5, &["gravity"]);
}

#[test]
fn a_stream_of_another_plane_is_accepted_only_on_demand() {
    let bench = upstream();
    let lower = ["--set", "gate.outlet.point_mm=[0, 0, 199]"];
    let at = |further: &[&'static str]| bench.attempt("b", &[&SHORT[..], &lower, further].concat());
    assert_eq!(at(&["--stage", "hopper"]).code, 0);
    fs::remove_dir_all(bench.path("b/stages/hopper/streams/outlet")).unwrap();
    copy_folder(&bench.path(STREAM), &bench.path("b/stages/hopper/streams/outlet"));
    at(&["--stage", "heap"]).refused(5, &["does not fit", "plane", "--accept-stream"]);
    let answer = at(&["--stage", "heap", "--accept-stream"]);
    assert_eq!(answer.code, 0, "{answer:?}");
    assert!(bench.summary("b").warns("accepted although"));
    assert!(bench.json("b/stages/heap/summary.json")["warnings"].to_string().contains("accepted although"));
}

#[test]
fn stages_that_cannot_be_run_are_named() {
    let bench = Bench::hopper();
    let answer = downstream(&bench, &[]);
    answer.refused(5, &["stage 'heap' needs the stream of gate 'outlet'", "run stage 'hopper' first"]);
    bench.attempt("b", &["--stage", "bin"]).refused(2, &["no stage 'bin'", "hopper, heap"]);
    bench.attempt("c", &["--whole", "--stage", "hopper"]).refused(2, &["--whole", "heap"]);
    let plain = Bench::with("", &[crate::common::FLOOR, "[end]\ntime = \"1 ms\"\n"]);
    let feed = plain.drops("one", &[crate::common::Drop::new([0.0, 0.0, 50.0], [0.0; 3])]);
    plain.write_scene("scene.toml", "", &[crate::common::FLOOR, &feed, "[end]\ntime = \"1 ms\"\n"]);
    let answer = plain.attempt("a", &["--stage", "hopper"]);
    answer.refused(2, &["no stage 'hopper'"]);
    // Whole or not, a scene without gates is one run.
    plain.run("whole", &["--whole"]);
    assert!(plain.path("whole/summary.json").exists() && !plain.path("whole/stages").exists());
}
