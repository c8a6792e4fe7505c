//! Tethers: free particles bound to a recorded path by a spring that stiffens with distance.

use super::ghost::PrescribedMotion;
use super::particles::{Load, Path};
use super::simulation::Simulation;
use crate::math::Vec3;
use crate::particle::ParticleId;

/// Law of a tether: a = -w2 e (1 + (|e| / c)^2) - 2 sqrt(w2) (v - v_path), e = x - x_path.
///
/// a acceleration [m/s2], e excursion from the path [m], v velocity [m/s]. Critically damped for small excursions; beyond c
/// the spring is a hardening Duffing spring (Duffing 1918). It acts on the centre only: rotation is free.
/// Valid for w2 dt^2 (1 + 3 (|e| / c)^2) << 1, dt the time step [s]; the watchdog stops a run beyond [`STABLE`].
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TetherLaw {
    /// w2, the square of the angular frequency at small excursions [1/s2].
    pub frequency_squared: f64,
    /// c, the excursion at which the spring force has doubled its linear value [m].
    pub compliance: f64,
}

/// Largest w2 dt^2 (1 + 3 (|e| / c)^2) that is let pass. Velocity-Verlet alone bears 4 of an undamped spring; the dashpot, which
/// sees the estimated velocity v + a dt, needs 2 sqrt(w2) dt < 1, or 0.25 at e = 0. What is left is for the contacts.
pub const STABLE: f64 = 0.1;

impl TetherLaw {
    /// Acceleration [m/s2] at the excursion `excursion` [m] and the velocity relative to the path `velocity` [m/s].
    #[must_use]
    pub fn acceleration(&self, excursion: &Vec3, velocity: &Vec3) -> Vec3 {
        let stiffening = 1.0 + excursion.norm_squared() / (self.compliance * self.compliance);
        excursion * (-self.frequency_squared * stiffening) - velocity * (2.0 * self.frequency_squared.sqrt())
    }

    /// w2 dt^2 (1 + 3 (|e| / c)^2): the tangent stiffness at `excursion` [m] in units of the time step `timestep` [s].
    #[must_use]
    pub fn stiffness_number(&self, excursion: &Vec3, timestep: f64) -> f64 {
        let tangent = 1.0 + 3.0 * excursion.norm_squared() / (self.compliance * self.compliance);
        self.frequency_squared * timestep * timestep * tangent
    }
}

/// A tethered particle's tether.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Tether {
    /// The particle.
    pub id: ParticleId,
    /// Law.
    pub law: TetherLaw,
    /// The path now.
    pub target: PrescribedMotion,
    /// Force of the tether at the last time step [N].
    pub force: Vec3,
    /// Where the particle is stored, unless the order has changed since.
    index: usize,
    /// Within a time step: the velocity that the law saw [m/s], and the load without the tether [N].
    seen_velocity: Vec3,
    contact_force: Vec3,
}

impl Tether {
    /// A tether that holds nothing yet.
    #[must_use]
    pub const fn new(id: ParticleId, law: TetherLaw, target: PrescribedMotion, force: Vec3) -> Self {
        let none = Vec3::new(0.0, 0.0, 0.0);
        Self { id, law, target, force, index: 0, seen_velocity: none, contact_force: none }
    }
}

/// A tether too stiff for the time step.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct StiffTether {
    /// Storage index of the particle.
    pub particle: usize,
    /// Excursion [m].
    pub excursion: f64,
    /// w2 dt^2 (1 + 3 (e / c)^2) [-].
    pub number: f64,
}

