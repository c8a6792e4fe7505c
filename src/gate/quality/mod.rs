//! How good a place to cut it was: figures of the crossings and of the ghosts' contacts, and what they mean.

mod backing_up;
mod judgement;

pub use backing_up::{BackedUp, BackingUpState, BackingUpWatch, GateLook, GhostContact};
pub use judgement::{Grade, Quality, judge};

use super::crossing::Crossing;
use crate::math::Vec3;
use crate::particle::Body;
use serde::{Deserialize, Serialize};

/// A contact force above this share of the weight counts.
const CONTACT_FORCE: f64 = 1e-9;
/// An overlap above this share of the smaller radius is deep.
const DEEP_OVERLAP: f64 = 0.1;

/// Adds up crossings.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct CrossingStatistics {
    normal: Vec3,
    gravity: f64,
    body: Body,
    slow: f64,
    count: u64,
    in_contact: u64,
    below_slow: u64,
    normal_speed: f64,
    diameter: f64,
    largest_overlap_share: f64,
}

impl CrossingStatistics {
    /// For a plane with unit `normal` under gravity \[m/s2\] and a generation zone of `length` L2 \[m\]; slow is
    /// |v_n| < sqrt(2 g L2), the speed gained by falling through the zone.
    #[must_use]
    pub fn new(normal: Vec3, gravity: &Vec3, body: Body, length: f64) -> Self {
        let gravity = gravity.norm();
        Self {
            normal,
            gravity,
            body,
            slow: (2.0 * gravity * length).sqrt(),
            count: 0,
            in_contact: 0,
            below_slow: 0,
            normal_speed: 0.0,
            diameter: 0.0,
            largest_overlap_share: 0.0,
        }
    }

    /// Adds a crossing.
    pub fn add(&mut self, crossing: &Crossing) {
        let state = &crossing.state;
        let weight = self.body.mass(state.radius, state.density) * self.gravity;
        let speed = crossing.passage.velocity.dot(&self.normal);
        self.count += 1;
        self.in_contact += u64::from(crossing.force.norm() > CONTACT_FORCE * weight);
        self.below_slow += u64::from(speed.abs() < self.slow);
        self.normal_speed += speed;
        self.diameter += 2.0 * state.radius;
        let deepest = crossing.contacts.iter().map(|contact| contact.overlap).fold(0.0, f64::max);
        self.largest_overlap_share = self.largest_overlap_share.max(deepest / state.radius);
    }

    /// The figures; all 0 without a crossing.
    #[must_use]
    pub fn figures(&self) -> CrossingFigures {
        let count = self.count.max(1) as f64;
        let (speed, diameter) = (self.normal_speed / count, self.diameter / count);
        let scale = (self.gravity * diameter).sqrt();
        CrossingFigures {
            crossings: self.count,
            contact_share: self.in_contact as f64 / count,
            slow_share: self.below_slow as f64 / count,
            slow_speed_m_s: self.slow,
            mean_normal_speed_m_s: speed,
            speed_over_sqrt_gd: if scale > 0.0 { speed / scale } else { 0.0 },
            largest_overlap_share: self.largest_overlap_share,
        }
    }
}

/// Figures of the crossings of a stream.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize)]
pub struct CrossingFigures {
    /// Number of crossings.
    pub crossings: u64,
    /// Share with a contact force \[-\].
    pub contact_share: f64,
    /// Share slower than `slow_speed_m_s` along the normal \[-\].
    pub slow_share: f64,
    /// sqrt(2 g L2) \[m/s\].
    pub slow_speed_m_s: f64,
    /// Mean speed along the normal \[m/s\].
    pub mean_normal_speed_m_s: f64,
    /// It over sqrt(g d), d the mean diameter \[-\].
    pub speed_over_sqrt_gd: f64,
    /// Largest overlap of a contact at a crossing, over the radius of the particle that crosses \[-\].
    pub largest_overlap_share: f64,
}

/// Contacts between ghosts and residents, added up while a downstream runs; part of its checkpoint.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize)]
pub struct OverlapFigures {
    /// Looks at which a ghost touched a resident.
    pub looks: u64,
    /// Looks at which an overlap was more than 10 % of the smaller radius.
    pub deep_looks: u64,
    /// Largest overlap \[m\].
    pub largest_m: f64,
    /// It over the smaller radius \[-\].
    pub largest_share: f64,
    /// Where \[m\].
    pub place_m: [f64; 3],
    /// When, plant time \[s\].
    pub time_s: f64,
}

impl OverlapFigures {
    /// Adds the contacts of a look at `time` \[s\].
    pub fn add(&mut self, time: f64, contacts: &[GhostContact]) {
        let share = |contact: &GhostContact| contact.overlap / contact.smaller_radius;
        let Some(deepest) = contacts.iter().max_by(|a, b| share(a).total_cmp(&share(b))) else { return };
        self.looks += 1;
        self.deep_looks += u64::from(share(deepest) > DEEP_OVERLAP);
        if share(deepest) > self.largest_share {
            self.largest_share = share(deepest);
            (self.largest_m, self.time_s, self.place_m) = (deepest.overlap, time, deepest.place.into());
        }
    }

    /// Share of the looks with contacts at which one was deep \[-\].
    #[must_use]
    pub fn deep_share(&self) -> f64 {
        self.deep_looks as f64 / self.looks.max(1) as f64
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::gate::crossing::Passage;
    use crate::math::vec3;
    use crate::particle::{ParticleId, ParticleState};

    fn crossing(speed: f64, force: f64) -> Crossing {
        let (position, velocity, spin) = (Vec3::zeros(), vec3(0.3, 0.0, -speed), Vec3::zeros());
        let id = ParticleId::new(0, 0);
        Crossing {
            step: 1,
            state: ParticleState { id, material: 0, radius: 0.002, density: 2500.0, position, velocity, spin },
            force: vec3(0.0, 0.0, force),
            torque: Vec3::zeros(),
            passage: Passage { time: 0.0, position, velocity, spin },
            contacts: Vec::new(),
            path: Vec::new(),
            path_start: 0,
        }
    }

    #[test]
    fn crossings_are_told_slow_by_the_fall_through_the_zone() {
        let gravity = vec3(0.0, 0.0, -9.81);
        let mut statistics = CrossingStatistics::new(vec3(0.0, 0.0, -1.0), &gravity, Body::Sphere, 0.005);
        // sqrt(2 * 9.81 * 0.005) = 0.3132 m/s.
        for (speed, force) in [(0.31, 0.0), (0.32, 1e-3), (-0.2, 1e-20), (0.57, 0.0)] {
            statistics.add(&crossing(speed, force));
        }
        let figures = statistics.figures();
        assert_eq!((figures.crossings, figures.contact_share, figures.slow_share), (4, 0.25, 0.5));
        assert!((figures.mean_normal_speed_m_s - 0.25).abs() < 1e-15);
        assert!((figures.speed_over_sqrt_gd - 0.25 / (9.81_f64 * 0.004).sqrt()).abs() < 1e-14);
        let nothing = CrossingStatistics::new(vec3(0.0, 0.0, -1.0), &gravity, Body::Sphere, 0.005).figures();
        assert_eq!((nothing.contact_share, nothing.speed_over_sqrt_gd), (0.0, 0.0));
    }
}
