//! Angle of repose: inclination of the free surface of a heap, with its uncertainty.

use super::Unmeasurable;
use super::size_distribution::SizeDistribution;
use super::statistics::{BlockBootstrap, Line, block_length, median, standard_deviation, theil_sen};
use super::surface_profile::{SurfacePoint, surface_profile};
use crate::math::Bounds;
use crate::particle::{Body, GradingBy, ParticleState};
use std::ops::Range;

/// Bin width, as a multiple of the median diameter by mass: wide enough that every cell holds a surface particle.
const BIN_OVER_DIAMETER: f64 = 1.25;
/// Fewest bins of a slope: below, slope and curvature cannot be told apart.
const FEWEST_BINS: usize = 8;
/// Fewest bins of the crest or the toe beside the slope.
const FEWEST_OUTER_BINS: usize = 3;
/// Largest number of places tried for each end of the slope.
const MOST_PLACES: usize = 28;
/// A piece beside the slope belongs to it where it is at least this share as steep.
const NEARLY_AS_STEEP: f64 = 0.7;
/// A second flank counts where it falls at least this share of the first one's height.
const SECOND_FLANK: f64 = 0.5;
const RESAMPLES: usize = 400;
const SEED: u64 = 0x7265_706f_7365;

/// Angle of repose of a heap.
#[derive(Debug, Clone, PartialEq)]
pub struct HeapAngle {
    /// Angle of the free surface against the horizontal [rad]; mean of the flanks.
    pub angle: f64,
    /// Standard uncertainty [rad].
    pub uncertainty: f64,
    /// The flanks that were measured, the higher one first.
    pub flanks: Vec<Flank>,
    /// Width of the bins [m].
    pub bin_width: f64,
}

/// One side of a heap.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Flank {
    /// Angle against the horizontal [rad], positive.
    pub angle: f64,
    /// Part of the uncertainty from the roughness of the surface [rad].
    pub roughness: f64,
    /// Part of the uncertainty from where the slope is taken to begin and end [rad].
    pub extent: f64,
    /// Upper end of the fitted line: place along the axis, height [m].
    pub upper: SurfacePoint,
    /// Lower end of the fitted line.
    pub lower: SurfacePoint,
    /// Number of bins in the fit.
    pub bins: usize,
}

impl Flank {
    /// Standard uncertainty of `angle` [rad]: both parts in quadrature.
    #[must_use]
    pub fn uncertainty(&self) -> f64 {
        self.roughness.hypot(self.extent)
    }
}

/// Angle of repose of the particles whose centres lie in `region`, theta = atan |dh/ds| along axis `along` (0 = x, 1 = y)   [rad]
///
/// h surface height [m] at s [m] from [`surface_profile`], in bins of 1.25 median diameters. From the crest (the highest
/// running median of five bins) each side is a flank as far as the surface goes on. On a flank, the slope is told from a
/// rounded crest and a run-out toe by continuous lines of one, two or three pieces, fitted to the least sum of absolute
/// distances at every choice of joints; the number of pieces is that of the smallest Bayesian information criterion
/// (Laplace scatter, three parameters a joint), and the piece with the largest fall is
/// the slope, with its neighbours where they are at least 0.7 times as steep. Its angle is that of
/// the Theil-Sen line through its bins. A second flank of at least half the height is measured too.
///
/// Uncertainty of a flank, in quadrature: roughness = scatter of the angle over 400 moving-block resamples of the
/// residuals (Künsch 1989; fixed seed); extent = half the difference of the angles without the upper and without the
/// lower quarter of the slope / sqrt(3), which is large on a curved surface. Of two flanks: the mean's, or half their
/// difference where that is larger. It is that of one heap; replicates tell how heaps differ.
/// Valid: a heap uniform across the other horizontal axis, gravity along -z, a slope of at least 8 bins.
pub fn angle_of_repose(
    particles: &[ParticleState],
    body: Body,
    region: &Bounds,
    along: usize,
) -> Result<HeapAngle, Unmeasurable> {
    let sizes = SizeDistribution::of(particles, body, GradingBy::Mass, region)
        .ok_or_else(|| Unmeasurable("no particle in the region of the heap".into()))?;
    let bin_width = BIN_OVER_DIAMETER * sizes.percentile(0.5).diameter;
    let profile = surface_profile(particles, region, along, bin_width);
    let mut flanks: Vec<Flank> = sides(&profile).iter().filter_map(|side| measure_flank(side, bin_width)).collect();
    let fall = |flank: &Flank| flank.upper.height - flank.lower.height;
    flanks.sort_by(|a, b| fall(b).total_cmp(&fall(a)));
    let Some(highest) = flanks.first().map(fall) else {
        return Err(Unmeasurable(format!(
            "no slope of at least {FEWEST_BINS} bins of {:.3} mm in the region of the heap",
            bin_width * 1e3
        )));
    };
    flanks.retain(|flank| fall(flank) >= SECOND_FLANK * highest);
    let (angle, uncertainty) = match flanks[..] {
        [first, second, ..] => (
            0.5 * (first.angle + second.angle),
            (0.5 * first.uncertainty().hypot(second.uncertainty())).max(0.5 * (first.angle - second.angle).abs()),
        ),
        _ => (flanks[0].angle, flanks[0].uncertainty()),
    };
    Ok(HeapAngle { angle, uncertainty, flanks, bin_width })
}

