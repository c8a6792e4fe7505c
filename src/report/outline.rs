//! Outlines of parts as seen in a view: edges that a draughtsman would draw, and faces to tint.

use crate::geometry::motion::Pose;
use crate::geometry::part::{Surface, TriangleMesh};
use crate::geometry::plane::{Aperture, GatePlane};
use crate::math::{Bounds, Vec3, vec3};
use std::collections::BTreeMap;

/// Points joined by straight lines [m].
pub type Polyline = Vec<Vec3>;

/// Two faces that meet at more than this angle [rad] show their edge: 25 degrees, above the facets of a round part.
const FEATURE_ANGLE: f64 = 25.0 * std::f64::consts::PI / 180.0;
/// Triangles of one part up to which its faces are tinted.
const MOST_TINTED: usize = 2000;
/// Pieces of a circle.
const CIRCLE: usize = 72;

/// A part as seen in a view.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Outline {
    /// Edges.
    pub lines: Vec<Polyline>,
    /// Faces to tint behind the particles; left out for fine meshes.
    pub faces: Vec<[Vec3; 3]>,
}

/// Outline of a surface placed at `pose`, as seen against `sight` (unit vector from the scene to the viewer).
///
/// A mesh shows its border edges, its edges between faces at more than 25 degrees, and its silhouette (edges between a
/// face towards the viewer and one away from him). A frustum shows its end circles and its silhouette. A plane seen edge
/// on shows its line within `bounds` [m], otherwise nothing.
#[must_use]
pub fn outline(surface: &Surface, pose: &Pose, sight: &Vec3, bounds: &Bounds) -> Outline {
    let place = |point: &Vec3| pose.rotation * point + pose.translation;
    match surface {
        Surface::Plane { point, normal } => {
            Outline { lines: plane_line(&place(point), &(pose.rotation * normal), sight, bounds), faces: Vec::new() }
        }
        Surface::Frustum { start, end, start_radius, end_radius } => {
            let lines = frustum_lines([place(start), place(end)], [*start_radius, *end_radius], sight);
            Outline { lines, faces: Vec::new() }
        }
        Surface::Mesh(mesh) => {
            let vertices: Vec<Vec3> = mesh.vertices.iter().map(place).collect();
            mesh_outline(mesh, &vertices, sight)
        }
    }
}

/// Border of a gate's opening; of an unbounded one its line within `bounds` [m] where it is seen edge on, otherwise nothing.
#[must_use]
pub fn gate_outline(plane: &GatePlane, sight: &Vec3, bounds: &Bounds) -> Polyline {
    let point = plane.point;
    match plane.aperture {
        Aperture::Unbounded => plane_line(&point, &plane.normal, sight, bounds).pop().unwrap_or_default(),
        Aperture::Disc { radius } => {
            let side = any_perpendicular(&plane.normal);
            let other = plane.normal.cross(&side);
            let angle = |n: usize| n as f64 * std::f64::consts::TAU / CIRCLE as f64;
            (0..CIRCLE).map(|n| point + radius * (angle(n).cos() * side + angle(n).sin() * other)).collect()
        }
        Aperture::Rectangle { side_a, side_b } => {
            let corner = |a: f64, b: f64| point + a * side_a + b * side_b;
            vec![corner(-0.5, -0.5), corner(0.5, -0.5), corner(0.5, 0.5), corner(-0.5, 0.5)]
        }
    }
}

