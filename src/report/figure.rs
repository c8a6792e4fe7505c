//! A figure with axes: lines, bands and points.

use super::colour::{Colour, hexadecimal, magnitude, series};
use super::svg::{Anchor, Document, FONT_SIZE, LINE_HEIGHT, number, round_ticks, wrapped};

/// Width of a figure [px].
pub(super) const FIGURE_WIDTH: f64 = 720.0;
const PLOT: [f64; 2] = [80.0, 690.0];
const PLOT_TOP: f64 = 40.0;
const PLOT_HEIGHT: f64 = 380.0;
const LETTERS_A_LINE: usize = 84;

/// A figure.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Figure {
    /// Title above the plot.
    pub title: String,
    /// Horizontal axis.
    pub x: Axis,
    /// Vertical axis.
    pub y: Axis,
    /// What is drawn, from back to front.
    pub layers: Vec<Layer>,
    /// So many colours in the order of a magnitude, dark to light; 0 for colours that are merely different.
    pub ordered_colours: usize,
    /// Caption below the plot.
    pub caption: String,
}

/// An axis.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Axis {
    /// What it shows, with its unit.
    pub label: String,
    /// First and last value; `None` for what the layers need.
    pub range: Option<[f64; 2]>,
    /// Whether it is logarithmic; values <= 0 are not drawn then.
    pub logarithmic: bool,
}

/// Something drawn, with its name in the legend (none for an empty one).
#[derive(Debug, Clone, PartialEq)]
pub struct Layer {
    /// Name in the legend.
    pub label: String,
    /// Number of its colour; layers of one series share it.
    pub colour: usize,
    /// What it is.
    pub marks: Marks,
}

/// Marks of a layer. What is not finite is left out, and a line is broken there.
#[derive(Debug, Clone, PartialEq)]
pub enum Marks {
    /// A line through points (x, y).
    Line(Vec<[f64; 2]>),
    /// The same, dashed.
    DashedLine(Vec<[f64; 2]>),
    /// The band between two curves (x, low, high).
    Band(Vec<[f64; 3]>),
    /// Points (x, y, standard uncertainty of y); 0 for no bar.
    Points(Vec<[f64; 3]>),
}

impl Figure {
    /// The figure as an SVG document.
    #[must_use]
    pub fn to_svg(&self) -> String {
        let mut document = Document::new(FIGURE_WIDTH, self.height(), &self.title, &self.style());
        self.draw(&mut document, "plot");
        document.finish()
    }

    /// Its height [px].
    pub(super) fn height(&self) -> f64 {
        let caption = wrapped(&self.caption, LETTERS_A_LINE);
        PLOT_TOP + PLOT_HEIGHT + 62.0 + caption.len() as f64 * LINE_HEIGHT
    }

    /// Draws it with its upper left corner at the origin; `clip` names its plot area and is there once a document.
    pub(super) fn draw(&self, document: &mut Document, clip: &str) {
        let scales = [
            Scale::new(&self.x, self.values(0), PLOT),
            Scale::new(&self.y, self.values(1), [PLOT_TOP + PLOT_HEIGHT, PLOT_TOP]),
        ];
        self.draw_axes(document, &scales);
        document.raw(&format!(
            "<clipPath id=\"{clip}\"><rect x=\"{}\" y=\"{PLOT_TOP}\" width=\"{}\" height=\"{PLOT_HEIGHT}\"/></clipPath>\n\
             <g clip-path=\"url(#{clip})\">",
            PLOT[0],
            PLOT[1] - PLOT[0]
        ));
        for layer in &self.layers {
            draw(document, layer, &scales);
        }
        document.raw("</g>");
        self.draw_legend(document);
        for (k, line) in wrapped(&self.caption, LETTERS_A_LINE).iter().enumerate() {
            let y = PLOT_TOP + PLOT_HEIGHT + 70.0 + k as f64 * LINE_HEIGHT;
            document.label([PLOT[0], y], Anchor::Start, "", line);
        }
    }

