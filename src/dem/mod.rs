//! The native DEM solver.

pub mod feed;
pub mod law;
pub mod wall;
