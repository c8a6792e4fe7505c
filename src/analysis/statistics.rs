//! The few statistics that the measures share: order statistics, a robust line, resampling of correlated series.

pub mod student;
pub mod two_samples;

use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

/// Straight line y = `intercept` + `slope` x.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Line {
    /// Value at x = 0, in the unit of y.
    pub intercept: f64,
    /// Change of y with x.
    pub slope: f64,
}

impl Line {
    /// Value at `x`.
    #[must_use]
    pub fn at(&self, x: f64) -> f64 {
        self.intercept + self.slope * x
    }
}

/// Arithmetic mean; `None` for no values.
#[must_use]
pub fn mean(values: &[f64]) -> Option<f64> {
    (!values.is_empty()).then(|| values.iter().sum::<f64>() / values.len() as f64)
}

/// Standard deviation s = sqrt(sum (x - mean)^2 / (n - 1)); `None` for fewer than two values.
#[must_use]
pub fn standard_deviation(values: &[f64]) -> Option<f64> {
    let centre = mean(values).filter(|_| values.len() > 1)?;
    let squares = values.iter().map(|x| (x - centre).powi(2)).sum::<f64>();
    Some((squares / (values.len() - 1) as f64).sqrt())
}

/// Median (mean of the two middle values of an even number); `None` for no values.
#[must_use]
pub fn median(values: &[f64]) -> Option<f64> {
    if values.is_empty() {
        return None;
    }
    let mut scratch = values.to_vec();
    Some(median_in_place(&mut scratch))
}

/// The quantile `share` (0..=1) of ascending values, linear between order statistics (Hyndman and Fan 1996, type 7).
#[must_use]
pub fn quantile_of_sorted(sorted: &[f64], share: f64) -> Option<f64> {
    let last = sorted.len().checked_sub(1)?;
    let place = share.clamp(0.0, 1.0) * last as f64;
    let below = place.floor() as usize;
    let above = (below + 1).min(last);
    Some(sorted[below] + (place - below as f64) * (sorted[above] - sorted[below]))
}

/// Scale of scattered values that outliers do not move: 1.4826 times the median absolute deviation from their median,
/// which is the standard deviation of normal values (Rousseeuw and Croux 1993). `None` for no values.
#[must_use]
pub fn robust_deviation(values: &[f64]) -> Option<f64> {
    let centre = median(values)?;
    let distances: Vec<f64> = values.iter().map(|x| (x - centre).abs()).collect();
    median(&distances).map(|m| 1.4826 * m)
}

/// Theil-Sen line: slope = median of (y_j - y_i) / (x_j - x_i) over all pairs with x_i != x_j, intercept = median of
/// y - slope x.
///
/// Unmoved by up to 29 % of arbitrary outliers, 95 % as efficient as least squares for normal scatter.
/// Source: Theil (1950); Sen (1968), doi 10.1080/01621459.1968.10480934. Cost: n^2 / 2 slopes, so n <= about 1000.
/// `None` where all x are the same.
#[must_use]
pub fn theil_sen(x: &[f64], y: &[f64]) -> Option<Line> {
    let mut slopes = Vec::with_capacity(x.len() * x.len().saturating_sub(1) / 2);
    for j in 1..x.len() {
        for i in 0..j {
            let run = x[j] - x[i];
            if run != 0.0 {
                slopes.push((y[j] - y[i]) / run);
            }
        }
    }
    if slopes.is_empty() {
        return None;
    }
    let slope = median_in_place(&mut slopes);
    let offsets: Vec<f64> = x.iter().zip(y).map(|(x, y)| y - slope * x).collect();
    median(&offsets).map(|intercept| Line { intercept, slope })
}

/// Integrated autocorrelation time, in samples: tau = 1/2 + sum of the autocorrelation over lags 1..M, M the first lag
/// with M >= 5 tau (automatic window of Sokal 1997). Independent values give 1/2; never less is returned.
#[must_use]
pub fn autocorrelation_time(values: &[f64]) -> f64 {
    let Some(centre) = mean(values) else { return 0.5 };
    let deviations: Vec<f64> = values.iter().map(|x| x - centre).collect();
    let variance: f64 = deviations.iter().map(|d| d * d).sum();
    if variance <= 0.0 {
        return 0.5;
    }
    let mut tau = 0.5;
    for lag in 1..values.len() / 2 {
        tau += deviations.iter().zip(&deviations[lag..]).map(|(a, b)| a * b).sum::<f64>() / variance;
        if lag as f64 >= 5.0 * tau {
            break;
        }
    }
    tau.max(0.5)
}

/// Block length for resampling `values`: n^(1/3) as Künsch (1989) recommends, or twice the autocorrelation time where
/// that is longer, and at most a third of the series.
#[must_use]
pub fn block_length(values: &[f64]) -> usize {
    let count = values.len();
    let by_count = (count as f64).cbrt().ceil();
    let by_memory = (2.0 * autocorrelation_time(values)).ceil();
    (by_count.max(by_memory) as usize).clamp(1, (count / 3).max(1))
}

