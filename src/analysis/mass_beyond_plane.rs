//! Mass beyond a plane, sampled while a run goes on: the series behind a mass flow rate.

use crate::math::Vec3;
use crate::particle::{Body, ParticleId, ParticleState};
use std::collections::HashMap;

/// Accumulates the mass beyond a plane, frame by frame.
///
/// Beyond means (x - p) . n >= 0 for the particle's centre x, with p a point of the plane and n its normal along the flow.
/// A particle that has left the domain beyond the plane stays counted, one that left before it never counts, and one that
/// comes back through the plane counts no longer. The plane has no border; particles fed in beyond it count as passed.
#[derive(Debug, Clone)]
pub struct MassBeyondPlane {
    point: Vec3,
    normal: Vec3,
    body: Body,
    last_time: f64,
    last_frame: HashMap<ParticleId, ParticleState>,
    departed: f64,
    inferred: f64,
    samples: Vec<(f64, f64)>,
}

impl MassBeyondPlane {
    /// A plane through `point` [m] with the unit `normal` [-] along the flow.
    #[must_use]
    pub fn new(point: Vec3, normal: Vec3, body: Body) -> Self {
        let (last_frame, samples) = (HashMap::new(), Vec::new());
        Self { point, normal, body, last_time: f64::NAN, last_frame, departed: 0.0, inferred: 0.0, samples }
    }

    /// Takes the frame at `time` [s]: all `particles` there are, and those `removed` since the sample before, each in its
    /// last state. A particle that is gone without being listed is taken where its last velocity would have carried it.
    pub fn sample(&mut self, time: f64, particles: &[ParticleState], removed: &[ParticleState]) {
        for particle in particles.iter().chain(removed) {
            self.last_frame.remove(&particle.id);
        }
        let elapsed = time - self.last_time;
        for gone in std::mem::take(&mut self.last_frame).into_values() {
            let mass = self.body.mass(gone.radius, gone.density);
            self.inferred += mass;
            self.departed += if self.is_beyond(&(gone.position + elapsed * gone.velocity)) { mass } else { 0.0 };
        }
        self.departed += self.mass_beyond(removed);
        self.samples.push((time, self.departed + self.mass_beyond(particles)));
        self.last_frame = particles.iter().map(|p| (p.id, *p)).collect();
        self.last_time = time;
    }

    /// The series so far: (time [s], mass beyond the plane [kg]).
    #[must_use]
    pub fn samples(&self) -> &[(f64, f64)] {
        &self.samples
    }

    /// Mass [kg] of the particles whose departure was inferred, not listed: how uncertain the series can be.
    #[must_use]
    pub fn inferred_mass(&self) -> f64 {
        self.inferred
    }

    fn is_beyond(&self, position: &Vec3) -> bool {
        (position - self.point).dot(&self.normal) >= 0.0
    }

    fn mass_beyond(&self, particles: &[ParticleState]) -> f64 {
        let beyond = particles.iter().filter(|p| self.is_beyond(&p.position));
        beyond.map(|p| self.body.mass(p.radius, p.density)).sum()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::analysis::measure::tests::particle;
    use crate::math::vec3;
    use approx::assert_relative_eq;

    const MASS: f64 = 4.0 / 3.0 * std::f64::consts::PI;

    fn downwards() -> MassBeyondPlane {
        MassBeyondPlane::new(vec3(0.0, 0.0, 0.0), vec3(0.0, 0.0, -1.0), Body::Sphere)
    }

    fn at(id: u64, z: f64) -> ParticleState {
        particle(id, [0.0, 0.0, z], 1.0)
    }

    fn masses(meter: &MassBeyondPlane) -> Vec<f64> {
        meter.samples().iter().map(|(_, m)| (m / MASS * 1e9).round() / 1e9).collect()
    }

    #[test]
    fn counts_passages_and_returns() {
        let mut meter = downwards();
        meter.sample(0.0, &[at(0, 1.0), at(1, 2.0)], &[]);
        meter.sample(1.0, &[at(0, -1.0), at(1, 1.0)], &[]);
        meter.sample(2.0, &[at(0, -2.0), at(1, 0.0)], &[]);
        meter.sample(3.0, &[at(0, -3.0), at(1, 0.5)], &[]);
        assert_eq!(masses(&meter), [0.0, 1.0, 2.0, 1.0]);
    }

    #[test]
    fn what_left_beyond_stays_counted_and_what_left_before_never_counts() {
        let mut meter = downwards();
        meter.sample(0.0, &[at(0, 1.0), at(1, 1.0), at(2, -1.0)], &[]);
        meter.sample(1.0, &[], &[at(0, -5.0), at(1, 5.0), at(2, -2.0), at(3, -1.0)]);
        meter.sample(2.0, &[], &[]);
        // Particle 3 was fed in and removed between two samples.
        assert_eq!(masses(&meter), [1.0, 3.0, 3.0]);
        assert_eq!(meter.inferred_mass(), 0.0);
    }

    #[test]
    fn unlisted_departures_follow_their_last_velocity_and_are_declared() {
        let mut meter = downwards();
        let falling = ParticleState { velocity: vec3(0.0, 0.0, -3.0), ..at(0, 1.0) };
        meter.sample(0.0, &[falling, at(1, 1.0)], &[]);
        meter.sample(0.5, &[], &[]);
        assert_eq!(masses(&meter), [0.0, 1.0]);
        assert_relative_eq!(meter.inferred_mass(), 2.0 * MASS, max_relative = 1e-12);
    }
}
