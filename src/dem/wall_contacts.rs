//! Contacts between particles and parts: from who is near to the loads, several contacts at once.

use super::contact::{Springs, Touch, answer};
use super::energy::{DeepContact, Tally};
use super::law::constants::PairConstants;
use super::law::{Compatibility, NormalContact};
use super::meeting::ContactScene;
use super::neighbor::list::{Memory, PairMemory};
use super::pair_contacts::left_in_spring;
use super::particles::Path;
use super::seen::{SeenContact, seen};
use super::touched::Effects;
use super::wall::{Plane, WallPoint, Walls};
use super::wall_list::{PartList, WallList};
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

/// Spheres that touch a part, one a lane.
#[derive(Clone, Copy)]
struct Place<L> {
    centre: LaneVector<L>,
    radius: L,
    /// Unit normal to the part.
    normal: LaneVector<L>,
    overlap: L,
}

/// How a part's surface moves where it is touched.
#[derive(Clone, Copy)]
struct SurfaceMotion<L> {
    velocity: LaneVector<L>,
    spin: LaneVector<L>,
}

impl<L: Lanes> Springs<L> {
    /// `other` in the lanes of the mask, else these.
    #[inline(always)]
    fn or_in(&self, lanes: L::Mask, other: &Self) -> Self {
        let pick = |this, other| LaneVector::select(lanes, other, this);
        Self { tangential: pick(&self.tangential, &other.tangential), rolling: pick(&self.rolling, &other.rolling) }
    }
}

impl<L: Lanes> Place<L> {
    /// Where the surface is touched [m].
    #[inline(always)]
    fn point(&self) -> LaneVector<L> {
        self.centre.plus(&self.normal, self.radius - self.overlap)
    }

    #[inline(always)]
    fn surface_motion(&self, walls: &Walls, part: u16) -> SurfaceMotion<L> {
        if walls.stands(part) {
            return SurfaceMotion { velocity: LaneVector::zeros(), spin: LaneVector::zeros() };
        }
        let velocity = walls.surface_velocity(part, &self.point(), &self.normal);
        SurfaceMotion { velocity, spin: LaneVector::everywhere(walls.spin(part)) }
    }

    /// Relative motion of particles and surface, and lever arms [m]; `velocity` has the columns of [`super::particles::Velocity`].
    #[inline(always)]
    fn touch<const ROLLING: bool>(
        &self,
        scene: &ContactScene,
        velocity: &[L; 8],
        surface: &SurfaceMotion<L>,
    ) -> (Touch<L>, L) {
        let (radius, overlap) = (self.radius, self.overlap);
        // The contact lies on the rigid surface; LIGGGHTS puts it into the middle of the overlap.
        let ours = scene.law.settings.compatibility == Compatibility::Tollgate;
        let lever = if ours { radius - overlap } else { radius - L::splat(0.5) * overlap };
        let spin = LaneVector::new(velocity[4], velocity[5], velocity[6]);
        let mut inverse_inertia = L::zero();
        let mut relative_spin = spin;
        if ROLLING {
            inverse_inertia = velocity[3] / (L::splat(scene.inertia_factor) * radius * radius);
            // LIGGGHTS leaves the part's spin out and stretches the particle's by the ratio of lever arm and distance.
            relative_spin = if ours { spin - surface.spin } else { spin * (lever / (radius - overlap)) };
        }
        let touch = Touch {
            normal: self.normal,
            overlap,
            velocity: LaneVector::new(velocity[0], velocity[1], velocity[2]) - surface.velocity,
            lever_spin: spin * lever,
            relative_spin,
            effective_radius: radius,
            effective_mass: L::splat(1.0) / velocity[3],
            inverse_inertia,
            closing_lag: L::zero(),
        };
        (touch, lever)
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
    /// Whether some of its particles may be prescribed.
    pub has_prescribed: bool,
    /// Loads on the parts.
    pub part_loads: &'a mut [PartLoad],
    /// Where loads on its particles go, and all else.
    pub effects: Effects<'a>,
}

impl WallKernel<'_> {
    /// Adds the loads of the chunk's contacts with parts, on its particles and on the parts, part by part in the order of the
    /// particles: the number of lanes changes no bit.
    #[inline(always)]
    pub fn add_loads<L: Lanes, const FRICTION: bool, const ROLLING: bool, const ENERGY: bool>(
        &mut self,
        list: &mut WallList,
    ) {
        for list in &mut list.parts {
            let plane = self.walls.plane(list.part);
            list.plane_normal = plane.map_or_else(Vec3::zeros, |plane| -plane.normal);
            list.pad();
            self.add_part::<L, FRICTION, ROLLING, ENERGY>(list, plane.as_ref());
        }
    }

