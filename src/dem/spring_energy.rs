//! What the springs of all contacts hold: looked at by all threads, several contacts at once.

use super::contact::{Springs, elastic_energy};
use super::law::constants::PairConstants;
use super::meeting::{Block, ContactScene};
use super::neighbor::list::InnerList;
use super::pair_contacts::{both_prescribed, images, pairs_of, read_springs};
use super::seen::present_springs;
use super::simulation::Simulation;
use crate::math::lanes::{LaneWork, Lanes, Mask, at_level};

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
            let overlaps = near.square.below(near.sum * near.sum) & L::first(list.len() - from);
            let touches = overlaps & !both_prescribed::<L>(scene, &block);
            if !touches.any() {
                continue;
            }
            let depth = scene.depth(&near);
            let effective =
                [L::from_slice(&list.effective_radii[from..]), L::from_slice(&list.effective_masses[from..])];
            let touch = scene.touch::<L, true>(&block, &near, &depth, effective);
            let pair = single.unwrap_or_else(|| pairs_of(scene, &block));
            let stiffness = scene.law.settings.stiffness(&pair, &touch.normal_contact());
            let kept =
                if scene.remembers { read_springs::<L, true, false>(&list.memory, from) } else { Springs::none() };
            let springs = present_springs(scene, &stiffness, &touch, kept);
            let energy = elastic_energy(&scene.law.settings, &stiffness, &springs).to_array();
            let mine =
                |lane: &usize| touches.bits() >> lane & 1 == 1 && (both || block.own[*lane] < block.partner[*lane]);
            energies.extend((0..L::COUNT).filter(mine).map(|lane| energy[lane]));
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::law::TangentialLaw;
    use super::super::particles::Path;
    use super::super::simulation::Setup;
    use super::super::step::tests::{grain, setup};
    use super::*;
    use crate::geometry::motion::Motion;
    use crate::geometry::part::{Part, Surface, Trigger};
    use crate::material::PairContact;
    use crate::math::lanes::SimdLevel;
    use crate::math::{Bounds, Vec3, vec3};
    use crate::particle::ParticleId;

    /// Grains along an edge of the heap.
    const SIDE: u64 = 10;
    /// Distance of their centres [m]: they overlap.
    const PITCH: f64 = 1.95e-3;

    /// A floor under a box that is periodic along x, and two materials.
    fn box_of(simd: SimdLevel, tangential: TangentialLaw, friction: bool) -> Setup {
        let width = PITCH * SIDE as f64;
        let mut setup = Setup { simd, threads: 2, periodic: [true, false, false], overlap_limit: 0.9, ..setup() };
        setup.domain = Bounds { minimum: [0.0, -width, -width], maximum: [width, 2.0 * width, 2.0 * width] };
        setup.law.tangential = tangential;
        let wall = setup.materials.materials[0].clone();
        setup.materials = crate::material::MaterialTable::new(vec![wall.clone(), wall]);
        for (a, b, coefficient) in [(0, 0, 0.5), (0, 1, 0.7), (1, 1, 0.9)] {
            let sliding_friction = if friction { 1.0 - coefficient } else { 0.0 };
            let contact = PairContact::Restitution { coefficient };
            let properties = crate::material::PairProperties { contact, sliding_friction, rolling_friction: 0.0 };
            setup.materials.set_pair(a, b, properties);
        }
        setup.parts = vec![Part {
            name: "floor".to_owned(),
            material: 1,
            surface: Surface::Plane { point: Vec3::zeros(), normal: Vec3::z() },
            motion: Motion::default(),
            appears: Trigger::Always,
            disappears: Trigger::Never,
        }];
        setup
    }

    /// Grains of both materials in each other's way over the periodic border and on the floor, in several chunks; some are ghosts.
    fn heap(setup: Setup) -> Simulation {
        let states: Vec<_> = (0..SIDE.pow(3))
            .map(|k| {
                let [i, j, l] = [k % SIDE, k / SIDE % SIDE, k / SIDE / SIDE].map(|place| place as f64);
                let mut state = grain(k, 0.0);
                state.position = vec3(i + 0.5, j, l + 0.5) * PITCH;
                // Somehow, but not alike.
                state.velocity = vec3((7.0 * k as f64).sin(), (3.0 * k as f64).cos(), (5.0 * k as f64).sin()) * 0.2;
                state.radius *= 0.97 + 0.03 * (11.0 * k as f64).sin();
                state.material = u16::from(k % 3 == 0);
                state
            })
            .collect();
        let mut simulation = Simulation::new(setup);
        simulation.insert(&states);
        simulation
            .prescribe(&states.iter().step_by(7).map(|state| state.id).collect::<Vec<ParticleId>>(), Path::Constant);
        for _ in 0..20 {
            simulation.step().expect("it is stable");
        }
        simulation
    }

    #[test]
    fn they_are_those_of_the_contacts_one_by_one_on_every_instruction_set() {
        for level in SimdLevel::ALL.into_iter().filter(|level| level.is_available()) {
            for tangential in [TangentialLaw::Total, TangentialLaw::Incremental] {
                for friction in [true, false] {
                    let heap = heap(box_of(level, tangential, friction));
                    let mut expected = Vec::new();
                    heap.for_each_contact(|_, _, _, seen| expected.push(seen.elastic_energy.to_bits()));
                    let found: Vec<u64> = heap.spring_energies().into_iter().flatten().map(f64::to_bits).collect();
                    assert!(heap.neighborhood.chunks.iter().all(|chunk| !chunk.cross.is_empty()), "several chunks");
                    assert!(expected.len() > 1000, "only {} contacts", expected.len());
                    assert_eq!(found, expected, "{} {tangential:?} {friction}", level.name());
                }
            }
        }
    }
}
