//! The comparison as a picture: differences over their margins, then every curve with its bands.

use super::{Row, rounded, rows};
use crate::analysis::compare::{Comparison, CurveComparison, SetCurve, Verdict};
use crate::report::figure::{Axis, FIGURE_WIDTH, Figure, Layer, Marks};
use crate::report::svg::{Anchor, Document, FONT_SIZE, number};

const ROW: f64 = 24.0;
const TOP: f64 = 76.0;
/// Place of the scale, in pixels, and its ends in margins.
const SCALE: [f64; 2] = [330.0, 800.0];
const REACH: f64 = 3.0;
const PAGE: f64 = 2.0 * FIGURE_WIDTH;

/// Colours that differ also for those who see no red or green (Okabe and Ito 2008), and in lightness.
const STYLE: &str = ".within{fill:#e3f1ec}.one{stroke:#7a9e91;stroke-width:1;stroke-dasharray:4 3;fill:none}\
    .zero{stroke:#555;stroke-width:1;fill:none}.agrees{fill:#009e73}.inconclusive{fill:#8a8a8a}.differs{fill:#d55e00}\
    .bar-agrees,.bar-inconclusive,.bar-differs{stroke-width:2.4;fill:none}.bar-agrees{stroke:#009e73}\
    .bar-inconclusive{stroke:#8a8a8a}.bar-differs{stroke:#d55e00}.head{font-weight:bold}\n";

/// Draws a comparison as an SVG document.
#[must_use]
pub fn picture(comparison: &Comparison) -> String {
    let rows = rows(comparison);
    let figures: Vec<Figure> = comparison.curves.iter().filter(|c| !c.grid.is_empty()).map(figure).collect();
    let table_height = TOP + ROW * rows.len() as f64 + 50.0;
    let figure_height = figures.iter().map(Figure::height).fold(0.0, f64::max);
    let height = table_height + figure_height * figures.len().div_ceil(2) as f64;
    let style = figures.iter().fold(STYLE.to_owned(), |style, figure| style + &figure.style());
    let title =
        format!("{}: {} runs against {}", comparison.verdict.word(), comparison.runs.len(), comparison.reference.len());
    let mut document = Document::new(PAGE, height, &title, &style);
    document.label([20.0, 28.0], Anchor::Start, "head", &format!("{title} of the reference"));
    draw_rows(&mut document, &rows);
    for (place, figure) in figures.iter().enumerate() {
        let (x, y) = ((place % 2) as f64 * FIGURE_WIDTH, table_height + (place / 2) as f64 * figure_height);
        document.raw(&format!("<g transform=\"translate({} {})\">", number(x), number(y)));
        figure.draw(&mut document, &format!("plot{place}"));
        document.raw("</g>");
    }
    document.finish()
}

/// Pixel of a difference in margins; what is beyond the scale stands at its end.
fn pixel(margins: f64) -> f64 {
    let share = (margins.clamp(-REACH, REACH) + REACH) / (2.0 * REACH);
    SCALE[0] + share * (SCALE[1] - SCALE[0])
}

fn draw_rows(document: &mut Document, rows: &[Row]) {
    let (top, bottom) = (TOP - 10.0, TOP + ROW * rows.len() as f64);
    let corners = [[pixel(-1.0), top], [pixel(1.0), top], [pixel(1.0), bottom], [pixel(-1.0), bottom]];
    document.path("within", corners, true);
    for (margins, class) in [(-1.0, "one"), (0.0, "zero"), (1.0, "one")] {
        document.line(class, [pixel(margins), top], [pixel(margins), bottom]);
    }
    for margins in [-3.0, -2.0, -1.0, 0.0, 1.0, 2.0, 3.0] {
        document.label([pixel(margins), bottom + 18.0], Anchor::Middle, "", &format!("{margins}"));
    }
    let middle = 0.5 * (SCALE[0] + SCALE[1]);
    document.label([middle, TOP - 20.0], Anchor::Middle, "", "difference and its 95 % interval, in margins");
    document.label([SCALE[1] + 24.0, TOP - 20.0], Anchor::Start, "", "difference, margin, verdict");
    for (place, row) in rows.iter().enumerate() {
        draw_row(document, *row, TOP + ROW * (place as f64 + 0.5));
    }
}

