//! Curves and distributions of both sides on common axes.

use super::Verdict;
use super::judge::judge;
use super::margin::{Kind, Margin, Margins};
use super::noise::noise;
use crate::analysis::statistics::student::student_quantile;
use crate::analysis::statistics::two_samples::{CONFIDENCE, kolmogorov_smirnov};
use crate::analysis::statistics::{mean, quantile_of_sorted, standard_deviation};
use serde::Serialize;

/// Points of a discharge curve or surface.
const POINTS: usize = 201;
/// Places at which distributions of single runs are compared for their scatter: quantiles of all samples together.
const QUANTILES: usize = 257;
/// Fewest and most bins of a histogram.
const BINS: [usize; 2] = [5, 40];

/// An axis.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Axis {
    /// What it shows.
    pub label: String,
    /// Its unit; empty for a pure number.
    pub unit: String,
}

impl Axis {
    fn new(label: &str, unit: &str) -> Self {
        Self { label: label.to_owned(), unit: unit.to_owned() }
    }
}

/// How the distance of two curves is measured.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Distance {
    /// Largest |difference of the mean curves|, in the curves' unit.
    LargestDifference,
    /// Largest |difference of the distribution functions| of all samples of a side together [-] (Smirnov 1948).
    KolmogorovSmirnov,
}

/// Two sets of curves, compared.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct CurveComparison {
    /// Name.
    pub name: String,
    /// What it is: decides the margin.
    pub kind: Kind,
    /// Axis of `grid`.
    pub x: Axis,
    /// Axis of the curves.
    pub y: Axis,
    /// Places of the curves' points; of a histogram the middles of its bins.
    pub grid: Vec<f64>,
    /// Edges of the bins of a histogram; empty for other curves.
    pub bin_edges: Vec<f64>,
    /// The runs.
    pub runs: Option<SetCurve>,
    /// The reference.
    pub reference: Option<SetCurve>,
    /// How `difference` is measured.
    pub distance: Distance,
    /// The distance of both sides, >= 0.
    pub difference: Option<f64>,
    /// Place of the largest difference, on the axis of `grid`.
    pub largest_at: Option<f64>,
    /// Distance that the scatter of single runs alone stays below in 95 of 100 cases.
    pub noise_95: Option<f64>,
    /// Mean distance of two runs of the same side; null where no side has two.
    pub distance_within: Option<f64>,
    /// 95 % interval of the true distance, `difference` -+ `noise_95`, not below 0.
    pub interval_95: Option<[f64; 2]>,
    /// Largest distance that would not matter.
    pub margin: Option<f64>,
    /// The margin as it was asked for.
    pub margin_asked: Margin,
    /// The verdict.
    pub verdict: Verdict,
    /// Runs that each side needs, about, to decide an inconclusive verdict, if distance and scatter stay as they are.
    pub runs_needed: Option<u64>,
    /// What is doubtful; empty where nothing is.
    pub note: String,
}

/// The curves of one side.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct SetCurve {
    /// Runs that have the curve.
    pub count: usize,
    /// Mean curve.
    pub mean: Vec<f64>,
    /// Half of the width of the mean's 95 % interval, point by point; null for a single run.
    pub half_width_95: Option<Vec<f64>>,
}

/// Curves of both sides on one grid, before they are judged.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Curves {
    pub name: String,
    kind: Kind,
    x: Axis,
    y: Axis,
    grid: Vec<f64>,
    bin_edges: Vec<f64>,
    values: [Vec<Vec<f64>>; 2],
    measured: Measured,
    note: Option<String>,
}

/// The distance of both sides, and what tells its noise.
#[derive(Debug, Clone, PartialEq)]
struct Measured {
    distance: Distance,
    difference: Option<(f64, f64)>,
    deviations: [Vec<Vec<f64>>; 2],
    within: Option<f64>,
    /// What a relative margin is a share of.
    scale: f64,
}

impl Curves {
    /// Unit of the distance, and so of a margin.
    pub fn unit(&self) -> &str {
        if self.measured.distance == Distance::KolmogorovSmirnov { "" } else { &self.y.unit }
    }

