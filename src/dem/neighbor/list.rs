//! The pruned pair list of one chunk that the contact kernel walks, with its memory.

use super::prune::PruningScratch;
use crate::dem::particles::Velocity;
use crate::dem::resting::{RestingPairs, Run};
use crate::math::Vec3;
use crate::math::lanes::{Lanes, MOST_LANES};
use std::ops::Range;

/// A candidate partner of a particle.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Candidate {
    /// Storage index of the partner.
    pub partner: u32,
    /// Which periodic image of it, an index into [`Images`].
    pub image: u32,
}

/// Offsets of the periodic images [m]; index 13 is the particle itself.
#[derive(Debug, Clone)]
pub struct Images {
    offsets: [Vec3; 27],
}

/// Index of the image with no offset.
pub const NO_IMAGE: u32 = 13;

impl Images {
    /// The images of a domain with edges `size` [m].
    #[must_use]
    pub fn new(size: &Vec3) -> Self {
        let offset = |index: usize| {
            // An axis that is not periodic may be infinite: no shift along it must stay exactly zero.
            let part = |k: usize, length: f64| [-length, 0.0, length][k % 3];
            Vec3::new(part(index, size.x), part(index / 3, size.y), part(index / 9, size.z))
        };
        Self { offsets: std::array::from_fn(offset) }
    }

    /// Index of the image shifted by so many domain lengths per axis.
    #[must_use]
    pub fn index(shift: [i8; 3]) -> u32 {
        (i32::from(shift[0]) + 1 + 3 * (i32::from(shift[1]) + 1) + 9 * (i32::from(shift[2]) + 1)) as u32
    }

    /// Index of the same pair's image seen from the other particle.
    #[must_use]
    pub const fn opposite(image: u32) -> u32 {
        26 - image
    }

    /// Offset of an image [m].
    #[inline(always)]
    #[must_use]
    pub fn offset(&self, image: u32) -> &Vec3 {
        &self.offsets[image as usize]
    }
}

/// Memory of a contact.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Memory {
    /// Tangential spring, see [`crate::dem::law::tangential`].
    pub tangential: Vec3,
    /// Rolling spring [N m].
    pub rolling: Vec3,
}

impl Memory {
    /// No memory: not in contact.
    pub const NONE: Self = Self { tangential: Vec3::new(0.0, 0.0, 0.0), rolling: Vec3::new(0.0, 0.0, 0.0) };

    /// The same contact seen from the other particle.
    #[must_use]
    pub fn mirrored(&self) -> Self {
        Self { tangential: -self.tangential, rolling: -self.rolling }
    }
}

/// The memories of an inner list's pairs, component by component, as vector registers take them. Components are as long as whole
/// blocks of lanes; what lies beyond the pairs is nobody's.
#[derive(Debug, Clone, Default)]
pub struct PairMemory {
    /// Tangential springs; empty where the scene has no friction.
    pub tangential: [Vec<f64>; 3],
    /// Rolling springs; empty where nothing resists rolling.
    pub rolling: [Vec<f64>; 3],
}

/// The pairs that the contact kernel walks, with their memory.
#[derive(Debug, Clone, Default)]
pub struct InnerList {
    /// How many pairs.
    count: usize,
    /// How many of them were apart when the list was made, those of sleepers left out.
    pub(in crate::dem) apart: usize,
    /// The particle of each pair that the chunk owns; padded to whole blocks of lanes with the last one.
    pub owners: Vec<u32>,
    /// The other particle of each pair; padded likewise.
    pub partners: Vec<u32>,
    /// Which periodic image of it; empty where all are the particles themselves.
    pub(super) images: Vec<u32>,
    /// Where each pair stands in the outer list.
    pub(super) places: Vec<u32>,
    /// R* of each pair [m]; padded to whole blocks of lanes.
    pub effective_radii: Vec<f64>,
    /// m* of each pair [kg]; padded to whole blocks of lanes.
    pub effective_masses: Vec<f64>,
    /// Memory of each pair.
    pub memory: PairMemory,
    /// Forces of the pairs that rest, for this list alone.
    pub resting: RestingPairs,
}

/// What an inner list keeps in mind of its contacts.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Remembered {
    /// Tangential springs.
    pub tangential: bool,
    /// Rolling springs.
    pub rolling: bool,
}

impl PairMemory {
    /// Memory of a pair; none where the scene has no friction, or no such pair.
    #[must_use]
    pub fn get(&self, entry: usize) -> Option<Memory> {
        let vector = |lists: &[Vec<f64>; 3]| Some(Vec3::new(*lists[0].get(entry)?, lists[1][entry], lists[2][entry]));
        let tangential = vector(&self.tangential)?;
        Some(Memory { tangential, rolling: vector(&self.rolling).unwrap_or_default() })
    }

    /// Sets the memory of a pair, where the scene has friction.
    pub fn set(&mut self, entry: usize, memory: &Memory) {
        for (lists, vector) in [(&mut self.tangential, &memory.tangential), (&mut self.rolling, &memory.rolling)] {
            for (list, component) in lists.iter_mut().zip(vector.iter()) {
                if let Some(slot) = list.get_mut(entry) {
                    *slot = *component;
                }
            }
        }
    }

