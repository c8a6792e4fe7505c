//! Coordination numbers.

use super::statistics::{mean, standard_deviation};
use crate::math::Bounds;
use crate::particle::{ParticleId, ParticleState};
use std::collections::HashMap;

/// Contacts per particle in a region.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Coordination {
    /// Z: mean number of particle partners [-].
    pub mean: f64,
    /// Standard uncertainty of Z [-].
    pub uncertainty: f64,
    /// Z_m: the same without rattlers [-]; `None` where every particle is one.
    pub mechanical: Option<f64>,
    /// Standard uncertainty of Z_m [-].
    pub mechanical_uncertainty: Option<f64>,
    /// Share of rattlers [-].
    pub rattlers: f64,
    /// Number of particles.
    pub particles: usize,
}

/// Coordination number Z = (1/N) sum z_i of the N particles whose centres lie in `region`   [-]
///
/// z_i number of particles that particle i touches, also those beyond the border of the region; for all particles of a
/// closed system Z = 2 N_c / N with N_c contacts. Walls are no partners, but they hold: a particle with at most one
/// contact, walls included (`wall_contacts`, one entry a contact), carries no load and is a rattler. The mechanical
/// number averages over the others, Z_m = (2 N_c - N_1) / (N - N_0 - N_1) where no walls are touched.
/// Source: Thornton (2000), Géotechnique 50(1), 43-53, doi 10.1680/geot.2000.50.1.43.
/// Uncertainty: sqrt(2) s / sqrt(N), s the standard deviation of z_i; sqrt(2) because every contact counts for two
/// particles, which makes neighbours' numbers equal in that share. It describes another packing of the same kind.
/// `None` where the region holds no particle.
#[must_use]
pub fn coordination_number(
    particles: &[ParticleState],
    contacts: &[(ParticleId, ParticleId)],
    wall_contacts: &[ParticleId],
    region: &Bounds,
) -> Option<Coordination> {
    let inside = particles.iter().filter(|p| region.contains(&p.position));
    let mut partners: HashMap<ParticleId, (f64, usize)> = inside.map(|p| (p.id, (0.0, 0))).collect();
    for id in contacts.iter().flat_map(|(i, j)| [i, j]) {
        if let Some((with_particles, all)) = partners.get_mut(id) {
            *with_particles += 1.0;
            *all += 1;
        }
    }
    for id in wall_contacts {
        if let Some((_, all)) = partners.get_mut(id) {
            *all += 1;
        }
    }
    let every: Vec<f64> = partners.values().map(|(with_particles, _)| *with_particles).collect();
    let bearing: Vec<f64> = partners.values().filter(|(_, all)| *all > 1).map(|(partners, _)| *partners).collect();
    Some(Coordination {
        mean: mean(&every)?,
        uncertainty: uncertainty(&every),
        mechanical: mean(&bearing),
        mechanical_uncertainty: (!bearing.is_empty()).then(|| uncertainty(&bearing)),
        rattlers: 1.0 - bearing.len() as f64 / every.len() as f64,
        particles: every.len(),
    })
}

fn uncertainty(numbers: &[f64]) -> f64 {
    standard_deviation(numbers).map_or(f64::INFINITY, |s| s * (2.0 / numbers.len() as f64).sqrt())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::analysis::measure::tests::particle;
    use approx::assert_relative_eq;

    const ALL: Bounds = Bounds { minimum: [-1e9; 3], maximum: [1e9; 3] };

    /// A straight chain of `count` touching spheres along x.
    fn chain(count: u64) -> (Vec<ParticleState>, Vec<(ParticleId, ParticleId)>) {
        let particles: Vec<_> = (0..count).map(|k| particle(k, [2.0 * k as f64, 0.0, 0.0], 1.0)).collect();
        let contacts = particles.windows(2).map(|pair| (pair[0].id, pair[1].id)).collect();
        (particles, contacts)
    }

    #[test]
    fn a_chain_has_two_contacts_a_particle_but_for_its_ends() {
        let (particles, contacts) = chain(10);
        let found = coordination_number(&particles, &contacts, &[], &ALL).unwrap();
        assert_relative_eq!(found.mean, 2.0 * 9.0 / 10.0, epsilon = 1e-12);
        // Thornton: (2 * 9 - 2) / (10 - 0 - 2).
        assert_relative_eq!(found.mechanical.unwrap(), 2.0, epsilon = 1e-12);
        assert_relative_eq!(found.rattlers, 0.2, epsilon = 1e-12);
    }

    #[test]
    fn a_wall_holds_but_is_no_partner() {
        let (particles, contacts) = chain(10);
        let ends = [particles[0].id, particles[9].id];
        let found = coordination_number(&particles, &contacts, &ends, &ALL).unwrap();
        assert_relative_eq!(found.mean, 1.8, epsilon = 1e-12);
        assert_eq!(found.rattlers, 0.0);
    }

    #[test]
    fn partners_beyond_the_border_count() {
        let (particles, contacts) = chain(10);
        let region = Bounds { minimum: [3.0, -1.0, -1.0], maximum: [7.0, 1.0, 1.0] };
        let found = coordination_number(&particles, &contacts, &[], &region).unwrap();
        assert_eq!((found.particles, found.mean), (2, 2.0));
    }

    #[test]
    fn stated_uncertainty_is_the_scatter_of_random_packings() {
        // Random graphs: each pair of ring neighbours touches with probability p. Var(Z) = 4 N p (1 - p) / N^2.
        use rand::{RngExt, SeedableRng};
        let mut random = rand_chacha::ChaCha8Rng::seed_from_u64(3);
        let (particles, _) = chain(400);
        let chance = 0.7;
        let (mut numbers, mut stated) = (Vec::new(), 0.0);
        for _ in 0..300 {
            let contacts: Vec<_> = (0..400usize)
                .filter(|_| random.random_range(0.0..1.0) < chance)
                .map(|k| (particles[k].id, particles[(k + 1) % 400].id))
                .collect();
            let found = coordination_number(&particles, &contacts, &[], &ALL).unwrap();
            numbers.push(found.mean);
            stated += found.uncertainty / 300.0;
        }
        // 300 draws know their scatter to 1 / sqrt(600) = 4 %; three times that.
        assert_relative_eq!(standard_deviation(&numbers).unwrap(), stated, max_relative = 0.12);
    }

    #[test]
    fn no_particle_no_number() {
        assert_eq!(coordination_number(&[], &[], &[], &ALL), None);
    }
}