    /// Judges the curves.
    pub fn compare(&self, margins: &Margins) -> CurveComparison {
        let margin_asked = margins.of(&self.name, self.kind);
        let margin = margin_asked.absolute(self.measured.scale);
        let difference = self.measured.difference.map(|(difference, _)| difference);
        let [first, second] = &self.measured.deviations;
        let noise = difference.and_then(|_| noise([first, second]));
        // The scatter of a point whose interval is as wide as the band: carries the band's reach into runs needed.
        let scatter = noise.map(|noise| {
            let mut scatter = noise.scatter;
            let widening = if noise.reach > 0.0 { noise.reach / scatter.half_width() } else { 0.0 };
            scatter.standard_error *= widening;
            scatter.variances = scatter.variances.map(|variance| variance * widening * widening);
            scatter
        });
        let judged = judge(difference, scatter, margin);
        CurveComparison {
            name: self.name.clone(),
            kind: self.kind,
            x: self.x.clone(),
            y: self.y.clone(),
            grid: self.grid.clone(),
            bin_edges: self.bin_edges.clone(),
            runs: set_curve(&self.values[0]),
            reference: set_curve(&self.values[1]),
            distance: self.measured.distance,
            difference,
            largest_at: self.measured.difference.map(|(_, at)| at),
            noise_95: noise.map(|noise| noise.reach),
            distance_within: self.measured.within,
            interval_95: judged.interval.map(|[low, high]| [low.max(0.0), high]),
            margin: difference.map(|_| margin),
            margin_asked,
            verdict: judged.verdict,
            runs_needed: judged.runs_needed,
            note: self.notes().join("; "),
        }
    }

    fn notes(&self) -> Vec<String> {
        let counts = [self.values[0].len(), self.values[1].len()];
        let mut notes: Vec<String> = self.note.iter().cloned().collect();
        match counts {
            [0, 0] => {}
            [0, _] => notes.push("the runs have no such curve".to_owned()),
            [_, 0] => notes.push("the reference has no such curve".to_owned()),
            _ => notes.extend(super::few_runs(counts)),
        }
        notes
    }
}

fn set_curve(curves: &[Vec<f64>]) -> Option<SetCurve> {
    let mean = mean_curve(curves)?;
    let count = curves.len();
    let half_width_95 = (count > 1).then(|| {
        let t = student_quantile(0.5 * (1.0 + CONFIDENCE), (count - 1) as f64) / (count as f64).sqrt();
        let at = |k: usize| curves.iter().map(|curve| curve[k]).collect::<Vec<_>>();
        (0..mean.len()).map(|k| t * standard_deviation(&at(k)).unwrap_or(0.0)).collect()
    });
    Some(SetCurve { count, mean, half_width_95 })
}

fn mean_curve(curves: &[Vec<f64>]) -> Option<Vec<f64>> {
    let points = curves.first()?.len();
    let at = |k: usize| curves.iter().map(|curve| curve[k]).sum::<f64>() / curves.len() as f64;
    Some((0..points).map(at).collect())
}

/// Largest |a - b| and its place.
fn largest_difference(a: &[f64], b: &[f64], grid: &[f64]) -> Option<(f64, f64)> {
    let differences = a.iter().zip(b).map(|(a, b)| (a - b).abs()).zip(grid.iter().copied());
    differences.max_by(|one, other| one.0.total_cmp(&other.0))
}

/// Mean distance of two runs of the same side.
fn distance_within(sides: [&[Vec<f64>]; 2]) -> Option<f64> {
    let mut distances = Vec::new();
    for side in sides {
        for (k, a) in side.iter().enumerate() {
            distances.extend(side[..k].iter().map(|b| a.iter().zip(b).fold(0.0_f64, |l, (a, b)| l.max((a - b).abs()))));
        }
    }
    mean(&distances)
}

/// Curves whose distance is the largest difference of their means.
fn plain_curves(
    name: &str,
    axes: [Axis; 2],
    grid: Vec<f64>,
    values: [Vec<Vec<f64>>; 2],
    note: Option<String>,
) -> Curves {
    let means = [mean_curve(&values[0]), mean_curve(&values[1])];
    let difference = match &means {
        [Some(a), Some(b)] => largest_difference(a, b, &grid),
        _ => None,
    };
    let deviations = [0, 1].map(|side| {
        let Some(mean) = &means[side] else { return Vec::new() };
        values[side].iter().map(|curve| curve.iter().zip(mean).map(|(v, m)| v - m).collect()).collect()
    });
    let range = |curve: &Vec<f64>| {
        let [low, high] = extent(curve.iter().copied());
        high - low
    };
    let [x, y] = axes;
    Curves {
        name: name.to_owned(),
        kind: Kind::Curve,
        x,
        y,
        grid,
        bin_edges: Vec::new(),
        measured: Measured {
            distance: Distance::LargestDifference,
            difference,
            deviations,
            within: distance_within([&values[0], &values[1]]),
            scale: means[1].as_ref().map_or(f64::NAN, range),
        },
        values,
        note,
    }
}

