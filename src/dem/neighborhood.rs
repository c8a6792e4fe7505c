//! The solver's knowledge of who is near whom, and when it must be renewed.

use super::energy::Tally;
use super::neighbor::cells::{CellLevels, Space};
use super::neighbor::chunks::chunk_ranges;
use super::neighbor::history::HeldMemory;
use super::neighbor::list::{Images, InnerList, Memory, Remembered};
use super::neighbor::prune::{Bodies, PruningScratch};
use super::neighbor::search::{ChunkCandidates, find_candidates};
use super::particles::{Particles, Sphere, Velocity};
use super::sleep::ChunkRest;
use super::survey::{displacement_unless, only_material, radii};
use super::threads::Threads;
use super::touched::Touched;
use super::wall::Walls;
use super::wall_contacts::PartLoad;
use super::wall_list::{WallContact, WallList};
use super::wall_search::Scratch;
use super::wear::{RENEW_SHARE, Wear};
use crate::math::lanes::SimdLevel;
use crate::math::{Bounds, Vec3};
use serde::{Deserialize, Serialize};
use std::ops::Range;

/// One fixed piece of work: a run of particles with their pairs and contacts.
#[derive(Debug, Default)]
pub struct Chunk {
    /// Its particles, by storage index.
    pub range: Range<usize>,
    /// Pairs within the outer skin.
    pub candidates: ChunkCandidates,
    /// Pairs within the chunk that the kernel walks.
    pub own: InnerList,
    /// Pairs with other chunks that the kernel walks.
    pub cross: InnerList,
    /// Whether some of its particles may be prescribed.
    pub has_prescribed: bool,
    /// Elements of parts near its particles, and contacts with them.
    pub walls: WallList,
    /// Scratch lists.
    pub(super) scratch: Scratch,
    /// Storage of own and cross lists that are not used any more.
    worn: [InnerList; 2],
    /// Who of its particles is touched.
    pub(super) touched: Touched,
    /// What its contacts took in this time step.
    pub tally: Tally,
    /// Force of the normal springs on each of its particles [N]; empty where losses are not accounted for.
    pub springs: Vec<Vec3>,
    /// What its particles do to each part.
    pub part_loads: Vec<PartLoad>,
    /// What is known of its rest.
    pub rest: ChunkRest,
    /// Whether its loads were looked at and all are numbers far from overflow.
    pub is_moderate: bool,
}

/// What the lists are made with.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct ListSettings {
    /// Outer skin [m].
    pub skin: f64,
    /// Domain.
    pub domain: Bounds,
    /// Periodic axes.
    pub periodic: [bool; 3],
    /// Whether contacts have a memory.
    pub remembers: bool,
    /// Whether they remember rolling too.
    pub remembers_rolling: bool,
}

impl ListSettings {
    const fn remembered(&self) -> Remembered {
        Remembered { tangential: self.remembers, rolling: self.remembers_rolling }
    }
}

/// Chunks, cells, and how far the particles have moved since they were made.
#[derive(Debug)]
pub struct Neighborhood {
    /// The chunks, in storage order.
    pub chunks: Vec<Chunk>,
    /// Periodic images.
    pub images: Images,
    cells: CellLevels,
    settings: ListSettings,
    /// Instruction set that lists are made with.
    simd: SimdLevel,
    /// Centres when the outer list was made.
    pub(super) outer_reference: Vec<[f64; 3]>,
    /// Centres when the inner list was made.
    pub(super) inner_reference: Vec<[f64; 3]>,
    /// Who slept when the inner list was made; empty where nobody did.
    listed_asleep: Vec<bool>,
    /// Smallest radius [m]; infinite without particles.
    smallest_radius: f64,
    /// The particles' material, where all have the same.
    pub only_material: Option<u32>,
    /// How far anybody may have moved since.
    pub(super) wear: Wear,
    /// How often the lists were made: the storage order is the same while it is.
    generation: u64,
}

