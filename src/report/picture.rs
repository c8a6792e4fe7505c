//! A picture of a run: particles, parts and measured slopes, drawn to scale as SVG.

use super::colour::{hexadecimal, magnitude};
use super::outline::{Outline, Polyline};
use super::svg::{Anchor, Document, FONT_SIZE, LINE_HEIGHT, number, round_length, round_ticks, wrapped};
use crate::math::{Bounds, Vec3, vec3};
use crate::particle::ParticleState;
use std::collections::HashSet;
use std::fmt::Write;

/// Classes of colour.
const CLASSES: usize = 32;
pub(super) const MARGIN: f64 = 24.0;
pub(super) const LEGEND_WIDTH: f64 = 120.0;
/// Largest size of the scene on the page [px].
const LARGEST: [f64; 2] = [820.0, 820.0];
const SMALLEST_WIDTH: f64 = 320.0;
/// Raster cells in a pixel, for telling which particles are hidden.
const RASTER: f64 = 2.0;

/// Where one looks from: the picture's right and up, unit vectors; the viewer is at right x up.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct View {
    /// Direction to the right.
    pub right: Vec3,
    /// Direction upwards.
    pub up: Vec3,
    /// What is shown [m]; `None` for all particles and outlines.
    pub bounds: Option<Bounds>,
}

impl View {
    /// From the front: x to the right, z upwards.
    #[must_use]
    pub const fn front() -> Self {
        Self { right: vec3(1.0, 0.0, 0.0), up: vec3(0.0, 0.0, 1.0), bounds: None }
    }

    /// From the right: y to the right, z upwards.
    #[must_use]
    pub const fn side() -> Self {
        Self { right: vec3(0.0, 1.0, 0.0), up: vec3(0.0, 0.0, 1.0), bounds: None }
    }

    /// From above: x to the right, y upwards.
    #[must_use]
    pub const fn above() -> Self {
        Self { right: vec3(1.0, 0.0, 0.0), up: vec3(0.0, 1.0, 0.0), bounds: None }
    }

    /// Unit vector from the scene to the viewer.
    #[must_use]
    pub fn sight(&self) -> Vec3 {
        self.right.cross(&self.up)
    }
}

/// What a particle's colour says.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ColourBy {
    /// Diameter, from the smallest to the largest.
    Diameter,
    /// Speed of the centre, from 0 to the speed that 99 % stay below.
    Speed,
}

/// A measured straight slope.
#[derive(Debug, Clone, PartialEq)]
pub struct SlopeLine {
    /// Its ends [m].
    pub ends: [Vec3; 2],
    /// What is written beside it, such as "31.2 ± 0.6°".
    pub label: String,
}

/// What a picture shows beside particles and parts.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Annotations {
    /// Title of the document.
    pub title: String,
    /// Slopes.
    pub slopes: Vec<SlopeLine>,
    /// Caption below the picture.
    pub caption: String,
}

/// Draws particles and parts as seen in `view`, as an SVG document.
///
/// Circles have the particles' true radii at one scale; nearer ones cover farther ones, and those that are covered as a
/// whole are left out. Parts are lines in front of a light tint. A bar gives the scale, another one the colours.
#[must_use]
pub fn side_view(
    particles: &[ParticleState],
    parts: &[Outline],
    view: &View,
    colour_by: ColourBy,
    annotations: &Annotations,
) -> String {
    let frame = Frame::new(&extent(particles, parts, view), view, LARGEST);
    let caption = wrapped(&annotations.caption, ((frame.width - 2.0 * MARGIN) / (0.5 * FONT_SIZE)) as usize);
    let height = frame.height + 44.0 + caption.len() as f64 * LINE_HEIGHT;
    let mut document = Document::new(frame.width, height, &annotations.title, &style());
    document.raw(&format!(
        "<clipPath id=\"shown\"><rect width=\"{}\" height=\"{}\"/></clipPath>\n<g clip-path=\"url(#shown)\">",
        number(frame.width - LEGEND_WIDTH),
        number(frame.height)
    ));
    let scale = ColourScale::new(particles, colour_by);
    draw_faces(&mut document, "k", parts, &frame);
    draw_particles(&mut document, particles, &scale, &frame);
    draw_lines(&mut document, "o", parts, &frame);
    for slope in &annotations.slopes {
        draw_slope(&mut document, slope, &frame);
    }
    document.raw("</g>");
    draw_scale_bar(&mut document, &frame);
    if !particles.is_empty() {
        draw_legend(&mut document, &scale, &frame);
    }
    for (k, line) in caption.iter().enumerate() {
        document.label([MARGIN, frame.height + 50.0 + k as f64 * LINE_HEIGHT], Anchor::Start, "", line);
    }
    document.finish()
}

