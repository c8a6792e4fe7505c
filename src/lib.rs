//! Discrete element (DEM) simulations of plants, stage by stage.
//!
//! Modules in the order of the data flow: a scene file becomes a valid [`scene::Scene`], a [`plan`] says what follows
//! from it, a [`backend`] computes it, [`analysis`] measures it and [`report`] shows it. Below the line, the physics
//! ground floor: [`dem`], [`geometry`], [`particle`], [`material`], [`math`].
#![forbid(unsafe_op_in_unsafe_fn)]

pub mod exit_code;

pub mod verify;

pub mod analysis;
pub mod output;
pub mod scene;
// --- physics ground floor: no upward imports ---
pub mod dem;
pub mod geometry;
pub mod material;
pub mod math;
pub mod particle;