fn draw_row(document: &mut Document, row: Row, y: f64) {
    let word = row.verdict().word();
    let text = y + 0.35 * FONT_SIZE;
    document.label([SCALE[0] - 14.0, text], Anchor::End, "", row.name());
    document.label([SCALE[1] + 24.0, text], Anchor::Start, "", &values(row));
    let (Some(difference), Some(margin)) = (row.difference(), row.margin()) else { return };
    // A margin of zero is passed by any difference.
    let in_margins = |value: f64| {
        if margin > 0.0 || value == 0.0 {
            value / margin.max(f64::MIN_POSITIVE)
        } else {
            value.signum() * f64::INFINITY
        }
    };
    if let Some([low, high]) = row.interval() {
        let (left, right) = (pixel(in_margins(low)), pixel(in_margins(high)));
        document.line(&format!("bar-{word}"), [left, y], [right, y]);
        for (end, at) in [(in_margins(low), left), (in_margins(high), right)] {
            if end.abs() > REACH {
                let base = at - 8.0 * end.signum();
                document.path(word, [[at, y], [base, y - 5.0], [base, y + 5.0]], true);
            } else {
                document.line(&format!("bar-{word}"), [at, y - 5.0], [at, y + 5.0]);
            }
        }
    }
    let x = pixel(in_margins(difference));
    // Shapes tell the verdicts apart without colour.
    match row.verdict() {
        Verdict::Agrees => {
            document.raw(&format!("<circle class=\"{word}\" cx=\"{}\" cy=\"{}\" r=\"4.5\"/>", number(x), number(y)))
        }
        Verdict::Inconclusive => {
            document.path(word, [[x - 4.5, y - 4.5], [x + 4.5, y - 4.5], [x + 4.5, y + 4.5], [x - 4.5, y + 4.5]], true)
        }
        Verdict::Differs => document.path(word, [[x, y - 6.5], [x + 6.5, y], [x, y + 6.5], [x - 6.5, y]], true),
    }
}

fn values(row: Row) -> String {
    let (Some(difference), Some(margin)) = (row.difference(), row.margin()) else {
        return format!("{} ({})", row.verdict().word(), if row.note().is_empty() { "no value" } else { row.note() });
    };
    let unit = if row.unit().is_empty() { String::new() } else { format!(" {}", row.unit()) };
    let shown = rounded(difference, row.scale());
    format!("{shown}{unit}, margin {}{unit}: {}", rounded(margin, margin), row.words())
}

fn figure(curve: &CurveComparison) -> Figure {
    let with_unit =
        |label: &str, unit: &str| if unit.is_empty() { label.to_owned() } else { format!("{label} [{unit}]") };
    let mut layers = Vec::new();
    let sides = [("reference", curve.reference.as_ref(), 0), ("runs", curve.runs.as_ref(), 1)];
    for (label, set, colour) in &sides {
        if let Some(band) = set.and_then(|set| band(curve, set)) {
            layers.push(Layer {
                label: format!("{label}: 95 % interval of the mean"),
                colour: *colour,
                marks: Marks::Band(band),
            });
        }
    }
    for (label, set, colour) in sides {
        if let Some(set) = set {
            let points = outline(curve, &set.mean).into_iter().map(|(x, k)| [x, set.mean[k]]).collect();
            let marks = if colour == 0 { Marks::Line(points) } else { Marks::DashedLine(points) };
            layers.push(Layer { label: format!("{label}: mean of {}", set.count), colour, marks });
        }
    }
    let row = Row::Curve(curve);
    Figure {
        title: format!("{}: {}", curve.name, curve.verdict.word()),
        x: Axis { label: with_unit(&curve.x.label, &curve.x.unit), ..Axis::default() },
        y: Axis { label: with_unit(&curve.y.label, &curve.y.unit), range: range(curve), ..Axis::default() },
        layers,
        caption: format!("Largest difference {}.", values(row)),
        ordered_colours: 0,
    }
}

/// Shares start at 0, and leave room for the legend above them; other curves take what they need.
fn range(curve: &CurveComparison) -> Option<[f64; 2]> {
    let sets = [curve.runs.as_ref(), curve.reference.as_ref()];
    let highest = sets.into_iter().flatten().flat_map(|set| &set.mean).copied().fold(0.0, f64::max);
    (!curve.bin_edges.is_empty() && highest > 0.0).then_some([0.0, 1.5 * highest])
}

fn band(curve: &CurveComparison, set: &SetCurve) -> Option<Vec<[f64; 3]>> {
    let half = set.half_width_95.as_ref()?;
    let at = |(x, k): (f64, usize)| [x, set.mean[k] - half[k], set.mean[k] + half[k]];
    Some(outline(curve, &set.mean).into_iter().map(at).collect())
}

/// Place and index of every point that is drawn: of a histogram both edges of every bin.
fn outline(curve: &CurveComparison, mean: &[f64]) -> Vec<(f64, usize)> {
    if curve.bin_edges.is_empty() {
        return curve.grid.iter().copied().zip(0..mean.len()).collect();
    }
    (0..mean.len()).flat_map(|k| [(curve.bin_edges[k], k), (curve.bin_edges[k + 1], k)]).collect()
}
