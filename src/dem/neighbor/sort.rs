//! The sorting of particles into cells by all threads: pieces of the particles are spread over runs of cells, then every run is sorted
//! by itself.

use crate::dem::pieces::{add_up, piece_ranges, split_at_ranges};
use crate::dem::threads::Threads;
use std::ops::Range;

/// Particles by cell.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Sorted {
    /// Where the particles of each cell begin, and where the last one's end.
    pub start: Vec<u32>,
    /// Storage indices, cell by cell.
    pub members: Vec<u32>,
}

/// A piece of the particles, spread over runs of cells.
struct Spread {
    /// (cell, particle), run by run, in each in the order given.
    entries: Vec<(u32, u32)>,
    /// Where each run's begin, and where the last one's end.
    start: Vec<u32>,
}

impl Spread {
    /// `entry(place)` is (cell, particle).
    fn new(places: Range<usize>, entry: impl Fn(usize) -> (u32, u32), run: usize, runs: usize) -> Self {
        let entries: Vec<(u32, u32)> = places.map(entry).collect();
        let run_of = |(cell, _): (u32, u32)| cell as usize / run;
        let mut start = vec![0_u32; runs + 1];
        entries.iter().for_each(|&entry| start[run_of(entry) + 1] += 1);
        add_up(&mut start);
        let mut next = start.clone();
        let mut spread = vec![(0, 0); entries.len()];
        for &entry in &entries {
            let slot = &mut next[run_of(entry)];
            spread[*slot as usize] = entry;
            *slot += 1;
        }
        Self { entries: spread, start }
    }

    fn of_run(&self, number: usize) -> &[(u32, u32)] {
        &self.entries[self.start[number] as usize..self.start[number + 1] as usize]
    }
}

impl Sorted {
    /// Sorts `members` into so many cells, in each in the order given; `cell_of` tells a member's.
    #[must_use]
    pub fn new(threads: &Threads, members: &[u32], cells: usize, cell_of: impl Fn(u32) -> u32 + Sync) -> Self {
        let run = cells.div_ceil(piece_ranges(members.len()).len()).max(1);
        let runs: Vec<Range<usize>> = (0..cells).step_by(run).map(|from| from..(from + run).min(cells)).collect();
        let entry = |place: usize| (cell_of(members[place]), members[place]);
        let spread = threads.map_pieces(members.len(), |places| Spread::new(places, entry, run, runs.len()));
        let mut end = 0;
        let places: Vec<Range<usize>> = (0..runs.len())
            .map(|number| {
                let from = end;
                end += spread.iter().map(|piece| piece.of_run(number).len()).sum::<usize>();
                from..end
            })
            .collect();
        let (mut start, mut sorted) = (vec![0_u32; cells + 1], vec![0_u32; members.len()]);
        start[cells] = members.len() as u32;
        let work = split_at_ranges(&mut start, runs.iter().cloned())
            .into_iter()
            .zip(split_at_ranges(&mut sorted, places.iter().cloned()))
            .enumerate()
            .collect();
        threads.for_each(work, |(number, (start, sorted)): (usize, (&mut [u32], &mut [u32]))| {
            let entries = || spread.iter().flat_map(|piece| piece.of_run(number));
            sort_run(entries, runs[number].start, places[number].start as u32, start, sorted);
        });
        Self { start, members: sorted }
    }
}

/// Sorts the (cell, particle) of a run of cells of which `first` is the first one; its particles stand from `place` on.
fn sort_run<'a, I: Iterator<Item = &'a (u32, u32)>>(
    entries: impl Fn() -> I,
    first: usize,
    place: u32,
    start: &mut [u32],
    sorted: &mut [u32],
) {
    let mut next = vec![0_u32; start.len() + 1];
    entries().for_each(|(cell, _)| next[*cell as usize - first + 1] += 1);
    add_up(&mut next);
    start.iter_mut().zip(&next).for_each(|(start, from)| *start = place + from);
    for (cell, member) in entries() {
        let slot = &mut next[*cell as usize - first];
        sorted[*slot as usize] = *member;
        *slot += 1;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// As a stable sort puts them.
    fn by_sorting(members: &[u32], cells: usize, cell_of: impl Fn(u32) -> u32) -> Sorted {
        let mut sorted = members.to_vec();
        sorted.sort_by_key(|&member| cell_of(member));
        let below = |cell: usize| sorted.partition_point(|&member| (cell_of(member) as usize) < cell) as u32;
        Sorted { start: (0..=cells).map(below).collect(), members: sorted }
    }

    #[test]
    fn any_number_of_threads_sorts_as_a_stable_sort_does() {
        let scattered = |cells: u32| move |member: u32| (member.wrapping_mul(2_654_435_761) >> 7) % cells;
        for count in [0_u32, 1, 5, 2047, 30_000] {
            // Not ascending, as of one size level among others they need not be.
            let members: Vec<u32> = (0..count).map(|index| 2 * (count - index)).collect();
            for cells in [1, 2, 97, 40_000] {
                let expected = by_sorting(&members, cells as usize, scattered(cells));
                let at_the_end = by_sorting(&members, cells as usize, |_| cells - 1);
                for threads in [1, 2, 3, 7].map(Threads::new) {
                    assert_eq!(Sorted::new(&threads, &members, cells as usize, scattered(cells)), expected);
                    assert_eq!(Sorted::new(&threads, &members, cells as usize, |_| cells - 1), at_the_end);
                }
            }
        }
    }
}
