//! Lists that all threads work on: cut into pieces that follow from their length alone, so that no bit depends on the threads.

use super::threads::Threads;
use std::ops::{AddAssign, Range};

/// About so many entries go into a piece: beside its work, handing it out costs nothing.
const ENTRIES: usize = 2048;
/// Most pieces.
const MOST: usize = 64;

/// Cuts `count` entries into contiguous pieces, a power of two of them, so that two, four or eight threads share them evenly.
#[must_use]
pub fn piece_ranges(count: usize) -> Vec<Range<usize>> {
    let pieces = (count / ENTRIES).next_power_of_two().min(MOST);
    (0..pieces).map(|piece| piece * count / pieces..(piece + 1) * count / pieces).collect()
}

/// Splits a list at the borders of contiguous ranges, the first of which begins with the list.
pub fn split_at_ranges<T>(mut list: &mut [T], ranges: impl Iterator<Item = Range<usize>>) -> Vec<&mut [T]> {
    let mut pieces = Vec::new();
    for range in ranges {
        let (piece, rest) = list.split_at_mut(range.len());
        pieces.push(piece);
        list = rest;
    }
    pieces
}

/// Turns the numbers of entries of rows, each one place behind its row, into where each row's begin, and where the last one's end.
pub fn add_up<T: Copy + Default + AddAssign>(counts: &mut [T]) {
    let mut sum = T::default();
    for count in counts {
        // Not read back from the list: that takes longer than the sum.
        sum += *count;
        *count = sum;
    }
}

impl Threads {
    /// The list `entry(0)`, `entry(1)`, ... `entry(count - 1)`.
    ///
    /// # Panics
    /// Where `entry` does.
    pub fn collect<T: Copy + Send>(&self, count: usize, entry: impl Fn(usize) -> T + Sync) -> Vec<T> {
        let mut list = Vec::new();
        self.collect_into(&mut list, count, entry);
        list
    }

    /// Puts the list that [`Threads::collect`] makes into the storage of another.
    ///
    /// # Panics
    /// Where `entry` does.
    pub fn collect_into<T: Copy + Send>(&self, list: &mut Vec<T>, count: usize, entry: impl Fn(usize) -> T + Sync) {
        list.clear();
        list.reserve_exact(count);
        let ranges = piece_ranges(count);
        let pieces = split_at_ranges(&mut list.spare_capacity_mut()[..count], ranges.iter().cloned());
        self.for_each(ranges.into_iter().zip(pieces).collect(), |(range, piece)| {
            for (slot, index) in piece.iter_mut().zip(range) {
                slot.write(entry(index));
            }
        });
        // SAFETY: the pieces tile the first `count` places, and all of them were written to their ends: else this would have panicked.
        unsafe { list.set_len(count) };
    }

    /// What `found` says of every piece of `count` entries, in their order.
    ///
    /// # Panics
    /// Where `found` does.
    pub fn map_pieces<R: Send + Sync>(&self, count: usize, found: impl Fn(Range<usize>) -> R + Sync) -> Vec<R> {
        let ranges = piece_ranges(count);
        self.map(ranges.len(), |piece| found(ranges[piece].clone()))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::panic::{AssertUnwindSafe, catch_unwind};

    const COUNTS: [usize; 7] = [0, 1, 7, ENTRIES - 1, 3 * ENTRIES + 1, 20_000, 1_000_003];

    #[test]
    fn pieces_tile_all_entries_once() {
        for count in COUNTS {
            let ranges = piece_ranges(count);
            assert_eq!((ranges[0].start, ranges[ranges.len() - 1].end), (0, count));
            assert!(ranges.windows(2).all(|pair| pair[0].end == pair[1].start) && ranges.len() <= MOST);
        }
    }

    #[test]
    fn numbers_of_entries_become_places() {
        let mut start = [0_u32, 3, 0, 2, 1];
        add_up(&mut start);
        assert_eq!(start, [0, 3, 3, 5, 6]);
        add_up::<u32>(&mut []);
    }

    #[test]
    fn every_entry_is_made_once_and_in_its_place() {
        for threads in [1, 2, 3, 7] {
            let threads = Threads::new(threads);
            for count in COUNTS {
                let list = threads.collect(count, |index| 3 * index);
                assert!(list.len() == count && list.iter().enumerate().all(|(index, entry)| *entry == 3 * index));
                let ends: Vec<usize> = threads.map_pieces(count, |range| range.end);
                assert_eq!(ends, piece_ranges(count).iter().map(|range| range.end).collect::<Vec<_>>());
            }
        }
    }

    #[test]
    fn a_panic_comes_out_and_no_half_made_list() {
        let threads = Threads::new(2);
        let outcome = catch_unwind(AssertUnwindSafe(|| {
            threads.collect(20_000, |index| {
                assert!(index != 15_000, "entry {index}");
                index
            })
        }));
        assert_eq!(outcome.unwrap_err().downcast_ref::<String>().unwrap(), "entry 15000");
    }
}