fn mesh_outline(mesh: &TriangleMesh, vertices: &[Vec3], sight: &Vec3) -> Outline {
    let corners = |triangle: &[u32; 3]| triangle.map(|k| vertices[k as usize]);
    let normal = |triangle: &[u32; 3]| {
        let [a, b, c] = corners(triangle);
        (b - a).cross(&(c - a)).try_normalize(0.0).unwrap_or_else(Vec3::zeros)
    };
    // Normals of the faces at each edge, as if all faces at it were wound alike: STL files often are not.
    let mut edges: BTreeMap<[u32; 2], Vec<Vec3>> = BTreeMap::new();
    for triangle in &mesh.triangles {
        let normal = normal(triangle);
        for k in 0..3 {
            let (from, to) = (triangle[k], triangle[(k + 1) % 3]);
            let known = edges.entry([from.min(to), from.max(to)]).or_default();
            // Neighbours wound alike run along their edge in opposite directions.
            let along = if known.is_empty() == (from < to) { normal } else { -normal };
            known.push(along);
        }
    }
    let shown = |normals: &[Vec3]| match normals {
        [one, other] => {
            // The first normal was turned to its edge's order, so both are turned or neither: the angle is right.
            let turned = one.angle(other) > FEATURE_ANGLE;
            turned || one.dot(sight) * other.dot(sight) < 0.0
        }
        _ => true,
    };
    let lines = edges
        .iter()
        .filter(|(_, normals)| shown(normals))
        .map(|(edge, _)| edge.iter().map(|k| vertices[*k as usize]).collect())
        .collect();
    let tinted = mesh.triangles.len() <= MOST_TINTED;
    Outline { lines, faces: if tinted { mesh.triangles.iter().map(corners).collect() } else { Vec::new() } }
}

fn frustum_lines(ends: [Vec3; 2], radii: [f64; 2], sight: &Vec3) -> Vec<Polyline> {
    let axis = ends[1] - ends[0];
    let direction = axis.try_normalize(0.0).unwrap_or_else(|| vec3(0.0, 0.0, 1.0));
    let side = any_perpendicular(&direction);
    let other = direction.cross(&side);
    let rim = |k: usize, angle: f64| ends[k] + radii[k] * (angle.cos() * side + angle.sin() * other);
    let circle = |k: usize| -> Polyline {
        (0..=CIRCLE).map(|n| rim(k, n as f64 * std::f64::consts::TAU / CIRCLE as f64)).collect()
    };
    let mut lines: Vec<Polyline> = (0..2).filter(|k| radii[*k] > 0.0).map(circle).collect();
    // The surface normal at angle a is L (cos a side + sin a other) - (r1 - r0) direction; it is square to the sight
    // where A cos a + B sin a = C.
    let (a, b) = (axis.norm() * side.dot(sight), axis.norm() * other.dot(sight));
    let c = (radii[1] - radii[0]) * direction.dot(sight);
    if a.hypot(b) > c.abs() {
        let (middle, half) = (b.atan2(a), (c / a.hypot(b)).acos());
        lines.extend([middle - half, middle + half].map(|angle| vec![rim(0, angle), rim(1, angle)]));
    }
    lines
}

fn plane_line(point: &Vec3, normal: &Vec3, sight: &Vec3, bounds: &Bounds) -> Vec<Polyline> {
    let (Some(along), true) = (normal.cross(sight).try_normalize(1e-6), normal.dot(sight).abs() < 1e-6) else {
        return Vec::new();
    };
    let middle = 0.5 * (Vec3::from(bounds.minimum) + Vec3::from(bounds.maximum));
    let foot = middle - (middle - point).dot(normal) * normal;
    let reach = 0.5 * bounds.size().norm();
    if !reach.is_finite() || (foot - middle).norm() > reach {
        return Vec::new();
    }
    vec![vec![foot - reach * along, foot + reach * along]]
}

