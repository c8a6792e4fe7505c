//! Keyed random draws: every number is a function of (seed, feed, serial, what for, attempt), never of what was drawn
//! before it. So a particle's size and the places it tries depend neither on the order of calls nor on threads.

use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::{Rng, SeedableRng};

/// Words of the ChaCha stream that one attempt at a place uses: four numbers of 64 bits.
const WORDS_PER_ATTEMPT: u128 = 8;
/// The last 16 bytes of every key; a change of the scheme changes them, so that old and new draws never mix unnoticed.
const SCHEME: [u8; 16] = *b"tollgate feeds 1";

/// What all draws of one feed have in common.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct FeedKey {
    seed: u64,
    feed: u32,
}

/// What a draw is for; part of its key.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Purpose {
    Size = 1,
    Place = 2,
}

impl FeedKey {
    /// The key of feed number `feed` in a scene with `seed`.
    #[must_use]
    pub const fn new(seed: u64, feed: u32) -> Self {
        Self { seed, feed }
    }

    /// The feed's number.
    #[must_use]
    pub const fn feed(&self) -> u32 {
        self.feed
    }

    /// Two numbers in [0, 1) that fix the size of particle `serial`.
    #[must_use]
    pub fn size(&self, serial: u64) -> [f64; 2] {
        let mut generator = self.generator(Purpose::Size, serial);
        [unit(&mut generator), unit(&mut generator)]
    }

    /// The places that particle `serial` tries.
    #[must_use]
    pub fn places(&self, serial: u64) -> PlaceDraws {
        PlaceDraws { generator: self.generator(Purpose::Place, serial), next: 0 }
    }

    fn generator(&self, purpose: Purpose, serial: u64) -> ChaCha8Rng {
        let mut key = [0; 32];
        key[0..8].copy_from_slice(&self.seed.to_le_bytes());
        key[8..12].copy_from_slice(&self.feed.to_le_bytes());
        key[12] = purpose as u8;
        key[16..32].copy_from_slice(&SCHEME);
        let mut generator = ChaCha8Rng::from_seed(key);
        generator.set_stream(serial);
        generator
    }
}

/// The draws for the places of one particle.
#[derive(Debug, Clone)]
pub struct PlaceDraws {
    generator: ChaCha8Rng,
    next: u64,
}

impl PlaceDraws {
    /// Three numbers in [0, 1) of attempt number `attempt`; attempts in ascending order cost least.
    pub fn attempt(&mut self, attempt: u64) -> [f64; 3] {
        if attempt != self.next {
            self.generator.set_word_pos(u128::from(attempt) * WORDS_PER_ATTEMPT);
        }
        self.next = attempt + 1;
        let numbers = [unit(&mut self.generator), unit(&mut self.generator), unit(&mut self.generator)];
        let _spare = self.generator.next_u64();
        numbers
    }
}

/// A number in [0, 1) with 53 random bits.
fn unit(generator: &mut ChaCha8Rng) -> f64 {
    (generator.next_u64() >> 11) as f64 * (1.0 / (1_u64 << 53) as f64)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_attempt_does_not_depend_on_the_attempts_before_it() {
        let key = FeedKey::new(7, 3);
        let mut in_order = key.places(11);
        let listed: Vec<_> = (0..40).map(|attempt| in_order.attempt(attempt)).collect();
        let mut out_of_order = key.places(11);
        for attempt in [39, 0, 17, 18, 3] {
            assert_eq!(out_of_order.attempt(attempt), listed[attempt as usize]);
        }
    }

    #[test]
    fn every_part_of_the_key_counts() {
        let base = FeedKey::new(1, 2).size(3);
        assert_eq!(base, FeedKey::new(1, 2).size(3));
        assert_ne!(base, FeedKey::new(2, 2).size(3));
        assert_ne!(base, FeedKey::new(1, 3).size(3));
        assert_ne!(base, FeedKey::new(1, 2).size(4));
        assert_ne!(base[0], FeedKey::new(1, 2).places(3).attempt(0)[0]);
    }

    #[test]
    fn numbers_are_uniform() {
        let count = 40_000;
        let key = FeedKey::new(99, 0);
        let numbers: Vec<f64> = (0..count).map(|serial| key.size(serial)[0]).collect();
        assert!(numbers.iter().all(|x| (0.0..1.0).contains(x)));
        let mean = numbers.iter().sum::<f64>() / count as f64;
        // the mean of n uniform numbers has the standard deviation 1 / sqrt(12 n); five of them
        assert!((mean - 0.5).abs() < 5.0 / (12.0 * count as f64).sqrt());
    }
}
