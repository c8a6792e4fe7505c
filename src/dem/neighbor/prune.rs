//! Pruning: which pairs of an outer list go into the inner one, several looked at at once.

use super::list::{Images, InnerList, Remembered, effective_mass, effective_radius};
use super::outer::OuterList;
use crate::dem::particles::{Sphere, Velocity};
use crate::math::lanes::{LaneWork, Lanes, MOST_LANES, Mask, SimdLevel, at_level};
use std::cell::RefCell;
use std::ops::Range;

/// What pruning reads of all particles.
#[derive(Debug, Clone, Copy)]
pub struct Bodies<'a> {
    /// Centres and radii.
    pub spheres: &'a [Sphere],
    /// Masses.
    pub velocities: &'a [Velocity],
    /// Periodic images.
    pub images: &'a Images,
    /// Who sleeps, as the list is to know it; empty where nobody does.
    pub asleep: &'a [bool],
}

/// Sections of an inner list, one after the other: in contact when the list was made, apart, both asleep. Pairs alike stand together, so
/// that lanes which the laws need not compute fill whole blocks.
const SECTIONS: usize = 3;

/// Lists needed only while an inner one is made. A thread keeps them for its next: lists of this size come from the system and go back to
/// it, which takes as long as what is done with them.
#[derive(Debug, Default)]
pub struct PruningScratch {
    kept: [Kept; SECTIONS],
    /// Where each pair of the outer list stands in the inner one from which memories are taken.
    pub(super) entry_at: Vec<u32>,
    /// Where each pair of the new inner list stands in that one.
    pub(super) entries: Vec<u32>,
}

impl PruningScratch {
    /// `work` with what the present thread keeps.
    pub fn with<R>(work: impl FnOnce(&mut Self) -> R) -> R {
        thread_local! {
            static KEPT: RefCell<PruningScratch> = RefCell::default();
        }
        KEPT.with_borrow_mut(work)
    }
}

impl OuterList {
    /// The pairs within `skin` [m] of contact, section by section, in each in the same order as here. `worn` lends its storage; memories
    /// are nobody's until [`InnerList::take_over`] or [`InnerList::recall_each`] sets them.
    #[must_use]
    pub fn pruned(
        &self,
        level: SimdLevel,
        bodies: Bodies,
        skin: f64,
        remembered: Remembered,
        (worn, scratch): (InnerList, &mut PruningScratch),
    ) -> InnerList {
        let mut inner = worn.emptied();
        let kept = &mut scratch.kept;
        at_level(level, Sieve { outer: self, bodies, skin, kept });
        kept.iter().for_each(|kept| kept.append_to(&mut inner.places));
        inner.apart = kept[1].count;
        let InnerList { owners, partners, images, places, .. } = &mut inner;
        owners.extend(places.iter().map(|&place| self.owners[place as usize]));
        partners.extend(places.iter().map(|&place| self.partners[place as usize]));
        if !self.images.is_empty() {
            images.extend(places.iter().map(|&place| self.images[place as usize]));
        }
        inner.pad(remembered);
        at_level(level, Constants { inner: &mut inner, bodies });
        inner
    }
}

/// Places of pairs in an outer list. The list is longer than what it holds: it takes what may turn out not to count without a jump that
/// no processor foresees.
#[derive(Debug, Default)]
struct Kept {
    places: Vec<u32>,
    count: usize,
}

impl Kept {
    /// Forgets what it holds, and takes up to `length` from now on.
    fn make_room(&mut self, length: usize) {
        self.count = 0;
        if self.places.len() < length {
            self.places.resize(length, 0);
        }
    }

    /// Appends the places of the block from `from` on whose bit is set.
    #[inline(always)]
    fn append<L: Lanes>(&mut self, from: usize, bits: u16) {
        let block: [u32; MOST_LANES] = std::array::from_fn(|lane| (from + lane) as u32);
        self.count += L::pack(&block, bits, &mut self.places[self.count..]);
    }

    fn append_to(&self, places: &mut Vec<u32>) {
        places.extend_from_slice(&self.places[..self.count]);
    }
}

/// The choice of an outer list's pairs.
struct Sieve<'a> {
    outer: &'a OuterList,
    bodies: Bodies<'a>,
    skin: f64,
    /// Takes the places of the pairs that are chosen, section by section.
    kept: &'a mut [Kept; SECTIONS],
}

