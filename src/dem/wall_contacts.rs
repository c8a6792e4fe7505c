//! Contacts between particles and parts.

use super::contact::{Answer, Touch, answer};
use super::energy::{DeepContact, Tally};
use super::law::{Compatibility, NormalMotion};
use super::neighbor::list::Memory;
use super::pair_contacts;
use super::pair_contacts::{ContactScene, SeenContact, left_in_spring};
use super::particles::{Load, Sphere};
use super::wall::{Candidate, WallPoint, Walls};
use crate::math::Vec3;

/// What the particles do to a part.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct PartLoad {
    /// Force [N].
    pub force: Vec3,
    /// Torque about the plant's origin [N m].
    pub torque: Vec3,
    /// Power that the particles put into the part's motion [W].
    pub power: f64,
}

impl PartLoad {
    /// Adds another load on the same part.
    pub fn add(&mut self, other: &Self) {
        self.force += other.force;
        self.torque += other.torque;
        self.power += other.power;
    }
}

/// Elements near each particle of a chunk; particles with none have no row.
#[derive(Debug, Clone, Default)]
pub struct WallCandidates {
    /// (storage index, first candidate, one past the last).
    rows: Vec<(u32, u32, u32)>,
    candidates: Vec<Candidate>,
}

impl WallCandidates {
    /// Collects every element within `skin` [m] of the surface of the particles in `range`.
    #[must_use]
    pub fn collect(spheres: &[Sphere], walls: &Walls, range: std::ops::Range<usize>, skin: f64) -> Self {
        let mut result = Self::default();
        let mut found = Vec::new();
        for index in range {
            let sphere = &spheres[index];
            walls.candidates(&sphere.position(), sphere.radius + skin, &mut found);
            result.push(index, &found);
        }
        result
    }

    /// Adds the elements near the particle stored at `index`, which follows all that are here.
    pub fn push(&mut self, index: usize, found: &[Candidate]) {
        if !found.is_empty() {
            let from = self.candidates.len() as u32;
            self.candidates.extend_from_slice(found);
            self.rows.push((index as u32, from, self.candidates.len() as u32));
        }
    }

    /// The particles, by storage index, and the elements near each.
    pub fn rows(&self) -> impl Iterator<Item = (usize, &[Candidate])> {
        self.rows.iter().map(|&(index, from, to)| (index as usize, &self.candidates[from as usize..to as usize]))
    }
}

/// A contact with a part that lasts, with its memory. Sorted by particle.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct WallContact {
    /// Storage index of the particle.
    pub particle: u32,
    /// Part.
    pub part: u16,
    /// Triangle touched last.
    pub element: u32,
    /// Normal at the last time step.
    pub normal: Vec3,
    /// Memory.
    pub memory: Memory,
}

/// Scratch lists of a chunk, kept to save allocations.
#[derive(Debug, Clone, Default)]
pub struct Scratch {
    points: Vec<WallPoint>,
    next: Vec<WallContact>,
    taken: Vec<bool>,
}

/// Adds the loads of a chunk's contacts with parts, on its particles and on the parts.
#[expect(clippy::too_many_arguments, reason = "the pieces of a chunk are borrowed apart")]
pub fn add_wall_loads<const FRICTION: bool, const ROLLING: bool, const ENERGY: bool>(
    scene: &ContactScene,
    walls: &Walls,
    first: usize,
    near: &WallCandidates,
    contacts: &mut Vec<WallContact>,
    loads: &mut [Load],
    springs: &mut [Vec3],
    part_loads: &mut [PartLoad],
    tally: &mut Tally,
    scratch: &mut Scratch,
) {
    let mut held = 0;
    scratch.next.clear();
    scratch.taken.clear();
    scratch.taken.resize(contacts.len(), false);
    for &(particle, from, to) in &near.rows {
        let index = particle as usize;
        let sphere = &scene.spheres[index];
        if scene.velocities[index].path.is_prescribed() {
            continue;
        }
        scratch.points.clear();
        let candidates = &near.candidates[from as usize..to as usize];
        walls.contacts(candidates, &sphere.position(), sphere.radius, &mut scratch.points);
        if scratch.points.is_empty() {
            continue;
        }
        while held < contacts.len() && contacts[held].particle < particle {
            held += 1;
        }
        let end = contacts[held..].iter().position(|c| c.particle != particle).map_or(contacts.len(), |n| held + n);
        let old = &contacts[held..end];
        for point in &scratch.points {
            let mut memory = recall(old, &mut scratch.taken[held..end], point);
            let mut touch = touch_part(scene, walls, index, point);
            if ENERGY {
                touch.closing_lag = scene.closing_lag(&scene.accelerations[index].linear, &touch.normal);
            }
            let pair = scene.law.pair(scene.velocities[index].material, u32::from(walls.material(point.part)));
            let lever = wall_lever(scene, sphere.radius, point.overlap);
            let settings = &scene.law.settings;
            let result =
                answer::<FRICTION, ROLLING, ENERGY>(settings, pair, &touch, scene.timestep, &mut memory, tally, 1.0);
            let load = &mut loads[index - first];
            load.force += result.force;
            load.torque += result.twist * lever + result.rolling;
            if ENERGY {
                springs[index - first] -= point.normal * result.normal.elastic;
            }
            part_loads[usize::from(point.part)].add(&load_on_part(walls, point, &result));
            if point.overlap > scene.overlap_limit * sphere.radius {
                let ratio = point.overlap / sphere.radius;
                tally.note_deep(DeepContact { particle, partner: None, part: Some(point.part), ratio });
            }
            scratch.next.push(WallContact {
                particle,
                part: point.part,
                element: point.element,
                normal: point.normal,
                memory,
            });
        }
    }
    if ENERGY && scene.law.is_linear() {
        let ended = contacts.iter().zip(&scratch.taken).filter(|(_, taken)| !**taken);
        tally.slip += ended.map(|(contact, _)| left_at_wall(scene, walls, contact)).sum::<f64>();
    }
    std::mem::swap(contacts, &mut scratch.next);
}

