//! Contacts between particles and parts.

use super::contact::{Springs, Touch, answer};
use super::energy::{DeepContact, Tally};
use super::law::constants::PairConstants;
use super::law::{Compatibility, NormalContact};
use super::meeting::ContactScene;
use super::neighbor::list::Memory;
use super::pair_contacts::left_in_spring;
use super::particles::{Load, Path, Sphere};
use super::seen::{SeenContact, seen};
use super::wall::{Candidate, WallPoint, Walls};
use crate::math::Vec3;
use crate::math::lanes::{LaneVector, Lanes, MOST_LANES, Mask};

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
    /// What the approach of particles and parts must have reached before each can be touched [m].
    due: Vec<f64>,
    /// Whether loads have been computed from these.
    pub(super) were_seen: bool,
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
            self.due.resize(self.candidates.len(), 0.0);
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
    block: WallBlock,
}

/// Contacts with parts, one a lane, that wait to be computed together.
#[derive(Debug, Clone, Default)]
struct WallBlock {
    count: usize,
    particles: [u32; MOST_LANES],
    parts: [u16; MOST_LANES],
    /// Points of the surface touched [m].
    points: [Vec3; MOST_LANES],
    normals: [[f64; MOST_LANES]; 3],
    overlaps: [f64; MOST_LANES],
    surface_velocities: [[f64; MOST_LANES]; 3],
    part_spins: [[f64; MOST_LANES]; 3],
    tangential: [[f64; MOST_LANES]; 3],
    rolling: [[f64; MOST_LANES]; 3],
}

impl WallBlock {
    fn push(&mut self, walls: &Walls, particle: u32, point: &WallPoint, memory: &Memory) {
        let lane = self.count;
        self.count += 1;
        (self.particles[lane], self.parts[lane], self.points[lane]) = (particle, point.part, point.point);
        self.overlaps[lane] = point.overlap;
        let surface_velocity = walls.surface_velocity(point.part, &point.point, &point.normal);
        let part_spin = walls.spin(point.part);
        for axis in 0..3 {
            self.normals[axis][lane] = point.normal[axis];
            self.surface_velocities[axis][lane] = surface_velocity[axis];
            self.part_spins[axis][lane] = part_spin[axis];
            self.tangential[axis][lane] = memory.tangential[axis];
            self.rolling[axis][lane] = memory.rolling[axis];
        }
    }

    /// Lanes beyond the contacts belong to the first particle, and count for nothing.
    fn fill_up(&mut self) {
        let first = self.particles[0];
        self.particles[self.count..].fill(first);
    }

    fn memory(&self, lane: usize) -> Memory {
        let vector = |lists: &[[f64; MOST_LANES]; 3]| Vec3::new(lists[0][lane], lists[1][lane], lists[2][lane]);
        Memory { tangential: vector(&self.tangential), rolling: vector(&self.rolling) }
    }

    /// Relative motion of particles and parts, lever arms [m] and radii [m].
    #[inline(always)]
    fn touch<L: Lanes, const ROLLING: bool>(&self, scene: &ContactScene) -> (Touch<L>, L, L) {
        let index = &self.particles[..L::COUNT];
        debug_assert!(index.iter().all(|&index| (index as usize) < scene.spheres.len()));
        // SAFETY: spheres are rows of four numbers and velocities of eight; blocks hold particles that there are.
        let (sphere, velocity) = unsafe {
            (
                L::gather_four(scene.spheres.as_ptr().cast(), index),
                L::gather_eight(scene.velocities.as_ptr().cast(), index),
            )
        };
        let (radius, overlap) = (sphere[3], L::from_slice(&self.overlaps));
        // The contact lies on the rigid surface; LIGGGHTS puts it into the middle of the overlap.
        let ours = scene.law.settings.compatibility == Compatibility::Tollgate;
        let lever = if ours { radius - overlap } else { radius - L::splat(0.5) * overlap };
        let spin = LaneVector::new(velocity[4], velocity[5], velocity[6]);
        let mut inverse_inertia = L::zero();
        let mut relative_spin = spin;
        if ROLLING {
            inverse_inertia = velocity[3] / (L::splat(scene.inertia_factor) * radius * radius);
            // LIGGGHTS leaves the part's spin out and stretches the particle's by the ratio of lever arm and distance.
            relative_spin = if ours {
                spin - LaneVector::read_from(&self.part_spins, 0)
            } else {
                spin * (lever / (radius - overlap))
            };
        }
        let touch = Touch {
            normal: LaneVector::read_from(&self.normals, 0),
            overlap,
            velocity: LaneVector::new(velocity[0], velocity[1], velocity[2])
                - LaneVector::read_from(&self.surface_velocities, 0),
            lever_spin: spin * lever,
            relative_spin,
            effective_radius: radius,
            effective_mass: L::splat(1.0) / velocity[3],
            inverse_inertia,
            closing_lag: L::zero(),
        };
        (touch, lever, radius)
    }
}