fn extent(values: impl Iterator<Item = f64>) -> [f64; 2] {
    values.fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], value| [low.min(value), high.max(value)])
}

/// Places from the lower to the upper end of a range.
fn even_grid([low, high]: [f64; 2], points: usize) -> Vec<f64> {
    let last = (points - 1) as f64;
    (0..points).map(|k| if k + 1 == points { high } else { low + (high - low) * k as f64 / last }).collect()
}

/// Mass passed over time, from the passages (time [s], mass [kg]) of every run, in order of time.
pub(super) fn discharge_curves(name: &str, passages: [Vec<Vec<(f64, f64)>>; 2]) -> Curves {
    let axes = [Axis::new("time", "s"), Axis::new("mass passed", "kg")];
    let range = extent(passages.iter().flatten().flatten().map(|(time, _)| *time));
    if range[0] > range[1] {
        let note = Some("nothing has passed in any run".to_owned());
        return plain_curves(name, axes, Vec::new(), [Vec::new(), Vec::new()], note);
    }
    let grid = even_grid(range, POINTS);
    let cumulated = |run: &Vec<(f64, f64)>| {
        let mut pending = run.iter().peekable();
        let mut passed = 0.0;
        let at = |time: &f64| {
            while let Some((_, mass)) = pending.next_if(|(t, _)| t <= time) {
                passed += mass;
            }
            passed
        };
        grid.iter().map(at).collect::<Vec<f64>>()
    };
    let values = [0, 1].map(|side: usize| passages[side].iter().map(cumulated).collect());
    plain_curves(name, axes, grid.clone(), values, None)
}

/// Heights of a heap's surface where all runs have one, from their surfaces (place, height) [m] in order of place.
pub(super) fn surface_curves(name: &str, surfaces: [Vec<Vec<[f64; 2]>>; 2]) -> Curves {
    let axes = [Axis::new("place", "m"), Axis::new("height", "m")];
    let all = || surfaces.iter().flatten().filter(|surface| !surface.is_empty());
    let ends = |surface: &Vec<[f64; 2]>| [surface[0][0], surface[surface.len() - 1][0]];
    let common =
        all().map(ends).fold([f64::NEG_INFINITY, f64::INFINITY], |[low, high], [a, b]| [low.max(a), high.min(b)]);
    let widest = extent(all().flat_map(ends));
    if common[0] >= common[1] || all().next().is_none() {
        let note = Some("the surfaces have no place in common".to_owned());
        return plain_curves(name, axes, Vec::new(), [Vec::new(), Vec::new()], note);
    }
    let grid = even_grid(common, POINTS);
    let heights =
        |surface: &Vec<[f64; 2]>| grid.iter().map(|place| interpolated(surface, *place)).collect::<Vec<f64>>();
    let values = [0, 1].map(|side: usize| surfaces[side].iter().filter(|s| !s.is_empty()).map(heights).collect());
    let share = (common[1] - common[0]) / (widest[1] - widest[0]);
    let note =
        (share < 0.9).then(|| format!("only {:.0} % of the widest surface is common to all runs", 100.0 * share));
    plain_curves(name, axes, grid.clone(), values, note)
}

/// Height at `place` on straight lines between the points of a surface.
fn interpolated(surface: &[[f64; 2]], place: f64) -> f64 {
    let above = surface.partition_point(|point| point[0] < place).clamp(1, surface.len() - 1);
    let ([x0, y0], [x1, y1]) = (surface[above - 1], surface[above]);
    if x1 > x0 { y0 + (y1 - y0) * (place - x0) / (x1 - x0) } else { 0.5 * (y0 + y1) }
}

