//! Parts of a plant: shapes, triangle meshes, STL files, and motion as a closed function of time.

pub mod motion;
pub mod part;
