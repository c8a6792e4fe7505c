//! Whether a surface reaches into a convex region: clipping of triangles, and the support of the region.

use crate::dem::feed::{Face, Region};
use crate::geometry::part::{Surface, TriangleMesh};
use crate::math::Vec3;
use std::borrow::Cow;
use std::f64::consts::PI;

/// A convex region: the intersection of half spaces and, perhaps, of an endless cylinder.
pub(super) struct Convex {
    /// Outward unit normal and offset: x . n <= offset inside.
    half_spaces: Vec<(Vec3, f64)>,
    /// Point of the axis, unit direction, radius.
    cylinder: Option<(Vec3, Vec3, f64)>,
    /// By how much it was made smaller [m].
    shrink: f64,
    /// Points whose hull it is, for boxes; for cylinders the centres of the two ends.
    points: Vec<Vec3>,
}

impl Convex {
    /// A region, made smaller by `shrink` [m] on every side; `None` for the inside of a mesh.
    pub fn region(region: &Region, shrink: f64) -> Option<Self> {
        match region {
            Region::Box { minimum, maximum } => {
                let size = maximum - minimum;
                let sides = [Vec3::x() * size.x, Vec3::y() * size.y, Vec3::z() * size.z];
                Self::parallelepiped(&((minimum + maximum) / 2.0), sides, shrink)
            }
            Region::Cylinder { start, end, radius } => Self::cylinder(start, end, *radius, shrink),
            Region::Inside(_) => None,
        }
    }

    /// All that particles of `radius` [m] can cover whose centres lie in a face.
    pub fn face(face: &Face, radius: f64, shrink: f64) -> Option<Self> {
        match face {
            Face::Disc { centre, normal, radius: disc } => {
                Self::cylinder(&(centre - radius * normal), &(centre + radius * normal), *disc, shrink)
            }
            Face::Rectangle { centre, side_a, side_b } => {
                let normal = side_a.cross(side_b).try_normalize(0.0)?;
                Self::parallelepiped(centre, [*side_a, *side_b, 2.0 * radius * normal], shrink)
            }
        }
    }

    fn parallelepiped(centre: &Vec3, sides: [Vec3; 3], shrink: f64) -> Option<Self> {
        let mut half_spaces = Vec::new();
        for k in 0..3 {
            let normal = sides[(k + 1) % 3].cross(&sides[(k + 2) % 3]).try_normalize(0.0)?;
            let half = (sides[k].dot(&normal) / 2.0).abs() - shrink;
            if half <= 0.0 {
                return None;
            }
            half_spaces.push((normal, centre.dot(&normal) + half));
            half_spaces.push((-normal, -centre.dot(&normal) + half));
        }
        let sign = |k: usize, bit: usize| if k & bit == 0 { -0.5 } else { 0.5 };
        let corner = |k| centre + sides[0] * sign(k, 1) + sides[1] * sign(k, 2) + sides[2] * sign(k, 4);
        Some(Self { half_spaces, cylinder: None, shrink, points: (0..8).map(corner).collect() })
    }

    fn cylinder(start: &Vec3, end: &Vec3, radius: f64, shrink: f64) -> Option<Self> {
        let axis = (end - start).try_normalize(0.0)?;
        if radius <= shrink || (end - start).norm() <= 2.0 * shrink {
            return None;
        }
        Some(Self {
            half_spaces: vec![(axis, end.dot(&axis) - shrink), (-axis, -start.dot(&axis) - shrink)],
            cylinder: Some((*start, axis, radius - shrink)),
            shrink,
            points: vec![*start, *end],
        })
    }

    /// How far behind a plane the region reaches [m]; negative where all of it is in front.
    pub fn depth_behind(&self, point: &Vec3, normal: &Vec3) -> f64 {
        let lateral =
            self.cylinder.map_or(0.0, |(_, axis, radius)| radius * (1.0 - axis.dot(normal).powi(2)).max(0.0).sqrt());
        let lowest = self.points.iter().map(|corner| (corner - point).dot(normal)).fold(f64::INFINITY, f64::min);
        lateral - lowest
    }

    /// By how much the region was made smaller [m].
    pub fn forgiven(&self) -> f64 {
        self.shrink
    }

