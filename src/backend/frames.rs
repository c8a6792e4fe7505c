//! Frames of particles, parts and contacts, whoever computed them.

use crate::geometry::frustum::Frustum;
use crate::geometry::motion::Motion;
use crate::geometry::part::{Part, Surface, TriangleMesh};
use crate::math::{Bounds, Vec3};
use crate::output::lammps::{DumpWriter, FrameHeader};
use crate::output::pvd::{Collection, Entry, frame_file};
use crate::output::vtp::{ContactLine, MeshFrame, Precision, write_contacts, write_mesh, write_particles};
use crate::particle::{Body, ParticleState};
use crate::scene::Scene;
use crate::storage::staging::STAGING_SUFFIX;
use crate::storage::{Column, StorageError};
use std::fs;
use std::path::{Path, PathBuf};

/// Generators that a cylinder or cone is drawn with.
const SEGMENTS: u32 = 64;

/// What a frame shows.
#[derive(Debug)]
pub struct Frame<'a> {
    /// Time step.
    pub step: u64,
    /// Plant time [s].
    pub time: f64,
    /// Particles, by ascending identity.
    pub particles: &'a [ParticleState],
    /// Force of the contacts on each particle [N].
    pub forces: &'a [Vec3],
    /// How each particle moves, where there is a gate: 0 by the forces on it, 1 on a prescribed path, 2 tethered to one.
    pub ghosts: Option<Vec<u8>>,
    /// Whether each part is there.
    pub present: &'a [bool],
    /// Loads on each part; empty where they are not known.
    pub loads: &'a [PartLoad],
    /// Contacts, where the scene asks for them.
    pub contacts: Option<Vec<ContactLine>>,
}

/// Load of the particles on a part.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct PartLoad {
    /// Force [N].
    pub force: Vec3,
    /// Torque about the plant's origin [N m].
    pub torque: Vec3,
    /// Power the particles do on the part [W].
    pub power: f64,
}

/// The frames of a result folder, with all of the scene that they show: it may be written by another thread than reads the scene.
#[derive(Debug)]
pub struct FrameFiles {
    folder: PathBuf,
    collection: Option<Collection>,
    dump: Option<DumpWriter>,
    body: Body,
    bounds: Bounds,
    periodic: [bool; 3],
    parts: Vec<DrawnPart>,
}

/// A part as it is drawn.
#[derive(Debug)]
struct DrawnPart {
    /// Its number in the scene.
    index: usize,
    name: String,
    motion: Motion,
    mesh: TriangleMesh,
}

impl FrameFiles {
    /// Opens the frame files; those of a run that goes on are continued after the frame of the time step `kept`.
    ///
    /// # Errors
    /// When the disk refuses, or a file to be continued cannot be used.
    pub fn open(scene: &Scene, folder: &Path, timestep: f64, kept: Option<u64>) -> Result<Self, StorageError> {
        let frames = folder.join("frames");
        let pvd = folder.join("frames.pvd");
        let dump = folder.join("dump.particles.lammpstrj");
        let mut files = Self {
            folder: folder.to_path_buf(),
            collection: None,
            dump: None,
            body: scene.body,
            bounds: scene.domain.bounds,
            periodic: scene.domain.periodic,
            parts: scene.parts.iter().enumerate().filter_map(|(index, part)| DrawnPart::new(index, part)).collect(),
        };
        if scene.output.vtp {
            fs::create_dir_all(&frames).map_err(|source| StorageError::system("create", &frames, source))?;
            remove_frames_after(&frames, kept)?;
            files.collection = Some(match kept {
                Some(step) => Collection::resume(&pvd, step as f64 * timestep)?,
                None => Collection::create(&pvd)?,
            });
        }
        if scene.output.lammps {
            files.dump = Some(match kept {
                Some(step) => DumpWriter::resume(&dump, step)?,
                None => DumpWriter::create(&dump)?,
            });
        }
        Ok(files)
    }

    /// Writes a frame into every file that the scene asks for.
    ///
    /// # Errors
    /// When the disk refuses.
    pub fn write(&mut self, frame: &Frame) -> Result<(), StorageError> {
        if let Some(dump) = &mut self.dump {
            let header = FrameHeader { step: frame.step, time: None, bounds: self.bounds, periodic: self.periodic };
            dump.add_frame(&header, frame.particles, Some(frame.forces), &self.body)?;
        }
        if self.collection.is_some() {
            let entries = self.write_vtp(frame)?;
            if let Some(collection) = &mut self.collection {
                collection.add_frame(entries)?;
            }
        }
        Ok(())
    }

    fn write_vtp(&self, frame: &Frame) -> Result<Vec<Entry>, StorageError> {
        let (step, time) = (frame.step, frame.time);
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
        let columns: Vec<(&str, Column)> = frame.ghosts.iter().map(|ghosts| ("ghost", Column::from(ghosts))).collect();
        write_particles(&add("particles", "particles"), time, frame.particles, &columns, Precision::Single)?;
        for DrawnPart { index, name, motion, mesh } in self.parts.iter().filter(|part| frame.present[part.index]) {
            let pose = motion.pose(time);
            let vertices: Vec<Vec3> = mesh.vertices.iter().map(|vertex| pose.apply(vertex)).collect();
            let load = frame.loads.get(*index).copied();
            let values = load.map(|load| ([load.force], [load.torque], [load.power]));
            let columns: Vec<(&str, Column)> = match &values {
                Some((force, torque, power)) => vec![
                    ("force", Column::from(&force[..])),
                    ("torque", Column::from(&torque[..])),
                    ("power", Column::from(&power[..])),
                ],
                None => Vec::new(),
            };
            let frame = MeshFrame {
                name,
                vertices: &vertices,
                triangles: &mesh.triangles,
                triangle_columns: &[],
                part_columns: &columns,
            };
            write_mesh(&add(name, &format!("{index}_{name}")), time, &frame, Precision::Single)?;
        }
        if let Some(lines) = &frame.contacts {
            write_contacts(&add("contacts", "contacts"), time, lines, &[], Precision::Single)?;
        }
        Ok(entries)
    }
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

impl DrawnPart {
    /// A part's surface as triangles to look at; a plane has no border and is not drawn.
    fn new(index: usize, part: &Part) -> Option<Self> {
        let mesh = match &part.surface {
            Surface::Plane { .. } => return None,
            Surface::Frustum { start, end, start_radius, end_radius } => {
                Frustum::new(*start, *end, *start_radius, *end_radius).to_mesh(SEGMENTS)
            }
            Surface::Mesh(mesh) => mesh.clone(),
        };
        Some(Self { index, name: part.name.clone(), motion: part.motion.clone(), mesh })
    }
}
