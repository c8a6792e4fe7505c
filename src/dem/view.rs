//! Particles as an observer sees them after a time step.

use super::particles::Path;
use super::simulation::Simulation;
use crate::math::Vec3;
use crate::particle::ParticleId;

/// A particle at the present full step, with all that its next step follows from.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ParticleView {
    /// Identity.
    pub id: ParticleId,
    /// Radius [m].
    pub radius: f64,
    /// Centre [m].
    pub position: Vec3,
    /// Velocity of the centre [m/s].
    pub velocity: Vec3,
    /// Own rotation [rad/s].
    pub spin: Vec3,
    /// Acceleration of the centre [m/s2].
    pub acceleration: Vec3,
    /// Acceleration of the rotation [rad/s2].
    pub spin_acceleration: Vec3,
    /// Force by its contacts [N]; that of a tether is not in it.
    pub force: Vec3,
    /// Torque about its centre by its contacts [N m].
    pub torque: Vec3,
    /// How it moves.
    pub path: Path,
}

impl Simulation {
    /// All particles in the order of storage, which changes whenever the neighbour lists are made anew.
    pub fn views(&self) -> impl Iterator<Item = ParticleView> + '_ {
        (0..self.particles.len()).map(|index| self.view(index))
    }

    fn view(&self, index: usize) -> ParticleView {
        let particles = &self.particles;
        let (sphere, velocity) = (&particles.spheres[index], &particles.velocities[index]);
        let (acceleration, load) = (&particles.accelerations[index], &particles.loads[index]);
        ParticleView {
            id: particles.ids[index],
            radius: sphere.radius,
            position: sphere.position(),
            velocity: Vec3::from(velocity.linear),
            spin: Vec3::from(velocity.angular),
            acceleration: acceleration.linear,
            spin_acceleration: acceleration.angular,
            force: load.force,
            torque: load.torque,
            path: velocity.path,
        }
    }
}
