//! Frames of the solver's state: copied out of it at their time step, written by a thread of their own.

use super::Schedule;
use super::background::BackgroundWriter;
use crate::backend::frames::{Frame, FrameFiles, PartLoad};
use crate::dem::inspect::{ContactRecord, Partner};
use crate::dem::particles::Path as Motion;
use crate::dem::simulation::Simulation;
use crate::math::Vec3;
use crate::output::vtp::ContactLine;
use crate::particle::{ParticleId, ParticleState};
use crate::scene::Scene;
use crate::storage::StorageError;
use std::path::Path;

/// Writes frames at their interval, and the last one.
#[derive(Debug)]
pub struct FrameOutput {
    /// None where the scene asks for no kind of frame.
    writer: Option<BackgroundWriter<Snapshot>>,
    schedule: Schedule,
    last_taken: Option<u64>,
}

impl FrameOutput {
    /// Opens the frame files; those of a resumed simulation are continued after the last frame that was due.
    pub fn open(scene: &Scene, folder: &Path, simulation: &Simulation, resumed: bool) -> Result<Self, StorageError> {
        let schedule = Schedule::new(scene.output.frame_interval, simulation);
        let kept = resumed.then(|| schedule.last_due(simulation.steps_done()));
        let mut files = FrameFiles::open(scene, folder, simulation.setup().timestep, kept)?;
        let is_wanted = scene.output.vtp || scene.output.lammps;
        let start = || BackgroundWriter::start(move |snapshot: Snapshot| snapshot.write(&mut files));
        let writer = is_wanted.then(start).transpose();
        let writer =
            writer.map_err(|source| StorageError::system("start a thread that writes into", folder, source))?;
        Ok(Self { writer, schedule, last_taken: kept })
    }

    /// Takes a frame where the present step is due. An error may be that of an earlier frame.
    pub fn write_due(&mut self, simulation: &Simulation, scene: &Scene) -> Result<(), StorageError> {
        if self.schedule.is_due(simulation.steps_done()) {
            return self.write(simulation, scene);
        }
        // A run that cannot keep its frames need not go on until the next one.
        self.writer.as_mut().map_or(Ok(()), BackgroundWriter::heed)
    }

    /// Takes the last state, unless that is done already.
    pub fn write_last(&mut self, simulation: &Simulation, scene: &Scene) -> Result<(), StorageError> {
        if self.last_taken == Some(simulation.steps_done()) { Ok(()) } else { self.write(simulation, scene) }
    }

    /// Waits until every frame that was taken is written.
    pub fn wait(&mut self) -> Result<(), StorageError> {
        self.writer.as_mut().map_or(Ok(()), BackgroundWriter::wait)
    }

    fn write(&mut self, simulation: &Simulation, scene: &Scene) -> Result<(), StorageError> {
        let Some(writer) = &mut self.writer else { return Ok(()) };
        // Before the copy: there is memory for one at a time.
        writer.wait()?;
        writer.hand_over(Snapshot::of(simulation, scene.output.contacts))?;
        self.last_taken = Some(simulation.steps_done());
        Ok(())
    }
}

/// All that a frame shows, as the solver holds it: what can be worked out of that is left to the writer.
#[derive(Debug)]
struct Snapshot {
    step: u64,
    time: f64,
    /// Particles in the order of storage.
    particles: Vec<ParticleState>,
    /// Force of the contacts on each [N].
    forces: Vec<Vec3>,
    /// How each moves, where there is a gate.
    paths: Option<Vec<Motion>>,
    present: Vec<bool>,
    loads: Vec<PartLoad>,
    /// In the order of the lists.
    contacts: Option<Vec<ContactRecord>>,
}

