//! Two samples against each other: difference of their means, distance of their distributions.

use super::student::student_quantile;
use super::{mean, standard_deviation};

/// Probability that an interval holds the true value [-].
pub const CONFIDENCE: f64 = 0.95;
/// More values a side than this are not counted.
const MOST_NEEDED: u64 = 100_000;

/// How far a difference of means scatters.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Scatter {
    /// Standard error of the difference, in the values' unit.
    pub standard_error: f64,
    /// Degrees of freedom of that [-]; infinite where nothing scatters.
    pub degrees_of_freedom: f64,
    /// Variance of single values on each side, in the unit squared.
    pub variances: [f64; 2],
}

impl Scatter {
    /// Half of the width of the 95 % interval, t s.
    #[must_use]
    pub fn half_width(&self) -> f64 {
        if self.standard_error == 0.0 {
            return 0.0;
        }
        student_quantile(0.5 * (1.0 + CONFIDENCE), self.degrees_of_freedom) * self.standard_error
    }
}

/// Scatter of the difference of two means, from the variances of single values v_k, the numbers of values n_k, and on how
/// many degrees of freedom each variance stands.
///
/// s^2 = v_1 / n_1 + v_2 / n_2, degrees of freedom s^4 / sum (v_k / n_k)^2 / f_k, f_k = n_k - 1 (Satterthwaite 1946; Welch 1947).
/// A side with one value has no variance: it takes that of the other side, on whose degrees of freedom all stands then.
/// `None` where both have one.
/// Valid: normal values, five or more on the smaller side. With fewer on one side only, intervals come out too narrow: of equal
/// variances, the true difference lies in 93 % of those from 3 and 12 values and in 90 % of those from 2 and 10 (simulated);
/// two and two give 98 %.
#[must_use]
pub fn welch_scatter(variances: [Option<f64>; 2], counts: [usize; 2]) -> Option<Scatter> {
    let [first, second] = variances;
    let known = [first.or(second)?, second.or(first)?];
    let parts = [known[0] / counts[0] as f64, known[1] / counts[1] as f64];
    let square = parts[0] + parts[1];
    let degrees_of_freedom = match variances {
        [Some(_), Some(_)] => {
            let sum: f64 = (0..2).map(|k| parts[k].powi(2) / (counts[k] as f64 - 1.0)).sum();
            if sum == 0.0 { f64::INFINITY } else { square * square / sum }
        }
        _ => (counts[0].max(counts[1]) - 1) as f64,
    };
    Some(Scatter { standard_error: square.sqrt(), degrees_of_freedom, variances: known })
}

/// Difference of the means of two samples, mean(a) - mean(b), with its scatter (see [`welch_scatter`]).
///
/// `None` where one has no value. Valid: values that are independent and not far from normal.
#[must_use]
pub fn difference_of_means(a: &[f64], b: &[f64]) -> Option<(f64, Option<Scatter>)> {
    let difference = mean(a)? - mean(b)?;
    let variances = [a, b].map(|values| standard_deviation(values).map(|s| s * s));
    Some((difference, welch_scatter(variances, [a.len(), b.len()])))
}

/// How many values each side must have for the 95 % interval of a difference to reach no farther than `reach`, if single
/// values go on scattering with `variances`: the smallest n with t sqrt((v_1 + v_2) / n) <= reach, n >= 2.
///
/// `None` where 100 000 are not enough.
#[must_use]
pub fn values_needed(variances: [f64; 2], reach: f64) -> Option<u64> {
    let enough = |count: u64| {
        let scatter = welch_scatter(variances.map(Some), [count as usize; 2]);
        scatter.is_some_and(|scatter| scatter.half_width() <= reach)
    };
    let mut high = 2;
    while !enough(high) {
        high *= 2;
        if high > MOST_NEEDED {
            return None;
        }
    }
    let mut low = if high == 2 { 1 } else { high / 2 };
    while high - low > 1 {
        let middle = low.midpoint(high);
        if enough(middle) { high = middle } else { low = middle }
    }
    Some(high)
}

/// Distance of two distributions, D = max |F_a(x) - F_b(x)| over all x, from ascending samples (Smirnov 1948)   [-]
///
/// F_a, F_b shares of the samples that are at most x. `None` where one has no value.
#[must_use]
pub fn kolmogorov_smirnov(a: &[f64], b: &[f64]) -> Option<f64> {
    if a.is_empty() || b.is_empty() {
        return None;
    }
    let (mut i, mut j, mut largest) = (0, 0, 0.0_f64);
    while i < a.len() && j < b.len() {
        let value = a[i].min(b[j]);
        // All equal values are passed before the shares are compared: between them there is no x.
        while i < a.len() && a[i] <= value {
            i += 1;
        }
        while j < b.len() && b[j] <= value {
            j += 1;
        }
        largest = largest.max((i as f64 / a.len() as f64 - j as f64 / b.len() as f64).abs());
    }
    Some(largest)
}