/// Both sides of the crest, each from the crest outwards as far as the surface goes on (one empty bin is bridged).
fn sides(profile: &[Option<SurfacePoint>]) -> [Vec<SurfacePoint>; 2] {
    let smooth = |k: usize| {
        let near = &profile[k.saturating_sub(2)..(k + 3).min(profile.len())];
        median(&near.iter().flatten().map(|p| p.height).collect::<Vec<_>>()).unwrap_or(f64::NEG_INFINITY)
    };
    let surface = (0..profile.len()).filter(|k| profile[*k].is_some());
    let Some(crest) = surface.max_by(|a, b| smooth(*a).total_cmp(&smooth(*b))) else { return [Vec::new(), Vec::new()] };
    let walk = |bins: &mut dyn Iterator<Item = &Option<SurfacePoint>>| {
        let mut side = Vec::new();
        let mut gap = 0;
        for bin in bins {
            gap = if bin.is_some() { 0 } else { gap + 1 };
            if gap > 1 {
                break;
            }
            side.extend(*bin);
        }
        side
    };
    [walk(&mut profile[crest..].iter()), walk(&mut profile[..=crest].iter().rev())]
}

/// Measures a flank, given from the crest outwards; `None` where it is too short or does not fall.
fn measure_flank(side: &[SurfacePoint], bin_width: f64) -> Option<Flank> {
    let x: Vec<f64> = side.iter().map(|p| p.position).collect();
    let h: Vec<f64> = side.iter().map(|p| p.height).collect();
    let slope = slope_extent(&x, &h, bin_width)?;
    let (x, h) = (&x[slope.clone()], &h[slope]);
    let line = theil_sen(x, h)?;
    let outward = (x[x.len() - 1] - x[0]).signum();
    let steepness = |line: &Line| (-line.slope * outward).atan();
    if steepness(&line) <= 0.0 {
        return None;
    }
    let end = |position: f64| SurfacePoint { position, height: line.at(position) };
    let quarter = x.len() / 4;
    let without_upper = theil_sen(&x[quarter..], &h[quarter..])?;
    let without_lower = theil_sen(&x[..x.len() - quarter], &h[..h.len() - quarter])?;
    let difference = steepness(&without_upper) - steepness(&without_lower);
    Some(Flank {
        angle: steepness(&line),
        roughness: roughness(x, h, &line)?,
        extent: 0.5 * difference.abs() / 3.0_f64.sqrt(),
        upper: end(x[0]),
        lower: end(x[x.len() - 1]),
        bins: x.len(),
    })
}

/// Scatter of the angle [rad] over resamples of the residuals. Blocks are as long as the residuals remember, but a few
/// dozen bins tell that poorly and a resample of few blocks scatters too little; single bins are the lower limit.
fn roughness(x: &[f64], h: &[f64], line: &Line) -> Option<f64> {
    let residuals: Vec<f64> = x.iter().zip(h).map(|(x, h)| h - line.at(*x)).collect();
    let remembered = block_length(&residuals);
    Some(scatter(x, &residuals, line, remembered)?.max(scatter(x, &residuals, line, 1)?))
}

