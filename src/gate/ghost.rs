//! Where a ghost is before its passage.
//!
//! A ghost is a particle on a prescribed path: it acts on others and is not acted upon. Its path ends in the passage, so it is
//! told backwards: `lead` is the time until then.

use super::crossing::{Crossing, Motion};
use crate::math::Vec3;
use crate::particle::Body;

/// Where a path ends: the state that a constant or a ballistic ghost heads for.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Anchor {
    /// Centre [m].
    pub position: Vec3,
    /// Velocity of the centre [m/s].
    pub velocity: Vec3,
    /// Own rotation [rad/s].
    pub spin: Vec3,
}

/// Motion at constant velocity and spin, `lead` [s] before the anchor: x = x_p - v tau.
///
/// Source: patent JP5440448B2. Valid where contacts and gravity change v by little within tau: the place is wrong by
/// a tau^2 / 2, a the true acceleration.
#[must_use]
pub fn constant(anchor: &Anchor, lead: f64) -> Motion {
    Motion {
        position: anchor.position - anchor.velocity * lead,
        velocity: anchor.velocity,
        spin: anchor.spin,
        acceleration: Vec3::zeros(),
        spin_acceleration: Vec3::zeros(),
    }
}

/// Motion in free fall, `lead` [s] before the anchor: x = x_p - v tau + g tau^2 / 2, v = v_p - g tau; the spin is kept.
///
/// g gravity [m/s2]. Valid where the particle touches nothing within tau.
#[must_use]
pub fn ballistic(anchor: &Anchor, lead: f64, gravity: &Vec3) -> Motion {
    Motion {
        position: anchor.position - anchor.velocity * lead + gravity * (0.5 * lead * lead),
        velocity: anchor.velocity - gravity * lead,
        spin: anchor.spin,
        acceleration: *gravity,
        spin_acceleration: Vec3::zeros(),
    }
}

/// How a ghost's path begins.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Entry {
    /// At the generation plane, so long before the anchor [s].
    Zone(f64),
    /// At its highest point, so long before the anchor [s]: further back it would have come from downstream.
    Apex(f64),
    /// Nowhere: told backwards, it does not go upstream.
    Nowhere,
}

/// Entry of a ghost of constant velocity: tau = l / v_n.
///
/// `way` l [m] from the generation plane to the anchor, v_n [m/s] the anchor's speed along the plane's normal.
#[must_use]
pub fn constant_entry(way: f64, normal_speed: f64) -> Entry {
    if normal_speed > 0.0 { Entry::Zone(way / normal_speed) } else { Entry::Nowhere }
}

/// Entry of a ghost in free fall: the smaller root of l = v_n tau - g_n tau^2 / 2, tau = 2 l / (v_n + sqrt(v_n^2 - 2 g_n l)).
///
/// `way` l [m], v_n [m/s] as for [`constant_entry`], g_n [m/s2] gravity along the normal. Where v_n^2 < 2 g_n l the path turns
/// at tau = v_n / g_n, before it reaches the generation plane.
#[must_use]
pub fn ballistic_entry(way: f64, normal_speed: f64, normal_gravity: f64) -> Entry {
    let square = normal_speed * normal_speed - 2.0 * normal_gravity * way;
    if normal_speed <= 0.0 && normal_gravity >= 0.0 {
        Entry::Nowhere
    } else if square < 0.0 {
        Entry::Apex(normal_speed / normal_gravity)
    } else {
        Entry::Zone(2.0 * way / (normal_speed + square.sqrt()))
    }
}

/// A time of the stream, in its time steps.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct StreamTime {
    /// Whole time steps.
    pub step: i64,
    /// Part of a time step beyond it, in [0, 1).
    pub fraction: f64,
}

/// A recorded path, read between its stored motions.
///
/// Between two of them, h [s] apart, the centre is the quintic polynomial that has place, velocity and acceleration of both
/// ends; its error is at most h^6 / 46080 times the largest sixth derivative. The spin is the cubic with spin and its
/// acceleration at both ends; h^4 / 384 times the largest fourth derivative. (Both: Hermite's remainder.) A contact that begins
/// or ends in between is no smooth path: there the error is that of the force's kink. At stored steps it is the stored bits.
#[derive(Debug, Clone, Copy)]
pub struct RecordedPath<'a> {
    /// The crossing that ends the path.
    pub crossing: &'a Crossing,
    /// Time steps between two stored motions.
    pub every: u64,
    /// Time step of the stream [s].
    pub timestep: f64,
    /// Gravity [m/s2].
    pub gravity: Vec3,
    /// Body of the particles.
    pub body: Body,
}

