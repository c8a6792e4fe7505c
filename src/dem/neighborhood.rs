//! The solver's knowledge of who is near whom, and when it must be renewed.

use super::energy::Tally;
use super::neighbor::history::HeldMemory;
use super::neighbor::list::{Bodies, Images, InnerList, Memory, Remembered};
use super::neighbor::search::{ChunkCandidates, find_candidates};
use super::neighbor::{cells::CellLevels, chunks::chunk_ranges};
use super::particles::{Particles, Sphere, Velocity, asleep, largest_displacement, only_material};
use super::simulation::Simulation;
use super::sleep::ChunkRest;
use super::wall::Walls;
use super::wall_contacts::PartLoad;
use super::wall_list::{NearParts, WallContact, WallList};
use super::wall_search::Scratch;
use crate::math::{Bounds, Vec3};
use serde::{Deserialize, Serialize};
use std::ops::Range;
use std::time::Instant;

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
    /// Storage of an inner list that is not used any more.
    worn: InnerList,
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
    inner_skin: f64,
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
    /// Upper bounds on how far any particle has moved [m].
    moved_since_outer: f64,
    moved_since_inner: f64,
    /// Upper bound on the approach of particles and parts since their candidates were collected [m].
    pub(super) approached_walls: f64,
    /// How often the lists were made: the storage order is the same while it is.
    generation: u64,
}

/// Share of the outer skin that the inner list keeps: between 0.02 and 0.1 of a diameter no effect on speed was seen.
const INNER_SHARE: f64 = 0.2;
/// Share of a skin used up at which a list is renewed rather than measured again.
const RENEW_SHARE: f64 = 0.5;

impl Neighborhood {
    /// Nothing known yet.
    #[must_use]
    pub fn new(settings: ListSettings) -> Self {
        Self {
            chunks: Vec::new(),
            images: Images::new(&settings.domain.size()),
            cells: CellLevels::default(),
            settings,
            inner_skin: INNER_SHARE * settings.skin,
            outer_reference: Vec::new(),
            inner_reference: Vec::new(),
            listed_asleep: Vec::new(),
            smallest_radius: f64::INFINITY,
            only_material: None,
            moved_since_outer: 0.0,
            moved_since_inner: 0.0,
            approached_walls: 0.0,
            generation: 0,
        }
    }

    /// How often the lists were made: the storage order is the same while it is.
    pub(super) const fn generation(&self) -> u64 {
        self.generation
    }

    /// Upper bound on how far any particle is from its outer reference centre [m].
    pub(super) const fn moved_since_outer(&self) -> f64 {
        self.moved_since_outer
    }

    /// Books one time step: no particle moved farther than `particles` [m], no part's surface farther than `parts` [m].
    pub fn note_motion(&mut self, particles: f64, parts: f64) {
        self.moved_since_outer += particles;
        self.moved_since_inner += particles;
        self.approached_walls += particles + parts;
    }

    /// Calls `visit(member, image offset)` for particles whose present distance to `position` may be below `radius` + theirs.
    pub fn for_each_near(&self, position: &Vec3, radius: f64, mut visit: impl FnMut(u32, Vec3)) {
        for grid in &self.cells.grids {
            let reach = radius + grid.largest_radius + self.moved_since_outer;
            grid.for_each_near(position, reach, |member, shift| visit(member, grid.image_offset(shift)));
        }
    }

    /// Smallest radius [m]; infinite without particles.
    #[must_use]
    pub const fn smallest_radius(&self) -> f64 {
        self.smallest_radius
    }

    /// The order of storage: level by level, cell by cell.
    fn storage_order(&self, spheres: &[Sphere]) -> Vec<u32> {
        let cells = CellLevels::new(spheres, self.settings.skin, &self.settings.domain, self.settings.periodic);
        if let [only] = cells.grids.as_slice() {
            return only.in_cell_order().to_vec();
        }
        // Mixed sizes: sort by the cells of the finest level's grid laid over all particles, so that neighbours of any size
        // lie close.
        let all: Vec<u32> = (0..spheres.len() as u32).collect();
        let edge = cells.grids.first().map_or(1.0, |grid| 2.0 * grid.largest_radius + self.settings.skin);
        super::neighbor::cells::CellGrid::new(spheres, &all, edge, &self.settings.domain, self.settings.periodic)
            .in_cell_order()
            .to_vec()
    }

