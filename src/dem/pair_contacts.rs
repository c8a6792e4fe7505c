//! Contacts between particles: the loop that costs the time, several pairs at once.

use super::contact::{Springs, answer};
use super::energy::{DeepContact, Tally};
use super::law::constants::{LawTable, PairConstants};
use super::law::tangential::tangential_energy;
use super::law::{LawSettings, NormalContact};
use super::meeting::{Block, ContactScene, Near};
use super::neighbor::list::{Images, InnerList, Memory, PairMemory, effective_mass, effective_radius};
use super::particles::Load;
use super::resting::{Rest, Run};
use super::touched::Effects;
use crate::math::Vec3;
use crate::math::lanes::{LaneVector, Lanes, MOST_LANES, Mask};
use std::ops::Range;

/// Blocks of lanes that go through the kernel's passes together: what passes hand on stays in the nearest cache.
const TOGETHER: usize = 8;

/// What the first pass finds about a block.
#[derive(Clone, Copy)]
struct Placed<L: Lanes> {
    near: Near<L>,
    touches: L::Mask,
}

/// What the second pass finds: forces on owners (on partners the opposite), and torques on both; nothing in lanes that do not touch.
#[derive(Clone, Copy)]
struct Pushed<L> {
    force: LaneVector<L>,
    torques: [LaneVector<L>; 2],
}

impl<L: Lanes> Placed<L> {
    #[inline(always)]
    fn nowhere() -> Self {
        let zero = L::zero();
        let near = Near { branch: LaneVector::zeros(), square: zero, radii: [zero; 2], sum: zero };
        Self { near, touches: L::Mask::from_bits(0) }
    }
}

impl<L: Lanes> Pushed<L> {
    #[inline(always)]
    fn nothing() -> Self {
        Self { force: LaneVector::zeros(), torques: [LaneVector::zeros(); 2] }
    }
}

/// A chunk's pairs and what is the same for all of them.
pub struct PairKernel<'a, L: Lanes, const BOTH: bool, const FRICTION: bool, const ROLLING: bool, const ENERGY: bool> {
    scene: &'a ContactScene<'a>,
    first: usize,
    has_prescribed: bool,
    settings: LawSettings,
    single: Option<PairConstants<L>>,
}