impl RecordedPath<'_> {
    /// The crossing's grid state as the end of the path, with the acceleration its stored force gives: a = F/m + g, M/I.
    #[must_use]
    pub fn end(&self) -> Motion {
        let state = &self.crossing.state;
        let mass = self.body.mass(state.radius, state.density);
        let inertia = mass * self.body.inertia_factor() * state.radius * state.radius;
        Motion {
            position: state.position,
            velocity: state.velocity,
            spin: state.spin,
            acceleration: self.body.in_plane(&(self.crossing.force / mass + self.gravity)),
            spin_acceleration: self.body.about_plane(&(self.crossing.torque / inertia)),
        }
    }

    /// Time step of the stored motion `index`; that of the grid state beyond the last.
    #[must_use]
    pub fn step_of(&self, index: usize) -> u64 {
        if index < self.crossing.path.len() {
            self.crossing.path_start + index as u64 * self.every
        } else {
            self.crossing.step
        }
    }

    /// The motion at `time`; before the path's start on its straight extension, after its end in free fall.
    #[must_use]
    pub fn motion(&self, time: StreamTime) -> Motion {
        let path = &self.crossing.path;
        let end_step = self.crossing.step as i64;
        if time.step >= end_step {
            let late = ((time.step - end_step) as f64 + time.fraction) * self.timestep;
            return if late > 0.0 { advanced(&self.end(), late) } else { self.end() };
        }
        let start_step = self.step_of(0) as i64;
        if time.step < start_step {
            let first = path.first().copied().unwrap_or_else(|| self.end());
            let lead = ((start_step - time.step) as f64 - time.fraction) * self.timestep;
            let anchor = Anchor { position: first.position, velocity: first.velocity, spin: first.spin };
            return constant(&anchor, lead);
        }
        let index = (((time.step - start_step) as u64 / self.every) as usize).min(path.len() - 1);
        let (left_step, right_step) = (self.step_of(index), self.step_of(index + 1));
        let offset = (time.step - left_step as i64) as f64 + time.fraction;
        if offset == 0.0 {
            return path[index];
        }
        let right = path.get(index + 1).copied().unwrap_or_else(|| self.end());
        let span = (right_step - left_step) as f64;
        between(&path[index], &right, offset / span, span * self.timestep)
    }
}

/// A motion `later` [s] under its own acceleration: x + v t + a t^2 / 2, v + a t, spin likewise.
#[must_use]
pub fn advanced(motion: &Motion, later: f64) -> Motion {
    Motion {
        position: motion.position + motion.velocity * later + motion.acceleration * (0.5 * later * later),
        velocity: motion.velocity + motion.acceleration * later,
        spin: motion.spin + motion.spin_acceleration * later,
        ..*motion
    }
}