    /// Makes both lists anew for particles in their final order; `old_index[new]` says where a particle stood in the lists that
    /// `held` was gathered from.
    fn make_lists(
        &mut self,
        spheres: &[Sphere],
        velocities: &[Velocity],
        old_index: &[u32],
        held: &HeldMemory,
        threads: &super::threads::Threads,
    ) {
        self.chunks.clear(); // What is worth keeping of them is in `held`: their memory is free for the new ones.
        self.cells = CellLevels::new(spheres, self.settings.skin, &self.settings.domain, self.settings.periodic);
        let ranges = chunk_ranges(spheres.len());
        let found = find_candidates(spheres, &self.cells, &ranges, self.settings.skin, threads);
        let chunk = |(range, candidates): (Range<usize>, ChunkCandidates)| {
            let has_prescribed = velocities[range.clone()].iter().any(|velocity| velocity.path.is_prescribed());
            Chunk { range, candidates, has_prescribed, ..Chunk::default() }
        };
        self.chunks = ranges.into_iter().zip(found).map(chunk).collect();
        self.outer_reference = spheres.iter().map(|sphere| sphere.centre).collect();
        self.smallest_radius = spheres.iter().map(|sphere| sphere.radius).fold(f64::INFINITY, f64::min);
        self.only_material = only_material(velocities);
        self.moved_since_outer = 0.0;
        self.generation += 1;
        self.listed_asleep = asleep(velocities);
        self.prune_with(spheres, velocities, threads, |_, owner, candidate| {
            held.of(old_index[owner as usize], old_index[candidate.partner as usize])
        });
    }

    /// Whether others sleep than when the inner lists were made.
    pub(super) fn lists_others_asleep(&self, velocities: &[Velocity]) -> bool {
        self.listed_asleep != asleep(velocities)
    }

    /// Makes the inner lists from the outer ones, each pair with the memory that `recall(place, owner, candidate)` gives.
    fn prune_with(
        &mut self,
        spheres: &[Sphere],
        velocities: &[Velocity],
        threads: &super::threads::Threads,
        recall: impl Fn(u32, u32, super::neighbor::list::Candidate) -> Memory + Sync,
    ) {
        let (skin, remembered) = (self.inner_skin, self.settings.remembered());
        let bodies = Bodies { spheres, velocities, images: &self.images, asleep: &self.listed_asleep };
        threads.for_each(self.chunks.iter_mut().collect(), |chunk: &mut Chunk| {
            let Chunk { candidates, own, cross, .. } = chunk;
            for (outer, inner) in [(&candidates.own, own), (&candidates.cross, cross)] {
                *inner = outer.pruned(bodies, skin, remembered, &recall, std::mem::take(inner));
            }
        });
        self.inner_reference = spheres.iter().map(|sphere| sphere.centre).collect();
        self.moved_since_inner = 0.0;
    }

    /// Makes the inner lists from the outer ones anew, memories kept.
    fn prune(&mut self, spheres: &[Sphere], velocities: &[Velocity], threads: &super::threads::Threads) {
        let (skin, remembered) = (self.inner_skin, self.settings.remembered());
        self.listed_asleep = asleep(velocities);
        let bodies = Bodies { spheres, velocities, images: &self.images, asleep: &self.listed_asleep };
        threads.for_each(self.chunks.iter_mut().collect(), |chunk: &mut Chunk| {
            let Chunk { candidates, own, cross, worn, .. } = chunk;
            for (outer, inner) in [(&candidates.own, own), (&candidates.cross, cross)] {
                let next = outer.pruned(bodies, skin, remembered, inner.recall_in_order(), std::mem::take(worn));
                *worn = std::mem::replace(inner, next);
            }
        });
        self.inner_reference = spheres.iter().map(|sphere| sphere.centre).collect();
        self.moved_since_inner = 0.0;
    }

    /// Says that the particle stored at `index` has become prescribed.
    pub(super) fn note_prescribed(&mut self, index: usize) {
        let number = self.chunk_of(index);
        self.chunks[number].has_prescribed = true;
    }

    fn gather_memory(&self, count: usize) -> HeldMemory {
        HeldMemory::gather(count, self.chunks.iter().map(|chunk| (&chunk.own, &chunk.cross)))
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
        self.inner_skin = INNER_SHARE * settings.skin;
        self.images = Images::new(&settings.domain.size());
    }