#[cfg(test)]
mod tests {
    use super::*;
    use approx::assert_relative_eq;
    use proptest::prelude::*;

    #[test]
    fn equal_variances_and_numbers_have_pooled_degrees() {
        let a = [1.0, 2.0, 3.0];
        let b = [11.0, 12.0, 13.0];
        let (difference, scatter) = difference_of_means(&a, &b).unwrap();
        let scatter = scatter.unwrap();
        assert_eq!(difference, -10.0);
        assert_relative_eq!(scatter.degrees_of_freedom, 4.0, max_relative = 1e-12);
        assert_relative_eq!(scatter.standard_error, (2.0_f64 / 3.0).sqrt(), max_relative = 1e-12);
        let expected = student_quantile(0.975, 4.0) * (2.0_f64 / 3.0).sqrt();
        assert_relative_eq!(scatter.half_width(), expected, max_relative = 1e-12);
    }

    #[test]
    fn a_side_that_does_not_scatter_leaves_the_degrees_of_the_other() {
        let scatter = difference_of_means(&[5.0; 7], &[1.0, 2.0, 4.0]).unwrap().1.unwrap();
        assert_relative_eq!(scatter.degrees_of_freedom, 2.0, max_relative = 1e-12);
        let still = difference_of_means(&[5.0; 7], &[4.0; 3]).unwrap().1.unwrap();
        assert_eq!((still.standard_error, still.half_width()), (0.0, 0.0));
    }

    #[test]
    fn one_value_takes_the_scatter_of_the_other_side() {
        let (difference, scatter) = difference_of_means(&[4.0], &[1.0, 2.0, 3.0]).unwrap();
        let scatter = scatter.unwrap();
        assert_eq!(difference, 2.0);
        // A new value against a mean of three: s^2 (1 + 1/3), s^2 = 1 on 2 degrees.
        assert_relative_eq!(scatter.standard_error, (4.0_f64 / 3.0).sqrt(), max_relative = 1e-12);
        assert_eq!(scatter.degrees_of_freedom, 2.0);
        assert_eq!(difference_of_means(&[4.0], &[1.0]), Some((3.0, None)));
        assert_eq!(difference_of_means(&[], &[1.0]), None);
    }

    #[test]
    fn distance_of_shifted_samples() {
        let a: Vec<f64> = (0..10).map(f64::from).collect();
        let b: Vec<f64> = (3..13).map(f64::from).collect();
        assert_relative_eq!(kolmogorov_smirnov(&a, &b).unwrap(), 0.3, max_relative = 1e-12);
        assert_eq!(kolmogorov_smirnov(&a, &a), Some(0.0));
        assert_eq!(kolmogorov_smirnov(&[1.0; 5], &[1.0; 9]), Some(0.0), "ties are no distance");
        assert_eq!(kolmogorov_smirnov(&[1.0], &[2.0]), Some(1.0));
        assert_eq!(kolmogorov_smirnov(&[], &[2.0]), None);
    }

    proptest! {
        #[test]
        fn needed_values_are_just_enough(v in [1e-3..10.0f64, 1e-3..10.0f64], reach in 0.05..5.0f64) {
            let needed = values_needed(v, reach).unwrap();
            let width = |n: u64| welch_scatter(v.map(Some), [n as usize; 2]).unwrap().half_width();
            prop_assert!(width(needed) <= reach);
            prop_assert!(needed == 2 || width(needed - 1) > reach);
        }

        #[test]
        fn the_distance_is_the_largest_at_any_value(mut a in prop::collection::vec(0i32..20, 1..30), mut b in prop::collection::vec(0i32..20, 1..30)) {
            a.sort_unstable();
            b.sort_unstable();
            let share = |s: &[i32], x: i32| s.iter().filter(|v| **v <= x).count() as f64 / s.len() as f64;
            let expected = (0..20).map(|x| (share(&a, x) - share(&b, x)).abs()).fold(0.0, f64::max);
            let real = |s: &[i32]| s.iter().map(|v| f64::from(*v)).collect::<Vec<_>>();
            prop_assert!((kolmogorov_smirnov(&real(&a), &real(&b)).unwrap() - expected).abs() < 1e-12);
        }
    }
}
