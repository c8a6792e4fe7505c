//! Sleep: particles that rest stay where they are, at no cost, until the forces on them are out of balance.

use super::integrate::StepNote;
use super::neighborhood::Chunk;
use super::particles::{Acceleration, Path, Velocity};
use super::simulation::Simulation;
use super::wall::Walls;
use crate::math::Vec3;
use std::time::Instant;

/// When a particle falls asleep, and when it wakes.
///
/// A free particle is calm while v <= `speed`, a <= `acceleration` / 2 and r A <= `acceleration` / 2: v [m/s] its velocity, a [m/s2] and
/// A [rad/s2] the accelerations that contacts and gravity give it, r [m] its radius. Its spin w [rad/s] does not count: a ball on a floor
/// turns on the spot for ever, and no torque says so. After `hold` of calm it falls asleep: v = w = 0, and it stays where it is.
/// Every other particle still feels it. It wakes in the time step in which a or r A, from all its contacts and gravity, exceeds
/// `acceleration`.
///
/// Valid where a resting particle may bear an unbalanced force of `acceleration` times its mass for ever: forces in a sleeping bed are
/// known up to that, and creep that is slower than `speed` is not seen.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SleepSettings {
    /// Speed below which a particle may be calm [m/s].
    pub speed: f64,
    /// How long it must be [s].
    pub hold: f64,
    /// Unbalanced acceleration at which a sleeper wakes [m/s2].
    pub acceleration: f64,
}

/// How often within the hold time a particle is looked at.
const LOOKS_PER_HOLD: u8 = 8;
/// Fewest time steps between two looks, as lists may be made anew at each of them.
const LEAST_STEPS: f64 = 16.0;

impl SleepSettings {
    /// Time steps of `timestep` [s] between two looks at who is calm.
    #[must_use]
    pub fn look_every(&self, timestep: f64) -> u64 {
        (self.hold / timestep / f64::from(LOOKS_PER_HOLD)).ceil().max(LEAST_STEPS) as u64
    }

    /// Whether a sleeper of `radius` [m] wakes that would be accelerated so.
    #[must_use]
    pub fn wakes(&self, acceleration: &Acceleration, radius: f64) -> bool {
        exceeds(&acceleration.linear, &acceleration.angular, radius, self.acceleration)
    }

    /// Whether a particle is calm.
    fn is_calm(&self, velocity: &Velocity, acceleration: &Acceleration, radius: f64) -> bool {
        let half = 0.5 * self.acceleration;
        Vec3::from(velocity.linear).norm_squared() <= self.speed * self.speed
            && !exceeds(&acceleration.linear, &acceleration.angular, radius, half)
    }
}

/// Whether a vector, or another one times the radius, is longer than `limit`.
fn exceeds(linear: &Vec3, angular: &Vec3, radius: f64, limit: f64) -> bool {
    let square = limit * limit;
    linear.norm_squared() > square || angular.norm_squared() * radius * radius > square
}

/// How often anybody fell asleep or woke: while it is the same number, the same particles sleep.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct SleepChanges(u64);

/// What is known of a chunk's rest.
#[derive(Debug, Clone, Copy, Default)]
pub struct ChunkRest {
    /// State of everybody's sleep at which the chunk's loads came from sleepers and standing parts alone.
    still_at: Option<SleepChanges>,
    /// Whether its loads are those of the step before, since they cannot be others.
    pub(super) skipped: bool,
    /// Sum of the loads and weights of its sleepers [N].
    pub(super) unbalanced: Vec3,
}

impl Chunk {
    /// Whether the chunk's loads cannot have changed since they were computed.
    pub(super) fn is_still(&self, changes: SleepChanges) -> bool {
        self.rest.still_at == Some(changes)
            && self.own.resting.is_complete()
            && self.cross.resting.is_complete()
            && self.walls.were_seen
    }

    /// Notes, loads computed, whether they can change.
    pub(super) fn note_rest(&mut self, changes: SleepChanges, velocities: &[Velocity], walls: &Walls) {
        self.walls.were_seen = true;
        let asleep = |velocity: &Velocity| velocity.path == Path::Asleep;
        let still = self.own.resting.is_complete()
            && self.cross.resting.is_complete()
            && velocities[self.range.clone()].iter().all(asleep)
            && self.walls.parts().all(|part| walls.stands(part));
        self.rest.still_at = still.then_some(changes);
    }
}

impl Simulation {
    /// At fixed steps, looks who is calm, and lays down who has been for long enough. What they lose of their motion is booked.
    pub(super) fn lay_to_sleep(&mut self) {
        let Some(settings) = self.setup.sleeping else { return };
        if !self.steps.is_multiple_of(settings.look_every(self.setup.timestep)) {
            return;
        }
        let started = Instant::now();
        self.particles.calm_looks.resize(self.particles.len(), 0);
        for index in 0..self.particles.len() {
            let ((velocity, acceleration), sphere) = (self.particles.motion(index), &self.particles.spheres[index]);
            let calm = velocity.path == Path::Free && settings.is_calm(&velocity, &acceleration, sphere.radius);
            let looks = &mut self.particles.calm_looks[index];
            *looks = if calm { *looks + 1 } else { 0 };
            if *looks > LOOKS_PER_HOLD {
                *looks = 0;
                self.lay_down(index);
            }
        }
        // Pairs at rest stand together in the lists, so that whole blocks of them are at rest.
        if self.neighborhood.lists_others_asleep(&self.sleepers()) {
            self.renew_lists();
        }
        self.phases.integration += started.elapsed();
    }

