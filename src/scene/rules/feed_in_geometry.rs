//! `feed-in-geometry` (error): a feed would put particles into the solid side of a plane, or across a surface.
//!
//! Particles lie inside a region as a whole, so a region may touch a wall; a thousandth of the smallest diameter is
//! forgiven. Parts are taken where they are when the feed starts; parts that wait for a condition are left out.

use super::overlap::{Convex, cross, frustum_triangles, triangles};
use super::{Subject, join, mm};
use crate::dem::feed::{FeedKind, Region};
use crate::geometry::motion::Pose;
use crate::geometry::part::{Part, Surface, TriangleMesh};
use crate::geometry::solid::Solid;
use crate::math::Vec3;
use std::borrow::Cow;

/// Share of the smallest diameter that a region may reach into a wall.
const FORGIVEN: f64 = 1e-3;
/// A file's particles that overlap a plane by more than this share of their radius are reported.
const DEEP: f64 = 0.1;

pub(super) fn check(subject: &Subject<'_>) {
    for feed in &subject.draft.feeds {
        let Some((smallest, largest)) = subject.diameters(&feed.item) else { continue };
        let shrink = FORGIVEN * smallest;
        let (key, start) = match &feed.item.kind {
            FeedKind::Fill { start, .. } => ("region", *start),
            FeedKind::Stream { start, .. } => ("face", *start),
            FeedKind::File { .. } => ("file", 0.0),
        };
        let convex = match &feed.item.kind {
            FeedKind::Fill { region, .. } => Convex::region(region, shrink),
            FeedKind::Stream { face, .. } => Convex::face(face, largest / 2.0, shrink),
            FeedKind::File { .. } => None,
        };
        for part in subject.parts_at(start) {
            let part = &part.item.part;
            let surface = moved(part, start);
            let trouble = match &feed.item.kind {
                FeedKind::Fill { region: Region::Inside(mesh), .. } => mesh_trouble(mesh, &surface, shrink),
                FeedKind::Fill { .. } | FeedKind::Stream { .. } => {
                    convex.as_ref().and_then(|convex| convex_trouble(convex, &surface))
                }
                FeedKind::File { particles } => {
                    particles.iter().find_map(|p| particle_trouble(&p.position, p.radius, &surface))
                }
            };
            if let Some(trouble) = trouble {
                subject.error(
                    "feed-in-geometry",
                    &join(&feed.path, key),
                    format!("feed \"{}\" overlaps part \"{}\": {trouble}", feed.item.name, part.name),
                    "move or shrink the region, or let the part appear later",
                );
            }
        }
    }
}

/// The surface of a part at a plant time [s].
fn moved(part: &Part, time: f64) -> Cow<'_, Surface> {
    if part.motion.terms.is_empty() {
        return Cow::Borrowed(&part.surface);
    }
    let pose: Pose = part.motion.pose(time);
    let at = |point: &Vec3| pose.apply(point);
    Cow::Owned(match &part.surface {
        Surface::Plane { point, normal } => Surface::Plane { point: at(point), normal: pose.rotation * normal },
        Surface::Frustum { start, end, start_radius, end_radius } => {
            Surface::Frustum { start: at(start), end: at(end), start_radius: *start_radius, end_radius: *end_radius }
        }
        Surface::Mesh(mesh) => Surface::Mesh(TriangleMesh {
            vertices: mesh.vertices.iter().map(at).collect(),
            triangles: mesh.triangles.clone(),
        }),
    })
}

fn convex_trouble(region: &Convex, surface: &Surface) -> Option<String> {
    match surface {
        Surface::Plane { point, normal } => {
            let depth = region.depth_behind(point, normal);
            // The support still has its full size, so the forgiven share is compared here.
            (depth > region.forgiven()).then(|| behind(depth))
        }
        _ => region.meets_surface(surface).then(|| CUT.to_owned()),
    }
}

const CUT: &str = "the surface cuts it";

fn behind(depth: f64) -> String {
    format!("it reaches {} behind the plane", mm(depth))
}

fn mesh_trouble(region: &TriangleMesh, surface: &Surface, tolerance: f64) -> Option<String> {
    let part: Vec<[Vec3; 3]> = match surface {
        Surface::Plane { point, normal } => {
            let lowest = region.vertices.iter().map(|v| (v - point).dot(normal)).fold(f64::INFINITY, f64::min);
            return (-lowest > tolerance).then(|| behind(-lowest));
        }
        Surface::Frustum { .. } => frustum_triangles(surface),
        Surface::Mesh(mesh) => triangles(mesh).collect(),
    };
    let own: Vec<[Vec3; 3]> = triangles(region).collect();
    (crossing(&own, &part, tolerance) || buried(region, &part, tolerance)).then(|| CUT.to_owned())
}

/// True where two sets of triangles cross: swept along x, so that far ones are never compared.
fn crossing(own: &[[Vec3; 3]], part: &[[Vec3; 3]], tolerance: f64) -> bool {
    let span = |t: &[Vec3; 3], axis: usize| {
        let values = t.map(|corner| corner[axis]);
        (values.iter().copied().fold(f64::INFINITY, f64::min), values.iter().copied().fold(f64::NEG_INFINITY, f64::max))
    };
    let mut sorted: Vec<&[Vec3; 3]> = part.iter().collect();
    sorted.sort_by(|a, b| span(a, 0).0.total_cmp(&span(b, 0).0));
    let widest = part.iter().map(|t| span(t, 0).1 - span(t, 0).0).fold(0.0, f64::max);
    own.iter().any(|one| {
        let (low, high) = span(one, 0);
        let from = sorted.partition_point(|t| span(t, 0).0 < low - widest);
        sorted[from..].iter().take_while(|t| span(t, 0).0 <= high).any(|other| {
            let near = (0..3).all(|axis| {
                let ((a, b), (c, d)) = (span(one, axis), span(other, axis));
                a <= d && c <= b
            });
            near && cross(one, other, tolerance)
        })
    })
}

/// True where a triangle of the part lies within the region without crossing its surface. A few of them tell.
fn buried(region: &TriangleMesh, part: &[[Vec3; 3]], tolerance: f64) -> bool {
    const SAMPLES: usize = 64;
    let solid = Solid::new(region);
    let stride = part.len().div_ceil(SAMPLES).max(1);
    part.iter().step_by(stride).any(|[a, b, c]| solid.sphere_inside(&((a + b + c) / 3.0), tolerance))
}

fn particle_trouble(position: &Vec3, radius: f64, surface: &Surface) -> Option<String> {
    let Surface::Plane { point, normal } = surface else { return None };
    let overlap = radius - (position - point).dot(normal);
    (overlap > DEEP * radius).then(|| format!("a particle of it overlaps the plane by {}", mm(overlap)))
}