fn scatter(x: &[f64], residuals: &[f64], line: &Line, block: usize) -> Option<f64> {
    let count = residuals.len();
    let mut resampler = BlockBootstrap::new(count, block, SEED);
    let angles: Vec<f64> = (0..RESAMPLES)
        .filter_map(|_| {
            let drawn: Vec<f64> = resampler.draw().iter().zip(x).map(|(k, x)| line.at(*x) + residuals[*k]).collect();
            theil_sen(x, &drawn).map(|line| line.slope.atan())
        })
        .collect();
    // Two parameters are fitted, and blocks lose the scatter between blocks: both make residuals look too small.
    let inflation = (count as f64 / (count - 2) as f64 * count as f64 / (count - block) as f64).sqrt();
    standard_deviation(&angles).map(|scatter| inflation * scatter)
}

/// Bins of the slope between crest and toe; `None` where there are too few.
fn slope_extent(x: &[f64], h: &[f64], bin_width: f64) -> Option<Range<usize>> {
    let count = x.len();
    if count < FEWEST_BINS {
        return None;
    }
    let fewest_slope = FEWEST_BINS.max(count / 4);
    let stride = count.div_ceil(MOST_PLACES);
    let joints: Vec<usize> = (FEWEST_OUTER_BINS..count.saturating_sub(FEWEST_OUTER_BINS)).step_by(stride).collect();
    let mut choices: Vec<Vec<usize>> = vec![vec![]];
    choices.extend(joints.iter().map(|j| vec![*j]));
    for (k, first) in joints.iter().enumerate() {
        choices.extend(joints[k + 1..].iter().filter(|j| **j >= first + FEWEST_OUTER_BINS).map(|j| vec![*first, *j]));
    }
    let mut best: Option<(f64, Range<usize>)> = None;
    for joints in choices {
        let Some((distances, fitted)) = broken_line(x, h, &joints) else { continue };
        let mut ends = vec![0];
        ends.extend(&joints);
        ends.push(count - 1);
        let Some(slope) = steepest_run(x, &fitted, &ends) else { continue };
        // Distances below a fiftieth of a bin are no roughness of a surface of spheres: they prove no further joint.
        let distance = (distances / count as f64).max(0.02 * bin_width);
        let criterion = 2.0 * count as f64 * distance.ln() + (2 + 3 * joints.len()) as f64 * (count as f64).ln();
        if slope.len() >= fewest_slope && best.as_ref().is_none_or(|(least, _)| criterion < *least) {
            best = Some((criterion, slope));
        }
    }
    best.map(|(_, slope)| slope)
}

/// The piece with the largest fall, and the pieces next to it that are nearly as steep: a slope that bends a little is
/// one slope, and its bend goes into the uncertainty.
fn steepest_run(x: &[f64], fitted: &[f64], ends: &[usize]) -> Option<Range<usize>> {
    let fall = |k: usize| fitted[ends[k]] - fitted[ends[k + 1]];
    let steepness = |k: usize| fall(k) / (x[ends[k + 1]] - x[ends[k]]).abs();
    let pieces = ends.len() - 1;
    let main = (0..pieces).max_by(|a, b| fall(*a).total_cmp(&fall(*b)))?;
    let belongs = |k: &usize| steepness(*k) >= NEARLY_AS_STEEP * steepness(main);
    let first = (0..main).rev().take_while(belongs).last().unwrap_or(main);
    let last = (main + 1..pieces).take_while(belongs).last().unwrap_or(main);
    Some(ends[first]..ends[last + 1] + 1)
}

