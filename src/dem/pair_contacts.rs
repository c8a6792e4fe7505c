//! Contacts between particles: the loop that costs the time.

use super::contact::{Answer, Touch, answer, elastic_energy, present_memory};
use super::energy::{DeepContact, Tally};
use super::law::constants::{LawTable, PairConstants};
use super::law::tangential::tangential_energy;
use super::law::{Compatibility, LawSettings, NormalMotion};
use super::neighbor::list::{Candidate, Images, InnerList, Memory, NO_IMAGE};
use super::particles::{Acceleration, Load, Sphere, Velocity};
use crate::math::Vec3;

/// What all chunks read while they compute contacts.
#[derive(Debug, Clone, Copy)]
pub struct ContactScene<'a> {
    /// Centres and radii.
    pub spheres: &'a [Sphere],
    /// Velocities.
    pub velocities: &'a [Velocity],
    /// Accelerations at the last full step.
    pub accelerations: &'a [Acceleration],
    /// Laws.
    pub law: &'a LawTable,
    /// Periodic images.
    pub images: &'a Images,
    /// Time step [s]; 0 where the memory must not move.
    pub timestep: f64,
    /// Watchdog's limit of overlap over the smaller radius [-].
    pub overlap_limit: f64,
    /// Factor c of I = c m r^2 [-].
    pub inertia_factor: f64,
}

impl ContactScene<'_> {
    /// Relative motion of particle `index` and a candidate, where they touch, with the lever arms of both [m].
    #[inline(always)]
    #[must_use]
    pub fn touch(&self, index: usize, candidate: Candidate) -> Option<(Touch, [f64; 2])> {
        self.touch_from(&self.spheres[index], &self.velocities[index], candidate)
    }

    /// As [`ContactScene::touch`], for a particle whose records the caller holds.
    #[inline(always)]
    fn touch_from(&self, i: &Sphere, a: &Velocity, candidate: Candidate) -> Option<(Touch, [f64; 2])> {
        let partner = candidate.partner as usize;
        let j = &self.spheres[partner];
        let mut branch = j.position() - i.position();
        if candidate.image != NO_IMAGE {
            branch += self.images.offset(candidate.image);
        }
        let square = branch.norm_squared();
        let sum = i.radius + j.radius;
        if square >= sum * sum {
            return None;
        }
        let distance = square.sqrt();
        let normal = branch * (1.0 / distance);
        let overlap = sum - distance;
        let b = &self.velocities[partner];
        let levers = [i.radius - 0.5 * overlap, j.radius - 0.5 * overlap];
        let (spin_a, spin_b) = (Vec3::from(a.angular), Vec3::from(b.angular));
        let inverse =
            |velocity: &Velocity, radius: f64| velocity.inverse_mass / (self.inertia_factor * radius * radius);
        let touch = Touch {
            normal,
            overlap,
            velocity: Vec3::from(a.linear) - Vec3::from(b.linear),
            lever_spin: spin_a * levers[0] + spin_b * levers[1],
            relative_spin: spin_a - spin_b,
            effective_radius: i.radius * j.radius / sum,
            effective_mass: 1.0 / (a.inverse_mass + b.inverse_mass),
            inverse_inertia: inverse(a, i.radius) + inverse(b, j.radius),
            closing_lag: 0.0,
        };
        Some((touch, levers))
    }

    /// Closing speed that the laws see less its mean over the time step [m/s]: half a time step of acceleration, unless the
    /// laws see half-step velocities.
    #[inline(always)]
    #[must_use]
    pub fn closing_lag(&self, acceleration: &Vec3, normal: &Vec3) -> f64 {
        match self.law.settings.compatibility {
            Compatibility::Tollgate => 0.5 * self.timestep * acceleration.dot(normal),
            Compatibility::Liggghts => 0.0,
        }
    }
}