    /// The classes it is drawn with; figures of one document share them.
    pub(super) fn style(&self) -> String {
        let mut style = String::from(
            ".f{fill:none;stroke:#222;stroke-width:1}.g{fill:none;stroke:#e4e4e4;stroke-width:1}\n.t{font-weight:bold}\n",
        );
        for layer in &self.layers {
            let (n, colour) = (layer.colour, hexadecimal(self.colour(layer.colour)));
            let rule = format!(
                ".l{n},.d{n}{{fill:none;stroke:{colour};stroke-width:1.8;stroke-linejoin:round}}.d{n}{{stroke-dasharray:7 4}}\
                 .b{n}{{fill:{colour};opacity:.22}}.p{n}{{fill:{colour};stroke:#fff;stroke-width:.7}}\
                 .e{n}{{stroke:{colour};stroke-width:1.3}}\n"
            );
            if !style.contains(&rule) {
                style += &rule;
            }
        }
        style
    }

    fn colour(&self, number: usize) -> Colour {
        if self.ordered_colours == 0 {
            return series(number);
        }
        // The yellow end is too pale for thin lines on white.
        let share = number as f64 / (self.ordered_colours - 1).max(1) as f64;
        magnitude(0.9 * share)
    }

    /// All drawable values on an axis, 0 for x and 1 for y.
    fn values(&self, axis: usize) -> Vec<f64> {
        let mut values = Vec::new();
        for layer in &self.layers {
            match (&layer.marks, axis) {
                (Marks::Line(points) | Marks::DashedLine(points), _) => values.extend(points.iter().map(|p| p[axis])),
                (Marks::Band(points) | Marks::Points(points), 0) => values.extend(points.iter().map(|p| p[0])),
                (Marks::Band(points), _) => values.extend(points.iter().flat_map(|p| [p[1], p[2]])),
                (Marks::Points(points), _) => values.extend(points.iter().flat_map(|p| [p[1] - p[2], p[1] + p[2]])),
            }
        }
        values
    }

    fn draw_axes(&self, document: &mut Document, [x, y]: &[Scale; 2]) {
        let bottom = PLOT_TOP + PLOT_HEIGHT;
        for (at, text) in x.ticks(6) {
            document.line("g", [at, PLOT_TOP], [at, bottom]);
            document.label([at, bottom + 20.0], Anchor::Middle, "", &text);
        }
        for (at, text) in y.ticks(6) {
            document.line("g", [PLOT[0], at], [PLOT[1], at]);
            document.label([PLOT[0] - 8.0, at + 0.35 * FONT_SIZE], Anchor::End, "", &text);
        }
        let frame = [[PLOT[0], PLOT_TOP], [PLOT[1], PLOT_TOP], [PLOT[1], bottom], [PLOT[0], bottom]];
        document.path("f", frame, true);
        document.label([0.5 * (PLOT[0] + PLOT[1]), bottom + 44.0], Anchor::Middle, "", &self.x.label);
        document.raw(&format!("<g transform=\"translate(20 {}) rotate(-90)\">", PLOT_TOP + 0.5 * PLOT_HEIGHT));
        document.label([0.0, 0.0], Anchor::Middle, "", &self.y.label);
        document.raw("</g>");
        document.label([PLOT[0], PLOT_TOP - 14.0], Anchor::Start, "t", &self.title);
    }

    fn draw_legend(&self, document: &mut Document) {
        let named = self.layers.iter().filter(|layer| !layer.label.is_empty());
        for (row, layer) in named.enumerate() {
            let (y, n) = (PLOT_TOP + 20.0 + row as f64 * LINE_HEIGHT, layer.colour);
            let (left, right) = (PLOT[0] + 14.0, PLOT[0] + 42.0);
            match layer.marks {
                Marks::Line(_) => document.line(&format!("l{n}"), [left, y], [right, y]),
                Marks::DashedLine(_) => document.line(&format!("d{n}"), [left, y], [right, y]),
                Marks::Band(_) => {
                    let corners = [[left, y - 5.0], [right, y - 5.0], [right, y + 5.0], [left, y + 5.0]];
                    document.path(&format!("b{n}"), corners, true);
                }
                Marks::Points(_) => draw_point(document, n, [0.5 * (left + right), y]),
            }
            document.label([right + 8.0, y + 0.35 * FONT_SIZE], Anchor::Start, "halo", &layer.label);
        }
    }
}

