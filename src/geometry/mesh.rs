//! Building and measuring triangle meshes.

use super::part::TriangleMesh;
use super::triangle::{Triangle, doubled_area_vector};
use crate::math::{Bounds, Rotation, Vec3};
use std::collections::HashMap;

impl TriangleMesh {
    /// A mesh from separate triangles [m]. Bit-equal vertices become one; -0 counts as 0.
    ///
    /// # Panics
    /// With more than 2^32 vertices.
    #[must_use]
    pub fn from_soup(triangles: &[[Vec3; 3]]) -> Self {
        let mut mesh = Self { vertices: Vec::new(), triangles: Vec::with_capacity(triangles.len()) };
        let mut known: HashMap<[u64; 3], u32> = HashMap::new();
        for corners in triangles {
            let indices = corners.map(|corner| {
                // adding 0 turns -0 into 0 and leaves all else alone
                let corner = corner.add_scalar(0.0);
                *known.entry([corner.x, corner.y, corner.z].map(f64::to_bits)).or_insert_with(|| {
                    mesh.vertices.push(corner);
                    u32::try_from(mesh.vertices.len() - 1).expect("fewer than 2^32 vertices")
                })
            });
            mesh.triangles.push(indices);
        }
        mesh
    }

    /// The closed surface of a box, 12 triangles with normals outwards.
    #[must_use]
    pub fn box_mesh(minimum: &Vec3, maximum: &Vec3) -> Self {
        let ends = [minimum, maximum];
        // vertex 4 x + 2 y + z, each 0 or 1
        let vertices = (0..8_usize)
            .map(|corner| Vec3::new(ends[corner >> 2].x, ends[corner >> 1 & 1].y, ends[corner & 1].z))
            .collect();
        let faces: [[u32; 4]; 6] = [[0, 1, 3, 2], [4, 6, 7, 5], [0, 4, 5, 1], [2, 3, 7, 6], [0, 2, 6, 4], [1, 5, 7, 3]];
        let triangles = faces.iter().flat_map(|&[a, b, c, d]| [[a, b, c], [a, c, d]]).collect();
        Self { vertices, triangles }
    }

    /// Corners of a triangle [m], by its number.
    #[must_use]
    pub fn corners(&self, triangle: usize) -> [Vec3; 3] {
        self.triangles[triangle].map(|vertex| self.vertices[vertex as usize])
    }

    /// All triangles, prepared for distance queries.
    #[must_use]
    pub fn prepared_triangles(&self) -> Vec<Triangle> {
        (0..self.triangles.len()).map(|triangle| Triangle::new(self.corners(triangle))).collect()
    }

    /// The smallest box around all triangles.
    #[must_use]
    pub fn bounds(&self) -> Bounds {
        let mut bounds = Bounds::EMPTY;
        for &vertex in self.triangles.iter().flatten() {
            bounds.include(&self.vertices[vertex as usize]);
        }
        bounds
    }

    /// The mesh scaled about the origin, then rotated, then moved [m].
    /// A negative scale mirrors, and the triangles are turned over so that normals stay on their side.
    #[must_use]
    pub fn transform(&self, scale: f64, rotation: &Rotation, translation: &Vec3) -> Self {
        let vertices = self.vertices.iter().map(|vertex| rotation * (vertex * scale) + translation).collect();
        let turned = |&[a, b, c]: &[u32; 3]| if scale < 0.0 { [a, c, b] } else { [a, b, c] };
        Self { vertices, triangles: self.triangles.iter().map(turned).collect() }
    }

    /// Area of a triangle [m^2], by its number.
    #[must_use]
    pub fn area(&self, triangle: usize) -> f64 {
        doubled_area_vector(&self.corners(triangle)).norm() / 2.0
    }

    /// Unit normal of a triangle, right-handed about its corners, by its number; `None` for a degenerate one.
    #[must_use]
    pub fn normal(&self, triangle: usize) -> Option<Vec3> {
        let triangle = Triangle::new(self.corners(triangle));
        (!triangle.is_degenerate()).then(|| *triangle.normal())
    }

    /// Volume [m^3] enclosed by a closed mesh, positive for normals outwards.
    ///
    /// Sum of the tetrahedra between each triangle and a common point, V = sum (a x b).c / 6 (divergence theorem with
    /// the field x / 3). The common point is the middle of the mesh, so that a part far from the origin loses nothing.
    #[must_use]
    pub fn signed_volume(&self) -> f64 {
        let bounds = self.bounds();
        if bounds.is_empty() {
            return 0.0;
        }
        let middle = (Vec3::from(bounds.minimum) + Vec3::from(bounds.maximum)) / 2.0;
        let six_volumes = (0..self.triangles.len()).map(|triangle| {
            let [a, b, c] = self.corners(triangle).map(|corner| corner - middle);
            a.cross(&b).dot(&c)
        });
        six_volumes.sum::<f64>() / 6.0
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::vec3;
    use std::f64::consts::FRAC_PI_2;

    #[test]
    fn a_box_has_its_volume_area_and_outward_normals() {
        let (minimum, maximum) = (vec3(1.0, 2.0, 3.0), vec3(2.0, 4.0, 6.0));
        let mesh = TriangleMesh::box_mesh(&minimum, &maximum);
        assert_eq!(mesh.triangles.len(), 12);
        assert!((mesh.signed_volume() - 6.0).abs() < 1e-14);
        let area: f64 = (0..12).map(|t| mesh.area(t)).sum();
        assert!((area - 2.0 * (2.0 + 3.0 + 6.0)).abs() < 1e-14);
        let middle = (minimum + maximum) / 2.0;
        for t in 0..12 {
            let outwards = mesh.corners(t)[0] - middle;
            assert!(mesh.normal(t).unwrap().dot(&outwards) > 0.0);
        }
        assert_eq!(mesh.bounds(), Bounds { minimum: [1.0, 2.0, 3.0], maximum: [2.0, 4.0, 6.0] });
    }

    #[test]
    fn a_soup_shares_bit_equal_vertices_only() {
        let mesh = TriangleMesh::box_mesh(&vec3(0.0, 0.0, 0.0), &vec3(1.0, 1.0, 1.0));
        let mut soup: Vec<[Vec3; 3]> = (0..12).map(|t| mesh.corners(t)).collect();
        soup[0][0].x = -0.0;
        let welded = TriangleMesh::from_soup(&soup);
        assert_eq!(welded.vertices.len(), 8);
        assert!((0..12).all(|t| welded.corners(t) == mesh.corners(t)));
        soup[0][0].x = 1e-300;
        assert_eq!(TriangleMesh::from_soup(&soup).vertices.len(), 9);
    }

    #[test]
    fn a_transform_scales_rotates_and_moves_in_this_order() {
        let mesh = TriangleMesh::box_mesh(&vec3(0.0, 0.0, 0.0), &vec3(1.0, 2.0, 3.0));
        let quarter = Rotation::from_axis_angle(&Vec3::z_axis(), FRAC_PI_2);
        let moved = mesh.transform(2.0, &quarter, &vec3(10.0, 0.0, 0.0));
        let bounds = moved.bounds();
        assert!((Vec3::from(bounds.minimum) - vec3(6.0, 0.0, 0.0)).norm() < 1e-14);
        assert!((Vec3::from(bounds.maximum) - vec3(10.0, 2.0, 6.0)).norm() < 1e-14);
        assert!((moved.signed_volume() - 48.0).abs() < 1e-12);
        assert!(mesh.transform(-1.0, &quarter, &Vec3::zeros()).signed_volume() > 0.0);
    }
}