/// Adds the loads of a chunk's pairs. `first` is the chunk's first particle, `loads` its particles' loads. With `BOTH` the
/// partners lie in the chunk too and get theirs; else only the row's particle does.
pub fn add_pair_loads<const BOTH: bool, const FRICTION: bool, const ROLLING: bool, const ENERGY: bool>(
    scene: &ContactScene,
    first: usize,
    list: &mut InnerList,
    loads: &mut [Load],
    springs: &mut [Vec3],
    tally: &mut Tally,
) {
    let remembers = FRICTION || ROLLING;
    let share = if BOTH { 1.0 } else { 0.5 };
    // Copies: what is written below could otherwise change them, as far as the compiler knows.
    let (settings, single) = (scene.law.settings, scene.law.single_pair());
    for row in 0..loads.len() {
        let index = first + row;
        let mut own = Load::ZERO;
        let (sphere, a) = (scene.spheres[index], scene.velocities[index]);
        for entry in list.row(row) {
            let candidate = list.candidates[entry];
            let partner = candidate.partner as usize;
            let Some((mut touch, levers)) = scene.touch_from(&sphere, &a, candidate) else {
                if remembers {
                    forget::<ENERGY>(scene, index, partner, &mut list.memory[entry], tally, share);
                }
                continue;
            };
            let b = &scene.velocities[partner];
            if a.path.is_prescribed() && b.path.is_prescribed() {
                if remembers {
                    list.memory[entry] = Memory::NONE;
                }
                continue;
            }
            let smaller_radius = levers[0].min(levers[1]) + 0.5 * touch.overlap;
            if touch.overlap > scene.overlap_limit * smaller_radius {
                let ratio = touch.overlap / smaller_radius;
                let deep = DeepContact { particle: index as u32, partner: Some(candidate.partner), part: None, ratio };
                tally.note_deep(deep);
            }
            if ENERGY {
                let acceleration = scene.accelerations[index].linear - scene.accelerations[partner].linear;
                touch.closing_lag = scene.closing_lag(&acceleration, &touch.normal);
            }
            let pair = single.as_ref().unwrap_or_else(|| scene.law.pair(a.material, b.material));
            let mut none = Memory::NONE;
            let memory = if remembers { &mut list.memory[entry] } else { &mut none };
            let result: Answer =
                answer::<FRICTION, ROLLING, ENERGY>(&settings, pair, &touch, scene.timestep, memory, tally, share);
            own.force += result.force;
            if ENERGY {
                let spring = touch.normal * result.normal.elastic;
                springs[row] -= spring;
                if BOTH {
                    springs[partner - first] += spring;
                }
            }
            if FRICTION || ROLLING {
                own.torque += result.twist * levers[0] + result.rolling;
            }
            if BOTH {
                let other = &mut loads[partner - first];
                other.force -= result.force;
                if FRICTION || ROLLING {
                    other.torque += result.twist * levers[1] - result.rolling;
                }
            }
        }
        loads[row].force += own.force;
        loads[row].torque += own.torque;
    }
}

/// Two particles that do not touch have no memory of each other. What a linear spring still held is lost in sliding.
#[inline(always)]
fn forget<const ENERGY: bool>(
    scene: &ContactScene,
    index: usize,
    partner: usize,
    memory: &mut Memory,
    tally: &mut Tally,
    share: f64,
) {
    if *memory == Memory::NONE {
        return;
    }
    if ENERGY && scene.law.is_linear() {
        let (a, b) = (&scene.velocities[index], &scene.velocities[partner]);
        let radii = (scene.spheres[index].radius, scene.spheres[partner].radius);
        let motion = NormalMotion {
            overlap: 0.0,
            closing_speed: 0.0,
            effective_radius: radii.0 * radii.1 / (radii.0 + radii.1),
            effective_mass: 1.0 / (a.inverse_mass + b.inverse_mass),
        };
        tally.slip += share * left_in_spring(scene.law, scene.law.pair(a.material, b.material), &motion, memory);
    }
    *memory = Memory::NONE;
}

/// Energy [J] that the tangential spring of a linear contact still holds as it ends.
#[must_use]
pub fn left_in_spring(law: &LawTable, pair: &PairConstants, motion: &NormalMotion, memory: &Memory) -> f64 {
    let stiffness = law.settings.normal_force(pair, motion).tangential_stiffness;
    tangential_energy(&law.settings, stiffness, &memory.tangential)
}

/// A contact as an observer sees it, at the present full step.
#[derive(Debug, Clone, Copy)]
pub struct SeenContact {
    /// Relative motion.
    pub touch: Touch,
    /// Lever arm of the first body [m].
    pub lever: f64,
    /// Forces and torques.
    pub answer: Answer,
    /// Elastic energy [J].
    pub elastic_energy: f64,
    /// Memory as it is kept.
    pub kept: Memory,
}

/// Looks at a contact without moving its memory.
#[must_use]
pub fn look(scene: &ContactScene, index: usize, candidate: Candidate, kept: Option<&Memory>) -> Option<SeenContact> {
    let (touch, levers) = scene.touch(index, candidate)?;
    let material = |particle: usize| scene.velocities[particle].material;
    let pair = scene.law.pair(material(index), material(candidate.partner as usize));
    let kept = kept.copied().unwrap_or(Memory::NONE);
    Some(seen(&scene.law.settings, pair, &touch, levers[0], scene.timestep, &kept))
}

/// A contact of known relative motion, seen without moving its memory.
#[must_use]
pub fn seen(
    settings: &LawSettings,
    pair: &PairConstants,
    touch: &Touch,
    lever: f64,
    timestep: f64,
    kept: &Memory,
) -> SeenContact {
    let mut memory = present_memory(settings, pair, touch, timestep, kept);
    let before = memory;
    let mut tally = Tally::default();
    let answer = answer::<true, true, false>(settings, pair, touch, 0.0, &mut memory, &mut tally, 1.0);
    let elastic_energy = elastic_energy(settings, &answer.normal, &before);
    SeenContact { touch: *touch, lever, answer, elastic_energy, kept: *kept }
}