impl LaneWork for Sieve<'_> {
    type Output = ();

    #[inline(always)]
    fn run<L: Lanes>(mut self) {
        let length = self.outer.len();
        let sleepers = if self.bodies.asleep.is_empty() { 0 } else { length };
        self.kept.iter_mut().zip([length, length, sleepers]).for_each(|(kept, length)| kept.make_room(length));
        let whole = length - length % L::COUNT;
        (0..whole).step_by(L::COUNT).for_each(|from| self.sort::<L>(from));
        (whole..length).for_each(|from| self.sort::<f64>(from));
    }
}

impl Sieve<'_> {
    /// Sorts the block of pairs from `from` on.
    #[inline(always)]
    fn sort<L: Lanes>(&mut self, from: usize) {
        let [within, touching] = self.meet::<L>(from);
        let asleep = if self.bodies.asleep.is_empty() { 0 } else { self.asleep(from..from + L::COUNT) & within };
        let [in_contact, apart, at_rest] = &mut *self.kept;
        in_contact.append::<L>(from, within & touching & !asleep);
        apart.append::<L>(from, within & !touching & !asleep);
        if asleep != 0 {
            at_rest.append::<L>(from, asleep);
        }
    }

    /// Which pairs of the block from `from` on are within the skin, and which touch.
    #[inline(always)]
    fn meet<L: Lanes>(&self, from: usize) -> [u16; 2] {
        let OuterList { owners, partners, images } = self.outer;
        let Bodies { spheres, .. } = self.bodies;
        let block = from..from + L::COUNT;
        let [owners, partners] = [&owners[block.clone()], &partners[block.clone()]];
        debug_assert!(owners.iter().chain(partners).all(|&index| (index as usize) < spheres.len()));
        let rows = spheres.as_ptr().cast();
        // SAFETY: spheres are rows of four numbers, and lists name only particles that there are.
        let [[a, b, c, own], [x, y, z, other]] =
            unsafe { [L::gather_four(rows, owners), L::gather_four(rows, partners)] };
        let (mut x, mut y, mut z) = (x - a, y - b, z - c);
        if !images.is_empty() {
            let [a, b, c] = self.offsets::<L>(&images[block]);
            (x, y, z) = (x + a, y + b, z + c);
        }
        let (square, touch) = (x * x + y * y + z * z, own + other);
        let reach = touch + L::splat(self.skin);
        [square.below(reach * reach).bits(), square.below(touch * touch).bits()]
    }

    #[inline(always)]
    fn offsets<L: Lanes>(&self, images: &[u32]) -> [L; 3] {
        let mut offsets = [[0.0; MOST_LANES]; 3];
        for (lane, &image) in images.iter().enumerate() {
            let offset = self.bodies.images.offset(image);
            (0..3).for_each(|axis| offsets[axis][lane] = offset[axis]);
        }
        offsets.each_ref().map(|list| L::from_slice(list))
    }

    /// Of which pairs both particles sleep, bit by bit.
    fn asleep(&self, block: Range<usize>) -> u16 {
        let sleeps = |index: u32| self.bodies.asleep.get(index as usize).copied().unwrap_or(false);
        let pairs = self.outer.owners[block.clone()].iter().zip(&self.outer.partners[block]);
        pairs.rev().fold(0, |bits, (&owner, &partner)| bits << 1 | u16::from(sleeps(owner) && sleeps(partner)))
    }
}

/// What is the same for a pair as long as a list lasts.
struct Constants<'a> {
    inner: &'a mut InnerList,
    bodies: Bodies<'a>,
}

impl LaneWork for Constants<'_> {
    type Output = ();

    #[inline(always)]
    fn run<L: Lanes>(self) {
        let InnerList { owners, partners, effective_radii, effective_masses, .. } = self.inner;
        let Bodies { spheres, velocities, .. } = self.bodies;
        for from in (0..owners.len()).step_by(L::COUNT) {
            let pairs = [&owners[from..from + L::COUNT], &partners[from..from + L::COUNT]];
            debug_assert!(pairs.iter().copied().flatten().all(|&index| (index as usize) < velocities.len()));
            // SAFETY: spheres are rows of four numbers, and lists name only particles that there are.
            let [own, other] = unsafe { pairs.map(|index| L::gather_four(spheres.as_ptr().cast(), index)[3]) };
            // SAFETY: velocities are rows of eight numbers, of as many particles.
            let inverse = unsafe { pairs.map(|index| L::gather_eight(velocities.as_ptr().cast(), index)[3]) };
            effective_radius(own, other).write_to(&mut effective_radii[from..]);
            effective_mass(inverse).write_to(&mut effective_masses[from..]);
        }
    }
}

#[cfg(test)]
mod tests;
