//! Gates in the summary: what was recorded, what arrived, how good a place to cut it was.

use crate::analysis::mass_flow_rate::mass_flow_rate;
use crate::backend::stage::{GateResults, RecordResult, ReplayResult};
use crate::gate::stream::format::Counts;
use crate::gate::stream::reader::StreamReader;
use crate::storage::StorageError;
use serde_json::{Map, Value, json};
use std::path::Path;

/// What came through the gates of one stage: one entry a stream that it recorded or replayed.
///
/// # Errors
/// When a stream that the stage has just recorded cannot be read.
pub fn of_stage(stage: &str, folder: &Path, results: &GateResults) -> Result<Vec<Value>, StorageError> {
    let recorded = results.recorded.iter().map(|result| recorded(stage, folder, result));
    let mut entries: Vec<Value> = recorded.collect::<Result<_, _>>()?;
    entries.extend(results.replayed.iter().map(|result| replayed(stage, result, results)));
    Ok(entries)
}

fn recorded(stage: &str, folder: &Path, result: &RecordResult) -> Result<Value, StorageError> {
    let mut entry = json!({
        "stage": stage,
        "role": if result.observed { "observed" } else { "handed over" },
        "crossings": result.crossings,
        "tally": result.tally,
    });
    if let Some(manifest) = &result.manifest {
        entry["stream"] = counts(&manifest.counts);
        entry["stream"]["digest"] = manifest.digest().into();
        let place = super::streams::stream_folder(folder, &result.gate.name);
        if let Ok(flow) = mass_flow_rate(&mass_curve(&place)?) {
            entry["mass_flow_rate_kg_per_s"] = flow.rate.into();
            entry["mass_flow_rate_uncertainty_kg_per_s"] = flow.uncertainty.into();
        }
    }
    Ok(json!({"name": result.gate.name, "recorded": entry}))
}

/// Mass that has passed against time, at most some hundred points: [s], [kg].
fn mass_curve(place: &Path) -> Result<Vec<(f64, f64)>, StorageError> {
    const POINTS: usize = 400;
    let reader = StreamReader::open(place)?;
    let body = reader.manifest().origin.body;
    let mut passed = Vec::new();
    for crossing in reader.crossings() {
        let crossing = crossing?;
        passed.push((crossing.passage.time, body.mass(crossing.state.radius, crossing.state.density)));
    }
    passed.sort_by(|a, b| a.0.total_cmp(&b.0));
    let (Some(first), Some(last)) = (passed.first(), passed.last()) else { return Ok(Vec::new()) };
    let (from, step) = (first.0, (last.0 - first.0) / POINTS as f64);
    let (mut sum, mut next) = (0.0, 0);
    let curve = (0..=POINTS).map(|point| {
        let time = from + point as f64 * step;
        while next < passed.len() && passed[next].0 <= time {
            sum += passed[next].1;
            next += 1;
        }
        (time, sum)
    });
    Ok(curve.collect())
}

fn counts(counts: &Counts) -> Value {
    json!({
        "crossings": counts.crossings,
        "contacts": counts.contacts,
        "path_motions": counts.motions,
        "mass_kg": counts.mass,
        "first_passage_s": counts.range.map(|range| range.first_time),
        "last_passage_s": counts.range.map(|range| range.last_time),
    })
}

fn replayed(stage: &str, result: &ReplayResult, results: &GateResults) -> Value {
    json!({
        "name": result.name,
        "replayed": {
            "stage": stage,
            "path": result.replay.path,
            "exact": result.exact,
            "tally": result.tally,
            "arrivals": result.arrivals,
            "left_upstream": result.left_upstream,
            "quality": result.quality,
            "backed_up": result.backed_up,
            "momentum": results.momentum,
            "energy": results.energy,
        },
    })
}

