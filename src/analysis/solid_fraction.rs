//! Solid fraction of a region, with spheres cut exactly at its border.

use crate::math::Bounds;
use crate::particle::{Body, ParticleId, ParticleState};
use std::collections::HashMap;
use std::f64::consts::{FRAC_PI_2, PI};

/// Solid fraction of a region.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SolidFraction {
    /// phi = sum of the particle volumes inside / volume of the region [-].
    pub value: f64,
    /// Share of the region that is counted twice because particles overlap there [-]: the largest error of `value`.
    pub overlap: f64,
}

/// Solid fraction of the box `region`, phi = (1/V) sum V_i   [-]
///
/// V volume of the region, V_i volume of particle i inside of it [m3]: spheres are cut at the faces exactly (to about
/// 1e-10 of their volume, see [`sphere_in_box`]), discs likewise in the plane y = 0. Overlaps count for both partners, as
/// usual in DEM; `overlap` = sum of the lenses of the `contacts` whose middle lies inside / V says how much that is.
/// `None` for a region without volume.
#[must_use]
pub fn solid_fraction(
    particles: &[ParticleState],
    contacts: &[(ParticleId, ParticleId)],
    body: Body,
    region: &Bounds,
) -> Option<SolidFraction> {
    let size = region.size();
    let volume = match body {
        Body::Sphere => size.x * size.y * size.z,
        Body::Disc { thickness } => size.x * size.z * thickness,
    };
    if region.is_empty() || volume <= 0.0 {
        return None;
    }
    let solid: f64 = particles.iter().map(|p| inside(p, body, region)).sum();
    let by_id: HashMap<ParticleId, &ParticleState> = particles.iter().map(|p| (p.id, p)).collect();
    let lenses: f64 = contacts
        .iter()
        .filter_map(|(i, j)| Some((*by_id.get(i)?, *by_id.get(j)?)))
        .map(|(a, b)| lens_inside(a, b, body, region))
        .sum();
    Some(SolidFraction { value: solid / volume, overlap: lenses / volume })
}

/// Volume [m3] of the sphere at `centre` [m] of `radius` [m] inside the box `region`.
///
/// V = integral over z of the area of (circle of radius sqrt(r^2 - z^2)) cut by the box's rectangle, which is closed. The
/// interval is cut where the circle meets a side or a corner; in each half of a piece z is stretched by t^2 (3 - 2 t), which takes
/// away the square-root behaviour at its ends, and 16-point Gauss-Legendre does the rest.
#[must_use]
pub fn sphere_in_box(centre: [f64; 3], radius: f64, region: &Bounds) -> f64 {
    let low: [f64; 3] = std::array::from_fn(|a| region.minimum[a] - centre[a]);
    let high: [f64; 3] = std::array::from_fn(|a| region.maximum[a] - centre[a]);
    if (0..3).any(|a| low[a] >= radius || high[a] <= -radius || low[a] >= high[a]) {
        return 0.0;
    }
    if (0..3).all(|a| low[a] <= -radius && high[a] >= radius) {
        return 4.0 / 3.0 * PI * radius.powi(3);
    }
    let rectangle = ([low[0], high[0]], [low[1], high[1]]);
    let mut cuts = vec![low[2].max(-radius), high[2].min(radius)];
    for x in rectangle.0 {
        push_cuts(&mut cuts, radius * radius - x * x);
        for y in rectangle.1 {
            push_cuts(&mut cuts, radius * radius - x * x - y * y);
        }
    }
    for y in rectangle.1 {
        push_cuts(&mut cuts, radius * radius - y * y);
    }
    let (from, to) = (cuts[0], cuts[1]);
    cuts.retain(|z| (from..=to).contains(z));
    cuts.sort_by(f64::total_cmp);
    let area = |z: f64| circle_in_rectangle((radius * radius - z * z).max(0.0).sqrt(), rectangle.0, rectangle.1);
    let halves = |piece: &[f64]| {
        let middle = 0.5 * (piece[0] + piece[1]);
        integrate_stretched(area, piece[0], middle) + integrate_stretched(area, middle, piece[1])
    };
    cuts.windows(2).map(halves).sum()
}

/// Area [m2] of the circle of `radius` [m] about the origin inside the rectangle `x` times `y` (ascending pairs) [m].
#[must_use]
pub fn circle_in_rectangle(radius: f64, x: [f64; 2], y: [f64; 2]) -> f64 {
    let corner = |x, y| circle_in_quarter_plane(radius, x, y);
    (corner(x[1], y[1]) - corner(x[0], y[1]) - corner(x[1], y[0]) + corner(x[0], y[0])).max(0.0)
}

