//! Motion of a part as a closed function of plant time: never accumulated, so that any time can be asked for directly.

use crate::math::{Bounds, Rotation, Vec3};
use serde::Serialize;
use std::f64::consts::TAU;

/// Motions of one part, applied in order: the first acts on the part as placed, the next on its result.
#[derive(Debug, Clone, PartialEq, Default, Serialize)]
pub struct Motion {
    /// The motions; empty for a part at rest.
    pub terms: Vec<MotionTerm>,
}

/// One motion within a time window.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct MotionTerm {
    /// The kind of motion.
    pub kind: MotionKind,
    /// Plant time at which it starts [s].
    pub from: f64,
    /// Plant time at which it stops [s]; infinite for ever. The part stays where it is then.
    pub until: f64,
}

/// Kinds of motion.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub enum MotionKind {
    /// Rotation about an axis.
    Rotate {
        /// A point of the axis [m].
        origin: Vec3,
        /// Unit direction of the axis [-]; right-handed.
        axis: Vec3,
        /// Rate [rad/s].
        rate: f64,
    },
    /// Straight motion.
    Translate {
        /// Velocity [m/s].
        velocity: Vec3,
    },
    /// x = a sin(2 pi f (t - from) + phase) - a sin(phase): starts without a jump in place.
    Oscillate {
        /// Amplitude a [m].
        amplitude: Vec3,
        /// Frequency f [1/s].
        frequency: f64,
        /// Phase [rad].
        phase: f64,
    },
    /// The surface moves in itself, the part stays: a conveyor belt.
    Conveyor {
        /// Belt velocity [m/s]; its component normal to the surface is ignored where a particle touches.
        velocity: Vec3,
    },
}

/// Where a part is: x = rotation * x0 + translation.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Pose {
    /// Rotation about the origin.
    pub rotation: Rotation,
    /// Translation [m].
    pub translation: Vec3,
}

/// How a part moves as a rigid body: v(x) = velocity + spin x x, with x in plant coordinates.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Twist {
    /// Velocity of the body point at the plant's origin [m/s].
    pub velocity: Vec3,
    /// Angular velocity [rad/s].
    pub spin: Vec3,
    /// Conveyor velocity of the surface in itself [m/s].
    pub belt: Vec3,
}

impl Pose {
    /// Where the part was placed.
    pub const IDENTITY: Self = Self {
        rotation: Rotation::new_unchecked(nalgebra::Quaternion::new(1.0, 0.0, 0.0, 0.0)),
        translation: Vec3::new(0.0, 0.0, 0.0),
    };

    /// The plant's point of a body point [m].
    #[must_use]
    pub fn apply(&self, point: &Vec3) -> Vec3 {
        self.rotation * point + self.translation
    }

    /// The body's point of a plant point [m].
    #[must_use]
    pub fn inverse_apply(&self, point: &Vec3) -> Vec3 {
        self.rotation.inverse_transform_vector(&(point - self.translation))
    }

    /// The plant's direction of a body direction.
    #[must_use]
    pub fn apply_direction(&self, direction: &Vec3) -> Vec3 {
        self.rotation * direction
    }

    /// This pose, then `next` on its result: x = R2 (R1 x0 + t1) + t2.
    #[must_use]
    fn then(&self, next: &Self) -> Self {
        Self { rotation: next.rotation * self.rotation, translation: next.apply(&self.translation) }
    }
}

impl Twist {
    /// At rest.
    pub const REST: Self =
        Self { velocity: Vec3::new(0.0, 0.0, 0.0), spin: Vec3::new(0.0, 0.0, 0.0), belt: Vec3::new(0.0, 0.0, 0.0) };

    /// Velocity of the body point that is at `point` [m] of the plant, without the belt [m/s].
    #[must_use]
    pub fn at(&self, point: &Vec3) -> Vec3 {
        self.velocity + self.spin.cross(point)
    }
}

impl Motion {
    /// Where the part is at a plant time [s].
    #[must_use]
    pub fn pose(&self, time: f64) -> Pose {
        self.terms.iter().fold(Pose::IDENTITY, |pose, term| pose.then(&term.pose(time)))
    }

    /// How the part moves at a plant time [s].
    ///
    /// With x = R y + t the last term's map and (v, w) its own velocities, and (V, W) those of the terms before it,
    /// dx/dt = R dy/dt + v + w x x, dy/dt = V + W x y and y = R^T (x - t). So x moves with the spin W' = R W + w and
    /// with V' = R V - (R W) x t + v at the origin. A belt moves within the surface and is turned with it; a term acts
    /// from its start (included) to its end (excluded).
    #[must_use]
    pub fn twist(&self, time: f64) -> Twist {
        self.terms.iter().fold(Twist::REST, |before, term| {
            let (own, pose) = (term.twist(time), term.pose(time));
            let spin = pose.apply_direction(&before.spin);
            Twist {
                velocity: pose.apply_direction(&before.velocity) - spin.cross(&pose.translation) + own.velocity,
                spin: spin + own.spin,
                belt: pose.apply_direction(&before.belt) + own.belt,
            }
        })
    }

