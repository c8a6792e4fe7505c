//! States of one plant side by side at one scale: a cut scene, with one panel for each of its last stages.

use super::colour::{hexadecimal, series};
use super::outline::{Outline, Polyline};
use super::picture::{
    ColourBy, ColourScale, Frame, LEGEND_WIDTH, MARGIN, SlopeLine, View, draw_faces, draw_legend, draw_lines,
    draw_particles, draw_scale_bar, draw_slope, extent, seen, style,
};
use super::svg::{Anchor, Document, FONT_SIZE, LINE_HEIGHT, number, wrapped};
use crate::math::{Bounds, Vec3};
use crate::particle::ParticleState;

/// Panels in a row.
const MOST_COLUMNS: usize = 4;
/// Largest size of all panels of a row on the page [px].
const ROW: [f64; 2] = [1080.0, 560.0];
/// Height of a panel's heading [px].
const HEADING: f64 = 14.0;

/// A panel.
#[derive(Debug, Clone, Default)]
pub struct Panel {
    /// What is written above it.
    pub heading: String,
    /// Particles.
    pub particles: Vec<ParticleState>,
    /// Its parts.
    pub parts: Vec<Outline>,
    /// Parts that belong to what was before: drawn lightly.
    pub earlier_parts: Vec<Outline>,
    /// Measured slopes.
    pub slopes: Vec<SlopeLine>,
}

/// A gate as it is drawn into every panel.
#[derive(Debug, Clone, PartialEq)]
pub struct GateMark {
    /// Its name.
    pub name: String,
    /// Border of its opening, or a line that goes beyond the picture [m].
    pub border: Polyline,
    /// Its middle, which is within the picture [m].
    pub middle: Vec3,
}

/// Draws `panels` as seen in `view`, at one scale and with one scale of colours, and the `gates` dashed in each of them.
#[must_use]
pub fn side_by_side(panels: &[Panel], gates: &[GateMark], view: &View, title: &str, caption: &str) -> String {
    let mut all = Bounds::EMPTY;
    for panel in panels {
        for parts in [&panel.parts, &panel.earlier_parts] {
            all = all.union(&extent(&panel.particles, parts, view));
        }
    }
    gates.iter().for_each(|gate| all.include(&seen(view, &gate.middle)));
    let columns = panels.len().clamp(1, MOST_COLUMNS);
    let rows = panels.len().div_ceil(columns).max(1);
    let frame = Frame::new(&all, view, [ROW[0] / columns as f64, ROW[1]]);
    let (width, height) = (frame.width - LEGEND_WIDTH, frame.height + HEADING);
    let page_width = columns as f64 * width + LEGEND_WIDTH;
    let caption = wrapped(caption, ((page_width - 2.0 * MARGIN) / (0.54 * FONT_SIZE)) as usize);
    let page_height = rows as f64 * height + 44.0 + caption.len() as f64 * LINE_HEIGHT;
    let mut document = Document::new(page_width, page_height, title, &(style() + &own_style()));
    document.raw(&format!(
        "<clipPath id=\"shown\"><rect width=\"{}\" height=\"{}\"/></clipPath>",
        number(width),
        number(frame.height)
    ));
    let colours = ColourScale::new(panels.iter().flat_map(|panel| &panel.particles), ColourBy::Diameter);
    let corner = |column: usize, row: usize| [column as f64 * width, row as f64 * height + HEADING];
    for (index, panel) in panels.iter().enumerate() {
        moved(&mut document, corner(index % columns, index / columns), |document| {
            draw(document, panel, gates, &colours, &frame);
        });
    }
    moved(&mut document, corner(0, rows - 1), |document| draw_scale_bar(document, &frame));
    if panels.iter().any(|panel| !panel.particles.is_empty()) {
        moved(&mut document, corner(columns - 1, 0), |document| draw_legend(document, &colours, &frame));
    }
    for (k, line) in caption.iter().enumerate() {
        document.label([MARGIN, rows as f64 * height + 50.0 + k as f64 * LINE_HEIGHT], Anchor::Start, "", line);
    }
    document.finish()
}

/// Classes beside those of a single picture: earlier parts (lines, faces), gates (line, name), headings.
fn own_style() -> String {
    let gate = hexadecimal(series(0));
    format!(
        ".u{{fill:none;stroke:#aab0b7;stroke-width:1;stroke-linecap:round;stroke-linejoin:round}}\
         .v{{fill:#f4f5f6;stroke:#f4f5f6;stroke-width:.6}}\n\
         .z{{fill:none;stroke:{gate};stroke-width:1.8;stroke-dasharray:6 4}}.y{{fill:{gate}}}.x{{font-weight:bold}}\n"
    )
}

fn moved(document: &mut Document, [x, y]: [f64; 2], draw: impl FnOnce(&mut Document)) {
    document.raw(&format!("<g transform=\"translate({} {})\">", number(x), number(y)));
    draw(document);
    document.raw("</g>");
}

fn draw(document: &mut Document, panel: &Panel, gates: &[GateMark], colours: &ColourScale, frame: &Frame) {
    document.label([MARGIN, 6.0], Anchor::Start, "x", &panel.heading);
    document.raw("<g clip-path=\"url(#shown)\">");
    draw_faces(document, "v", &panel.earlier_parts, frame);
    draw_faces(document, "k", &panel.parts, frame);
    draw_particles(document, &panel.particles, colours, frame);
    draw_lines(document, "u", &panel.earlier_parts, frame);
    draw_lines(document, "o", &panel.parts, frame);
    for slope in &panel.slopes {
        draw_slope(document, slope, frame);
    }
    for gate in gates {
        draw_gate(document, gate, frame);
    }
    document.raw("</g>");
}

