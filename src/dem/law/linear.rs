//! Linear spring and dashpot.

use super::constants::{GivenStiffness, PairConstants};
use super::{Compatibility, ContactStiffness, LawSettings, NormalContact};
use crate::dem::timescale::linear_stiffness;
use crate::math::lanes::{Lanes, Mask};

/// Elastic force F = K_n d, dashpot eta_n on the closing speed; constants given directly, or from E*, G* and e.
///
/// From the materials: K_n = 16/15 sqrt(R*) E* (15 m* v_c^2 / (16 sqrt(R*) E*))^(1/5)   [N/m], the stiffness that gives a
/// collision at the characteristic velocity v_c [m/s] the same largest elastic energy as Hertz's law;
/// K_t = K_n 4 G* / E* (Mindlin's ratio of tangential to normal tangent stiffness); eta = 2 beta sqrt(m* K).
/// R* effective radius [m], m* effective mass [kg], d overlap [m], beta damping factor [-].
/// Source: Cundall & Strack (1979); the stiffness as in the LIGGGHTS documentation, `model hooke`.
/// Valid: where forces, not contact durations at other speeds than v_c, matter. In the LIGGGHTS compatibility mode K_t = K_n
/// and eta_t = eta_n, which is that code's convention.
#[inline(always)]
#[must_use]
pub fn stiffness<L: Lanes>(
    settings: &LawSettings,
    pair: &PairConstants<L>,
    contact: &NormalContact<L>,
) -> ContactStiffness<L> {
    let constants = match &pair.given {
        None => derived(settings, pair, contact),
        Some((stiffness, everywhere)) if !(!*everywhere).any() => *stiffness,
        // Materials of both kinds.
        Some((stiffness, here)) => stiffness.or(*here, &derived(settings, pair, contact)),
    };
    let elastic = constants.normal_stiffness * contact.overlap;
    ContactStiffness {
        elastic,
        normal_damping: constants.normal_damping,
        tangential_stiffness: constants.tangential_stiffness,
        tangential_damping: constants.tangential_damping,
        elastic_energy: L::splat(0.5) * elastic * contact.overlap,
        growth_by_overlap: L::zero(),
    }
}

#[inline(always)]
fn derived<L: Lanes>(settings: &LawSettings, pair: &PairConstants<L>, contact: &NormalContact<L>) -> GivenStiffness<L> {
    let (mass, radius, youngs) = (contact.effective_mass, contact.effective_radius, pair.effective_youngs_modulus);
    // The power has no lanes.
    let stiffness = L::lane_by_lane(mass, radius, youngs, |mass, radius, youngs| {
        linear_stiffness(mass, radius, youngs, settings.characteristic_velocity)
    });
    // 4 m* k / (1 + (pi / ln e)^2) = (2 beta)^2 m* k
    let damping = L::splat(2.0) * pair.damping_factor * (mass * stiffness).sqrt();
    let (tangential_stiffness, tangential_damping) = if settings.compatibility == Compatibility::Liggghts {
        (stiffness, damping)
    } else {
        let tangential = stiffness * L::splat(4.0) * pair.effective_shear_modulus / youngs;
        (tangential, damping * pair.root_of_stiffness_ratio)
    };
    GivenStiffness { normal_stiffness: stiffness, tangential_stiffness, normal_damping: damping, tangential_damping }
}

#[cfg(test)]
mod tests {
    use super::*;
    use approx::assert_relative_eq;

    #[test]
    fn stiffness_gives_hertz_largest_energy_overlap_relation() {
        // At v_c the linear spring takes up the kinetic energy at d = v sqrt(m/k); Hertz at d = (15 m v^2 / (16 E sqrt R))^(2/5).
        // The formula sets k so that both are equal.
        let (youngs, radius, mass, velocity): (f64, f64, f64, f64) = (2.0e7, 2e-3, 5e-5, 1.3);
        let stiffness = linear_stiffness(mass, radius, youngs, velocity);
        let linear = velocity * (mass / stiffness).sqrt();
        let hertz = (15.0 * mass * velocity.powi(2) / (16.0 * youngs * radius.sqrt())).powf(0.4);
        assert_relative_eq!(linear, hertz, max_relative = 1e-12);
    }
}
