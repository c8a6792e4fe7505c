//! Gates in the summary.

use crate::backend::native::gate::GateResults;
use crate::scene::Scene;
use serde_json::{Value, json};

/// What came through the gates of one stage, one entry a gate and direction.
pub fn of_stage(stage: &str, _scene: &Scene, results: &GateResults) -> Vec<Value> {
    let mut entries = Vec::new();
    for recorded in &results.recorded {
        entries.push(json!({"name": recorded.gate.name, "stage": stage, "recorded": recorded.tally}));
    }
    for replayed in &results.replayed {
        entries.push(json!({"name": replayed.name, "stage": stage, "replayed": replayed.tally}));
    }
    entries
}

/// The entries of all stages, by gate.
pub fn by_name(entries: Vec<Value>) -> Vec<Value> {
    entries
}
