//! Cells over the particles' bounds, one grid per size level.

use super::sort::Sorted;
use crate::dem::particles::Sphere;
use crate::dem::pieces::{piece_ranges, split_at_ranges};
use crate::dem::survey::radii;
use crate::dem::threads::Threads;
use crate::math::{Bounds, Vec3};
use std::ops::Range;

/// Where grids are laid, and who works on them.
#[derive(Debug, Clone, Copy)]
pub struct Space<'a> {
    /// Domain [m]; along a periodic axis the cells tile it exactly.
    pub domain: &'a Bounds,
    /// Periodic axes.
    pub periodic: [bool; 3],
    /// Threads.
    pub threads: &'a Threads,
}

/// A grid of cells with the particles of one size level, in ascending storage order within a cell.
#[derive(Debug, Clone, PartialEq)]
pub struct CellGrid {
    origin: [f64; 3],
    cell: [f64; 3],
    counts: [usize; 3],
    periodic: [bool; 3],
    sorted: Sorted,
    /// Whether storage follows the cells: then the particles of a cell, and of cells side by side, are a run of storage indices.
    in_storage_order: bool,
    /// Largest radius in this level [m].
    pub largest_radius: f64,
}

/// Cells per particle that a grid may have at most: a cloud of far-flung particles gets larger cells, not more memory.
const CELLS_PER_PARTICLE: usize = 4;

impl CellGrid {
    /// Sorts `members` into cells of at least `edge` [m].
    #[must_use]
    pub fn new(spheres: &[Sphere], members: &[u32], edge: f64, space: &Space) -> Self {
        let (mut bounds, largest_radius) = extent(spheres, members, space.threads);
        for axis in (0..3).filter(|&axis| space.periodic[axis]) {
            bounds.minimum[axis] = space.domain.minimum[axis];
            bounds.maximum[axis] = space.domain.maximum[axis];
        }
        let (size, limit) = (bounds.size(), CELLS_PER_PARTICLE * members.len() + 64);
        let counts = cell_counts(&size, edge, limit);
        let cell = std::array::from_fn(|axis| (size[axis] / counts[axis] as f64).max(f64::MIN_POSITIVE));
        let mut grid = Self {
            origin: bounds.minimum,
            cell,
            counts,
            periodic: space.periodic,
            sorted: Sorted { start: Vec::new(), members: Vec::new() },
            in_storage_order: false,
            largest_radius,
        };
        let cell_of = |member: u32| grid.cell_of(&spheres[member as usize].position());
        grid.sorted = Sorted::new(space.threads, members, counts.iter().product(), cell_of);
        grid.note_order();
        grid
    }

    fn note_order(&mut self) {
        self.in_storage_order = (0..).zip(&self.sorted.members).all(|(place, &member)| place == member);
    }

    fn coordinate(&self, position: f64, axis: usize) -> usize {
        // Cut off, what is not negative is rounded down.
        ((position - self.origin[axis]) / self.cell[axis]).clamp(0.0, (self.counts[axis] - 1) as f64) as usize
    }

    fn cell_of(&self, position: &Vec3) -> u32 {
        let [x, y, z] = [0, 1, 2].map(|axis| self.coordinate(position[axis], axis));
        ((z * self.counts[1] + y) * self.counts[0] + x) as u32
    }

    /// Calls `visit(members, image)` for particles of the level, run by run, at least for all whose cells lie within `reach` [m] of
    /// `position`; `image` is the number of domain lengths to add to the members' positions, per axis. Some of those stored before
    /// number `first` are left out.
    #[inline(always)]
    pub fn for_each_run(&self, position: &Vec3, reach: f64, first: u32, mut visit: impl FnMut(&[u32], [i8; 3])) {
        let Sorted { start, members } = &self.sorted;
        let [x_range, y_range, z_range] = [0, 1, 2].map(|axis| self.cell_range(position[axis], reach, axis));
        for z in z_range.0..=z_range.1 {
            let (z, image_z) = self.wrapped(z, 2);
            let layer_end = start[(z + 1) * self.counts[1] * self.counts[0]];
            if self.in_storage_order && layer_end <= first {
                continue;
            }
            for y in y_range.0..=y_range.1 {
                let (y, image_y) = self.wrapped(y, 1);
                let row = (z * self.counts[1] + y) * self.counts[0];
                let mut x = x_range.0;
                while x <= x_range.1 {
                    // Cells of a row are neighbours in memory: one run of members, where none of them is an image.
                    let last = if self.periodic[0] { x } else { x_range.1 };
                    let (cell, image_x) = self.wrapped(x, 0);
                    let cells = row + cell..=row + cell + (last - x) as usize;
                    let [mut from, to] = [*cells.start(), *cells.end() + 1].map(|cell| start[cell] as usize);
                    if self.in_storage_order {
                        from = from.max(first as usize).min(to);
                    }
                    if from < to {
                        visit(&members[from..to], [image_x, image_y, image_z]);
                    }
                    x = last + 1;
                }
            }
        }
    }

    /// Whether storage follows the cells: no particle before the first one asked for is visited then.
    #[inline(always)]
    #[must_use]
    pub const fn is_in_storage_order(&self) -> bool {
        self.in_storage_order
    }

