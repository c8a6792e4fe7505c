//! The law of the gate: what is recorded arrives once, and the accounts of the region close.

use crate::common::{Bench, assert_faultless, number};
use serde_json::Value;
use std::collections::BTreeSet;

fn entry<'a>(account: &'a Value, name: &str) -> &'a Value {
    let entries = account["entries"].as_array().unwrap();
    entries.iter().find(|entry| entry["name"] == name).unwrap_or_else(|| panic!("no entry {name}: {account:#}"))
}

fn magnitude(vector: &Value) -> f64 {
    vector.as_array().unwrap().iter().map(|x| number(x).powi(2)).sum::<f64>().sqrt()
}

/// Catches impulses of walls, ghosts or gravity that are booked nowhere, or twice; an energy that ghosts bring unnoticed; a particle
/// that arrives twice, or with another mass.
fn closes(settings: &[&str], path: &str) {
    let bench = Bench::hopper();
    let summary = bench.run("a", settings);
    let replayed = summary.replayed("outlet", "heap");
    let stream = &summary.recorded("outlet")["stream"];
    let count = stream["crossings"].as_u64().unwrap();
    assert!(count > 60, "{stream:#}");
    if path == "compliant" {
        let arrivals = &replayed["arrivals"];
        assert_eq!(
            (&arrivals["each_once"], &arrivals["arrived"]["count"]),
            (&true.into(), &count.into()),
            "{arrivals:#}"
        );
        assert!(number(&arrivals["largest_deviation_m"]) > 0.0, "{arrivals:#}");
    } else {
        assert_faultless(replayed, count);
    }
    let share = (number(&replayed["arrivals"]["arrived"]["mass_kg"]) / number(&stream["mass_kg"]) - 1.0).abs();
    // Two sums of the same hundred numbers, one of them without rounding.
    assert!(share < 1e-14, "{share:e}");
    let momentum = &replayed["momentum"];
    for name in ["gravity", "parts", "ghosts"] {
        assert!(magnitude(&entry(momentum, name)["momentum_kg_m_s"]) > 0.0, "{name}: {momentum:#}");
    }
    let error = number(&momentum["closure_error"]);
    assert!(error <= 1e-9, "momentum: {error:e}: {momentum:#}");
    let energy = &replayed["energy"];
    assert!(number(&entry(energy, "ghosts")["energy_J"]) != 0.0, "{energy:#}");
    let error = number(&energy["closure_error"]);
    assert!(error <= 1e-3, "energy: {error:e}: {energy:#}");
    ids_are_those_recorded(&bench, path);
}

fn ids_are_those_recorded(bench: &Bench, path: &str) {
    let crossings = bench.crossings("a/stages/hopper/streams/outlet");
    let recorded: BTreeSet<u64> = crossings.iter().map(|row| row["id"].parse().unwrap()).collect();
    assert_eq!(recorded.len(), crossings.len(), "somebody crossed twice");
    let (_, last) = bench.frames("a", "heap").0.pop_last().unwrap();
    assert!(last.keys().all(|id| recorded.contains(id)), "{path}: somebody whom nobody recorded");
}

#[test]
fn accounts_close_on_recorded_paths() {
    closes(&[], "recorded");
}

#[test]
fn accounts_close_in_the_modes_of_the_patent() {
    let constant = ["--set", "gate.outlet.exclusion.mode=constant", "--set", "stage.heap.replay.outlet.path=constant"];
    // In the free jet: inside the outlet such ghosts are no model of the flow.
    let below = ["--set", "gate.outlet.point_mm=[0, 0, 188]"];
    closes(&[&constant[..], &below[..]].concat(), "constant");
}

#[test]
fn accounts_close_with_ghosts_that_yield() {
    closes(
        &[
            "--set",
            "stage.heap.replay.outlet.path=compliant",
            "--set",
            "stage.heap.replay.outlet.length_mm=8",
            "--set",
            "gate.outlet.paths.length_mm=8",
        ],
        "compliant",
    );
}