impl Neighborhood {
    /// Nothing known yet. Lists will be made with the instruction set `simd`.
    #[must_use]
    pub fn new(settings: ListSettings, simd: SimdLevel) -> Self {
        Self {
            chunks: Vec::new(),
            images: Images::new(&settings.domain.size()),
            cells: CellLevels::default(),
            settings,
            simd,
            outer_reference: Vec::new(),
            inner_reference: Vec::new(),
            listed_asleep: Vec::new(),
            smallest_radius: f64::INFINITY,
            only_material: None,
            wear: Wear::new(&settings),
            generation: 0,
        }
    }

    /// How often the lists were made: the storage order is the same while it is.
    pub(super) const fn generation(&self) -> u64 {
        self.generation
    }

    /// Calls `visit(member, image offset)` for particles whose present distance to `position` may be below `radius` + theirs.
    pub fn for_each_near(&self, position: &Vec3, radius: f64, mut visit: impl FnMut(u32, Vec3)) {
        for grid in &self.cells.grids {
            let reach = radius + grid.largest_radius + self.wear.since_outer;
            grid.for_each_run(position, reach, 0, |members, shift| {
                let offset = grid.image_offset(shift);
                members.iter().for_each(|&member| visit(member, offset));
            });
        }
    }

    /// Smallest radius [m]; infinite without particles.
    #[must_use]
    pub const fn smallest_radius(&self) -> f64 {
        self.smallest_radius
    }

    /// The order in which to store the particles, `order[new] = old`, and their cells then.
    pub(super) fn storage_order(&self, spheres: &[Sphere], threads: &Threads) -> (CellLevels, Vec<u32>) {
        let (space, skin) = (self.space(threads), self.settings.skin);
        CellLevels::new(spheres, skin, &space).in_storage_order(spheres, skin, &space)
    }

    const fn space<'a>(&'a self, threads: &'a Threads) -> Space<'a> {
        Space { domain: &self.settings.domain, periodic: self.settings.periodic, threads }
    }

    /// Makes both lists anew for particles in their final order, in these cells and with these asleep, each pair with the memory that
    /// `recall(owner, partner)` gives.
    pub(super) fn make_lists(
        &mut self,
        (spheres, velocities): (&[Sphere], &[Velocity]),
        cells: CellLevels,
        asleep: Vec<bool>,
        threads: &Threads,
        recall: impl Fn(u32, u32) -> Option<Memory> + Sync,
    ) {
        self.chunks.clear(); // Their memory is free for the new ones.
        self.cells = cells;
        self.listed_asleep = asleep;
        let ranges = chunk_ranges(spheres.len());
        let found = find_candidates(spheres, &self.cells, &ranges, self.settings.skin, (threads, self.simd));
        let chunk = |(range, candidates)| Chunk { range, candidates, ..Chunk::default() };
        self.chunks = ranges.into_iter().zip(found).map(chunk).collect();
        threads.for_each(self.chunks.iter_mut().collect(), |chunk: &mut Chunk| {
            let mut own = velocities[chunk.range.clone()].iter();
            chunk.has_prescribed = own.any(|velocity| velocity.path.is_prescribed());
        });
        self.outer_reference = threads.collect(spheres.len(), |index| spheres[index].centre);
        self.smallest_radius = radii(spheres, threads)[0];
        self.only_material = only_material(velocities, threads);
        self.wear.since_outer = 0.0;
        self.generation += 1;
        self.prune_with(spheres, velocities, threads, recall);
    }

    /// Gives the inner lists that are made next the skin that fits the motion.
    pub(super) fn fit_inner_skin(&mut self) {
        self.wear.inner_skin = self.wear.fitting_inner_skin(self.settings.skin);
    }

    /// Whether others sleep than when the inner lists were made.
    pub(super) fn lists_others_asleep(&self, asleep: &[bool]) -> bool {
        self.listed_asleep != asleep
    }

    /// Makes the inner lists from the outer ones, each pair with the memory that `recall(owner, partner)` gives.
    fn prune_with(
        &mut self,
        spheres: &[Sphere],
        velocities: &[Velocity],
        threads: &Threads,
        recall: impl Fn(u32, u32) -> Option<Memory> + Sync,
    ) {
        let (simd, skin, remembered) = (self.simd, self.wear.inner_skin, self.settings.remembered());
        let bodies = Bodies { spheres, velocities, images: &self.images, asleep: &self.listed_asleep };
        threads.for_each(self.chunks.iter_mut().collect(), |chunk: &mut Chunk| {
            let Chunk { candidates, own, cross, .. } = chunk;
            PruningScratch::with(|scratch| {
                for (outer, inner) in [(&candidates.own, own), (&candidates.cross, cross)] {
                    *inner = outer.pruned(simd, bodies, skin, remembered, (std::mem::take(inner), &mut *scratch));
                    inner.recall_each(&recall);
                }
            });
        });
        self.note_inner_reference(spheres, threads);
    }

