//! The inside of a closed mesh, ready to be asked millions of times.

use super::part::TriangleMesh;
use super::tree::TriangleTree;
use super::triangle::Triangle;
use crate::math::{Bounds, Vec3};
use std::f64::consts::PI;

/// Directions in which rays are sent, one after the other until one misses all edges. Powers of the plastic number
/// (the root of p^3 = p + 1) and their permutations: no plane or edge of a drawn part is along them.
const DIRECTIONS: [Vec3; 3] = [
    Vec3::new(0.754_877_666_246_692_7, 0.569_840_290_998_053_2, 0.324_717_957_244_746),
    Vec3::new(-0.324_717_957_244_746, 0.754_877_666_246_692_7, 0.569_840_290_998_053_2),
    Vec3::new(0.569_840_290_998_053_2, -0.324_717_957_244_746, 0.754_877_666_246_692_7),
];

/// Share of its greatest possible value below which the sign of a triple product may be round-off.
const EDGE_ON: f64 = 1e-13;

/// A closed mesh with a tree over its triangles.
#[derive(Debug, Clone)]
pub struct Solid {
    tree: TriangleTree,
}

/// How a ray meets a triangle.
enum Meeting {
    Misses,
    Crosses,
    /// Too near an edge, or edge-on.
    Unclear,
}

impl Solid {
    /// Prepares a mesh. What is inside of one with holes is not defined, see [`TriangleMesh::inspect`]; the direction of
    /// the normals does not matter.
    #[must_use]
    pub fn new(mesh: &TriangleMesh) -> Self {
        Self { tree: TriangleTree::new(mesh.prepared_triangles()) }
    }

    /// A box around it [m], at most some round-off larger than the smallest.
    #[must_use]
    pub fn bounds(&self) -> Bounds {
        self.tree.bounds()
    }

    /// Distance [m] of a point from the surface, on whichever side; infinite for an empty mesh.
    #[must_use]
    pub fn distance_to(&self, point: &Vec3) -> f64 {
        self.tree.squared_distance(point, f64::INFINITY).sqrt()
    }

    /// True where a sphere [m] lies inside as a whole; it may touch the surface.
    #[must_use]
    pub fn sphere_inside(&self, centre: &Vec3, radius: f64) -> bool {
        let squared_radius = radius * radius;
        self.bounds().contains(centre)
            && self.tree.squared_distance(centre, squared_radius) >= squared_radius
            && self.contains(centre)
    }

    /// True where a point lies inside: a ray from it crosses the surface an odd number of times.
    ///
    /// The ray along D crosses the plane of a triangle within it where D.(a x b), D.(b x c) and D.(c x a) have one sign
    /// (corners as seen from the point). Two neighbours compute the product of their common edge with the same numbers
    /// in opposite order, hence with exactly opposite signs: no ray slips between them or counts twice. Where a product
    /// is too near zero to have a sign, another direction is taken, and in the end the winding number.
    #[must_use]
    pub fn contains(&self, point: &Vec3) -> bool {
        if !self.bounds().contains(point) {
            return false;
        }
        let crossings = DIRECTIONS.iter().find_map(|direction| self.crossings(point, direction));
        crossings.map_or_else(|| self.winding_number(point).abs() > 0.5, |count| count % 2 == 1)
    }

    /// How often a ray crosses the surface; `None` where that is unclear.
    fn crossings(&self, point: &Vec3, direction: &Vec3) -> Option<usize> {
        let mut count = 0;
        let mut clear = true;
        self.tree.traverse(
            |bounds| may_cross(bounds, point, direction),
            |_, triangle| match meet(triangle, point, direction) {
                Meeting::Misses => {}
                Meeting::Crosses => count += 1,
                Meeting::Unclear => clear = false,
            },
        );
        clear.then_some(count)
    }

