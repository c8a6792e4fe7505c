//! The search for candidate pairs.

use super::cells::CellLevels;
use super::list::{Images, NO_IMAGE, OuterList};
use crate::dem::particles::Sphere;
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

/// A pair as found: from the particle of the finer level (or the lower index) to the other.
#[derive(Debug, Clone, Copy)]
struct Pair {
    from: u32,
    to: u32,
    image: u32,
}

/// Pairs that one chunk's particles found.
#[derive(Debug, Default)]
struct Found {
    own: Vec<Pair>,
    cross: Vec<Pair>,
}

/// All pairs within `skin` [m] of contact, chunk by chunk.
pub fn find_candidates(
    spheres: &[Sphere],
    cells: &CellLevels,
    chunks: &[Range<usize>],
    skin: f64,
    pool: &crate::dem::threads::Threads,
) -> Vec<ChunkCandidates> {
    let found: Vec<Found> = pool.map(chunks.len(), |chunk| find_from(spheres, cells, &chunks[chunk], skin));
    pool.map(chunks.len(), |chunk| {
        let range = &chunks[chunk];
        let own = OuterList::mixed(range, found[chunk].own.iter().map(|pair| (pair.from, pair.to, pair.image)));
        let mut cross: Vec<(u32, u32, u32)> = Vec::new();
        for pair in found.iter().flat_map(|found| &found.cross) {
            if range.contains(&(pair.from as usize)) {
                cross.push((pair.from, pair.to, pair.image));
            } else if range.contains(&(pair.to as usize)) {
                cross.push((pair.to, pair.from, Images::opposite(pair.image)));
            }
        }
        ChunkCandidates { own, cross: OuterList::mixed(range, cross.into_iter()) }
    })
}

fn find_from(spheres: &[Sphere], cells: &CellLevels, range: &Range<usize>, skin: f64) -> Found {
    let mut found = Found::default();
    for index in range.clone() {
        let own = &spheres[index];
        let position = own.position();
        let level = cells.level(index);
        for (number, grid) in cells.grids.iter().enumerate().skip(level) {
            // Of a pair of one level the earlier one finds the later one.
            let first = if number == level { index as u32 + 1 } else { 0 };
            let reach = own.radius + grid.largest_radius + skin;
            grid.for_each_run(&position, reach, first, |members, shift| {
                let image = Images::index(shift);
                let offset = (image != NO_IMAGE).then(|| grid.image_offset(shift));
                for &member in members.iter().filter(|&&member| member >= first) {
                    let other = &spheres[member as usize];
                    let mut distance = other.position() - position;
                    if let Some(offset) = offset {
                        distance += offset;
                    }
                    let reach = own.radius + other.radius + skin;
                    if distance.norm_squared() < reach * reach {
                        let pair = Pair { from: index as u32, to: member, image };
                        let list = if range.contains(&(member as usize)) { &mut found.own } else { &mut found.cross };
                        list.push(pair);
                    }
                }
            });
        }
    }
    found
}

#[cfg(test)]
mod tests {
    use super::super::cells::Space;
    use super::super::chunks::chunk_ranges;
    use super::*;
    use crate::dem::threads::Threads;
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
            for (&owner, candidate) in list.owners.iter().zip(&list.candidates) {
                pairs.push([owner, candidate.partner]);
                pairs.extend(both.then_some([candidate.partner, owner]));
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
    fn any_number_of_threads_lists_the_same_pairs_in_the_same_order_and_all_of_them() {
        for (count, edge, ratio) in
            [(0, 0.06, 1.0), (1, 0.06, 1.0), (4000, 0.06, 1.3), (200, 1e-4, 1.0), (3000, 0.06, 10.0)]
        {
            for periodic in [[false; 3], [true, false, true]] {
                let found = |threads: usize| {
                    let threads = Threads::new(threads);
                    let space = Space { domain: &DOMAIN, periodic, threads: &threads };
                    let (spheres, cells) = stored(count, edge, ratio, &space);
                    // More chunks than such a number of particles would have.
                    let chunks: Vec<Range<usize>> = (0..4).map(|n| n * count / 4..(n + 1) * count / 4).collect();
                    let pairs = [chunks, chunk_ranges(count)]
                        .map(|chunks| find_candidates(&spheres, &cells, &chunks, SKIN, &threads));
                    (spheres, pairs)
                };
                let (spheres, alone) = found(1);
                let expected = all_pairs(&spheres, periodic);
                assert!(count < 2 || expected.len() > 100, "{} pairs", expected.len());
                alone.iter().for_each(|alone| assert_eq!(listed(alone), expected));
                [2, 3, 7].into_iter().for_each(|threads| assert_eq!(found(threads), (spheres.clone(), alone.clone())));
            }
        }
    }
}
