//! The comparison as text: a table of numbers, a table of curves, what is doubtful, the verdict.

use super::{Row, rounded, rows};
use crate::analysis::compare::{Comparison, Margin, SetFigure, Verdict};

/// Renders a comparison as text.
#[must_use]
pub fn table(comparison: &Comparison) -> String {
    let mut lines = vec![format!(
        "{} against {} (reference); difference = runs - reference, with 95 % intervals",
        counted(comparison.runs.len(), "run"),
        counted(comparison.reference.len(), "run"),
    )];
    if !comparison.measures.is_empty() {
        lines.push(String::new());
        lines.extend(aligned(&numbers(comparison)));
    }
    if !comparison.curves.is_empty() {
        lines.push(String::new());
        lines.extend(aligned(&curves(comparison)));
    }
    let notes: Vec<String> = rows(comparison)
        .iter()
        .filter(|row| !row.note().is_empty())
        .map(|row| format!("  {}: {}", row.name(), row.note()))
        .chain(comparison.notes.iter().map(|note| format!("  {note}")))
        .collect();
    if !notes.is_empty() {
        lines.push(String::new());
        lines.push("to be noted:".to_owned());
        lines.extend(notes);
    }
    lines.push(String::new());
    lines.push(conclusion(comparison));
    lines.join("\n")
}

fn counted(count: usize, word: &str) -> String {
    format!("{count} {word}{}", if count == 1 { "" } else { "s" })
}

fn numbers(comparison: &Comparison) -> Vec<Vec<String>> {
    let header = ["measure", "unit", "runs", "reference", "difference", "95 % interval", "margin", "verdict"];
    let mut cells = vec![header.map(str::to_owned).to_vec()];
    for measure in &comparison.measures {
        let row = Row::Number(measure);
        cells.push(vec![
            measure.name.clone(),
            unit(row),
            figure(measure.runs.as_ref()),
            figure(measure.reference.as_ref()),
            difference(row),
            interval(row),
            margin(row),
            row.words(),
        ]);
    }
    cells
}

fn curves(comparison: &Comparison) -> Vec<Vec<String>> {
    let header = ["curve", "unit", "largest difference", "95 % interval", "noise", "margin", "verdict"];
    let mut cells = vec![header.map(str::to_owned).to_vec()];
    for curve in &comparison.curves {
        let row = Row::Curve(curve);
        let place = curve.largest_at.map_or_else(String::new, |at| {
            let extent = curve.grid.last().unwrap_or(&at) - curve.grid.first().unwrap_or(&at);
            format!(" at {} {}", rounded(at, 0.01 * extent.abs()), curve.x.unit)
        });
        cells.push(vec![
            curve.name.clone(),
            unit(row),
            difference(row) + &place,
            interval(row),
            curve.noise_95.map_or_else(dash, |noise| rounded(noise, row.scale())),
            margin(row),
            row.words(),
        ]);
    }
    cells
}

fn dash() -> String {
    "-".to_owned()
}

fn unit(row: Row) -> String {
    let unit = row.unit();
    if unit.is_empty() { dash() } else { unit.to_owned() }
}

fn figure(figure: Option<&SetFigure>) -> String {
    let Some(figure) = figure else { return dash() };
    match figure.standard_deviation {
        Some(deviation) if deviation > 0.0 => {
            // Nobody reads a seventh digit, however little it scatters.
            let scale = deviation.max(1e-4 * figure.mean.abs());
            format!("{} \u{b1} {}", rounded(figure.mean, scale), rounded(deviation, deviation))
        }
        _ => plain(figure.mean),
    }
}

/// A number that does not scatter: whole as it is, others with six digits.
fn plain(value: f64) -> String {
    if value.fract() == 0.0 && value.abs() < 1e9 { format!("{value}") } else { rounded(value, value.abs() * 1e-4) }
}

fn difference(row: Row) -> String {
    row.difference().map_or_else(dash, |difference| rounded(difference, row.scale()))
}

fn interval(row: Row) -> String {
    let shown = |[low, high]: [f64; 2]| format!("{} to {}", rounded(low, row.scale()), rounded(high, row.scale()));
    row.interval().map_or_else(dash, shown)
}

fn margin(row: Row) -> String {
    let Some(margin) = row.margin() else { return dash() };
    // A distance has no sign.
    let sign = if matches!(row, Row::Number(_)) { "\u{b1} " } else { "" };
    let absolute = format!("{sign}{}", rounded(margin, margin));
    match row.margin_asked() {
        Margin::Relative(share) => format!("{absolute} ({} %)", (1e6 * share).round() / 1e4),
        Margin::Absolute(_) => absolute,
    }
}

/// Columns of one width, text to the left.
fn aligned(cells: &[Vec<String>]) -> Vec<String> {
    let columns = cells.first().map_or(0, Vec::len);
    let width = |column: usize| cells.iter().map(|row| row[column].chars().count()).max().unwrap_or(0);
    let widths: Vec<usize> = (0..columns).map(width).collect();
    let line = |row: &Vec<String>| {
        let padded = row.iter().zip(&widths).map(|(cell, width)| format!("{cell:width$}"));
        format!("  {}", padded.collect::<Vec<_>>().join("  ")).trim_end().to_owned()
    };
    cells.iter().map(line).collect()
}

/// The overall verdict, with the lines that made it.
fn conclusion(comparison: &Comparison) -> String {
    let all = rows(comparison);
    let of =
        |verdict: Verdict| all.iter().filter(|row| row.verdict() == verdict).map(|row| row.name()).collect::<Vec<_>>();
    let (different, undecided) = (of(Verdict::Differs), of(Verdict::Inconclusive));
    let mut text = match comparison.verdict {
        Verdict::Agrees => return format!("agrees: all {} lie within their margins", all.len()),
        Verdict::Differs => format!("differs: {} of {} ({})", different.len(), all.len(), different.join(", ")),
        Verdict::Inconclusive => "inconclusive".to_owned(),
    };
    if !undecided.is_empty() {
        let lead = if comparison.verdict == Verdict::Differs { "; inconclusive: " } else { ": " };
        text += &format!("{lead}{} of {} ({})", undecided.len(), all.len(), undecided.join(", "));
    }
    text
}