impl<'a, L: Lanes, const BOTH: bool, const FRICTION: bool, const ROLLING: bool, const ENERGY: bool>
    PairKernel<'a, L, BOTH, FRICTION, ROLLING, ENERGY>
{
    /// `first` is the chunk's first particle. With `BOTH` the partners lie in the chunk too and get their loads; else only the
    /// pairs' owners do.
    #[inline(always)]
    #[must_use]
    pub fn new(scene: &'a ContactScene<'a>, first: usize, has_prescribed: bool) -> Self {
        let single = scene.only_material.map(|material| PairConstants::everywhere(scene.law.pair(material, material)));
        Self { scene, first, has_prescribed, settings: scene.law.settings, single }
    }

    /// Share of a pair's losses that is booked here.
    const SHARE: f64 = if BOTH { 1.0 } else { 0.5 };

    /// Adds the loads of the list's pairs to those of the chunk's particles, in the list's order: the number of lanes changes no bit.
    #[inline(always)]
    pub fn add_loads(&self, list: &mut InnerList, effects: &mut Effects) {
        // Summed apart from the other losses: how many blocks go together must not change the order.
        let mut ended = 0.0;
        let whole = [Run::moving(list.len())];
        let sorted = self.scene.sleeping.then(|| list.runs_by_rest(self.scene.velocities));
        for run in sorted.as_deref().unwrap_or(&whole) {
            if run.rest != Rest::Known {
                self.compute(list, run, effects, &mut ended);
            }
            if run.rest != Rest::Moving {
                self.add_kept(list, run.pairs.clone(), effects.loads);
            }
        }
        effects.tally.slip += Self::SHARE * ended;
    }

    /// Adds the loads of a run of moving pairs, or keeps those of pairs that have come to rest: these lose nothing, and remember
    /// what they did.
    #[inline(always)]
    fn compute(&self, list: &mut InnerList, run: &Run, effects: &mut Effects, ended: &mut f64) {
        let Effects { loads, springs, tally, touched } = effects;
        let rests = run.rest == Rest::New;
        let held = rests.then(|| list.memory.part(run.pairs.clone()));
        let (mut no_tally, mut none_ended) = (Tally::default(), 0.0);
        let (tally, ended) = if rests { (&mut no_tally, &mut none_ended) } else { (&mut **tally, ended) };
        let first = run.pairs.start;
        let blocks = run.pairs.len().div_ceil(L::COUNT);
        let mut placed = [Placed::<L>::nowhere(); TOGETHER];
        let mut pushed = [Pushed::<L>::nothing(); TOGETHER];
        for start in (0..blocks).step_by(TOGETHER) {
            let together = TOGETHER.min(blocks - start);
            let from = |number: usize| first + (start + number) * L::COUNT;
            for (number, placed) in placed[..together].iter_mut().enumerate() {
                *placed = self.place(list, from(number), ended);
            }
            for number in 0..together {
                if placed[number].touches.any() {
                    pushed[number] = self.push(list, from(number), &placed[number], springs, tally);
                } else if FRICTION || ROLLING {
                    write_springs::<L, FRICTION, ROLLING>(&mut list.memory, from(number), &Springs::none());
                }
            }
            if rests {
                for number in 0..together {
                    let pushed = if placed[number].touches.any() { pushed[number] } else { Pushed::nothing() };
                    list.resting.keep(from(number), &pushed.force, &pushed.torques);
                }
                continue;
            }
            for number in (0..together).filter(|&number| placed[number].touches.any()) {
                let block = Block::of::<L>(list, from(number));
                self.add(&block, &pushed[number], loads);
                touched.note(block.own, placed[number].touches.bits());
                if BOTH {
                    touched.note(block.partner, placed[number].touches.bits());
                }
            }
        }
        if let Some(held) = held {
            list.memory.put_back(first, &held);
        }
    }

    /// Adds the loads of a run of pairs at rest.
    #[inline(always)]
    fn add_kept(&self, list: &InnerList, pairs: Range<usize>, loads: &mut [Load]) {
        for from in pairs.step_by(L::COUNT) {
            let (force, torques) = list.resting.kept(from);
            self.add(&Block::of::<L>(list, from), &Pushed { force, torques }, loads);
        }
    }

    /// First pass: who touches.
    #[inline(always)]
    fn place(&self, list: &InnerList, from: usize, ended: &mut f64) -> Placed<L> {
        let block = Block::of::<L>(list, from);
        // The last block repeats its last pair in lanes that count for nothing.
        let counted = L::first(list.len() - from);
        let shift = list.has_images().then(|| images::<L>(self.scene.images, list, from));
        let near = self.scene.near::<L>(&block, shift);
        let overlaps = near.square.below(near.sum * near.sum) & counted;
        if ENERGY && self.scene.law.is_linear() {
            add_ended(self.scene, &block, (!overlaps & counted).bits(), &list.memory, from, ended);
        }
        let touches = if self.has_prescribed { overlaps & !both_prescribed::<L>(self.scene, &block) } else { overlaps };
        Placed { near, touches }
    }

    /// Second pass: the laws.
    #[inline(always)]
    fn push(
        &self,
        list: &mut InnerList,
        from: usize,
        Placed { near, touches }: &Placed<L>,
        springs: &mut [Vec3],
        tally: &mut Tally,
    ) -> Pushed<L> {
        let (scene, block) = (self.scene, Block::of::<L>(list, from));
        let depth = scene.depth(near);
        let smaller_radius = near.radii[0].smaller(near.radii[1]);
        let deep = depth.overlap.exceeds(L::splat(scene.overlap_limit) * smaller_radius) & *touches;
        if deep.any() {
            note_deep(block, (depth.overlap / smaller_radius).to_array(), deep.bits(), tally);
        }
        let effective_radius = L::from_slice(&list.effective_radii[from..]);
        let effective_mass = L::from_slice(&list.effective_masses[from..]);
        let mut touch = scene.touch::<L, ROLLING>(&block, near, &depth, [effective_radius, effective_mass]);
        if ENERGY {
            touch.closing_lag = pair_lag(scene, &block, &touch.normal);
        }
        let several;
        let pair = match &self.single {
            Some(pair) => pair,
            None => {
                several = pairs_of(scene, &block);
                &several
            }
        };
        let stiffness = self.settings.stiffness(pair, &touch.normal_contact());
        let mut held = read_springs::<L, FRICTION, ROLLING>(&list.memory, from);
        let (law, timestep) = (&self.settings, scene.timestep);
        let result = answer::<L, FRICTION, ROLLING, ENERGY>(law, pair, &stiffness, &touch, timestep, &mut held);
        if ENERGY {
            let (bits, elastic) = (touches.bits(), stiffness.elastic);
            result.lost.book(Self::SHARE, bits, tally);
            book_normal_springs::<L, BOTH>(&block, self.first, bits, &touch.normal, elastic, springs);
        }
        if FRICTION || ROLLING {
            let kept = Springs { tangential: held.tangential.only(*touches), rolling: held.rolling.only(*touches) };
            write_springs::<L, FRICTION, ROLLING>(&mut list.memory, from, &kept);
        }
        // Nothing of lanes that do not touch, whatever came out there.
        let mut pushed = Pushed { force: result.force.only(*touches), ..Pushed::nothing() };
        if FRICTION || ROLLING {
            let [own, partner] = depth.levers;
            let (mut torque, mut counter_torque) = (result.twist * own, result.twist * partner);
            if ROLLING {
                torque = torque + result.rolling;
                counter_torque = counter_torque - result.rolling;
            }
            pushed.torques = [torque.only(*touches), counter_torque.only(*touches)];
        }
        pushed
    }

    /// Third pass: forces and torques go to the particles.
    #[inline(always)]
    fn add(&self, block: &Block, pushed: &Pushed<L>, loads: &mut [Load]) {
        debug_assert!(block.own.iter().all(|&index| (index as usize).wrapping_sub(self.first) < loads.len()));
        // Indices count from the first of all particles.
        let rows: *mut [f64; 8] = loads.as_mut_ptr().cast::<[f64; 8]>().wrapping_sub(self.first);
        let (zero, force) = (L::zero(), [pushed.force.x, pushed.force.y, pushed.force.z]);
        let [own, partner] = &pushed.torques;
        let turns = [[own.x, own.y, own.z], [partner.x, partner.y, partner.z]];
        // SAFETY: loads are rows of eight numbers; the owners of a chunk's pairs are the chunk's own particles, and with `BOTH` so
        // are their partners.
        unsafe {
            if BOTH {
                L::add_action(rows, [block.own, block.partner], force, turns);
            } else {
                let ([x, y, z], [a, b, c]) = (force, turns[0]);
                L::add_to_rows(rows, [block.own], [[x, y, z, zero, a, b, c, zero]]);
            }
        }
    }
}