/// What the contacts of a chunk with parts are computed from and where their loads go.
pub struct WallKernel<'a> {
    /// What all chunks read.
    pub scene: &'a ContactScene<'a>,
    /// Parts.
    pub walls: &'a Walls,
    /// The chunk's first particle.
    pub first: usize,
    /// Loads of its particles.
    pub loads: &'a mut [Load],
    /// Forces of the normal springs on its particles [N]; empty where losses are not accounted for.
    pub springs: &'a mut [Vec3],
    /// Loads on the parts.
    pub part_loads: &'a mut [PartLoad],
    /// Losses.
    pub tally: &'a mut Tally,
    /// Upper bound on the approach of particles and parts since the candidates were collected [m].
    pub approached: f64,
}

impl WallKernel<'_> {
    /// Adds the loads of the chunk's contacts with parts, on its particles and on the parts, in the candidates' order: the number
    /// of lanes changes no bit.
    #[inline(always)]
    pub fn add_loads<L: Lanes, const FRICTION: bool, const ROLLING: bool, const ENERGY: bool>(
        &mut self,
        near: &mut WallCandidates,
        contacts: &mut Vec<WallContact>,
        scratch: &mut Scratch,
    ) {
        let materials = self.scene.only_material.zip(self.walls.only_material());
        let single =
            materials.map(|(own, other)| PairConstants::everywhere(self.scene.law.pair(own, u32::from(other))));
        let mut held = 0;
        scratch.next.clear();
        scratch.taken.clear();
        scratch.taken.resize(contacts.len(), false);
        for &(particle, from, to) in &near.rows {
            let sphere = &self.scene.spheres[particle as usize];
            if self.scene.velocities[particle as usize].path.is_prescribed() {
                continue;
            }
            let here = from as usize..to as usize;
            let (candidates, due) = (&near.candidates[here.clone()], &mut near.due[here]);
            let (centre, approached) = (sphere.position(), self.approached);
            self.walls.contacts_when_due(candidates, due, approached, &centre, sphere.radius, &mut scratch.points);
            if scratch.points.is_empty() {
                continue;
            }
            while held < contacts.len() && contacts[held].particle < particle {
                held += 1;
            }
            let end = contacts[held..].iter().position(|c| c.particle != particle).map_or(contacts.len(), |n| held + n);
            for number in 0..scratch.points.len() {
                let point = scratch.points[number];
                let memory = recall(&contacts[held..end], &mut scratch.taken[held..end], &point);
                scratch.block.push(self.walls, particle, &point, &memory);
                let WallPoint { part, element, normal, .. } = point;
                scratch.next.push(WallContact { particle, part, element, normal, memory });
                if scratch.block.count == L::COUNT {
                    self.compute::<L, FRICTION, ROLLING, ENERGY>(&single, &mut scratch.block, &mut scratch.next);
                }
            }
        }
        if scratch.block.count > 0 {
            self.compute::<L, FRICTION, ROLLING, ENERGY>(&single, &mut scratch.block, &mut scratch.next);
        }
        if ENERGY && self.scene.law.is_linear() {
            let ended = contacts.iter().zip(&scratch.taken).filter(|(_, taken)| !**taken);
            self.tally.slip += ended.map(|(contact, _)| left_at_wall(self.scene, self.walls, contact)).sum::<f64>();
        }
        std::mem::swap(contacts, &mut scratch.next);
    }

    /// Computes the contacts of a block, which are the last of the list, and empties it; with the constants of the `single` pair of
    /// materials that there is, else looked up lane by lane.
    #[inline(always)]
    fn compute<L: Lanes, const FRICTION: bool, const ROLLING: bool, const ENERGY: bool>(
        &mut self,
        single: &Option<PairConstants<L>>,
        block: &mut WallBlock,
        contacts: &mut [WallContact],
    ) {
        let scene = self.scene;
        block.fill_up();
        let counted = L::Mask::from_bits(u16::MAX >> (MOST_LANES - block.count));
        // Sleepers on parts that stand lose nothing, and remember what they did, however often they are computed.
        let moving = if scene.sleeping { moving_lanes(scene, self.walls, block) } else { u16::MAX };
        let (mut touch, lever, radius) = block.touch::<L, ROLLING>(scene);
        if (touch.overlap.exceeds(L::splat(scene.overlap_limit) * radius) & counted).any() {
            note_deep(scene, block, self.tally);
        }
        if ENERGY {
            touch.closing_lag = wall_lag(scene, block);
        }
        let material = |lane: usize| scene.velocities[block.particles[lane] as usize].material;
        let walls = self.walls;
        let several;
        let pair = match single {
            Some(pair) => pair,
            None => {
                several = scene
                    .law
                    .pairs(|lane| [material(lane), u32::from(walls.material(block.parts[lane.min(block.count - 1)]))]);
                &several
            }
        };
        let mut held = Springs {
            tangential: LaneVector::read_from(&block.tangential, 0),
            rolling: LaneVector::read_from(&block.rolling, 0),
        };
        let settings = &scene.law.settings;
        let stiffness = settings.stiffness(pair, &touch.normal_contact());
        let result =
            answer::<L, FRICTION, ROLLING, ENERGY>(settings, pair, &stiffness, &touch, scene.timestep, &mut held);
        if FRICTION || ROLLING {
            (block.tangential, block.rolling) = (held.tangential.to_arrays(), held.rolling.to_arrays());
            let last = contacts.len() - block.count;
            for (lane, contact) in contacts[last..].iter_mut().enumerate().filter(|(lane, _)| moving >> lane & 1 == 1) {
                contact.memory = block.memory(lane);
            }
        }
        if ENERGY {
            result.lost.book(1.0, counted.bits() & moving, self.tally);
            let springs = (touch.normal * stiffness.elastic).to_arrays();
            for (lane, &particle) in block.particles[..block.count].iter().enumerate() {
                let spring = Vec3::new(springs[0][lane], springs[1][lane], springs[2][lane]);
                self.springs[particle as usize - self.first] -= spring;
            }
        }
        let force = result.force.only(counted);
        let torque = (result.twist * lever + result.rolling).only(counted);
        let rows: *mut [f64; 8] = self.loads.as_mut_ptr().cast::<[f64; 8]>().wrapping_sub(self.first);
        let zero = L::zero();
        let columns = [force.x, force.y, force.z, zero, torque.x, torque.y, torque.z, zero];
        // SAFETY: loads are rows of eight numbers; a chunk's candidates belong to the chunk's own particles.
        unsafe { L::add_to_rows(rows, [&block.particles[..L::COUNT]], [columns]) };
        self.load_parts(block, &force.to_arrays(), &result.rolling.only(counted).to_arrays());
        block.count = 0;
    }

    /// Adds the opposite of forces and rolling torques to the parts.
    fn load_parts(&mut self, block: &WallBlock, forces: &[[f64; MOST_LANES]; 3], rolling: &[[f64; MOST_LANES]; 3]) {
        for lane in 0..block.count {
            let vector = |lists: &[[f64; MOST_LANES]; 3]| Vec3::new(lists[0][lane], lists[1][lane], lists[2][lane]);
            let (force, rolling) = (-vector(forces), vector(rolling));
            let surface = vector(&block.surface_velocities);
            self.part_loads[usize::from(block.parts[lane])].add(&PartLoad {
                force,
                torque: block.points[lane].cross(&force) - rolling,
                power: force.dot(&surface) - rolling.dot(&vector(&block.part_spins)),
            });
        }
    }
}

