//! Whether a sphere lies inside a closed surface.

use crate::geometry::part::TriangleMesh;
use crate::math::Vec3;

/// Asks a closed surface about a sphere.
pub(super) trait SphereInside {
    /// True where the whole sphere of `radius` [m] around `centre` [m] lies inside.
    fn sphere_inside(&self, centre: &Vec3, radius: f64) -> bool;
}

impl SphereInside for TriangleMesh {
    fn sphere_inside(&self, centre: &Vec3, radius: f64) -> bool {
        let corners = |triangle: &[u32; 3]| triangle.map(|index| self.vertices[index as usize] - centre);
        // the solid angle of a closed surface is 4 pi from inside and 0 from outside (van Oosterom and Strackee, 1983)
        let mut angle = 0.0;
        for [a, b, c] in self.triangles.iter().map(corners) {
            if distance_squared(&a, &b, &c) < radius * radius {
                return false;
            }
            let (x, y, z) = (a.norm(), b.norm(), c.norm());
            let volume = a.dot(&b.cross(&c));
            angle += 2.0 * volume.atan2(x * y * z + a.dot(&b) * z + b.dot(&c) * x + c.dot(&a) * y);
        }
        angle.abs() > std::f64::consts::TAU
    }
}

/// Squared distance of the origin from a triangle [m2].
fn distance_squared(a: &Vec3, b: &Vec3, c: &Vec3) -> f64 {
    let normal = (b - a).cross(&(c - a));
    let beside = |p: &Vec3, q: &Vec3| normal.cross(&(q - p)).dot(p) <= 0.0;
    if normal.norm_squared() > 0.0 && beside(a, b) && beside(b, c) && beside(c, a) {
        return a.dot(&normal).powi(2) / normal.norm_squared();
    }
    edge_distance_squared(a, b).min(edge_distance_squared(b, c)).min(edge_distance_squared(c, a))
}

fn edge_distance_squared(p: &Vec3, q: &Vec3) -> f64 {
    let edge = q - p;
    let length_squared = edge.norm_squared();
    let along = if length_squared > 0.0 { (-p.dot(&edge) / length_squared).clamp(0.0, 1.0) } else { 0.0 };
    (p + edge * along).norm_squared()
}