    /// Adds the loads of the contacts with one part.
    #[inline(always)]
    fn add_part<L: Lanes, const FRICTION: bool, const ROLLING: bool, const ENERGY: bool>(
        &mut self,
        list: &mut PartList,
        plane: Option<&Plane>,
    ) {
        let (scene, walls, part) = (self.scene, self.walls, list.part);
        let (settings, material) = (&scene.law.settings, u32::from(walls.material(part)));
        let single = scene.only_material.map(|own| PairConstants::everywhere(scene.law.pair(own, material)));
        let stands = walls.stands(part);
        // Summed apart from the other losses: how many lanes go together must not change the order.
        let mut ended = 0.0;
        let mut sum = [0.0; 7];
        for from in (0..list.places.count).step_by(L::COUNT) {
            let (place, touches) = self.place::<L, ENERGY>(list, plane, from, &mut ended);
            if !touches.any() {
                keep::<L, FRICTION, ROLLING>(&mut list.memory, from, &Springs::none());
                continue;
            }
            let particles = &list.places.particles[from..from + L::COUNT];
            // SAFETY: velocities are rows of eight numbers; lists name only particles that there are.
            let velocity = unsafe { L::gather_eight(scene.velocities.as_ptr().cast(), particles) };
            self.effects.touched.note(particles, touches.bits());
            let surface = place.surface_motion(walls, part);
            let (mut touch, lever) = place.touch::<ROLLING>(scene, &velocity, &surface);
            let deep = place.overlap.exceeds(L::splat(scene.overlap_limit) * place.radius) & touches;
            if deep.any() {
                note_deep(particles, part, &(place.overlap / place.radius).to_array(), deep.bits(), self.effects.tally);
            }
            if ENERGY {
                touch.closing_lag = wall_lag(scene, particles, &place.normal);
            }
            let several;
            let pair = match &single {
                Some(pair) => pair,
                None => {
                    let own = |lane: usize| scene.velocities[particles[lane] as usize].material;
                    several = scene.law.pairs(|lane| [own(lane), material]);
                    &several
                }
            };
            let stiffness = settings.stiffness(pair, &touch.normal_contact());
            let before = Springs {
                tangential: LaneVector::read_from(&list.memory.tangential, from),
                rolling: LaneVector::read_from(&list.memory.rolling, from),
            };
            let mut held = before;
            let result =
                answer::<L, FRICTION, ROLLING, ENERGY>(settings, pair, &stiffness, &touch, scene.timestep, &mut held);
            // Sleepers on parts that stand lose nothing, and remember what they did, however often they are computed.
            if scene.sleeping && stands {
                let moving = lanes_on(scene, particles, |path| path != Path::Asleep);
                held = held.or_in(L::Mask::from_bits(!moving), &before);
                if ENERGY {
                    result.lost.book(1.0, touches.bits() & moving, self.effects.tally);
                }
            } else if ENERGY {
                result.lost.book(1.0, touches.bits(), self.effects.tally);
            }
            if ENERGY {
                self.book_normal_springs(particles, touches.bits(), &(touch.normal * stiffness.elastic));
            }
            keep::<L, FRICTION, ROLLING>(&mut list.memory, from, &held.or_in(!touches, &Springs::none()));
            let force = result.force.only(touches);
            let rolling = result.rolling.only(touches);
            self.push(particles, &force, &((result.twist * lever).only(touches) + rolling));
            // The part gets the opposite.
            let torque = (place.point().cross(&force) + rolling).only(touches);
            let power = force.dot(&surface.velocity) + rolling.dot(&surface.spin);
            let power = if stands { L::zero() } else { L::select(touches, power, L::zero()) };
            add_lanes(&mut sum, [-force.x, -force.y, -force.z, -torque.x, -torque.y, -torque.z, -power]);
        }
        self.effects.tally.slip += ended;
        let (force, torque) = (Vec3::new(sum[0], sum[1], sum[2]), Vec3::new(sum[3], sum[4], sum[5]));
        self.part_loads[usize::from(part)].add(&PartLoad { force, torque, power: sum[6] });
    }