pub(super) fn style() -> String {
    let mut style = String::from(
        ".k{fill:#e9ebee;stroke:#e9ebee;stroke-width:.6}\
         .o{fill:none;stroke:#3c434b;stroke-width:1.1;stroke-linecap:round;stroke-linejoin:round}\n\
         .s{fill:none;stroke:#fff;stroke-width:4.5;stroke-linecap:round}\
         .r{fill:none;stroke:#c01824;stroke-width:2;stroke-dasharray:9 5;stroke-linecap:round}\
         .h{fill:none;stroke:#fff;stroke-width:4}.a{fill:none;stroke:#c01824;stroke-width:1.4}.w{fill:#c01824;font-weight:bold}\
         .m{fill:none;stroke:#222;stroke-width:2}.f{fill:none;stroke:#222;stroke-width:.8}\
         .p{stroke:#10151c;stroke-width:.35;stroke-opacity:.75}\n",
    );
    for class in 0..CLASSES {
        let colour = hexadecimal(magnitude((class as f64 + 0.5) / CLASSES as f64));
        let _ = writeln!(style, ".c{class}{{fill:{colour}}}");
    }
    style
}

/// What is to be seen: right, up and towards the viewer [m].
pub(super) fn extent(particles: &[ParticleState], parts: &[Outline], view: &View) -> Bounds {
    let mut extent = Bounds::EMPTY;
    if let Some(bounds) = view.bounds {
        for corner in 0..8usize {
            let pick = |axis: usize| if corner >> axis & 1 == 0 { bounds.minimum[axis] } else { bounds.maximum[axis] };
            extent.include(&seen(view, &vec3(pick(0), pick(1), pick(2))));
        }
        return extent;
    }
    for particle in particles {
        let centre = seen(view, &particle.position);
        extent.include(&centre.map(|c| c - particle.radius));
        extent.include(&centre.map(|c| c + particle.radius));
    }
    parts.iter().flat_map(|p| p.lines.iter().flatten()).for_each(|point| extent.include(&seen(view, point)));
    extent
}

/// From the scene to the page.
#[derive(Debug)]
pub(super) struct Frame {
    view: View,
    origin: [f64; 2],
    pixels_per_metre: f64,
    pub(super) width: f64,
    pub(super) height: f64,
}

impl Frame {
    /// For an `extent` as [`extent`] gives it, on a page with room for `largest` [px].
    pub(super) fn new(extent: &Bounds, view: &View, largest: [f64; 2]) -> Self {
        let finite = !extent.is_empty() && extent.minimum.iter().chain(&extent.maximum).all(|c| c.is_finite());
        let extent = if finite { *extent } else { Bounds { minimum: [0.0; 3], maximum: [1.0; 3] } };
        let size = extent.size().map(|length| length.max(1e-9));
        let pixels_per_metre = (largest[0] / size.x).min(largest[1] / size.y);
        let drawn = (size.x * pixels_per_metre).max(SMALLEST_WIDTH - LEGEND_WIDTH);
        Self {
            view: *view,
            origin: [extent.minimum[0], extent.maximum[1]],
            pixels_per_metre,
            width: drawn + 2.0 * MARGIN + LEGEND_WIDTH,
            height: size.y * pixels_per_metre + 2.0 * MARGIN,
        }
    }