    /// Who sleeps; empty where nobody does.
    pub(super) fn sleepers(&self) -> Vec<bool> {
        let velocities = self.particles.laws_velocities();
        let asleep = |velocity: &Velocity| velocity.path == Path::Asleep;
        let some = self.setup.sleeping.is_some() && velocities.iter().any(asleep);
        if some { velocities.iter().map(asleep).collect() } else { Vec::new() }
    }

    fn lay_down(&mut self, index: usize) {
        let state = self.particles.state(index);
        let still = crate::particle::ParticleState { velocity: Vec3::zeros(), spin: Vec3::zeros(), ..state };
        self.booked.sleep += self.mechanical_energy_of(&state) - self.mechanical_energy_of(&still);
        self.note_sleeper(self.momentum_of(index));
        let velocity = &mut self.particles.velocities_mut()[index];
        (velocity.linear, velocity.angular, velocity.path) = ([0.0; 3], [0.0; 3], Path::Asleep);
        self.particles.accelerations_mut()[index] = Acceleration::ZERO;
        self.note_sleep_change();
    }

    /// Takes up what the chunks saw of their sleepers in a time step.
    pub(super) fn note_sleepers(&mut self, notes: &[StepNote]) {
        for (chunk, note) in self.neighborhood.chunks.iter_mut().zip(notes) {
            chunk.rest.unbalanced = note.unbalanced;
        }
        self.momentum.sleeper_force = notes.iter().map(|note| note.unbalanced).sum();
        if notes.iter().any(|note| note.woke) {
            self.note_sleep_change();
        }
    }

    /// Says that somebody fell asleep or woke.
    pub(super) const fn note_sleep_change(&mut self) {
        self.sleep_changes.0 += 1;
    }

    /// Wakes the particle stored at `index`, if it sleeps: something else than forces happens to it.
    pub(super) fn wake(&mut self, index: usize) {
        if self.particles.path(index) == Path::Asleep {
            self.particles.velocities_mut()[index].path = Path::Free;
            self.update_acceleration(index);
            self.momentum.regrouped = true;
            self.note_sleep_change();
        }
    }

    /// Sum of the loads and weights of all sleepers [N]: what being asleep takes up.
    pub(super) fn force_on_sleepers(&self) -> Vec3 {
        let asleep = |index: &usize| self.particles.path(*index) == Path::Asleep;
        let body = self.setup.body;
        let unbalanced = |index: usize| {
            body.in_plane(&(self.particles.loads()[index].force + self.setup.gravity * self.particles.mass(index)))
        };
        (0..self.particles.len()).filter(asleep).map(unbalanced).sum()
    }
}

/// Leaves a zero out of a record: one of a scene in which nobody sleeps is as it always was.
pub(super) fn is_zero<T: Default + PartialEq>(value: &T) -> bool {
    *value == T::default()
}

#[cfg(test)]
mod tests {
    use super::*;

    const SETTINGS: SleepSettings = SleepSettings { speed: 1e-3, hold: 0.01, acceleration: 0.1 };

    fn moving(linear: f64, angular: f64) -> Velocity {
        Velocity {
            linear: [0.0, linear, 0.0],
            inverse_mass: 1.0,
            angular: [angular, 0.0, 0.0],
            material: 0,
            path: Path::Free,
        }
    }

    fn pushed(linear: f64, angular: f64) -> Acceleration {
        Acceleration::new(Vec3::new(0.0, 0.0, linear), Vec3::new(0.0, angular, 0.0))
    }

    #[test]
    fn calm_is_slow_and_balanced_to_half_of_what_wakes() {
        let radius = 0.01;
        let calm = |velocity, acceleration| SETTINGS.is_calm(&velocity, &acceleration, radius);
        assert!(calm(moving(0.99e-3, 50.0), pushed(0.049, 4.9)));
        assert!(!calm(moving(1.01e-3, 0.0), pushed(0.0, 0.0)));
        assert!(!calm(moving(0.0, 0.0), pushed(0.051, 0.0)));
        assert!(!calm(moving(0.0, 0.0), pushed(0.0, 5.1)));
        assert!(!SETTINGS.wakes(&pushed(0.099, 9.9), radius));
        assert!(SETTINGS.wakes(&pushed(0.101, 0.0), radius) && SETTINGS.wakes(&pushed(0.0, 10.1), radius));
    }

    #[test]
    fn looks_share_the_hold_time_evenly_but_leave_lists_some_life() {
        assert_eq!(SETTINGS.look_every(1e-5), 125);
        assert_eq!(SETTINGS.look_every(1e-4), 16);
    }
}
