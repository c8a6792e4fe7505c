//! Looking at, and steering, a simulation after every time step; particles on prescribed paths.

use super::inspect::Partner;
use super::particles::Path;
use super::simulation::Simulation;
use super::step::acceleration;
use super::watchdog::Stop;
use crate::math::Vec3;
use crate::particle::ParticleId;

/// Is called after every time step, in the order in which observers were given.
pub trait StepObserver {
    /// Looks at the simulation, and may insert, remove, prescribe and release particles.
    ///
    /// # Errors
    /// To end the run.
    fn observe(&mut self, simulation: &mut Simulation) -> Result<(), Stop>;
}

impl Simulation {
    /// Puts a particle on a prescribed path, or frees it (`Path::Free`). Returns false where there is no such particle.
    ///
    /// A prescribed particle acts on others with its true mass in the pair law and is not acted upon.
    pub fn prescribe(&mut self, id: ParticleId, path: Path) -> bool {
        let Some(index) = self.particles.ids.iter().position(|held| *held == id) else { return false };
        let state = self.particles.state(index);
        let mechanical = self.mechanical_energy_of(&state);
        let was_free = self.particles.velocities[index].path == Path::Free;
        // Contacts with parts and with other prescribed particles exist for a free particle only.
        let springs_before = self.springs_of(id);
        // A prescribed particle's own energy is outside of the budget.
        match (was_free, path == Path::Free) {
            (true, false) => self.booked.removed += mechanical,
            (false, true) => self.booked.inserted += mechanical,
            _ => {}
        }
        self.particles.velocities[index].path = path;
        if path != Path::Free {
            self.neighborhood.forget_wall_contacts(|contact| contact.particle as usize == index);
        }
        self.particles.accelerations[index] = acceleration(
            &self.particles.loads[index],
            &self.particles.velocities[index],
            self.particles.spheres[index].radius,
            &self.setup.gravity,
            self.setup.body,
        );
        let gained = self.springs_of(id) - springs_before;
        self.booked.inserted += gained.max(0.0);
        self.booked.removed -= gained.min(0.0);
        self.watchdog.expect_new_energy();
        true
    }

    /// Energy [J] in the springs of a particle's contacts; not looked at where losses are not accounted for.
    fn springs_of(&self, id: ParticleId) -> f64 {
        if self.terms.energy { self.spring_energy(|i, j| i == id || j == Partner::Particle(id)) } else { 0.0 }
    }

    /// Sets place [m], velocity [m/s] and spin [rad/s] of a prescribed particle. Returns false where there is no such particle.
    /// A jump in place changes the springs of its contacts; the energy budget does not see that.
    pub fn place_prescribed(&mut self, id: ParticleId, position: Vec3, velocity: Vec3, spin: Vec3) -> bool {
        let Some(index) = self.particles.ids.iter().position(|held| *held == id) else { return false };
        if self.particles.velocities[index].path == Path::Free {
            return false;
        }
        let moved = (position - self.particles.spheres[index].position()).norm();
        self.particles.spheres[index].centre = position.into();
        self.particles.velocities[index].linear = velocity.into();
        self.particles.velocities[index].angular = spin.into();
        self.neighborhood.note_motion(moved, 0.0);
        self.watchdog.expect_new_energy();
        true
    }
}
