//! Pair lists of one chunk: candidates (outer) and the pruned list that the contact kernel walks (inner).

use crate::dem::particles::{Sphere, Velocity};
use crate::dem::pieces::add_up;
use crate::dem::resting::{RestingPairs, Run};
use crate::math::Vec3;
use crate::math::lanes::MOST_LANES;
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

/// Candidate pairs of a chunk.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct OuterList {
    /// The particle of each pair that the chunk owns.
    pub owners: Vec<u32>,
    /// The other one.
    pub candidates: Vec<Candidate>,
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
    /// How many of them are in each [`Section`], which stand one after the other.
    sections: [usize; Section::COUNT],
    /// The particle of each pair that the chunk owns; padded to whole blocks of lanes with the last one.
    pub owners: Vec<u32>,
    /// The other particle of each pair; padded likewise.
    pub partners: Vec<u32>,
    /// Which periodic image of it; empty where all are the particles themselves.
    images: Vec<u32>,
    /// Where each pair stands in the outer list.
    places: Vec<u32>,
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

    fn push(&mut self, remembered: Remembered, memory: &Memory) {
        if remembered.tangential {
            self.tangential.iter_mut().zip(memory.tangential.iter()).for_each(|(list, x)| list.push(*x));
        }
        if remembered.rolling {
            self.rolling.iter_mut().zip(memory.rolling.iter()).for_each(|(list, x)| list.push(*x));
        }
    }
}

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

impl Bodies<'_> {
    /// Whether both particles of a pair sleep.
    fn rest(&self, indices: [usize; 2]) -> bool {
        indices.into_iter().all(|index| self.asleep.get(index).copied().unwrap_or(false))
    }

    /// Where a pair belongs in an inner list; nowhere beyond `skin` [m].
    #[inline(always)]
    fn section(&self, owner: u32, candidate: Candidate, skin: f64) -> Option<Section> {
        let indices = [owner as usize, candidate.partner as usize];
        let [own, other] = indices.map(|index| &self.spheres[index]);
        let mut distance = other.position() - own.position();
        if candidate.image != NO_IMAGE {
            distance += self.images.offset(candidate.image);
        }
        let (square, touch) = (distance.norm_squared(), own.radius + other.radius);
        let reach = touch + skin;
        if square >= reach * reach {
            None
        } else if !self.asleep.is_empty() && self.rest(indices) {
            Some(Section::Asleep)
        } else if square < touch * touch {
            Some(Section::Touching)
        } else {
            Some(Section::Near)
        }
    }
}

/// Where a pair stands in an inner list. Pairs alike stand together, so that lanes which the laws need not compute fill whole blocks.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Section {
    /// In contact when the list was made.
    Touching = 0,
    /// Apart when the list was made.
    Near = 1,
    /// Both asleep when the list was made.
    Asleep = 2,
}

impl Section {
    const COUNT: usize = 3;
}

/// Particles whose pairs are mixed: enough for every lane of a block to belong to another one, few enough to stay in the nearest cache.
const MIXED: usize = 32;

impl OuterList {
    /// The pairs (owner, partner, image) of the particles in `range`, each particle's in the order given, mixed so that neighbours
    /// in the list belong to different particles: what is added to one of them need not wait for what was added just before.
    #[must_use]
    pub fn mixed(range: &Range<usize>, pairs: impl Iterator<Item = (u32, u32, u32)> + Clone) -> Self {
        let first = range.start as u32;
        let mut start = vec![0_u32; range.len() + 1];
        pairs.clone().for_each(|(owner, ..)| start[(owner - first) as usize + 1] += 1);
        add_up(&mut start);
        let mut next = start.clone();
        let blank = Candidate { partner: 0, image: NO_IMAGE };
        let mut rows = vec![blank; start[range.len()] as usize];
        for (owner, partner, image) in pairs {
            let slot = &mut next[(owner - first) as usize];
            rows[*slot as usize] = Candidate { partner, image };
            *slot += 1;
        }
        let mut list = Self { owners: Vec::with_capacity(rows.len()), candidates: Vec::with_capacity(rows.len()) };
        let mut open: Vec<usize> = Vec::with_capacity(MIXED);
        for group in (0..range.len()).step_by(MIXED) {
            open.clear();
            open.extend((group..range.len().min(group + MIXED)).filter(|&row| start[row] < start[row + 1]));
            for turn in 0.. {
                open.retain(|&row| {
                    list.owners.push(first + row as u32);
                    list.candidates.push(rows[(start[row] + turn) as usize]);
                    start[row] + turn + 1 < start[row + 1]
                });
                if open.is_empty() {
                    break;
                }
            }
        }
        list
    }

