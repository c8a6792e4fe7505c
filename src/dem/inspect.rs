//! Looking at a simulation without changing it.

use super::energy::EnergyBudget;
use super::meeting::ContactScene;
use super::particles::{Path, Velocity};
use super::seen::{SeenContact, look, overlap_ratio};
use super::simulation::Simulation;
use super::wall_contacts::look_at_walls;
use super::wall_list::WallList;
use crate::math::Vec3;
use crate::particle::{ParticleId, ParticleState};

/// The other body of a contact.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Partner {
    /// A particle.
    Particle(ParticleId),
    /// A part and its triangle.
    Part {
        /// Part.
        part: u16,
        /// Triangle of the part; 0 where it has none.
        element: u32,
    },
}

/// A contact at the present time.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ContactRecord {
    /// Body i.
    pub i: ParticleId,
    /// Body j.
    pub j: Partner,
    /// Contact point [m].
    pub point: Vec3,
    /// Unit normal from i to j.
    pub normal: Vec3,
    /// Overlap [m].
    pub overlap: f64,
    /// Force on i [N].
    pub force: Vec3,
}

/// How many contacts there are, and how deep.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct ContactSurvey {
    /// Number.
    pub count: u64,
    /// Largest overlap over the smaller radius [-].
    pub largest_overlap_ratio: f64,
}

impl ContactSurvey {
    fn add(&mut self, overlap_ratio: Option<f64>) {
        if let Some(ratio) = overlap_ratio {
            self.count += 1;
            self.largest_overlap_ratio = self.largest_overlap_ratio.max(ratio);
        }
    }
}

impl Simulation {
    /// All particles at the present time, by ascending identity.
    #[must_use]
    pub fn particles(&self) -> Vec<ParticleState> {
        let mut states: Vec<ParticleState> =
            (0..self.particles.len()).map(|index| self.particles.state(index)).collect();
        states.sort_by_key(|state| state.id);
        states
    }

    /// State, force [N] and torque [N m] by its contacts of a particle at the last time step.
    #[must_use]
    pub fn loaded_state(&self, id: ParticleId) -> Option<(ParticleState, Vec3, Vec3)> {
        let index = self.particles.ids.iter().position(|held| *held == id)?;
        let load = &self.particles.loads()[index];
        Some((self.particles.state(index), load.force, load.torque))
    }

    /// Number of particles.
    #[must_use]
    pub fn particle_count(&self) -> usize {
        self.particles.len()
    }

    /// Root-mean-square speed of the centres [m/s].
    #[must_use]
    pub fn rms_speed(&self) -> f64 {
        self.particles.rms_speed()
    }

    /// Force on particle `id` by its contacts at the last time step [N].
    #[must_use]
    pub fn contact_force(&self, id: ParticleId) -> Option<Vec3> {
        let index = self.particles.ids.iter().position(|held| *held == id)?;
        Some(self.particles.loads()[index].force)
    }

    /// All particles in the order of storage: state, force by the contacts at the last time step [N], and how each moves.
    pub fn stored_states(&self) -> impl ExactSizeIterator<Item = (ParticleState, Vec3, Path)> {
        let particles = &self.particles;
        let stored = |index| (particles.state(index), particles.loads()[index].force, particles.path(index));
        (0..particles.len()).map(stored)
    }

    /// Whether a part is there now.
    #[must_use]
    pub fn is_present(&self, part: u16) -> bool {
        self.walls.is_present(part)
    }

    /// True while a part waits for the particles to come to rest.
    #[must_use]
    pub fn awaits_rest(&self) -> bool {
        self.presence.awaits_rest()
    }

    /// What observers look at contacts with: they need no accelerations.
    pub(super) fn contact_scene<'a>(&'a self, velocities: &'a [Velocity]) -> ContactScene<'a> {
        ContactScene {
            spheres: &self.particles.spheres,
            velocities,
            accelerations: &[],
            law: &self.law,
            only_material: self.neighborhood.only_material,
            images: &self.neighborhood.images,
            remembers: self.terms.friction,
            timestep: self.setup.timestep,
            overlap_limit: self.setup.overlap_limit,
            inertia_factor: self.setup.body.inertia_factor(),
            sleeping: self.setup.sleeping.is_some(),
        }
    }

    /// Calls `visit` for every contact: (storage index of i, the other body, contact point [m], contact).
    pub(super) fn for_each_contact(&self, mut visit: impl FnMut(usize, Partner, Vec3, &SeenContact)) {
        let velocities = self.particles.velocities();
        let scene = self.contact_scene(&velocities);
        for chunk in &self.neighborhood.chunks {
            for (list, both) in [(&chunk.own, true), (&chunk.cross, false)] {
                for (entry, owner, candidate) in list.pairs() {
                    let index = owner as usize;
                    // A pair of two chunks stands in both: seen from its lower index.
                    let other = candidate.partner as usize;
                    let prescribed = |particle: usize| scene.velocities[particle].path.is_prescribed();
                    if (!both && other < index) || (prescribed(index) && prescribed(other)) {
                        continue;
                    }
                    if let Some(seen) = look(&scene, index, candidate, list.memory.get(entry).as_ref()) {
                        let partner = Partner::Particle(self.particles.ids[other]);
                        let point = scene.spheres[index].position() + seen.normal * seen.lever;
                        visit(index, partner, point, &seen);
                    }
                }
            }
            self.for_each_wall_contact(&scene, &chunk.walls, |_| true, &mut visit);
        }
    }

