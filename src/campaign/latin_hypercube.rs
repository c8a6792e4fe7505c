//! Latin hypercube samples.

use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::{Rng as _, SeedableRng as _};

/// `count` shares in [0, 1) of one axis of a Latin hypercube sample: one in each of `count` equal classes, uniform within it,
/// the classes in random order (McKay, Beckman and Conover 1979).
///
/// x_i = (pi(i) + u_i) / count, with pi a random permutation of 0 .. count - 1 and u_i uniform in [0, 1). What is drawn depends
/// on `seed`, the axis' `name` and `count` alone: an axis that is added changes no other.
#[must_use]
pub fn shares(seed: u64, name: &str, count: usize) -> Vec<f64> {
    let mut key = blake3::Hasher::new();
    key.update(&seed.to_le_bytes()).update(name.as_bytes());
    let mut generator = ChaCha8Rng::from_seed(*key.finalize().as_bytes());
    let mut classes: Vec<usize> = (0..count).collect();
    // Fisher and Yates
    for last in (1..count).rev() {
        let other = (unit(&mut generator) * (last + 1) as f64) as usize;
        classes.swap(last, other.min(last));
    }
    let largest = 1.0 - f64::EPSILON / 2.0;
    classes.into_iter().map(|class| ((class as f64 + unit(&mut generator)) / count as f64).min(largest)).collect()
}

/// Uniform in [0, 1), a multiple of 2^-53.
fn unit(generator: &mut ChaCha8Rng) -> f64 {
    (generator.next_u64() >> 11) as f64 * (0.5 * f64::EPSILON)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_class_is_met_once_and_seed_and_name_decide() {
        for count in [1, 2, 7, 1000] {
            let drawn = shares(3, "friction", count);
            let mut classes: Vec<usize> = drawn.iter().map(|share| (share * count as f64) as usize).collect();
            classes.sort_unstable();
            assert_eq!(classes, (0..count).collect::<Vec<_>>());
            assert_eq!(drawn, shares(3, "friction", count));
        }
        assert_ne!(shares(3, "friction", 50), shares(4, "friction", 50));
        assert_ne!(shares(3, "friction", 50), shares(3, "tilt", 50));
    }

    #[test]
    fn two_axes_are_not_correlated() {
        // Correlation of n independent pairs has the standard deviation 1 / sqrt(n - 1); four of them.
        let count = 2000;
        let (a, b) = (shares(1, "a", count), shares(1, "b", count));
        let covariance: f64 = a.iter().zip(&b).map(|(a, b)| (a - 0.5) * (b - 0.5)).sum::<f64>() / count as f64;
        assert!((covariance * 12.0).abs() < 4.0 / (count as f64 - 1.0).sqrt(), "{}", covariance * 12.0);
    }
}