/// Resampler of positions 0..count in moving blocks (Künsch 1989): keeps the correlation of neighbours within a block.
/// The seed is fixed, so a measure has the same uncertainty every time.
#[derive(Debug, Clone)]
pub struct BlockBootstrap {
    random: ChaCha8Rng,
    count: usize,
    block: usize,
}

impl BlockBootstrap {
    /// Resamples `count` positions in blocks of `block`.
    ///
    /// # Panics
    /// When `block` is 0 or longer than `count`.
    #[must_use]
    pub fn new(count: usize, block: usize, seed: u64) -> Self {
        assert!((1..=count).contains(&block), "a block holds 1 to {count} positions, not {block}");
        Self { random: ChaCha8Rng::seed_from_u64(seed), count, block }
    }

    /// One resample of `count` positions.
    pub fn draw(&mut self) -> Vec<usize> {
        let mut positions = Vec::with_capacity(self.count + self.block);
        while positions.len() < self.count {
            let start = self.random.random_range(0..=self.count - self.block);
            positions.extend(start..start + self.block);
        }
        positions.truncate(self.count);
        positions
    }
}

fn median_in_place(values: &mut [f64]) -> f64 {
    let middle = values.len() / 2;
    let even = values.len().is_multiple_of(2);
    let (below, upper, _) = values.select_nth_unstable_by(middle, f64::total_cmp);
    if even { 0.5 * (below.iter().copied().fold(f64::NEG_INFINITY, f64::max) + *upper) } else { *upper }
}

#[cfg(test)]
mod tests {
    use super::*;
    use approx::assert_relative_eq;
    use proptest::prelude::*;

    #[test]
    fn medians_of_odd_and_even_numbers() {
        assert_eq!(median(&[3.0, 1.0, 2.0]), Some(2.0));
        assert_eq!(median(&[4.0, 1.0, 3.0, 2.0]), Some(2.5));
        assert_eq!(median(&[7.0]), Some(7.0));
        assert_eq!(median(&[]), None);
    }

    #[test]
    fn quantiles_lie_between_order_statistics() {
        let sorted = [1.0, 2.0, 4.0];
        assert_eq!(quantile_of_sorted(&sorted, 0.0), Some(1.0));
        assert_eq!(quantile_of_sorted(&sorted, 0.75), Some(3.0));
        assert_eq!(quantile_of_sorted(&sorted, 1.0), Some(4.0));
    }

    #[test]
    fn robust_deviation_of_normal_quantiles_is_their_deviation() {
        // Half of a normal sample lies within 0.6745 sigma: uniform values on [-1, 1] have their median distance at 0.5.
        let uniform: Vec<f64> = (-1000..=1000).map(|k| f64::from(k) / 1000.0).collect();
        assert_relative_eq!(robust_deviation(&uniform).unwrap(), 1.4826 * 0.5, max_relative = 1e-3);
    }

    #[test]
    fn line_ignores_a_quarter_of_outliers() {
        let x: Vec<f64> = (0..40).map(f64::from).collect();
        let y: Vec<f64> = x.iter().map(|x| if *x as usize % 4 == 1 { 1e6 } else { 3.0 - 0.5 * x }).collect();
        let line = theil_sen(&x, &y).unwrap();
        assert_relative_eq!(line.slope, -0.5, epsilon = 1e-12);
        assert_relative_eq!(line.intercept, 3.0, epsilon = 1e-9);
    }

    #[test]
    fn memory_of_an_autoregressive_series_is_found() {
        // AR(1) with coefficient a: tau = 1/2 + a / (1 - a). n = 2e5 leaves about sqrt(2 (2M + 1) / n) = 3 % of scatter.
        let mut random = ChaCha8Rng::seed_from_u64(1);
        let coefficient = 0.8;
        let mut state = 0.0;
        let series: Vec<f64> = (0..200_000)
            .map(|_| {
                state = coefficient * state + random.random_range(-1.0..1.0);
                state
            })
            .collect();
        let expected = 0.5 + coefficient / (1.0 - coefficient);
        assert_relative_eq!(autocorrelation_time(&series), expected, max_relative = 0.1);
        assert_eq!(autocorrelation_time(&[2.0; 50]), 0.5);
    }

    proptest! {
        #[test]
        fn a_draw_is_made_of_whole_blocks(count in 1usize..60, block in 1usize..60, seed in any::<u64>()) {
            let block = block.min(count);
            let drawn = BlockBootstrap::new(count, block, seed).draw();
            prop_assert_eq!(drawn.len(), count);
            for chunk in drawn.chunks(block) {
                prop_assert!(chunk.windows(2).all(|w| w[1] == w[0] + 1));
                prop_assert!(chunk.iter().all(|p| *p < count));
            }
        }

        #[test]
        fn median_is_the_middle_of_the_sorted_values(mut values in prop::collection::vec(-1e3..1e3f64, 1..40)) {
            let found = median(&values).unwrap();
            values.sort_by(f64::total_cmp);
            let expected = 0.5 * (values[(values.len() - 1) / 2] + values[values.len() / 2]);
            prop_assert_eq!(found, expected);
        }
    }
}
