//! `[[stage]]` and `[[stage.replay]]`: what a stage consists of and how streams enter it; or the series of stages that the
//! gates imply.

use super::backends::backend;
use super::gates::{FATES, default_length};
use super::outputs::end_conditions;
use super::regions::rotation;
use super::{Context, Located, Name};
use crate::dem::feed::Feed;
use crate::math::Vec3;
use crate::scene::gate::{
    BackingUp, Clock, Fate, Gate, PathMode, Replay, StageOutline, StreamSource, Timing, Transform,
};
use crate::scene::quantity::Dimension::{Length, Time};
use crate::scene::reader::{Limit, Reader};
use crate::scene::tree::Value;

/// Largest distance of a compliant ghost from its path where the scene does not say, in largest diameters.
const DEFAULT_COMPLIANCE: f64 = 0.1;

/// Names that stages refer to, and what became of them.
pub(super) struct Known<'a> {
    /// Everything that was declared, also what did not resolve.
    pub names: &'a [Name],
    /// Names of the parts that resolved.
    pub parts: Vec<String>,
    /// The feeds that resolved.
    pub feeds: &'a [Located<Feed>],
    /// The gates that resolved.
    pub gates: &'a [Located<Gate>],
    /// Largest diameter of any particle [m].
    pub largest: f64,
}

/// The stages, and whether everything that they name is known and right.
#[derive(Debug)]
pub(in crate::scene) struct Stages {
    /// Stages in the file's order, or as the gates imply them.
    pub stages: Vec<Located<StageOutline>>,
    /// True where all of them and all their references resolved.
    pub whole: bool,
}

/// Reads the stages.
pub(super) fn stages(reader: &Reader<'_>, context: &Context<'_>, known: &Known<'_>, names: &mut Vec<Name>) -> Stages {
    let tables = reader.tables("stage", "stage");
    let declared_gates = known.names.iter().filter(|(kind, ..)| *kind == "gate").count();
    let gates_whole = declared_gates == known.gates.len();
    if tables.is_empty() {
        let implied = !reader.has("stage");
        let stages = if implied { series(known) } else { Vec::new() };
        return Stages { stages, whole: gates_whole && implied };
    }
    let count = tables.len();
    let mut whole = gates_whole;
    let mut stages = Vec::new();
    for table in tables {
        let path = table.path();
        let place = table.place_of("name");
        let name = table.name();
        if let Some(name) = &name {
            names.push(("stage", name.clone(), place));
        }
        let (outline, complete) = stage(table, name, context, known);
        whole &= complete;
        stages.extend(outline.map(|item| Located { path, item }));
    }
    whole &= stages.len() == count;
    Stages { stages, whole }
}

/// The series of stages between the gates in the file's order.
fn series(known: &Known<'_>) -> Vec<Located<StageOutline>> {
    let gates = known.gates;
    let Some((first, last)) = gates.first().zip(gates.last()) else { return Vec::new() };
    let mut stages = Vec::new();
    for after in 0..=gates.len() {
        let before = after.checked_sub(1).map(|index| (index, &gates[index]));
        let next = gates.get(after);
        let name = match (before, next) {
            (None, _) => format!("before-{}", first.item.name),
            (Some((_, gate)), Some(next)) => format!("{}-to-{}", gate.item.name, next.item.name),
            (Some(_), None) => format!("after-{}", last.item.name),
        };
        let replay = |(index, gate): (usize, &Located<Gate>)| {
            replay_of(StreamSource::Gate(index), default_path(&gate.item), known.largest)
        };
        let item = StageOutline {
            name,
            parts: None,
            feeds: None,
            records: next.map(|_| after).into_iter().collect(),
            replays: before.map(replay).into_iter().collect(),
            end: None,
            backend: None,
        };
        // What is wrong with an implied stage is said where the gate stands that begins it.
        let path = before.map_or(&first.path, |(_, gate)| &gate.path).clone();
        stages.push(Located { path, item });
    }
    stages
}

fn stage(
    reader: Reader<'_>,
    name: Option<String>,
    context: &Context<'_>,
    known: &Known<'_>,
) -> (Option<StageOutline>, bool) {
    let mut complete = true;
    let parts = references(&reader, "parts", "part", known, &mut complete, |name| {
        known.parts.iter().position(|part| part == name)
    });
    let feeds = references(&reader, "feeds", "feed", known, &mut complete, |name| {
        known.feeds.iter().position(|feed| feed.item.name == name)
    });
    let records = references(&reader, "records", "gate", known, &mut complete, |name| known.gate(name));
    let tables = reader.tables("replay", "stage.replay");
    let count = tables.len();
    let replays: Vec<Replay> = tables.into_iter().filter_map(|table| replay(table, context, known)).collect();
    complete &= replays.len() == count;
    let end = reader.table("end", "end").and_then(end_conditions);
    let backend = backend(&reader);
    complete &= end.is_some() || !reader.has("end");
    reader.finish();
    let records = records.unwrap_or_default();
    (name.map(|name| StageOutline { name, parts, feeds, records, replays, end, backend }), complete)
}

impl Known<'_> {
    fn gate(&self, name: &str) -> Option<usize> {
        self.gates.iter().position(|gate| gate.item.name == name)
    }

    fn declared(&self, kind: &str) -> Vec<String> {
        self.names.iter().filter(|(own, ..)| *own == kind).map(|(_, name, _)| name.clone()).collect()
    }
}