    /// Makes the inner lists from the outer ones anew, with these asleep; memories are kept.
    pub(super) fn prune(&mut self, spheres: &[Sphere], velocities: &[Velocity], asleep: Vec<bool>, threads: &Threads) {
        let (simd, skin, remembered) = (self.simd, self.wear.inner_skin, self.settings.remembered());
        self.listed_asleep = asleep;
        let bodies = Bodies { spheres, velocities, images: &self.images, asleep: &self.listed_asleep };
        threads.for_each(self.chunks.iter_mut().collect(), |chunk: &mut Chunk| {
            let Chunk { candidates, own, cross, worn, .. } = chunk;
            PruningScratch::with(|scratch| {
                let [worn_own, worn_cross] = worn;
                for (outer, inner, worn) in [(&candidates.own, own, worn_own), (&candidates.cross, cross, worn_cross)] {
                    let mut next = outer.pruned(simd, bodies, skin, remembered, (std::mem::take(worn), &mut *scratch));
                    next.take_over(inner, outer.len(), scratch);
                    *worn = std::mem::replace(inner, next);
                }
            });
        });
        self.note_inner_reference(spheres, threads);
    }

    fn note_inner_reference(&mut self, spheres: &[Sphere], threads: &Threads) {
        threads.collect_into(&mut self.inner_reference, spheres.len(), |index| spheres[index].centre);
        let looked_at = self.chunks.iter().map(|chunk| chunk.candidates.own.len() + chunk.candidates.cross.len()).sum();
        let apart = self.chunks.iter().map(|chunk| chunk.own.apart + chunk.cross.apart).sum();
        self.wear.note_inner(looked_at, apart);
    }

    /// Whether the inner lists are too old to go on with. Displacements are measured where the bound on them allows no answer.
    pub(super) fn inner_is_worn(&mut self, spheres: &[Sphere], threads: &Threads) -> bool {
        self.wear.note_step();
        if self.wear.inner_is_wide(self.settings.skin) {
            return true;
        }
        if 2.0 * self.wear.since_inner <= self.wear.inner_skin {
            return false;
        }
        let limit = RENEW_SHARE * self.wear.inner_skin;
        let moved = displacement_unless(spheres, &self.inner_reference, threads, |moved| 2.0 * moved > limit);
        self.wear.since_inner = moved.unwrap_or(self.wear.since_inner);
        moved.is_none()
    }

    /// Whether the outer lists are too old to make inner ones from. Displacements are measured likewise.
    pub(super) fn outer_is_worn(&mut self, spheres: &[Sphere], threads: &Threads) -> bool {
        let (inner_skin, skin) = (self.wear.inner_skin, self.settings.skin);
        let is_far = |moved: f64| 2.0 * moved + inner_skin > skin;
        if !is_far(self.wear.since_outer) {
            return false;
        }
        let moved = displacement_unless(spheres, &self.outer_reference, threads, is_far);
        self.wear.since_outer = moved.unwrap_or(self.wear.since_outer);
        moved.is_none()
    }

    /// Says that the particle stored at `index` has become prescribed.
    pub(super) fn note_prescribed(&mut self, index: usize) {
        let number = self.chunk_of(index);
        self.chunks[number].has_prescribed = true;
    }

    /// What the contacts remember, by the present storage order.
    pub(super) fn gather_memory(&self, threads: &Threads) -> HeldMemory {
        let lists = self.chunks.iter().map(|chunk| (chunk.range.clone(), [&chunk.own, &chunk.cross]));
        HeldMemory::gather(&lists.collect::<Vec<_>>(), threads)
    }

    /// Drops the contacts with parts that `gone` picks, with their memory.
    pub(super) fn forget_wall_contacts(&mut self, gone: impl Fn(&WallContact) -> bool) {
        for chunk in &mut self.chunks {
            chunk.walls.forget(&gone);
        }
    }

