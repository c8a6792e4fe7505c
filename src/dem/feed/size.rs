//! Sizes from a distribution: the diameter that belongs to random numbers, moments and classes.

use crate::particle::{Body, GradingBy, SizeDistribution};

/// Cells of the table from which a cut normal distribution is inverted.
const CELLS: usize = 2048;
/// Below this relative density a tail is left out: exp(-745) is the smallest number above zero.
const LARGEST_EXPONENT: f64 = 700.0;

/// Draws diameters of one distribution.
#[derive(Debug, Clone, PartialEq)]
pub struct SizeSampler {
    shape: Shape,
    by: GradingBy,
}

/// A class of sizes and the share of the particles that belongs to it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SizeClass {
    /// Smallest diameter [m].
    pub from: f64,
    /// Largest diameter [m].
    pub to: f64,
    /// Share asked for [-]: of the mass or of the number, see [`SizeSampler::graded_by`].
    pub share: f64,
}

#[derive(Debug, Clone, PartialEq)]
enum Shape {
    Uniform { minimum: f64, maximum: f64 },
    Normal { normal: CutNormal, mean: f64, deviation: f64 },
    Lognormal { normal: CutNormal, median: f64, logarithm: f64 },
    Classes { sieves: Vec<f64>, cumulative: Vec<f64>, asked: Vec<f64> },
}

impl SizeSampler {
    /// A sampler of `distribution`.
    ///
    /// Fractions of the mass become probabilities of the number: p_k ~ w_k / <d^q>_k with q = 3 for spheres and 2 for
    /// discs, where <d^q>_k = (b^(q+1) - a^(q+1)) / ((q + 1) (b - a)) is the mean over a class uniform in diameter
    /// from a to b [m] (density is the same for all sizes).
    #[must_use]
    pub fn new(distribution: &SizeDistribution, body: Body) -> Self {
        let mut by = GradingBy::Number;
        let shape = match *distribution {
            SizeDistribution::Fixed { diameter } => Shape::Uniform { minimum: diameter, maximum: diameter },
            SizeDistribution::Uniform { minimum, maximum } => Shape::Uniform { minimum, maximum },
            SizeDistribution::Normal { mean, deviation, minimum, maximum } => {
                let normal = CutNormal::new((minimum - mean) / deviation, (maximum - mean) / deviation);
                Shape::Normal { normal, mean, deviation }
            }
            SizeDistribution::Lognormal { median, geometric_deviation, minimum, maximum } => {
                let logarithm = geometric_deviation.ln();
                let scaled = |diameter: f64| (diameter / median).ln() / logarithm;
                Shape::Lognormal { normal: CutNormal::new(scaled(minimum), scaled(maximum)), median, logarithm }
            }
            SizeDistribution::Sieve { by: graded_by, ref sieves, ref fractions } => {
                by = graded_by;
                sieve_classes(graded_by, sieves, fractions, mass_power(body))
            }
        };
        Self { shape, by }
    }

    /// The diameter [m] that belongs to two numbers in [0, 1).
    #[must_use]
    pub fn diameter(&self, [first, second]: [f64; 2]) -> f64 {
        match &self.shape {
            Shape::Uniform { minimum, maximum } => minimum + first * (maximum - minimum),
            Shape::Normal { normal, mean, deviation } => mean + deviation * normal.quantile(first),
            Shape::Lognormal { normal, median, logarithm } => median * (logarithm * normal.quantile(first)).exp(),
            Shape::Classes { sieves, cumulative, .. } => {
                let class = cumulative.partition_point(|&share| share <= first).min(cumulative.len() - 1);
                sieves[class] + second * (sieves[class + 1] - sieves[class])
            }
        }
    }

    /// Mean of the diameter's power, by number: E\[d^q\] \[m^q\].
    #[must_use]
    pub fn mean_power(&self, power: u32) -> f64 {
        let raised = |diameter: f64| diameter.powi(power.cast_signed());
        match &self.shape {
            Shape::Uniform { minimum, maximum } => mean_power_of_uniform(*minimum, *maximum, power),
            Shape::Normal { normal, mean, deviation } => normal.mean_of(|z| raised(mean + deviation * z)),
            Shape::Lognormal { normal, median, logarithm } => {
                normal.mean_of(|z| raised(median * (logarithm * z).exp()))
            }
            Shape::Classes { sieves, cumulative, .. } => {
                let mut below = 0.0;
                let mut mean = 0.0;
                for (class, &share) in cumulative.iter().enumerate() {
                    mean += (share - below) * mean_power_of_uniform(sieves[class], sieves[class + 1], power);
                    below = share;
                }
                mean
            }
        }
    }

