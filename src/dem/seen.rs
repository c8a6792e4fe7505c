//! Contacts as observers see them: looked at, not moved.

use super::contact::{Springs, Touch, answer, elastic_energy, present_memory};
use super::law::ContactStiffness;
use super::law::constants::PairConstants;
use super::meeting::{Block, ContactScene};
use super::neighbor::list::{Candidate, Memory, effective_mass, effective_radius};
use crate::math::Vec3;
use crate::math::lanes::Lanes;

/// A contact as an observer sees it, at the present full step.
#[derive(Debug, Clone, Copy)]
pub struct SeenContact {
    /// Unit normal to the other body.
    pub normal: Vec3,
    /// Overlap [m].
    pub overlap: f64,
    /// Lever arm of the first body [m].
    pub lever: f64,
    /// Force on the first body [N].
    pub force: Vec3,
    /// Repulsion along the normal [N].
    pub normal_force: f64,
    /// Elastic energy [J].
    pub elastic_energy: f64,
    /// Memory as it is kept.
    pub kept: Memory,
}

/// Overlap over the smaller radius of particle `index` and a candidate [-], where they touch.
#[must_use]
pub fn overlap_ratio(scene: &ContactScene, index: usize, candidate: Candidate) -> Option<f64> {
    let prescribed = |index: usize| scene.velocities[index].path.is_prescribed();
    let near = scene.near_pair(index, candidate);
    let touches = near.square < near.sum * near.sum && !(prescribed(index) && prescribed(candidate.partner as usize));
    touches.then(|| (near.sum - near.square.sqrt()) / near.radii[0].min(near.radii[1]))
}

/// Looks at a contact without moving its memory.
#[must_use]
pub fn look(scene: &ContactScene, index: usize, candidate: Candidate, kept: Option<&Memory>) -> Option<SeenContact> {
    let block = Block { own: &[index as u32], partner: &[candidate.partner] };
    let near = scene.near_pair(index, candidate);
    if near.square >= near.sum * near.sum {
        return None;
    }
    let [a, b] = [index, candidate.partner as usize].map(|index| &scene.velocities[index]);
    let radius = effective_radius(near.radii[0], near.radii[1]);
    let mass = effective_mass([a.inverse_mass, b.inverse_mass]);
    let depth = scene.depth(&near);
    let touch = scene.touch::<f64, true>(&block, &near, &depth, [radius, mass]);
    let pair = scene.law.pair(a.material, b.material);
    let kept = kept.copied().unwrap_or(Memory::NONE);
    Some(seen(scene, pair, &touch, depth.levers[0], &kept))
}

/// The springs of contacts at the present full step. Where contacts have no memory, nothing is in them.
#[inline(always)]
#[must_use]
pub fn present_springs<L: Lanes>(
    scene: &ContactScene,
    stiffness: &ContactStiffness<L>,
    touch: &Touch<L>,
    kept: Springs<L>,
) -> Springs<L> {
    if scene.remembers {
        present_memory(&scene.law.settings, stiffness, touch, scene.timestep, kept)
    } else {
        Springs::none()
    }
}

/// A contact of known relative motion, seen without moving its memory.
#[must_use]
pub fn seen(scene: &ContactScene, pair: &PairConstants, touch: &Touch, lever: f64, kept: &Memory) -> SeenContact {
    let settings = &scene.law.settings;
    let stiffness = settings.stiffness(pair, &touch.normal_contact());
    let before = present_springs(scene, &stiffness, touch, kept.into());
    let mut memory = before;
    let answer = answer::<f64, true, true, false>(settings, pair, &stiffness, touch, 0.0, &mut memory);
    SeenContact {
        normal: touch.normal.into(),
        overlap: touch.overlap,
        lever,
        force: answer.force.into(),
        normal_force: answer.repulsion,
        elastic_energy: elastic_energy(settings, &stiffness, &before),
        kept: *kept,
    }
}