/// Lanes of particles that are awake, or of parts that move.
fn moving_lanes(scene: &ContactScene, walls: &Walls, block: &WallBlock) -> u16 {
    let moves = |lane: &usize| {
        scene.velocities[block.particles[*lane] as usize].path != Path::Asleep || !walls.stands(block.parts[*lane])
    };
    (0..block.count).filter(moves).fold(0, |bits, lane| bits | 1 << lane)
}

#[cold]
#[inline(never)]
fn note_deep(scene: &ContactScene, block: &WallBlock, tally: &mut Tally) {
    for lane in 0..block.count {
        let ratio = block.overlaps[lane] / scene.spheres[block.particles[lane] as usize].radius;
        if ratio > scene.overlap_limit {
            let (particle, part) = (block.particles[lane], Some(block.parts[lane]));
            tally.note_deep(DeepContact { particle, partner: None, part, ratio });
        }
    }
}

/// [`ContactScene::closing_lag`] of every lane.
fn wall_lag<L: Lanes>(scene: &ContactScene, block: &WallBlock) -> L {
    let mut lags = [0.0; MOST_LANES];
    for (lane, lag) in lags[..block.count].iter_mut().enumerate() {
        let normal = Vec3::new(block.normals[0][lane], block.normals[1][lane], block.normals[2][lane]);
        *lag = scene.closing_lag(&scene.accelerations[block.particles[lane] as usize].linear, &normal);
    }
    L::from_slice(&lags)
}

/// Energy [J] that the tangential spring of a contact still holds as it ends: lost in sliding.
fn left_at_wall(scene: &ContactScene, walls: &Walls, contact: &WallContact) -> f64 {
    let (sphere, velocity) = (&scene.spheres[contact.particle as usize], &scene.velocities[contact.particle as usize]);
    let motion =
        NormalContact { overlap: 0.0, effective_radius: sphere.radius, effective_mass: 1.0 / velocity.inverse_mass };
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
        let mut block = WallBlock::default();
        block.push(walls, index as u32, point, &kept);
        let (touch, lever, _) = block.touch::<f64, true>(scene);
        let pair = scene.law.pair(scene.velocities[index].material, u32::from(walls.material(point.part)));
        visit(point, &seen(&scene.law.settings, pair, &touch, lever, scene.timestep, &kept));
    }
}
