//! The contacts of chosen particles, with what is needed to continue them elsewhere.

use super::inspect::Partner;
use super::neighbor::list::{Candidate, Images, Memory};
use super::neighborhood::Chunk;
use super::particles::Path;
use super::seen::{SeenContact, look};
use super::simulation::Simulation;
use crate::math::Vec3;
use crate::particle::ParticleId;

/// A contact as seen from one of its particles, at the present full step.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct HeldContact {
    /// The other body.
    pub partner: Partner,
    /// Contact point [m].
    pub point: Vec3,
    /// Unit normal towards the other body [-].
    pub normal: Vec3,
    /// Overlap [m].
    pub overlap: f64,
    /// Normal force on the particle [N].
    pub normal_force: Vec3,
    /// Tangential force on the particle [N].
    pub tangential_force: Vec3,
    /// Memory as the solver keeps it, half a time step ahead.
    pub memory: Memory,
}

/// A contact between a prescribed and a free particle.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct GhostContact {
    /// The prescribed particle.
    pub ghost: ParticleId,
    /// The free one.
    pub resident: ParticleId,
    /// Overlap over the smaller radius [-].
    pub overlap_ratio: f64,
    /// The smaller of the two radii [m].
    pub smaller_radius: f64,
    /// Contact point [m].
    pub point: Vec3,
    /// Velocity of the prescribed one [m/s].
    pub ghost_velocity: Vec3,
    /// Velocity of the free one [m/s].
    pub resident_velocity: Vec3,
    /// Normal force on the free one [N].
    pub normal_force: Vec3,
}

impl HeldContact {
    fn new(partner: Partner, point: Vec3, seen: &SeenContact) -> Self {
        let normal_force = seen.normal * -seen.normal_force;
        Self {
            partner,
            point,
            normal: seen.normal,
            overlap: seen.overlap,
            normal_force,
            tangential_force: seen.force - normal_force,
            memory: seen.kept,
        }
    }
}

impl Simulation {
    /// Contacts of the particles `ids`, each seen from that particle, sorted by partner; in the order of `ids`. Unknown
    /// identities are left out. A prescribed particle has contacts with free particles only: ask before it is frozen.
    #[must_use]
    pub fn contacts_of(&self, ids: &[ParticleId]) -> Vec<(ParticleId, Vec<HeldContact>)> {
        if ids.is_empty() {
            return Vec::new();
        }
        let found = self.indices_of(ids);
        let mut slot_of: Vec<(usize, usize)> = Vec::with_capacity(ids.len());
        let mut lists: Vec<(ParticleId, Vec<HeldContact>)> = Vec::with_capacity(ids.len());
        for id in ids {
            if let Some(index) = found.get(*id) {
                slot_of.push((index, lists.len()));
                lists.push((*id, Vec::new()));
            }
        }
        slot_of.sort_unstable();
        slot_of.dedup_by_key(|(index, _)| *index);
        let slot = |index: usize| slot_of.binary_search_by_key(&index, |(held, _)| *held).ok().map(|n| slot_of[n].1);
        let marked = self.marks(slot_of.iter().map(|(index, _)| *index));
        self.for_each_contact_of(&marked, |index, other, point, seen| {
            if let Some(slot) = slot(index) {
                lists[slot].1.push(HeldContact::new(other.0, point, seen));
            }
        });
        lists.iter_mut().for_each(|(_, contacts)| contacts.sort_by_key(|contact| contact.partner));
        lists
    }

    /// Contacts of prescribed with free particles (tethered ones apart), sorted by identity.
    #[must_use]
    pub fn ghost_pressure(&self) -> Vec<GhostContact> {
        let particles = &self.particles;
        let prescribed: Vec<bool> = (0..particles.len()).map(|index| particles.path(index).is_prescribed()).collect();
        let mut contacts = Vec::new();
        self.for_each_contact_of(&prescribed, |index, (partner, other), point, seen| {
            let (Partner::Particle(resident), Some(other)) = (partner, other) else { return };
            if !matches!(particles.path(other), Path::Free | Path::Asleep) {
                return;
            }
            let radius = |index: usize| particles.spheres[index].radius;
            contacts.push(GhostContact {
                ghost: particles.ids[index],
                resident,
                overlap_ratio: seen.overlap / radius(index).min(radius(other)),
                smaller_radius: radius(index).min(radius(other)),
                point,
                ghost_velocity: Vec3::from(particles.velocity(index).linear),
                resident_velocity: Vec3::from(particles.velocity(other).linear),
                normal_force: seen.normal * seen.normal_force,
            });
        });
        contacts.sort_by_key(|contact| (contact.ghost, contact.resident));
        contacts
    }

    /// True at the storage indices given.
    pub(super) fn marks(&self, indices: impl Iterator<Item = usize>) -> Vec<bool> {
        let mut marked = vec![false; self.particles.len()];
        indices.for_each(|index| marked[index] = true);
        marked
    }

    /// Calls `visit` for every contact of the marked particles, seen from them: (storage index, (the other body, its storage
    /// index where it is a particle), contact point [m], contact). A contact of two marked particles is seen from both.
    /// Only chunks that hold a marked particle are looked at.
    pub(super) fn for_each_contact_of(
        &self,
        marked: &[bool],
        mut visit: impl FnMut(usize, (Partner, Option<usize>), Vec3, &SeenContact),
    ) {
        let velocities = self.particles.velocities();
        let scene = self.contact_scene(&velocities);
        let mut see = |index: usize, candidate: Candidate, kept: Memory| {
            let other = candidate.partner as usize;
            let prescribed = |particle: usize| scene.velocities[particle].path.is_prescribed();
            if prescribed(index) && prescribed(other) {
                return;
            }
            if let Some(seen) = look(&scene, index, candidate, Some(&kept)) {
                let point = scene.spheres[index].position() + seen.normal * seen.lever;
                visit(index, (Partner::Particle(self.particles.ids[other]), Some(other)), point, &seen);
            }
        };
        let concerned = |chunk: &&Chunk| marked[chunk.range.clone()].contains(&true);
        for chunk in self.neighborhood.chunks.iter().filter(concerned) {
            for (list, both) in [(&chunk.own, true), (&chunk.cross, false)] {
                for (entry, owner, candidate) in list.pairs() {
                    let kept = || list.memory.get(entry).unwrap_or(Memory::NONE);
                    if marked[owner as usize] {
                        see(owner as usize, candidate, kept());
                    }
                    if both && marked[candidate.partner as usize] {
                        let back = Candidate { partner: owner, image: Images::opposite(candidate.image) };
                        see(candidate.partner as usize, back, kept().mirrored());
                    }
                }
            }
        }
        for chunk in self.neighborhood.chunks.iter().filter(concerned) {
            self.for_each_wall_contact(
                &scene,
                &chunk.walls,
                |index| marked[index],
                &mut |index, partner, point, seen| {
                    visit(index, (partner, None), point, seen);
                },
            );
        }
    }

    /// Energy [J] in the springs of the marked particles' contacts; not looked at where losses are not accounted for.
    pub(super) fn springs_of(&self, marked: &[bool]) -> f64 {
        let mut sum = 0.0;
        if self.terms.energy {
            self.for_each_contact_of(marked, |index, (_, other), _, seen| {
                // Two marked particles see their contact twice.
                if other.is_none_or(|other| !marked[other] || index < other) {
                    sum += seen.elastic_energy;
                }
            });
        }
        sum
    }
}
