//! Two sets of runs against each other: same measures, same axes, difference of means with 95 % intervals, verdict.
//!
//! Every run is a replicate: its measures, its gates and its heaps are one draw from what its set would give with other
//! seeds, and the scatter over a set's runs is the only uncertainty that counts. A difference is that of the runs minus the
//! reference, and it is judged against a margin: the difference that would not matter (two one-sided tests, Schuirmann
//! 1987, with the 95 % interval instead of the 90 % one).

mod curves;
mod gates;
mod judge;
mod margin;
mod matching;
mod noise;

pub use curves::{Axis, CurveComparison, Distance, SetCurve};
pub use judge::Verdict;
pub use margin::{Kind, Margin};

use super::statistics::two_samples::difference_of_means;
use super::statistics::{mean, standard_deviation};
use judge::judge;
use margin::Margins;
use matching::Quantity;
use serde::Serialize;
use std::collections::BTreeMap;

/// What one run brings into a comparison.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct RunRecord {
    /// How the user finds it again: its folder.
    pub name: String,
    /// Measures with their unit at the end of the name, `<stage>.<measure>` in a run of stages; `None` where one could not be
    /// taken.
    pub measures: BTreeMap<String, Option<f64>>,
    /// What passed its gates.
    pub gates: Vec<GateRecord>,
    /// Surfaces of its measured heaps.
    pub heaps: Vec<HeapRecord>,
}

/// What passed a gate, one entry a crossing, in any order.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct GateRecord {
    /// Name of the gate.
    pub gate: String,
    /// Plant times of the passages [s].
    pub times: Vec<f64>,
    /// Masses [kg].
    pub masses: Vec<f64>,
    /// Speeds along the gate's normal [m/s].
    pub normal_speeds: Vec<f64>,
    /// Diameters [m].
    pub diameters: Vec<f64>,
}

/// Surface of a heap in a run's final state.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct HeapRecord {
    /// Name of the angle of repose whose region it is, `<stage>.<measure>` in a run of stages.
    pub measure: String,
    /// Place along the heap's axis and height [m], in order of place.
    pub surface: Vec<[f64; 2]>,
}

/// Two sets of runs, compared.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Comparison {
    /// Version of this format: another major means that a field changed its meaning or went away.
    pub format_major: u32,
    /// A larger minor only adds fields.
    pub format_minor: u32,
    /// Version of the program that compared.
    pub tollgate_version: String,
    /// The worst of all verdicts.
    pub verdict: Verdict,
    /// Folders of the runs.
    pub runs: Vec<String>,
    /// Folders of the reference's runs.
    pub reference: Vec<String>,
    /// Numbers, one entry each.
    pub measures: Vec<MeasureComparison>,
    /// Curves and distributions, one entry each.
    pub curves: Vec<CurveComparison>,
    /// What could not be compared on either side, and why.
    pub notes: Vec<String>,
}

/// Version of [`Comparison`].
pub const FORMAT: (u32, u32) = (1, 0);

/// One number, compared.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct MeasureComparison {
    /// Name, without its unit.
    pub name: String,
    /// Unit; empty for a pure number.
    pub unit: String,
    /// What it is: decides the margin.
    pub kind: Kind,
    /// The runs.
    pub runs: Option<SetFigure>,
    /// The reference.
    pub reference: Option<SetFigure>,
    /// Mean of the runs - mean of the reference.
    pub difference: Option<f64>,
    /// 95 % interval of the difference (Welch 1947).
    pub interval_95: Option<[f64; 2]>,
    /// Degrees of freedom of the interval; null where nothing scatters.
    pub degrees_of_freedom: Option<f64>,
    /// Largest difference that would not matter, in `unit`.
    pub margin: Option<f64>,
    /// The margin as it was asked for.
    pub margin_asked: Margin,
    /// The verdict.
    pub verdict: Verdict,
    /// Runs that each side needs to decide an inconclusive verdict, if difference and scatter stay as they are.
    pub runs_needed: Option<u64>,
    /// What is doubtful; empty where nothing is.
    pub note: String,
}

/// A number over the runs of one side.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct SetFigure {
    /// Name in the runs' summaries, with its unit.
    pub name: String,
    /// Runs in which it has a value.
    pub count: usize,
    /// Mean.
    pub mean: f64,
    /// Standard deviation of single runs; null for fewer than two.
    pub standard_deviation: Option<f64>,
    /// Value of every run; null where it has none.
    pub values: Vec<Option<f64>>,
}