impl Simulation {
    /// Binds particles on recorded paths to these paths by tethers: from now on they are free particles that meet parts and
    /// other prescribed particles too. Others are left as they are. [`Simulation::steer`] moves the paths on.
    pub fn tether(&mut self, ids: &[ParticleId], law: TetherLaw) {
        if !self.loads_known {
            // Else the loads at the start would take the place of the path's acceleration.
            self.prepare();
        }
        let found = self.indices_of(ids);
        let is_recorded = |index: &usize| self.particles.path(*index) == Path::Recorded;
        let indices: Vec<usize> = found.all().filter(is_recorded).collect();
        if indices.is_empty() {
            return;
        }
        let marked = self.marks(indices.iter().copied());
        let springs = self.springs_of(&marked);
        for index in indices {
            self.particles.velocities_mut()[index].path = Path::Tethered;
            let ((velocity, acceleration), sphere) = (self.particles.motion(index), self.particles.spheres[index]);
            // The path's acceleration stands for the contacts that made it, those with other prescribed particles included.
            let mass = 1.0 / velocity.inverse_mass;
            let inertia = self.setup.body.inertia_factor() * mass * sphere.radius * sphere.radius;
            let force = (acceleration.linear - self.setup.body.in_plane(&self.setup.gravity)) * mass;
            self.particles.loads_mut()[index] = Load::new(force, acceleration.angular * inertia);
            let target = PrescribedMotion {
                position: sphere.position(),
                velocity: Vec3::from(velocity.linear),
                spin: Vec3::from(velocity.angular),
                acceleration: acceleration.linear,
                spin_acceleration: acceleration.angular,
            };
            self.tethers.push(Tether::new(self.particles.ids[index], law, target, Vec3::zeros()));
            self.book_comer(index);
        }
        self.book_springs(&marked, springs);
    }

    /// Cuts the tethers of particles: from now on they are ordinary free particles, where they are.
    pub fn untether(&mut self, ids: &[ParticleId]) {
        let found = self.indices_of(ids);
        let is_tethered = |index: &usize| self.particles.path(*index) == Path::Tethered;
        let indices: Vec<usize> = found.all().filter(is_tethered).collect();
        for index in indices {
            let id = self.particles.ids[index];
            self.tethers.retain(|tether| tether.id != id);
            self.particles.velocities_mut()[index].path = Path::Free;
            self.update_acceleration(index);
        }
    }

    /// Adds the tethers' forces to the loads, the paths moved on to the end of the time step.
    pub(super) fn pull_tethers(&mut self) {
        if self.tethers.is_empty() {
            return;
        }
        self.find_tethered();
        let (dt, body) = (self.setup.timestep, self.setup.body);
        let mut tethers = std::mem::take(&mut self.tethers);
        let mut stiffest: Option<StiffTether> = None;
        for tether in &mut tethers {
            let index = tether.index;
            tether.target.move_on(dt);
            let position = self.particles.spheres[index].position();
            let excursion = position - self.nearest_image(&tether.target.position, &position);
            let velocity = Vec3::from(self.particles.velocity(index).linear);
            let acceleration = tether.law.acceleration(&excursion, &(velocity - tether.target.velocity));
            tether.force = body.in_plane(&acceleration) * self.particles.mass(index);
            tether.seen_velocity = velocity;
            let load = &mut self.particles.loads_mut()[index];
            tether.contact_force = load.force;
            load.force += tether.force;
            let number = tether.law.stiffness_number(&excursion, dt);
            if number > STABLE && stiffest.is_none_or(|held| number > held.number) {
                stiffest = Some(StiffTether { particle: index, excursion: excursion.norm(), number });
            }
        }
        self.tethers = tethers;
        if let Some(stiffest) = stiffest {
            self.watchdog.note_stiff_tether(stiffest);
        }
    }

    /// Takes the tethers' forces out of the loads again, velocities known, and books their work.
    pub(super) fn book_tethers(&mut self) {
        let dt = self.setup.timestep;
        for tether in &self.tethers {
            self.particles.loads_mut()[tether.index].force = tether.contact_force;
            let velocity = Vec3::from(self.particles.velocity(tether.index).linear);
            self.booked.tether_work += tether.force.dot(&velocity) * dt;
            if self.terms.energy {
                // The correction of the dashpots took the tether for a contact.
                self.booked.dashpot += tether.force.dot(&(velocity - tether.seen_velocity)) * dt;
            }
        }
    }

    /// Renews the tethers' storage indices where the order has changed.
    fn find_tethered(&mut self) {
        let ids = &self.particles.ids;
        if self.tethers.iter().all(|tether| ids.get(tether.index) == Some(&tether.id)) {
            return;
        }
        let wanted: Vec<ParticleId> = self.tethers.iter().map(|tether| tether.id).collect();
        let found = self.indices_of(&wanted);
        self.tethers.retain_mut(|tether| {
            let index = found.get(tether.id);
            tether.index = index.unwrap_or(0);
            index.is_some()
        });
    }
}
