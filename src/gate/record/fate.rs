//! Particles that leave the ordinary course: they come back over the plane, or are behind it without having passed.

use super::profile::FreeFlowBin;
use super::{Fate, Look, Recorder};
use crate::gate::crossing::Seen;
use serde::{Deserialize, Serialize};

/// What a recorder has counted.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct RecordTally {
    /// Crossings.
    pub recorded: u64,
    /// Crossings of particles that touched something.
    pub in_contact: u64,
    /// Crossings of particles that moved along the plane or back at their first time step behind it.
    pub grazing: u64,
    /// Times that a recorded particle came back over the plane.
    pub returned: u64,
    /// The farthest that one of them got before the plane \[m\].
    pub returned_farthest_m: f64,
    /// Particles behind the plane when the run began, never recorded.
    pub sitting_at_start: u64,
    /// Particles that came behind the plane later without passing the aperture, or were put there.
    pub came_around: u64,
    /// Recorded particles taken out at the exclusion plane.
    pub excluded: u64,
    /// Particles taken out by their fate.
    pub deleted: u64,
    /// Recorded particles that left the run in another way.
    pub lost_after_crossing: u64,
    /// Recorded particles that are still in the run.
    pub still_in_run: u64,
    /// Share of particles in contact behind the plane; empty where ghosts move there.
    #[serde(skip_deserializing)]
    pub free_flow: Vec<FreeFlowBin>,
}

impl Recorder {
    /// A recorded particle before the plane again.
    pub(super) fn see_returned(&mut self, step: u64, seen: &Seen, distance: f64, look: &mut Look) {
        self.tally.returned_farthest_m = self.tally.returned_farthest_m.max(-distance);
        if let Some(gone) = self.after.get_mut(&seen.id)
            && !gone.returned
        {
            gone.returned = true;
            self.tally.returned += 1;
        }
        match self.gate.returning {
            Fate::Keep => {}
            Fate::Delete if step.is_multiple_of(self.cadence.hand_over) => look.delete.push(seen.id),
            Fate::Delete => {}
            Fate::Error => {
                let what = "came back over it after it had been recorded";
                let next = "move the gate to where nothing comes back, or set `returning` of the gate to \"keep\" or \"delete\"";
                self.refuse(step, seen, what, next, look);
            }
        }
    }

    /// A particle behind the plane that never passed it.
    pub(super) fn see_sitting(&mut self, step: u64, seen: &Seen, handing_over: bool, look: &mut Look) {
        if !self.in_aperture(seen) {
            return;
        }
        if self.sitting.insert(seen.id, ()).is_none() {
            let counter = if self.looked { &mut self.tally.came_around } else { &mut self.tally.sitting_at_start };
            *counter += 1;
        }
        match self.gate.sitting {
            Fate::Keep => {}
            Fate::Delete if handing_over => look.delete.push(seen.id),
            Fate::Delete => {}
            Fate::Error => {
                let what =
                    if self.looked { "is behind it without having passed it" } else { "lies behind it at the start" };
                let next = "keep particles out of there, move the gate, or set `sitting` of the gate to \"keep\" or \"delete\"";
                self.refuse(step, seen, what, next, look);
            }
        }
    }

    /// Ends the run; of several particles the one with the smallest identity is named.
    fn refuse(&self, step: u64, seen: &Seen, what: &str, next: &str, look: &mut Look) {
        let (id, place) = (seen.id, &seen.motion.position);
        let text = format!(
            "gate {:?}: particle {} of feed {} {what}: at {} s, at ({:.6}, {:.6}, {:.6}) m; {next}",
            self.gate.name,
            id.serial(),
            id.feed(),
            step as f64 * self.timestep,
            place.x,
            place.y,
            place.z,
        );
        if look.error.as_ref().is_none_or(|other| text < *other) {
            look.error = Some(text);
        }
    }
}