/// The array `key` of names of one kind, as indices; `complete` becomes false where one of them is not to be had.
fn references(
    reader: &Reader<'_>,
    key: &'static str,
    kind: &str,
    known: &Known<'_>,
    complete: &mut bool,
    resolved: impl Fn(&str) -> Option<usize>,
) -> Option<Vec<usize>> {
    let node = reader.node(key)?;
    let Value::Array(items) = &node.value else {
        reader.wrong_type(key, node, "an array of names", "[\"…\"]");
        *complete = false;
        return None;
    };
    let declared = known.declared(kind);
    let mut found = Vec::new();
    for item in items.iter() {
        // A name that was declared and did not resolve has its finding there.
        let index = reader.reference_of(key, item, kind, &declared).and_then(|index| resolved(&declared[index]));
        match index {
            Some(index) if found.contains(&index) => reader.report.error(
                "given-twice",
                &item.place,
                format!("`{key}` names one {kind} twice"),
                "keep one of the two",
            ),
            Some(index) => found.push(index),
            None => *complete = false,
        }
    }
    Some(found)
}

/// How a particle of this gate moves before its passage where the scene does not say.
fn default_path(gate: &Gate) -> PathMode {
    if gate.paths.is_some() { PathMode::Recorded } else { PathMode::Ballistic }
}

fn replay_of(source: StreamSource, path: PathMode, largest: f64) -> Replay {
    Replay {
        source,
        path,
        length: default_length(largest),
        clock: Clock::Plant,
        timing: Timing::Arrival,
        window: [0.0, f64::INFINITY],
        loops: 1,
        gap: 0.0,
        transform: Transform::IDENTITY,
        leaving: Fate::Delete,
        backing_up: BackingUp::Stop,
        compliance: DEFAULT_COMPLIANCE * largest,
    }
}

fn replay(reader: Reader<'_>, context: &Context<'_>, known: &Known<'_>) -> Option<Replay> {
    let source = source(&reader, context, known);
    let modes = [
        ("constant", PathMode::Constant),
        ("ballistic", PathMode::Ballistic),
        ("recorded", PathMode::Recorded),
        ("compliant", PathMode::Compliant),
    ];
    let path = match &source {
        // What a stored stream holds is not known here.
        Some(StreamSource::Folder(_)) => reader.need_word("path", &modes),
        Some(StreamSource::Gate(index)) => {
            Some(reader.word("path", &modes).unwrap_or_else(|| default_path(&known.gates[*index].item)))
        }
        None => reader.word("path", &modes),
    };
    let mut replay =
        replay_of(source.clone().unwrap_or(StreamSource::Gate(0)), path.unwrap_or(PathMode::Constant), known.largest);
    replay.length = reader.quantity("length", Length, Limit::Positive).unwrap_or(replay.length);
    replay.clock = reader
        .word("clock", &[("plant", Clock::Plant), ("first-passage", Clock::FirstPassage)])
        .unwrap_or(replay.clock);
    replay.timing =
        reader.word("timing", &[("arrival", Timing::Arrival), ("creation", Timing::Creation)]).unwrap_or(replay.timing);
    let from = reader.quantity("from", Time, Limit::NotNegative).unwrap_or(replay.window[0]);
    let until = reader.quantity("until", Time, Limit::NotNegative).unwrap_or(replay.window[1]);
    replay.window = [from, until];
    replay.loops = reader.integer("loops", 2).unwrap_or(replay.loops);
    replay.gap = reader.quantity("gap", Time, Limit::NotNegative).unwrap_or(replay.gap);
    replay.transform = transform(&reader);
    replay.leaving = reader.word("leaving", &FATES).unwrap_or(replay.leaving);
    replay.backing_up =
        reader.word("backing_up", &[("stop", BackingUp::Stop), ("warn", BackingUp::Warn)]).unwrap_or(replay.backing_up);
    replay.compliance = reader.quantity("compliance", Length, Limit::Positive).unwrap_or(replay.compliance);
    reader.finish();
    source.and(path).map(|_| replay)
}

/// A gate of the scene or the folder of a stored stream: one of the two.
fn source(reader: &Reader<'_>, context: &Context<'_>, known: &Known<'_>) -> Option<StreamSource> {
    let gate = reader.node("gate");
    let folder = reader.text("stream");
    match (gate, folder) {
        (Some(node), None) if !reader.has("stream") => {
            let declared = known.declared("gate");
            let index = reader.reference_of("gate", node, "gate", &declared)?;
            known.gate(&declared[index]).map(StreamSource::Gate)
        }
        (None, Some(folder)) => Some(StreamSource::Folder(context.base.join(folder))),
        (Some(_), Some(_)) => {
            reader.report.error(
                "given-twice",
                &reader.place_of("stream"),
                "a replay has one source, and this one names a gate and a stored stream",
                "keep `gate` or `stream`",
            );
            None
        }
        _ => {
            if !reader.has("gate") && !reader.has("stream") {
                reader
                    .missing("gate", "gate = \"…\"` for a gate of this scene, or `stream = \"…\"` for a stored stream");
            }
            None
        }
    }
}

fn transform(reader: &Reader<'_>) -> Transform {
    let mut transform = Transform::IDENTITY;
    if let Some(place) = reader.table("place", "place") {
        transform.rotation = place.table("rotate", "place.rotate").and_then(rotation);
        transform.translation = place.vector("move", Length).unwrap_or_else(Vec3::zeros);
        place.finish();
    }
    if let Some(mirror) = reader.table("mirror", "stage.replay.mirror") {
        let (point, normal) = (mirror.need_vector("point", Length), mirror.need_direction("normal"));
        mirror.finish();
        transform.mirror = point.zip(normal);
    }
    transform
}
