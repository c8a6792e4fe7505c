//! From identities to storage indices.

use super::simulation::Simulation;
use crate::particle::ParticleId;

/// Where some particles are stored, by identity.
#[derive(Debug, Default)]
pub struct Indices(Vec<(ParticleId, usize)>);

/// Up to so many identities a plain comparison with each is quicker than a search.
const FEW: usize = 4;

impl Indices {
    /// Finds `wanted` in `ids` in one pass.
    #[must_use]
    pub fn find(ids: &[ParticleId], wanted: &[ParticleId]) -> Self {
        if wanted.is_empty() {
            return Self::default();
        }
        let mut sorted = wanted.to_vec();
        sorted.sort_unstable();
        sorted.dedup();
        let is_wanted = |id: &ParticleId| match sorted.len() {
            0..=FEW => sorted.contains(id),
            _ => sorted.binary_search(id).is_ok(),
        };
        let mut found: Vec<_> =
            ids.iter().enumerate().filter(|(_, id)| is_wanted(id)).map(|(index, id)| (*id, index)).collect();
        found.sort_unstable();
        Self(found)
    }

    /// Storage index of a particle; `None` where there is no such particle.
    #[must_use]
    pub fn get(&self, id: ParticleId) -> Option<usize> {
        self.0.binary_search_by_key(&id, |(held, _)| *held).ok().map(|n| self.0[n].1)
    }

    /// Storage indices of all that were found, by ascending identity.
    pub fn all(&self) -> impl Iterator<Item = usize> + '_ {
        self.0.iter().map(|(_, index)| *index)
    }
}

impl Simulation {
    /// Where the particles `ids` are stored now.
    pub(super) fn indices_of(&self, ids: &[ParticleId]) -> Indices {
        Indices::find(&self.particles.ids, ids)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn few_and_many_are_found_alike() {
        // 101 is prime to 1000: every number once, in disorder
        let ids: Vec<ParticleId> = (0..1000_u64).map(|n| ParticleId(n * 101 % 1000)).collect();
        for count in [0, 1, FEW, FEW + 1, 300] {
            let wanted: Vec<ParticleId> = (0..count as u64).map(|n| ParticleId((7 * n + 990) % 1100)).collect();
            let found = Indices::find(&ids, &wanted);
            for id in &wanted {
                assert_eq!(found.get(*id), ids.iter().position(|held| held == id), "{id:?}");
            }
            assert_eq!(found.all().count(), wanted.iter().filter(|id| id.0 < 1000).count());
            assert_eq!(found.get(ParticleId(5)).is_some(), wanted.contains(&ParticleId(5)));
        }
    }
}
