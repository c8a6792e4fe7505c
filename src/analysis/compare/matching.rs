//! Which figure of one side is which of the other.
//!
//! Runs cut at the same gates have the same names. A run cut into stages has `<stage>.<measure>` where a whole one has
//! `<measure>`: those belong together too, as long as it is clear which.

use super::curves::{Curves, surface_curves};
use super::margin::Kind;
use super::{GateRecord, HeapRecord, RunRecord};
use crate::analysis::replicates::is_figure;
use std::collections::{BTreeMap, BTreeSet};

/// A number that both sides have, or should have.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Quantity {
    /// Name without its unit.
    pub name: String,
    /// Unit.
    pub unit: String,
    /// What it is.
    pub kind: Kind,
    /// Its name on each side.
    pub sources: [String; 2],
    /// Its values, one a run.
    pub values: [Vec<Option<f64>>; 2],
    /// What must be said about it.
    pub note: Option<String>,
}

/// Units as they end a name in `summary.json`, longest first.
const ENDINGS: [(&str, &str); 8] = [
    ("_kg_per_s", "kg/s"),
    ("_m_per_s", "m/s"),
    ("_percent", "%"),
    ("_deg", "deg"),
    ("_kg", "kg"),
    ("_m", "m"),
    ("_s", "s"),
    ("_J", "J"),
];

/// How a unit ends a name.
pub(super) fn ending(unit: &str) -> &'static str {
    ENDINGS.iter().find(|(_, known)| *known == unit).map_or("", |(ending, _)| ending)
}

/// Name and unit of a measure.
fn split_unit(name: &str) -> (&str, &'static str) {
    let found = ENDINGS.iter().find_map(|(ending, unit)| Some((name.strip_suffix(ending)?, *unit)));
    found.filter(|(bare, _)| !bare.is_empty()).unwrap_or((name, ""))
}

/// Name without its stage.
fn bare(name: &str) -> &str {
    name.rsplit_once('.').map_or(name, |(_, bare)| bare)
}

/// All measures of both sides, matched, and what could not be.
pub(super) fn quantities(sides: [&[RunRecord]; 2]) -> (Vec<Quantity>, Vec<String>) {
    let names = sides.map(|runs| {
        let names = runs.iter().flat_map(|run| run.measures.keys()).filter(|name| is_figure(name));
        names.map(String::as_str).collect::<BTreeSet<_>>()
    });
    let has_value =
        |side: usize, name: &str| sides[side].iter().any(|run| run.measures.get(name).is_some_and(Option::is_some));
    let (pairs, notes) = pairs(&names, &has_value);
    let quantity = |[first, second]: [Option<&str>; 2]| {
        let shown = longer(first, second);
        let (name, unit) = split_unit(shown);
        let values = |side: usize, source: Option<&str>| {
            let value = |run: &RunRecord| run.measures.get(source?).copied().flatten().filter(|v| v.is_finite());
            sides[side].iter().map(value).collect()
        };
        let differently = matches!((first, second), (Some(a), Some(b)) if a != b);
        Quantity {
            name: name.to_owned(),
            unit: unit.to_owned(),
            kind: Kind::of(name, unit),
            sources: [first, second].map(|source| source.unwrap_or_default().to_owned()),
            values: [values(0, first), values(1, second)],
            note: differently.then(|| format!("{} against {}", first.unwrap_or_default(), second.unwrap_or_default())),
        }
    };
    (pairs.into_iter().map(quantity).collect(), notes)
}

fn longer<'a>(first: Option<&'a str>, second: Option<&'a str>) -> &'a str {
    let (first, second) = (first.unwrap_or_default(), second.unwrap_or_default());
    if second.len() > first.len() { second } else { first }
}

type Pair<'a> = [Option<&'a str>; 2];

