//! How results are shown: figures and pictures as SVG, written by our own small writer.

pub mod colour;
pub mod comparison;
pub mod figure;
pub mod outline;
pub mod panels;
pub mod picture;
mod svg;
