//! What enters at a batch: a file of particles for `read_data .. add`, and the lines that read it and put the particles into groups.
//! Batches at which nothing enters have no file; a list of time steps, which a file variable of the deck reads, tells the others.

use crate::backend::liggghts::{Schedule, files};
use crate::particle::ParticleState;
use crate::storage::{StorageError, staging::write_whole};
use std::fmt::Write;
use std::path::Path;

/// Particles that enter at a batch: their tags follow each other.
#[derive(Debug, Default)]
pub struct Batch {
    /// Tag and state.
    particles: Vec<(u32, ParticleState)>,
    /// Group, first and last tag.
    groups: Vec<(&'static str, u32, u32)>,
}

impl Batch {
    /// Adds a particle to a group; tags ascend.
    pub fn add(&mut self, tag: u32, state: ParticleState, group: &'static str) {
        self.particles.push((tag, state));
        match self.groups.last_mut().filter(|(last, ..)| *last == group) {
            Some((_, _, last)) => *last = tag,
            None => self.groups.push((group, tag, tag)),
        }
    }

    /// True where nothing enters.
    pub const fn is_empty(&self) -> bool {
        self.particles.is_empty()
    }

    /// Writes `STEP.in` and, where something enters, `STEP.data`.
    pub fn write(&self, folder: &Path, step: u64, schedule: &Schedule) -> Result<(), StorageError> {
        let name = folder.file_name().unwrap_or_default().to_string_lossy();
        let (count, time) = (self.particles.len(), schedule.time(step));
        let mut text = format!("# step {step}, {} s: {count} particles enter\n", number(time));
        if count > 0 {
            let _ = writeln!(text, "read_data {name}/{step}.data add");
            for (group, first, last) in &self.groups {
                let _ = writeln!(text, "group {group} id {first}:{last}");
            }
            write_whole(&folder.join(format!("{step}.data")), self.data().as_bytes())?;
        }
        write_whole(&folder.join(format!("{step}.in")), text.as_bytes())
    }

    fn data(&self) -> String {
        let mut text = format!(
            "particles that enter: tag, type, diameter (m), density (kg/m3), x y z (m); then tag, velocity (m/s), spin (rad/s)\n\n{} atoms\n\nAtoms\n\n",
            self.particles.len()
        );
        for (tag, state) in &self.particles {
            let [x, y, z] = [0, 1, 2].map(|axis: usize| number(state.position[axis]));
            let (diameter, density) = (number(2.0 * state.radius), number(state.density));
            let _ = writeln!(text, "{tag} {} {diameter} {density} {x} {y} {z}", state.material + 1);
        }
        text.push_str("\nVelocities\n\n");
        for (tag, state) in &self.particles {
            let _ = write!(text, "{tag}");
            for value in state.velocity.iter().chain(state.spin.iter()) {
                let _ = write!(text, " {}", number(*value));
            }
            text.push('\n');
        }
        text
    }
}

/// Writes the list of the batches behind the first one at which anything enters. It ends with a time step that never comes: at the end
/// of the list the deck's variable would be gone.
pub fn write_steps(folder: &Path, steps: &[u64]) -> Result<(), StorageError> {
    let lines: String = steps.iter().map(|step| format!("{step}\n")).collect();
    write_whole(&folder.join(files::ENTERING), format!("{lines}-1\n").as_bytes())
}

/// A number as the shortest text that reads back to the same bits.
pub fn number(value: f64) -> String {
    if value == 0.0 || (1e-4..1e15).contains(&value.abs()) { format!("{value}") } else { format!("{value:e}") }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::{Vec3, vec3};
    use crate::particle::ParticleId;

    #[test]
    fn numbers_read_back_to_the_same_bits() {
        for value in [0.0, -0.0, 1.0, 0.1 + 0.2, -1e-4, 9.999e-5, 1e15, -3.3e22, f64::MIN_POSITIVE, f64::MAX] {
            assert_eq!(number(value).parse::<f64>().unwrap().to_bits(), value.to_bits(), "{}", number(value));
        }
        assert_eq!((number(0.004), number(2500.0), number(2e-9)), ("0.004".into(), "2500".into(), "2e-9".into()));
    }

    #[test]
    fn a_batch_names_its_groups_by_ranges_and_an_empty_one_reads_nothing() {
        let folder = tempfile::tempdir().unwrap();
        let place = folder.path().join("batches");
        let schedule =
            Schedule { timestep: 1e-5, cadence: crate::gate::Cadence { look: 20, hand_over: 100 }, steps: 1000 };
        let mut batch = Batch::default();
        batch.write(&place, 0, &schedule).unwrap();
        for (tag, group) in [(3, "active"), (4, "active"), (5, "ghost_constant")] {
            let state = ParticleState {
                id: ParticleId::new(0, 7),
                material: 1,
                radius: 0.002,
                density: 2500.0,
                position: vec3(0.1, 0.0, 0.3),
                velocity: vec3(0.0, 0.0, -1.0),
                spin: Vec3::zeros(),
            };
            batch.add(tag, state, group);
        }
        batch.write(&place, 100, &schedule).unwrap();
        let read = |name: &str| std::fs::read_to_string(place.join(name)).unwrap();
        assert_eq!(read("0.in"), "# step 0, 0 s: 0 particles enter\n");
        assert!(!place.join("0.data").exists());
        write_steps(&place, &[100, 300]).unwrap();
        assert_eq!(read("entering"), "100\n300\n-1\n");
        assert_eq!(
            read("100.in").lines().skip(1).collect::<Vec<_>>(),
            ["read_data batches/100.data add", "group active id 3:4", "group ghost_constant id 5:5"]
        );
        let data = read("100.data");
        assert!(data.contains("\n3 atoms\n") && data.contains("\n5 2 0.004 2500 0.1 0 0.3\n"), "{data}");
        assert!(data.ends_with("\n5 0 0 -1 0 0 0\n"), "{data}");
    }
}
