//! Centre of mass.

use crate::math::{Bounds, Vec3};
use crate::particle::{Body, ParticleState};

/// Centre of mass of the particles whose centres lie in `region`, x_c = sum m_i x_i / sum m_i   [m]
///
/// m_i mass [kg] of `body`, x_i centre [m]. Exact for the state it is given (round-off aside): one state has no sampling
/// error, and what another seed would give only replicates tell. `None` where the region holds no particle.
#[must_use]
pub fn centre_of_mass(particles: &[ParticleState], body: Body, region: &Bounds) -> Option<Vec3> {
    let (mut moment, mut mass) = (Vec3::zeros(), 0.0);
    for particle in particles.iter().filter(|p| region.contains(&p.position)) {
        let own = body.mass(particle.radius, particle.density);
        moment += own * particle.position;
        mass += own;
    }
    (mass > 0.0).then(|| moment / mass)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::analysis::measure::tests::particle;
    use crate::math::vec3;
    use approx::assert_relative_eq;

    #[test]
    fn weighs_by_mass_and_leaves_out_what_is_outside() {
        let particles =
            [particle(0, [0.0; 3], 1.0), particle(1, [9.0, 0.0, 0.0], 2.0), particle(2, [100.0, 0.0, 0.0], 5.0)];
        let region = Bounds { minimum: [-10.0; 3], maximum: [10.0; 3] };
        // Masses 1 : 8 for spheres and 1 : 4 for discs of equal thickness.
        let spheres = centre_of_mass(&particles, Body::Sphere, &region).unwrap();
        assert_relative_eq!(spheres, vec3(9.0 * 8.0 / 9.0, 0.0, 0.0), epsilon = 1e-12);
        let discs = centre_of_mass(&particles, Body::Disc { thickness: 1.0 }, &region).unwrap();
        assert_relative_eq!(discs, vec3(9.0 * 4.0 / 5.0, 0.0, 0.0), epsilon = 1e-12);
    }

    #[test]
    fn an_empty_region_has_none() {
        assert_eq!(centre_of_mass(&[particle(0, [0.0; 3], 1.0)], Body::Sphere, &Bounds::EMPTY), None);
    }
}
