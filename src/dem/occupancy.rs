//! Where the solver has room for a new particle.

use super::feed::runner::Occupancy;
use super::neighborhood::Neighborhood;
use super::particles::Particles;
use super::wall::Walls;
use crate::math::Vec3;

/// The solver's particles and parts as a feed sees them.
#[derive(Debug)]
pub struct SolverOccupancy<'a> {
    /// Particles.
    pub particles: &'a Particles,
    /// Their cells.
    pub neighborhood: &'a Neighborhood,
    /// Parts.
    pub walls: &'a Walls,
}

impl Occupancy for SolverOccupancy<'_> {
    fn is_free(&self, centre: &Vec3, radius: f64) -> bool {
        let spheres = &self.particles.spheres;
        let mut free = true;
        self.neighborhood.for_each_near(centre, radius, |member, offset| {
            let other = &spheres[member as usize];
            let reach = radius + other.radius;
            free &= (other.position() + offset - centre).norm_squared() >= reach * reach;
        });
        if !free {
            return false;
        }
        let (mut near, mut points) = (Vec::new(), Vec::new());
        self.walls.candidates(centre, radius, &mut near);
        self.walls.contacts(&near, centre, radius, &mut points);
        points.is_empty()
    }
}