    pub(super) fn at(&self, point: &Vec3) -> [f64; 2] {
        let seen = seen(&self.view, point);
        [
            MARGIN + (seen.x - self.origin[0]) * self.pixels_per_metre,
            MARGIN + (self.origin[1] - seen.y) * self.pixels_per_metre,
        ]
    }
}

/// Right, up and towards the viewer.
pub(super) fn seen(view: &View, point: &Vec3) -> Vec3 {
    vec3(point.dot(&view.right), point.dot(&view.up), point.dot(&view.sight()))
}

/// From a particle to its class of colour.
#[derive(Debug)]
pub(super) struct ColourScale {
    colour_by: ColourBy,
    range: [f64; 2],
}

impl ColourScale {
    pub(super) fn new<'a>(particles: impl IntoIterator<Item = &'a ParticleState>, colour_by: ColourBy) -> Self {
        let mut values: Vec<f64> =
            particles.into_iter().map(|p| value(p, colour_by)).filter(|v| v.is_finite()).collect();
        values.sort_by(f64::total_cmp);
        let at = |share: f64| values.get((share * values.len().saturating_sub(1) as f64) as usize).copied();
        let range = match colour_by {
            ColourBy::Diameter => [at(0.0).unwrap_or(0.0), at(1.0).unwrap_or(0.0)],
            ColourBy::Speed => [0.0, at(0.99).unwrap_or(0.0)],
        };
        Self { colour_by, range }
    }

    fn class(&self, particle: &ParticleState) -> usize {
        let [low, high] = self.range;
        let share = if high > low { (value(particle, self.colour_by) - low) / (high - low) } else { 0.5 };
        ((share.clamp(0.0, 1.0) * CLASSES as f64) as usize).min(CLASSES - 1)
    }
}

fn value(particle: &ParticleState, colour_by: ColourBy) -> f64 {
    match colour_by {
        ColourBy::Diameter => 2.0 * particle.radius,
        ColourBy::Speed => particle.velocity.norm(),
    }
}

pub(super) fn draw_particles(document: &mut Document, particles: &[ParticleState], scale: &ColourScale, frame: &Frame) {
    let mut order: Vec<(f64, &ParticleState)> = particles
        .iter()
        .filter(|p| p.position.iter().all(|c| c.is_finite()))
        .map(|p| (seen(&frame.view, &p.position).z, p))
        .collect();
    order.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.id.cmp(&b.1.id)));
    let mut raster = Raster::new(frame);
    // From front to back, to see who is hidden; drawn from back to front.
    let visible: Vec<bool> = order
        .iter()
        .rev()
        .map(|(_, p)| raster.cover(frame.at(&p.position), p.radius * frame.pixels_per_metre))
        .collect();
    document.raw("<g class=\"p\">");
    for (_, particle) in order.iter().zip(visible.iter().rev()).filter(|(_, visible)| **visible).map(|(entry, _)| entry)
    {
        let [x, y] = frame.at(&particle.position).map(number);
        let radius = number((particle.radius * frame.pixels_per_metre).max(0.2));
        document.raw(&format!("<circle class=\"c{}\" cx=\"{x}\" cy=\"{y}\" r=\"{radius}\"/>", scale.class(particle)));
    }
    document.raw("</g>");
}

/// Which cells of the page are covered already.
#[derive(Debug)]
struct Raster {
    columns: usize,
    covered: Vec<bool>,
}

impl Raster {
    fn new(frame: &Frame) -> Self {
        let (columns, rows) = ((frame.width * RASTER) as usize + 1, (frame.height * RASTER) as usize + 1);
        Self { columns, covered: vec![false; columns * rows] }
    }