/// From values to pixels.
#[derive(Debug)]
struct Scale {
    range: [f64; 2],
    pixels: [f64; 2],
    logarithmic: bool,
}

impl Scale {
    fn new(axis: &Axis, values: Vec<f64>, pixels: [f64; 2]) -> Self {
        let transform = |v: f64| if axis.logarithmic { v.log10() } else { v };
        let drawable = values.into_iter().map(transform).filter(|v| v.is_finite());
        let found = drawable.fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], v| [low.min(v), high.max(v)]);
        let mut range = axis.range.map(|range| range.map(transform)).unwrap_or_else(|| {
            let margin = 0.04 * (found[1] - found[0]);
            [found[0] - margin, found[1] + margin]
        });
        if !range.iter().all(|v| v.is_finite()) {
            range = [0.0, 1.0];
        }
        if range[0] == range[1] {
            let half = if range[0] == 0.0 { 0.5 } else { 0.1 * range[0].abs() };
            range = [range[0] - half, range[1] + half];
        }
        Self { range, pixels, logarithmic: axis.logarithmic }
    }

    fn at(&self, value: f64) -> Option<f64> {
        let value = if self.logarithmic { value.log10() } else { value };
        let share = (value - self.range[0]) / (self.range[1] - self.range[0]);
        let pixel = self.pixels[0] + share * (self.pixels[1] - self.pixels[0]);
        // Far outside of the plot a coordinate only makes the file long and some viewers fail.
        pixel.is_finite().then(|| pixel.clamp(-1e5, 1e5))
    }

    fn ticks(&self, wanted: usize) -> Vec<(f64, String)> {
        let [low, high] = self.range;
        let pixel = |share: f64| self.pixels[0] + share * (self.pixels[1] - self.pixels[0]);
        let (values, decimals) = round_ticks(low, high, wanted);
        let largest = values.iter().fold(0.0_f64, |l, v| l.max(v.abs()));
        let decades = self.logarithmic && high - low >= 1.5;
        values
            .into_iter()
            .filter(|v| !decades || v.fract() == 0.0)
            .map(|v| {
                let text = match self.logarithmic {
                    true => short(10f64.powf(v)),
                    false if largest >= 1e5 || (largest > 0.0 && largest < 1e-3) => format!("{v:.1e}"),
                    false => format!("{v:.decimals$}"),
                };
                (pixel((v - low) / (high - low)), text)
            })
            .collect()
    }
}

fn short(value: f64) -> String {
    if (1e-2..1e4).contains(&value) { format!("{}", (value * 1e4).round() / 1e4) } else { format!("{value:.0e}") }
}

fn draw(document: &mut Document, layer: &Layer, [x, y]: &[Scale; 2]) {
    let n = layer.colour;
    let pixels = |px: f64, py: f64| Some([x.at(px)?, y.at(py)?]);
    match &layer.marks {
        Marks::Line(points) | Marks::DashedLine(points) => {
            let letter = if matches!(layer.marks, Marks::Line(_)) { 'l' } else { 'd' };
            let drawn: Vec<Option<[f64; 2]>> = points.iter().map(|p| pixels(p[0], p[1])).collect();
            for run in drawn.split(Option::is_none) {
                document.path(&format!("{letter}{n}"), run.iter().flatten().copied(), false);
            }
        }
        Marks::Band(points) => {
            let both: Vec<[[f64; 2]; 2]> =
                points.iter().filter_map(|p| Some([pixels(p[0], p[1])?, pixels(p[0], p[2])?])).collect();
            let there = both.iter().map(|b| b[0]);
            document.path(&format!("b{n}"), there.chain(both.iter().rev().map(|b| b[1])), true);
        }
        Marks::Points(points) => {
            for [px, py, uncertainty] in points {
                let Some(at) = pixels(*px, *py) else { continue };
                if let (true, Some(low), Some(high)) =
                    (*uncertainty > 0.0, pixels(*px, py - uncertainty), pixels(*px, py + uncertainty))
                {
                    document.line(&format!("e{n}"), low, high);
                }
                draw_point(document, n, at);
            }
        }
    }
}

