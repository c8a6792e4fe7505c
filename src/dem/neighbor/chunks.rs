//! Chunks: the fixed pieces of work. They follow from the number of particles alone, so that no bit depends on the threads.

use std::ops::Range;

/// Cuts `count` particles in storage order into contiguous chunks.
///
/// Particles are stored in layers of cells; a chunk of about six layers keeps the pairs that cross between chunks (computed
/// by both) near a tenth of all. Their number is the power of two next to n^(1/3) / 6, so that two, four or eight threads
/// share them evenly.
#[must_use]
pub fn chunk_ranges(count: usize) -> Vec<Range<usize>> {
    let pieces = ((count as f64).cbrt() / 6.0).max(1.0).log2().round().exp2() as usize;
    (0..pieces).map(|piece| piece * count / pieces..(piece + 1) * count / pieces).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn chunks_tile_all_particles_once() {
        for count in [0, 1, 7, 20_000, 1_000_000] {
            let ranges = chunk_ranges(count);
            assert_eq!(ranges.first().expect("at least one chunk").start, 0);
            assert_eq!(ranges.last().expect("at least one chunk").end, count);
            assert!(ranges.windows(2).all(|pair| pair[0].end == pair[1].start));
        }
    }
}