    /// Calls `visit` for every contact with a part of the particles that a list names and `concerned` picks, by ascending storage index.
    pub(super) fn for_each_wall_contact(
        &self,
        scene: &ContactScene,
        held: &WallList,
        concerned: impl Fn(usize) -> bool,
        visit: &mut impl FnMut(usize, Partner, Vec3, &SeenContact),
    ) {
        for index in held.particles(|index| concerned(index) && !scene.velocities[index].path.is_prescribed()) {
            look_at_walls(scene, &self.walls, index, held, |point, seen| {
                visit(index, Partner::Part { part: point.part, element: point.element }, point.point, seen);
            });
        }
    }

    /// All contacts at the present time, by i, then j.
    #[must_use]
    pub fn contacts(&self) -> Vec<ContactRecord> {
        let mut records = self.stored_contacts();
        records.sort_by_key(|record| (record.i, record.j));
        records
    }

    /// All contacts at the present time, in the order of the lists.
    #[must_use]
    pub fn stored_contacts(&self) -> Vec<ContactRecord> {
        let mut records = Vec::new();
        self.for_each_contact(|index, partner, point, seen| {
            let id = self.particles.ids[index];
            let mirrored = matches!(partner, Partner::Particle(other) if other < id);
            let sign = if mirrored { -1.0 } else { 1.0 };
            let (i, j) = match partner {
                Partner::Particle(other) if mirrored => (other, Partner::Particle(id)),
                _ => (id, partner),
            };
            records.push(ContactRecord {
                i,
                j,
                point,
                normal: seen.normal * sign,
                overlap: seen.overlap,
                force: seen.force * sign,
            });
        });
        records
    }

    /// Who touches whom: i and j of [`Simulation::contacts`], in the same order.
    #[must_use]
    pub fn touching(&self) -> Vec<(ParticleId, Partner)> {
        let mut touching = Vec::new();
        self.for_each_contact(|index, partner, _, _| {
            let id = self.particles.ids[index];
            touching.push(match partner {
                Partner::Particle(other) if other < id => (other, Partner::Particle(id)),
                _ => (id, partner),
            });
        });
        touching.sort_unstable();
        touching
    }

    /// Number and depth of all contacts at the present time, without their forces.
    #[must_use]
    pub fn contact_survey(&self) -> ContactSurvey {
        let mut survey = ContactSurvey::default();
        // How deep contacts are does not depend on velocities.
        let scene = self.contact_scene(self.particles.laws_velocities());
        let mut points = Vec::new();
        for chunk in &self.neighborhood.chunks {
            for (list, both) in [(&chunk.own, true), (&chunk.cross, false)] {
                // A pair of two chunks stands in both: counted at its lower index.
                for (_, owner, candidate) in list.pairs().filter(|(_, owner, other)| both || other.partner > *owner) {
                    survey.add(overlap_ratio(&scene, owner as usize, candidate));
                }
            }
            for (index, near) in chunk.walls.rows() {
                if !scene.velocities[index].path.is_prescribed() {
                    let sphere = &scene.spheres[index];
                    self.walls.contacts(near, &sphere.position(), sphere.radius, &mut points);
                    points.iter().for_each(|point| survey.add(Some(point.overlap / sphere.radius)));
                }
            }
        }
        survey
    }

    /// The energy budget at the present time. Losses are in it where they are accounted for.
    #[must_use]
    pub fn energy(&self) -> EnergyBudget {
        let mut budget = self.energy_without_springs();
        self.spring_energies().into_iter().flatten().for_each(|energy| budget.elastic += energy);
        budget
    }

    /// The energy budget less what the springs of contacts hold, which is what takes its time.
    #[must_use]
    pub fn energy_without_springs(&self) -> EnergyBudget {
        let mut budget = self.booked;
        let factor = self.setup.body.inertia_factor();
        for index in 0..self.particles.len() {
            let velocity = self.particles.velocity(index);
            if velocity.path.is_prescribed() {
                continue;
            }
            let (mass, sphere) = (self.particles.mass(index), &self.particles.spheres[index]);
            budget.kinetic += 0.5 * mass * Vec3::from(velocity.linear).norm_squared();
            let inertia = factor * mass * sphere.radius * sphere.radius;
            budget.rotational += 0.5 * inertia * Vec3::from(velocity.angular).norm_squared();
            budget.gravitational -= mass * self.setup.gravity.dot(&sphere.position());
        }
        budget
    }

    /// Energy [J] in the springs of the contacts that `concerned` picks.
    pub(super) fn spring_energy(&self, concerned: impl Fn(ParticleId, Partner) -> bool) -> f64 {
        let mut sum = 0.0;
        self.for_each_contact(|index, partner, _, seen| {
            if concerned(self.particles.ids[index], partner) {
                sum += seen.elastic_energy;
            }
        });
        sum
    }

    /// Energy of motion and height of a particle [J].
    pub(super) fn mechanical_energy_of(&self, state: &ParticleState) -> f64 {
        let mass = self.setup.body.mass(state.radius, state.density);
        let inertia = self.setup.body.inertia_factor() * mass * state.radius * state.radius;
        0.5 * mass * state.velocity.norm_squared() + 0.5 * inertia * state.spin.norm_squared()
            - mass * self.setup.gravity.dot(&state.position)
    }
}