#[inline(always)]
pub(super) fn read_springs<L: Lanes, const FRICTION: bool, const ROLLING: bool>(
    memory: &PairMemory,
    from: usize,
) -> Springs<L> {
    let mut springs = Springs::none();
    if FRICTION || ROLLING {
        springs.tangential = LaneVector::read_from(&memory.tangential, from);
    }
    if ROLLING {
        springs.rolling = LaneVector::read_from(&memory.rolling, from);
    }
    springs
}

#[inline(always)]
fn write_springs<L: Lanes, const FRICTION: bool, const ROLLING: bool>(
    memory: &mut PairMemory,
    from: usize,
    springs: &Springs<L>,
) {
    if FRICTION || ROLLING {
        springs.tangential.write_to(&mut memory.tangential, from);
    }
    if ROLLING {
        springs.rolling.write_to(&mut memory.rolling, from);
    }
}

/// Offsets of the images that the lanes' partners are [m].
#[inline(always)]
pub(super) fn images<L: Lanes>(images: &Images, list: &InnerList, from: usize) -> LaneVector<L> {
    let mut lists = [[0.0; MOST_LANES]; 3];
    for lane in 0..L::COUNT {
        let offset = images.offset(list.candidate(from + lane).image);
        lists.iter_mut().zip(offset.iter()).for_each(|(list, component)| list[lane] = *component);
    }
    LaneVector::read_from(&lists, 0)
}

