//! Frames of the solver's state.

use super::Schedule;
use crate::backend::frames::{Frame, FrameFiles, PartLoad};
use crate::dem::inspect::{ContactRecord, Partner};
use crate::dem::particles::Path as Motion;
use crate::dem::simulation::Simulation;
use crate::math::Vec3;
use crate::output::vtp::ContactLine;
use crate::particle::{ParticleId, ParticleState};
use crate::scene::Scene;
use crate::storage::StorageError;
use std::collections::HashMap;
use std::path::Path;

/// Writes frames at their interval, and the last one.
#[derive(Debug)]
pub struct FrameOutput {
    files: FrameFiles,
    schedule: Schedule,
    last_written: Option<u64>,
}

impl FrameOutput {
    /// Opens the frame files; those of a resumed simulation are continued after the last frame that was due.
    pub fn open(scene: &Scene, folder: &Path, simulation: &Simulation, resumed: bool) -> Result<Self, StorageError> {
        let schedule = Schedule::new(scene.output.frame_interval, simulation);
        let kept = resumed.then(|| schedule.last_due(simulation.steps_done()));
        let files = FrameFiles::open(scene, folder, simulation.setup().timestep, kept)?;
        Ok(Self { files, schedule, last_written: kept })
    }

    /// Writes a frame where the present step is due.
    pub fn write_due(&mut self, simulation: &Simulation, scene: &Scene) -> Result<(), StorageError> {
        if self.schedule.is_due(simulation.steps_done()) { self.write(simulation, scene) } else { Ok(()) }
    }

    /// Writes the last state, unless it stands there already.
    pub fn write_last(&mut self, simulation: &Simulation, scene: &Scene) -> Result<(), StorageError> {
        if self.last_written == Some(simulation.steps_done()) { Ok(()) } else { self.write(simulation, scene) }
    }

    fn write(&mut self, simulation: &Simulation, scene: &Scene) -> Result<(), StorageError> {
        if !(scene.output.vtp || scene.output.lammps) {
            return Ok(());
        }
        let particles = simulation.particles();
        let forces: HashMap<ParticleId, Vec3> = simulation.contact_forces().collect();
        let forces: Vec<Vec3> = particles.iter().map(|particle| forces[&particle.id]).collect();
        let present: Vec<bool> = (0..scene.parts.len()).map(|part| simulation.is_present(part as u16)).collect();
        let loads = simulation.part_loads().iter();
        let loads: Vec<PartLoad> =
            loads.map(|load| PartLoad { force: load.force, torque: load.torque, power: load.power }).collect();
        let contacts = scene.output.contacts.then(|| contact_lines(&particles, &simulation.contacts()));
        let frame = Frame {
            step: simulation.steps_done(),
            time: simulation.time(),
            particles: &particles,
            forces: &forces,
            ghosts: ghost_column(simulation, &particles),
            present: &present,
            loads: &loads,
            contacts,
        };
        self.files.write(scene, &frame)?;
        self.last_written = Some(simulation.steps_done());
        Ok(())
    }
}

/// How each particle moves, where there is a gate: 0 by the forces on it, 1 on a prescribed path, 2 tethered to one.
fn ghost_column(simulation: &Simulation, particles: &[ParticleState]) -> Option<Vec<u8>> {
    simulation.setup().momentum.then(|| {
        let number = |path: Motion| if path.is_prescribed() { 1 } else { 2 * u8::from(path == Motion::Tethered) };
        let paths: HashMap<ParticleId, u8> = simulation.views().map(|view| (view.id, number(view.path))).collect();
        particles.iter().map(|particle| paths[&particle.id]).collect()
    })
}

fn contact_lines(particles: &[ParticleState], contacts: &[ContactRecord]) -> Vec<ContactLine> {
    let places: HashMap<ParticleId, Vec3> = particles.iter().map(|p| (p.id, p.position)).collect();
    let line = |contact: &ContactRecord| ContactLine {
        start: places[&contact.i],
        end: match contact.j {
            Partner::Particle(other) => places[&other],
            Partner::Part { .. } => contact.point,
        },
        normal: contact.normal,
        overlap: contact.overlap,
        force: contact.force,
    };
    contacts.iter().map(line).collect()
}