    /// How often the surface winds around a point [-]: 0 outside, 1 inside (-1 with normals inwards).
    ///
    /// Sum of the solid angles Omega of all triangles over 4 pi, with
    /// tan(Omega / 2) = a.(b x c) / (|a| |b| |c| + (a.b) |c| + (b.c) |a| + (c.a) |b|), corners as seen from the point.
    /// Source: A. van Oosterom, J. Strackee, IEEE Trans. Biomed. Eng. 30 (1983) 125.
    #[must_use]
    pub fn winding_number(&self, point: &Vec3) -> f64 {
        let solid_angle = |triangle: &Triangle| {
            let [a, b, c] = triangle.corners().map(|corner| corner - point);
            let (la, lb, lc) = (a.norm(), b.norm(), c.norm());
            let below = la * lb * lc + a.dot(&b) * lc + b.dot(&c) * la + c.dot(&a) * lb;
            2.0 * a.dot(&b.cross(&c)).atan2(below)
        };
        self.tree.triangles().iter().map(solid_angle).sum::<f64>() / (4.0 * PI)
    }
}

fn meet(triangle: &Triangle, point: &Vec3, direction: &Vec3) -> Meeting {
    let [a, b, c] = triangle.corners().map(|corner| corner - point);
    let mut signs = [0.0; 3];
    let mut unclear = false;
    for (sign, (from, to)) in signs.iter_mut().zip([(a, b), (b, c), (c, a)]) {
        let product = direction.dot(&from.cross(&to));
        unclear |= product.abs() <= EDGE_ON * from.norm() * to.norm();
        *sign = product;
    }
    let all = |test: fn(&f64) -> bool| signs.iter().all(test);
    if unclear {
        // an edge the ray passes on its far side is no trouble
        let margin = EDGE_ON * a.norm().max(b.norm()).max(c.norm()).powi(2);
        let apart = signs.iter().any(|s| *s > margin) && signs.iter().any(|s| *s < -margin);
        return if apart { Meeting::Misses } else { Meeting::Unclear };
    }
    if !all(|s| *s > 0.0) && !all(|s| *s < 0.0) {
        return Meeting::Misses;
    }
    if triangle.is_degenerate() {
        return Meeting::Unclear;
    }
    // along the ray the plane lies at (n.a) / (n.D)
    let ahead = triangle.normal().dot(&a) * triangle.normal().dot(direction) > 0.0;
    if ahead { Meeting::Crosses } else { Meeting::Misses }
}

