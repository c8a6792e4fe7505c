//! Candidate pairs of a chunk: the outer list, and the rows that it is mixed from.

use super::list::NO_IMAGE;
use std::ops::Range;

/// Partners of a chunk's particles, one particle's after the other's.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Rows {
    /// Where the partners of each particle begin, and where the last one's end.
    pub start: Vec<u32>,
    /// Storage indices of the partners.
    pub partners: Vec<u32>,
    /// Which periodic image of each; empty where all are the particles themselves.
    pub images: Vec<u32>,
}

impl Rows {
    /// Entries of the row of the chunk's particle number `row`.
    #[inline(always)]
    #[must_use]
    pub fn entries(&self, row: usize) -> Range<usize> {
        self.start[row] as usize..self.start[row + 1] as usize
    }

    /// The image of an entry's partner.
    #[inline(always)]
    #[must_use]
    pub fn image(&self, entry: usize) -> u32 {
        self.images.get(entry).copied().unwrap_or(NO_IMAGE)
    }
}

/// Candidate pairs of a chunk.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct OuterList {
    /// The particle of each pair that the chunk owns.
    pub owners: Vec<u32>,
    /// The other one.
    pub partners: Vec<u32>,
    /// Which periodic image of it; empty where all are the particles themselves.
    pub images: Vec<u32>,
}

/// Particles whose pairs are mixed: enough for every lane of a block to belong to another one, few enough to stay in the nearest cache.
const MIXED: usize = 32;

/// A row that is not yet used up.
#[derive(Clone, Copy, Default)]
struct Open {
    owner: u32,
    next: u32,
    end: u32,
}

impl OuterList {
    /// The pairs of the particles in `range`, each particle's in the order of its row, mixed so that neighbours in the list belong to
    /// different particles: what is added to one of them need not wait for what was added just before.
    #[must_use]
    pub fn mixed(range: &Range<usize>, rows: &Rows) -> Self {
        let count = rows.partners.len();
        let has_images = rows.images.iter().any(|&image| image != NO_IMAGE);
        let mut list = Self {
            owners: vec![0; count],
            partners: vec![0; count],
            images: vec![NO_IMAGE; if has_images { count } else { 0 }],
        };
        let mut place = 0;
        for group in (0..range.len()).step_by(MIXED) {
            let mut open = [Open::default(); MIXED];
            let mut left = 0;
            for row in group..range.len().min(group + MIXED) {
                let Range { start, end } = rows.entries(row);
                open[left] = Open { owner: (range.start + row) as u32, next: start as u32, end: end as u32 };
                left += usize::from(start < end);
            }
            while left > 0 {
                let turn = left;
                left = 0;
                for number in 0..turn {
                    let Open { owner, next, end } = open[number];
                    list.owners[place] = owner;
                    list.partners[place] = rows.partners[next as usize];
                    if has_images {
                        list.images[place] = rows.images[next as usize];
                    }
                    place += 1;
                    open[left] = Open { owner, next: next + 1, end };
                    left += usize::from(next + 1 < end);
                }
            }
        }
        list
    }

    /// Number of pairs.
    #[must_use]
    pub const fn len(&self) -> usize {
        self.owners.len()
    }

    /// True where there is no pair.
    #[must_use]
    pub const fn is_empty(&self) -> bool {
        self.owners.is_empty()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Rows of these lengths; entry `n` has partner 1000 + n.
    fn rows(lengths: &[u32], images: Vec<u32>) -> Rows {
        let mut start = vec![0];
        lengths.iter().for_each(|length| start.push(start[start.len() - 1] + length));
        Rows { partners: (1000..1000 + start[lengths.len()]).collect(), start, images }
    }

    #[test]
    fn rows_take_turns_within_a_group() {
        let list = OuterList::mixed(&(7..12), &rows(&[2, 0, 3, 1, 0], Vec::new()));
        assert_eq!(list.owners, [7, 9, 10, 7, 9, 9]);
        assert_eq!(list.partners, [1000, 1002, 1005, 1001, 1003, 1004]);
        assert!(list.images.is_empty());
        // A particle of the next group comes after all of this one.
        let lengths: Vec<u32> = (0..MIXED as u32 + 1).map(|row| if row % MIXED as u32 == 0 { 2 } else { 0 }).collect();
        assert_eq!(OuterList::mixed(&(0..MIXED + 1), &rows(&lengths, Vec::new())).owners, [0, 0, 32, 32]);
    }

    #[test]
    fn images_are_listed_where_there_is_one() {
        let images = |images: [u32; 3]| OuterList::mixed(&(0..2), &rows(&[2, 1], images.to_vec())).images;
        assert_eq!(images([1, 2, 3]), [1, 3, 2]);
        assert!(images([NO_IMAGE; 3]).is_empty());
        assert!(OuterList::mixed(&(3..3), &rows(&[], Vec::new())).is_empty());
    }
}
