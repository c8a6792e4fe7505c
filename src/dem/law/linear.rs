//! Linear spring and dashpot.

use super::constants::PairConstants;
use super::{Compatibility, LawSettings, NormalForce, NormalMotion};
use crate::dem::timescale::linear_stiffness;

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
pub fn normal_force(settings: &LawSettings, pair: &PairConstants, motion: &NormalMotion) -> NormalForce {
    let (normal_stiffness, tangential_stiffness, normal_damping, tangential_damping) = match pair.direct {
        Some(d) => (d.normal_stiffness, d.tangential_stiffness, d.normal_damping, d.tangential_damping),
        None => derived(settings, pair, motion),
    };
    let elastic = normal_stiffness * motion.overlap;
    NormalForce {
        elastic,
        total: elastic + normal_damping * motion.closing_speed,
        tangential_stiffness,
        tangential_damping,
        elastic_energy: 0.5 * elastic * motion.overlap,
        stiffness_growth: 0.0,
        growth_by_overlap: 0.0,
    }
}

fn derived(settings: &LawSettings, pair: &PairConstants, motion: &NormalMotion) -> (f64, f64, f64, f64) {
    let stiffness = linear_stiffness(
        motion.effective_mass,
        motion.effective_radius,
        pair.effective_youngs_modulus,
        settings.characteristic_velocity,
    );
    // 4 m* k / (1 + (pi / ln e)^2) = (2 beta)^2 m* k
    let damping = 2.0 * pair.damping_factor * (motion.effective_mass * stiffness).sqrt();
    if settings.compatibility == Compatibility::Liggghts {
        return (stiffness, stiffness, damping, damping);
    }
    let tangential = stiffness * 4.0 * pair.effective_shear_modulus / pair.effective_youngs_modulus;
    let tangential_damping = 2.0 * pair.damping_factor * (motion.effective_mass * tangential).sqrt();
    (stiffness, tangential, damping, tangential_damping)
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