/// True unless the ray misses the box for sure. The boxes of the tree are larger than their content by its round-off, and
/// no component of a direction is near zero.
fn may_cross(bounds: &Bounds, point: &Vec3, direction: &Vec3) -> bool {
    let (mut enters, mut leaves) = (0.0_f64, f64::INFINITY);
    for axis in 0..3 {
        let one = (bounds.minimum[axis] - point[axis]) / direction[axis];
        let two = (bounds.maximum[axis] - point[axis]) / direction[axis];
        enters = enters.max(one.min(two));
        leaves = leaves.min(one.max(two));
    }
    enters <= leaves * (1.0 + 1e-12)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::{Rotation, vec3};
    use proptest::prelude::*;
    use std::f64::consts::TAU;

    /// A sphere of radius 1 as a polyhedron with its vertices on the sphere.
    fn globe(columns: u32, rows: u32) -> TriangleMesh {
        let vertex = |i: u32, k: u32| {
            let (longitude, latitude) =
                (TAU * f64::from(i % columns) / f64::from(columns), PI * f64::from(k) / f64::from(rows));
            match k {
                0 => Vec3::z(),
                _ if k == rows => -Vec3::z(),
                _ => vec3(latitude.sin() * longitude.cos(), latitude.sin() * longitude.sin(), latitude.cos()),
            }
        };
        let mut soup = Vec::new();
        for i in 0..columns {
            for k in 0..rows {
                let [a, b, c, d] = [vertex(i, k), vertex(i, k + 1), vertex(i + 1, k + 1), vertex(i + 1, k)];
                if k + 1 < rows {
                    soup.push([a, b, c]);
                }
                if k > 0 {
                    soup.push([a, c, d]);
                }
            }
        }
        TriangleMesh::from_soup(&soup)
    }

    /// A box with a box-shaped cavity, turned.
    fn hollow_box(rotation: &Rotation) -> TriangleMesh {
        let one = vec3(1.0, 1.0, 1.0);
        let (outer, inner) = (TriangleMesh::box_mesh(&-one, &one), TriangleMesh::box_mesh(&(-one / 2.0), &(one / 2.0)));
        let turned = |[a, b, c]: [Vec3; 3]| [a, c, b];
        let soup: Vec<[Vec3; 3]> =
            (0..12).map(|t| outer.corners(t)).chain((0..12).map(|t| turned(inner.corners(t)))).collect();
        TriangleMesh::from_soup(&soup).transform(1.0, rotation, &Vec3::zeros())
    }

    proptest! {
        #[test]
        fn a_hollow_box_in_closed_form(x in -1.2..1.2_f64, y in -1.2..1.2_f64, z in -1.2..1.2_f64, radius in 0.0..0.3_f64) {
            let rotation = Rotation::from_euler_angles(0.2, 0.9, -0.4);
            let solid = Solid::new(&hollow_box(&rotation));
            let local = vec3(x, y, z);
            let point = rotation * local;
            let inside = local.amax() < 1.0 && local.amax() > 0.5;
            // from outside of the cavity or the box: to the clamped point; from within: to the nearest face
            let beyond = |half: f64| (local - local.map(|c| c.clamp(-half, half))).norm();
            let within = |half: f64| local.iter().map(|c| half - c.abs()).fold(f64::INFINITY, f64::min);
            let to = |half: f64| if local.amax() > half { beyond(half) } else { within(half) };
            let distance = to(1.0).min(to(0.5));
            prop_assume!(distance > 1e-12 && (distance - radius).abs() > 1e-12);
            prop_assert!((solid.distance_to(&point) - distance).abs() < 1e-14);
            prop_assert_eq!(solid.contains(&point), inside);
            prop_assert!((solid.winding_number(&point) - f64::from(u8::from(inside))).abs() < 1e-12);
            prop_assert_eq!(solid.sphere_inside(&point, radius), inside && distance >= radius);
        }

        #[test]
        fn a_globe_contains_what_is_within_its_inner_radius(x in -1.1..1.1_f64, y in -1.1..1.1_f64, z in -1.1..1.1_f64) {
            let (columns, rows) = (40, 20);
            let solid = Solid::new(&globe(columns, rows));
            let point = vec3(x, y, z);
            // a facet's middle sinks below the sphere by at most the product of the cosines of half its two angles
            let inner = (PI / f64::from(columns)).cos() * (PI / f64::from(rows) / 2.0).cos();
            if point.norm() < inner {
                prop_assert!(solid.contains(&point));
            } else if point.norm() > 1.0 {
                prop_assert!(!solid.contains(&point));
            }
            let unclear_free = solid.winding_number(&point).abs() > 0.5;
            prop_assert_eq!(solid.contains(&point), unclear_free);
        }
    }

    #[test]
    fn rays_through_vertices_and_edges_are_not_fooled() {
        let mesh = globe(12, 6);
        let solid = Solid::new(&mesh);
        for direction in &DIRECTIONS {
            for t in 0..mesh.triangles.len() {
                let [a, b, c] = mesh.corners(t);
                for target in [a, (a + b) / 2.0, (b + c) / 2.0] {
                    let (before, after) = (target - direction * 1e-3, target + direction * 1e-3);
                    assert_eq!(solid.contains(&before), solid.winding_number(&before).abs() > 0.5);
                    assert_eq!(solid.contains(&after), solid.winding_number(&after).abs() > 0.5);
                }
            }
        }
    }

    #[test]
    fn an_empty_mesh_contains_nothing() {
        let solid = Solid::new(&TriangleMesh::default());
        assert!(!solid.contains(&Vec3::zeros()) && !solid.sphere_inside(&Vec3::zeros(), 0.0));
        assert_eq!(solid.distance_to(&Vec3::zeros()), f64::INFINITY);
    }
}
