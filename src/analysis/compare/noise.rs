//! How far the largest difference of two mean curves may come from the scatter of single runs alone.

use crate::analysis::statistics::quantile_of_sorted;
use crate::analysis::statistics::two_samples::{CONFIDENCE, Scatter, welch_scatter};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

/// Curves drawn; their 95 % quantile has a standard error of about 1.5 % of itself.
const DRAWS: usize = 1999;
const SEED: u64 = 0x0062_616e_6473;
/// Degrees of freedom above which Student's t is taken as normal.
const MANY_DEGREES: f64 = 500.0;

/// Noise of a largest difference.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Noise {
    /// The largest difference that noise alone stays below in 95 of 100 cases.
    pub reach: f64,
    /// Scatter of a typical point of the curves.
    pub scatter: Scatter,
}

/// Noise of max |mean curve of one side - mean curve of the other|, from the deviations of single runs from their side's
/// mean curve, all at the same points.
///
/// Simultaneous 95 % band by the multiplier bootstrap: the deviations e_i of a side with n runs, times independent normal
/// numbers, summed and divided by sqrt(n (n - 1)), have the very covariance that the mean curve is estimated to have; the sum
/// over both sides divided by sqrt(chi^2_f / f) has the tails of Student's t with Welch's degrees of freedom f (of variances
/// averaged over the curve). The 95 % quantile of its largest magnitude is the reach (van der Vaart and Wellner 1996, 2.9;
/// Montiel Olea and Plagborg-Moller 2019). For curves of one point this is Welch's interval. A side with one run takes the
/// deviations of the other. `None` where both have one.
pub(super) fn noise(deviations: [&[Vec<f64>]; 2]) -> Option<Noise> {
    let counts = deviations.map(<[Vec<f64>]>::len);
    let points = deviations[0].first().or(deviations[1].first())?.len();
    let variance = |side: &[Vec<f64>]| {
        let squares: f64 = side.iter().flatten().map(|e| e * e).sum();
        (side.len() > 1).then(|| squares / ((side.len() - 1) * points.max(1)) as f64)
    };
    let scatter = welch_scatter(deviations.map(variance), counts)?;
    if scatter.standard_error == 0.0 {
        return Some(Noise { reach: 0.0, scatter });
    }
    let mut random = Normal::new(SEED);
    let mut largest = Vec::with_capacity(DRAWS);
    let mut curve = vec![0.0; points];
    for _ in 0..DRAWS {
        curve.fill(0.0);
        for side in 0..2 {
            let pool = if counts[side] > 1 { deviations[side] } else { deviations[1 - side] };
            let scale = 1.0 / (counts[side] as f64 * (pool.len() - 1) as f64).sqrt();
            for deviation in pool {
                let factor = scale * random.draw();
                curve.iter_mut().zip(deviation).for_each(|(sum, e)| *sum += factor * e);
            }
        }
        let shrink = random.root_mean_square(scatter.degrees_of_freedom);
        largest.push(curve.iter().fold(0.0_f64, |l, v| l.max(v.abs())) / shrink);
    }
    largest.sort_by(f64::total_cmp);
    Some(Noise { reach: quantile_of_sorted(&largest, CONFIDENCE)?, scatter })
}

/// Normal numbers (Box and Muller 1958).
struct Normal {
    random: ChaCha8Rng,
    spare: Option<f64>,
}

impl Normal {
    fn new(seed: u64) -> Self {
        Self { random: ChaCha8Rng::seed_from_u64(seed), spare: None }
    }

    fn draw(&mut self) -> f64 {
        if let Some(spare) = self.spare.take() {
            return spare;
        }
        // 1 - u lies in (0, 1], where the logarithm is finite.
        let radius = (-2.0 * (1.0 - self.random.random::<f64>()).ln()).sqrt();
        let (sine, cosine) = (std::f64::consts::TAU * self.random.random::<f64>()).sin_cos();
        self.spare = Some(radius * sine);
        radius * cosine
    }

    /// sqrt(chi^2_f / f), f rounded down to a whole number, which widens the tails a little.
    fn root_mean_square(&mut self, degrees: f64) -> f64 {
        if degrees > MANY_DEGREES {
            return 1.0;
        }
        let count = degrees.floor().max(1.0) as usize;
        let sum: f64 = (0..count).map(|_| self.draw().powi(2)).sum();
        (sum / count as f64).sqrt()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::analysis::statistics::two_samples::difference_of_means;
    use approx::assert_relative_eq;

    fn deviations(values: &[f64]) -> Vec<Vec<f64>> {
        let mean = values.iter().sum::<f64>() / values.len() as f64;
        values.iter().map(|v| vec![v - mean]).collect()
    }

    #[test]
    fn a_curve_of_one_point_has_the_interval_of_a_number() {
        let (a, b) = ([1.0, 2.0, 4.0, 3.0, 2.5], [1.5, 2.5, 2.0, 2.2, 2.8]);
        let expected = difference_of_means(&a, &b).unwrap().1.unwrap();
        let found = noise([&deviations(&a), &deviations(&b)]).unwrap();
        assert_relative_eq!(found.scatter.standard_error, expected.standard_error, max_relative = 1e-12);
        assert_relative_eq!(found.scatter.degrees_of_freedom, expected.degrees_of_freedom, max_relative = 1e-12);
        // The drawn quantile scatters by 1.5 % (4 sigma here), and degrees of freedom are rounded down (6.4 to 6: 1.5 %).
        assert_relative_eq!(found.reach, expected.half_width(), max_relative = 0.075);
    }

    #[test]
    fn one_run_takes_the_scatter_of_the_other_side() {
        let b = [1.5, 2.5, 2.0, 2.2, 2.8];
        let expected = difference_of_means(&[7.0], &b).unwrap().1.unwrap();
        let found = noise([&[vec![0.0]], &deviations(&b)]).unwrap();
        assert_relative_eq!(found.reach, expected.half_width(), max_relative = 0.06);
        assert_eq!(noise([&[vec![0.0]], &[vec![0.0]]]), None);
    }

    #[test]
    fn the_band_holds_whole_curves_in_95_of_100_cases() {
        // Curves of 12 independent normal points, 10 + 10 runs, whose true difference is zero.
        let mut random = Normal::new(5);
        let draws = 400;
        let inside = (0..draws)
            .filter(|_| {
                let mut side = || {
                    let runs: Vec<Vec<f64>> = (0..10).map(|_| (0..12).map(|_| random.draw()).collect()).collect();
                    let mean: Vec<f64> = (0..12).map(|k| runs.iter().map(|r| r[k]).sum::<f64>() / 10.0).collect();
                    let deviations: Vec<Vec<f64>> =
                        runs.iter().map(|run| run.iter().zip(&mean).map(|(v, m)| v - m).collect()).collect();
                    (mean, deviations)
                };
                let ((a, first), (b, second)) = (side(), side());
                let largest = a.iter().zip(&b).fold(0.0_f64, |l, (a, b)| l.max((a - b).abs()));
                largest <= noise([&first, &second]).unwrap().reach
            })
            .count();
        // 95 % of 400 with a binomial deviation of 1.1 %, three of them below; above it may be as safe as it likes.
        let share = inside as f64 / draws as f64;
        assert!(share > 0.95 - 3.0 * (0.95_f64 * 0.05 / draws as f64).sqrt(), "{share}");
    }
}
