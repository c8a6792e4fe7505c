//! Tables by particle identity, looked up for every particle near a gate at every time step.

use crate::particle::ParticleId;
use std::collections::HashMap;
use std::hash::{BuildHasherDefault, Hasher};

/// A table by identity. Its order means nothing and differs from nothing: whoever needs one sorts.
pub type IdMap<T> = HashMap<ParticleId, T, BuildHasherDefault<IdHasher>>;

/// Hash of an identity: multiplied by 2^64 / golden ratio (Knuth 1973), upper and lower half mixed. Identities come from our own
/// feeds, so no protection against chosen keys is needed.
#[derive(Debug, Clone, Copy, Default)]
pub struct IdHasher(u64);

impl Hasher for IdHasher {
    fn finish(&self) -> u64 {
        self.0
    }

    fn write(&mut self, bytes: &[u8]) {
        for &byte in bytes {
            self.write_u64(u64::from(byte));
        }
    }

    fn write_u64(&mut self, number: u64) {
        let product = (self.0 ^ number).wrapping_mul(0x9E37_79B9_7F4A_7C15);
        self.0 = product ^ (product >> 32);
    }
}
