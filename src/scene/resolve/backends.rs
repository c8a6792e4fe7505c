//! `backend` and `[liggghts]`: who computes, and what the external code is told.

use crate::scene::backend::{BackendName, DeckPlace, LiggghtsSettings};
use crate::scene::quantity::Dimension::{Length, Time};
use crate::scene::reader::{Limit, Reader};
use crate::scene::tree::{Node, Value};
use std::path::Path;

/// The words of `backend`.
const NAMES: [(&str, BackendName); 2] =
    [(BackendName::Native.text(), BackendName::Native), (BackendName::Liggghts.text(), BackendName::Liggghts)];

/// Reads `backend`, of the scene or of a stage.
pub(super) fn backend(reader: &Reader<'_>) -> Option<BackendName> {
    reader.word("backend", &NAMES)
}

/// Reads `[liggghts]`.
pub(super) fn liggghts(reader: &Reader<'_>, base: &Path) -> LiggghtsSettings {
    let default = LiggghtsSettings::default();
    let Some(table) = reader.table("liggghts", "liggghts") else { return default };
    let mut settings = LiggghtsSettings {
        sample_every: table.integer("sample_every", 20).unwrap_or(default.sample_every),
        batch_every: table.integer("batch_every", 100).unwrap_or(default.batch_every),
        contacts: table.boolean("contacts", default.contacts),
        ranks: table.integer("ranks", 2).map_or(default.ranks, |ranks| u32::try_from(ranks).unwrap_or(u32::MAX)),
        processors: processors(&table),
        skin: table.quantity("skin", Length, Limit::Positive),
        templates: table.text("templates").map(|folder| base.join(folder)),
        mpirun: texts(&table, "mpirun"),
        time_limit: table.quantity("time_limit", Time, Limit::Positive).unwrap_or(default.time_limit),
        keep_samples: table.boolean("keep_samples", default.keep_samples),
        ..default
    };
    if let Some(places) = table.table("lines", "liggghts.lines") {
        for place in DeckPlace::ALL {
            let lines = texts(&places, place.text());
            if !lines.is_empty() {
                settings.lines.insert(place, lines);
            }
        }
        places.finish();
    }
    table.finish();
    settings
}

/// Numbers of ranks along x, y and z.
fn processors(table: &Reader<'_>) -> Option<[u32; 3]> {
    let node = table.node("processors")?;
    let count = |node: &Node| match &node.value {
        Value::Integer(count) => u32::try_from(*count).ok().filter(|count| *count > 0),
        _ => None,
    };
    let counts = match &node.value {
        Value::Array(items) => items.iter().map(count).collect::<Option<Vec<u32>>>(),
        _ => None,
    };
    let counts = counts.and_then(|counts| <[u32; 3]>::try_from(counts).ok());
    if counts.is_none() {
        table.wrong_type("processors", node, "an array of three whole numbers above 0", "[1, 1, 2]");
    }
    counts
}

/// An array of texts; empty where it is not given.
fn texts(table: &Reader<'_>, key: &'static str) -> Vec<String> {
    let Some(node) = table.node(key) else { return Vec::new() };
    let text = |node: &Node| match &node.value {
        Value::Text(text) => Some(text.clone()),
        _ => None,
    };
    let texts = match &node.value {
        Value::Array(items) => items.iter().map(text).collect::<Option<Vec<String>>>(),
        _ => None,
    };
    if texts.is_none() {
        table.wrong_type(key, node, "an array of texts", "[\"…\"]");
    }
    texts.unwrap_or_default()
}