    /// Mean mass of a particle, by number [kg]; `density` [kg/m3].
    #[must_use]
    pub fn mean_mass(&self, body: Body, density: f64) -> f64 {
        // a body's mass is proportional to a power of its size, so the mean power stands for all sizes
        let power = mass_power(body);
        body.mass(0.5, density) * self.mean_power(power)
    }

    /// Smallest diameter [m].
    #[must_use]
    pub fn minimum(&self) -> f64 {
        match &self.shape {
            Shape::Uniform { minimum, .. } => *minimum,
            Shape::Normal { normal, mean, deviation } => mean + deviation * normal.lower,
            Shape::Lognormal { normal, median, logarithm } => median * (logarithm * normal.lower).exp(),
            Shape::Classes { sieves, asked, .. } => {
                let first = asked.iter().position(|&share| share > 0.0).unwrap_or(0);
                sieves[first]
            }
        }
    }

    /// Largest diameter [m].
    #[must_use]
    pub fn maximum(&self) -> f64 {
        match &self.shape {
            Shape::Uniform { maximum, .. } => *maximum,
            Shape::Normal { normal, mean, deviation } => mean + deviation * normal.upper,
            Shape::Lognormal { normal, median, logarithm } => median * (logarithm * normal.upper).exp(),
            Shape::Classes { sieves, asked, .. } => {
                let last = asked.iter().rposition(|&share| share > 0.0).unwrap_or(asked.len() - 1);
                sieves[last + 1]
            }
        }
    }

    /// What the shares of [`SizeSampler::classes`] count.
    #[must_use]
    pub const fn graded_by(&self) -> GradingBy {
        self.by
    }

    /// The classes in which what was asked for and what came are compared: the sieve classes, or ten classes of equal
    /// share of a continuous distribution, or the one size.
    #[must_use]
    pub fn classes(&self) -> Vec<SizeClass> {
        if let Shape::Classes { sieves, asked, .. } = &self.shape {
            let class = |(k, &share): (usize, &f64)| SizeClass { from: sieves[k], to: sieves[k + 1], share };
            return asked.iter().enumerate().map(class).collect();
        }
        let (minimum, maximum) = (self.minimum(), self.maximum());
        if minimum >= maximum {
            return vec![SizeClass { from: minimum, to: maximum, share: 1.0 }];
        }
        let border = |tenth: u8| match tenth {
            0 => minimum,
            10 => maximum,
            _ => self.diameter([f64::from(tenth) / 10.0, 0.0]),
        };
        (0..10).map(|tenth| SizeClass { from: border(tenth), to: border(tenth + 1), share: 0.1 }).collect()
    }
}

/// The power of the diameter to which a body's mass is proportional.
const fn mass_power(body: Body) -> u32 {
    match body {
        Body::Sphere => 3,
        Body::Disc { .. } => 2,
    }
}

/// Mean of x^q over [a, b] = (b^q + b^(q-1) a + ... + a^q) / (q + 1): the quotient of differences without cancellation.
fn mean_power_of_uniform(a: f64, b: f64, power: u32) -> f64 {
    let power = power.cast_signed();
    (0..=power).map(|k| a.powi(k) * b.powi(power - k)).sum::<f64>() / f64::from(power + 1)
}

fn sieve_classes(by: GradingBy, sieves: &[f64], fractions: &[f64], power: u32) -> Shape {
    let total: f64 = fractions.iter().sum();
    let asked: Vec<f64> = fractions.iter().map(|fraction| fraction / total).collect();
    let weight = |(class, &share): (usize, &f64)| match by {
        GradingBy::Number => share,
        GradingBy::Mass => share / mean_power_of_uniform(sieves[class], sieves[class + 1], power),
    };
    let weights: Vec<f64> = asked.iter().enumerate().map(weight).collect();
    let sum: f64 = weights.iter().sum();
    let mut so_far = 0.0;
    let accumulate = |weight: &f64| {
        so_far += weight;
        so_far / sum
    };
    let cumulative = weights.iter().map(accumulate).collect();
    Shape::Classes { sieves: sieves.to_vec(), cumulative, asked }
}

