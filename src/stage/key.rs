//! The key of a stage: a hash of all that influences its result, and of what was asked to be written.

use super::canonical;
use super::split::Recording;
use crate::dem::feed::Feed;
use crate::dem::law::LawSettings;
use crate::geometry::part::Part;
use crate::material::MaterialTable;
use crate::math::Vec3;
use crate::particle::{Body, ParticleClass};
use crate::scene::backend::BackendName;
use crate::scene::gate::{BackingUp, Clock, Fate, PathMode, Replay, Timing, Transform};
use crate::scene::{Domain, EndConditions, Measure, OutputSettings, Scene, SolverSettings};
use serde::Serialize;
use serde_json::{Map, Value};

/// All that influences a stage's result, as JSON that can be compared, and its hash.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct StageKey {
    /// blake3 digest of `content`, hexadecimal.
    pub key: String,
    /// blake3 digest of what was asked to be written and measured, hexadecimal.
    pub outputs_key: String,
    /// What the key is a hash of: JSON as [`canonical`] has it.
    pub content: String,
    /// What the other one is a hash of: JSON as well.
    pub outputs: String,
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
    /// Gates that are recorded. Those of a whole run are only observed: they belong to what is written.
    #[serde(skip_serializing_if = "<[Recording]>::is_empty")]
    pub records: &'a [Recording],
    /// How streams are replayed.
    #[serde(skip_serializing_if = "<[ReplayChoice]>::is_empty")]
    pub replays: &'a [ReplayChoice],
    /// Digests of the streams that are replayed, in the order of the replays, hexadecimal.
    #[serde(skip_serializing_if = "<[&str]>::is_empty")]
    pub streams: &'a [&'a str],
    /// Kick of a particle at the start: length [m], number of the draw.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub kick: Option<(f64, u64)>,
    /// Which of the scene's materials the stage can meet; the others are in no key.
    #[serde(skip)]
    pub materials: &'a [bool],
    /// Of an external code: its version, and what it is told that may change a number.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub external: Option<&'a Value>,
}

/// How a stream is replayed; which one it is its digest says, wherever it comes from.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct ReplayChoice {
    path: PathMode,
    length: f64,
    clock: Clock,
    timing: Timing,
    window: [f64; 2],
    loops: u64,
    /// Only where there are several loops.
    #[serde(skip_serializing_if = "Option::is_none")]
    gap: Option<f64>,
    transform: Transform,
    leaving: Fate,
    backing_up: BackingUp,
    /// Only of compliant ghosts.
    #[serde(skip_serializing_if = "Option::is_none")]
    compliance: Option<f64>,
}

impl From<&Replay> for ReplayChoice {
    fn from(replay: &Replay) -> Self {
        Self {
            path: replay.path,
            length: replay.length,
            clock: replay.clock,
            timing: replay.timing,
            window: replay.window,
            loops: replay.loops,
            gap: (replay.loops > 1).then_some(replay.gap),
            transform: replay.transform,
            leaving: replay.leaving,
            backing_up: replay.backing_up,
            compliance: (replay.path == PathMode::Compliant).then_some(replay.compliance),
        }
    }
}

/// Keys of the scene that say what is written or how it is called, and change no result.
const OUTPUT_KEYS: [&str; 2] = ["output", "measures"];
/// Keys of `[liggghts]` that say how it is started and what is kept of it.
const STARTING_KEYS: [&str; 3] = ["mpirun", "time_limit", "keep_samples"];

/// What a stage's key is a hash of.
#[derive(Serialize)]
struct Content<'a> {
    seed: &'a u64,
    body: &'a Body,
    gravity: &'a Vec3,
    domain: &'a Domain,
    materials: &'a MaterialTable,
    law: &'a LawSettings,
    classes: &'a [ParticleClass],
    feeds: &'a [Feed],
    parts: &'a [Part],
    solver: &'a SolverSettings,
    end: &'a EndConditions,
    choices: Choices<'a>,
}

/// What a stage is to write and measure.
#[derive(Serialize)]
struct Outputs<'a> {
    output: &'a OutputSettings,
    measures: &'a [Measure],
    #[serde(skip_serializing_if = "<[Recording]>::is_empty")]
    observes: &'a [Recording],
}

impl StageKey {
    /// The key of a scene under these choices. Comments, the scene's name, paths and the number of threads are not in it; the
    /// bytes of STL and initial-state files are, as what was read from them.
    ///
    /// # Panics
    /// Never: a scene is plain numbers and names.
    #[must_use]
    pub fn new(scene: &Scene, choices: &Choices) -> Self {
        let Scene {
            seed,
            body,
            gravity,
            domain,
            materials,
            law,
            classes,
            feeds,
            parts,
            solver,
            end,
            output,
            measures,
            // Among the choices: how it is split, who computes by what it is told, and what the path leads to.
            gates: _,
            stages: _,
            backend: _,
            liggghts: _,
            start_checkpoint: _,
            // It changes no result.
            name: _,
        } = scene;
        // A gate that is only observed changes nothing but what is written.
        let (observed, records): (Vec<Recording>, Vec<Recording>) =
            choices.records.iter().cloned().partition(|recording| recording.observes);
        let materials = &materials.of_those(choices.materials);
        let choices = Choices { records: &records, ..*choices };
        let content =
            Content { seed, body, gravity, domain, materials, law, classes, feeds, parts, solver, end, choices };
        Self::of(canonical::text_of(&content), canonical::text_of(&Outputs { output, measures, observes: &observed }))
    }
}

