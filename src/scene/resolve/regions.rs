//! Regions to fill, faces to stream through, placements, STL files.

use super::Context;
use crate::dem::feed::{Face, Region};
use crate::geometry::part::TriangleMesh;
use crate::math::{Rotation, Vec3};
use crate::scene::meshes::Unusable;
use crate::scene::quantity::Dimension::{Angle, Dimensionless, Length};
use crate::scene::reader::{Limit, Reader};
use nalgebra::Unit;
use std::path::PathBuf;

/// x = rotation * (scale * x0) + translation, as `scale` and `place` say.
#[derive(Debug, Clone, Copy)]
pub(super) struct Placement {
    scale: f64,
    rotation: Rotation,
    translation: Vec3,
}

impl Placement {
    /// A point of the part as described, in the plant [m].
    pub fn point(&self, point: Vec3) -> Vec3 {
        self.rotation * (self.scale * point) + self.translation
    }

    /// A direction.
    pub fn direction(&self, direction: Vec3) -> Vec3 {
        self.rotation * direction
    }

    /// A length [m].
    pub fn length(&self, length: f64) -> f64 {
        self.scale * length
    }

    /// A mesh.
    pub fn mesh(&self, mut mesh: TriangleMesh) -> TriangleMesh {
        for vertex in &mut mesh.vertices {
            *vertex = self.point(*vertex);
        }
        mesh
    }
}

/// Reads `scale` and `place`: scaled first, then turned about its origin, then moved.
pub(super) fn placement(reader: &Reader<'_>) -> Placement {
    let scale = reader.quantity("scale", Dimensionless, Limit::Positive).unwrap_or(1.0);
    let mut placement = Placement { scale, rotation: Rotation::identity(), translation: Vec3::zeros() };
    let Some(place) = reader.table("place", "place") else { return placement };
    if let Some((axis, angle, origin)) = place.table("rotate", "place.rotate").and_then(rotation) {
        placement.rotation = Rotation::from_axis_angle(&Unit::new_normalize(axis), angle);
        placement.translation = origin - placement.rotation * origin;
    }
    placement.translation += place.vector("move", Length).unwrap_or_else(Vec3::zeros);
    place.finish();
    placement
}

/// Reads `rotate`: unit axis, angle [rad], a point of the axis [m].
pub(super) fn rotation(reader: Reader<'_>) -> Option<(Vec3, f64, Vec3)> {
    let axis = reader.need_direction("axis");
    let angle = reader.need_quantity("angle", Angle, Limit::Any);
    let origin = reader.vector("origin", Length).unwrap_or_else(Vec3::zeros);
    reader.finish();
    axis.zip(angle).map(|(axis, angle)| (axis, angle, origin))
}

/// Reads the STL file that `file` names; `None` with a finding where that fails.
pub(super) fn stl(reader: &Reader<'_>, context: &Context<'_>) -> Option<(TriangleMesh, PathBuf)> {
    let name = reader.need_text("file", "shape.stl")?;
    let path = context.base.join(name);
    match context.meshes.of(&path) {
        Ok(mesh) => Some((mesh, path)),
        Err(Unusable::NoFile) => {
            let what = format!("\"{name}\" is no file");
            reader.report.error("stl-unreadable", &reader.place_of("file"), what, "name an ASCII or binary STL file");
            None
        }
        Err(Unusable::Stl(error)) => {
            reader.report.error(
                "stl-unreadable",
                &reader.place_of("file"),
                format!("the STL file cannot be used: {error}"),
                "files are named from the folder of the scene; write the shape as ASCII or binary STL",
            );
            None
        }
    }
}

#[derive(Clone, Copy)]
enum RegionShape {
    Box,
    Cylinder,
    Stl,
}

/// Reads a region to fill.
pub(super) fn region(reader: Reader<'_>, context: &Context<'_>) -> Option<Region> {
    let shapes = [("box", RegionShape::Box), ("cylinder", RegionShape::Cylinder), ("stl", RegionShape::Stl)];
    let region = match reader.need_word("shape", &shapes)? {
        RegionShape::Box => {
            let (minimum, maximum) = (reader.need_vector("min", Length), reader.need_vector("max", Length));
            corners(&reader, minimum, maximum).map(|(minimum, maximum)| Region::Box { minimum, maximum })
        }
        RegionShape::Cylinder => {
            let (start, end) = (reader.need_vector("start", Length), reader.need_vector("end", Length));
            let radius = reader.need_quantity("radius", Length, Limit::Positive);
            axis(&reader, start, end).zip(radius).map(|((start, end), radius)| Region::Cylinder { start, end, radius })
        }
        RegionShape::Stl => {
            let placement = placement(&reader);
            stl(&reader, context).map(|(mesh, _)| Region::Inside(placement.mesh(mesh)))
        }
    };
    reader.finish();
    region
}

/// Two corners in ascending order on every axis.
pub(super) fn corners(reader: &Reader<'_>, minimum: Option<Vec3>, maximum: Option<Vec3>) -> Option<(Vec3, Vec3)> {
    let (minimum, maximum) = minimum.zip(maximum)?;
    for axis in 0..3 {
        if minimum[axis] >= maximum[axis] {
            reader.report.error(
                "out-of-range",
                &reader.place_of("max"),
                format!("`max` must be greater than `min` along {}", ["x", "y", "z"][axis]),
                "give the lower corner as `min` and the upper one as `max`",
            );
            return None;
        }
    }
    Some((minimum, maximum))
}

/// Two ends that are apart.
pub(super) fn axis(reader: &Reader<'_>, start: Option<Vec3>, end: Option<Vec3>) -> Option<(Vec3, Vec3)> {
    let (start, end) = start.zip(end)?;
    if (end - start).try_normalize(0.0).is_none() {
        reader.report.error(
            "zero-vector",
            &reader.place_of("end"),
            "`end` is where `start` is, so the axis has no direction",
            "move one of the two",
        );
        return None;
    }
    Some((start, end))
}

/// Reads a face to stream through.
pub(super) fn face(reader: Reader<'_>) -> Option<Face> {
    let disc = reader.need_word("shape", &[("disc", true), ("rectangle", false)])?;
    let centre = reader.need_vector("centre", Length);
    let face = if disc {
        let normal = reader.need_direction("normal");
        let radius = reader.need_quantity("radius", Length, Limit::Positive);
        (|| Some(Face::Disc { centre: centre?, normal: normal?, radius: radius? }))()
    } else {
        let (side_a, side_b) = (reader.need_vector("side_a", Length), reader.need_vector("side_b", Length));
        let sides = side_a.zip(side_b);
        if let Some((a, b)) = sides
            && a.cross(&b).norm() <= f64::EPSILON * a.norm() * b.norm()
        {
            reader.report.error(
                "zero-vector",
                &reader.place_of("side_b"),
                "`side_a` and `side_b` lie along one line, so they span no face",
                "turn one of the two",
            );
            return None;
        }
        (|| Some(Face::Rectangle { centre: centre?, side_a: side_a?, side_b: side_b? }))()
    };
    reader.finish();
    face
}