/// The standard normal distribution cut to [lower, upper], inverted on a table of its integral.
///
/// A table of integrals relative to the largest density inside the cut, rather than the error function: it keeps its
/// accuracy however far out in a tail the cut lies, and one uniform number gives one draw.
#[derive(Debug, Clone, PartialEq)]
struct CutNormal {
    lower: f64,
    upper: f64,
    /// Where the density inside the cut is largest.
    peak: f64,
    /// First border and width of the cells.
    start: f64,
    width: f64,
    /// Integral up to the upper border of each cell.
    integral: Vec<f64>,
}

impl CutNormal {
    fn new(lower: f64, upper: f64) -> Self {
        let peak = 0.0_f64.clamp(lower, upper);
        let reach = (peak * peak + 2.0 * LARGEST_EXPONENT).sqrt();
        let start = lower.max(-reach);
        let width = (upper.min(reach) - start) / CELLS as f64;
        let mut normal = Self { lower, upper, peak, start, width, integral: Vec::with_capacity(CELLS) };
        let mut sum = 0.0;
        for cell in 0..CELLS {
            sum += normal.integrate(normal.border(cell), normal.border(cell + 1), |_| 1.0);
            normal.integral.push(sum);
        }
        normal
    }

    fn border(&self, cell: usize) -> f64 {
        self.start + self.width * cell as f64
    }

    /// Density relative to its value at the peak: exp(-(z^2 - z_peak^2) / 2).
    fn density(&self, z: f64) -> f64 {
        (-0.5 * (z - self.peak) * (z + self.peak)).exp()
    }

    /// Gauss-Legendre with five points: exact for polynomials of degree nine.
    fn integrate(&self, from: f64, to: f64, factor: impl Fn(f64) -> f64) -> f64 {
        let root = (10.0_f64 / 7.0).sqrt();
        let (near, far) = ((5.0 - 2.0 * root).sqrt() / 3.0, (5.0 + 2.0 * root).sqrt() / 3.0);
        let (heavy, light) = ((322.0 + 13.0 * 70.0_f64.sqrt()) / 900.0, (322.0 - 13.0 * 70.0_f64.sqrt()) / 900.0);
        let (middle, half) = (0.5 * (from + to), 0.5 * (to - from));
        let value = |x: f64| self.density(middle + half * x) * factor(middle + half * x);
        half * (128.0 / 225.0 * value(0.0) + heavy * (value(near) + value(-near)) + light * (value(far) + value(-far)))
    }

    fn quantile(&self, probability: f64) -> f64 {
        let total = self.integral[CELLS - 1];
        if total <= 0.0 || self.width <= 0.0 {
            return self.peak;
        }
        let target = probability * total;
        let cell = self.integral.partition_point(|&sum| sum <= target).min(CELLS - 1);
        let below = if cell == 0 { 0.0 } else { self.integral[cell - 1] };
        let (from, to) = (self.border(cell), self.border(cell + 1));
        let share = (target - below) / (self.integral[cell] - below);
        let mut z = from + share.clamp(0.0, 1.0) * (to - from);
        // the integral over one narrow cell is nearly linear: Newton reaches round-off in three steps
        for _ in 0..3 {
            let error = self.integrate(from, z, |_| 1.0) - (target - below);
            z = (z - error / self.density(z)).clamp(from, to);
        }
        z.clamp(self.lower, self.upper)
    }

    fn mean_of(&self, value: impl Fn(f64) -> f64) -> f64 {
        if self.width <= 0.0 {
            return value(self.peak);
        }
        let sum: f64 = (0..CELLS).map(|cell| self.integrate(self.border(cell), self.border(cell + 1), &value)).sum();
        sum / self.integral[CELLS - 1]
    }
}

#[cfg(test)]
mod tests {
    use super::super::draw::FeedKey;
    use super::*;
    use approx::assert_relative_eq;
    use std::f64::consts::PI;

