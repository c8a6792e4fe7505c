//! `[[gate]]`: where the plant is cut, and what is stored there.

use super::Located;
use crate::geometry::plane::{Aperture, GatePlane};
use crate::scene::diagnostics::Place;
use crate::scene::gate::{Exclusion, ExclusionMode, Fate, Gate, PassingPoint, PathRecording};
use crate::scene::quantity::Dimension::Length;
use crate::scene::reader::{Limit, Reader};
use crate::scene::tree::{Node, Value};

/// A length at a gate where the scene does not say, in largest diameters.
const DEFAULT_LENGTH: f64 = 1.2;
/// Time steps between two stored states of a path where the scene does not say.
const DEFAULT_EVERY: u64 = 10;

/// The words for what becomes of a particle that leaves the ordinary course.
pub(super) const FATES: [(&str, Fate); 3] = [("keep", Fate::Keep), ("delete", Fate::Delete), ("error", Fate::Error)];

/// The length of a zone where the scene does not say [m].
pub(super) fn default_length(largest: f64) -> f64 {
    DEFAULT_LENGTH * largest
}

/// All gates, in the file's order; `largest` is the largest diameter of any particle [m].
pub(super) fn gates(
    reader: &Reader<'_>,
    largest: f64,
    names: &mut Vec<(&'static str, String, Place)>,
) -> Vec<Located<Gate>> {
    let mut gates = Vec::new();
    for table in reader.tables("gate", "gate") {
        let path = table.path();
        let place = table.place_of("name");
        let name = table.name();
        if let Some(name) = &name {
            names.push(("gate", name.clone(), place));
        }
        if let Some(item) = gate(table, name, largest) {
            gates.push(Located { path, item });
        }
    }
    gates
}

fn gate(reader: Reader<'_>, name: Option<String>, largest: f64) -> Option<Gate> {
    let (point, normal) = (reader.need_vector("point", Length), reader.need_direction("normal"));
    let aperture = aperture(&reader);
    let passage = reader
        .word("passage", &[("centre", PassingPoint::Centre), ("lowest-point", PassingPoint::LowestPoint)])
        .unwrap_or(PassingPoint::Centre);
    let exclusion = exclusion(&reader, largest);
    let paths = paths(&reader, largest);
    let returning = reader.word("returning", &FATES).unwrap_or(Fate::Keep);
    let sitting = reader.word("sitting", &FATES).unwrap_or(Fate::Keep);
    reader.finish();
    let plane = GatePlane { point: point?, normal: normal?, aperture: aperture? };
    Some(Gate { name: name?, plane, passage, exclusion, paths, returning, sitting })
}

/// The opening: the whole plane where none is given; `None` where it is wrong.
fn aperture(reader: &Reader<'_>) -> Option<Aperture> {
    if !reader.has("aperture") {
        return Some(Aperture::Unbounded);
    }
    let table = reader.table("aperture", "gate.aperture")?;
    let aperture = if table.need_word("shape", &[("disc", true), ("rectangle", false)])? {
        table.need_quantity("radius", Length, Limit::Positive).map(|radius| Aperture::Disc { radius })
    } else {
        let (side_a, side_b) = (table.need_vector("side_a", Length), table.need_vector("side_b", Length));
        side_a.zip(side_b).map(|(side_a, side_b)| Aperture::Rectangle { side_a, side_b })
    };
    table.finish();
    aperture
}

fn exclusion(reader: &Reader<'_>, largest: f64) -> Exclusion {
    let mut exclusion = Exclusion { mode: ExclusionMode::Buffer, length: default_length(largest) };
    let Some(table) = reader.table("exclusion", "gate.exclusion") else { return exclusion };
    let modes = [
        ("constant", ExclusionMode::Constant),
        ("ballistic", ExclusionMode::Ballistic),
        ("buffer", ExclusionMode::Buffer),
    ];
    exclusion.mode = table.word("mode", &modes).unwrap_or(exclusion.mode);
    exclusion.length = table.quantity("length", Length, Limit::Positive).unwrap_or(exclusion.length);
    table.finish();
    exclusion
}

/// The paths before the gate: a table, or "none".
fn paths(reader: &Reader<'_>, largest: f64) -> Option<PathRecording> {
    let mut paths = PathRecording { every: DEFAULT_EVERY, length: default_length(largest) };
    match reader.node("paths") {
        None => return Some(paths),
        Some(node @ Node { value: Value::Text(_), .. }) => {
            // Any other word is a finding, and the paths are taken as stored.
            return match reader.word_of("paths", node, &[("none", ())]) {
                Some(()) => None,
                None => Some(paths),
            };
        }
        Some(_) => {}
    }
    let Some(table) = reader.table("paths", "gate.paths") else { return Some(paths) };
    if let Some(every) = table.integer("every", DEFAULT_EVERY) {
        if every == 0 {
            table.out_of_range("every", &table.place_of("every"), "be at least 1", "0");
        } else {
            paths.every = every;
        }
    }
    paths.length = table.quantity("length", Length, Limit::Positive).unwrap_or(paths.length);
    table.finish();
    Some(paths)
}
