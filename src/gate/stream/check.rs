//! What must hold of crossings in a stream, whoever wrote them.

use super::format::{Counts, Origin, Range};
use crate::gate::crossing::{ContactPartner, Crossing};
use crate::particle::ParticleId;

/// Deviation of a stored unit normal from length 1 that is still round-off of an external code's printed digits.
const UNIT: f64 = 1e-5;

/// What is wrong with `crossings`, which follow the crossing `before`, in words that name the first that is.
pub(super) fn fault(origin: &Origin, crossings: &[Crossing], before: Option<(u64, ParticleId)>) -> Option<String> {
    let mut last = before;
    crossings.iter().enumerate().find_map(|(row, crossing)| {
        let place = (crossing.step, crossing.state.id);
        let found = match last.replace(place) {
            Some(earlier) if earlier >= place => Some(order(earlier, place)),
            _ => fault_of_one(origin, crossing),
        };
        found.map(|what| format!("crossing {row} ({}): {what}", name(crossing.state.id)))
    })
}

fn order((step, id): (u64, ParticleId), (now, _): (u64, ParticleId)) -> String {
    format!("its step {now} does not follow step {step} of {} before it", name(id))
}

fn name(id: ParticleId) -> String {
    format!("particle {} of feed {}", id.serial(), id.feed())
}

fn fault_of_one(origin: &Origin, crossing: &Crossing) -> Option<String> {
    let state = &crossing.state;
    if !(state.radius > 0.0 && state.density > 0.0) {
        return Some(format!("its radius {} m or density {} kg/m3 is not positive", state.radius, state.density));
    }
    if usize::from(state.material) >= origin.materials.len() {
        return Some(format!("its material {} is none of the {} stored", state.material, origin.materials.len()));
    }
    for (number, contact) in crossing.contacts.iter().enumerate() {
        match contact.partner {
            ContactPartner::Part { part, .. } if usize::from(part) >= origin.part_names.len() => {
                let parts = origin.part_names.len();
                return Some(format!("its contact {number} is with part {part}, there are names of {parts}"));
            }
            ContactPartner::Particle(id) if id == state.id => {
                return Some(format!("its contact {number} is with itself"));
            }
            _ => {}
        }
        if (contact.normal.norm_squared() - 1.0).abs() > 2.0 * UNIT {
            return Some(format!("the normal of its contact {number} is not of unit length"));
        }
    }
    let motions = crossing.path.len() as u64;
    let every = origin.paths.map_or(0, |paths| paths.every);
    match motions.checked_sub(1) {
        Some(_) if every == 0 => Some("it has a path, but the manifest says that none are stored".to_owned()),
        Some(intervals) => {
            let last = intervals.checked_mul(every).and_then(|steps| steps.checked_add(crossing.path_start));
            (last.is_none_or(|last| last >= crossing.step)).then(|| {
                format!(
                    "its path of {motions} motions from step {} ends after step {}",
                    crossing.path_start, crossing.step
                )
            })
        }
        None => None,
    }
}

/// Counts of consecutive crossings; the mass is added to `mass` [kg] in their order, so that the sum does not depend on chunks.
pub(super) fn count(origin: &Origin, crossings: &[Crossing], mass: f64) -> Counts {
    let mut counts = Counts { crossings: crossings.len() as u64, mass, ..Counts::default() };
    for crossing in crossings {
        let time = crossing.passage.time;
        let own = Range { first_step: crossing.step, last_step: crossing.step, first_time: time, last_time: time };
        counts.contacts += crossing.contacts.len() as u64;
        counts.motions += crossing.path.len() as u64;
        counts.mass += origin.body.mass(crossing.state.radius, crossing.state.density);
        counts.range = Some(counts.range.map_or(own, |range| range.union(own)));
    }
    counts
}

impl Counts {
    /// Adds those of the next crossings, whose mass already holds this one.
    pub(super) fn continued(&mut self, next: &Self) {
        self.crossings += next.crossings;
        self.contacts += next.contacts;
        self.motions += next.motions;
        self.mass = next.mass;
        self.range = match (self.range, next.range) {
            (Some(before), Some(after)) => Some(before.union(after)),
            (before, after) => before.or(after),
        };
    }
}