    fn draws(distribution: &SizeDistribution, body: Body, count: u64) -> Vec<f64> {
        let sampler = SizeSampler::new(distribution, body);
        let key = FeedKey::new(2024, 1);
        (0..count).map(|serial| sampler.diameter(key.size(serial))).collect()
    }

    /// Sample mean of `value` against `expected` within five standard errors (chance of a false alarm 6e-7; the seed is
    /// fixed, so a pass stays a pass).
    fn assert_mean(draws: &[f64], value: impl Fn(f64) -> f64, expected: f64) {
        let count = draws.len() as f64;
        let mean = draws.iter().map(|&d| value(d)).sum::<f64>() / count;
        let variance = draws.iter().map(|&d| (value(d) - mean).powi(2)).sum::<f64>() / (count - 1.0);
        let tolerance = 5.0 * (variance / count).sqrt();
        assert!((mean - expected).abs() <= tolerance, "mean {mean} expected {expected} tolerance {tolerance}");
    }

    /// Standard normal distribution function by the alternating series of its integral, for |z| < 5.
    fn phi(z: f64) -> f64 {
        let mut term = z;
        let mut sum = z;
        for k in 1..200 {
            term *= -z * z / (2.0 * f64::from(k));
            sum += term / (2.0 * f64::from(k) + 1.0);
        }
        0.5 + sum / (2.0 * PI).sqrt()
    }

    #[test]
    fn fixed_and_uniform_have_their_moments() {
        let fixed = SizeSampler::new(&SizeDistribution::Fixed { diameter: 0.004 }, Body::Sphere);
        assert_eq!(fixed.diameter([0.73, 0.2]), 0.004);
        assert_relative_eq!(fixed.mean_power(3), 0.004_f64.powi(3), max_relative = 1e-15);
        let (a, b) = (0.003_f64, 0.005_f64);
        let uniform = SizeDistribution::Uniform { minimum: a, maximum: b };
        let sampler = SizeSampler::new(&uniform, Body::Sphere);
        let third_moment = (b.powi(4) - a.powi(4)) / (4.0 * (b - a));
        // the quotient of differences loses two digits, the tolerance allows four
        assert_relative_eq!(sampler.mean_power(3), third_moment, max_relative = 1e-12);
        let drawn = draws(&uniform, Body::Sphere, 20_000);
        assert_mean(&drawn, |d| d, (a + b) / 2.0);
        assert_mean(&drawn, |d| d.powi(3), third_moment);
        assert_relative_eq!(
            sampler.mean_mass(Body::Sphere, 3300.0),
            PI / 6.0 * 3300.0 * third_moment,
            max_relative = 1e-12
        );
    }

    #[test]
    fn a_cut_normal_has_the_moments_of_the_truncated_normal() {
        let (mean, deviation, a, b) = (4.0, 1.0, 3.5, 6.0);
        let normal = SizeDistribution::Normal { mean, deviation, minimum: a, maximum: b };
        let density = |z: f64| (-0.5 * z * z).exp() / (2.0 * PI).sqrt();
        let (alpha, beta) = ((a - mean) / deviation, (b - mean) / deviation);
        let inside = phi(beta) - phi(alpha);
        let expected = mean + deviation * (density(alpha) - density(beta)) / inside;
        let second = deviation.powi(2)
            * (1.0 + (alpha * density(alpha) - beta * density(beta)) / inside
                - ((density(alpha) - density(beta)) / inside).powi(2))
            + expected.powi(2);
        let sampler = SizeSampler::new(&normal, Body::Sphere);
        // both sides are quadratures or series good to round-off; a few digits are left for their sums
        assert_relative_eq!(sampler.mean_power(1), expected, max_relative = 1e-12);
        assert_relative_eq!(sampler.mean_power(2), second, max_relative = 1e-12);
        let drawn = draws(&normal, Body::Sphere, 20_000);
        assert!(drawn.iter().all(|d| (a..=b).contains(d)));
        assert_mean(&drawn, |d| d, expected);
        assert_mean(&drawn, |d| d * d, second);
        // quantile and distribution function are inverse to each other
        for probability in [0.001, 0.2, 0.5, 0.9, 0.9999] {
            let z = (sampler.diameter([probability, 0.0]) - mean) / deviation;
            assert_relative_eq!((phi(z) - phi(alpha)) / inside, probability, epsilon = 1e-12);
        }
    }