/// The motion at the share u in (0, 1) of the time `span` h [s] from `left` to `right`.
///
/// Hermite polynomials of u, q = 1 - u: place x_0 + v_0 u h + a_0 (u h)^2 / 2 + c_3 u^3 + c_4 u^4 + c_5 u^5, where the residuals
/// at u = 1 of place X, velocity V and acceleration A (times 1, h, h^2) give c_3 = 10 X - 4 V + A / 2, c_4 = -15 X + 7 V - A,
/// c_5 = 6 X - 3 V + A / 2; spin likewise by the cubic, c_2 = 3 W - B, c_3 = -2 W + B.
fn between(left: &Motion, right: &Motion, u: f64, span: f64) -> Motion {
    let (v0, a0) = (left.velocity * span, left.acceleration * (span * span));
    let place = right.position - left.position - v0 - a0 * 0.5;
    let velocity = right.velocity * span - v0 - a0;
    let acceleration = right.acceleration * (span * span) - a0;
    let c3 = place * 10.0 - velocity * 4.0 + acceleration * 0.5;
    let c4 = place * -15.0 + velocity * 7.0 - acceleration;
    let c5 = place * 6.0 - velocity * 3.0 + acceleration * 0.5;
    let b0 = left.spin_acceleration * span;
    let spin = right.spin - left.spin - b0;
    let spin_change = right.spin_acceleration * span - b0;
    let (d2, d3) = (spin * 3.0 - spin_change, spin * -2.0 + spin_change);
    Motion {
        position: left.position + (v0 + (a0 * 0.5 + (c3 + (c4 + c5 * u) * u) * u) * u) * u,
        velocity: (v0 + (a0 + (c3 * 3.0 + (c4 * 4.0 + c5 * (5.0 * u)) * u) * u) * u) / span,
        acceleration: (a0 + (c3 * 6.0 + (c4 * 12.0 + c5 * (20.0 * u)) * u) * u) / (span * span),
        spin: left.spin + (b0 + (d2 + d3 * u) * u) * u,
        spin_acceleration: (b0 + (d2 * 2.0 + d3 * (3.0 * u)) * u) / span,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::vec3;
    use crate::particle::{ParticleId, ParticleState};
    use approx::assert_relative_eq;

    const GRAVITY: Vec3 = vec3(0.0, 0.0, -9.81);

    fn anchor() -> Anchor {
        Anchor { position: vec3(0.01, 0.02, 0.2), velocity: vec3(0.1, 0.0, -0.5), spin: vec3(3.0, 2.0, 1.0) }
    }

    #[test]
    fn a_constant_and_a_ballistic_ghost_arrive_at_their_anchor() {
        let anchor = anchor();
        assert_eq!(constant(&anchor, 0.0).position, anchor.position);
        let before = ballistic(&anchor, 0.02, &GRAVITY);
        let again = advanced(&before, 0.02);
        assert_relative_eq!(again.position, anchor.position, epsilon = 1e-15);
        assert_relative_eq!(again.velocity, anchor.velocity, epsilon = 1e-15);
        let straight = advanced(&constant(&anchor, 0.02), 0.02);
        assert_relative_eq!(straight.position, anchor.position, epsilon = 1e-15);
    }

    #[test]
    fn entries_lie_on_the_generation_plane_or_at_the_apex() {
        let way = 0.006;
        // (speed along the normal, gravity along the normal), down, across and up.
        for (speed, gravity) in [(0.5, 9.81), (0.5, 0.0), (0.5, -9.81), (-0.1, -9.81)] {
            let Entry::Zone(lead) = ballistic_entry(way, speed, gravity) else { panic!("{speed} {gravity}") };
            assert!(lead > 0.0);
            assert_relative_eq!(speed * lead - 0.5 * gravity * lead * lead, way, max_relative = 1e-14);
        }
        // 0.3 m/s is less than sqrt(2 g 6 mm) = 0.343 m/s.
        assert_eq!(ballistic_entry(way, 0.3, 9.81), Entry::Apex(0.3 / 9.81));
        assert_eq!(ballistic_entry(way, 0.0, 9.81), Entry::Nowhere);
        assert_eq!(constant_entry(way, 0.5), Entry::Zone(0.012));
        assert_eq!(constant_entry(way, -0.5), Entry::Nowhere);
        assert_eq!(constant_entry(way, 0.0), Entry::Nowhere);
    }

    /// A smooth path with all derivatives: x = sin(w t) (1, 2, -3) + v t, spin = cos(w t) (1, 0, 2).
    fn smooth(time: f64) -> Motion {
        let rate = 40.0;
        let (sine, cosine) = (rate * time).sin_cos();
        let (way, spin) = (vec3(1.0, 2.0, -3.0) * 0.01, vec3(1.0, 0.0, 2.0));
        Motion {
            position: way * sine + vec3(0.0, 0.0, -0.4) * time,
            velocity: way * (rate * cosine) + vec3(0.0, 0.0, -0.4),
            spin: spin * cosine,
            acceleration: way * (-rate * rate * sine),
            spin_acceleration: spin * (-rate * sine),
        }
    }

    /// The smooth path stored every `every` of `step` steps, the first at step 100.
    fn stored(every: u64, step: u64, timestep: f64) -> Crossing {
        let state = |motion: Motion| ParticleState {
            id: ParticleId::new(0, 1),
            material: 0,
            radius: 0.002,
            density: 2500.0,
            position: motion.position,
            velocity: motion.velocity,
            spin: motion.spin,
        };
        let end = smooth(step as f64 * timestep);
        let end_state = state(end);
        let mass = Body::Sphere.mass(end_state.radius, end_state.density);
        Crossing {
            step,
            state: end_state,
            force: (end.acceleration - GRAVITY) * mass,
            torque: end.spin_acceleration * (mass * 0.4 * end_state.radius * end_state.radius),
            passage: super::super::crossing::Passage {
                time: step as f64 * timestep,
                position: end.position,
                velocity: end.velocity,
                spin: end.spin,
            },
            contacts: Vec::new(),
            path: (100..step).step_by(every as usize).map(|at| smooth(at as f64 * timestep)).collect(),
            path_start: 100,
        }
    }

    fn recorded(crossing: &Crossing, every: u64, timestep: f64) -> RecordedPath<'_> {
        RecordedPath { crossing, every, timestep, gravity: GRAVITY, body: Body::Sphere }
    }

    /// Largest errors of place and spin over the whole path, and of the velocity.
    fn errors(every: u64) -> [f64; 3] {
        let (step, timestep) = (100 + 480, 1e-4);
        let crossing = stored(every, step, timestep);
        let path = recorded(&crossing, every, timestep);
        let mut largest = [0.0_f64; 3];
        for quarter in 400..4 * step as i64 {
            let time = StreamTime { step: quarter / 4, fraction: (quarter % 4) as f64 / 4.0 };
            let (found, true_one) = (path.motion(time), smooth(quarter as f64 / 4.0 * timestep));
            largest[0] = largest[0].max((found.position - true_one.position).norm());
            largest[1] = largest[1].max((found.spin - true_one.spin).norm());
            largest[2] = largest[2].max((found.velocity - true_one.velocity).norm());
        }
        largest
    }

    #[test]
    fn the_interpolation_is_of_sixth_and_fourth_order_and_within_its_bound() {
        let (coarse, fine) = (errors(80), errors(40));
        let order = |index: usize| (coarse[index] / fine[index]).log2();
        // Halving h: 2^6, 2^4, and 2^5 for the derivative of the quintic; 0.3 for the terms above the leading one (w h = 0.32).
        assert!((order(0) - 6.0).abs() < 0.3, "{}", order(0));
        assert!((order(1) - 4.0).abs() < 0.3, "{}", order(1));
        assert!((order(2) - 5.0).abs() < 0.3, "{}", order(2));
        let (rate, span) = (40.0_f64, 80.0e-4);
        assert!(coarse[0] <= (rate * span).powi(6) / 46080.0 * vec3(1.0, 2.0, -3.0).norm() * 0.01);
        assert!(coarse[1] <= (rate * span).powi(4) / 384.0 * vec3(1.0, 0.0, 2.0).norm());
    }

    #[test]
    fn stored_motions_come_back_bit_for_bit_and_the_last_interval_ends_at_the_grid_state() {
        let timestep = 1e-4;
        let crossing = stored(40, 100 + 95, timestep);
        let path = recorded(&crossing, 40, timestep);
        assert_eq!(crossing.path.len(), 3);
        for (index, motion) in crossing.path.iter().enumerate() {
            assert_eq!(path.motion(StreamTime { step: 100 + 40 * index as i64, fraction: 0.0 }), *motion);
        }
        let end = path.motion(StreamTime { step: 195, fraction: 0.0 });
        assert_eq!((end.position, end.velocity), (crossing.state.position, crossing.state.velocity));
        assert_relative_eq!(end.acceleration, smooth(195.0 * timestep).acceleration, max_relative = 1e-12);
        assert_relative_eq!(end.spin_acceleration, smooth(195.0 * timestep).spin_acceleration, max_relative = 1e-12);
        // The last interval is 15 steps long, w h = 0.06.
        let bound = (40.0 * 15.0 * timestep).powi(6) / 46080.0 * 0.03;
        let inside = path.motion(StreamTime { step: 187, fraction: 0.5 });
        assert_relative_eq!(inside.position, smooth(187.5 * timestep).position, epsilon = bound);
    }

    #[test]
    fn before_its_start_a_path_is_straight_and_a_missing_one_is_the_end_s() {
        let timestep = 1e-4;
        let mut crossing = stored(40, 195, timestep);
        let early = recorded(&crossing, 40, timestep).motion(StreamTime { step: 90, fraction: 0.0 });
        let first = crossing.path[0];
        assert_relative_eq!(early.position, first.position - first.velocity * (10.0 * timestep), epsilon = 1e-16);
        crossing.path.clear();
        let early = recorded(&crossing, 40, timestep).motion(StreamTime { step: 190, fraction: 0.5 });
        let straight = crossing.state.position - crossing.state.velocity * (4.5 * timestep);
        assert_relative_eq!(early.position, straight, epsilon = 1e-16);
    }
}
