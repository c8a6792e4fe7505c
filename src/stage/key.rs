//! The key of a stage: a hash of all that influences its result, and of what was asked to be written.

use crate::scene::Scene;
use serde::Serialize;
use serde_json::{Map, Value};

/// All that influences a stage's result, as JSON that can be compared, and its hash.
#[derive(Debug, Clone, PartialEq)]
pub struct StageKey {
    /// blake3 digest of `content`, hexadecimal.
    pub key: String,
    /// blake3 digest of what was asked to be written and measured, hexadecimal.
    pub outputs_key: String,
    /// What the key is a hash of.
    pub content: Value,
}

/// Numbers that a plan and a backend add to the scene.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Choices<'a> {
    /// Name of the backend.
    pub backend: &'a str,
    /// Counts changes of the backend that may change a bit.
    pub numerics_version: u32,
    /// Time step [s].
    pub timestep: f64,
    /// Neighbour skin [m].
    pub skin: f64,
    /// Models that act.
    pub models: &'a [&'a str],
    /// Digest of the checkpoint that is started from, hexadecimal.
    pub start: Option<&'a str>,
}

/// Keys of the scene that say what is written or how it is called, and change no result.
const OUTPUT_KEYS: [&str; 2] = ["output", "measures"];

impl StageKey {
    /// The key of a scene under these choices. Comments, the scene's name, paths and the number of threads are not in it; the
    /// bytes of STL and initial-state files are, as what was read from them.
    ///
    /// # Panics
    /// Never: a scene is plain numbers and names.
    #[must_use]
    pub fn new(scene: &Scene, choices: &Choices) -> Self {
        let mut content = to_map(scene);
        content.remove("name");
        // A path; what it leads to is among the choices.
        content.remove("start_checkpoint");
        let outputs: Map<String, Value> =
            OUTPUT_KEYS.iter().filter_map(|&key| Some((key.to_owned(), content.remove(key)?))).collect();
        content.insert("choices".to_owned(), Value::Object(to_map(choices)));
        let content = Value::Object(content);
        Self { key: digest(&content), outputs_key: digest(&Value::Object(outputs)), content }
    }
}

fn to_map(value: &impl Serialize) -> Map<String, Value> {
    match serde_json::to_value(value).expect("plain numbers and names become JSON") {
        Value::Object(map) => map,
        other => Map::from_iter([("value".to_owned(), other)]),
    }
}

fn digest(value: &Value) -> String {
    blake3::hash(value.to_string().as_bytes()).to_hex().to_string()
}

/// Places at which two contents differ, as dotted paths, at most `most` of them.
#[must_use]
pub fn differences(old: &Value, new: &Value, most: usize) -> Vec<String> {
    let mut found = Vec::new();
    compare(old, new, "", most, &mut found);
    found
}

fn compare(old: &Value, new: &Value, path: &str, most: usize, found: &mut Vec<String>) {
    if found.len() >= most || old == new {
        return;
    }
    let join = |name: &str| if path.is_empty() { name.to_owned() } else { format!("{path}.{name}") };
    match (old, new) {
        (Value::Object(a), Value::Object(b)) => {
            let mut names: Vec<&String> = a.keys().chain(b.keys()).collect();
            names.sort();
            names.dedup();
            for name in names {
                let side = |map: &Map<String, Value>| map.get(name).cloned().unwrap_or(Value::Null);
                compare(&side(a), &side(b), &join(name), most, found);
            }
        }
        (Value::Array(a), Value::Array(b)) if a.len() == b.len() => {
            for (index, (a, b)) in a.iter().zip(b).enumerate() {
                let name = b.get("name").and_then(Value::as_str).map_or_else(|| index.to_string(), str::to_owned);
                compare(a, b, &join(&name), most, found);
            }
        }
        _ => found.push(format!("{path}: {} then, {} now", short(old), short(new))),
    }
}

fn short(value: &Value) -> String {
    let text = value.to_string();
    if text.chars().count() <= 40 { text } else { text.chars().take(37).chain("...".chars()).collect() }
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    #[test]
    fn differences_name_the_place_and_both_values() {
        let old = json!({"seed": 1, "parts": [{"name": "chute", "material": 0}]});
        let new = json!({"seed": 1, "parts": [{"name": "chute", "material": 2}]});
        assert_eq!(differences(&old, &new, 5), ["parts.chute.material: 0 then, 2 now"]);
        assert!(differences(&old, &old, 5).is_empty());
    }
}