    /// Whether some axis is periodic.
    #[inline(always)]
    #[must_use]
    pub const fn is_periodic(&self) -> bool {
        self.periodic[0] || self.periodic[1] || self.periodic[2]
    }

    /// Offset [m] of the image shifted by so many domain lengths.
    #[must_use]
    pub fn image_offset(&self, shift: [i8; 3]) -> Vec3 {
        let length = |axis: usize| f64::from(shift[axis]) * self.cell[axis] * self.counts[axis] as f64;
        Vec3::new(length(0), length(1), length(2))
    }

    fn cell_range(&self, position: f64, reach: f64, axis: usize) -> (isize, isize) {
        if self.periodic[axis] {
            let low = ((position - reach - self.origin[axis]) / self.cell[axis]).floor() as isize;
            let high = ((position + reach - self.origin[axis]) / self.cell[axis]).floor() as isize;
            return (low, high);
        }
        (self.coordinate(position - reach, axis) as isize, self.coordinate(position + reach, axis) as isize)
    }

    fn wrapped(&self, cell: isize, axis: usize) -> (usize, i8) {
        let count = self.counts[axis] as isize;
        // Divisions are worth to be avoided: nearly all cells are within.
        if (0..count).contains(&cell) {
            return (cell as usize, 0);
        }
        (cell.rem_euclid(count) as usize, cell.div_euclid(count) as i8)
    }

    /// Takes up that the particle that was stored at an index is now stored at `new_index` of it.
    fn renumber(&mut self, new_index: &[u32], threads: &Threads) {
        let Sorted { start, members } = &mut self.sorted;
        let ranges = piece_ranges(start.len() - 1);
        let places = ranges.iter().map(|range| start[range.start] as usize..start[range.end] as usize);
        let pieces = split_at_ranges(members, places);
        threads.for_each(
            ranges.into_iter().zip(pieces).collect(),
            |(cells, mut members): (Range<usize>, &mut [u32])| {
                for cell in cells {
                    let here = members.split_off_mut(..(start[cell + 1] - start[cell]) as usize).unwrap_or_default();
                    here.iter_mut().for_each(|member| *member = new_index[*member as usize]);
                    here.sort_unstable();
                }
            },
        );
        self.note_order();
    }
}

/// Bounds of the centres [m] and largest radius [m] of some particles.
fn extent(spheres: &[Sphere], members: &[u32], threads: &Threads) -> (Bounds, f64) {
    let of_piece = |places: Range<usize>| {
        let mut bounds = Bounds::EMPTY;
        let mut largest = 0.0_f64;
        for &member in &members[places] {
            let sphere = &spheres[member as usize];
            bounds.include(&sphere.position());
            largest = largest.max(sphere.radius);
        }
        (bounds, largest)
    };
    let pieces = threads.map_pieces(members.len(), of_piece);
    pieces.iter().fold((Bounds::EMPTY, 0.0), |all, piece| (all.0.union(&piece.0), all.1.max(piece.1)))
}

/// How many cells of at least `edge` [m] lie along each axis of a box of this size [m]; larger ones where they would be more than `limit`.
fn cell_counts(size: &Vec3, mut edge: f64, limit: usize) -> [usize; 3] {
    loop {
        let wanted: [f64; 3] = std::array::from_fn(|axis| (size[axis] / edge).floor().max(1.0));
        if wanted.iter().product::<f64>() <= limit as f64 {
            return wanted.map(|count| count as usize);
        }
        edge *= 1.26;
    }
}

/// The cells of all size levels; a level holds radii within a factor of two.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct CellLevels {
    /// Grids from the finest to the coarsest level.
    pub grids: Vec<CellGrid>,
    /// Level of each particle; empty where there is one.
    levels: Vec<u8>,
}

impl CellLevels {
    /// Sorts all particles into levels and cells, for pairs within `skin` [m] of contact.
    #[must_use]
    pub fn new(spheres: &[Sphere], skin: f64, space: &Space) -> Self {
        if spheres.is_empty() {
            return Self::default();
        }
        let threads = space.threads;
        let [smallest, largest] = radii(spheres, threads);
        let level = |radius: f64| (radius / smallest).log2() as u8;
        let deepest = level(largest);
        let all: Vec<u32> = (0..spheres.len() as u32).collect();
        if deepest == 0 {
            return Self { grids: vec![CellGrid::new(spheres, &all, 2.0 * largest + skin, space)], levels: Vec::new() };
        }
        let levels = threads.collect(spheres.len(), |index| level(spheres[index].radius));
        let mut grids = Vec::new();
        let mut compact = vec![0_u8; usize::from(deepest) + 1];
        for number in 0..=deepest {
            let members: Vec<u32> = all.iter().copied().filter(|&index| levels[index as usize] == number).collect();
            if members.is_empty() {
                continue;
            }
            let largest = extent(spheres, &members, threads).1;
            compact[usize::from(number)] = grids.len() as u8;
            grids.push(CellGrid::new(spheres, &members, 2.0 * largest + skin, space));
        }
        let levels = levels.into_iter().map(|number| compact[usize::from(number)]).collect();
        Self { grids, levels }
    }