    /// Covers a disc [px]; true where some of it was still to be seen, false outside of the page.
    fn cover(&mut self, centre: [f64; 2], radius: f64) -> bool {
        let rows = self.covered.len() / self.columns;
        let [x, y] = centre.map(|c| c * RASTER);
        let radius = radius * RASTER;
        let span = |middle: f64, limit: usize| {
            let clip = |edge: f64| edge.clamp(0.0, limit as f64) as usize;
            clip((middle - radius - 0.5).ceil())..clip((middle + radius + 0.5).floor())
        };
        let (across, down) = (span(x, self.columns), span(y, rows));
        // A disc too small for any cell's centre is drawn: hiding must be proved.
        let mut visible = radius < 1.0 && !across.is_empty() && !down.is_empty();
        for row in down {
            for column in across.clone() {
                let (dx, dy) = (column as f64 + 0.5 - x, row as f64 + 0.5 - y);
                if dx * dx + dy * dy <= radius * radius {
                    visible |= !std::mem::replace(&mut self.covered[row * self.columns + column], true);
                }
            }
        }
        visible
    }
}

pub(super) fn draw_faces(document: &mut Document, class: &str, parts: &[Outline], frame: &Frame) {
    for part in parts {
        let mut path = String::new();
        for face in &part.faces {
            let [a, b, c] = face.map(|corner| frame.at(&corner));
            let area = (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]);
            if area.abs() > 0.01 {
                // All the same way round, so that faces behind each other do not cut holes.
                let [b, c] = if area > 0.0 { [b, c] } else { [c, b] };
                let [[ax, ay], [bx, by], [cx, cy]] = [a, b, c].map(|p| p.map(number));
                let _ = write!(path, "M{ax} {ay}L{bx} {by}L{cx} {cy}Z");
            }
        }
        if !path.is_empty() {
            document.raw(&format!("<path class=\"{class}\" d=\"{path}\"/>"));
        }
    }
}

pub(super) fn draw_lines(document: &mut Document, class: &str, parts: &[Outline], frame: &Frame) {
    let mut drawn = HashSet::new();
    for line in parts.iter().flat_map(|part| &part.lines) {
        let points: Vec<[f64; 2]> = line.iter().map(|point| frame.at(point)).collect();
        let cells: Vec<[i64; 2]> = points.iter().map(|p| p.map(|c| (c * 20.0).round() as i64)).collect();
        // Edges seen end on are points, and edges behind each other one line.
        let long = cells.windows(2).any(|w| (w[0][0] - w[1][0]).abs() + (w[0][1] - w[1][1]).abs() > 4);
        let mut backwards = cells.clone();
        backwards.reverse();
        if long && !drawn.contains(&backwards) && drawn.insert(cells) {
            document.path(class, points, false);
        }
    }
}

pub(super) fn draw_slope(document: &mut Document, slope: &SlopeLine, frame: &Frame) {
    let [a, b] = [0, 1].map(|k| frame.at(&slope.ends[k]));
    // Screen y points down: the lower end is the one with the larger y.
    let (low, high) = if a[1] >= b[1] { (a, b) } else { (b, a) };
    let beyond = |from: [f64; 2], to: [f64; 2]| [to[0] + 0.06 * (to[0] - from[0]), to[1] + 0.06 * (to[1] - from[1])];
    let ends = [beyond(high, low), beyond(low, high)];
    document.line("s", ends[0], ends[1]);
    document.line("r", ends[0], ends[1]);
    let (run, rise) = (high[0] - low[0], low[1] - high[1]);
    let reach = 0.32 * run.hypot(rise);
    let side = if run >= 0.0 { 1.0 } else { -1.0 };
    let level = [low, [low[0] + side * 1.15 * reach, low[1]]];
    let steps = 24;
    let steepness = rise.atan2(run.abs());
    let arc = (0..=steps).map(|k| {
        let angle = steepness * f64::from(k) / f64::from(steps);
        [low[0] + side * reach * angle.cos(), low[1] - reach * angle.sin()]
    });
    // A white line under each keeps them readable on particles of any colour.
    for class in ["h", "a"] {
        document.path(class, level, false);
        document.path(class, arc.clone(), false);
    }
    let middle = [0.5 * (low[0] + high[0]), 0.5 * (low[1] + high[1])];
    let away = 16.0 / run.hypot(rise).max(1.0);
    let at = [middle[0] - side * away * rise, middle[1] - away * run.abs()];
    let anchor = if side > 0.0 { Anchor::End } else { Anchor::Start };
    document.label(at, anchor, "w halo", &slope.label);
}

