//! Hertz's normal law with Tsuji's damping and Mindlin's no-slip tangential stiffness.

use super::constants::PairConstants;
use super::{ContactStiffness, NormalContact};
use crate::math::lanes::Lanes;

/// sqrt(5/6): the factor that makes Tsuji's damping reproduce the coefficient of restitution.
const SQRT_FIVE_SIXTHS: f64 = 0.912_870_929_175_276_9;

/// Elastic force F = 4/3 E* sqrt(R* d) d, damping gamma_n = 2 sqrt(5/6) beta sqrt(S_n m*) with S_n = 2 E* sqrt(R* d),
/// tangential stiffness k_t = 8 G* sqrt(R* d), gamma_t likewise with k_t for S_n: gamma_t = gamma_n sqrt(4 G* / E*).
///
/// E* effective Young's modulus [Pa], G* effective shear modulus [Pa], R* effective radius [m], m* effective mass [kg],
/// d overlap [m], beta damping factor [-] ([`crate::dem::timescale::damping_ratio`]).
/// Source: Hertz (1882); Mindlin (1949); Tsuji, Tanaka & Ishida (1992); Antypov & Elliott (2011).
/// Valid: dry elastic spheres, d much smaller than R*. Rival conventions: 4/3 E* sqrt(R* d) is the secant stiffness; the
/// tangent one is S_n, 3/2 of it.
#[inline(always)]
#[must_use]
pub fn stiffness<L: Lanes>(pair: &PairConstants<L>, contact: &NormalContact<L>) -> ContactStiffness<L> {
    let number = L::splat;
    let root = (contact.effective_radius * contact.overlap).sqrt();
    let tangent_stiffness = number(2.0) * pair.effective_youngs_modulus * root;
    let damping =
        number(2.0 * SQRT_FIVE_SIXTHS) * pair.damping_factor * (tangent_stiffness * contact.effective_mass).sqrt();
    let elastic = number(2.0 / 3.0) * tangent_stiffness * contact.overlap;
    ContactStiffness {
        elastic,
        normal_damping: damping,
        tangential_stiffness: number(8.0) * pair.effective_shear_modulus * root,
        tangential_damping: damping * pair.root_of_stiffness_ratio,
        elastic_energy: number(0.4) * elastic * contact.overlap,
        // k_t grows with the root of the overlap: d(ln k_t) = 1/2 d(ln delta).
        growth_by_overlap: number(0.5) / contact.overlap,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use approx::assert_relative_eq;

    #[test]
    fn root_of_five_sixths_is_exact_to_the_last_bit() {
        assert_eq!(SQRT_FIVE_SIXTHS, (5.0_f64 / 6.0).sqrt());
    }

    #[test]
    fn elastic_energy_is_the_integral_of_the_force() {
        let pair = PairConstants {
            effective_youngs_modulus: 3.0e6,
            effective_shear_modulus: 1.0e6,
            damping_factor: 0.3,
            root_of_stiffness_ratio: (4.0_f64 / 3.0).sqrt(),
            given: None,
            sliding_friction: 0.5,
            rolling_friction: 0.0,
        };
        let at =
            |overlap: f64| stiffness(&pair, &NormalContact { overlap, effective_radius: 1e-3, effective_mass: 1e-4 });
        let (overlap, count) = (2e-5, 20_000);
        let width = overlap / f64::from(count);
        // Midpoint rule: error of order (1 / count)^1.5 at the root's end.
        let integral: f64 = (0..count).map(|k| at((f64::from(k) + 0.5) * width).elastic * width).sum();
        assert_relative_eq!(at(overlap).elastic_energy, integral, max_relative = 1e-6);
    }
}