    /// The chunk of the particle stored at `index`.
    pub(super) fn chunk_of(&self, index: usize) -> usize {
        self.chunks.partition_point(|chunk| chunk.range.end <= index)
    }

    /// Sets the memory of the contact of particle `index` with particle `other`, seen from the former, wherever it is kept: a pair
    /// of one chunk stands once, a pair of two chunks in both. False where the two are not near each other.
    pub(super) fn remember(&mut self, index: usize, other: usize, memory: &Memory) -> bool {
        let mut found = false;
        for (from, to, memory) in [(index, other, *memory), (other, index, memory.mirrored())] {
            let number = self.chunk_of(from);
            let chunk = &mut self.chunks[number];
            for list in [&mut chunk.own, &mut chunk.cross] {
                let is_it = |&entry: &usize| (list.owners[entry], list.partners[entry]) == (from as u32, to as u32);
                for entry in (0..list.len()).filter(is_it).collect::<Vec<usize>>() {
                    found = true;
                    list.memory.set(entry, &memory);
                }
            }
        }
        found
    }

    /// Adds a contact with a part.
    pub(super) fn remember_part(&mut self, walls: &Walls, contact: &WallContact) {
        let number = self.chunk_of(contact.particle as usize);
        self.chunks[number].walls.hold(walls, contact);
    }

    /// What the lists are made with.
    #[must_use]
    pub const fn settings(&self) -> ListSettings {
        self.settings
    }

    /// Lists made from now on obey these settings; the present ones stay as they are.
    pub(super) fn change_settings(&mut self, settings: ListSettings) {
        self.settings = settings;
        self.wear.inner_skin = Wear::new(&settings).inner_skin;
        self.images = Images::new(&settings.domain.size());
    }

    /// Storage indices of those who slept when the inner lists were made.
    pub(super) fn listed_asleep(&self) -> Vec<u32> {
        (0_u32..).zip(&self.listed_asleep).filter_map(|(index, asleep)| asleep.then_some(index)).collect()
    }

    /// Gives every pair of the inner lists its memory, in the lists' order. A scene without friction takes none.
    pub(super) fn set_pair_memory(&mut self, memories: &mut dyn Iterator<Item = Memory>) -> Result<(), String> {
        let lists = self.chunks.iter_mut().flat_map(|chunk| [&mut chunk.own, &mut chunk.cross]);
        for list in lists.filter(|_| self.settings.remembers) {
            for entry in 0..list.len() {
                let memory = memories.next().ok_or("column 'pair_memory' is too short for the pairs")?;
                list.memory.set(entry, &memory);
            }
        }
        if self.settings.remembers && memories.next().is_some() {
            return Err("column 'pair_memory' is too long for the pairs".to_owned());
        }
        Ok(())
    }

    /// Makes the lists that a checkpoint was taken with: cells and outer list at its outer reference centres, inner list at its
    /// inner ones, with those asleep who slept then, without memory.
    pub(super) fn restore(
        &mut self,
        particles: &Particles,
        [outer_reference, inner_reference]: [Vec<[f64; 3]>; 2],
        listed_asleep: &[u32],
        wear: Wear,
        threads: &Threads,
    ) {
        let placed = |centres: &[[f64; 3]]| -> Vec<Sphere> {
            particles.spheres.iter().zip(centres).map(|(s, c)| Sphere { centre: *c, radius: s.radius }).collect()
        };
        let mut asleep = vec![false; if listed_asleep.is_empty() { 0 } else { particles.len() }];
        listed_asleep.iter().for_each(|&index| asleep[index as usize] = true);
        let (outer, velocities) = (placed(&outer_reference), particles.laws_velocities());
        self.wear = wear;
        let cells = CellLevels::new(&outer, self.settings.skin, &self.space(threads));
        self.make_lists((&outer, velocities), cells, asleep, threads, |_, _| None);
        self.prune_with(&placed(&inner_reference), velocities, threads, |_, _| None);
        // Nobody has collected the elements of parts for these lists yet.
        self.wear = wear;
        self.wear.towards_parts = f64::INFINITY;
    }
}
