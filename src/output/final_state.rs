//! The last state of a stage: of our own solver its checkpoint, of an external code a file of the columns that measures need.

use crate::math::vec3;
use crate::particle::{ParticleId, ParticleState};
use crate::storage::StorageError;
use crate::storage::columns::{ColumnReader, ColumnWriter};
use std::path::{Path, PathBuf};

/// Complete state of our own solver.
const CHECKPOINT: &str = "state.checkpoint";
/// Last state of an external code.
const FINAL: &str = "final.columns";
/// What the latter says it is.
const KIND: &str = "final state";

/// Writes the last state of an external code into the result folder `folder`.
///
/// # Errors
/// When the disk refuses.
pub fn write(folder: &Path, particles: &[ParticleState]) -> Result<(), StorageError> {
    let spheres: Vec<f64> = particles
        .iter()
        .flat_map(|particle| [particle.position.x, particle.position.y, particle.position.z, particle.radius])
        .collect();
    let densities: Vec<f64> = particles.iter().map(|particle| particle.density).collect();
    let ids: Vec<u64> = particles.iter().map(|particle| particle.id.0).collect();
    let materials: Vec<u64> = particles.iter().map(|particle| u64::from(particle.material)).collect();
    let mut writer = ColumnWriter::new(KIND);
    writer.column("sphere", spheres).column("density", densities).column("id", ids).column("material", materials);
    writer.write(&folder.join(FINAL))
}

/// The file that holds the last state of the stage in `folder`; `None` where it has none.
#[must_use]
pub fn place(folder: &Path) -> Option<PathBuf> {
    [CHECKPOINT, FINAL].into_iter().map(|name| folder.join(name)).find(|path| path.is_file())
}

/// Particles of a last state, as far as measures of it need them: velocity and spin stay zero.
///
/// # Errors
/// When the file cannot be read or is damaged.
pub fn read(path: &Path) -> Result<Vec<ParticleState>, StorageError> {
    let kind = if path.file_name().is_some_and(|name| name == FINAL) { KIND } else { "checkpoint" };
    let reader = ColumnReader::open(path, kind)?;
    let (spheres, densities) = (reader.f64s("sphere")?, reader.f64s("density")?);
    let (ids, materials) = (reader.u64s("id")?, reader.u64s("material")?);
    if [spheres.len(), 4 * ids.len(), 4 * materials.len()].iter().any(|length| *length != 4 * densities.len()) {
        let reason = "its columns hold different numbers of particles; run it again";
        return Err(StorageError::unusable(path, reason));
    }
    let particle = |k: usize| ParticleState {
        id: ParticleId(ids[k]),
        material: materials[k] as u16,
        radius: spheres[4 * k + 3],
        density: densities[k],
        position: vec3(spheres[4 * k], spheres[4 * k + 1], spheres[4 * k + 2]),
        velocity: vec3(0.0, 0.0, 0.0),
        spin: vec3(0.0, 0.0, 0.0),
    };
    Ok((0..densities.len()).map(particle).collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_was_written_comes_back_without_its_motion() {
        let folder = tempfile::tempdir().unwrap();
        assert_eq!(place(folder.path()), None);
        let particle = |serial: u64| ParticleState {
            id: ParticleId::new(2, serial),
            material: 1,
            radius: 0.002 + serial as f64 * 1e-4,
            density: 2500.0,
            position: vec3(0.1, -0.2, serial as f64),
            velocity: vec3(0.0, 0.0, 0.0),
            spin: vec3(0.0, 0.0, 0.0),
        };
        let particles: Vec<ParticleState> = (0..5).map(particle).collect();
        write(folder.path(), &particles).unwrap();
        assert_eq!(read(&place(folder.path()).unwrap()).unwrap(), particles);
    }
}