/// What of `wanted` outputs `held` ones lack, as dotted paths with both values; empty where a run that wrote `held` has all.
/// What is `null` or `false` is not wanted; elements of lists go by their names, or by themselves.
#[must_use]
pub fn lacking(held: &Value, wanted: &Value) -> Vec<String> {
    let mut found = Vec::new();
    lack(held, wanted, "", &mut found);
    found
}

fn lack(held: &Value, wanted: &Value, path: &str, found: &mut Vec<String>) {
    let join = |name: &str| if path.is_empty() { name.to_owned() } else { format!("{path}.{name}") };
    match (held, wanted) {
        _ if held == wanted || wanted.is_null() || *wanted == Value::Bool(false) => {}
        (Value::Object(held), Value::Object(wanted)) => {
            for (name, value) in wanted {
                lack(held.get(name).unwrap_or(&Value::Null), value, &join(name), found);
            }
        }
        (Value::Array(held), Value::Array(wanted)) => {
            for value in wanted {
                let name = value.get("name").and_then(Value::as_str);
                let same = |other: &&Value| match name {
                    Some(name) => other.get("name").and_then(Value::as_str) == Some(name),
                    None => *other == value,
                };
                match (held.iter().find(same), name) {
                    (Some(other), _) if other == value => {}
                    (Some(_), Some(name)) => found.push(format!("{} is defined otherwise", join(name))),
                    (_, Some(name)) => found.push(join(name)),
                    (_, None) => found.push(format!("{path} {}", short(value))),
                }
            }
        }
        (Value::Null | Value::Bool(false), _) => found.push(path.to_owned()),
        _ => found.push(format!("{path}: {} then, {} now", short(held), short(wanted))),
    }
}

fn to_value(value: &impl Serialize) -> Value {
    serde_json::to_value(value).expect("plain numbers and names become JSON")
}

impl StageKey {
    /// The key of a run of several stages: of the scene with its gates and stages, and of how it is run. The stages have keys
    /// of their own.
    ///
    /// # Panics
    /// Never: a scene is plain numbers and names.
    #[must_use]
    pub fn of_run(scene: &Scene, whole: bool, kick: Option<(f64, u64)>) -> Self {
        let mut content = to_map(scene);
        content.remove("name");
        without_unused_codes(scene, &mut content);
        if let Some(Value::Object(settings)) = content.get_mut("liggghts") {
            STARTING_KEYS.iter().for_each(|key| drop(settings.remove(*key)));
        }
        let outputs: Map<String, Value> =
            OUTPUT_KEYS.iter().filter_map(|&key| Some((key.to_owned(), content.remove(key)?))).collect();
        content.insert("whole".to_owned(), whole.into());
        content.insert("kick".to_owned(), serde_json::json!(kick));
        Self::of(Value::Object(content).to_string(), Value::Object(outputs).to_string())
    }
}

impl StageKey {
    fn of(content: String, outputs: String) -> Self {
        Self { key: digest(&content), outputs_key: digest(&outputs), content, outputs }
    }
}

/// What a key, or an outputs key, is a hash of, to be compared.
///
/// # Panics
/// Where it is no JSON: it is what a [`StageKey`] has.
#[must_use]
pub fn value_of(text: &str) -> Value {
    serde_json::from_str(text).expect("JSON that was written here")
}

/// What external codes are told does not belong to a run that none of them computes.
fn without_unused_codes(scene: &Scene, content: &mut Map<String, Value>) {
    let chosen = scene.stages.iter().filter_map(|stage| stage.backend).chain([scene.backend]);
    if chosen.into_iter().all(|backend| backend == BackendName::Native) {
        content.remove("liggghts");
        content.remove("backend");
        let stages = content.get_mut("stages").and_then(Value::as_array_mut).into_iter().flatten();
        stages.filter_map(Value::as_object_mut).for_each(|stage| drop(stage.remove("backend")));
    }
}

fn to_map(value: &impl Serialize) -> Map<String, Value> {
    match to_value(value) {
        Value::Object(map) => map,
        other => Map::from_iter([("value".to_owned(), other)]),
    }
}