impl Snapshot {
    fn of(simulation: &Simulation, with_contacts: bool) -> Self {
        let count = simulation.particle_count();
        let (mut particles, mut forces) = (Vec::with_capacity(count), Vec::with_capacity(count));
        let mut paths = simulation.setup().momentum.then(|| Vec::with_capacity(count));
        for (state, force, path) in simulation.stored_states() {
            particles.push(state);
            forces.push(force);
            if let Some(paths) = &mut paths {
                paths.push(path);
            }
        }
        let loads = simulation.part_loads().iter();
        Self {
            step: simulation.steps_done(),
            time: simulation.time(),
            particles,
            forces,
            paths,
            present: (0..simulation.setup().parts.len()).map(|part| simulation.is_present(part as u16)).collect(),
            loads: loads.map(|load| PartLoad { force: load.force, torque: load.torque, power: load.power }).collect(),
            contacts: with_contacts.then(|| simulation.stored_contacts()),
        }
    }

    fn write(self, files: &mut FrameFiles) -> Result<(), StorageError> {
        let mut order: Vec<u32> = (0..self.particles.len() as u32).collect();
        order.sort_unstable_by_key(|&index| self.particles[index as usize].id);
        let particles = reordered(self.particles, &order);
        let contacts = self.contacts.map(|contacts| contact_lines(&particles, contacts));
        let frame = Frame {
            step: self.step,
            time: self.time,
            forces: &reordered(self.forces, &order),
            ghosts: self.paths.map(|paths| reordered(paths, &order).into_iter().map(ghost_number).collect()),
            present: &self.present,
            loads: &self.loads,
            contacts,
            particles: &particles,
        };
        files.write(&frame)
    }
}

fn reordered<T: Copy>(list: Vec<T>, order: &[u32]) -> Vec<T> {
    order.iter().map(|&index| list[index as usize]).collect()
}

/// How a particle moves, as frames say it: 0 by the forces on it, 1 on a prescribed path, 2 tethered to one.
fn ghost_number(path: Motion) -> u8 {
    if path.is_prescribed() { 1 } else { 2 * u8::from(path == Motion::Tethered) }
}

