//! Prescribed particles: they act on others with their true mass in the pair law and are not acted upon.

use super::integrate::acceleration;
use super::particles::{Acceleration, Path};
use super::simulation::Simulation;
use crate::math::Vec3;
use crate::particle::{ParticleId, ParticleState};

/// A particle's motion at one full step, as somebody else knows it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PrescribedMotion {
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
}

/// Jump of a steered particle, over the smallest radius, up to which the work on its springs is known well enough from the force
/// before it: short beside usual overlaps.
const SHORT_JUMP: f64 = 1e-3;

/// Who is on a recorded path, looked up once for each making of the neighbour lists. Some may have left theirs since.
#[derive(Debug, Default)]
pub struct RecordedParticles {
    /// Making of the lists for which the indices hold.
    generation: Option<u64>,
    indices: Vec<usize>,
}

impl PrescribedMotion {
    /// The motion `timestep` [s] later if both accelerations stay as they are; the centre by the solver's own arithmetic.
    pub(super) fn move_on(&mut self, timestep: f64) {
        self.position += self.velocity * timestep + self.acceleration * (0.5 * timestep * timestep);
        self.velocity += self.acceleration * timestep;
        self.spin += self.spin_acceleration * timestep;
    }
}

impl Simulation {
    /// Adds particles on prescribed paths. The lists are made anew once, so many should come at a time.
    ///
    /// # Panics
    /// Where a path is not a prescribed one.
    pub fn insert_prescribed(&mut self, ghosts: &[(ParticleState, Path, PrescribedMotion)]) {
        if ghosts.is_empty() {
            return;
        }
        let body = self.setup.body;
        for (state, path, motion) in ghosts {
            assert!(path.is_prescribed(), "a particle inserted as prescribed follows a prescribed path");
            let PrescribedMotion { position, velocity, spin, .. } = *motion;
            self.particles.push(&ParticleState { position, velocity, spin, ..*state }, body);
            let last = self.particles.len() - 1;
            self.particles.velocities_mut()[last].path = *path;
            self.particles.accelerations_mut()[last] =
                Acceleration::new(body.in_plane(&motion.acceleration), body.about_plane(&motion.spin_acceleration));
            self.update_acceleration(last);
        }
        self.momentum.regrouped = true;
        self.watchdog.expect_new_energy();
        self.rebuild_neighborhood();
        if self.terms.energy {
            let ids: Vec<ParticleId> = ghosts.iter().map(|(state, ..)| state.id).collect();
            let marked = self.marks(self.indices_of(&ids).all());
            self.book_springs(&marked, 0.0);
        }
    }

    /// Puts particles on a prescribed path: free ones are frozen, prescribed ones change their path. One that is to follow a
    /// recorded path keeps its acceleration until it is steered. Unknown identities are left out.
    ///
    /// # Panics
    /// Where `path` is not a prescribed one; [`Simulation::release`] frees.
    pub fn prescribe(&mut self, ids: &[ParticleId], path: Path) {
        assert!(path.is_prescribed(), "particles are put on prescribed paths here and released elsewhere");
        let indices: Vec<usize> = self.indices_of(ids).all().collect();
        if indices.is_empty() {
            return;
        }
        let marked = self.marks(indices.iter().copied());
        let springs = self.springs_of(&marked);
        let mut tether_cut = false;
        self.recorded.generation = None;
        for index in indices {
            self.wake(index);
            let before = self.particles.path(index);
            if !before.is_prescribed() {
                // A prescribed particle's own energy and momentum are outside of the budgets.
                self.booked.removed += self.mechanical_energy_of(&self.particles.state(index));
                self.note_goer(self.momentum_of(index));
            }
            tether_cut |= before == Path::Tethered;
            self.particles.velocities_mut()[index].path = path;
            self.neighborhood.note_prescribed(index);
            self.update_acceleration(index);
        }
        if tether_cut {
            self.drop_tethers(&marked);
        }
        // Contacts with parts exist for free particles only.
        let particles = &self.particles;
        self.neighborhood.forget_wall_contacts(|contact| particles.path(contact.particle as usize).is_prescribed());
        self.book_springs(&marked, springs);
        self.watchdog.expect_new_energy();
    }

    /// Puts every particle on a recorded path, and the path of every tether, where `motion` says it is at the present full step.
    /// One of which nothing is said goes on with the acceleration it has.
    ///
    /// With the recorded bits of place, velocity, spin and both accelerations at every step, the next step's places and the
    /// velocities that the contact laws see are the recorded run's, to the last bit. A jump farther than the neighbour skin makes
    /// contacts whose springs the energy budget does not see.
    pub fn steer(&mut self, mut motion: impl FnMut(ParticleId) -> Option<PrescribedMotion>) {
        self.find_recorded();
        let mut steered = Vec::with_capacity(self.recorded.indices.len());
        for &index in &self.recorded.indices {
            if self.particles.path(index) == Path::Recorded
                && let Some(motion) = motion(self.particles.ids[index])
            {
                steered.push((index, motion));
            }
        }
        self.place(&steered);
        for tether in &mut self.tethers {
            if let Some(motion) = motion(tether.id) {
                tether.target = motion;
            }
        }
    }