/// Continuous line with joints at the given bins and the least sum of absolute distances (iteratively re-weighted least
/// squares): that sum [m], and the fitted heights [m].
fn broken_line(x: &[f64], h: &[f64], joints: &[usize]) -> Option<(f64, Vec<f64>)> {
    let (origin, length) = (x[0], x[x.len() - 1] - x[0]);
    let place = |k: usize| (x[k] - origin) / length;
    let terms = 2 + joints.len();
    let design = nalgebra::DMatrix::from_fn(x.len(), terms, |row, term| match term {
        0 => 1.0,
        1 => place(row),
        _ => (place(row) - place(joints[term - 2])).max(0.0),
    });
    let heights = nalgebra::DVector::from_column_slice(h);
    let smallest = 1e-3 * h.iter().fold(0.0_f64, |largest, h| largest.max(h.abs())).max(f64::MIN_POSITIVE);
    let mut weights = nalgebra::DVector::from_element(x.len(), 1.0);
    let mut fitted = heights.clone();
    for _ in 0..12 {
        let weighted = nalgebra::DMatrix::from_fn(x.len(), terms, |row, term| weights[row] * design[(row, term)]);
        let normal = design.transpose() * &weighted;
        let solution = normal.cholesky()?.solve(&(weighted.transpose() * &heights));
        fitted = &design * solution;
        weights = (&heights - &fitted).map(|r| 1.0 / r.abs().max(smallest));
    }
    Some(((&heights - &fitted).map(f64::abs).sum(), fitted.as_slice().to_vec()))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::analysis::measure::tests::particle;
    use crate::analysis::statistics::mean;
    use crate::math::{Vec3, vec3};
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;
    use std::collections::HashMap;

    const ALL: Bounds = Bounds { minimum: [-1e9; 3], maximum: [1e9; 3] };
    /// Depth of the slice [m].
    const DEPTH: f64 = 40e-3;

    /// Random spheres of 3 to 5 mm without overlaps that fill the space below `surface` (height [m] at x [m]) down to
    /// three diameters, x from 0 to `length`; what lies deeper does not show.
    fn heap(surface: impl Fn(f64) -> f64, length: f64, random: &mut ChaCha8Rng) -> Vec<ParticleState> {
        let cell = |x: &Vec3| [x.x, x.y, x.z].map(|c| (c / 5e-3).floor() as i32);
        let mut cells: HashMap<[i32; 3], Vec<usize>> = HashMap::new();
        let mut particles: Vec<ParticleState> = Vec::new();
        for _ in 0..25_000 {
            let radius = random.random_range(1.5e-3..2.5e-3);
            let (x, y) = (random.random_range(0.0..length), random.random_range(radius..DEPTH - radius));
            // Touches the surface from below, as far as it is straight within a radius.
            let steepness = (surface(x + 1e-4) - surface(x - 1e-4)) / 2e-4;
            let z = surface(x) - radius * steepness.hypot(1.0) - random.random_range(0.0..12e-3);
            let centre = vec3(x, y, z);
            let home = cell(&centre);
            let free = (0..27).all(|n| {
                let near = [home[0] + n % 3 - 1, home[1] + n / 3 % 3 - 1, home[2] + n / 9 - 1];
                cells.get(&near).is_none_or(|list| {
                    list.iter().all(|k| (particles[*k].position - centre).norm() >= particles[*k].radius + radius)
                })
            });
            if free {
                cells.entry(home).or_default().push(particles.len());
                particles.push(particle(particles.len() as u64, centre.into(), radius));
            }
        }
        particles
    }

    fn measured(particles: &[ParticleState]) -> HeapAngle {
        angle_of_repose(particles, Body::Sphere, &ALL, 0).unwrap()
    }

    /// Errors [deg] and errors over stated uncertainty of `seeds` heaps with a surface made for `angle` [deg].
    fn errors(
        angle: f64,
        seeds: Range<u64>,
        build: impl Fn(f64, &mut ChaCha8Rng) -> Vec<ParticleState>,
    ) -> Vec<[f64; 2]> {
        let tangent = angle.to_radians().tan();
        seeds
            .map(|seed| {
                let found = measured(&build(tangent, &mut ChaCha8Rng::seed_from_u64(seed)));
                let error = found.angle.to_degrees() - angle;
                [error, error / found.uncertainty.to_degrees()]
            })
            .collect()
    }

    #[test]
    fn known_slopes_are_found_without_bias_and_within_the_stated_uncertainty() {
        // Surface 150 mm long, 30 bins of 5 mm: tops scatter by about 0.6 mm, so the slope of a line by
        // 0.6 / 150 * sqrt(12 / 30) = 2.5e-3, i.e. 0.15 deg. Eight heaps an angle: their mean to 0.05 deg; three of
        // these, and 0.1 deg for the bias of random packings at the ends of the surface, make 0.25 deg.
        let mut pulls = Vec::new();
        for angle in [20.0, 25.0, 30.0, 35.5, 40.0, 45.0] {
            let found = errors(angle, 0..8, |tangent, random| heap(|x| (0.15 - x) * tangent, 0.15, random));
            let bias = mean(&found.iter().map(|e| e[0]).collect::<Vec<_>>()).unwrap();
            assert!(bias.abs() < 0.25, "{angle} deg: mean error {bias} deg");
            pulls.extend(found.iter().map(|e| e[1]));
        }
        let spread = (pulls.iter().map(|p| p * p).sum::<f64>() / pulls.len() as f64).sqrt();
        // 48 pulls know their spread to 10 %. Below 1 is wanted rather than above: the extent part also holds roughness.
        assert!((0.5..1.25).contains(&spread), "errors are {spread} of the stated uncertainties");
    }

    #[test]
    fn crest_toe_flying_and_scattered_particles_do_not_count() {
        // Level crest of 25 mm, slope of 110 mm, level run-out of 60 mm; 25 particles in flight, 40 scattered beyond.
        let found = errors(35.0, 0..8, |tangent, random| {
            let surface = |x: f64| (0.135 - x).clamp(0.0, 0.11) * tangent;
            let mut particles = heap(surface, 0.195, random);
            for k in 0..65 {
                let z = if k < 25 { random.random_range(0.15..0.3) } else { 2e-3 };
                let x = if k < 25 { random.random_range(0.0..0.2) } else { random.random_range(0.21..0.4) };
                particles.push(particle(9000 + k, [x, random.random_range(0.0..DEPTH), z], 2e-3));
            }
            particles
        });
        // 22 bins on 110 mm: 0.6 / 110 * sqrt(12 / 22) = 0.23 deg a heap, and joints set one bin wrong take in or leave
        // out a bin of level surface: 0.4 deg for the mean.
        let bias = mean(&found.iter().map(|e| e[0]).collect::<Vec<_>>()).unwrap();
        assert!(bias.abs() < 0.4, "mean error {bias} deg of {found:?}");
        assert!(found.iter().all(|e| e[1].abs() < 4.0), "{found:?}");
    }

    #[test]
    fn a_two_sided_heap_gives_both_flanks() {
        let mut random = ChaCha8Rng::seed_from_u64(5);
        let tangent = 30.0_f64.to_radians().tan();
        let found = measured(&heap(|x| 0.1 - (x - 0.1).abs() * tangent, 0.2, &mut random));
        assert_eq!(found.flanks.len(), 2, "{found:?}");
        assert!((found.angle.to_degrees() - 30.0).abs() < 1.0, "{found:?}");
        assert!(found.flanks.iter().all(|flank| flank.upper.height > flank.lower.height));
    }

    #[test]
    fn the_heap_may_lie_along_y_and_either_way_round() {
        let mut random = ChaCha8Rng::seed_from_u64(6);
        let tangent = 30.0_f64.to_radians().tan();
        let particles = heap(|x| (0.15 - x) * tangent, 0.15, &mut random);
        let mirrored: Vec<_> = particles
            .iter()
            .map(|p| ParticleState { position: vec3(p.position.y, -p.position.x, p.position.z), ..*p })
            .collect();
        let (one, other) = (measured(&particles), angle_of_repose(&mirrored, Body::Sphere, &ALL, 1).unwrap());
        // Bins start at the other end, so they are cut elsewhere: the same within the uncertainty.
        assert!((one.angle - other.angle).abs() < 3.0 * one.uncertainty, "{one:?} {other:?}");
    }

    #[test]
    fn a_curved_surface_says_so_in_the_extent() {
        let mut random = ChaCha8Rng::seed_from_u64(8);
        let straight = measured(&heap(|x| (0.15 - x) * 0.6, 0.15, &mut random));
        let curved = measured(&heap(|x| 4.0 * (0.15 - x).max(0.0).powi(2), 0.15, &mut random));
        assert!(curved.flanks[0].extent > 2.0 * straight.flanks[0].extent, "{curved:?} {straight:?}");
    }

    #[test]
    fn says_why_there_is_no_angle() {
        let single = [particle(0, [0.0; 3], 1e-3)];
        let reason = |particles: &[ParticleState]| angle_of_repose(particles, Body::Sphere, &ALL, 0).unwrap_err().0;
        assert!(reason(&[]).contains("no particle"));
        assert!(reason(&single).contains("no slope of at least 8 bins"));
    }

    #[test]
    fn the_same_heap_gives_the_same_bits() {
        let particles = heap(|x| (0.15 - x) * 0.6, 0.15, &mut ChaCha8Rng::seed_from_u64(9));
        assert_eq!(measured(&particles), measured(&particles));
    }
}