/// Contacts as lines, by ascending identities as `particles` are.
fn contact_lines(particles: &[ParticleState], mut contacts: Vec<ContactRecord>) -> Vec<ContactLine> {
    contacts.sort_by_key(|contact| (contact.i, contact.j));
    let place = |id: ParticleId| {
        let found = particles.binary_search_by_key(&id, |particle| particle.id);
        particles[found.expect("who is in contact is there")].position
    };
    let line = |contact: ContactRecord| ContactLine {
        start: place(contact.i),
        end: match contact.j {
            Partner::Particle(other) => place(other),
            Partner::Part { .. } => contact.point,
        },
        normal: contact.normal,
        overlap: contact.overlap,
        force: contact.force,
    };
    contacts.into_iter().map(line).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::backend::native::processor::Processor;
    use crate::backend::native::setup::setup;
    use crate::particle::ParticleId;
    use std::collections::BTreeMap;
    use std::fs;

    /// Beads that fall onto a floor that comes up.
    const SCENE: &str = r#"
version = 1
[contact]
law = "hertz-mindlin"
[material.glass]
density = "2500 kg/m3"
youngs_modulus = "10 MPa"
poissons_ratio = 0.25
[[pair]]
between = ["glass", "glass"]
restitution = 0.9
friction = 0.3
[particle.bead]
material = "glass"
diameter = { uniform_mm = [4, 6] }
[[feed]]
name = "fill"
kind = "fill"
particle = "bead"
region = { shape = "box", min_mm = [0, 0, 1], max_mm = [50, 50, 30] }
amount = 200
velocity_m_per_s = [0, 0, -1]
[[part]]
name = "floor"
material = "glass"
shape = "box"
min_mm = [-50, -50, -10]
max_mm = [100, 100, 0]
[[part.motion]]
kind = "translate"
velocity_mm_per_s = [0, 0, 1]
[output]
frames = "10 us"
formats = ["vtp", "lammps"]
contacts = true
[solver]
timestep = "10 us"
overlap_limit = 0.4
[end]
time = "1 s"
"#;

    /// The files of 200 time steps, each step's frame handed to `write`.
    fn files(write: impl FnOnce(&Scene, &Path, &mut Simulation)) -> BTreeMap<String, Vec<u8>> {
        let (scene, _) = crate::scene::read_text(SCENE, "scene.toml", Path::new("."), &[]).unwrap();
        let mut setup = setup(&scene, &crate::plan::plan(&scene, None), Processor::new(Some(1), None));
        // As in a stage with a gate.
        setup.momentum = true;
        let mut simulation = Simulation::new(setup);
        simulation.prepare();
        // Until they lie in each other's way.
        (0..300).for_each(|_| simulation.step().unwrap());
        let folder = tempfile::tempdir().unwrap();
        write(&scene, folder.path(), &mut simulation);
        let entries = ["", "frames"].into_iter().flat_map(|name| fs::read_dir(folder.path().join(name)).unwrap());
        let paths = entries.map(|entry| entry.unwrap().path()).filter(|path| path.is_file());
        paths.map(|path| (path.file_name().unwrap().to_str().unwrap().to_owned(), fs::read(path).unwrap())).collect()
    }

    /// What a frame shows, worked out at once and by other means.
    fn write_at_once(scene: &Scene, simulation: &Simulation, files: &mut FrameFiles) -> u64 {
        let particles = simulation.particles();
        let forces: Vec<Vec3> = particles.iter().map(|own| simulation.contact_force(own.id).unwrap()).collect();
        let place = |id: ParticleId| particles.iter().find(|particle| particle.id == id).unwrap().position;
        let line = |contact: &ContactRecord| ContactLine {
            start: place(contact.i),
            end: if let Partner::Particle(other) = contact.j { place(other) } else { contact.point },
            normal: contact.normal,
            overlap: contact.overlap,
            force: contact.force,
        };
        let contacts: Vec<ContactLine> = simulation.contacts().iter().map(line).collect();
        let count = contacts.len() as u64;
        let loads = simulation.part_loads().iter();
        let loads: Vec<PartLoad> =
            loads.map(|load| PartLoad { force: load.force, torque: load.torque, power: load.power }).collect();
        let frame = Frame {
            step: simulation.steps_done(),
            time: simulation.time(),
            particles: &particles,
            forces: &forces,
            ghosts: Some(vec![0; particles.len()]),
            present: &vec![true; scene.parts.len()],
            loads: &loads,
            contacts: Some(contacts),
        };
        files.write(&frame).unwrap();
        count
    }

    #[test]
    fn frames_written_while_the_solver_goes_on_are_those_written_at_once() {
        const STEPS: usize = 200;
        let at_once = files(|scene, folder, simulation| {
            let mut files = FrameFiles::open(scene, folder, simulation.setup().timestep, None).unwrap();
            let mut contacts = write_at_once(scene, simulation, &mut files);
            for _ in 0..STEPS {
                simulation.step().unwrap();
                contacts += write_at_once(scene, simulation, &mut files);
            }
            assert!(contacts > 1000, "{contacts} contacts in all frames");
        });
        // Particles, floor and contacts; collection and dump.
        assert_eq!(at_once.len(), 3 * (STEPS + 1) + 2);
        for waits in [false, true] {
            let while_going_on = files(|scene, folder, simulation| {
                let mut output = FrameOutput::open(scene, folder, simulation, false).unwrap();
                output.write_due(simulation, scene).unwrap();
                for _ in 0..STEPS {
                    simulation.step().unwrap();
                    output.write_due(simulation, scene).unwrap();
                    if waits {
                        output.wait().unwrap();
                    }
                }
                output.write_last(simulation, scene).unwrap();
            });
            assert!(at_once == while_going_on, "frames differ, waiting after each: {waits}");
        }
    }
}
