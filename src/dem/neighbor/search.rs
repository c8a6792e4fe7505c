//! The search for candidate pairs: those of a particle are gathered from the cells about it and tested several at once.

use super::cells::{CellGrid, CellLevels};
use super::list::{Images, NO_IMAGE};
use super::outer::{OuterList, Rows};
use crate::dem::particles::Sphere;
use crate::dem::pieces::add_up;
use crate::dem::threads::Threads;
use crate::math::lanes::{LaneWork, Lanes, MOST_LANES, Mask, SimdLevel, at_level};
use std::ops::Range;

/// Candidates of one chunk: `own` pairs lie within the chunk and stand once, `cross` pairs reach into another chunk and stand
/// in both chunks, each of which computes the load on its own particle only.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct ChunkCandidates {
    /// Pairs within the chunk, each owned by one of the two.
    pub own: OuterList,
    /// Pairs with particles of other chunks.
    pub cross: OuterList,
}

/// Pairs that one chunk's particles found, from the particle of the finer level (or the lower index) to the other.
#[derive(Debug)]
struct Found {
    own: Rows,
    cross: Rows,
}

/// All pairs within `skin` [m] of contact, chunk by chunk.
pub fn find_candidates(
    spheres: &[Sphere],
    cells: &CellLevels,
    chunks: &[Range<usize>],
    skin: f64,
    (threads, level): (&Threads, SimdLevel),
) -> Vec<ChunkCandidates> {
    let search = |chunk: usize| at_level(level, Search { spheres, cells, range: chunks[chunk].clone(), skin });
    let found: Vec<Found> = threads.map(chunks.len(), search);
    threads.map(chunks.len(), |chunk| ChunkCandidates {
        own: OuterList::mixed(&chunks[chunk], &found[chunk].own),
        cross: OuterList::mixed(&chunks[chunk], &crossing(&found, chunks, chunk)),
    })
}

/// The pairs of a chunk with particles of other chunks, whoever found them: in the order of the finders.
fn crossing(found: &[Found], chunks: &[Range<usize>], chunk: usize) -> Rows {
    let range = &chunks[chunk];
    let visit_all = |visit: &mut dyn FnMut(usize, u32, u32)| {
        for (number, (Found { cross, .. }, finders)) in found.iter().zip(chunks).enumerate() {
            for finder in finders.clone().filter(|_| !cross.partners.is_empty()) {
                for entry in cross.entries(finder - finders.start) {
                    let (partner, image) = (cross.partners[entry], cross.image(entry));
                    if number == chunk {
                        visit(finder - range.start, partner, image);
                    } else if range.contains(&(partner as usize)) {
                        visit(partner as usize - range.start, finder as u32, Images::opposite(image));
                    }
                }
            }
        }
    };
    let mut start = vec![0_u32; range.len() + 1];
    visit_all(&mut |row, _, _| start[row + 1] += 1);
    add_up(&mut start);
    let (mut next, count) = (start.clone(), start[range.len()] as usize);
    let (mut partners, mut images) = (vec![0; count], vec![NO_IMAGE; count]);
    visit_all(&mut |row, partner, image| {
        let slot = &mut next[row];
        partners[*slot as usize] = partner;
        images[*slot as usize] = image;
        *slot += 1;
    });
    Rows { start, partners, images }
}

/// Rows that are being found. The lists are longer than what they hold, so that whole blocks can be written.
struct Growing {
    rows: Rows,
    count: usize,
    has_images: bool,
}

impl Growing {
    fn new(rows: usize, has_images: bool) -> Self {
        let mut start = Vec::with_capacity(rows + 1);
        start.push(0);
        Self { rows: Rows { start, ..Rows::default() }, count: 0, has_images }
    }

    /// Makes room for so many more entries.
    #[inline(always)]
    fn make_room(&mut self, entries: usize) {
        let needed = self.count + entries;
        if self.rows.partners.len() < needed {
            self.rows.partners.resize(2 * needed, 0);
            self.rows.images.resize(if self.has_images { 2 * needed } else { 0 }, NO_IMAGE);
        }
    }

    /// Appends those of a block of partners to the present row whose bit is set.
    #[inline(always)]
    fn append<L: Lanes>(&mut self, partners: &[u32], images: &[u32], bits: u16) {
        if self.has_images {
            L::pack(images, bits, &mut self.rows.images[self.count..]);
        }
        self.count += L::pack(partners, bits, &mut self.rows.partners[self.count..]);
    }

    #[inline(always)]
    fn end_row(&mut self) {
        self.rows.start.push(self.count as u32);
    }

    fn finished(mut self) -> Rows {
        self.rows.partners.truncate(self.count);
        self.rows.images.truncate(self.count);
        self.rows
    }
}

/// Who may be near a particle. The list of partners is longer than what it holds, so that whole blocks can be written.
#[derive(Default)]
struct Near {
    count: usize,
    partners: Vec<u32>,
    /// Which periodic image of each, and the offset of that [m]; empty where no axis is periodic.
    images: Vec<u32>,
    offsets: [Vec<f64>; 3],
}