    /// What the checkpoint needs besides the reference centres, in order: (moved since outer, since inner, towards walls) [m].
    #[must_use]
    pub(super) fn motion_bounds(&self) -> [f64; 3] {
        [self.moved_since_outer, self.moved_since_inner, self.approached_walls]
    }

    /// Storage indices of those who slept when the inner lists were made.
    pub(super) fn listed_asleep(&self) -> Vec<u32> {
        (0_u32..).zip(&self.listed_asleep).filter_map(|(index, asleep)| asleep.then_some(index)).collect()
    }

    pub(super) fn set_motion_bounds(&mut self, bounds: [f64; 3]) {
        [self.moved_since_outer, self.moved_since_inner, self.approached_walls] = bounds;
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
        bounds: [f64; 3],
        threads: &super::threads::Threads,
    ) {
        let placed = |centres: &[[f64; 3]]| -> Vec<Sphere> {
            particles.spheres.iter().zip(centres).map(|(s, c)| Sphere { centre: *c, radius: s.radius }).collect()
        };
        let (order, velocities) = ((0..particles.len() as u32).collect::<Vec<u32>>(), particles.laws_velocities());
        self.make_lists(&placed(&outer_reference), velocities, &order, &HeldMemory::default(), threads);
        // Ascending, as they were written.
        let listed = |index: &u32| listed_asleep.binary_search(index).is_ok();
        self.listed_asleep = if listed_asleep.is_empty() { Vec::new() } else { order.iter().map(listed).collect() };
        self.prune_with(&placed(&inner_reference), velocities, threads, |_, _, _| Memory::NONE);
        // Nobody has collected the elements of parts for these lists yet.
        self.set_motion_bounds([bounds[0], bounds[1], f64::INFINITY]);
    }
}

impl Simulation {
    /// Renews what has become too old, after the particles moved and before contacts are computed.
    pub(super) fn refresh_neighborhood(&mut self) {
        let started = Instant::now();
        let neighborhood = &mut self.neighborhood;
        if 2.0 * neighborhood.moved_since_inner > neighborhood.inner_skin {
            let moved = largest_displacement(&self.particles.spheres, &neighborhood.inner_reference);
            neighborhood.moved_since_inner = moved;
            if 2.0 * moved > RENEW_SHARE * neighborhood.inner_skin {
                self.renew_lists();
            }
        }
        if self.neighborhood.approached_walls > self.neighborhood.settings.skin {
            self.collect_wall_candidates();
        }
        self.phases.neighborhood += started.elapsed();
    }

    /// Makes the inner lists anew, and the outer ones too where these are too old for that.
    pub(super) fn renew_lists(&mut self) {
        let (neighborhood, spheres) = (&mut self.neighborhood, &self.particles.spheres);
        let far = largest_displacement(spheres, &neighborhood.outer_reference);
        neighborhood.moved_since_outer = far;
        if 2.0 * far + neighborhood.inner_skin > neighborhood.settings.skin {
            self.rebuild_neighborhood();
        } else {
            neighborhood.prune(spheres, self.particles.laws_velocities(), &self.threads);
        }
    }

    /// Sorts the particles into storage order and makes every list anew, contact memories kept.
    pub(super) fn rebuild_neighborhood(&mut self) {
        self.wrap_periodic();
        let count = self.particles.len();
        // Newcomers stand at the end of the list: no memory is held for them.
        let held = self.neighborhood.gather_memory(count);
        let order = self.neighborhood.storage_order(&self.particles.spheres);
        self.particles.reorder(&order);
        let walls = self.take_wall_contacts(&order);
        let near = self.take_wall_candidates();
        let (spheres, velocities) = (&self.particles.spheres, self.particles.laws_velocities());
        self.neighborhood.make_lists(spheres, velocities, &order, &held, &self.threads);
        self.give_wall_candidates(&near, &order);
        self.give_wall_contacts(&walls);
    }