    /// Where the particles of a block are to the part, and which of them touch it.
    #[inline(always)]
    fn place<L: Lanes, const ENERGY: bool>(
        &self,
        list: &mut PartList,
        plane: Option<&Plane>,
        from: usize,
        ended: &mut f64,
    ) -> (Place<L>, L::Mask) {
        let (scene, part) = (self.scene, list.part);
        let PartList { places, memory, .. } = list;
        let particles = &places.particles[from..from + L::COUNT];
        // SAFETY: spheres are rows of four numbers; lists name only particles that there are.
        let [x, y, z, radius] = unsafe { L::gather_four(scene.spheres.as_ptr().cast(), particles) };
        let centre = LaneVector::new(x, y, z);
        // The last block repeats its last particle in lanes that count for nothing.
        let counted = L::first(places.count - from);
        let Some(plane) = plane else {
            let normal = LaneVector::read_from(&places.normals, from);
            return (Place { centre, radius, normal, overlap: L::from_slice(&places.overlaps[from..]) }, counted);
        };
        let overlap = plane.overlap(&centre, radius);
        let mut touches = overlap.exceeds(L::zero()) & counted;
        if !self.walls.is_present(part) {
            touches = L::Mask::from_bits(0);
        }
        if self.has_prescribed {
            touches = touches & !L::Mask::from_bits(lanes_on(scene, particles, Path::is_prescribed));
        }
        if ENERGY && scene.law.is_linear() {
            let (material, apart) = (u32::from(self.walls.material(part)), (!touches & counted).bits());
            add_ended(scene, material, particles, memory, from, apart, ended);
        }
        (Place { centre, radius, normal: LaneVector::everywhere(-plane.normal), overlap }, touches)
    }

    /// Adds forces and torques to the particles.
    #[inline(always)]
    fn push<L: Lanes>(&mut self, particles: &[u32], force: &LaneVector<L>, torque: &LaneVector<L>) {
        debug_assert!(
            particles.iter().all(|&index| (index as usize).wrapping_sub(self.first) < self.effects.loads.len())
        );
        let rows: *mut [f64; 8] = self.effects.loads.as_mut_ptr().cast::<[f64; 8]>().wrapping_sub(self.first);
        let zero = L::zero();
        let columns = [force.x, force.y, force.z, zero, torque.x, torque.y, torque.z, zero];
        // SAFETY: loads are rows of eight numbers; a chunk's list names the chunk's own particles.
        unsafe { L::add_to_rows(rows, [particles], [columns]) };
    }

    /// Keeps the force of the normal springs on each particle apart, for the budget.
    fn book_normal_springs<L: Lanes>(&mut self, particles: &[u32], touches: u16, springs: &LaneVector<L>) {
        let [x, y, z] = springs.to_arrays();
        for lane in (0..L::COUNT).filter(|lane| touches >> lane & 1 == 1) {
            self.effects.springs[particles[lane] as usize - self.first] -= Vec3::new(x[lane], y[lane], z[lane]);
        }
    }
}

/// Adds the lanes of columns to sums, lane by lane in their order.
#[inline(always)]
fn add_lanes<L: Lanes>(sums: &mut [f64; 7], columns: [L; 7]) {
    // Loops rather than `map`, here as wherever lanes are handled: one that is not inlined is not compiled for the level.
    let mut lists = [[0.0; MOST_LANES]; 7];
    for (list, column) in lists.iter_mut().zip(columns) {
        column.write_to(list);
    }
    for lane in 0..L::COUNT {
        for (sum, list) in sums.iter_mut().zip(&lists) {
            *sum += list[lane];
        }
    }
}