impl Near {
    fn clear(&mut self) {
        self.count = 0;
        self.images.clear();
        self.offsets.iter_mut().for_each(Vec::clear);
    }

    /// Adds the grid's particles from number `first` on that may be within `skin` [m] of contact with `own`.
    #[inline(always)]
    fn add_from(&mut self, grid: &CellGrid, own: &Sphere, first: u32, skin: f64) {
        let reach = own.radius + grid.largest_radius + skin;
        grid.for_each_run(&own.position(), reach, first, |members, shift| {
            self.make_room(members.len());
            if grid.is_in_storage_order() {
                self.append_run(members);
            } else {
                for &member in members {
                    self.partners[self.count] = member;
                    self.count += usize::from(member >= first);
                }
            }
            if grid.is_periodic() {
                self.images.resize(self.count, Images::index(shift));
                let offset = grid.image_offset(shift);
                for (list, &part) in self.offsets.iter_mut().zip(offset.iter()) {
                    list.resize(self.count, part);
                }
            }
        });
    }

    /// Makes room for so many more partners and a block of any level.
    #[inline(always)]
    fn make_room(&mut self, partners: usize) {
        let needed = self.count + partners + MOST_LANES;
        if self.partners.len() < needed {
            self.partners.resize(2 * needed, 0);
        }
    }

    /// Appends a run of storage indices, of which there is one at least: by whole blocks, since most runs are shorter than what a loop or
    /// a copy needs to get going.
    #[inline(always)]
    fn append_run(&mut self, members: &[u32]) {
        const BLOCK: usize = 8;
        let blocks = members.len().div_ceil(BLOCK);
        let places = &mut self.partners[self.count..self.count + blocks * BLOCK];
        for (number, block) in places.as_chunks_mut::<BLOCK>().0.iter_mut().enumerate() {
            *block = std::array::from_fn(|lane| members[0] + (number * BLOCK + lane) as u32);
        }
        self.count += members.len();
    }

    /// Fills the last block of any level with whoever is last.
    #[inline(always)]
    fn pad(&mut self) {
        let Some(last) = self.count.checked_sub(1) else { return };
        let last = self.partners[last];
        self.partners[self.count..self.count + MOST_LANES].fill(last);
        if !self.images.is_empty() {
            self.images.resize(self.count + MOST_LANES, NO_IMAGE);
            self.offsets.iter_mut().for_each(|list| list.resize(self.count + MOST_LANES, 0.0));
        }
    }
}

/// The search of one chunk's particles.
struct Search<'a> {
    spheres: &'a [Sphere],
    cells: &'a CellLevels,
    range: Range<usize>,
    skin: f64,
}

impl LaneWork for Search<'_> {
    type Output = Found;

    #[inline(always)]
    fn run<L: Lanes>(self) -> Found {
        let is_periodic = self.cells.grids.iter().any(CellGrid::is_periodic);
        let [mut own, mut cross] = [(); 2].map(|()| Growing::new(self.range.len(), is_periodic));
        let mut near = Near::default();
        for index in self.range.clone() {
            let level = self.cells.level(index);
            near.clear();
            for (number, grid) in self.cells.grids.iter().enumerate().skip(level) {
                // Of a pair of one level the earlier one finds the later one.
                let first = if number == level { index as u32 + 1 } else { 0 };
                near.add_from(grid, &self.spheres[index], first, self.skin);
            }
            self.choose::<L>(index, &mut near, [&mut own, &mut cross]);
            own.end_row();
            cross.end_row();
        }
        Found { own: own.finished(), cross: cross.finished() }
    }
}

impl Search<'_> {
    /// Appends those near a particle that are within the skin to its rows.
    #[inline(always)]
    fn choose<L: Lanes>(&self, index: usize, near: &mut Near, [own, cross]: [&mut Growing; 2]) {
        near.pad();
        own.make_room(near.count + MOST_LANES);
        cross.make_room(near.count + MOST_LANES);
        for from in (0..near.count).step_by(L::COUNT) {
            let real = u16::MAX >> (MOST_LANES - (near.count - from).min(MOST_LANES));
            let within = self.within::<L>(&self.spheres[index], near, from) & real;
            let partners = &near.partners[from..from + L::COUNT];
            let images = if near.images.is_empty() { &[] } else { &near.images[from..from + L::COUNT] };
            let inside = self.inside(partners);
            own.append::<L>(partners, images, within & inside);
            if within & !inside != 0 {
                cross.append::<L>(partners, images, within & !inside);
            }
        }
    }

    /// Who of a block belongs to the chunk, bit by bit; further bits may be anything.
    #[inline(always)]
    fn inside(&self, partners: &[u32]) -> u16 {
        let is_inside = |partner: &u32| self.range.contains(&(*partner as usize));
        if partners.iter().fold(true, |all, partner| all & is_inside(partner)) {
            return u16::MAX; // As nearly always.
        }
        partners.iter().rev().fold(0, |bits, partner| bits << 1 | u16::from(is_inside(partner)))
    }

    /// Who of the block `from` on is within the skin, bit by bit.
    #[inline(always)]
    fn within<L: Lanes>(&self, own: &Sphere, near: &Near, from: usize) -> u16 {
        let partners = &near.partners[from..from + L::COUNT];
        debug_assert!(partners.iter().all(|&partner| (partner as usize) < self.spheres.len()));
        // SAFETY: spheres are rows of four numbers, and cells name only particles that there are.
        let [x, y, z, radius] = unsafe { L::gather_four(self.spheres.as_ptr().cast(), partners) };
        let [mut x, mut y, mut z] =
            [x - L::splat(own.centre[0]), y - L::splat(own.centre[1]), z - L::splat(own.centre[2])];
        if !near.images.is_empty() {
            let [a, b, c] = near.offsets.each_ref().map(|list| L::from_slice(&list[from..]));
            (x, y, z) = (x + a, y + b, z + c);
        }
        let reach = L::splat(own.radius) + radius + L::splat(self.skin);
        (x * x + y * y + z * z).below(reach * reach).bits()
    }
}

