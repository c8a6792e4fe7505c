//! Discrete element (DEM) simulations of plants, stage by stage.
//!
//! Modules against the order of the data flow: a scene file becomes a valid [`scene::Scene`], a [`plan`] says what follows
//! from it, a [`backend`] computes it and writes [`output`], [`analysis`] measures it, [`report`] shows it, and [`run`] is the
//! one place that knows them all. On the ground floor is the physics: [`dem`], [`geometry`], [`particle`], [`material`], [`math`].
#![forbid(unsafe_op_in_unsafe_fn)]

pub mod exit_code;

pub mod analysis;
pub mod backend;
pub mod campaign;
pub mod gate;
pub mod output;
pub mod plan;
pub mod report;
pub mod run;
pub mod scene;
pub mod stage;
pub mod verify;
// --- physics ground floor: no upward imports ---
pub mod dem;
pub mod geometry;
pub mod material;
pub mod math;
pub mod particle;
pub mod storage;
