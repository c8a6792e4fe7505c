//! When a run ends.

use crate::backend::stage::EndReason;
use crate::dem::presence::RestWatch;
use crate::dem::simulation::Simulation;
use crate::scene::Scene;
use serde::{Deserialize, Serialize};

/// Watches the end conditions; part of a checkpoint.
#[derive(Debug, Clone, Default, Serialize, Deserialize)]
pub struct EndWatch {
    rest: RestWatch,
}

impl EndWatch {
    /// The end condition that holds now.
    pub fn reached(&mut self, simulation: &Simulation, scene: &Scene) -> Option<EndReason> {
        let (end, timestep) = (&scene.end, simulation.setup().timestep);
        let (step, empty) = (simulation.steps_done(), simulation.particle_count() == 0);
        // Half a step: the last one must not be missed, or done twice, for a rounding of time / dt.
        if simulation.time() > end.time - 0.5 * timestep {
            return Some(EndReason::Time);
        }
        let fed = simulation.feeds_finished();
        if end.empty && fed && empty && step > 0 {
            return Some(EndReason::Empty);
        }
        if end.left_count.is_some_and(|count| simulation.removed().len() as u64 >= count) {
            return Some(EndReason::LeftCount);
        }
        let condition = end.at_rest?;
        // Parts that wait for rest go first: a gate that has just opened must be given time to act.
        let waiting = simulation.awaits_rest();
        let rests = !waiting && self.rest.holds(&condition, step, timestep, fed, empty, || simulation.rms_speed());
        if waiting {
            self.rest = RestWatch::new();
        }
        rests.then_some(EndReason::AtRest)
    }
}
