//! The momentum budget of the free particles: where it comes from, and what taking particles in and out of their midst brings.

use super::simulation::Simulation;
use crate::math::Vec3;
use serde::{Deserialize, Serialize};

/// Momentum [kg m/s] of the particles that are moved by forces, tethered ones among them, and its sources since the start:
/// momentum = gravity + walls + ghosts + tethers + sleep + hand_over + inserted - removed, up to round-off.
///
/// In a time step velocity-Verlet gives each particle m (a_old + a_new) dt / 2. What acts between two free particles cancels;
/// the rest is split by its origin. Particles that were frozen, released, inserted or removed between two steps leave a
/// remainder in the half step with a_old: a force whose counterpart is no longer, or not yet, accounted for on the same side.
/// It is `hand_over`, dt/2 times the sum of the old contact forces on free particles, prescribed particles and parts; exactly
/// zero while nobody comes or goes.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
pub struct MomentumBudget {
    /// Sum of m v now.
    pub momentum: Vec3,
    /// From gravity.
    pub gravity: Vec3,
    /// From parts.
    pub walls: Vec3,
    /// From prescribed particles.
    pub ghosts: Vec3,
    /// From tethers.
    pub tethers: Vec3,
    /// From being asleep: the motion that sleepers lost, and what kept them in place under unbalanced forces.
    #[serde(default, skip_serializing_if = "super::sleep::is_zero")]
    pub sleep: Vec3,
    /// Left by changes of who is free.
    pub hand_over: Vec3,
    /// Came with particles that were inserted, released or tethered.
    pub inserted: Vec3,
    /// Went with particles that were removed or frozen.
    pub removed: Vec3,
}

impl MomentumBudget {
    /// What the sources leave unexplained [kg m/s]: zero up to round-off.
    #[must_use]
    pub fn imbalance(&self) -> Vec3 {
        self.momentum
            - (self.gravity + self.walls + self.ghosts + self.tethers + self.sleep + self.hand_over + self.inserted
                - self.removed)
    }
}

/// The sources so far, and what the next step's account needs.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
pub struct MomentumAccount {
    /// The sources; `momentum` is computed when asked for.
    pub(super) booked: MomentumBudget,
    /// Mass of the free particles [kg].
    free_mass: f64,
    /// Sum of the present loads on the prescribed particles [N].
    pub(super) ghost_force: Vec3,
    /// Sum of the present loads and weights of the sleepers [N].
    #[serde(default, skip_serializing_if = "super::sleep::is_zero")]
    pub(super) sleeper_force: Vec3,
    /// Whether anybody came or went since the last step.
    pub(super) regrouped: bool,
}

impl Simulation {
    /// The momentum budget of the free particles. The sources are zero where momentum is not accounted for
    /// ([`super::simulation::Setup::momentum`]).
    #[must_use]
    pub fn momentum_budget(&self) -> MomentumBudget {
        let free = (0..self.particles.len()).filter(|&index| !self.particles.path(index).is_prescribed());
        let momentum = free.map(|index| self.momentum_of(index)).sum();
        MomentumBudget { momentum, ..self.momentum.booked }
    }

    /// Books that a free particle came, with its momentum [kg m/s].
    pub(super) fn note_comer(&mut self, momentum: Vec3) {
        if self.accounts_for_momentum() {
            self.momentum.booked.inserted += momentum;
        }
        self.momentum.regrouped = true;
    }

    /// Books that a free particle went, with its momentum [kg m/s].
    pub(super) fn note_goer(&mut self, momentum: Vec3) {
        if self.accounts_for_momentum() {
            self.momentum.booked.removed += momentum;
        }
        self.momentum.regrouped = true;
    }

    /// Books that a particle fell asleep, with the momentum that it loses [kg m/s].
    pub(super) fn note_sleeper(&mut self, momentum: Vec3) {
        if self.accounts_for_momentum() {
            self.momentum.booked.sleep -= momentum;
        }
        self.momentum.regrouped = true;
    }

    const fn accounts_for_momentum(&self) -> bool {
        self.setup.energy || self.setup.momentum
    }

    /// The half step with the old forces, once it is known who takes part in the step, before the new forces are computed.
    pub(super) fn book_old_forces(&mut self) {
        if !self.accounts_for_momentum() {
            return;
        }
        if self.momentum.regrouped {
            self.regroup();
        }
        self.book_half_step();
    }

    /// The half step with the new forces.
    pub(super) fn book_new_forces(&mut self) {
        if self.accounts_for_momentum() {
            self.book_half_step();
        }
    }

    fn book_half_step(&mut self) {
        let (half, body) = (0.5 * self.setup.timestep, self.setup.body);
        let parts: Vec3 = self.part_loads.iter().map(|load| load.force).sum();
        let tethers: Vec3 = self.tethers.iter().map(|tether| tether.force).sum();
        let account = &mut self.momentum;
        let booked = &mut account.booked;
        booked.gravity += body.in_plane(&self.setup.gravity) * (account.free_mass * half);
        booked.walls -= body.in_plane(&parts) * half;
        booked.ghosts -= body.in_plane(&account.ghost_force) * half;
        booked.tethers += tethers * half;
        booked.sleep -= account.sleeper_force * half;
    }

    /// Who is free has changed: their mass, the old forces as they are divided now, and the remainder of that division.
    fn regroup(&mut self) {
        let (mut free_mass, mut free_force, mut ghost_force) = (0.0, Vec3::zeros(), Vec3::zeros());
        for index in 0..self.particles.len() {
            let force = self.particles.loads()[index].force;
            if self.particles.path(index).is_prescribed() {
                ghost_force += force;
            } else {
                free_mass += self.particles.mass(index);
                free_force += force;
            }
        }
        let sleeper_force = self.force_on_sleepers();
        let parts: Vec3 = self.part_loads.iter().map(|load| load.force).sum();
        let remainder = self.setup.body.in_plane(&(free_force + parts + ghost_force)) * (0.5 * self.setup.timestep);
        let account = &mut self.momentum;
        account.booked.hand_over += remainder;
        (account.free_mass, account.ghost_force, account.regrouped) = (free_mass, ghost_force, false);
        account.sleeper_force = sleeper_force;
    }

    /// Momentum of particle `index` [kg m/s].
    pub(super) fn momentum_of(&self, index: usize) -> Vec3 {
        Vec3::from(self.particles.velocity(index).linear) * self.particles.mass(index)
    }
}
