//! Parts of a plant: shapes, triangle meshes, STL files, and motion as a closed function of time.

pub mod frustum;
pub mod inspection;
pub mod mesh;
pub mod motion;
pub mod part;
pub mod plane;
pub mod solid;
pub mod stl;
pub mod tree;
pub mod triangle;