/// Energy [J] that the tangential spring of a contact still holds as it ends: lost in sliding.
fn left_at_wall(scene: &ContactScene, walls: &Walls, contact: &WallContact) -> f64 {
    let (sphere, velocity) = (&scene.spheres[contact.particle as usize], &scene.velocities[contact.particle as usize]);
    let motion = NormalMotion {
        overlap: 0.0,
        closing_speed: 0.0,
        effective_radius: sphere.radius,
        effective_mass: 1.0 / velocity.inverse_mass,
    };
    let pair = scene.law.pair(velocity.material, u32::from(walls.material(contact.part)));
    left_in_spring(scene.law, pair, &motion, &contact.memory)
}

/// Memory of the contact that `point` continues: same triangle, else the one of the same part whose normal is closest.
fn recall(old: &[WallContact], taken: &mut [bool], point: &WallPoint) -> Memory {
    let free = |n: &usize, taken: &[bool]| !taken[*n] && old[*n].part == point.part;
    let same = (0..old.len()).find(|n| free(n, taken) && old[*n].element == point.element);
    let closest = || {
        (0..old.len())
            .filter(|n| free(n, taken))
            .map(|n| (n, old[n].normal.dot(&point.normal)))
            // Sliding over an edge turns the normal by less than 60 degrees a step; a new wall of a corner does not.
            .filter(|(_, cosine)| *cosine > 0.5)
            .max_by(|a, b| a.1.total_cmp(&b.1))
            .map(|(n, _)| n)
    };
    let Some(found) = same.or_else(closest) else { return Memory::NONE };
    taken[found] = true;
    old[found].memory
}

/// Lever arm at a part [m]: the contact lies on the rigid surface; LIGGGHTS puts it into the middle of the overlap.
fn wall_lever(scene: &ContactScene, radius: f64, overlap: f64) -> f64 {
    match scene.law.settings.compatibility {
        Compatibility::Tollgate => radius - overlap,
        Compatibility::Liggghts => radius - 0.5 * overlap,
    }
}

/// Relative spin that the rolling laws see at a part [rad/s]; LIGGGHTS leaves the part's out and stretches the particle's by the
/// ratio of lever arm and distance.
fn rolling_spin(scene: &ContactScene, walls: &Walls, point: &WallPoint, spin: &Vec3, stretch: f64) -> Vec3 {
    match scene.law.settings.compatibility {
        Compatibility::Tollgate => spin - walls.spin(point.part),
        Compatibility::Liggghts => spin * stretch,
    }
}

fn touch_part(scene: &ContactScene, walls: &Walls, index: usize, point: &WallPoint) -> Touch {
    let (sphere, velocity) = (&scene.spheres[index], &scene.velocities[index]);
    let spin = Vec3::from(velocity.angular);
    let lever = wall_lever(scene, sphere.radius, point.overlap);
    Touch {
        normal: point.normal,
        overlap: point.overlap,
        velocity: Vec3::from(velocity.linear) - walls.surface_velocity(point.part, &point.point, &point.normal),
        lever_spin: spin * lever,
        relative_spin: rolling_spin(scene, walls, point, &spin, lever / (sphere.radius - point.overlap)),
        effective_radius: sphere.radius,
        effective_mass: 1.0 / velocity.inverse_mass,
        inverse_inertia: velocity.inverse_mass / (scene.inertia_factor * sphere.radius * sphere.radius),
        closing_lag: 0.0,
    }
}

fn load_on_part(walls: &Walls, point: &WallPoint, result: &Answer) -> PartLoad {
    let force = -result.force;
    let surface = walls.surface_velocity(point.part, &point.point, &point.normal);
    PartLoad {
        force,
        torque: point.point.cross(&force) - result.rolling,
        power: force.dot(&surface) - result.rolling.dot(&walls.spin(point.part)),
    }
}

/// Looks at the contacts of particle `index` with parts, without moving their memory.
pub fn look_at_walls(
    scene: &ContactScene,
    walls: &Walls,
    index: usize,
    held: &[WallContact],
    mut visit: impl FnMut(&WallPoint, &SeenContact),
) {
    let sphere = &scene.spheres[index];
    let (mut near, mut points) = (Vec::new(), Vec::new());
    walls.candidates(&sphere.position(), sphere.radius, &mut near);
    walls.contacts(&near, &sphere.position(), sphere.radius, &mut points);
    let mut taken = vec![false; held.len()];
    for point in &points {
        let kept = recall(held, &mut taken, point);
        let touch = touch_part(scene, walls, index, point);
        let pair = scene.law.pair(scene.velocities[index].material, u32::from(walls.material(point.part)));
        let lever = wall_lever(scene, sphere.radius, point.overlap);
        visit(point, &pair_contacts::seen(&scene.law.settings, pair, &touch, lever, scene.timestep, &kept));
    }
}