/// What the user must hear of the gates of a stage.
pub fn warnings(results: &GateResults) -> Vec<String> {
    let mut warnings = Vec::new();
    for result in &results.recorded {
        let (name, tally) = (&result.gate.name, &result.tally);
        if tally.sitting_at_start > 0 && !result.observed {
            warnings.push(format!(
                "gate '{name}': {} particles lay behind the plane at the start; they never pass it, so no stage beyond gets them: start \
                 with an empty space there, or move the gate",
                tally.sitting_at_start
            ));
        }
        if tally.came_around > 0 && !result.observed {
            warnings.push(format!(
                "gate '{name}': {} particles came behind the plane without passing its aperture; no stage beyond gets them: \
                 widen the aperture, or keep feeds out of there",
                tally.came_around
            ));
        }
    }
    for result in &results.replayed {
        let name = &result.name;
        let arrivals = &result.arrivals;
        if !arrivals.each_once || !arrivals.sums_exact {
            let exceptions: Vec<String> =
                arrivals.exceptions.iter().map(|entry| format!("{} {:?}", entry.count, entry.reason)).collect();
            warnings.push(format!(
                "gate '{name}': not every crossing arrived once and as it was recorded: {}",
                exceptions.join(", ")
            ));
        }
        if let Some(count) = result.left_upstream.filter(|count| *count > 0) {
            warnings.push(format!("gate '{name}': {count} particles went back upstream beyond the generation plane"));
        }
        if let Some(quality) = &result.quality {
            warnings.extend(quality.warnings.iter().map(|warning| format!("gate '{name}': {warning}")));
        }
        warnings.extend(result.backed_up.iter().map(|backed_up| backed_up.words.clone()));
    }
    warnings
}

/// The entries of all stages, one a gate: who recorded it, and everybody who replayed it.
pub fn by_name(entries: Vec<Value>) -> Vec<Value> {
    let mut gates: Vec<Map<String, Value>> = Vec::new();
    for entry in entries {
        let index = gates.iter().position(|gate| gate["name"] == entry["name"]).unwrap_or_else(|| {
            let mut gate = Map::new();
            gate.insert("name".to_owned(), entry["name"].clone());
            gate.insert("recorded".to_owned(), json!([]));
            gate.insert("replayed".to_owned(), json!([]));
            gates.push(gate);
            gates.len() - 1
        });
        for list in ["recorded", "replayed"] {
            if let (Some(one), Some(Value::Array(all))) = (entry.get(list), gates[index].get_mut(list)) {
                all.push(one.clone());
            }
        }
    }
    gates.into_iter().map(Value::Object).collect()
}

/// The gates of a summary in words.
#[must_use]
pub fn lines(gates: &[Value]) -> Vec<String> {
    let number = |value: &Value| value.as_f64().unwrap_or_default();
    let mut lines = Vec::new();
    for gate in gates {
        let name = gate["name"].as_str().unwrap_or_default();
        for one in gate["recorded"].as_array().into_iter().flatten() {
            let (stage, role) = (one["stage"].as_str().unwrap_or_default(), one["role"].as_str().unwrap_or_default());
            let (stream, crossings) = (&one["stream"], &one["crossings"]);
            // A stage that was stopped has no stream: what passed so far is in its checkpoint.
            let passed = match stream["crossings"].as_u64() {
                Some(count) => format!("{count} crossings, {:.4} kg", number(&stream["mass_kg"])),
                None => "no stream yet".to_owned(),
            };
            lines.push(format!(
                "gate '{name}' ({role} by {stage}): {passed}, {:.1} % in contact, mean normal speed {:.3} m/s, {} returned",
                100.0 * number(&crossings["contact_share"]),
                number(&crossings["mean_normal_speed_m_s"]),
                one["tally"]["returned"],
            ));
        }
        for one in gate["replayed"].as_array().into_iter().flatten() {
            let arrivals = &one["arrivals"];
            let mut line = format!(
                "gate '{name}' into {}: {} of {} arrived, {} bit-equal, path {}, cut {}",
                one["stage"].as_str().unwrap_or_default(),
                arrivals["arrived"]["count"],
                arrivals["recorded"]["count"],
                arrivals["bit_equal"],
                one["path"].as_str().unwrap_or_default(),
                one["quality"]["grade"].as_str().unwrap_or("not judged"),
            );
            // An external code tells neither.
            if let Some(share) = one["quality"]["overlaps"]["largest_share"].as_f64() {
                line += &format!(", largest ghost overlap {:.1} % of the radius", 100.0 * share);
            }
            if let Some(error) = one["momentum"]["closure_error"].as_f64() {
                line += &format!(", momentum closed to {error:.1e}");
            }
            lines.push(line);
        }
    }
    lines
}