pub(super) fn draw_scale_bar(document: &mut Document, frame: &Frame) {
    let available = frame.width - LEGEND_WIDTH - 2.0 * MARGIN;
    let length = round_length(0.12 * available / frame.pixels_per_metre);
    let (left, y) = (MARGIN, frame.height + 16.0);
    let right = left + length * frame.pixels_per_metre;
    document.line("m", [left, y], [right, y]);
    for x in [left, right] {
        document.line("m", [x, y - 5.0], [x, y + 5.0]);
    }
    let text = with_unit(length, "m");
    document.label([right + 10.0, y + 0.35 * FONT_SIZE], Anchor::Start, "", &text);
}

pub(super) fn draw_legend(document: &mut Document, scale: &ColourScale, frame: &Frame) {
    let left = frame.width - LEGEND_WIDTH + 14.0;
    let (top, width) = (MARGIN + 34.0, 16.0);
    let height = (0.5 * frame.height).clamp(60.0, 260.0).min((frame.height - top).max(40.0));
    let [low, high] = scale.range;
    let (word, unit, factor) = match scale.colour_by {
        ColourBy::Diameter if high < 0.1 => ("diameter", "mm", 1e3),
        ColourBy::Diameter => ("diameter", "m", 1.0),
        ColourBy::Speed => ("speed", "m/s", 1.0),
    };
    document.label([left, MARGIN], Anchor::Start, "", word);
    document.label([left, MARGIN + 17.0], Anchor::Start, "", &format!("[{unit}]"));
    let step = height / CLASSES as f64;
    for class in 0..CLASSES {
        let y = top + height - (class + 1) as f64 * step;
        let (x, y, w, h) = (number(left), number(y), number(width), number(step + 0.4));
        document.raw(&format!("<rect class=\"c{class}\" x=\"{x}\" y=\"{y}\" width=\"{w}\" height=\"{h}\"/>"));
    }
    let frame_corners = [[left, top], [left + width, top], [left + width, top + height], [left, top + height]];
    document.path("f", frame_corners, true);
    let (ticks, decimals) = round_ticks(low * factor, high * factor, 5);
    for tick in ticks {
        let share = if high > low { (tick / factor - low) / (high - low) } else { 0.5 };
        let y = top + height * (1.0 - share);
        document.line("f", [left + width, y], [left + width + 5.0, y]);
        document.label([left + width + 9.0, y + 0.35 * FONT_SIZE], Anchor::Start, "", &format!("{tick:.decimals$}"));
    }
}

/// A length with a unit that keeps it short.
fn with_unit(metres: f64, unit: &str) -> String {
    let (factor, prefix) = match metres {
        m if m >= 1.0 => (1.0, ""),
        m if m >= 1e-3 => (1e3, "m"),
        _ => (1e6, "µ"),
    };
    format!("{} {prefix}{unit}", number(metres * factor))
}

