//! Contact memory carried over a change of the particles' order.

use super::list::{InnerList, Memory};
use crate::dem::pieces::add_up;
use crate::dem::threads::Threads;
use std::ops::Range;

/// The contacts that remember something, by storage index of either particle.
#[derive(Debug, Default)]
pub struct HeldMemory {
    /// Chunk by chunk, ascending.
    chunks: Vec<ChunkMemory>,
}

/// Those of one chunk's particles.
#[derive(Debug)]
struct ChunkMemory {
    range: Range<usize>,
    /// Where the contacts of each particle begin, and where the last one's end.
    start: Vec<u32>,
    /// Partners, and memories of the contacts with them.
    entries: Vec<(u32, Memory)>,
}

impl HeldMemory {
    /// Gathers the memories of the chunks' particles from their inner lists: own pairs, cross pairs.
    #[must_use]
    pub fn gather(chunks: &[(Range<usize>, [&InnerList; 2])], threads: &Threads) -> Self {
        Self { chunks: threads.map(chunks.len(), |number| ChunkMemory::gather(&chunks[number].0, chunks[number].1)) }
    }

    /// Memory of the contact of `particle` with `partner`, seen from the former; none where they did not touch.
    #[must_use]
    pub fn of(&self, particle: u32, partner: u32) -> Memory {
        let number = self.chunks.partition_point(|chunk| chunk.range.end <= particle as usize);
        self.chunks.get(number).map_or(Memory::NONE, |chunk| chunk.of(particle as usize, partner))
    }
}

impl ChunkMemory {
    fn gather(range: &Range<usize>, lists: [&InnerList; 2]) -> Self {
        // Counted first and filled in afterwards: of millions of particles this is the largest thing while lists are made anew.
        let mut start = vec![0_u32; range.len() + 1];
        for_each_memory(lists, |particle, _, _| start[particle as usize - range.start + 1] += 1);
        add_up(&mut start);
        let mut next = start.clone();
        let mut entries = vec![(0, Memory::NONE); start[range.len()] as usize];
        for_each_memory(lists, |particle, partner, memory| {
            let slot = &mut next[particle as usize - range.start];
            entries[*slot as usize] = (partner, memory);
            *slot += 1;
        });
        Self { range: range.clone(), start, entries }
    }

    fn of(&self, particle: usize, partner: u32) -> Memory {
        let row = particle - self.range.start;
        self.entries[self.start[row] as usize..self.start[row + 1] as usize]
            .iter()
            .find(|(held, _)| *held == partner)
            .map_or(Memory::NONE, |(_, memory)| *memory)
    }
}

/// Calls `visit` (particle, partner, memory) for every contact of a chunk's particles that remembers something: own pairs from both
/// sides, pairs with other chunks from the side of its own particle.
fn for_each_memory([own, cross]: [&InnerList; 2], mut visit: impl FnMut(u32, u32, Memory)) {
    for (list, both) in [(own, true), (cross, false)] {
        for (entry, particle, candidate) in list.pairs() {
            let Some(memory) = list.memory.get(entry).filter(|memory| *memory != Memory::NONE) else { continue };
            visit(particle, candidate.partner, memory);
            if both {
                visit(candidate.partner, particle, memory.mirrored());
            }
        }
    }
}
