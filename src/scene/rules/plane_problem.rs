//! The plane problem (two dimensions): motion in x and z, spin about y, discs of a given thickness.
//!
//! - `plane-hertz` (error): Hertz describes spheres; two parallel discs touch along a line, where the approach is not a
//!   power law of the force (Johnson 1985). Only the linear law is offered.
//! - `plane-gravity` (error): gravity cannot point out of the plane.
//! - `plane-region` (error): feeds and motions must lie in the plane y = 0.

use super::{Subject, join};
use crate::dem::feed::FeedKind;
use crate::dem::law::NormalLaw;
use crate::geometry::motion::MotionKind;
use crate::math::Vec3;
use crate::particle::Body;
use crate::scene::extent;

pub(super) fn check(subject: &Subject<'_>) {
    if subject.draft.body == Body::Sphere {
        return;
    }
    if subject.draft.law.is_some_and(|law| law.normal == NormalLaw::HertzMindlin) {
        subject.error(
            "plane-hertz",
            "contact.law",
            "a plane problem has no Hertz law: discs touch along a line, not in a point".to_owned(),
            "write `law = \"linear\"`, or `dimensions = 3`",
        );
    }
    if subject.draft.gravity.y != 0.0 {
        let what = "gravity points out of the plane: its y component must be 0".to_owned();
        subject.error("plane-gravity", "gravity", what, "give gravity in x and z");
    }
    feeds(subject);
    motions(subject);
    gates(subject);
}

/// A gate stands across the plane y = 0, and a stream stays in it.
fn gates(subject: &Subject<'_>) {
    for gate in subject.draft.gates.iter().filter(|gate| gate.item.plane.normal.y.abs() > 1e-9) {
        report(subject, &join(&gate.path, "normal"), "particles cannot pass: the normal leaves the plane y = 0");
    }
    for stage in subject.draft.stages.stages.iter().filter(|_| subject.draft.stages.whole) {
        for (index, replay) in stage.item.replays.iter().enumerate() {
            let moved = replay.transform;
            let turns = (moved.direction(Vec3::x()).y.abs() + moved.direction(Vec3::z()).y.abs()) > 1e-9;
            if turns || moved.point(Vec3::zeros()).y.abs() > 1e-9 {
                let path = join(&stage.path, &format!("replay.{index}"));
                report(subject, &path, "the stream is moved out of the plane y = 0");
            }
        }
    }
}

fn feeds(subject: &Subject<'_>) {
    for feed in &subject.draft.feeds {
        let bounds = extent::of_feed(&feed.item.kind);
        let (key, velocity) = match &feed.item.kind {
            FeedKind::Fill { velocity, .. } => ("region", *velocity),
            FeedKind::Stream { velocity, .. } => ("face", *velocity),
            FeedKind::File { particles } => {
                if particles.iter().any(|p| p.position.y != 0.0 || p.velocity.y != 0.0) {
                    report(subject, &join(&feed.path, "file"), "a particle of it leaves the plane y = 0");
                }
                continue;
            }
        };
        if bounds.minimum[1] > 0.0 || bounds.maximum[1] < 0.0 {
            report(subject, &join(&feed.path, key), "the feed does not reach the plane y = 0");
        }
        if velocity.y != 0.0 {
            report(subject, &join(&feed.path, "velocity"), "the velocity leaves the plane y = 0");
        }
    }
}

fn motions(subject: &Subject<'_>) {
    for part in &subject.draft.parts {
        for (index, term) in part.item.part.motion.terms.iter().enumerate() {
            let leaves = match &term.kind {
                MotionKind::Rotate { axis, .. } => axis.cross(&Vec3::y()).norm() > 1e-9,
                MotionKind::Translate { velocity } | MotionKind::Conveyor { velocity } => velocity.y != 0.0,
                MotionKind::Oscillate { amplitude, .. } => amplitude.y != 0.0,
            };
            if leaves {
                let path = join(&join(&part.path, "motion"), &index.to_string());
                report(
                    subject,
                    &path,
                    "the motion leaves the plane; only turns about y and shifts in x and z stay in it",
                );
            }
        }
    }
}

fn report(subject: &Subject<'_>, path: &str, what: &str) {
    subject.error(
        "plane-region",
        path,
        what.to_owned(),
        "keep feeds and motions in the plane y = 0, or write `dimensions = 3`",
    );
}