    /// True where the part never leaves its place. A conveyor belt may run in it.
    #[must_use]
    pub fn is_static(&self) -> bool {
        self.terms.iter().all(MotionTerm::is_static)
    }

    /// Upper bound of the speed of any point of a part within `bounds` [m], as placed, over all time [m/s].
    ///
    /// Rigid maps keep lengths, so the speed of a point is at most the sum of what each term running at that time adds:
    /// |v| of a translation, 2 pi f |a| of an oscillation, |rate| times the distance from the axis of a rotation. That
    /// distance is bounded by where the terms before can have brought the part by the end of the rotation. Infinite
    /// where nothing bounds it: a part carried away for ever and rotated after that, or unbounded and rotated.
    #[must_use]
    pub fn speed_bound(&self, bounds: &Bounds) -> f64 {
        let speeds: Vec<f64> = (0..self.terms.len()).map(|index| self.term_speed_bound(index, bounds)).collect();
        // what runs together changes only where a window opens, so those times see every combination
        let running_from = |time: f64| -> f64 {
            let running = |term: &MotionTerm| term.from <= time && time < term.until;
            self.terms.iter().zip(&speeds).filter(|(term, _)| running(term)).map(|(_, speed)| speed).sum()
        };
        self.terms.iter().map(|term| running_from(term.from)).fold(0.0, f64::max)
    }

    fn term_speed_bound(&self, index: usize, bounds: &Bounds) -> f64 {
        let term = &self.terms[index];
        match &term.kind {
            MotionKind::Rotate { rate: 0.0, .. } | MotionKind::Conveyor { .. } => 0.0,
            MotionKind::Rotate { origin, axis, rate } => {
                rate.abs() * farthest_from_axis(&self.terms[..index], bounds, origin, axis, term.until)
            }
            MotionKind::Translate { velocity } => velocity.norm(),
            MotionKind::Oscillate { amplitude, frequency, .. } => TAU * frequency.abs() * amplitude.norm(),
        }
    }
}

/// Greatest distance [m] from an axis that a part within `bounds` reaches under `terms` until a plant time [s].
fn farthest_from_axis(terms: &[MotionTerm], bounds: &Bounds, origin: &Vec3, axis: &Vec3, until: f64) -> f64 {
    let from_axis = |point: &Vec3, origin: &Vec3, axis: &Vec3| (point - origin).cross(axis).norm();
    if bounds.is_empty() {
        return 0.0;
    }
    let extremes = [bounds.minimum, bounds.maximum];
    if extremes.iter().flatten().any(|coordinate| !coordinate.is_finite()) {
        return f64::INFINITY;
    }
    if terms.iter().all(MotionTerm::is_static) {
        // distance is convex: the farthest point of a box is a corner
        return (0..8_usize)
            .map(|corner| Vec3::from_fn(|axis, _| extremes[corner >> axis & 1][axis]))
            .map(|corner| from_axis(&corner, origin, axis))
            .fold(0.0, f64::max);
    }
    // a ball around everything the part can have swept
    let mut centre = (Vec3::from(bounds.minimum) + Vec3::from(bounds.maximum)) / 2.0;
    let mut radius = bounds.size().norm() / 2.0;
    for term in terms.iter().filter(|term| !term.is_static()) {
        match &term.kind {
            MotionKind::Rotate { origin, axis, .. } => {
                let on_axis = origin + axis * axis.dot(&(centre - origin));
                radius += (centre - on_axis).norm();
                centre = on_axis;
            }
            MotionKind::Translate { velocity } => radius += velocity.norm() * term.elapsed(until),
            MotionKind::Oscillate { amplitude, .. } => radius += 2.0 * amplitude.norm(),
            MotionKind::Conveyor { .. } => {}
        }
    }
    from_axis(&centre, origin, axis) + radius
}

impl MotionTerm {
    /// Time for which it has acted [s].
    fn elapsed(&self, time: f64) -> f64 {
        time.min(self.until).max(self.from) - self.from
    }

    fn is_static(&self) -> bool {
        match &self.kind {
            MotionKind::Rotate { rate, .. } => *rate == 0.0,
            MotionKind::Translate { velocity } => *velocity == Vec3::zeros(),
            MotionKind::Oscillate { amplitude, frequency, .. } => *amplitude == Vec3::zeros() || *frequency == 0.0,
            MotionKind::Conveyor { .. } => true,
        }
    }