    #[test]
    fn a_lognormal_has_its_moments() {
        let (median, geometric_deviation) = (0.01_f64, 1.3_f64);
        let logarithm = geometric_deviation.ln();
        // cut at ten standard deviations: what is cut off is 1e-23 of the number
        let lognormal = SizeDistribution::Lognormal {
            median,
            geometric_deviation,
            minimum: median * (-10.0 * logarithm).exp(),
            maximum: median * (10.0 * logarithm).exp(),
        };
        let sampler = SizeSampler::new(&lognormal, Body::Sphere);
        for power in 1..=3 {
            let q = f64::from(power);
            let expected = median.powf(q) * (0.5 * (q * logarithm).powi(2)).exp();
            // the third power of a cut at ten deviations loses less than 1e-15 as well
            assert_relative_eq!(sampler.mean_power(power), expected, max_relative = 1e-11);
        }
        let drawn = draws(&lognormal, Body::Sphere, 20_000);
        assert_mean(&drawn, |d| (d / median).ln(), 0.0);
        assert_mean(&drawn, |d| (d / median).ln().powi(2), logarithm * logarithm);
    }

    #[test]
    fn a_cut_far_out_in_the_tail_still_draws_inside_it() {
        let tail = SizeDistribution::Normal { mean: 1.0, deviation: 0.01, minimum: 1.4, maximum: 2.0 };
        let drawn = draws(&tail, Body::Sphere, 2_000);
        assert!(drawn.iter().all(|d| (1.4..=2.0).contains(d)));
        // beyond z = 40 the tail falls off like exp(-40 (z - 40)): mean distance 1/40 deviations, less 1/40^2 of it
        assert_mean(&drawn, |d| (d - 1.4) / 0.01 * 40.0, 1.0 - 2.0 / 1600.0);
    }

    #[test]
    fn a_grading_by_mass_gives_its_fractions_of_the_mass() {
        for (body, power) in [(Body::Sphere, 3), (Body::Disc { thickness: 0.01 }, 2)] {
            let sieves = vec![0.003, 0.005, 0.01, 0.02];
            let fractions = vec![0.2, 0.3, 0.5];
            let grading =
                SizeDistribution::Sieve { by: GradingBy::Mass, sieves: sieves.clone(), fractions: fractions.clone() };
            let drawn = draws(&grading, body, 200_000);
            let sampler = SizeSampler::new(&grading, body);
            let mean_mass = sampler.mean_power(power);
            assert_mean(&drawn, |d| d.powi(power.cast_signed()), mean_mass);
            for class in 0..3 {
                let mass_inside = |d: f64| {
                    if d >= sieves[class] && d < sieves[class + 1] { d.powi(power.cast_signed()) } else { 0.0 }
                };
                assert_mean(&drawn, mass_inside, fractions[class] * mean_mass);
            }
        }
    }

    #[test]
    fn a_grading_by_number_gives_its_fractions_of_the_number() {
        let grading = SizeDistribution::Sieve {
            by: GradingBy::Number,
            sieves: vec![1.0, 2.0, 2.0, 5.0],
            fractions: vec![0.25, 0.35, 0.4],
        };
        let drawn = draws(&grading, Body::Sphere, 50_000);
        assert_mean(&drawn, |d| f64::from(u8::from(d < 2.0)), 0.25);
        assert_mean(&drawn, |d| f64::from(u8::from(d > 2.0)), 0.4);
    }

    #[test]
    fn classes_of_a_continuous_distribution_hold_equal_shares() {
        let normal = SizeDistribution::Normal { mean: 4.0, deviation: 0.5, minimum: 3.0, maximum: 5.0 };
        let classes = SizeSampler::new(&normal, Body::Sphere).classes();
        assert_eq!(classes.len(), 10);
        assert_relative_eq!(classes[5].from, 4.0, max_relative = 1e-12);
        let drawn = draws(&normal, Body::Sphere, 50_000);
        for class in &classes {
            assert_mean(&drawn, |d| f64::from(u8::from(d >= class.from && d < class.to)), class.share);
        }
    }
}