fn any_perpendicular(direction: &Vec3) -> Vec3 {
    let smallest = direction.iamin();
    let mut helper = Vec3::zeros();
    helper[smallest] = 1.0;
    direction.cross(&helper).normalize()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::Rotation;

    const SIDE: Vec3 = vec3(0.0, -1.0, 0.0);
    const WIDE: Bounds = Bounds { minimum: [-10.0; 3], maximum: [10.0; 3] };

    fn still() -> Pose {
        Pose { rotation: Rotation::identity(), translation: Vec3::zeros() }
    }

    /// A unit cube; every second triangle is wound the other way round when `mixed`.
    fn cube(mixed: bool) -> Surface {
        let vertices = (0..8).map(|k| vec3(f64::from(k & 1), f64::from(k >> 1 & 1), f64::from(k >> 2 & 1))).collect();
        let faces: [[u32; 4]; 6] = [[0, 4, 6, 2], [1, 3, 7, 5], [0, 1, 5, 4], [2, 6, 7, 3], [0, 2, 3, 1], [4, 5, 7, 6]];
        let mut triangles: Vec<[u32; 3]> = faces.iter().flat_map(|[a, b, c, d]| [[*a, *b, *c], [*a, *c, *d]]).collect();
        if mixed {
            triangles.iter_mut().step_by(2).for_each(|t| t.swap(0, 1));
        }
        Surface::Mesh(TriangleMesh { vertices, triangles })
    }

    #[test]
    fn a_cube_shows_its_twelve_edges_and_no_diagonals() {
        for mixed in [false, true] {
            let drawn = outline(&cube(mixed), &still(), &SIDE, &WIDE);
            assert_eq!(drawn.lines.len(), 12, "mixed winding: {mixed}");
            assert!(drawn.lines.iter().all(|line| ((line[1] - line[0]).norm() - 1.0).abs() < 1e-12));
        }
    }

    #[test]
    fn an_open_surface_shows_its_border() {
        let vertices = [[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]].map(|[x, z]| vec3(x, 0.0, z)).into();
        let square = Surface::Mesh(TriangleMesh { vertices, triangles: vec![[0, 1, 2], [0, 2, 3]] });
        assert_eq!(outline(&square, &still(), &SIDE, &WIDE).lines.len(), 4);
    }

    #[test]
    fn a_cylinder_seen_from_the_side_is_a_rectangle_and_a_cone_a_trapezium() {
        let seen = |start_radius, end_radius| {
            let (start, end) = (Vec3::zeros(), vec3(0.0, 0.0, 3.0));
            outline(&Surface::Frustum { start, end, start_radius, end_radius }, &still(), &SIDE, &WIDE).lines
        };
        let cylinder = seen(1.0, 1.0);
        assert_eq!(cylinder.len(), 4);
        for line in &cylinder[2..] {
            assert!((line[0].x.abs() - 1.0).abs() < 1e-12 && line[0].y.abs() < 1e-12, "{line:?}");
        }
        let cone = seen(2.0, 0.0);
        assert_eq!(cone.len(), 3, "one circle and two sides");
        assert!((cone[1][0].x.abs() - 2.0).abs() < 1e-12);
    }

    #[test]
    fn a_cone_seen_along_its_axis_has_no_sides() {
        let cone =
            Surface::Frustum { start: Vec3::zeros(), end: vec3(0.0, 3.0, 0.0), start_radius: 2.0, end_radius: 1.0 };
        assert_eq!(outline(&cone, &still(), &SIDE, &WIDE).lines.len(), 2);
    }

    #[test]
    fn planes_show_edge_on_only() {
        let plane = |normal| Surface::Plane { point: vec3(0.0, 0.0, 1.0), normal };
        let floor = outline(&plane(vec3(0.0, 0.0, 1.0)), &still(), &SIDE, &WIDE).lines;
        assert_eq!(floor.len(), 1);
        assert!(floor[0].iter().all(|p| (p.z - 1.0).abs() < 1e-12));
        assert!(outline(&plane(vec3(0.0, 1.0, 0.0)), &still(), &SIDE, &WIDE).lines.is_empty());
    }

    #[test]
    fn a_moved_part_is_drawn_where_it_is() {
        let pose = Pose { rotation: Rotation::identity(), translation: vec3(5.0, 0.0, 0.0) };
        let drawn = outline(&cube(false), &pose, &SIDE, &WIDE);
        assert!(drawn.lines.iter().flatten().all(|p| p.x >= 5.0));
    }

    #[test]
    fn a_gate_shows_its_opening() {
        let normal = vec3(0.0, 0.0, -1.0);
        let border = |aperture| gate_outline(&GatePlane { point: vec3(1.0, 0.0, 2.0), normal, aperture }, &SIDE, &WIDE);
        let disc = border(Aperture::Disc { radius: 0.5 });
        assert!(
            disc.iter().all(|p| ((p - vec3(1.0, 0.0, 2.0)).norm() - 0.5).abs() < 1e-12 && (p.z - 2.0).abs() < 1e-12)
        );
        let rectangle = border(Aperture::Rectangle { side_a: vec3(2.0, 0.0, 0.0), side_b: vec3(0.0, 1.0, 0.0) });
        assert_eq!(rectangle[2], vec3(2.0, 0.5, 2.0));
        let line = border(Aperture::Unbounded);
        assert!(line.len() == 2 && line.iter().all(|p| (p.z - 2.0).abs() < 1e-12), "{line:?}");
    }
}