/// Distributions of samples, one list a run: histograms to look at, Kolmogorov-Smirnov distance of all samples of a side
/// together to judge by.
///
/// Samples of one run are not independent, so the noise of the distance comes from the distribution functions F_i of single
/// runs: the function of a side is their mean weighted by numbers of samples n_i, and n n_i / sum n_i (F_i - F) is what run i
/// of n contributes to its error.
pub(super) fn distribution_curves(name: &str, label: &str, unit: &str, mut samples: [Vec<Vec<f64>>; 2]) -> Curves {
    for side in &mut samples {
        side.iter_mut().for_each(|run| run.retain(|value| value.is_finite()));
        side.retain(|run| !run.is_empty());
        side.iter_mut().for_each(|run| run.sort_by(f64::total_cmp));
    }
    let pooled = [0, 1].map(|side: usize| sorted(samples[side].iter().flatten().copied().collect()));
    let together = sorted(pooled.iter().flatten().copied().collect());
    let places: Vec<f64> =
        (0..QUANTILES).filter_map(|k| quantile_of_sorted(&together, k as f64 / (QUANTILES - 1) as f64)).collect();
    let functions = [0, 1].map(|side: usize| {
        samples[side].iter().map(|run| places.iter().map(|x| share_up_to(run, *x)).collect()).collect::<Vec<Vec<f64>>>()
    });
    let deviations = [0, 1].map(|side| weighted_deviations(&samples[side], &functions[side]));
    let edges = bin_edges(&together);
    let shares = |run: &Vec<f64>| {
        let shares = edges.windows(2).enumerate().map(|(k, edge)| {
            let upper = if k + 2 == edges.len() { run.len() } else { run.partition_point(|v| *v < edge[1]) };
            (upper - run.partition_point(|v| *v < edge[0])) as f64 / run.len() as f64
        });
        shares.collect::<Vec<f64>>()
    };
    let distance = kolmogorov_smirnov(&pooled[0], &pooled[1]);
    let difference = distance.map(|distance| {
        let by_place =
            [0, 1].map(|side: usize| places.iter().map(|x| share_up_to(&pooled[side], *x)).collect::<Vec<_>>());
        let at = largest_difference(&by_place[0], &by_place[1], &places).map_or(f64::NAN, |(_, at)| at);
        (distance, at)
    });
    Curves {
        name: name.to_owned(),
        kind: Kind::Distribution,
        x: Axis::new(label, unit),
        y: Axis::new("share of particles", ""),
        grid: edges.windows(2).map(|edge| 0.5 * (edge[0] + edge[1])).collect(),
        values: [0, 1].map(|side: usize| samples[side].iter().map(shares).collect()),
        bin_edges: edges.clone(),
        measured: Measured {
            distance: Distance::KolmogorovSmirnov,
            difference,
            deviations,
            within: distance_within([&functions[0], &functions[1]]),
            scale: 1.0,
        },
        note: together.is_empty().then(|| "no run has a sample".to_owned()),
    }
}

fn sorted(mut values: Vec<f64>) -> Vec<f64> {
    values.sort_by(f64::total_cmp);
    values
}

fn share_up_to(sorted: &[f64], x: f64) -> f64 {
    sorted.partition_point(|value| *value <= x) as f64 / sorted.len() as f64
}

fn weighted_deviations(samples: &[Vec<f64>], functions: &[Vec<f64>]) -> Vec<Vec<f64>> {
    let total: usize = samples.iter().map(Vec::len).sum();
    let weights: Vec<f64> = samples.iter().map(|run| run.len() as f64 / total as f64).collect();
    let points = functions.first().map_or(0, Vec::len);
    let mean: Vec<f64> = (0..points).map(|k| weights.iter().zip(functions).map(|(w, f)| w * f[k]).sum()).collect();
    let scaled = |(weight, function): (&f64, &Vec<f64>)| {
        let scale = weight * samples.len() as f64;
        function.iter().zip(&mean).map(|(f, m)| scale * (f - m)).collect()
    };
    weights.iter().zip(functions).map(scaled).collect()
}

/// Edges of equal bins over all samples; width 2 IQR n^(-1/3) (Freedman and Diaconis 1981), 5 to 40 bins.
fn bin_edges(sorted: &[f64]) -> Vec<f64> {
    let (Some(low), Some(high)) = (sorted.first().copied(), sorted.last().copied()) else { return Vec::new() };
    if low == high {
        let half = if low == 0.0 { 0.5 } else { 0.05 * low.abs() };
        return vec![low - half, high + half];
    }
    let at = |share| quantile_of_sorted(sorted, share).unwrap_or(low);
    let width = 2.0 * (at(0.75) - at(0.25)) / (sorted.len() as f64).cbrt();
    let bins = if width > 0.0 { ((high - low) / width).ceil() as usize } else { BINS[1] };
    even_grid([low, high], bins.clamp(BINS[0], BINS[1]) + 1)
}

