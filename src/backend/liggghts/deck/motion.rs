//! Motions of parts as LIGGGHTS makes them: `fix move/mesh`, and `surface_vel` for belts.
//!
//! Several motions of a mesh at a time add up to a rigid motion only where none of them turns it: LIGGGHTS moves the mesh by one
//! motion and by the next in every time step, each about its own fixed axis. One after the other they are those of the scene as long
//! as they follow each other in time as they do in the list.

use super::names::vector;
use crate::backend::liggghts::{Schedule, deck_number};
use crate::geometry::motion::{Motion, MotionKind, MotionTerm};
use crate::geometry::part::Part;
use crate::math::Vec3;
use std::f64::consts::TAU;

/// A motion of a mesh.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Move {
    /// Its number within the part, from 1.
    pub number: usize,
    /// What follows `fix ID all move/mesh mesh MESH`.
    pub arguments: String,
    /// Time step of its start.
    pub from: u64,
    /// Time step of its end, where it lies within the run.
    pub until: Option<u64>,
}

/// The motions of a part within a run.
#[must_use]
pub fn moves(motion: &Motion, schedule: &Schedule) -> Vec<Move> {
    let numbered = motion.terms.iter().zip(1..);
    let within = numbered.filter_map(|(term, number)| {
        let arguments = arguments(&term.kind)?;
        let from = schedule.batch_at(term.from);
        let until = term.until.is_finite().then(|| schedule.batch_at(term.until)).filter(|end| *end < schedule.steps);
        let happens = from < schedule.steps && until.is_none_or(|end| end > from);
        happens.then_some(Move { number, arguments, from, until })
    });
    within.collect()
}

/// Velocity of a belt in itself [m/s].
#[must_use]
pub fn belt(motion: &Motion) -> Option<Vec3> {
    let belts = motion.terms.iter().filter_map(|term| match term.kind {
        MotionKind::Conveyor { velocity } => Some(velocity),
        _ => None,
    });
    belts.reduce(|sum, velocity| sum + velocity)
}

fn arguments(kind: &MotionKind) -> Option<String> {
    match kind {
        MotionKind::Rotate { rate: 0.0, .. } | MotionKind::Conveyor { .. } => None,
        MotionKind::Rotate { origin, axis, rate } => Some(format!(
            "rotate origin {} axis {} period {}",
            vector(origin),
            vector(&(axis * rate.signum())),
            deck_number(TAU / rate.abs())
        )),
        MotionKind::Translate { velocity } => Some(format!("linear {}", vector(velocity))),
        MotionKind::Oscillate { amplitude, frequency, phase } => {
            let sign = if phase.cos() < 0.0 { -1.0 } else { 1.0 };
            let amplitude = vector(&(amplitude * sign));
            Some(format!("wiggle amplitude {amplitude} period {}", deck_number(1.0 / frequency)))
        }
    }
}

/// What of a part's motion LIGGGHTS cannot do.
#[must_use]
pub fn refusals(part: &Part, end: f64) -> Vec<String> {
    let name = &part.name;
    let mut found = Vec::new();
    let moving: Vec<&MotionTerm> = part.motion.terms.iter().filter(|term| arguments(&term.kind).is_some()).collect();
    let turns = |term: &MotionTerm| matches!(term.kind, MotionKind::Rotate { .. });
    if moving.iter().any(|term| turns(term)) && moving.windows(2).any(|pair| pair[1].from < pair[0].until.min(end)) {
        found.push(format!(
            "part `{name}`: LIGGGHTS turns a mesh about an axis that stands still, also while the mesh moves otherwise; let its motions \
             follow one another in time, in the order in which the scene has them, or use the native solver"
        ));
    }
    for term in &part.motion.terms {
        match &term.kind {
            MotionKind::Oscillate { phase, .. } if phase.sin().abs() > 1e-9 => found.push(format!(
                "part `{name}`: LIGGGHTS starts an oscillation in its middle; set its phase to 0, start it earlier or later instead, or \
                 use the native solver"
            )),
            MotionKind::Conveyor { .. } if term.from > 0.0 || term.until < end => found.push(format!(
                "part `{name}`: a belt runs from the start to the end in LIGGGHTS; drop its `from` and `until`, or use the native solver"
            )),
            MotionKind::Conveyor { .. } if moving.iter().any(|term| turns(term)) => found.push(format!(
                "part `{name}`: LIGGGHTS does not turn a belt's velocity with the belt; drop one of the two, or use the native solver"
            )),
            _ => {}
        }
    }
    found
}