    /// The memories of a run of pairs.
    #[must_use]
    pub fn part(&self, pairs: Range<usize>) -> Self {
        let part = |lists: &[Vec<f64>; 3]| {
            lists.each_ref().map(|list| list.get(pairs.clone()).map(<[f64]>::to_vec).unwrap_or_default())
        };
        Self { tangential: part(&self.tangential), rolling: part(&self.rolling) }
    }

    /// Puts the memories of a run of pairs back, as [`PairMemory::part`] took them from `from` on.
    pub fn put_back(&mut self, from: usize, part: &Self) {
        for (lists, parts) in [(&mut self.tangential, &part.tangential), (&mut self.rolling, &part.rolling)] {
            for (list, part) in lists.iter_mut().zip(parts) {
                if let Some(place) = list.get_mut(from..from + part.len()) {
                    place.copy_from_slice(part);
                }
            }
        }
    }
}

/// R* = r_i r_j / (r_i + r_j) [m] of two radii [m].
#[inline(always)]
#[must_use]
pub fn effective_radius<L: Lanes>(own: L, other: L) -> L {
    own * other / (own + other)
}

/// m* = 1 / (1/m_i + 1/m_j) [kg] of two inverse masses [1/kg].
#[inline(always)]
#[must_use]
pub fn effective_mass<L: Lanes>(inverse: [L; 2]) -> L {
    L::splat(1.0) / (inverse[0] + inverse[1])
}

impl InnerList {
    /// An empty list in the same storage.
    pub(super) fn emptied(mut self) -> Self {
        self.owners.clear();
        self.partners.clear();
        self.places.clear();
        self.images.clear();
        self.resting.forget();
        self
    }

    /// Makes what kernels read as long as whole blocks of lanes. Of constants and memories only the length is set.
    pub(super) fn pad(&mut self, remembered: Remembered) {
        self.count = self.partners.len();
        let length = self.count.next_multiple_of(MOST_LANES);
        for list in [&mut self.owners, &mut self.partners, &mut self.images] {
            if let Some(&last) = list.last() {
                list.resize(length, last);
            }
        }
        for list in [&mut self.effective_radii, &mut self.effective_masses] {
            list.resize(length, 1.0);
        }
        let PairMemory { tangential, rolling } = &mut self.memory;
        for (kept, lists) in [(remembered.tangential, tangential), (remembered.rolling, rolling)] {
            lists.iter_mut().for_each(|list| list.resize(if kept { length } else { 0 }, 0.0));
        }
    }

    /// The list cut into runs of blocks of which all particles sleep, or not all.
    pub fn runs_by_rest(&mut self, velocities: &[Velocity]) -> Vec<Run> {
        let length = self.count.next_multiple_of(MOST_LANES);
        self.resting.runs([&self.owners[..length], &self.partners[..length]], self.count, velocities)
    }

    /// Number of pairs.
    #[inline(always)]
    #[must_use]
    pub const fn len(&self) -> usize {
        self.count
    }

    /// True where there is no pair.
    #[must_use]
    pub const fn is_empty(&self) -> bool {
        self.count == 0
    }

    /// True where some partner is a periodic image.
    #[inline(always)]
    #[must_use]
    pub fn has_images(&self) -> bool {
        !self.images.is_empty()
    }

    /// The partner of a pair.
    #[inline(always)]
    #[must_use]
    pub fn candidate(&self, entry: usize) -> Candidate {
        Candidate { partner: self.partners[entry], image: self.images.get(entry).copied().unwrap_or(NO_IMAGE) }
    }

    /// The pairs: which entry, owner, and partner.
    pub fn pairs(&self) -> impl Iterator<Item = (usize, u32, Candidate)> {
        (0..self.count).map(|entry| (entry, self.owners[entry], self.candidate(entry)))
    }

    /// Sets all memories: those that `recall(owner, partner)` does not know are blank.
    pub fn recall_each(&mut self, recall: impl Fn(u32, u32) -> Option<Memory>) {
        if self.memory.tangential[0].is_empty() {
            return;
        }
        for entry in 0..self.count {
            let known = recall(self.owners[entry], self.partners[entry]);
            self.memory.set(entry, &known.unwrap_or(Memory::NONE));
        }
    }

    /// Sets all memories to those of a list pruned from the same outer one, which has `places` pairs; who was not in it has a blank one.
    pub fn take_over(&mut self, held: &Self, places: usize, scratch: &mut PruningScratch) {
        if self.memory.tangential[0].is_empty() {
            return;
        }
        let PruningScratch { entry_at, entries, .. } = scratch;
        entry_at.clear();
        entry_at.resize(places, u32::MAX);
        (0..).zip(&held.places).for_each(|(entry, &place)| entry_at[place as usize] = entry);
        entries.clear();
        entries.extend(self.places.iter().map(|&place| entry_at[place as usize]));
        let PairMemory { tangential, rolling } = &held.memory;
        let components = self.memory.tangential.iter_mut().chain(&mut self.memory.rolling);
        for (component, held) in components.zip(tangential.iter().chain(rolling)) {
            for (slot, &entry) in component.iter_mut().zip(entries.iter()) {
                *slot = held.get(entry as usize).copied().unwrap_or(0.0);
            }
        }
    }
}
