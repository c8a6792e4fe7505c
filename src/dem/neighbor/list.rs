//! Pair lists of one chunk: candidates (outer) and the pruned list that the contact kernel walks (inner).

use crate::dem::particles::Sphere;
use crate::math::Vec3;
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

/// Candidates of the particles of a chunk, one row a particle.
#[derive(Debug, Clone, Default)]
pub struct OuterList {
    /// Start of each row; one more than there are particles.
    pub start: Vec<u32>,
    /// Candidates, row after row.
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

/// The pairs that the contact kernel walks, with their memory.
#[derive(Debug, Clone, Default)]
pub struct InnerList {
    /// Start of each row.
    pub start: Vec<u32>,
    /// Pairs, row after row.
    pub candidates: Vec<Candidate>,
    /// Memory of each pair; empty where the scene has no friction.
    pub memory: Vec<Memory>,
}

impl OuterList {
    /// The pairs within `skin` [m] of contact at `spheres`, in the same order, each with the memory that `recall(row, candidate)`
    /// gives; rows start at particle `first`.
    #[must_use]
    pub fn pruned(
        &self,
        spheres: &[Sphere],
        images: &Images,
        first: usize,
        skin: f64,
        mut recall: impl FnMut(usize, Candidate) -> Option<Memory>,
    ) -> InnerList {
        let mut inner = InnerList { start: Vec::with_capacity(self.start.len()), ..InnerList::default() };
        inner.start.push(0);
        for (row, range) in self.start.windows(2).enumerate() {
            let own = &spheres[first + row];
            for &candidate in &self.candidates[range[0] as usize..range[1] as usize] {
                let other = &spheres[candidate.partner as usize];
                let distance = other.position() - own.position() + images.offset(candidate.image);
                let reach = own.radius + other.radius + skin;
                if distance.norm_squared() < reach * reach {
                    inner.candidates.push(candidate);
                    inner.memory.extend(recall(row, candidate));
                }
            }
            inner.start.push(inner.candidates.len() as u32);
        }
        inner
    }
}

impl InnerList {
    /// Entries of a row.
    #[inline(always)]
    #[must_use]
    pub fn row(&self, row: usize) -> Range<usize> {
        self.start[row] as usize..self.start[row + 1] as usize
    }

    /// A reader that finds the memory of candidates asked for in the outer list's order.
    pub fn recall_in_order(&self, remembers: bool) -> impl FnMut(usize, Candidate) -> Option<Memory> {
        let mut row_seen = usize::MAX;
        let mut next = 0;
        move |row, candidate| {
            if !remembers {
                return None;
            }
            if row != row_seen {
                row_seen = row;
                next = self.start[row] as usize;
            }
            // Both lists are subsequences of the outer row: walk on until this candidate, or stay where it is not held.
            let end = self.start[row + 1] as usize;
            let found = self.candidates[next..end].iter().position(|held| *held == candidate);
            found.map_or(Some(Memory::NONE), |offset| {
                next += offset + 1;
                Some(self.memory[next - 1])
            })
        }
    }
}