/// Area of the circle where X <= x and Y <= y: integral over X of the chord's part below y.
fn circle_in_quarter_plane(radius: f64, x: f64, y: f64) -> f64 {
    if radius <= 0.0 || x <= -radius || y <= -radius {
        return 0.0;
    }
    let x = x.min(radius);
    // Area under the half chord from 0 to u: integral of sqrt(r^2 - u^2).
    let under = |u: f64| {
        let angle = if u.abs() >= radius { FRAC_PI_2.copysign(u) } else { (u / radius).asin() };
        0.5 * (u * (radius * radius - u * u).max(0.0).sqrt() + radius * radius * angle)
    };
    let whole_chords = |from: f64, to: f64| if to > from { 2.0 * (under(to) - under(from)) } else { 0.0 };
    if y >= radius {
        return whole_chords(-radius, x);
    }
    // For |X| < half the line y = const cuts the chord: its part below has the length y + sqrt(r^2 - X^2).
    let half = (radius * radius - y * y).sqrt();
    let right = x.min(half);
    let cut = if right > -half { y * (right + half) + under(right) - under(-half) } else { 0.0 };
    if y > 0.0 { cut + whole_chords(-radius, x.min(-half)) + whole_chords(half, x) } else { cut }
}

fn inside(particle: &ParticleState, body: Body, region: &Bounds) -> f64 {
    let (centre, radius) = (particle.position, particle.radius);
    match body {
        Body::Sphere => sphere_in_box(centre.into(), radius, region),
        Body::Disc { thickness } => {
            let span = |axis: usize| [region.minimum[axis] - centre[axis], region.maximum[axis] - centre[axis]];
            thickness * circle_in_rectangle(radius, span(0), span(2))
        }
    }
}

/// Volume [m3] shared by two overlapping particles whose middle lies inside `region`.
fn lens_inside(a: &ParticleState, b: &ParticleState, body: Body, region: &Bounds) -> f64 {
    let (r, s) = (a.radius, b.radius);
    let distance = (b.position - a.position).norm();
    if distance >= r + s || !region.contains(&(0.5 * (a.position + b.position))) {
        return 0.0;
    }
    let whole = r.min(s);
    match body {
        Body::Sphere if distance <= (r - s).abs() => 4.0 / 3.0 * PI * whole.powi(3),
        Body::Sphere => {
            let overlap = r + s - distance;
            PI * overlap * overlap * (distance * distance + 2.0 * distance * (r + s) - 3.0 * (r - s).powi(2))
                / (12.0 * distance)
        }
        Body::Disc { thickness } if distance <= (r - s).abs() => thickness * PI * whole * whole,
        Body::Disc { thickness } => {
            // Two circular segments beyond the common chord, which lies x from the first centre.
            let x = (distance * distance + r * r - s * s) / (2.0 * distance);
            let segment = |radius: f64, x: f64| {
                radius * radius * (x / radius).clamp(-1.0, 1.0).acos() - x * (radius * radius - x * x).max(0.0).sqrt()
            };
            thickness * (segment(r, x) + segment(s, distance - x))
        }
    }
}

fn push_cuts(cuts: &mut Vec<f64>, square: f64) {
    if square > 0.0 {
        cuts.extend([-square.sqrt(), square.sqrt()]);
    }
}

/// Integral of `f` from `from` to `to`, z = from + (to - from) t^2 (3 - 2 t).
fn integrate_stretched(f: impl Fn(f64) -> f64, from: f64, to: f64) -> f64 {
    let length = to - from;
    let mut sum = 0.0;
    for (node, weight) in GAUSS_16 {
        for t in [0.5 - 0.5 * node, 0.5 + 0.5 * node] {
            sum += 0.5 * weight * f(from + length * t * t * (3.0 - 2.0 * t)) * 6.0 * t * (1.0 - t);
        }
    }
    sum * length
}

/// Positive nodes and weights of 16-point Gauss-Legendre quadrature on [-1, 1] (Abramowitz and Stegun 1964, table 25.4).
const GAUSS_16: [(f64, f64); 8] = [
    (0.095_012_509_837_637_44, 0.189_450_610_455_068_5),
    (0.281_603_550_779_258_9, 0.182_603_415_044_923_6),
    (0.458_016_777_657_227_4, 0.169_156_519_395_002_5),
    (0.617_876_244_402_643_7, 0.149_595_988_816_576_7),
    (0.755_404_408_355_003, 0.124_628_971_255_533_9),
    (0.865_631_202_387_831_7, 0.095_158_511_682_492_78),
    (0.944_575_023_073_232_6, 0.062_253_523_938_647_89),
    (0.989_400_934_991_649_9, 0.027_152_459_411_754_1),
];

#[cfg(test)]
mod tests {
    use super::*;
    use crate::analysis::measure::tests::particle;
    use approx::assert_relative_eq;
    use proptest::prelude::*;

    const SPHERE: f64 = 4.0 / 3.0 * PI;
    const WIDE: [f64; 3] = [9.0; 3];

    fn bounds(minimum: [f64; 3], maximum: [f64; 3]) -> Bounds {
        Bounds { minimum, maximum }
    }

    #[test]
    fn half_quarter_and_eighth_of_a_sphere() {
        for (minimum, share) in [([0.0, -9.0, -9.0], 0.5), ([0.0, 0.0, -9.0], 0.25), ([0.0; 3], 0.125)] {
            let volume = sphere_in_box([0.0; 3], 1.0, &bounds(minimum, WIDE));
            assert_relative_eq!(volume, share * SPHERE, max_relative = 1e-10);
        }
    }

