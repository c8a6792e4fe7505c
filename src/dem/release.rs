//! Prescribed particles become free where a record says they crossed.

use super::ghost::PrescribedMotion;
use super::inspect::Partner;
use super::lookup::Indices;
use super::neighbor::list::Memory;
use super::particles::{Load, Path};
use super::simulation::Simulation;
use super::wall::WallPoint;
use super::wall_list::WallContact;
use crate::math::Vec3;
use crate::particle::{ParticleId, ParticleState};

/// A particle that becomes free at the present full step, with all that its next step follows from.
#[derive(Debug, Clone, PartialEq)]
pub struct Arrival {
    /// State.
    pub state: ParticleState,
    /// Force by its contacts [N].
    pub force: Vec3,
    /// Torque by its contacts [N m].
    pub torque: Vec3,
    /// Its contacts, with their memory as the solver keeps it, seen from this particle.
    pub contacts: Vec<(Partner, Memory)>,
}

/// What became of the contacts of arrivals. Every contact is counted once.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct ReleaseCount {
    /// Contacts with particles still on prescribed paths: the stored memory was set.
    pub restored: u64,
    /// Contacts with free particles: the solver's own memory was kept.
    pub kept_by_solver: u64,
    /// Contacts whose partner is not here, or not within reach: nothing was set.
    pub without_partner: u64,
    /// Contacts with parts: the stored memory was set.
    pub with_parts: u64,
}

impl ReleaseCount {
    /// Adds what became of more arrivals.
    pub const fn add(&mut self, more: Self) {
        self.restored += more.restored;
        self.kept_by_solver += more.kept_by_solver;
        self.without_partner += more.without_partner;
        self.with_parts += more.with_parts;
    }
}

impl Simulation {
    /// Frees prescribed particles with exactly the state given; their acceleration follows from the force and torque given as
    /// it would have followed at the end of a time step. A particle that is not here is inserted; one that is free already,
    /// tethered or not, is left as it is.
    ///
    /// Memory is restored where it is this particle's part to bring it: with partners that are still prescribed, and with
    /// parts. The memory of a contact with a free partner is the solver's own.
    pub fn release(&mut self, arrivals: &[Arrival]) -> ReleaseCount {
        if arrivals.is_empty() {
            return ReleaseCount::default();
        }
        if !self.loads_known {
            // Else the loads at the start would be computed over what is set here.
            self.prepare();
        }
        self.bring_absent(arrivals);
        let ids: Vec<ParticleId> = arrivals.iter().map(|arrival| arrival.state.id).collect();
        let here = self.indices_of(&ids);
        let motion = |arrival: &Arrival| {
            let index = here.get(arrival.state.id)?;
            self.particles.path(index).is_prescribed().then(|| (index, motion_of(&arrival.state)))
        };
        let motions: Vec<_> = arrivals.iter().filter_map(motion).collect();
        self.place(&motions);
        // Lists that the jump has made too old would lack pairs that are to be given a memory.
        self.refresh_neighborhood();
        self.free(arrivals)
    }

    /// Inserts the particles that are not here, as prescribed ones.
    fn bring_absent(&mut self, arrivals: &[Arrival]) {
        let ids: Vec<ParticleId> = arrivals.iter().map(|arrival| arrival.state.id).collect();
        let here = self.indices_of(&ids);
        let absent = arrivals.iter().filter(|arrival| here.get(arrival.state.id).is_none());
        let ghosts: Vec<_> = absent.map(|arrival| (arrival.state, Path::Recorded, motion_of(&arrival.state))).collect();
        self.insert_prescribed(&ghosts);
    }

    fn free(&mut self, arrivals: &[Arrival]) -> ReleaseCount {
        let mut ids: Vec<ParticleId> = Vec::new();
        for arrival in arrivals {
            ids.push(arrival.state.id);
            ids.extend(arrival.contacts.iter().filter_map(|(partner, _)| match partner {
                Partner::Particle(id) => Some(*id),
                Partner::Part { .. } => None,
            }));
        }
        let here = self.indices_of(&ids);
        let arriving = arrivals.iter().filter_map(|arrival| here.get(arrival.state.id));
        let marked = self.marks(arriving);
        let springs = self.springs_of(&marked);
        let mut count = ReleaseCount::default();
        for arrival in arrivals {
            let index = here.get(arrival.state.id).expect("the absent have been inserted");
            if !self.particles.path(index).is_prescribed() {
                continue;
            }
            self.particles.velocities_mut()[index].path = Path::Free;
            self.particles.loads_mut()[index] = Load::new(arrival.force, arrival.torque);
            self.update_acceleration(index);
            self.book_comer(index);
            self.restore_contacts(index, &arrival.contacts, &here, &mut count);
        }
        self.book_springs(&marked, springs);
        count
    }

    fn restore_contacts(
        &mut self,
        index: usize,
        contacts: &[(Partner, Memory)],
        here: &Indices,
        count: &mut ReleaseCount,
    ) {
        for (partner, memory) in contacts {
            if let Partner::Particle(id) = partner {
                match here.get(*id) {
                    Some(other) if !self.particles.path(other).is_prescribed() => count.kept_by_solver += 1,
                    Some(other) if self.neighborhood.remember(index, other, memory) => count.restored += 1,
                    _ => count.without_partner += 1,
                }
            }
        }
        self.restore_contacts_with_parts(index, contacts, count);
    }

    /// Contacts with parts go on at the points where the particle touches these parts now: on the same triangle, and what is left
    /// at any point left of the same part, which may be meshed otherwise where the record was made.
    fn restore_contacts_with_parts(&mut self, index: usize, contacts: &[(Partner, Memory)], count: &mut ReleaseCount) {
        let of_part = |(partner, memory): &(Partner, Memory)| match partner {
            Partner::Part { part, element } => Some((*part, *element, *memory)),
            Partner::Particle(_) => None,
        };
        let mut left: Vec<(u16, u32, Memory)> = contacts.iter().filter_map(of_part).collect();
        if left.is_empty() {
            return;
        }
        let mut points = self.points_on_parts(index);
        for same_triangle in [true, false] {
            left.retain(|(part, element, memory)| {
                let continues =
                    |point: &WallPoint| point.part == *part && (!same_triangle || point.element == *element);
                let Some(found) = points.iter().position(continues) else { return true };
                let point = points.remove(found);
                let contact = WallContact {
                    particle: index as u32,
                    part: *part,
                    element: point.element,
                    normal: point.normal,
                    memory: *memory,
                };
                self.neighborhood.remember_part(&self.walls, &contact);
                count.with_parts += 1;
                false
            });
        }
        count.without_partner += left.len() as u64;
    }

    /// Where particle `index` touches parts.
    fn points_on_parts(&self, index: usize) -> Vec<WallPoint> {
        let sphere = &self.particles.spheres[index];
        let (mut near, mut points) = (Vec::new(), Vec::new());
        self.walls.candidates(&sphere.position(), sphere.radius, &mut near);
        self.walls.contacts(&near, &sphere.position(), sphere.radius, &mut points);
        points
    }
}

/// The state as a motion; the acceleration follows once the particle is free.
const fn motion_of(state: &ParticleState) -> PrescribedMotion {
    PrescribedMotion {
        position: state.position,
        velocity: state.velocity,
        spin: state.spin,
        acceleration: Vec3::new(0.0, 0.0, 0.0),
        spin_acceleration: Vec3::new(0.0, 0.0, 0.0),
    }
}
