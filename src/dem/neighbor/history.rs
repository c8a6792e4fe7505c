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
    /// Partners.
    partners: Vec<u32>,
    /// Memories of the contacts with them: apart, so that who looks for a partner passes none by.
    memories: Vec<Memory>,
}

impl HeldMemory {
    /// Gathers the memories of the chunks' particles from their inner lists: own pairs, cross pairs.
    #[must_use]
    pub fn gather(chunks: &[(Range<usize>, [&InnerList; 2])], threads: &Threads) -> Self {
        Self { chunks: threads.map(chunks.len(), |number| ChunkMemory::gather(&chunks[number].0, chunks[number].1)) }
    }

    /// Memory of the contact of `particle` with `partner`, seen from the former; none where they did not touch.
    #[must_use]
    pub fn of(&self, particle: u32, partner: u32) -> Option<Memory> {
        let number = self.chunks.partition_point(|chunk| chunk.range.end <= particle as usize);
        self.chunks.get(number)?.of(particle as usize, partner)
    }
}

impl ChunkMemory {
    fn gather(range: &Range<usize>, lists: [&InnerList; 2]) -> Self {
        // Counted first and filled in afterwards: of millions of particles this is the largest thing while lists are made anew.
        let mut start = vec![0_u32; range.len() + 1];
        for_each_memory(lists, |particle, _, _| start[particle as usize - range.start + 1] += 1);
        add_up(&mut start);
        let mut next = start.clone();
        let count = start[range.len()] as usize;
        let (mut partners, mut memories) = (vec![0; count], vec![Memory::NONE; count]);
        for_each_memory(lists, |particle, partner, memory| {
            let slot = &mut next[particle as usize - range.start];
            partners[*slot as usize] = partner;
            memories[*slot as usize] = memory;
            *slot += 1;
        });
        Self { range: range.clone(), start, partners, memories }
    }

    fn of(&self, particle: usize, partner: u32) -> Option<Memory> {
        let row = particle - self.range.start;
        let entries = self.start[row] as usize..self.start[row + 1] as usize;
        let place = self.partners[entries.clone()].iter().position(|&held| held == partner)?;
        Some(self.memories[entries.start + place])
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
