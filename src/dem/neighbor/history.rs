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
    pub fn gather<'a>(count: usize, lists: impl Iterator<Item = (&'a InnerList, &'a InnerList)>) -> Self {
        let mut found: Vec<(u32, u32, Memory)> = Vec::new();
        for (own, cross) in lists {
            collect(own, true, &mut found);
            collect(cross, false, &mut found);
        }
        let mut start = vec![0_u32; count + 1];
        found.iter().for_each(|(particle, ..)| start[*particle as usize + 1] += 1);
        (0..count).for_each(|index| start[index + 1] += start[index]);
        let mut next = start.clone();
        let mut entries = vec![(0, Memory::NONE); found.len()];
        for (particle, partner, memory) in found {
            let slot = &mut next[particle as usize];
            entries[*slot as usize] = (partner, memory);
            *slot += 1;
        }
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

fn collect(list: &InnerList, both: bool, found: &mut Vec<(u32, u32, Memory)>) {
    for (entry, particle, candidate) in list.pairs() {
        let Some(memory) = list.memory.get(entry).filter(|memory| *memory != Memory::NONE) else { continue };
        found.push((particle, candidate.partner, memory));
        if both {
            found.push((candidate.partner, particle, memory.mirrored()));
        }
    }
}
