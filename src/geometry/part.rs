//! A part: a named surface with a material, a motion and a time of presence.

use super::motion::Motion;
use crate::math::Vec3;
use serde::ser::SerializeStruct as _;
use serde::{Serialize, Serializer};

/// A part of the plant.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Part {
    /// Name in the scene.
    pub name: String,
    /// Index into the scene's materials.
    pub material: u16,
    /// The surface at the time 0 of its motion, in plant coordinates (scale and placement applied).
    pub surface: Surface,
    /// Motion as a closed function of plant time.
    pub motion: Motion,
    /// When the part comes into being.
    pub appears: Trigger,
    /// When the part ceases to exist.
    pub disappears: Trigger,
}

/// A surface particles touch. All but the plane are two-sided.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub enum Surface {
    /// The half space behind a plane is solid.
    Plane {
        /// A point of the plane [m].
        point: Vec3,
        /// Unit normal out of the solid, towards the particles [-].
        normal: Vec3,
    },
    /// Shell of revolution of one straight generator: an open cylinder or cone, or a flat ring or disc.
    Frustum {
        /// First end of the axis [m].
        start: Vec3,
        /// Second end of the axis [m]; equal heights are expressed by [`Surface::Mesh`].
        end: Vec3,
        /// Radius at `start` [m].
        start_radius: f64,
        /// Radius at `end` [m].
        end_radius: f64,
    },
    /// Triangles: an STL file, or a box (its six faces).
    Mesh(TriangleMesh),
}

/// Triangles that share vertices. It is serialised as the number of its triangles and a digest of its content: what it is used for
/// is to tell meshes apart, and there may be millions of triangles.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct TriangleMesh {
    /// Vertices [m]; bit-equal ones are stored once.
    pub vertices: Vec<Vec3>,
    /// Vertex indices of each triangle, in the file's order and orientation.
    pub triangles: Vec<[u32; 3]>,
}

impl Serialize for TriangleMesh {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let mut content = blake3::Hasher::new();
        content.update(&(self.vertices.len() as u64).to_le_bytes());
        for component in self.vertices.iter().flatten() {
            content.update(&component.to_le_bytes());
        }
        for corner in self.triangles.iter().flatten() {
            content.update(&corner.to_le_bytes());
        }
        let mut mesh = serializer.serialize_struct("TriangleMesh", 2)?;
        mesh.serialize_field("triangles", &self.triangles.len())?;
        mesh.serialize_field("blake3", content.finalize().to_hex().as_str())?;
        mesh.end()
    }
}

/// When something happens.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub enum Trigger {
    /// Before the start.
    Always,
    /// Not in this run.
    Never,
    /// At a plant time [s].
    At {
        /// Plant time [s].
        time: f64,
    },
    /// Once the particles are at rest.
    AtRest(AtRest),
}

/// At rest: all feeds due so far have finished, there is at least one particle, and the root-mean-square speed of the
/// particles' centres has stayed below `speed` for `hold`.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct AtRest {
    /// Limit of the root-mean-square speed [m/s].
    pub speed: f64,
    /// How long it must hold [s].
    pub hold: f64,
    /// Not before this plant time [s].
    pub not_before: f64,
}
