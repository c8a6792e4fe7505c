//! The particles of one feed in the order of their serial numbers: their sizes are known before their places, so an
//! amount fixes which particles come, whatever happens on the way.

use super::Amount;
use super::draw::FeedKey;
use super::fresh::FreshParticles;
use super::report::Tally;
use super::runner::Occupancy;
use super::size::SizeSampler;
use crate::math::Vec3;
use crate::particle::{Body, ParticleClass, ParticleId, ParticleState};
use serde::{Deserialize, Serialize};

/// Share of an amount by mass that counts as reached: more than the round-off of a sum of 10^6 masses, less than one.
const REACHED: f64 = 1.0 - 1e-9;

/// What makes the particles of one feed.
#[derive(Debug, Clone)]
pub(super) struct Queue {
    key: FeedKey,
    sampler: SizeSampler,
    body: Body,
    material: u16,
    density: f64,
    velocity: Vec3,
    limit: Option<Amount>,
    pub progress: QueueProgress,
}

/// How far a feed has come: all of it that a checkpoint must keep.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
pub(super) struct QueueProgress {
    /// Serial number of the next particle to be made.
    pub next_serial: u64,
    /// Mass of all particles made [kg], as bits.
    drawn_mass: Exact,
    /// Made, but without a place so far; ascending serial numbers.
    pub waiting: Vec<Candidate>,
    /// Made and given up, because they do not fit into the region or face at all.
    pub too_large: u64,
    /// What was inserted.
    pub tally: Tally,
}

/// A particle that looks for a place.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub(super) struct Candidate {
    /// Its serial number.
    pub serial: u64,
    /// Places tried so far.
    pub attempts: u64,
}

/// A number kept as its bits, so that a text format between checkpoint and restart cannot round it.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(super) struct Exact(pub f64);

impl Serialize for Exact {
    fn serialize<S: serde::Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.serialize_u64(self.0.to_bits())
    }
}

impl<'de> Deserialize<'de> for Exact {
    fn deserialize<D: serde::Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        u64::deserialize(deserializer).map(|bits| Self(f64::from_bits(bits)))
    }
}

/// How the search for a place ended.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Outcome {
    Placed,
    /// Every place inside was taken.
    NoRoom,
    /// No place tried lies inside at all: the particle is too large for the region or face.
    TooLarge,
}

/// What one insertion sees of the world: the solver's particles and walls, and the particles it has placed itself.
pub(super) struct Site<'a> {
    pub occupancy: &'a dyn Occupancy,
    pub fresh: FreshParticles,
    pub inserted: Vec<ParticleState>,
}

impl Queue {
    pub fn new(key: FeedKey, class: &ParticleClass, density: f64, body: Body, velocity: Vec3) -> Self {
        let sampler = SizeSampler::new(&class.diameter, body);
        let tally = Tally::new(&sampler);
        // a plane problem has no motion across its plane
        let velocity =
            if matches!(body, Body::Disc { .. }) { Vec3::new(velocity.x, 0.0, velocity.z) } else { velocity };
        Self {
            key,
            sampler,
            body,
            material: class.material,
            density,
            velocity,
            limit: None,
            progress: QueueProgress { tally, ..QueueProgress::default() },
        }
    }

    pub fn limited(mut self, limit: Option<Amount>) -> Self {
        self.limit = limit;
        self
    }

    pub const fn body(&self) -> Body {
        self.body
    }

    pub const fn sampler(&self) -> &SizeSampler {
        &self.sampler
    }

    pub fn radius(&self, serial: u64) -> f64 {
        0.5 * self.sampler.diameter(self.key.size(serial))
    }

    pub fn largest_radius(&self) -> f64 {
        0.5 * self.sampler.maximum()
    }

    pub fn mass(&self, radius: f64) -> f64 {
        self.body.mass(radius, self.density)
    }

    /// Mass of all particles made so far [kg].
    pub const fn drawn_mass(&self) -> f64 {
        self.progress.drawn_mass.0
    }

    /// True once the last particle of the amount has been made: by mass, the first one that reaches it.
    pub fn is_drawn(&self) -> bool {
        match self.limit {
            None => false,
            Some(Amount::Count(count)) => self.progress.next_serial >= count,
            Some(Amount::Mass(mass)) => self.drawn_mass() >= mass * REACHED,
        }
    }

    /// True once all of the amount has been inserted.
    pub fn is_complete(&self) -> bool {
        self.is_drawn() && self.progress.waiting.is_empty()
    }

    /// Makes the next particle, unless the amount is reached.
    pub fn draw(&mut self) -> Option<(Candidate, f64)> {
        if self.is_drawn() {
            return None;
        }
        let serial = self.progress.next_serial;
        let radius = self.radius(serial);
        self.progress.next_serial += 1;
        self.progress.drawn_mass.0 += self.mass(radius);
        Some((Candidate { serial, attempts: 0 }, radius))
    }

    /// Tries `attempts` places for a particle; `place` turns random numbers into a centre. The first free one is taken.
    pub fn try_places(
        &mut self,
        candidate: &mut Candidate,
        radius: f64,
        attempts: u64,
        place: impl Fn([f64; 3]) -> Option<Vec3>,
        site: &mut Site,
    ) -> Outcome {
        let mut draws = self.key.places(candidate.serial);
        let mut outcome = Outcome::TooLarge;
        for _ in 0..attempts {
            let numbers = draws.attempt(candidate.attempts);
            candidate.attempts += 1;
            let Some(centre) = place(numbers) else { continue };
            outcome = Outcome::NoRoom;
            if site.fresh.is_free(&centre, radius) && site.occupancy.is_free(&centre, radius) {
                self.insert(candidate.serial, radius, centre, site);
                return Outcome::Placed;
            }
        }
        if outcome == Outcome::TooLarge {
            self.progress.too_large += 1;
        }
        outcome
    }

    fn insert(&mut self, serial: u64, radius: f64, position: Vec3, site: &mut Site) {
        let mass = self.mass(radius);
        self.progress.tally.add(2.0 * radius, mass);
        site.fresh.add(position, radius);
        site.inserted.push(ParticleState {
            id: ParticleId::new(self.key.feed(), serial),
            material: self.material,
            radius,
            density: self.density,
            position,
            velocity: self.velocity,
            spin: Vec3::zeros(),
        });
    }
}