    /// Renews the list of particles on recorded paths where the order of storage has changed or somebody may have joined them.
    fn find_recorded(&mut self) {
        let generation = Some(self.neighborhood.generation());
        if self.recorded.generation != generation {
            let recorded = (0..self.particles.len()).filter(|&index| self.particles.path(index) == Path::Recorded);
            self.recorded = RecordedParticles { generation, indices: recorded.collect() };
        }
    }

    /// Puts prescribed particles (by storage index) where they are said to be, and books what that does to the others.
    pub(super) fn place(&mut self, motions: &[(usize, PrescribedMotion)]) {
        let mut jumps = Vec::new();
        let mut farthest = 0.0_f64;
        for (index, motion) in motions {
            let here = self.particles.spheres[*index].position();
            let there = self.nearest_image(&self.setup.body.in_plane(&motion.position), &here);
            if there != here {
                jumps.push((*index, there));
                farthest = farthest.max((there - here).norm());
            }
            self.place_velocity(*index, motion);
        }
        if jumps.is_empty() {
            return;
        }
        let marked = if self.terms.energy { self.marks(jumps.iter().map(|(index, _)| *index)) } else { Vec::new() };
        let springs = self.springs_of(&marked);
        for (index, there) in jumps {
            if !self.terms.energy {
                // The watchdog's balance is to know a short jump to first order.
                let way = there - self.particles.spheres[index].position();
                self.booked.prescribed_work -= self.particles.loads()[index].force.dot(&way);
            }
            self.particles.spheres[index].centre = there.into();
        }
        self.book_springs(&marked, springs);
        if !self.terms.energy && farthest > SHORT_JUMP * self.neighborhood.smallest_radius() {
            self.watchdog.expect_new_energy();
        }
        self.neighborhood.wear.note_motion(farthest, 0.0);
    }

    /// Velocity, spin and accelerations of a prescribed particle. What its contacts did in the last step was booked at the
    /// velocity it was thought to have.
    fn place_velocity(&mut self, index: usize, motion: &PrescribedMotion) {
        let (dt, body) = (self.setup.timestep, self.setup.body);
        let velocity = &mut self.particles.velocities_mut()[index];
        let (linear, angular) = (body.in_plane(&motion.velocity), body.about_plane(&motion.spin));
        let late = (linear - Vec3::from(velocity.linear), angular - Vec3::from(velocity.angular));
        (velocity.linear, velocity.angular) = (linear.into(), angular.into());
        self.particles.accelerations_mut()[index] =
            Acceleration::new(body.in_plane(&motion.acceleration), body.about_plane(&motion.spin_acceleration));
        let load = &self.particles.loads()[index];
        let work = (load.force.dot(&late.0) + load.torque.dot(&late.1)) * dt;
        self.booked.prescribed_work -= work;
        // Springs are known until the lists are made anew; then the correction, of second order in dt, is left out.
        if let Some(spring) = self.normal_springs(index) {
            self.booked.dashpot -= work - spring.dot(&late.0) * dt;
        }
    }

    /// Force of the normal springs on a particle at the last time step [N], where losses are accounted for.
    fn normal_springs(&self, index: usize) -> Option<Vec3> {
        let chunk = &self.neighborhood.chunks[self.neighborhood.chunk_of(index)];
        chunk.springs.get(index - chunk.range.start).copied()
    }

    /// Acceleration [m/s2] that follows from a particle's path and load.
    pub(super) fn update_acceleration(&mut self, index: usize) {
        let particles = &self.particles;
        let (velocity, held) = particles.motion(index);
        let (load, radius) = (&particles.loads()[index], particles.spheres[index].radius);
        let now = acceleration(load, &velocity, radius, &held, &self.setup.gravity, self.setup.body);
        self.particles.accelerations_mut()[index] = now;
    }

    /// Books that a particle has become free: energy of motion and height, and momentum.
    pub(super) fn book_comer(&mut self, index: usize) {
        self.booked.inserted += self.mechanical_energy_of(&self.particles.state(index));
        self.note_comer(self.momentum_of(index));
        self.watchdog.expect_new_energy();
    }

    /// Books what the springs of the marked particles have gained since they held `before` [J].
    pub(super) fn book_springs(&mut self, marked: &[bool], before: f64) {
        if self.terms.energy {
            let gained = self.springs_of(marked) - before;
            self.booked.inserted += gained.max(0.0);
            self.booked.removed -= gained.min(0.0);
        }
    }

    /// Forgets the tethers of the marked particles.
    fn drop_tethers(&mut self, marked: &[bool]) {
        let ids: Vec<ParticleId> =
            self.particles.ids.iter().zip(marked).filter(|(_, marked)| **marked).map(|(id, _)| *id).collect();
        self.tethers.retain(|tether| !ids.contains(&tether.id));
    }

    /// `place` [m], moved by whole lengths of periodic axes to be as close as possible to `reference` [m].
    pub(super) fn nearest_image(&self, place: &Vec3, reference: &Vec3) -> Vec3 {
        let mut nearest = *place;
        for axis in (0..3).filter(|&axis| self.setup.periodic[axis]) {
            let length = self.setup.domain.maximum[axis] - self.setup.domain.minimum[axis];
            let turns = ((reference[axis] - place[axis]) / length).round();
            if turns != 0.0 {
                nearest[axis] += turns * length;
            }
        }
        nearest
    }
}