/// Lanes of two prescribed particles: they do not act on each other.
#[inline(always)]
pub(super) fn both_prescribed<L: Lanes>(scene: &ContactScene, block: &Block) -> L::Mask {
    let prescribed = |index: u32| scene.velocities[index as usize].path.is_prescribed();
    let both = |lane: &usize| prescribed(block.own[*lane]) && prescribed(block.partner[*lane]);
    L::Mask::from_bits((0..L::COUNT).filter(both).fold(0, |bits, lane| bits | 1 << lane))
}

/// Constants of the lanes' materials.
#[inline(always)]
pub(super) fn pairs_of<L: Lanes>(scene: &ContactScene, block: &Block) -> PairConstants<L> {
    let material = |index: u32| scene.velocities[index as usize].material;
    scene.law.pairs(|lane| [material(block.own[lane]), material(block.partner[lane])])
}

/// [`ContactScene::closing_lag`] of every lane.
#[inline(always)]
fn pair_lag<L: Lanes>(scene: &ContactScene, block: &Block, normal: &LaneVector<L>) -> L {
    let acceleration = |index: u32| scene.accelerations[index as usize].linear;
    let [x, y, z] = normal.to_arrays();
    let mut lags = [0.0; MOST_LANES];
    for lane in 0..L::COUNT {
        let relative = acceleration(block.own[lane]) - acceleration(block.partner[lane]);
        lags[lane] = scene.closing_lag(&relative, &Vec3::new(x[lane], y[lane], z[lane]));
    }
    L::from_slice(&lags)
}

/// Keeps the force of the normal springs on each particle apart, for the budget.
#[inline(always)]
fn book_normal_springs<L: Lanes, const BOTH: bool>(
    block: &Block,
    first: usize,
    touches: u16,
    normal: &LaneVector<L>,
    elastic: L,
    springs: &mut [Vec3],
) {
    let [x, y, z] = (*normal * elastic).to_arrays();
    for lane in (0..L::COUNT).filter(|lane| touches >> lane & 1 == 1) {
        let spring = Vec3::new(x[lane], y[lane], z[lane]);
        springs[block.own[lane] as usize - first] -= spring;
        if BOTH {
            springs[block.partner[lane] as usize - first] += spring;
        }
    }
}

#[cold]
#[inline(never)]
fn note_deep(block: Block, ratio: [f64; MOST_LANES], deep: u16, tally: &mut Tally) {
    for lane in (0..block.own.len()).filter(|lane| deep >> lane & 1 == 1) {
        let (particle, partner) = (block.own[lane], Some(block.partner[lane]));
        tally.note_deep(DeepContact { particle, partner, part: None, ratio: ratio[lane] });
    }
}

/// Two particles that do not touch have no memory of each other. What a linear spring still held is lost in sliding [J].
fn add_ended(scene: &ContactScene, block: &Block, apart: u16, memory: &PairMemory, from: usize, ended: &mut f64) {
    for lane in (0..block.own.len()).filter(|lane| apart >> lane & 1 == 1) {
        let Some(memory) = memory.get(from + lane).filter(|memory| *memory != Memory::NONE) else { continue };
        let indices = [block.own[lane] as usize, block.partner[lane] as usize];
        let ([a, b], radii) =
            (indices.map(|index| &scene.velocities[index]), indices.map(|index| scene.spheres[index].radius));
        let contact = NormalContact {
            overlap: 0.0,
            effective_radius: effective_radius(radii[0], radii[1]),
            effective_mass: effective_mass([a.inverse_mass, b.inverse_mass]),
        };
        *ended += left_in_spring(scene.law, scene.law.pair(a.material, b.material), &contact, &memory);
    }
}

/// Energy [J] that the tangential spring of a linear contact still holds as it ends.
#[must_use]
pub fn left_in_spring(law: &LawTable, pair: &PairConstants, contact: &NormalContact, memory: &Memory) -> f64 {
    let stiffness = law.settings.stiffness(pair, contact).tangential_stiffness;
    tangential_energy(&law.settings, stiffness, &memory.tangential.into())
}