    /// The pairs within `skin` [m] of contact, section by section (touching, near, asleep), in each in the same order as here, each with the
    /// memory that `recall(place in this list, owner, candidate)` gives. `worn` lends its storage.
    #[must_use]
    pub fn pruned(
        &self,
        bodies: Bodies,
        skin: f64,
        remembered: Remembered,
        mut recall: impl FnMut(u32, u32, Candidate) -> Memory,
        worn: InnerList,
    ) -> InnerList {
        let Bodies { spheres, velocities, .. } = bodies;
        let mut inner = worn.emptied();
        let has_images = self.candidates.iter().any(|candidate| candidate.image != NO_IMAGE);
        let mut kept: [Vec<u32>; Section::COUNT] = Default::default();
        for ((place, &owner), &candidate) in (0_u32..).zip(&self.owners).zip(&self.candidates) {
            if let Some(section) = bodies.section(owner, candidate, skin) {
                kept[section as usize].push(place);
            }
        }
        for (section, places) in inner.sections.iter_mut().zip(&kept) {
            *section = places.len();
        }
        for place in kept.into_iter().flatten() {
            let (owner, candidate) = (self.owners[place as usize], self.candidates[place as usize]);
            let indices = [owner as usize, candidate.partner as usize];
            let [own, other] = indices.map(|index| spheres[index].radius);
            inner.places.push(place);
            inner.owners.push(owner);
            inner.partners.push(candidate.partner);
            if has_images {
                inner.images.push(candidate.image);
            }
            inner.effective_radii.push(effective_radius(own, other));
            inner.effective_masses.push(effective_mass(indices.map(|index| velocities[index].inverse_mass)));
            if remembered.tangential || remembered.rolling {
                inner.memory.push(remembered, &recall(place, owner, candidate));
            }
        }
        inner.pad(remembered);
        inner
    }
}

/// R* = r_i r_j / (r_i + r_j) [m] of two radii [m].
#[inline(always)]
#[must_use]
pub fn effective_radius(own: f64, other: f64) -> f64 {
    own * other / (own + other)
}

/// m* = 1 / (1/m_i + 1/m_j) [kg] of two inverse masses [1/kg].
#[inline(always)]
#[must_use]
pub fn effective_mass(inverse: [f64; 2]) -> f64 {
    1.0 / (inverse[0] + inverse[1])
}

impl InnerList {
    /// An empty list in the same storage.
    fn emptied(mut self) -> Self {
        self.owners.clear();
        self.partners.clear();
        self.places.clear();
        self.images.clear();
        self.sections = [0; Section::COUNT];
        self.resting.forget();
        self.components().for_each(Vec::clear);
        self
    }

    fn components(&mut self) -> impl Iterator<Item = &mut Vec<f64>> {
        let Self { effective_radii, effective_masses, memory, .. } = self;
        let PairMemory { tangential, rolling } = memory;
        [effective_radii, effective_masses].into_iter().chain(tangential).chain(rolling)
    }

    /// Fills what kernels read to whole blocks of lanes.
    fn pad(&mut self, remembered: Remembered) {
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
            if kept {
                lists.iter_mut().for_each(|list| list.resize(length, 0.0));
            }
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

    /// A reader that finds the memory of pairs of the same outer list, asked for in its order.
    pub fn recall_in_order(&self) -> impl FnMut(u32, u32, Candidate) -> Memory {
        // Each section stands in order, and so does what is asked for of each.
        let mut start = 0;
        let parts = self.sections.map(|count| {
            start += count;
            (start - count, &self.places[start - count..start])
        });
        let (mut next, mut last) = ([0; Section::COUNT], 0);
        move |place, _, _| {
            if place < last {
                next = [0; Section::COUNT];
            }
            last = place;
            for ((start, places), next) in parts.iter().zip(&mut next) {
                while places.get(*next).is_some_and(|held| *held < place) {
                    *next += 1;
                }
                if places.get(*next).is_some_and(|held| *held == place) {
                    return self.memory.get(start + *next).unwrap_or(Memory::NONE);
                }
            }
            Memory::NONE
        }
    }
}