    #[test]
    fn caps_on_every_axis_are_the_textbook_cap() {
        for axis in 0..3 {
            for height in [1e-3, 0.1, 0.7, 1.0, 1.6, 1.999] {
                let mut minimum = [-9.0; 3];
                minimum[axis] = 1.0 - height;
                let volume = sphere_in_box([0.0; 3], 1.0, &bounds(minimum, WIDE));
                // Relative to the sphere: V = pi h^2 (3 r - h) / 3.
                assert_relative_eq!(volume, PI * height * height * (3.0 - height) / 3.0, epsilon = 1e-10 * SPHERE);
            }
        }
    }

    #[test]
    fn a_box_inside_the_sphere_keeps_its_own_volume() {
        let volume = sphere_in_box([0.1, 0.0, -0.1], 2.0, &bounds([-0.5; 3], [0.5, 0.7, 0.6]));
        assert_relative_eq!(volume, 1.0 * 1.2 * 1.1, max_relative = 1e-10);
    }

    #[test]
    fn circle_and_rectangle_in_closed_form() {
        let segment = |c: f64| c.acos() - c * (1.0 - c * c).sqrt();
        assert_relative_eq!(circle_in_rectangle(1.0, [-5.0, 5.0], [-5.0, 5.0]), PI, epsilon = 1e-14);
        assert_relative_eq!(circle_in_rectangle(1.0, [0.3, 5.0], [-5.0, 5.0]), segment(0.3), epsilon = 1e-14);
        assert_relative_eq!(circle_in_rectangle(1.0, [-5.0, 5.0], [-5.0, -0.4]), segment(0.4), epsilon = 1e-14);
        assert_relative_eq!(circle_in_rectangle(1.0, [-0.6, 0.6], [-0.2, 0.6]), 1.2 * 0.8, epsilon = 1e-14);
        assert_relative_eq!(
            circle_in_rectangle(1.0, [-0.8, 0.8], [-5.0, 5.0]),
            PI - 2.0 * segment(0.8),
            epsilon = 1e-14
        );
    }

    #[test]
    fn two_spheres_share_the_textbook_lens() {
        // Equal radii r, distance d: V = pi (4 r + d) (2 r - d)^2 / 12.
        let (a, b) = (particle(0, [0.0; 3], 1.0), particle(1, [1.8, 0.0, 0.0], 1.0));
        let region = bounds([-2.0; 3], [4.0, 2.0, 2.0]);
        let found = solid_fraction(&[a, b], &[(a.id, b.id)], Body::Sphere, &region).unwrap();
        let volume = 6.0 * 4.0 * 4.0;
        assert_relative_eq!(found.value, 2.0 * SPHERE / volume, max_relative = 1e-12);
        assert_relative_eq!(found.overlap, PI * 5.8 * 0.2 * 0.2 / 12.0 / volume, max_relative = 1e-12);
        let disc = Body::Disc { thickness: 0.5 };
        let flat = solid_fraction(&[a, b], &[(a.id, b.id)], disc, &region).unwrap();
        assert_relative_eq!(flat.value, 2.0 * PI / 24.0, max_relative = 1e-12);
        let lens = 2.0 * 0.9_f64.acos() - 0.9 * (4.0 - 1.8_f64 * 1.8).sqrt();
        assert_relative_eq!(flat.overlap, lens / 24.0, max_relative = 1e-12);
    }

    #[test]
    fn flat_and_empty_regions_have_no_fraction() {
        assert_eq!(solid_fraction(&[], &[], Body::Sphere, &bounds([0.0; 3], [1.0, 1.0, 0.0])), None);
        assert_eq!(solid_fraction(&[], &[], Body::Sphere, &Bounds::EMPTY), None);
    }

    proptest! {
        #[test]
        fn eight_boxes_about_any_corner_share_the_whole_sphere(
            x in -1.2..1.2f64, y in -1.2..1.2f64, z in -1.2..1.2f64, radius in 0.3..1.5f64,
        ) {
            let mut sum = 0.0;
            for corner in 0..8 {
                let side = |axis: usize, at: f64| if corner >> axis & 1 == 0 { (-9.0, at) } else { (at, 9.0) };
                let spans = [side(0, x), side(1, y), side(2, z)];
                sum += sphere_in_box([0.0; 3], radius, &bounds(spans.map(|s| s.0), spans.map(|s| s.1)));
            }
            prop_assert!((sum / (SPHERE * radius.powi(3)) - 1.0).abs() < 1e-9, "{sum}");
        }

        #[test]
        fn axes_are_equal(a in -1.0..0.5f64, b in -1.0..0.5f64, c in -1.0..0.5f64) {
            let one = sphere_in_box([0.0; 3], 1.0, &bounds([a, b, c], [a + 0.6, b + 0.7, c + 0.8]));
            let turned = sphere_in_box([0.0; 3], 1.0, &bounds([c, a, b], [c + 0.8, a + 0.6, b + 0.7]));
            prop_assert!((one - turned).abs() < 1e-9, "{one} {turned}");
        }
    }
}
