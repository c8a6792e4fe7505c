//! Looking at, and steering, a simulation after every time step.

use super::simulation::Simulation;
use super::watchdog::Stop;

/// Is called after every time step, in the order in which observers were given.
pub trait StepObserver {
    /// Looks at the simulation, and may insert, remove, prescribe, steer, tether and release particles.
    ///
    /// # Errors
    /// To end the run.
    fn observe(&mut self, simulation: &mut Simulation) -> Result<(), Stop>;
}
