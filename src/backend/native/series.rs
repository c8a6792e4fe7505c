//! Rows of `series.csv`.

use super::Schedule;
use crate::dem::simulation::Simulation;
use crate::math::Vec3;
use crate::output::series::{PartRow, SeriesEnergy, SeriesRow, SeriesWriter, mass_column};
use crate::particle::ParticleState;
use crate::scene::{MeasureKind, Scene};
use crate::storage::StorageError;
use std::path::Path;

/// Writes rows at their interval, and the last one.
#[derive(Debug)]
pub struct SeriesOutput {
    writer: SeriesWriter,
    schedule: Schedule,
    last_written: Option<u64>,
}

impl SeriesOutput {
    /// Opens `series.csv`; that of a resumed simulation is continued after the last row that was due.
    pub fn open(scene: &Scene, folder: &Path, simulation: &Simulation, resumed: bool) -> Result<Self, StorageError> {
        let path = folder.join("series.csv");
        let schedule = Schedule::new(Some(scene.output.series_interval), simulation);
        if !resumed {
            return Ok(Self { writer: SeriesWriter::create(&path)?, schedule, last_written: None });
        }
        let kept = schedule.last_due(simulation.steps_done());
        let writer = SeriesWriter::resume(&path, kept as f64 * simulation.setup().timestep)?;
        Ok(Self { writer, schedule, last_written: Some(kept) })
    }

    /// Writes a row where the present step is due.
    pub fn write_due(&mut self, simulation: &Simulation, scene: &Scene) -> Result<(), StorageError> {
        if self.schedule.is_due(simulation.steps_done()) { self.write(simulation, scene) } else { Ok(()) }
    }

    /// Writes the last state's row, unless it stands there already.
    pub fn write_last(&mut self, simulation: &Simulation, scene: &Scene) -> Result<(), StorageError> {
        if self.last_written == Some(simulation.steps_done()) { Ok(()) } else { self.write(simulation, scene) }
    }

    fn write(&mut self, simulation: &Simulation, scene: &Scene) -> Result<(), StorageError> {
        self.writer.add(&row(simulation, scene))?;
        self.last_written = Some(simulation.steps_done());
        Ok(())
    }
}

fn row(simulation: &Simulation, scene: &Scene) -> SeriesRow {
    let particles = simulation.particles();
    let contacts = simulation.contact_survey();
    let budget = if scene.output.energy { simulation.energy() } else { simulation.energy_without_springs() };
    let mass = |p: &ParticleState| scene.body.mass(p.radius, p.density);
    let inserted = simulation.feed_reports().iter().map(|report| report.inserted_count).sum();
    let energy = scene.output.energy.then(|| SeriesEnergy {
        gravitational: budget.gravitational,
        elastic: budget.elastic,
        slip: budget.slip,
        dashpot: budget.dashpot,
        rolling: budget.rolling,
        wall_work: budget.wall_work,
        inserted: budget.inserted,
        removed: budget.removed,
        law_residual: budget.law_residual,
        sleep: simulation.setup().sleeping.map(|_| budget.sleep),
        imbalance: budget.sum(),
    });
    let parts = scene.parts.iter().zip(simulation.part_loads()).map(|(part, load)| PartRow {
        name: part.name.clone(),
        force: load.force,
        torque: load.torque,
        power: load.power,
    });
    let beyond = scene.measures.iter().filter_map(|measure| match &measure.kind {
        MeasureKind::MassFlowRate { point, normal } => {
            let gone = simulation.removed().iter().map(|removal| (removal.position.into(), removal.mass));
            let here = particles.iter().map(|particle| (particle.position, mass(particle)));
            Some((mass_column(&measure.name), mass_beyond_plane(point, normal, here.chain(gone))))
        }
        _ => None,
    });
    SeriesRow {
        time: simulation.time(),
        step: simulation.steps_done(),
        particles: particles.len() as u64,
        mass: particles.iter().map(mass).sum(),
        contacts: Some(contacts.count),
        kinetic_energy: budget.kinetic,
        rotational_energy: budget.rotational,
        rms_speed: simulation.rms_speed(),
        maximum_speed: particles.iter().map(|p| p.velocity.norm()).fold(0.0, f64::max),
        maximum_overlap: Some(contacts.largest_overlap_ratio),
        inserted,
        removed: simulation.removed().len() as u64,
        energy,
        parts: parts.collect(),
        further: beyond.collect(),
    }
}

/// Mass [kg] of the bodies whose centre lies beyond a plane; those that left the domain count where they were last.
fn mass_beyond_plane(point: &Vec3, normal: &Vec3, bodies: impl Iterator<Item = (Vec3, f64)>) -> f64 {
    bodies.filter(|(place, _)| (place - point).dot(normal) >= 0.0).map(|(_, mass)| mass).sum()
}
