//! Particles as an observer sees them after a time step.

use super::particles::Path;
use super::simulation::Simulation;
use crate::math::Vec3;
use crate::particle::ParticleId;
use std::ops::RangeInclusive;

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

/// Distance from a plane [m] of a point of each particle that lies a share of the radius beside the centre.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PlaneDistance {
    /// Unit normal.
    normal: Vec3,
    /// Distance of the plane from the origin along the normal [m].
    offset: f64,
    /// How far the point lies along the normal, per radius.
    per_radius: f64,
}

impl PlaneDistance {
    /// From the plane through `point` [m] with the unit `normal`, of the points that lie `per_radius` radii along it.
    #[must_use]
    pub fn new(point: &Vec3, normal: &Vec3, per_radius: f64) -> Self {
        Self { normal: *normal, offset: point.dot(normal), per_radius }
    }

    /// That of a particle.
    fn of(&self, centre: &Vec3, radius: f64) -> f64 {
        centre.dot(&self.normal) - self.offset + radius * self.per_radius
    }
}

/// Who may be in a zone along a plane: looked up once for each making of the neighbour lists, with room for the motion until
/// the next one, so that a time step looks at few particles only.
#[derive(Debug, Clone)]
pub struct NearPlane {
    plane: PlaneDistance,
    range: RangeInclusive<f64>,
    /// Storage indices, ascending.
    members: Vec<usize>,
    /// Making of the lists for which they hold, and the motion [m] since then up to which they do.
    generation: Option<u64>,
    margin: f64,
}

impl NearPlane {
    /// The zone of the distances `range` [m].
    #[must_use]
    pub const fn new(plane: PlaneDistance, range: RangeInclusive<f64>) -> Self {
        Self { plane, range, members: Vec::new(), generation: None, margin: 0.0 }
    }

    /// What the distance is measured from.
    #[must_use]
    pub const fn plane(&self) -> &PlaneDistance {
        &self.plane
    }
}

impl Simulation {
    /// All particles in the order of storage, which changes whenever the neighbour lists are made anew.
    pub fn views(&self) -> impl Iterator<Item = ParticleView> + '_ {
        (0..self.particles.len()).map(|index| self.view(index))
    }

    /// Particles at a distance from a plane, in the order of storage, found by their places alone.
    pub fn views_at<'a>(
        &'a self,
        plane: &'a PlaneDistance,
        range: RangeInclusive<f64>,
    ) -> impl Iterator<Item = ParticleView> + 'a {
        let spheres = self.particles.spheres.iter().enumerate();
        spheres
            .filter(move |(_, sphere)| range.contains(&plane.of(&sphere.position(), sphere.radius)))
            .map(|(index, _)| self.view(index))
    }

    /// At least all particles of the zone, in the order of storage; few others.
    pub fn views_near<'a>(&'a self, zone: &'a mut NearPlane) -> impl Iterator<Item = ParticleView> + 'a {
        let neighborhood = &self.neighborhood;
        let moved = neighborhood.wear.since_outer;
        if zone.generation != Some(neighborhood.generation()) || moved > zone.margin {
            // The skin: lists are made anew before anybody has moved that far. Only a jump can be wider.
            let margin = neighborhood.settings().skin.max(2.0 * moved);
            let centres = neighborhood.outer_reference.iter().zip(&self.particles.spheres).enumerate();
            let (from, to) = (zone.range.start() - margin, zone.range.end() + margin);
            let near = centres.filter_map(|(index, (centre, sphere))| {
                let distance = zone.plane.of(&Vec3::from(*centre), sphere.radius);
                (from..=to).contains(&distance).then_some(index)
            });
            zone.members = near.collect();
            (zone.generation, zone.margin) = (Some(neighborhood.generation()), margin);
        }
        zone.members.iter().map(|&index| self.view(index))
    }

    fn view(&self, index: usize) -> ParticleView {
        let particles = &self.particles;
        let (sphere, load) = (&particles.spheres[index], &particles.loads()[index]);
        let (velocity, acceleration) = particles.motion(index);
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