    fn pose(&self, time: f64) -> Pose {
        let elapsed = self.elapsed(time);
        match &self.kind {
            MotionKind::Rotate { origin, axis, rate } => {
                let rotation = Rotation::from_axis_angle(&nalgebra::Unit::new_unchecked(*axis), rate * elapsed);
                Pose { rotation, translation: origin - rotation * origin }
            }
            MotionKind::Translate { velocity } => Pose { translation: velocity * elapsed, ..Pose::IDENTITY },
            MotionKind::Oscillate { amplitude, frequency, phase } => {
                let stroke = (TAU * frequency * elapsed + phase).sin() - phase.sin();
                Pose { translation: amplitude * stroke, ..Pose::IDENTITY }
            }
            MotionKind::Conveyor { .. } => Pose::IDENTITY,
        }
    }

    fn twist(&self, time: f64) -> Twist {
        if time < self.from || time >= self.until {
            return Twist::REST;
        }
        match &self.kind {
            MotionKind::Rotate { origin, axis, rate } => {
                let spin = axis * *rate;
                Twist { velocity: -spin.cross(origin), spin, ..Twist::REST }
            }
            MotionKind::Translate { velocity } => Twist { velocity: *velocity, ..Twist::REST },
            MotionKind::Oscillate { amplitude, frequency, phase } => {
                let rate = TAU * frequency;
                let velocity = amplitude * (rate * (rate * self.elapsed(time) + phase).cos());
                Twist { velocity, ..Twist::REST }
            }
            MotionKind::Conveyor { velocity } => Twist { belt: *velocity, ..Twist::REST },
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::vec3;
    use proptest::prelude::*;
    use std::f64::consts::FRAC_PI_2;

    fn rotate(rate: f64) -> MotionKind {
        MotionKind::Rotate { origin: vec3(0.3, -0.2, 0.5), axis: vec3(1.0, 2.0, -2.0) / 3.0, rate }
    }

    fn term(kind: MotionKind) -> MotionTerm {
        MotionTerm { kind, from: 0.0, until: f64::INFINITY }
    }

    fn composite() -> Motion {
        let oscillate = MotionKind::Oscillate { amplitude: vec3(0.1, 0.0, 0.2), frequency: 1.3, phase: 0.4 };
        let roll = MotionKind::Rotate { origin: vec3(1.0, 0.0, 0.0), axis: vec3(0.0, 1.0, 0.0), rate: -1.7 };
        Motion {
            terms: vec![
                MotionTerm { kind: rotate(2.0), from: 0.2, until: 3.1 },
                MotionTerm { kind: oscillate, from: 0.7, until: 2.6 },
                MotionTerm { kind: MotionKind::Translate { velocity: vec3(0.3, -1.0, 0.2) }, from: 1.0, until: 2.0 },
                MotionTerm { kind: roll, from: 0.5, until: 2.9 },
            ],
        }
    }

    proptest! {
        /// Central differences over 2 h err by h^2 / 6 times the third derivative, about (3 /s)^3 x 5 m, and by round-off
        /// 1e-15 / h: with h = 1e-5 s below 1e-8 m/s.
        #[test]
        fn the_twist_is_the_derivative_of_the_pose(time in 0.0..3.5_f64, x in -1.0..1.0, y in -1.0..1.0, z in -1.0..1.0) {
            let (motion, h) = (composite(), 1e-5);
            let edges = motion.terms.iter().flat_map(|t| [t.from, t.until]);
            prop_assume!(edges.into_iter().all(|edge| (time - edge).abs() > 2.0 * h));
            let body = vec3(x, y, z);
            let at = |time: f64| motion.pose(time).apply(&body);
            let expected = (at(time + h) - at(time - h)) / (2.0 * h);
            prop_assert!((motion.twist(time).at(&at(time)) - expected).norm() < 1e-8);
        }

        #[test]
        fn no_point_is_faster_than_the_bound(time in 0.0..3.5_f64, x in -1.0..1.0, y in -1.0..1.0, z in -1.0..1.0) {
            let motion = composite();
            let bound = motion.speed_bound(&Bounds { minimum: [-1.0; 3], maximum: [1.0; 3] });
            let at = motion.pose(time).apply(&vec3(x, y, z));
            prop_assert!(motion.twist(time).at(&at).norm() <= bound);
            prop_assert!(bound.is_finite());
        }

        #[test]
        fn a_pose_is_undone_by_its_inverse(time in 0.0..3.5_f64, x in -1.0..1.0, y in -1.0..1.0, z in -1.0..1.0) {
            let pose = composite().pose(time);
            let point = vec3(x, y, z);
            prop_assert!((pose.inverse_apply(&pose.apply(&point)) - point).norm() < 1e-14);
        }
    }

    #[test]
    fn terms_act_in_order() {
        let quarter = MotionKind::Rotate { origin: Vec3::zeros(), axis: Vec3::z(), rate: FRAC_PI_2 };
        let shift = MotionKind::Translate { velocity: vec3(1.0, 0.0, 0.0) };
        let turned_then_shifted = Motion { terms: vec![term(quarter.clone()), term(shift.clone())] };
        let shifted_then_turned = Motion { terms: vec![term(shift), term(quarter)] };
        let point = vec3(1.0, 0.0, 0.0);
        assert!((turned_then_shifted.pose(1.0).apply(&point) - vec3(1.0, 1.0, 0.0)).norm() < 1e-15);
        assert!((shifted_then_turned.pose(1.0).apply(&point) - vec3(0.0, 2.0, 0.0)).norm() < 1e-15);
    }

    #[test]
    fn a_part_waits_for_its_window_and_stays_after_it() {
        let motion = Motion { terms: vec![MotionTerm { kind: rotate(2.0), from: 1.0, until: 1.5 }] };
        assert_eq!(motion.pose(0.9), Pose::IDENTITY);
        assert_eq!(motion.twist(0.9), Twist::REST);
        assert_eq!(motion.twist(1.0).spin, vec3(1.0, 2.0, -2.0) / 3.0 * 2.0);
        assert_eq!(motion.pose(1.5), motion.pose(77.0));
        assert_eq!(motion.twist(1.5), Twist::REST);
        assert!((motion.pose(9.0).rotation.angle() - 2.0 * (1.5 - 1.0)).abs() < 1e-15);
    }

    #[test]
    fn an_oscillation_starts_in_place() {
        let (amplitude, frequency, phase) = (vec3(0.0, 0.0, 0.01), 5.0, 0.7);
        let kind = MotionKind::Oscillate { amplitude, frequency, phase };
        let motion = Motion { terms: vec![MotionTerm { kind, from: 2.0, until: f64::INFINITY }] };
        assert_eq!(motion.pose(2.0).translation, Vec3::zeros());
        let expected = 0.01 * ((TAU * frequency * 0.03 + phase).sin() - phase.sin());
        assert!((motion.pose(2.03).translation.z - expected).abs() < 1e-15);
        assert!((motion.twist(2.0).velocity.z - 0.01 * TAU * frequency * phase.cos()).abs() < 1e-15);
        assert_eq!(motion.speed_bound(&Bounds::EMPTY), TAU * frequency * 0.01);
    }

    #[test]
    fn a_belt_leaves_the_part_in_place_and_turns_with_it() {
        let belt = MotionKind::Conveyor { velocity: vec3(1.0, 0.0, 0.0) };
        let motion = Motion { terms: vec![term(belt.clone())] };
        assert!(motion.is_static());
        assert_eq!(motion.pose(3.0), Pose::IDENTITY);
        assert_eq!(motion.twist(3.0), Twist { belt: vec3(1.0, 0.0, 0.0), ..Twist::REST });
        let swing = MotionKind::Rotate { origin: Vec3::zeros(), axis: Vec3::z(), rate: FRAC_PI_2 };
        let swung = Motion { terms: vec![term(belt), term(swing)] };
        assert!(!swung.is_static());
        assert!((swung.twist(1.0).belt - vec3(0.0, 1.0, 0.0)).norm() < 1e-15);
    }

    #[test]
    fn the_speed_bound_of_a_rotation_is_reached_at_the_farthest_corner() {
        let kind = MotionKind::Rotate { origin: vec3(1.0, 0.0, 0.0), axis: Vec3::z(), rate: -3.0 };
        let motion = Motion { terms: vec![term(kind.clone())] };
        let bounds = Bounds { minimum: [-1.0; 3], maximum: [1.0; 3] };
        assert!((motion.speed_bound(&bounds) - 3.0 * 2.0_f64.hypot(1.0)).abs() < 1e-14);
        // one after the other: the faster one counts, not the sum
        let shift = MotionKind::Translate { velocity: vec3(0.0, 0.0, 4.0) };
        let one = MotionTerm { kind: kind.clone(), from: 0.0, until: 1.0 };
        let two = MotionTerm { kind: shift.clone(), from: 1.0, until: 2.0 };
        let bound = Motion { terms: vec![one, two] }.speed_bound(&bounds);
        assert!((bound - 3.0 * 2.0_f64.hypot(1.0)).abs() < 1e-14);
        // carried away for ever, then rotated: nothing bounds it
        let carried = MotionKind::Translate { velocity: vec3(1.0, 0.0, 0.0) };
        assert_eq!(Motion { terms: vec![term(carried), term(kind)] }.speed_bound(&bounds), f64::INFINITY);
    }
}
