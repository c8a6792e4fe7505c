//! What LIGGGHTS cannot do of a stage's geometry, motions and gates.

use super::motion;
use super::parts::across;
use crate::geometry::motion::MotionKind;
use crate::geometry::part::{Part, Surface, Trigger};
use crate::particle::Body;
use crate::scene::Scene;
use crate::stage::split::Recording;

/// Gates that a deck has groups of particles for: LIGGGHTS has 32 groups, of which a deck needs 11, and 3 for each gate.
const MOST_GATES: usize = 7;

/// Each with its reason, and what to do.
#[must_use]
pub fn refusals(scene: &Scene, records: &[Recording]) -> Vec<String> {
    let mut found = Vec::new();
    if matches!(scene.body, Body::Disc { .. }) {
        let what = "LIGGGHTS computes spheres in space, not discs in a plane; use a thin slice between two frictionless walls, or \
                    the native solver";
        found.push(what.to_owned());
    }
    if scene.start_checkpoint.is_some() {
        let what = "LIGGGHTS cannot start from a checkpoint of the native solver, whose contacts it does not know; start from an \
                    initial state (a feed of kind \"file\"), or use the native solver";
        found.push(what.to_owned());
    }
    for part in &scene.parts {
        found.extend(motion::refusals(part, scene.end.time));
        found.extend(plane_refusal(scene, part));
        found.extend(parking_refusal(scene, part));
    }
    if records.len() > MOST_GATES {
        found.push(format!(
            "{} gates are recorded in one run, and LIGGGHTS has groups of particles for {MOST_GATES}: cut the plant into more stages, \
             or use the native solver",
            records.len()
        ));
    }
    found
}

fn plane_refusal(scene: &Scene, part: &Part) -> Option<String> {
    let Surface::Plane { normal, .. } = &part.surface else { return None };
    let name = &part.name;
    let turns = |kind: &MotionKind| matches!(kind, MotionKind::Rotate { rate, .. } if *rate != 0.0);
    if part.motion.terms.iter().any(|term| turns(&term.kind)) {
        return Some(format!(
            "part `{name}`: a plane that moves is two triangles in LIGGGHTS, which do not reach everywhere once they are turned; \
             give it as a box or an STL file, or use the native solver"
        ));
    }
    let crosses = (0..3).any(|axis| scene.domain.periodic[axis] && normal[axis].abs() > 1e-9);
    (crosses && across(normal).is_none()).then(|| {
        format!(
            "part `{name}`: a plane that is not along the periodic axes ends at their borders; give it another normal"
        )
    })
}

/// A mesh that is not there is parked, which a mesh that turns cannot be.
fn parking_refusal(scene: &Scene, part: &Part) -> Option<String> {
    let (name, changes) = (&part.name, part.appears != Trigger::Always || part.disappears != Trigger::Never);
    if changes && scene.domain.periodic == [true; 3] {
        return Some(format!(
            "part `{name}`: a part that is not there stands beside the domain, and this domain has no side that is not periodic; \
             let one axis be open, or use the native solver"
        ));
    }
    let turns = |kind: &MotionKind| matches!(kind, MotionKind::Rotate { rate, .. } if *rate != 0.0);
    (changes && part.motion.terms.iter().any(|term| turns(&term.kind))).then(|| {
        format!(
            "part `{name}`: a part that is not there stands beside the domain, where LIGGGHTS would turn it about the same axis; let it \
             be there all the time, do without the rotation, or use the native solver"
        )
    })
}
