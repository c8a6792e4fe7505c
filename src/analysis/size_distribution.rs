//! Size distribution of particles.

use crate::math::Bounds;
use crate::particle::{Body, GradingBy, ParticleState};

/// A cumulative size distribution.
#[derive(Debug, Clone, PartialEq)]
pub struct SizeDistribution {
    /// Ascending diameters [m].
    diameters: Vec<f64>,
    /// Passing fraction [-] at each diameter, half of the particle itself included.
    passing: Vec<f64>,
    /// Number of equally weighted particles that would scatter as much: (sum w)^2 / sum w^2 [-].
    effective_count: f64,
}

/// A diameter below which a share of the particles lies.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Percentile {
    /// Diameter [m].
    pub diameter: f64,
    /// Standard uncertainty [m], as of a sample of the material that was fed.
    pub uncertainty: f64,
}

impl SizeDistribution {
    /// Distribution of the particles whose centres lie in `region`, weighted by mass or by number.
    ///
    /// Particle k of the ascending order stands at the passing fraction (w_1 + ... + w_(k-1) + w_k / 2) / W, w_k its mass
    /// [kg] or 1, W their sum (the plotting position of Hazen 1914), and fractions in between are linear in diameter.
    /// `None` where the region holds no particle.
    #[must_use]
    pub fn of(particles: &[ParticleState], body: Body, by: GradingBy, region: &Bounds) -> Option<Self> {
        let weight = |p: &ParticleState| match by {
            GradingBy::Mass => body.mass(p.radius, p.density),
            GradingBy::Number => 1.0,
        };
        let mut sizes: Vec<(f64, f64)> =
            particles.iter().filter(|p| region.contains(&p.position)).map(|p| (2.0 * p.radius, weight(p))).collect();
        sizes.sort_by(|a, b| a.0.total_cmp(&b.0));
        let total: f64 = sizes.iter().map(|(_, w)| w).sum();
        let squares: f64 = sizes.iter().map(|(_, w)| w * w).sum();
        let mut below = 0.0;
        let passing = sizes
            .iter()
            .map(|(_, w)| {
                below += w;
                (below - 0.5 * w) / total
            })
            .collect();
        let diameters = sizes.iter().map(|(d, _)| *d).collect();
        (total > 0.0).then(|| Self { diameters, passing, effective_count: total * total / squares })
    }

    /// Share of the particles [-] that passes a sieve of `diameter` [m].
    #[must_use]
    pub fn passing_fraction(&self, diameter: f64) -> f64 {
        let smallest = self.diameters.partition_point(|d| *d < diameter);
        match smallest {
            0 => 0.0,
            k if k == self.diameters.len() => 1.0,
            k => interpolate(diameter, &self.diameters[k - 1..=k], &self.passing[k - 1..=k]),
        }
    }

    /// Diameter d_q that the share `passing` q passes: d10 for q = 0.1, d50 (the median) for q = 0.5, d90 for q = 0.9.
    ///
    /// Uncertainty: half the distance of the diameters at q -+ sqrt(q (1 - q) / n), the binomial scatter of a sample of n
    /// particles, n the effective count. All particles of a state are known, so the figure itself is exact for it.
    #[must_use]
    pub fn percentile(&self, passing: f64) -> Percentile {
        let scatter = (passing * (1.0 - passing) / self.effective_count).sqrt();
        let spread = self.diameter_at(passing + scatter) - self.diameter_at(passing - scatter);
        Percentile { diameter: self.diameter_at(passing), uncertainty: 0.5 * spread }
    }

    fn diameter_at(&self, passing: f64) -> f64 {
        let above = self.passing.partition_point(|p| *p < passing);
        match above {
            0 => self.diameters[0],
            k if k == self.passing.len() => self.diameters[k - 1],
            k => interpolate(passing, &self.passing[k - 1..=k], &self.diameters[k - 1..=k]),
        }
    }
}

fn interpolate(x: f64, xs: &[f64], ys: &[f64]) -> f64 {
    if xs[1] > xs[0] { ys[0] + (ys[1] - ys[0]) * (x - xs[0]) / (xs[1] - xs[0]) } else { ys[1] }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::analysis::measure::tests::particle;
    use crate::analysis::statistics::standard_deviation;
    use approx::assert_relative_eq;
    use rand::{RngExt, SeedableRng};

    const ALL: Bounds = Bounds { minimum: [-1e9; 3], maximum: [1e9; 3] };

    fn of_radii(radii: impl IntoIterator<Item = f64>, by: GradingBy) -> SizeDistribution {
        let particles: Vec<_> =
            radii.into_iter().enumerate().map(|(k, radius)| particle(k as u64, [0.0; 3], radius)).collect();
        SizeDistribution::of(&particles, Body::Sphere, by, &ALL).unwrap()
    }

    /// Evenly spaced radii in (a, b): the distribution function of a uniform radius without scatter.
    fn uniform(a: f64, b: f64, count: usize) -> impl Iterator<Item = f64> {
        (0..count).map(move |k| a + (b - a) * (k as f64 + 0.5) / count as f64)
    }

    #[test]
    fn uniform_radii_follow_their_distribution_functions() {
        // By number F = (d - a) / (b - a); by mass F = (d^4 - a^4) / (b^4 - a^4). n = 1000 even steps: error O(1 / n^2).
        let (a, b) = (3e-3, 5e-3);
        let by_number = of_radii(uniform(a / 2.0, b / 2.0, 1000), GradingBy::Number);
        let by_mass = of_radii(uniform(a / 2.0, b / 2.0, 1000), GradingBy::Mass);
        for q in [0.1, 0.5, 0.9] {
            assert_relative_eq!(by_number.percentile(q).diameter, a + q * (b - a), max_relative = 1e-5);
            let expected = (a.powi(4) + q * (b.powi(4) - a.powi(4))).powf(0.25);
            assert_relative_eq!(by_mass.percentile(q).diameter, expected, max_relative = 1e-5);
            assert_relative_eq!(by_mass.passing_fraction(expected), q, max_relative = 1e-5);
        }
    }

    #[test]
    fn fractions_stay_between_none_and_all() {
        let single = of_radii([1.0], GradingBy::Mass);
        assert_eq!((single.passing_fraction(1.9), single.passing_fraction(2.1)), (0.0, 1.0));
        assert_eq!(single.percentile(0.1), Percentile { diameter: 2.0, uncertainty: 0.0 });
        let equal = of_radii([1.0; 4], GradingBy::Number);
        assert_eq!(equal.percentile(0.5).diameter, 2.0);
    }

    #[test]
    fn stated_uncertainty_is_the_scatter_of_samples() {
        let mut random = rand_chacha::ChaCha8Rng::seed_from_u64(7);
        let (mut medians, mut stated) = (Vec::new(), 0.0);
        for _ in 0..400 {
            let radii: Vec<f64> = (0..500).map(|_| random.random_range(1.5..2.5)).collect();
            let median = of_radii(radii, GradingBy::Mass).percentile(0.5);
            medians.push(median.diameter);
            stated += median.uncertainty / 400.0;
        }
        // 400 samples know their scatter to 3.5 %; the rest is the binomial formula, which takes the weights as
        // independent of the size, although they grow with it: within 20 % for a size ratio of 5 : 3.
        assert_relative_eq!(standard_deviation(&medians).unwrap(), stated, max_relative = 0.2);
    }
}
