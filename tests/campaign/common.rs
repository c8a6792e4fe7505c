//! A small hopper that empties onto a floor, as the base of campaigns, and what these leave behind.

pub use crate::program::{Answer, Bench, seeded};

use serde_json::Value;
use std::collections::BTreeMap;
use std::fs;

const HOPPER: &str = include_str!("../scenes/gate/hopper.toml");

/// Fewer particles, less to write.
pub const SMALL: &str = r#"
version = 1
[set]
"output.frames" = "100 ms"
"gate.outlet.paths.every" = 4
"feed.fill.amount" = 80
"end.time" = "0.25 s"
"#;

/// Heights of the floor, which only the downstream stage has.
pub const FLOORS: &str = r#"
[[axis]]
name = "floor"
keys = "part.floor.point_mm"
values = [[0, 0, 140], [0, 0, 150]]
"#;

/// A folder with the scene and a campaign of these pieces.
pub fn bench(pieces: &[&str]) -> Bench {
    let bench = Bench::new();
    fs::write(bench.path("scene.toml"), HOPPER).unwrap();
    write(&bench, pieces);
    bench
}

/// Writes the campaign anew.
pub fn write(bench: &Bench, pieces: &[&str]) {
    fs::write(bench.path("campaign.toml"), pieces.concat()).unwrap();
}

/// `campaign run` into `out`.
pub fn run(bench: &Bench, further: &[&str]) -> Answer {
    bench.tollgate(&[&["campaign", "run", ".", "--out", "out"], further].concat())
}

/// The dry run as JSON.
pub fn dry_run(bench: &Bench, further: &[&str]) -> Value {
    let answer = run(bench, &[&["--dry-run", "--json"], further].concat());
    assert_eq!(answer.code, 0, "{answer:?}");
    serde_json::from_str(&answer.out).unwrap()
}

/// Stages that would be computed, by their group: how many of how many.
pub fn due(dry: &Value) -> BTreeMap<String, (usize, usize)> {
    let mut found: BTreeMap<String, (usize, usize)> = BTreeMap::new();
    for row in dry["tasks"].as_array().unwrap() {
        let entry = found.entry(row["stage"].as_str().unwrap().to_owned()).or_default();
        entry.0 += usize::from(row["runs"] == true);
        entry.1 += 1;
    }
    found
}

/// Reasons of the stages that would be computed.
pub fn reasons(dry: &Value) -> Vec<String> {
    let rows = dry["tasks"].as_array().unwrap().iter().filter(|row| row["runs"] == true);
    rows.map(|row| row["reason"].as_str().unwrap().to_owned()).collect()
}

/// The rows of `results.csv` by header; what was measured on a clock is left out.
pub fn results(bench: &Bench) -> Vec<BTreeMap<String, String>> {
    let text = bench.text("out/results.csv");
    let mut table = csv::Reader::from_reader(text.as_bytes());
    let header: Vec<String> = table.headers().unwrap().iter().map(str::to_owned).collect();
    let is_time = |name: &String| name.ends_with("cpu_s") || name.ends_with("memory_bytes");
    assert_eq!(header.iter().filter(|name| is_time(name)).count(), 3, "{header:?}");
    let row = |row: csv::StringRecord| {
        let cells = header.iter().cloned().zip(row.iter().map(str::to_owned));
        cells.filter(|(name, _)| !is_time(name)).collect()
    };
    table.records().map(|record| row(record.unwrap())).collect()
}

/// The statuses of all runs.
pub fn statuses(bench: &Bench) -> Vec<String> {
    results(bench).into_iter().map(|mut row| row.remove("status").unwrap()).collect()
}

/// How often each task's process began to compute: its log has a line at plant time 0.
pub fn starts(bench: &Bench) -> Vec<usize> {
    let logs = fs::read_dir(bench.path("out/logs")).unwrap();
    let count = |path: std::path::PathBuf| {
        let text = fs::read_to_string(path).unwrap();
        text.lines().filter(|line| line.starts_with("0.0000 of ")).count()
    };
    logs.map(|entry| count(entry.unwrap().path())).collect()
}
