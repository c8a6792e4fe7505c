//! STL files that a scene names: read once, and looked at once, however many scenes are made of one file.

use crate::geometry::inspection::MeshReport;
use crate::geometry::part::TriangleMesh;
use crate::geometry::stl::{StlError, read_stl};
use std::collections::HashMap;
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::thread::{self, ThreadId};

/// Meshes by the path of their file, and what is known of those that parts have been made of.
#[derive(Debug, Default)]
pub(super) struct Meshes {
    read: Mutex<HashMap<PathBuf, Result<TriangleMesh, Unusable>>>,
    /// For each thread and number of a part, the mesh that was looked at last: one, however many scenes there are. Threads that
    /// go through different scenes do not take each other's away.
    seen: Mutex<HashMap<(ThreadId, usize), Arc<Seen>>>,
}

/// Why a file gives no mesh.
#[derive(Debug, Clone)]
pub(super) enum Unusable {
    /// It is a folder or a device.
    NoFile,
    /// It cannot be read as STL.
    Stl(StlError),
}

/// A mesh, and what an inspection of it said.
#[derive(Debug)]
struct Seen {
    mesh: TriangleMesh,
    report: Arc<MeshReport>,
}

impl Meshes {
    /// The mesh in a file.
    pub fn of(&self, path: &Path) -> Result<TriangleMesh, Unusable> {
        let mut known = held(&self.read);
        let read = || match path.metadata() {
            // A device would be read for ever.
            Ok(found) if !found.is_file() => Err(Unusable::NoFile),
            _ => read_stl(path).map_err(Unusable::Stl),
        };
        known.entry(path.to_owned()).or_insert_with(read).clone()
    }

    /// What an inspection of `mesh`, the surface of part number `part`, says. It depends on nothing but the mesh, and is taken
    /// over where the scene before had the very same one.
    pub fn inspection(&self, part: usize, mesh: &TriangleMesh) -> Arc<MeshReport> {
        let place = (thread::current().id(), part);
        let known = held(&self.seen).get(&place).cloned();
        if let Some(seen) = known.filter(|seen| is_same(&seen.mesh, mesh)) {
            return Arc::clone(&seen.report);
        }
        let report = Arc::new(mesh.inspect());
        let seen = Seen { mesh: mesh.clone(), report: Arc::clone(&report) };
        held(&self.seen).insert(place, Arc::new(seen));
        report
    }
}

/// Bit by bit: a number that is merely equal may have another sign.
fn is_same(one: &TriangleMesh, other: &TriangleMesh) -> bool {
    let (mine, others) = (one.vertices.iter().flatten(), other.vertices.iter().flatten());
    one.triangles == other.triangles && mine.map(|x| x.to_bits()).eq(others.map(|x| x.to_bits()))
}

/// What a thread that panicked left is whole: entries are made before they are put there.
fn held<T>(of: &Mutex<T>) -> MutexGuard<'_, T> {
    of.lock().unwrap_or_else(PoisonError::into_inner)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::{Vec3, vec3};

    #[test]
    fn an_inspection_is_taken_over_from_the_very_same_mesh_alone() {
        let meshes = Meshes::default();
        let cube = TriangleMesh::box_mesh(&Vec3::zeros(), &vec3(1.0, 1.0, 1.0));
        let first = meshes.inspection(0, &cube);
        assert!(Arc::ptr_eq(&first, &meshes.inspection(0, &cube.clone())));
        let mut turned = cube.clone();
        turned.triangles.iter_mut().for_each(|triangle| triangle.swap(0, 1));
        let mut negative = cube.clone();
        negative.vertices[0].x = -0.0;
        let mut moved = cube.clone();
        moved.vertices.iter_mut().for_each(|vertex| vertex.x += 1.0);
        for other in [&turned, &negative, &moved, &cube] {
            let found = meshes.inspection(0, other);
            assert!(!Arc::ptr_eq(&first, &found));
            assert_eq!(*found, other.inspect());
        }
        assert_eq!(*meshes.inspection(1, &turned), turned.inspect(), "another part has a mesh of its own");
    }
}
