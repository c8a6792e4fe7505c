//! What the springs of all contacts hold: looked at by all threads, several contacts at once.

use super::contact::elastic_energy;
use super::law::constants::PairConstants;
use super::meeting::{Block, ContactScene};
use super::neighbor::list::InnerList;
use super::pair_contacts::{both_prescribed, images, pairs_of, read_springs};
use super::seen::present_springs;
use super::simulation::Simulation;
use crate::math::lanes::{LaneWork, Lanes, MOST_LANES, Mask, at_level};

impl Simulation {
    /// Elastic energies of all contacts [J], chunk by chunk in the order of [`Simulation::for_each_contact`], and the same bits.
    pub(super) fn spring_energies(&self) -> Vec<Vec<f64>> {
        let velocities = self.particles.velocities();
        let (scene, simd) = (&self.contact_scene(&velocities), self.setup.simd);
        self.threads.map(self.neighborhood.chunks.len(), |number| {
            let chunk = &self.neighborhood.chunks[number];
            let mut energies = Vec::new();
            for (list, both) in [(&chunk.own, true), (&chunk.cross, false)] {
                at_level(simd, PairSprings { scene, list, both, energies: &mut energies });
            }
            self.for_each_wall_contact(scene, &chunk.walls, |_| true, &mut |_, _, _, seen| {
                energies.push(seen.elastic_energy);
            });
            energies
        })
    }
}

/// Appends the elastic energies [J] of a list's pairs that touch, in their order.
struct PairSprings<'a> {
    scene: &'a ContactScene<'a>,
    list: &'a InnerList,
    /// Whether the list has every pair once. Else a pair counts at its lower index.
    both: bool,
    energies: &'a mut Vec<f64>,
}

impl LaneWork for PairSprings<'_> {
    type Output = ();

    #[inline(always)]
    fn run<L: Lanes>(self) {
        let Self { scene, list, both, energies } = self;
        let single = scene.only_material.map(|material| PairConstants::everywhere(scene.law.pair(material, material)));
        for from in (0..list.len()).step_by(L::COUNT) {
            let block = Block::of::<L>(list, from);
            let near = scene.near::<L>(&block, list.has_images().then(|| images::<L>(scene.images, list, from)));
            let counted = L::Mask::from_bits(u16::MAX >> (MOST_LANES - (list.len() - from).min(L::COUNT)));
            let touches = near.square.below(near.sum * near.sum) & counted & !both_prescribed::<L>(scene, &block);
            if !touches.any() {
                continue;
            }
            let depth = scene.depth(&near);
            let effective =
                [L::from_slice(&list.effective_radii[from..]), L::from_slice(&list.effective_masses[from..])];
            let touch = scene.touch::<L, true>(&block, &near, &depth, effective);
            let pair = single.unwrap_or_else(|| pairs_of(scene, &block));
            let stiffness = scene.law.settings.stiffness(&pair, &touch.normal_contact());
            let kept = if scene.remembers {
                read_springs::<L, true, false>(&list.memory, from)
            } else {
                read_springs::<L, false, false>(&list.memory, from)
            };
            let springs = present_springs(scene, &stiffness, &touch, kept);
            let energy = elastic_energy(&scene.law.settings, &stiffness, &springs).to_array();
            let mine =
                |lane: &usize| touches.bits() >> lane & 1 == 1 && (both || block.own[*lane] < block.partner[*lane]);
            energies.extend((0..L::COUNT).filter(mine).map(|lane| energy[lane]));
        }
    }
}