#[cfg(test)]
mod tests {
    use super::*;
    use approx::assert_relative_eq;

    #[test]
    fn a_discharge_counts_what_has_passed() {
        let run = |delay: f64| (1..=100).map(|k| (f64::from(k) * 0.01 + delay, 0.5)).collect::<Vec<_>>();
        let curves = discharge_curves("gate.a.discharge", [vec![run(0.1), run(0.1)], vec![run(0.0), run(0.0)]]);
        let found = curves.compare(&Margins::default());
        assert_eq!((found.grid.len(), found.grid[0], found.grid[POINTS - 1]), (POINTS, 0.01, 1.1));
        let last = |set: &Option<SetCurve>| *set.as_ref().unwrap().mean.last().unwrap();
        assert_eq!((last(&found.runs), last(&found.reference)), (50.0, 50.0));
        // A delay of 0.1 s at 50 kg/s, to a particle.
        assert_relative_eq!(found.difference.unwrap(), 5.0, epsilon = 0.5);
        assert_eq!(found.interval_95.unwrap()[0], found.difference.unwrap(), "nothing scatters");
        assert_eq!(found.verdict, Verdict::Differs, "5 of 50 kg are more than 5 %");
        assert_relative_eq!(found.margin.unwrap(), 0.05 * 49.5, epsilon = 1e-9);
    }

    #[test]
    fn surfaces_are_compared_where_all_have_one() {
        let flank = |from: f64, to: f64, lift: f64| vec![[from, 1.0 - from + lift], [to, 1.0 - to + lift]];
        let curves = surface_curves(
            "heap.surface",
            [vec![flank(0.0, 0.8, 0.01), flank(0.1, 0.9, 0.03)], vec![flank(0.0, 1.0, 0.0), flank(0.0, 0.9, 0.0)]],
        );
        let found = curves.compare(&Margins::default());
        assert_eq!([found.grid[0], found.grid[POINTS - 1]], [0.1, 0.8]);
        assert_relative_eq!(found.difference.unwrap(), 0.02, epsilon = 1e-12);
        assert!(found.note.contains("only 70 %"), "{}", found.note);
        let apart = surface_curves("heap.surface", [vec![flank(0.0, 0.4, 0.0)], vec![flank(0.5, 1.0, 0.0)]]);
        let found = apart.compare(&Margins::default());
        assert_eq!((found.difference, found.verdict), (None, Verdict::Inconclusive));
        assert!(found.note.contains("no place in common"));
    }

    #[test]
    fn distributions_are_pooled_and_binned_alike() {
        let ramp =
            |shift: f64, count: u32| (0..count).map(|k| shift + f64::from(k) / f64::from(count)).collect::<Vec<_>>();
        let samples = [vec![ramp(0.2, 300), ramp(0.2, 100)], vec![ramp(0.0, 200), ramp(0.0, 200)]];
        let found = distribution_curves("sizes", "diameter", "m", samples).compare(&Margins::default());
        // Uniform on [0.2, 1.2] against [0, 1]: the functions are 0.2 apart, to one sample.
        assert_relative_eq!(found.difference.unwrap(), 0.2, epsilon = 0.01);
        assert_eq!(found.bin_edges.len(), found.grid.len() + 1);
        for set in [&found.runs, &found.reference] {
            assert_relative_eq!(set.as_ref().unwrap().mean.iter().sum::<f64>(), 1.0, max_relative = 1e-12);
        }
        assert_eq!(found.verdict, Verdict::Differs);
        assert!(found.distance_within.unwrap() < 0.02);
    }

    #[test]
    fn one_size_is_one_bin() {
        let samples = [vec![vec![0.01; 5]], vec![vec![0.01; 7]]];
        let found = distribution_curves("sizes", "diameter", "m", samples).compare(&Margins::default());
        assert_eq!((found.grid.len(), found.difference), (1, Some(0.0)));
        assert_eq!(found.verdict, Verdict::Inconclusive, "one run a side says nothing of the scatter");
    }
}
