//! Motion of a part as a closed function of plant time: never accumulated, so that any time can be asked for directly.

use crate::math::{Rotation, Vec3};
use serde::Serialize;

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