/// Pairs names: equal ones; else those that are equal without their stages, where one side has only one of them.
fn pairs<'a>(names: &[BTreeSet<&'a str>; 2], has_value: &dyn Fn(usize, &str) -> bool) -> (Vec<Pair<'a>>, Vec<String>) {
    let mut pairs: Vec<Pair<'a>> = names[0].intersection(&names[1]).map(|name| [Some(*name); 2]).collect();
    let mut notes = Vec::new();
    let mut left: BTreeMap<&str, [Vec<&'a str>; 2]> = BTreeMap::new();
    for side in 0..2 {
        for name in names[side].difference(&names[1 - side]) {
            left.entry(bare(name)).or_default()[side].push(name);
        }
    }
    for (bare, mut sources) in left {
        for (side, names) in sources.iter_mut().enumerate() {
            // A stage that has nothing to measure here does not stand in the way of the one that has.
            if names.iter().any(|name| has_value(side, name)) {
                names.retain(|name| has_value(side, name));
            }
        }
        match &sources {
            [first, second] if first.is_empty() || second.is_empty() => {
                pairs.extend(first.iter().map(|name| [Some(*name), None]));
                pairs.extend(second.iter().map(|name| [None, Some(*name)]));
            }
            [first, second] if first.len() == 1 || second.len() == 1 => {
                pairs.extend(first.iter().flat_map(|a| second.iter().map(move |b| [Some(*a), Some(*b)])));
            }
            [first, second] => {
                notes.push(format!(
                    "\"{bare}\" is measured in several stages on both sides, and their names differ: {} against {}",
                    first.join(", "),
                    second.join(", ")
                ));
                pairs.extend(first.iter().map(|name| [Some(*name), None]));
                pairs.extend(second.iter().map(|name| [None, Some(*name)]));
            }
        }
    }
    pairs.sort_by_key(|[first, second]| longer(*first, *second));
    (pairs, notes)
}

/// Surfaces of the heaps of both sides, matched like measures.
pub(super) fn surfaces(sides: [&[RunRecord]; 2]) -> Vec<Curves> {
    let names = sides
        .map(|runs| runs.iter().flat_map(|run| &run.heaps).map(|heap| heap.measure.as_str()).collect::<BTreeSet<_>>());
    let of = |side: usize, name: &str| -> Vec<&HeapRecord> {
        sides[side].iter().flat_map(|run| run.heaps.iter().find(|heap| heap.measure == name)).collect()
    };
    let (pairs, _) = pairs(&names, &|side, name| of(side, name).iter().any(|heap| !heap.surface.is_empty()));
    let curves = |[first, second]: Pair| {
        let heaps = [first.map_or_else(Vec::new, |name| of(0, name)), second.map_or_else(Vec::new, |name| of(1, name))];
        let surfaces = heaps.map(|heaps| heaps.iter().map(|heap| heap.surface.clone()).collect::<Vec<_>>());
        surface_curves(&format!("{}.surface", longer(first, second)), surfaces)
    };
    pairs.into_iter().map(curves).collect()
}

/// The records of a gate on each side, one a run that has it.
pub(super) fn records<'a>(gate: &str, sides: [&'a [RunRecord]; 2]) -> [Vec<Option<&'a GateRecord>>; 2] {
    sides.map(|runs| runs.iter().map(|run| run.gates.iter().find(|record| record.gate == gate)).collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn run(measures: &[(&str, Option<f64>)]) -> RunRecord {
        let measures = measures.iter().map(|(name, value)| ((*name).to_owned(), *value)).collect();
        RunRecord { measures, ..RunRecord::default() }
    }

    fn matched(a: &[(&str, Option<f64>)], b: &[(&str, Option<f64>)]) -> (Vec<[String; 2]>, Vec<String>) {
        let (quantities, notes) = quantities([&[run(a)], &[run(b)]]);
        (quantities.into_iter().map(|q| q.sources).collect(), notes)
    }

    fn pair(a: &str, b: &str) -> [String; 2] {
        [a.to_owned(), b.to_owned()]
    }

    #[test]
    fn units_stand_at_the_end_of_a_name() {
        assert_eq!(split_unit("chute.outflow_kg_per_s"), ("chute.outflow", "kg/s"));
        assert_eq!(split_unit("heap_angle_deg"), ("heap_angle", "deg"));
        assert_eq!(split_unit("heap_centre_x_m"), ("heap_centre_x", "m"));
        assert_eq!(split_unit("contacts"), ("contacts", ""));
        for (_, unit) in ENDINGS {
            assert_eq!(split_unit(&format!("a{}", ending(unit))), ("a", unit));
        }
    }

    #[test]
    fn stages_are_matched_with_each_other_or_with_the_whole() {
        let value = Some(1.0);
        let split = [("hopper.flow_kg_per_s", value), ("chute.angle_deg", value), ("hopper.angle_deg", None)];
        assert_eq!(matched(&split, &split).0.len(), 3, "equal names are equal");
        let (pairs, notes) = matched(&split, &[("angle_deg", value), ("flow_kg_per_s", value)]);
        let expected = [pair("chute.angle_deg", "angle_deg"), pair("hopper.flow_kg_per_s", "flow_kg_per_s")];
        assert_eq!((pairs, notes.len()), (expected.to_vec(), 0), "the stage without a heap is left out");
        let both = [("hopper.flow_kg_per_s", value), ("chute.flow_kg_per_s", value)];
        let (pairs, _) = matched(&[("flow_kg_per_s", value)], &both);
        assert_eq!(pairs.len(), 2, "the whole is compared with each stage: {pairs:?}");
        let others = [("a.flow_kg_per_s", value), ("b.flow_kg_per_s", value)];
        let (pairs, notes) = matched(&others, &both);
        assert_eq!((pairs.len(), notes.len()), (4, 1), "{pairs:?} {notes:?}");
    }

    #[test]
    fn notes_and_uncertainties_are_no_measures() {
        let (pairs, _) = matched(&[("a_uncertainty_deg", Some(1.0)), ("a_deg", Some(1.0)), ("a_note", None)], &[]);
        assert_eq!(pairs, [pair("a_deg", "")]);
    }
}
