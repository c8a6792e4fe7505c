//! Frames of particles, parts and contacts.

use super::Schedule;
use crate::dem::inspect::{ContactRecord, Partner};
use crate::dem::particles::Path as Motion;
use crate::dem::simulation::Simulation;
use crate::geometry::frustum::Frustum;
use crate::geometry::part::{Part, Surface, TriangleMesh};
use crate::math::Vec3;
use crate::output::lammps::{DumpWriter, FrameHeader};
use crate::output::pvd::{Collection, Entry, frame_file};
use crate::output::vtp::{ContactLine, MeshFrame, Precision, write_contacts, write_mesh, write_particles};
use crate::particle::{ParticleId, ParticleState};
use crate::scene::Scene;
use crate::storage::staging::STAGING_SUFFIX;
use crate::storage::{Column, StorageError};
use std::collections::HashMap;
use std::fs;
use std::path::{Path, PathBuf};

/// Generators that a cylinder or cone is drawn with.
const SEGMENTS: u32 = 64;

/// Writes frames at their interval, and the last one.
#[derive(Debug)]
pub struct FrameOutput {
    folder: PathBuf,
    schedule: Schedule,
    collection: Option<Collection>,
    dump: Option<DumpWriter>,
    last_written: Option<u64>,
    meshes: Vec<Option<TriangleMesh>>,
}

impl FrameOutput {
    /// Opens the frame files; those of a resumed simulation are continued after the last frame that was due.
    pub fn open(scene: &Scene, folder: &Path, simulation: &Simulation, resumed: bool) -> Result<Self, StorageError> {
        let frames = folder.join("frames");
        let pvd = folder.join("frames.pvd");
        let dump = folder.join("dump.particles.lammpstrj");
        let schedule = Schedule::new(scene.output.frame_interval, simulation);
        let kept = resumed.then(|| schedule.last_due(simulation.steps_done()));
        let mut output = Self {
            folder: folder.to_path_buf(),
            schedule,
            collection: None,
            dump: None,
            last_written: kept,
            meshes: scene.parts.iter().map(drawable).collect(),
        };
        if scene.output.vtp {
            fs::create_dir_all(&frames).map_err(|source| StorageError::system("create", &frames, source))?;
            remove_frames_after(&frames, kept)?;
            output.collection = Some(match kept {
                Some(step) => Collection::resume(&pvd, step as f64 * simulation.setup().timestep)?,
                None => Collection::create(&pvd)?,
            });
        }
        if scene.output.lammps {
            output.dump = Some(match kept {
                Some(step) => DumpWriter::resume(&dump, step)?,
                None => DumpWriter::create(&dump)?,
            });
        }
        Ok(output)
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
        let step = simulation.steps_done();
        let particles = simulation.particles();
        if let Some(dump) = &mut self.dump {
            let header = FrameHeader { step, time: None, bounds: scene.domain.bounds, periodic: scene.domain.periodic };
            let forces: HashMap<ParticleId, Vec3> = simulation.contact_forces().collect();
            let forces: Vec<Vec3> = particles.iter().map(|particle| forces[&particle.id]).collect();
            dump.add_frame(&header, &particles, Some(&forces), &scene.body)?;
        }
        if self.collection.is_some() {
            let entries = self.write_vtp(simulation, scene, &particles)?;
            if let Some(collection) = &mut self.collection {
                collection.add_frame(entries)?;
            }
        }
        self.last_written = Some(step);
        Ok(())
    }

    fn write_vtp(
        &self,
        simulation: &Simulation,
        scene: &Scene,
        particles: &[ParticleState],
    ) -> Result<Vec<Entry>, StorageError> {
        let (step, time) = (simulation.steps_done(), simulation.time());
        let mut entries = Vec::new();
        let mut add = |name: &str, stem: &str| {
            let file = frame_file(stem, step);
            entries.push(Entry {
                time,
                part: entries.len() as u32,
                name: name.to_owned(),
                file: format!("frames/{file}"),
            });
            self.folder.join("frames").join(file)
        };
        let ghosts = ghost_column(simulation, particles);
        let columns: Vec<(&str, Column)> = ghosts.iter().map(|ghosts| ("ghost", Column::from(ghosts))).collect();
        write_particles(&add("particles", "particles"), time, particles, &columns, Precision::Single)?;
        for (index, (part, mesh)) in scene.parts.iter().zip(&self.meshes).enumerate() {
            let Some(mesh) = mesh.as_ref().filter(|_| simulation.is_present(index as u16)) else { continue };
            let pose = part.motion.pose(time);
            let vertices: Vec<Vec3> = mesh.vertices.iter().map(|vertex| pose.apply(vertex)).collect();
            let load = simulation.part_loads()[index];
            let (force, torque, power) = ([load.force], [load.torque], [load.power]);
            let columns = [
                ("force", Column::from(&force[..])),
                ("torque", Column::from(&torque[..])),
                ("power", Column::from(&power[..])),
            ];
            let frame = MeshFrame {
                name: &part.name,
                vertices: &vertices,
                triangles: &mesh.triangles,
                triangle_columns: &[],
                part_columns: &columns,
            };
            write_mesh(&add(&part.name, &format!("{index}_{}", part.name)), time, &frame, Precision::Single)?;
        }
        if scene.output.contacts {
            let lines = contact_lines(particles, &simulation.contacts());
            write_contacts(&add("contacts", "contacts"), time, &lines, &[], Precision::Single)?;
        }
        Ok(entries)
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

/// Removes the frames of an earlier attempt at the same run that are later than `kept`, finished or not.
fn remove_frames_after(frames: &Path, kept: Option<u64>) -> Result<(), StorageError> {
    let failed = |source| StorageError::system("tidy up", frames, source);
    for entry in fs::read_dir(frames).map_err(failed)? {
        let entry = entry.map_err(failed)?;
        let name = entry.file_name();
        let Some(step) = name.to_str().and_then(step_of_frame) else { continue };
        if kept.is_none_or(|kept| step > kept) {
            fs::remove_file(entry.path()).map_err(failed)?;
        }
    }
    Ok(())
}

/// The time step in the name of a frame's file, also of an unfinished one.
fn step_of_frame(name: &str) -> Option<u64> {
    let (_, step) = name.strip_suffix(STAGING_SUFFIX).unwrap_or(name).strip_suffix(".vtp")?.rsplit_once('_')?;
    step.parse().ok()
}

/// A surface as triangles to look at; a plane has no border and is not drawn.
fn drawable(part: &Part) -> Option<TriangleMesh> {
    match &part.surface {
        Surface::Plane { .. } => None,
        Surface::Frustum { start, end, start_radius, end_radius } => {
            Some(Frustum::new(*start, *end, *start_radius, *end_radius).to_mesh(SEGMENTS))
        }
        Surface::Mesh(mesh) => Some(mesh.clone()),
    }
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