/// Lines of an outline that have nothing to tint.
impl From<Vec<Polyline>> for Outline {
    fn from(lines: Vec<Polyline>) -> Self {
        Self { lines, faces: Vec::new() }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::analysis::measure::tests::particle;

    fn drawn(particles: &[ParticleState], parts: &[Outline], colour_by: ColourBy) -> String {
        side_view(particles, parts, &View::front(), colour_by, &Annotations::default())
    }

    fn circles(svg: &str) -> Vec<&str> {
        svg.lines().filter(|line| line.starts_with("<circle")).collect()
    }

    #[test]
    fn the_viewer_stands_in_front() {
        // x to the right and z up leave y into the page: the viewer is at negative y.
        assert_eq!(View::front().sight(), vec3(0.0, -1.0, 0.0));
        assert_eq!(View::side().sight(), vec3(1.0, 0.0, 0.0));
        assert_eq!(View::above().sight(), vec3(0.0, 0.0, 1.0));
    }

    #[test]
    fn nearer_particles_are_drawn_later_and_hidden_ones_not_at_all() {
        let near = particle(0, [0.0, -5.0, 0.0], 1.0);
        let hidden = particle(1, [0.0, 5.0, 0.0], 0.5);
        let aside = particle(2, [1.0, 5.0, 0.0], 1.0);
        let svg = drawn(&[near, hidden, aside], &[], ColourBy::Diameter);
        let found = circles(&svg);
        assert_eq!(found.len(), 2, "{found:?}");
        let across =
            |line: &str| line.split("cx=\"").nth(1).unwrap().split('"').next().unwrap().parse::<f64>().unwrap();
        assert!(across(found[0]) > across(found[1]), "the far one is to the right and comes first: {found:?}");
    }

    #[test]
    fn radii_and_distances_have_one_scale() {
        let svg = drawn(&[particle(0, [0.0; 3], 1.0), particle(1, [10.0, 0.0, 0.0], 2.0)], &[], ColourBy::Diameter);
        let get = |line: &str, key: &str| {
            line.split(&format!(" {key}=\"")).nth(1).unwrap().split('"').next().unwrap().parse::<f64>().unwrap()
        };
        let found = circles(&svg);
        let scale = (get(found[1], "cx") - get(found[0], "cx")).abs() / 10.0;
        let mut radii: Vec<f64> = found.iter().map(|line| get(line, "r") / scale).collect();
        radii.sort_by(f64::total_cmp);
        // Two decimals of a pixel.
        assert!((radii[0] - 1.0).abs() < 0.01 / scale && (radii[1] - 2.0).abs() < 0.01 / scale, "{radii:?}");
    }

    #[test]
    fn colours_go_from_the_smallest_to_the_largest() {
        let svg = drawn(&[particle(0, [0.0; 3], 1.0), particle(1, [10.0, 0.0, 0.0], 2.0)], &[], ColourBy::Diameter);
        let found = circles(&svg).join("\n");
        assert!(found.contains("class=\"c0\"") && found.contains(&format!("class=\"c{}\"", CLASSES - 1)), "{found}");
    }

    #[test]
    fn edges_behind_each_other_are_one_line_and_end_on_none() {
        let line = |y: f64| vec![vec3(0.0, y, 0.0), vec3(1.0, y, 1.0)];
        let end_on = vec![vec3(0.0, 0.0, 0.0), vec3(0.0, 1.0, 0.0)];
        let mut back = line(1.0);
        back.reverse();
        let svg = drawn(&[], &[Outline::from(vec![line(0.0), back, end_on])], ColourBy::Speed);
        assert_eq!(svg.matches("class=\"o\"").count(), 1, "{svg}");
    }

    #[test]
    fn the_slope_carries_its_label() {
        let ends = [vec3(0.0, 0.0, 1.0), vec3(2.0, 0.0, 0.0)];
        let slopes = vec![SlopeLine { ends, label: "26.6 ± 0.5°".into() }];
        let annotations = Annotations { title: "t".into(), slopes, caption: "c <&> d".into() };
        let particles = [particle(0, [0.0; 3], 0.1), particle(1, [2.0, 0.0, 1.0], 0.1)];
        let svg = side_view(&particles, &[], &View::front(), ColourBy::Diameter, &annotations);
        assert!(svg.contains("26.6 ± 0.5°</text>") && svg.contains("c &lt;&amp;&gt; d"));
    }

    #[test]
    fn four_thousand_particles_stay_small_and_nothing_breaks_on_odd_input() {
        let particles: Vec<_> = (0..4000).map(|k| particle(k, [(k % 80) as f64, 0.0, (k / 80) as f64], 0.45)).collect();
        let svg = drawn(&particles, &[], ColourBy::Speed);
        assert_eq!(circles(&svg).len(), 4000, "none hides another");
        assert!(svg.len() < 500_000, "{}", svg.len());
        for odd in [vec![], vec![particle(0, [f64::NAN; 3], 1.0)], vec![particle(0, [0.0; 3], 1.0)]] {
            let svg = drawn(&odd, &[], ColourBy::Diameter);
            assert!(svg.ends_with("</svg>\n") && !svg.contains("NaN") && !svg.contains("inf"), "{svg}");
        }
    }
}
