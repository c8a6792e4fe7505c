//! Particles that leave the domain, go round its periodic borders, or are taken out.

use super::inspect::Partner;
use super::particles::MotionLists;
use super::removal::{Removal, RemovalCause};
use super::simulation::Simulation;
use crate::particle::ParticleId;
use std::collections::HashSet;

impl Simulation {
    /// Removes the particles whose centre has left the domain.
    pub(super) fn remove_leavers(&mut self) {
        if !self.has_leavers {
            return;
        }
        let leavers: Vec<(usize, RemovalCause)> =
            (0..self.particles.len()).filter_map(|index| Some((index, self.border_crossed(index)?))).collect();
        if !leavers.is_empty() {
            self.remove(&leavers);
        }
    }

    /// Removes particles by identity; unknown ones are ignored.
    pub fn remove_particles(&mut self, ids: &[ParticleId], cause: RemovalCause) {
        let wanted: HashSet<ParticleId> = ids.iter().copied().collect();
        let found: Vec<(usize, RemovalCause)> = (0..self.particles.len())
            .filter(|&index| wanted.contains(&self.particles.ids[index]))
            .map(|index| (index, cause))
            .collect();
        if !found.is_empty() {
            self.remove(&found);
        }
    }

    fn border_crossed(&self, index: usize) -> Option<RemovalCause> {
        let centre = &self.particles.spheres[index].centre;
        let domain = &self.setup.domain;
        (0..3).filter(|&axis| !self.setup.periodic[axis]).find_map(|axis| {
            let below = centre[axis] < domain.minimum[axis];
            let above = centre[axis] > domain.maximum[axis];
            (below || above).then(|| RemovalCause::border(axis, above))
        })
    }

    fn remove(&mut self, leavers: &[(usize, RemovalCause)]) {
        let time = self.time();
        for &(index, cause) in leavers {
            let state = self.particles.state(index);
            // A prescribed particle's own energy is outside of the budget.
            if !self.particles.path(index).is_prescribed() {
                self.booked.removed += self.mechanical_energy_of(&state);
                let velocity = match cause {
                    RemovalCause::Asked | RemovalCause::Gate | RemovalCause::Fate => state.velocity,
                    // Within a time step: the velocity at its start, before it was estimated ahead.
                    _ => state.velocity - self.velocity_gained(index),
                };
                self.note_goer(velocity * self.particles.mass(index));
            }
            self.momentum.regrouped = true;
            self.removed.push(Removal {
                id: state.id,
                mass: self.particles.mass(index),
                time,
                position: state.position.into(),
                cause,
            });
        }
        if self.terms.energy {
            let ids: HashSet<ParticleId> = leavers.iter().map(|(index, _)| self.particles.ids[*index]).collect();
            let leaves = |partner| matches!(partner, Partner::Particle(other) if ids.contains(&other));
            self.booked.removed += self.spring_energy(|id, partner| ids.contains(&id) || leaves(partner));
        }
        if !self.tethers.is_empty() {
            let ids: HashSet<ParticleId> = leavers.iter().map(|(index, _)| self.particles.ids[*index]).collect();
            self.tethers.retain(|tether| !ids.contains(&tether.id));
        }
        let gone: HashSet<usize> = leavers.iter().map(|(index, _)| *index).collect();
        self.retain(|index| !gone.contains(&index));
    }

    /// Brings particles beyond a periodic border back on the other side.
    pub(super) fn wrap_periodic(&mut self) {
        let (domain, periodic) = (self.setup.domain, self.setup.periodic);
        if periodic == [false; 3] {
            return;
        }
        let mut lifted = 0.0;
        let MotionLists { spheres, velocities, .. } = self.particles.kept_lists();
        for (sphere, velocity) in spheres.iter_mut().zip(velocities) {
            for axis in (0..3).filter(|&axis| periodic[axis]) {
                let length = domain.maximum[axis] - domain.minimum[axis];
                let turns = ((sphere.centre[axis] - domain.minimum[axis]) / length).floor();
                sphere.centre[axis] -= turns * length;
                if !velocity.path.is_prescribed() {
                    lifted += turns * length * self.setup.gravity[axis] / velocity.inverse_mass;
                }
            }
        }
        // Where gravity has a component along a periodic axis, a particle that runs down comes back at the top.
        self.booked.inserted += lifted;
    }
}