    /// Drops the particles that `keep` refuses, and makes every list anew.
    pub(super) fn retain(&mut self, keep: impl Fn(usize) -> bool) {
        let count = self.particles.len();
        let held = self.neighborhood.gather_memory(count);
        let kept: Vec<u32> = (0..count as u32).filter(|&index| keep(index as usize)).collect();
        self.particles.reorder(&kept);
        self.wrap_periodic();
        let order = self.neighborhood.storage_order(&self.particles.spheres);
        self.particles.reorder(&order);
        let from_old: Vec<u32> = order.iter().map(|&index| kept[index as usize]).collect();
        let walls = self.take_wall_contacts(&from_old);
        let near = self.take_wall_candidates();
        let (spheres, velocities) = (&self.particles.spheres, self.particles.laws_velocities());
        self.neighborhood.make_lists(spheres, velocities, &from_old, &held, &self.threads);
        self.give_wall_candidates(&near, &from_old);
        self.give_wall_contacts(&walls);
    }

    /// All contacts with parts, renumbered: `old_index[new] = old`. Sorted by the new numbers.
    fn take_wall_contacts(&mut self, old_index: &[u32]) -> Vec<WallContact> {
        let mut new_index = vec![u32::MAX; old_index.iter().map(|&old| old as usize + 1).max().unwrap_or(0)];
        old_index.iter().enumerate().for_each(|(new, &old)| new_index[old as usize] = new as u32);
        let renumbered = |contact: WallContact| {
            let new = new_index.get(contact.particle as usize).filter(|&&new| new != u32::MAX);
            new.map(|&particle| WallContact { particle, ..contact })
        };
        let held = self.neighborhood.chunks.iter().flat_map(|chunk| chunk.walls.contacts());
        let mut contacts: Vec<WallContact> = held.filter_map(renumbered).collect();
        contacts.sort_by_key(|contact| contact.particle);
        contacts
    }

    /// Hands contacts with parts, sorted by particle, to the chunks.
    pub(super) fn give_wall_contacts(&mut self, contacts: &[WallContact]) {
        let parts = self.setup.parts.len();
        let mut contacts = contacts.iter().peekable();
        for chunk in &mut self.neighborhood.chunks {
            let end = chunk.range.end as u32;
            while let Some(contact) = contacts.next_if(|contact| contact.particle < end) {
                chunk.walls.hold(&self.walls, contact);
            }
            chunk.part_loads = vec![PartLoad::default(); parts];
        }
    }

    /// The elements of parts near each particle, and how many particles there were when the lists were made.
    fn take_wall_candidates(&mut self) -> (Vec<WallList>, usize) {
        let count = self.neighborhood.chunks.last().map_or(0, |chunk| chunk.range.end);
        (self.neighborhood.chunks.iter_mut().map(|chunk| std::mem::take(&mut chunk.walls)).collect(), count)
    }

    /// Goes on with the elements near each particle, renumbered: `old_index[new] = old`. Those of newcomers, and all where much
    /// of the skin is used up or a particle may have gone round a periodic border, are collected.
    fn give_wall_candidates(&mut self, (held, count): &(Vec<WallList>, usize), old_index: &[u32]) {
        let ListSettings { skin, periodic, .. } = self.neighborhood.settings;
        if periodic != [false; 3] || self.neighborhood.approached_walls > RENEW_SHARE * skin {
            self.collect_wall_candidates();
            return;
        }
        let near = NearParts::new(held, *count);
        let (spheres, walls) = (&self.particles.spheres, &self.walls);
        self.threads.for_each(self.neighborhood.chunks.iter_mut().collect(), |chunk: &mut Chunk| {
            let mut found = Vec::new();
            for index in chunk.range.clone() {
                if let Some(known) = near.of(old_index[index] as usize) {
                    chunk.walls.push(walls, index, known);
                } else {
                    let sphere = &spheres[index];
                    walls.candidates(&sphere.position(), sphere.radius + skin, &mut found);
                    chunk.walls.push(walls, index, &found);
                }
            }
        });
    }

    /// Collects the elements of parts near each particle; contacts are kept.
    pub(super) fn collect_wall_candidates(&mut self) {
        let skin = self.neighborhood.settings.skin;
        let (spheres, walls) = (&self.particles.spheres, &self.walls);
        self.threads.for_each(self.neighborhood.chunks.iter_mut().collect(), |chunk: &mut Chunk| {
            let held = chunk.walls.contacts();
            chunk.walls = WallList::collect(spheres, walls, chunk.range.clone(), skin);
            held.iter().for_each(|contact| chunk.walls.hold(walls, contact));
        });
        self.neighborhood.approached_walls = 0.0;
    }
}