/// Compares `runs` with a `reference`; `margins` are names with the margin asked for, as in ("heap_angle", "2 deg").
///
/// # Errors
/// Everything that is wrong with `margins`, or that a side holds no run.
pub fn compare(
    runs: &[RunRecord],
    reference: &[RunRecord],
    margins: &[(String, String)],
) -> Result<Comparison, Vec<String>> {
    if runs.is_empty() || reference.is_empty() {
        return Err(vec!["each side needs at least one run".to_owned()]);
    }
    let sides = [runs, reference];
    let (mut quantities, mut notes) = matching::quantities(sides);
    let gates = gates::names(sides);
    for gate in &gates {
        quantities.extend(gates::quantities(gate, sides, &mut notes));
    }
    let mut pictured = gates::curves(&gates, sides);
    pictured.extend(matching::surfaces(sides));
    let mut known: Vec<(String, String)> = quantities.iter().map(|q| (q.name.clone(), q.unit.clone())).collect();
    known.extend(pictured.iter().map(|curve| (curve.name.clone(), curve.unit().to_owned())));
    let margins = Margins::read(margins, &known)?;
    let measures: Vec<MeasureComparison> = quantities.iter().map(|quantity| compare_one(quantity, &margins)).collect();
    let curves: Vec<CurveComparison> = pictured.iter().map(|curve| curve.compare(&margins)).collect();
    let verdicts = measures.iter().map(|m| m.verdict).chain(curves.iter().map(|c| c.verdict));
    if measures.is_empty() && curves.is_empty() {
        notes.push("there is nothing to compare: no run has a measure or a gate".to_owned());
    }
    Ok(Comparison {
        format_major: FORMAT.0,
        format_minor: FORMAT.1,
        tollgate_version: env!("CARGO_PKG_VERSION").to_owned(),
        verdict: verdicts.max().unwrap_or(Verdict::Inconclusive),
        runs: runs.iter().map(|run| run.name.clone()).collect(),
        reference: reference.iter().map(|run| run.name.clone()).collect(),
        measures,
        curves,
        notes,
    })
}

fn compare_one(quantity: &Quantity, margins: &Margins) -> MeasureComparison {
    let present = [0, 1].map(|side| quantity.values[side].iter().flatten().copied().collect::<Vec<f64>>());
    let figure = |side: usize| {
        Some(SetFigure {
            name: quantity.sources[side].clone(),
            count: present[side].len(),
            mean: mean(&present[side])?,
            standard_deviation: standard_deviation(&present[side]),
            values: quantity.values[side].clone(),
        })
    };
    let (runs, reference) = (figure(0), figure(1));
    let margin_asked = margins.of(&quantity.name, quantity.kind);
    let margin = reference.as_ref().map(|figure| margin_asked.absolute(figure.mean.abs()));
    let compared = difference_of_means(&present[0], &present[1]);
    let scatter = compared.and_then(|(_, scatter)| scatter);
    let mut judged = judge(compared.map(|(difference, _)| difference), scatter, margin.unwrap_or(f64::NAN));
    let missing = missing_values(quantity, &present);
    if !missing.is_empty() && judged.verdict == Verdict::Agrees {
        // The runs that have a value are not a fair draw of the set.
        judged.verdict = Verdict::Inconclusive;
    }
    let mut notes = missing;
    notes.extend(quantity.note.clone());
    notes.extend(few_runs([present[0].len(), present[1].len()]));
    MeasureComparison {
        name: quantity.name.clone(),
        unit: quantity.unit.clone(),
        kind: quantity.kind,
        runs,
        reference,
        difference: compared.map(|(difference, _)| difference),
        interval_95: judged.interval,
        degrees_of_freedom: scatter.map(|scatter| scatter.degrees_of_freedom).filter(|d| d.is_finite()),
        margin,
        margin_asked,
        verdict: judged.verdict,
        runs_needed: judged.runs_needed,
        note: notes.join("; "),
    }
}

/// Runs from which on a side's scatter is known well enough for Welch's interval, whatever the other side has.
const FEW_RUNS: usize = 5;
const SIDES: [&str; 2] = ["the runs", "the reference"];

/// On which side a value is missing, in words.
fn missing_values(quantity: &Quantity, present: &[Vec<f64>; 2]) -> Vec<String> {
    let missing = |side: usize| {
        let (have, all) = (present[side].len(), quantity.values[side].len());
        match have {
            0 => Some(format!("{} have no value", SIDES[side]).replace("reference have", "reference has")),
            _ if have < all => Some(format!("only {have} of {all} of {} have a value", SIDES[side])),
            _ => None,
        }
    };
    [missing(0), missing(1)].into_iter().flatten().collect()
}

/// What a side with a single run, or with few, means for the interval, in words.
fn few_runs(counts: [usize; 2]) -> Option<String> {
    match counts {
        [1, 1] => Some("one run on each side: nothing is known of the scatter".to_owned()),
        [1, n] if n > 1 => Some("one run: the interval rests on the reference's scatter".to_owned()),
        [n, 1] if n > 1 => Some("one reference run: the interval rests on the runs' scatter".to_owned()),
        [a, b] if a.min(b) > 1 && a.min(b) < FEW_RUNS && a.max(b) > 2 * a.min(b) => Some(format!(
            "only {} runs on one side and {} on the other: Welch's interval is somewhat too narrow there",
            a.min(b),
            a.max(b)
        )),
        _ => None,
    }
}

#[cfg(test)]
mod tests;