/// Writes the memory of a block.
#[inline(always)]
fn keep<L: Lanes, const FRICTION: bool, const ROLLING: bool>(
    memory: &mut PairMemory,
    from: usize,
    springs: &Springs<L>,
) {
    if FRICTION || ROLLING {
        springs.tangential.write_to(&mut memory.tangential, from);
        springs.rolling.write_to(&mut memory.rolling, from);
    }
}

/// Lanes that `of` picks by the path of their particle.
#[inline(always)]
fn lanes_on(scene: &ContactScene, particles: &[u32], of: impl Fn(Path) -> bool) -> u16 {
    let picked = |lane: &usize| of(scene.velocities[particles[*lane] as usize].path);
    (0..particles.len()).filter(picked).fold(0, |bits, lane| bits | 1 << lane)
}

#[cold]
#[inline(never)]
fn note_deep(particles: &[u32], part: u16, ratio: &[f64; MOST_LANES], deep: u16, tally: &mut Tally) {
    for lane in (0..particles.len()).filter(|lane| deep >> lane & 1 == 1) {
        let (particle, part) = (particles[lane], Some(part));
        tally.note_deep(DeepContact { particle, partner: None, part, ratio: ratio[lane] });
    }
}

/// [`ContactScene::closing_lag`] of every lane.
#[inline(always)]
fn wall_lag<L: Lanes>(scene: &ContactScene, particles: &[u32], normal: &LaneVector<L>) -> L {
    let [x, y, z] = normal.to_arrays();
    let mut lags = [0.0; MOST_LANES];
    for (lane, &particle) in particles.iter().enumerate() {
        let normal = Vec3::new(x[lane], y[lane], z[lane]);
        lags[lane] = scene.closing_lag(&scene.accelerations[particle as usize].linear, &normal);
    }
    L::from_slice(&lags)
}

/// Who does not touch a plane has no memory of it. What a linear spring still held is lost in sliding [J].
fn add_ended(
    scene: &ContactScene,
    material: u32,
    particles: &[u32],
    memory: &mut PairMemory,
    from: usize,
    apart: u16,
    ended: &mut f64,
) {
    for lane in (0..particles.len()).filter(|lane| apart >> lane & 1 == 1) {
        if let Some(held) = memory.get(from + lane).filter(|held| *held != Memory::NONE) {
            *ended += left_at_wall(scene, particles[lane], material, &held);
            memory.set(from + lane, &Memory::NONE);
        }
    }
}

/// Energy [J] that the tangential spring of a contact of a particle with a part of a material still holds as it ends: lost in sliding.
#[must_use]
pub fn left_at_wall(scene: &ContactScene, particle: u32, material: u32, memory: &Memory) -> f64 {
    let (sphere, velocity) = (&scene.spheres[particle as usize], &scene.velocities[particle as usize]);
    let motion =
        NormalContact { overlap: 0.0, effective_radius: sphere.radius, effective_mass: 1.0 / velocity.inverse_mass };
    left_in_spring(scene.law, scene.law.pair(velocity.material, material), &motion, memory)
}

/// Looks at the contacts of particle `index` with parts, without moving their memory.
pub fn look_at_walls(
    scene: &ContactScene,
    walls: &Walls,
    index: usize,
    held: &WallList,
    mut visit: impl FnMut(&WallPoint, &SeenContact),
) {
    let sphere = &scene.spheres[index];
    let (mut near, mut points) = (Vec::new(), Vec::new());
    walls.candidates(&sphere.position(), sphere.radius, &mut near);
    walls.contacts(&near, &sphere.position(), sphere.radius, &mut points);
    for (point, kept) in points.iter().zip(held.recall(index, &points)) {
        let (centre, normal) = (sphere.position().into(), point.normal.into());
        let place = Place::<f64> { centre, radius: sphere.radius, normal, overlap: point.overlap };
        // SAFETY: velocities are rows of eight numbers, and the particle is there.
        let velocity = unsafe { f64::gather_eight(scene.velocities.as_ptr().cast(), &[index as u32]) };
        let (touch, lever) = place.touch::<true>(scene, &velocity, &place.surface_motion(walls, point.part));
        let pair = scene.law.pair(scene.velocities[index].material, u32::from(walls.material(point.part)));
        visit(point, &seen(scene, pair, &touch, lever, &kept));
    }
}
