//! The search for candidate pairs.

use super::cells::CellLevels;
use super::list::{Images, NO_IMAGE, OuterList};
use crate::dem::particles::Sphere;
use std::ops::Range;

/// Candidates of one chunk: `own` pairs lie within the chunk and stand once, `cross` pairs reach into another chunk and stand
/// in both chunks, each of which computes the load on its own particle only.
#[derive(Debug, Clone, Default)]
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