    /// True where some of the triangle lies in the region.
    pub fn meets(&self, triangle: &[Vec3; 3]) -> bool {
        let mut polygon = Cow::Borrowed(&triangle[..]);
        for (normal, offset) in &self.half_spaces {
            let stays = |point: &&Vec3| point.dot(normal) - offset <= 0.0;
            match polygon.iter().filter(stays).count() {
                0 => return false,
                all if all == polygon.len() => continue,
                _ => polygon = Cow::Owned(clip(&polygon, normal, *offset)),
            }
        }
        match &self.cylinder {
            Some((point, axis, radius)) => axis_distance(&polygon, point, axis) < *radius,
            None => true,
        }
    }

    /// True where some triangle of the surface lies in the region.
    pub fn meets_surface(&self, surface: &Surface) -> bool {
        match surface {
            Surface::Plane { .. } => false,
            Surface::Mesh(mesh) => triangles(mesh).any(|triangle| self.meets(&triangle)),
            Surface::Frustum { .. } => frustum_triangles(surface).iter().any(|triangle| self.meets(triangle)),
        }
    }
}

/// Corners of every triangle.
pub(super) fn triangles(mesh: &TriangleMesh) -> impl Iterator<Item = [Vec3; 3]> {
    mesh.triangles.iter().map(|triangle| triangle.map(|vertex| mesh.vertices[vertex as usize]))
}

/// The part of a convex polygon with x . n <= offset (Sutherland and Hodgman 1974).
fn clip(polygon: &[Vec3], normal: &Vec3, offset: f64) -> Vec<Vec3> {
    let mut kept = Vec::with_capacity(polygon.len() + 1);
    for (index, point) in polygon.iter().enumerate() {
        let next = &polygon[(index + 1) % polygon.len()];
        let (here, there) = (point.dot(normal) - offset, next.dot(normal) - offset);
        if here <= 0.0 {
            kept.push(*point);
        }
        if (here < 0.0 && there > 0.0) || (here > 0.0 && there < 0.0) {
            kept.push(point + (next - point) * (here / (here - there)));
        }
    }
    kept
}

/// Distance [m] of a convex polygon from a line: seen along the line, of a polygon from a point.
fn axis_distance(polygon: &[Vec3], point: &Vec3, axis: &Vec3) -> f64 {
    let helper = if axis.x.abs() < 0.9 { Vec3::x() } else { Vec3::y() };
    let u = axis.cross(&helper).normalize();
    let v = axis.cross(&u);
    let seen: Vec<(f64, f64)> = polygon.iter().map(|p| ((p - point).dot(&u), (p - point).dot(&v))).collect();
    let (mut left, mut right, mut nearest) = (false, false, f64::INFINITY);
    for (index, a) in seen.iter().enumerate() {
        let b = seen[(index + 1) % seen.len()];
        let edge = (b.0 - a.0, b.1 - a.1);
        let turn = edge.0 * -a.1 - edge.1 * -a.0;
        left |= turn > 0.0;
        right |= turn < 0.0;
        let length = edge.0 * edge.0 + edge.1 * edge.1;
        let share = if length > 0.0 { (-(a.0 * edge.0 + a.1 * edge.1) / length).clamp(0.0, 1.0) } else { 0.0 };
        nearest = nearest.min((a.0 + share * edge.0).hypot(a.1 + share * edge.1));
    }
    // The point lies inside where all edges turn the same way around it; seen edge-on, the polygon has no inside.
    if left != right { 0.0 } else { nearest }
}

/// Triangles around a frustum; they touch it from outside, so that a region inside that touches it stays clear of them.
pub(super) fn frustum_triangles(surface: &Surface) -> Vec<[Vec3; 3]> {
    const SECTORS: u32 = 180;
    let Surface::Frustum { start, end, start_radius, end_radius } = surface else { return Vec::new() };
    let axis = (end - start).normalize();
    let helper = if axis.x.abs() < 0.9 { Vec3::x() } else { Vec3::y() };
    let u = axis.cross(&helper).normalize();
    let v = axis.cross(&u);
    let step = 2.0 * PI / f64::from(SECTORS);
    let around = 1.0 / (step / 2.0).cos();
    let rim = |centre: &Vec3, radius: f64, k: u32| {
        let (sin, cos) = (step * f64::from(k)).sin_cos();
        centre + radius * around * (cos * u + sin * v)
    };
    let mut found = Vec::with_capacity(2 * SECTORS as usize);
    for k in 0..SECTORS {
        let (a, b) = (rim(start, *start_radius, k), rim(start, *start_radius, k + 1));
        let (c, d) = (rim(end, *end_radius, k), rim(end, *end_radius, k + 1));
        found.push([a, b, d]);
        found.push([a, d, c]);
    }
    found
}