/// A gate that is seen edge on is one dashed line: dashes of its far and near border would fill each other's gaps.
fn draw_gate(document: &mut Document, gate: &GateMark, frame: &Frame) {
    let points: Vec<[f64; 2]> = gate.border.iter().map(|point| frame.at(point)).collect();
    let Some(first) = points.first() else { return };
    let farthest = |from: &[f64; 2]| {
        let distance = |p: &[f64; 2]| (p[0] - from[0]).hypot(p[1] - from[1]);
        points.iter().copied().max_by(|a, b| distance(a).total_cmp(&distance(b))).unwrap_or(*from)
    };
    let one = farthest(first);
    let other = farthest(&one);
    let length = (other[0] - one[0]).hypot(other[1] - one[1]).max(1e-9);
    let aside =
        |p: &[f64; 2]| ((other[0] - one[0]) * (p[1] - one[1]) - (other[1] - one[1]) * (p[0] - one[0])).abs() / length;
    if points.iter().all(|p| aside(p) < 1.0) {
        document.line("z", one, other);
    } else {
        document.path("z", points.iter().copied(), true);
    }
    let right = if one[0] > other[0] { one } else { other };
    let border = frame.width - LEGEND_WIDTH;
    let name = format!("gate {}", gate.name);
    if right[0] + 8.0 + 0.55 * FONT_SIZE * name.chars().count() as f64 <= border {
        document.label([right[0] + 8.0, right[1] + 0.35 * FONT_SIZE], Anchor::Start, "y halo", &name);
    } else {
        document.label([border.min(right[0]) - 4.0, right[1] - 6.0], Anchor::End, "y halo", &name);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::analysis::measure::tests::particle;
    use crate::math::vec3;

    fn panel(heading: &str, x: f64) -> Panel {
        Panel {
            heading: heading.to_owned(),
            particles: vec![particle(0, [x, 0.0, 0.5], 0.1)],
            parts: vec![Outline::from(vec![vec![vec3(0.0, 0.0, 0.0), vec3(2.0, 0.0, 0.0)]])],
            ..Panel::default()
        }
    }

    fn across(svg: &str) -> Vec<f64> {
        let circles = svg.lines().filter(|line| line.starts_with("<circle"));
        circles.map(|line| line.split("cx=\"").nth(1).unwrap().split('"').next().unwrap().parse().unwrap()).collect()
    }

    #[test]
    fn panels_have_one_scale_wherever_their_particles_are() {
        let svg = side_by_side(&[panel("a", 0.5), panel("b < c", 1.5)], &[], &View::front(), "t", "c");
        let at = across(&svg);
        // One metre, on a line of two metres that takes half a row.
        assert!((at[1] - at[0] - ROW[0] / 4.0).abs() < 0.02, "{at:?}");
        assert!(svg.contains("b &lt; c") && svg.matches("<clipPath").count() == 1);
    }

    #[test]
    fn a_gate_seen_edge_on_is_one_line_and_seen_from_above_a_closed_border() {
        let border = vec![vec3(0.5, -0.2, 1.0), vec3(1.5, -0.2, 1.0), vec3(1.5, 0.2, 1.0), vec3(0.5, 0.2, 1.0)];
        let gates = [GateMark { name: "outlet".to_owned(), border, middle: vec3(1.0, 0.0, 1.0) }];
        let lines = |view: &View| {
            let svg = side_by_side(&[panel("a", 0.5), panel("b", 0.5)], &gates, view, "", "");
            assert_eq!(svg.matches(">gate outlet</text>").count(), 2);
            let path = svg.lines().find(|line| line.starts_with("<path class=\"z\"")).unwrap().to_owned();
            (path.matches('L').count(), path.contains('Z'))
        };
        assert_eq!(lines(&View::front()), (1, false));
        assert_eq!(lines(&View::above()), (3, true));
    }

    #[test]
    fn a_gate_far_from_everything_is_in_the_picture() {
        let gate = |height| {
            let border = vec![vec3(-9.0, 0.0, height), vec3(9.0, 0.0, height)];
            [GateMark { name: "far".to_owned(), border, middle: vec3(1.0, 0.0, height) }]
        };
        let height = |svg: String| {
            let page = svg.split("height=\"").nth(1).unwrap().split('"').next().unwrap().parse::<f64>().unwrap();
            let label = svg.lines().find(|line| line.ends_with(">gate far</text>")).unwrap().to_owned();
            (page, label.split("y=\"").nth(1).unwrap().split('"').next().unwrap().parse::<f64>().unwrap())
        };
        let (low, _) = height(side_by_side(&[panel("a", 0.5)], &gate(0.3), &View::front(), "", ""));
        let (high, label) = height(side_by_side(&[panel("a", 0.5)], &gate(0.9), &View::front(), "", ""));
        // The line is at the upper margin, its name just above it.
        assert!(high > low && (0.0..MARGIN).contains(&label), "{low} {high} {label}");
    }

    #[test]
    fn nothing_and_many_are_pictures_too() {
        for count in [0, 1, 9] {
            let panels: Vec<Panel> = (0..count).map(|k| panel(&k.to_string(), 1.0)).collect();
            let svg = side_by_side(&panels, &[], &View::front(), "t", "word ".repeat(90).as_str());
            assert!(svg.ends_with("</svg>\n") && !svg.contains("NaN") && !svg.contains("inf"), "{svg}");
            assert_eq!(across(&svg).len(), count);
        }
    }
}