fn draw_point(document: &mut Document, colour: usize, at: [f64; 2]) {
    document.raw(&format!("<circle class=\"p{colour}\" cx=\"{}\" cy=\"{}\" r=\"3.6\"/>", number(at[0]), number(at[1])));
}

#[cfg(test)]
mod tests {
    use super::*;

    fn figure(marks: Vec<Marks>, logarithmic: bool) -> String {
        let layers = marks.into_iter().enumerate();
        Figure {
            title: "a < b & c".into(),
            x: Axis { label: "time [s]".into(), range: None, logarithmic },
            y: Axis { label: "mass [kg]".into(), range: None, logarithmic },
            layers: layers.map(|(k, marks)| Layer { label: format!("series {k}"), colour: k, marks }).collect(),
            caption: "word ".repeat(60),
            ordered_colours: 0,
        }
        .to_svg()
    }

    #[test]
    fn points_land_where_the_axes_say() {
        let scale = Scale::new(&Axis { range: Some([2.0, 4.0]), ..Axis::default() }, vec![], [100.0, 300.0]);
        assert_eq!([2.0, 3.0, 4.0].map(|v| scale.at(v).unwrap()), [100.0, 200.0, 300.0]);
        let decades = Axis { range: Some([1.0, 1e4]), logarithmic: true, ..Axis::default() };
        let scale = Scale::new(&decades, vec![], [0.0, 400.0]);
        assert!((scale.at(100.0).unwrap() - 200.0).abs() < 1e-9);
        assert_eq!(scale.at(-1.0), None);
        let labels: Vec<String> = scale.ticks(5).into_iter().map(|t| t.1).collect();
        assert_eq!(labels, ["1", "10", "100", "1000", "1e4"]);
    }

    #[test]
    fn a_line_is_broken_where_a_value_is_missing() {
        let svg =
            figure(vec![Marks::Line(vec![[0.0, 1.0], [1.0, 2.0], [2.0, f64::NAN], [3.0, 1.0], [4.0, 0.0]])], false);
        assert_eq!(svg.matches("<path class=\"l0\"").count(), 2 + 1, "two pieces and the legend:\n{svg}");
        assert!(!svg.contains("NaN") && svg.contains("a &lt; b &amp; c"));
    }

    #[test]
    fn nothing_to_draw_is_still_a_figure() {
        for logarithmic in [false, true] {
            let svg = figure(vec![Marks::Line(vec![]), Marks::Points(vec![[-1.0, f64::INFINITY, 0.0]])], logarithmic);
            assert!(
                svg.starts_with("<svg") && svg.ends_with("</svg>\n") && !svg.contains("NaN") && !svg.contains("inf")
            );
        }
    }

    #[test]
    fn bands_and_points_are_drawn_once_each() {
        let svg = figure(
            vec![
                Marks::Band(vec![[0.0, 1.0, 2.0], [1.0, 1.5, 2.5]]),
                Marks::Points(vec![[0.0, 1.5, 0.2], [1.0, 2.0, 0.0]]),
            ],
            false,
        );
        assert_eq!(svg.matches("<circle class=\"p1\"").count(), 2 + 1, "two points and the legend");
        assert_eq!(svg.matches("class=\"e1\"").count(), 1, "one has no bar");
        assert_eq!(svg.matches("class=\"b0\"").count(), 1 + 1);
    }
}
