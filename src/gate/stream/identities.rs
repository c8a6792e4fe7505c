//! A set of particle identities that costs about a bit each where serial numbers are dense.

use crate::particle::ParticleId;
use std::collections::HashMap;

/// Identities in a page: 2^9, in eight words.
const PAGE_BITS: u32 = 9;

/// A set of identities.
#[derive(Debug, Default)]
pub(super) struct Identities {
    pages: HashMap<u64, [u64; 1 << (PAGE_BITS - 6)]>,
}

impl Identities {
    /// Adds `id`; false where it was there already.
    pub(super) fn insert(&mut self, id: ParticleId) -> bool {
        let page = self.pages.entry(id.0 >> PAGE_BITS).or_default();
        let within = id.0 & ((1 << PAGE_BITS) - 1);
        let (word, bit) = ((within >> 6) as usize, 1_u64 << (within & 63));
        let new = page[word] & bit == 0;
        page[word] |= bit;
        new
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;
    use std::collections::HashSet;

    proptest! {
        #[test]
        fn agrees_with_a_set_of_numbers(ids in prop::collection::vec(prop_oneof![0_u64..2000, any::<u64>()], 0..300)) {
            let (mut set, mut reference) = (Identities::default(), HashSet::new());
            for id in ids {
                prop_assert_eq!(set.insert(ParticleId(id)), reference.insert(id));
            }
        }
    }
}
