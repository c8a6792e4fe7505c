//! Who of a chunk is touched.
//!
//! In a thin stream nearly nobody is. Who touches nobody carries no load and is accelerated by gravity alone, so that the records of
//! both need not be read or written in every time step (`docs/decisions/free-falls.md`).

use super::energy::Tally;
use super::particles::Load;
use crate::math::Vec3;

/// Where what the contacts of a chunk do goes.
pub struct Effects<'a> {
    /// Loads of the chunk's particles.
    pub loads: &'a mut [Load],
    /// Forces of the normal springs on them [N]; empty where losses are not accounted for.
    pub springs: &'a mut [Vec3],
    /// Losses.
    pub tally: &'a mut Tally,
    /// Who is touched.
    pub touched: &'a mut Touched,
}

/// The particles of a chunk that are touched, while they are few. Places count from the chunk's first particle, and ascend.
#[derive(Debug, Default)]
pub struct Touched {
    /// Whether they are noted in this time step.
    are_noted: bool,
    /// Storage indices as contacts name them.
    named: Vec<u32>,
    /// Places of those who are touched now, and of those who were one time step before.
    places: [Vec<u32>; 2],
    /// Places of either.
    acted_upon: Vec<u32>,
    records: Records,
}

/// What is known of the records of particles that nobody touches.
#[derive(Debug, Default, Clone, Copy, PartialEq, Eq)]
enum Records {
    /// Nothing.
    #[default]
    Unknown,
    /// Loads are zero.
    Loads,
    /// Loads are zero; accelerations are gravity, but for those who were touched one time step before.
    All,
}

impl Touched {
    /// Takes the loads of the last time step from the chunk's particles. From now on it is noted who is touched: where there may be few
    /// `contacts`, and besides them and gravity `nothing_else` acts on the particles.
    pub(super) fn begin(&mut self, loads: &mut [Load], contacts: usize, nothing_else: bool) {
        match self.records {
            Records::Unknown => loads.fill(Load::ZERO),
            Records::Loads | Records::All => {
                self.places[0].iter().for_each(|&place| loads[place as usize] = Load::ZERO);
            }
        }
        self.named.clear();
        // With more of them, to note each costs about what it saves.
        self.are_noted = nothing_else && 2 * contacts < loads.len();
    }

    /// Notes the particles in the lanes that touch.
    #[inline(always)]
    pub(super) fn note(&mut self, particles: &[u32], touches: u16) {
        if self.are_noted {
            self.add(particles, touches);
        }
    }

    #[inline(never)]
    fn add(&mut self, particles: &[u32], touches: u16) {
        let touched = particles.iter().enumerate().filter(|(lane, _)| touches >> lane & 1 == 1);
        self.named.extend(touched.map(|(_, &particle)| particle));
    }

    /// Takes up what was noted since [`Touched::begin`]; `first` is the chunk's first particle.
    pub(super) fn end(&mut self, first: usize) {
        if !self.are_noted {
            self.records = Records::Unknown;
            return;
        }
        self.named.sort_unstable();
        self.named.dedup();
        self.places.swap(0, 1);
        let [now, before] = &mut self.places;
        now.clear();
        now.extend(self.named.iter().map(|&particle| particle - first as u32));
        merge(now, before, &mut self.acted_upon);
        if self.records == Records::Unknown {
            self.records = Records::Loads;
        }
    }

    /// Places of those who are touched now, where they are noted.
    pub(super) fn places(&self) -> Option<&[u32]> {
        self.are_noted.then_some(self.places[0].as_slice())
    }

    /// Says that the particles have been moved. Where that completed the time step before, accelerations have been written from loads.
    pub(super) const fn note_motion(&mut self, completed: bool) {
        self.records = match self.records {
            Records::Loads | Records::All if completed => Records::All,
            _ => Records::Unknown,
        };
    }

    /// Places of those whose records matter to who moves the particles next, where all others are known to have fallen freely since
    /// they were moved last.
    pub(super) fn among_falling(&self) -> Option<&[u32]> {
        (self.records == Records::All).then_some(self.acted_upon.as_slice())
    }
}

/// The numbers in either of two ascending lists, ascending.
fn merge(mut a: &[u32], mut b: &[u32], merged: &mut Vec<u32>) {
    merged.clear();
    while let (Some(first), Some(second)) = (a.first(), b.first()) {
        let least = *first.min(second);
        merged.push(least);
        a = &a[usize::from(*first == least)..];
        b = &b[usize::from(*second == least)..];
    }
    merged.extend_from_slice(a);
    merged.extend_from_slice(b);
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn merged_lists_name_each_number_once() {
        let mut merged = vec![7];
        for (a, b, both) in [
            (&[1, 4, 9][..], &[2, 4, 10, 11][..], &[1, 2, 4, 9, 10, 11][..]),
            (&[], &[3], &[3]),
            (&[3], &[], &[3]),
            (&[], &[], &[]),
        ] {
            merge(a, b, &mut merged);
            assert_eq!(merged, both);
        }
    }
}