fn digest(text: &str) -> String {
    blake3::hash(text.as_bytes()).to_hex().to_string()
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
    use crate::scene::gate::StreamSource;
    use crate::stage::split::{StageJob, stage_jobs, whole_jobs};
    use serde_json::json;

    const GATES: &str = include_str!("../../tests/scenes/good/gates.toml");

    fn scene(settings: &[(&str, &str)]) -> Scene {
        let settings: Vec<_> = settings.iter().map(|(key, value)| ((*key).to_owned(), (*value).to_owned())).collect();
        let base = std::path::Path::new("tests/scenes/good");
        crate::scene::read_text(GATES, "gates.toml", base, &settings).expect("a valid scene").0
    }

    fn key_of(job: &StageJob, streams: &[&str]) -> StageKey {
        let replays: Vec<ReplayChoice> = job.replays.iter().map(ReplayChoice::from).collect();
        let choices = Choices {
            backend: "native",
            numerics_version: 1,
            timestep: 1e-6,
            skin: 1e-3,
            models: &[],
            start: None,
            records: &job.records,
            replays: &replays,
            streams,
            kick: None,
            materials: &job.materials,
            external: None,
        };
        StageKey::new(&job.scene, &choices)
    }

    fn stage(name: &str, settings: &[(&str, &str)]) -> StageKey {
        let scene = scene(settings);
        let job = stage_jobs(&scene).into_iter().find(|job| job.name == name).expect("a stage");
        key_of(&job, &vec!["0123"; job.replays.len()])
    }

    #[test]
    fn a_stage_changes_its_key_with_what_influences_it_alone() {
        let (hopper, plate, chute) = (stage("hopper", &[]), stage("plate", &[]), stage("chute", &[]));
        let moved = [("part.plate.min_mm", "[-360, -50, 440]")];
        assert_eq!(stage("hopper", &moved).key, hopper.key);
        assert_eq!(stage("chute", &moved).key, chute.key);
        assert_ne!(stage("plate", &moved).key, plate.key);
        let finer = [("gate.outlet.paths.every", "1")];
        assert_ne!(stage("hopper", &finer).key, hopper.key);
        assert_eq!(stage("plate", &finer).key, plate.key, "what is finer is in the stream's digest");
        for change in
            [("path", "\"recorded\""), ("length_mm", "8"), ("from", "0.3 s"), ("loops", "2"), ("gap", "0.2 s")]
        {
            let path = format!("stage.plate.replay.outlet.{}", change.0);
            assert_ne!(stage("plate", &[(&path, change.1)]).key, plate.key, "{path}");
        }
        let other_name = [("title", "another")];
        assert_eq!(stage("plate", &other_name).key, plate.key);
    }

    #[test]
    fn how_an_external_code_is_started_is_in_no_key_of_a_run() {
        let key = |settings: &[(&str, &str)]| StageKey::of_run(&scene(settings), false, None).key;
        let plain = key(&[]);
        for (name, value) in [("mpirun", "[\"--oversubscribe\"]"), ("time_limit", "\"3 h\""), ("keep_samples", "false")]
        {
            assert_eq!(key(&[(&format!("liggghts.{name}"), value)]), plain, "{name}");
        }
        assert_ne!(key(&[("liggghts.sample_every", "20")]), plain);
        assert_ne!(key(&[("liggghts.skin", "\"2 mm\"")]), plain);
    }

    #[test]
    fn a_stream_counts_by_its_digest_not_by_its_folder() {
        let scene = scene(&[]);
        let mut job = stage_jobs(&scene).swap_remove(3);
        let key = key_of(&job, &["aa", "bb"]);
        job.replays[1].source = StreamSource::Folder("elsewhere".into());
        assert_eq!(key_of(&job, &["aa", "bb"]).key, key.key);
        assert_ne!(key_of(&job, &["aa", "bc"]).key, key.key);
    }

    #[test]
    fn an_observed_gate_is_an_output() {
        let mut job = whole_jobs(&scene(&[])).swap_remove(0);
        let key = key_of(&job, &[]);
        job.records[0].gate.exclusion.length *= 2.0;
        let other = key_of(&job, &[]);
        assert_eq!(other.key, key.key);
        assert_ne!(other.outputs_key, key.outputs_key);
        job.records[0].observes = false;
        assert_ne!(key_of(&job, &[]).key, key.key);
    }

    #[test]
    fn a_scene_without_gates_has_nothing_of_them_in_its_key() {
        let mut job = whole_jobs(&scene(&[])).swap_remove(0);
        job.records.clear();
        let key = key_of(&job, &[]);
        let text = key.content;
        for word in ["gates", "stages", "records", "replays", "streams"] {
            assert!(!text.contains(&format!("\"{word}\"")), "{word}");
        }
    }

    #[test]
    fn differences_name_the_place_and_both_values() {
        let old = json!({"seed": 1, "parts": [{"name": "chute", "material": 0}]});
        let new = json!({"seed": 1, "parts": [{"name": "chute", "material": 2}]});
        assert_eq!(differences(&old, &new, 5), ["parts.chute.material: 0 then, 2 now"]);
        assert!(differences(&old, &old, 5).is_empty());
    }
}