#[cfg(test)]
mod tests {
    use super::super::cells::Space;
    use super::super::chunks::chunk_ranges;
    use super::*;
    use crate::math::Bounds;

    const SKIN: f64 = 1e-3;
    const DOMAIN: Bounds = Bounds { minimum: [0.0; 3], maximum: [0.06; 3] };

    /// Spheres at random places of the domain, of radii from 1 to `ratio` mm, as they are stored, and their cells.
    fn stored(count: usize, edge: f64, ratio: f64, space: &Space) -> (Vec<Sphere>, CellLevels) {
        let mut state = 11_u64;
        let mut uniform = || {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (state >> 11) as f64 / (1_u64 << 53) as f64
        };
        let mut sphere = || {
            let centre = [edge * uniform(), edge * uniform(), edge * uniform()];
            Sphere { centre, radius: 1e-3 * ratio.powf(uniform().powi(4)) }
        };
        let spheres: Vec<Sphere> = (0..count).map(|_| sphere()).collect();
        let (cells, order) = CellLevels::new(&spheres, SKIN, space).in_storage_order(&spheres, SKIN, space);
        (order.iter().map(|&old| spheres[old as usize]).collect(), cells)
    }

    /// The pairs of all chunks, those across from both sides, ascending: owner and partner, with periodic images as often as they are near.
    fn listed(found: &[ChunkCandidates]) -> Vec<[u32; 2]> {
        let mut pairs = Vec::new();
        for (list, both) in found.iter().flat_map(|chunk| [(&chunk.own, true), (&chunk.cross, false)]) {
            for (&owner, &partner) in list.owners.iter().zip(&list.partners) {
                pairs.push([owner, partner]);
                pairs.extend(both.then_some([partner, owner]));
            }
        }
        pairs.sort_unstable();
        pairs
    }

    /// Every pair within the skin, by looking at all of them.
    fn all_pairs(spheres: &[Sphere], periodic: [bool; 3]) -> Vec<[u32; 2]> {
        let mut pairs = Vec::new();
        for (a, own) in (0..).zip(spheres) {
            for (b, other) in (0..).zip(spheres).filter(|(b, _)| *b != a) {
                let mut apart = other.position() - own.position();
                for axis in (0..3).filter(|&axis| periodic[axis]) {
                    apart[axis] -= (apart[axis] / 0.06).round() * 0.06;
                }
                if apart.norm() < own.radius + other.radius + SKIN {
                    pairs.push([a, b]);
                }
            }
        }
        pairs
    }

    #[test]
    fn any_number_of_threads_and_lanes_lists_the_same_pairs_in_the_same_order_and_all_of_them() {
        for (count, edge, ratio) in
            [(0, 0.06, 1.0), (1, 0.06, 1.0), (4000, 0.06, 1.3), (200, 1e-4, 1.0), (3000, 0.06, 10.0)]
        {
            for periodic in [[false; 3], [true, false, true]] {
                let found = |threads: usize, level: SimdLevel| {
                    let threads = Threads::new(threads);
                    let space = Space { domain: &DOMAIN, periodic, threads: &threads };
                    let (spheres, cells) = stored(count, edge, ratio, &space);
                    // More chunks than such a number of particles would have.
                    let chunks: Vec<Range<usize>> = (0..4).map(|n| n * count / 4..(n + 1) * count / 4).collect();
                    let pairs = [chunks, chunk_ranges(count)]
                        .map(|chunks| find_candidates(&spheres, &cells, &chunks, SKIN, (&threads, level)));
                    (spheres, pairs)
                };
                let (spheres, alone) = found(1, SimdLevel::Scalar);
                let expected = all_pairs(&spheres, periodic);
                assert!(count < 2 || expected.len() > 100, "{} pairs", expected.len());
                alone.iter().for_each(|alone| assert_eq!(listed(alone), expected));
                for level in SimdLevel::ALL.into_iter().filter(|level| level.is_available()) {
                    for threads in [1, 2, 3, 7] {
                        assert_eq!(found(threads, level), (spheres.clone(), alone.clone()), "{threads} {level:?}");
                    }
                }
            }
        }
    }
}
