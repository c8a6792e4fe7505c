//! Contact memory carried over a change of the particles' order.

use super::list::{InnerList, Memory};

/// The contacts that remember something, by storage index of either particle.
#[derive(Debug, Default)]
pub struct HeldMemory {
    start: Vec<u32>,
    entries: Vec<(u32, Memory)>,
}

impl HeldMemory {
    /// Gathers the memories of `count` particles from the chunks' inner lists: (own pairs, cross pairs).
    #[must_use]
    pub fn gather<'a>(count: usize, lists: impl Iterator<Item = (&'a InnerList, &'a InnerList)> + Clone) -> Self {
        // Counted first and filled in afterwards: of millions of particles this is the largest thing while lists are made anew.
        let mut start = vec![0_u32; count + 1];
        for_each_memory(lists.clone(), |particle, _, _| start[particle as usize + 1] += 1);
        (0..count).for_each(|index| start[index + 1] += start[index]);
        let mut next = start.clone();
        let mut entries = vec![(0, Memory::NONE); start[count] as usize];
        for_each_memory(lists, |particle, partner, memory| {
            let slot = &mut next[particle as usize];
            entries[*slot as usize] = (partner, memory);
            *slot += 1;
        });
        Self { start, entries }
    }

    /// Memory of the contact of `particle` with `partner`, seen from the former; none where they did not touch.
    #[must_use]
    pub fn of(&self, particle: u32, partner: u32) -> Memory {
        let Some(range) = self.start.get(particle as usize..particle as usize + 2) else { return Memory::NONE };
        self.entries[range[0] as usize..range[1] as usize]
            .iter()
            .find(|(held, _)| *held == partner)
            .map_or(Memory::NONE, |(_, memory)| *memory)
    }
}

/// Calls `visit` (particle, partner, memory) for every contact that remembers something, from both particles' side.
fn for_each_memory<'a>(
    lists: impl Iterator<Item = (&'a InnerList, &'a InnerList)>,
    mut visit: impl FnMut(u32, u32, Memory),
) {
    for (list, both) in lists.flat_map(|(own, cross)| [(own, true), (cross, false)]) {
        for (entry, particle, candidate) in list.pairs() {
            let Some(memory) = list.memory.get(entry).filter(|memory| *memory != Memory::NONE) else { continue };
            visit(particle, candidate.partner, memory);
            if both {
                visit(candidate.partner, particle, memory.mirrored());
            }
        }
    }
}