    /// Number of the grid that holds the particle stored at `index`.
    #[must_use]
    pub fn level(&self, index: usize) -> usize {
        self.levels.get(index).map_or(0, |&level| usize::from(level))
    }

    /// The order in which to store the particles, `order[new] = old`, so that neighbours lie close; and the cells as they are then, the
    /// same as made anew.
    #[must_use]
    pub fn in_storage_order(mut self, spheres: &[Sphere], skin: f64, space: &Space) -> (Self, Vec<u32>) {
        let all: Vec<u32> = (0..spheres.len() as u32).collect();
        if let [only] = self.grids.as_mut_slice() {
            only.in_storage_order = true;
            let order = std::mem::replace(&mut only.sorted.members, all);
            return (self, order);
        }
        // Mixed sizes: sort by the cells of the finest level's grid laid over all particles, so that neighbours of any size
        // lie close.
        let edge = self.grids.first().map_or(1.0, |grid| 2.0 * grid.largest_radius + skin);
        let order = CellGrid::new(spheres, &all, edge, space).sorted.members;
        let mut new_index = vec![0_u32; order.len()];
        (0..).zip(&order).for_each(|(new, &old)| new_index[old as usize] = new);
        self.grids.iter_mut().for_each(|grid| grid.renumber(&new_index, space.threads));
        self.levels = order.iter().map(|&old| self.levels[old as usize]).collect();
        (self, order)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Spheres at random places of a cube, of radii from 1 to `ratio` mm.
    fn spheres(count: usize, ratio: f64) -> Vec<Sphere> {
        let mut state = 7_u64;
        let mut uniform = || {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (state >> 11) as f64 / (1_u64 << 53) as f64
        };
        (0..count)
            .map(|_| Sphere {
                centre: [0.1 * uniform(), 0.1 * uniform(), 0.1 * uniform()],
                radius: 1e-3 * ratio.powf(uniform()),
            })
            .collect()
    }

    const DOMAIN: Bounds = Bounds { minimum: [0.0; 3], maximum: [0.1; 3] };

    fn each_space(mut visit: impl FnMut(&Space)) {
        for threads in [1, 2, 3, 7].map(Threads::new) {
            for periodic in [[false; 3], [true, false, true]] {
                visit(&Space { domain: &DOMAIN, periodic, threads: &threads });
            }
        }
    }

    #[test]
    fn cells_of_ordered_particles_are_those_made_anew_on_any_number_of_threads() {
        let at_one_place = vec![Sphere { centre: [0.05; 3], radius: 1e-3 }; 5000];
        let scenes = [(0, 1.0), (1, 1.0), (9000, 1.5), (9000, 20.0)].map(|(count, ratio)| spheres(count, ratio));
        for spheres in scenes.into_iter().chain([at_one_place]) {
            each_space(|space| {
                let alone = Threads::new(1);
                let serial = Space { threads: &alone, ..*space };
                let cells = CellLevels::new(&spheres, 1e-3, space);
                assert_eq!(cells, CellLevels::new(&spheres, 1e-3, &serial));
                let (cells, order) = cells.in_storage_order(&spheres, 1e-3, space);
                let mut seen = order.clone();
                seen.sort_unstable();
                assert!(seen.iter().copied().eq(0..spheres.len() as u32), "everybody once");
                let ordered: Vec<Sphere> = order.iter().map(|&old| spheres[old as usize]).collect();
                assert_eq!(cells, CellLevels::new(&ordered, 1e-3, &serial));
            });
        }
    }

    #[test]
    fn everybody_from_the_first_asked_for_is_found_in_reach() {
        let spheres = spheres(3000, 1.5);
        each_space(|space| {
            let unordered = CellLevels::new(&spheres, 1e-3, space);
            let (cells, order) = unordered.clone().in_storage_order(&spheres, 1e-3, space);
            let ordered: Vec<Sphere> = order.iter().map(|&old| spheres[old as usize]).collect();
            for (cells, spheres) in [(unordered, &spheres), (cells, &ordered)] {
                for first in [0, 1, 1500, 2999] {
                    let (position, reach, mut found) = (spheres[first].position(), 0.005, Vec::new());
                    cells.grids[0].for_each_run(&position, reach, first as u32, |members, image| {
                        let offset = cells.grids[0].image_offset(image);
                        let is_near = |&member: &u32| {
                            let apart = spheres[member as usize].position() + offset - position;
                            member as usize >= first && apart.norm() < reach
                        };
                        found.extend(members.iter().copied().filter(is_near));
                    });
                    found.sort_unstable();
                    let is_near = |&index: &u32| {
                        let mut apart = spheres[index as usize].position() - position;
                        for axis in (0..3).filter(|&axis| space.periodic[axis]) {
                            apart[axis] -= (apart[axis] / 0.1).round() * 0.1;
                        }
                        apart.norm() < reach
                    };
                    assert_eq!(found, (first as u32..3000).filter(is_near).collect::<Vec<u32>>());
                }
            }
        });
    }
}