/// True where an edge of one of the triangles passes through the other, by more than `tolerance` [m].
pub(super) fn cross(one: &[Vec3; 3], other: &[Vec3; 3], tolerance: f64) -> bool {
    let edge_through = |edge: (Vec3, Vec3), triangle: &[Vec3; 3]| {
        let [a, b, c] = triangle;
        let Some(normal) = (b - a).cross(&(c - a)).try_normalize(0.0) else { return false };
        let (s, t) = ((edge.0 - a).dot(&normal), (edge.1 - a).dot(&normal));
        if !(s > tolerance && t < -tolerance || s < -tolerance && t > tolerance) {
            return false;
        }
        let hit = edge.0 + (edge.1 - edge.0) * (s / (s - t));
        [(a, b), (b, c), (c, a)].iter().all(|(p, q)| {
            let inward = normal.cross(&(*q - *p)).normalize();
            (hit - *p).dot(&inward) > tolerance
        })
    };
    (0..3).any(|k| edge_through((one[k], one[(k + 1) % 3]), other) || edge_through((other[k], other[(k + 1) % 3]), one))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::vec3;

    fn unit_box() -> Convex {
        let region = Region::Box { minimum: Vec3::zeros(), maximum: vec3(1.0, 1.0, 1.0) };
        Convex::region(&region, 1e-9).expect("a box")
    }

    #[test]
    fn a_triangle_that_only_touches_a_box_does_not_meet_it() {
        let region = unit_box();
        let at = |z: f64| [vec3(-5.0, -5.0, z), vec3(5.0, -5.0, z), vec3(0.0, 9.0, z)];
        assert!(!region.meets(&at(1.0)));
        assert!(!region.meets(&at(0.0)));
        assert!(region.meets(&at(0.5)));
        // Large, slanted, past a corner: its bounds overlap those of the box, and it does not.
        let slanted = [vec3(3.1, 0.0, 0.0), vec3(0.0, 3.1, 0.0), vec3(0.0, 0.0, 3.1)];
        assert!(!region.meets(&slanted));
        let cutting = slanted.map(|p| p * (2.9 / 3.1));
        assert!(region.meets(&cutting));
    }

    #[test]
    fn a_cylinder_is_met_by_what_cuts_its_inside() {
        let region = Region::Cylinder { start: Vec3::zeros(), end: vec3(0.0, 0.0, 2.0), radius: 1.0 };
        let region = Convex::region(&region, 1e-9).expect("a cylinder");
        let wall = |x: f64| [vec3(x, -9.0, -9.0), vec3(x, 9.0, -9.0), vec3(x, 0.0, 9.0)];
        assert!(region.meets(&wall(0.99)));
        assert!(!region.meets(&wall(1.01)));
        let lid = |z: f64| [vec3(-9.0, -9.0, z), vec3(9.0, -9.0, z), vec3(0.0, 9.0, z)];
        assert!(region.meets(&lid(1.9)));
        assert!(!region.meets(&lid(2.1)));
        let around = Surface::Frustum {
            start: vec3(0.0, 0.0, -1.0),
            end: vec3(0.0, 0.0, 3.0),
            start_radius: 1.0,
            end_radius: 1.0,
        };
        assert!(!region.meets_surface(&around));
        // A slanted plane reaches as deep as the support of the cylinder says.
        let normal = vec3(1.0, 0.0, 1.0).normalize();
        let depth = region.depth_behind(&Vec3::zeros(), &normal);
        assert!((depth - 0.5_f64.sqrt()).abs() < 1e-8, "{depth}");
    }

    #[test]
    fn crossing_triangles_are_told_from_touching_ones() {
        let flat = [vec3(0.0, 0.0, 0.0), vec3(1.0, 0.0, 0.0), vec3(0.0, 1.0, 0.0)];
        let through = [vec3(0.2, 0.2, -1.0), vec3(0.2, 0.2, 1.0), vec3(5.0, 5.0, 1.0)];
        assert!(cross(&flat, &through, 1e-9));
        let resting = [vec3(0.2, 0.2, 0.0), vec3(0.2, 0.2, 1.0), vec3(5.0, 5.0, 1.0)];
        assert!(!cross(&flat, &resting, 1e-9));
        let shared = [vec3(0.0, 0.0, 0.0), vec3(1.0, 0.0, 0.0), vec3(0.0, 0.0, 1.0)];
        assert!(!cross(&flat, &shared, 1e-9));
        assert!(!cross(&flat, &flat, 1e-9));
    }
}
