//! What is wrong with a mesh: holes, edges shared by too many triangles, triangles without area, normals inwards.

use super::part::TriangleMesh;
use super::triangle::{Triangle, doubled_area_vector};
use crate::math::{Bounds, Vec3};
use std::collections::BTreeMap;
use std::f64::consts::PI;

/// Findings about a mesh.
#[derive(Debug, Clone, PartialEq)]
pub struct MeshReport {
    /// Edges of one triangle only. A mesh without any is closed.
    pub open_edges: usize,
    /// Edges of more than two triangles.
    pub non_manifold_edges: usize,
    /// Edges whose two triangles run along them in the same direction, so that their normals disagree.
    pub inconsistent_edges: usize,
    /// Triangles without area (height below 1e-12 of the longest edge).
    pub degenerate: usize,
    /// True where the normals of a closed mesh point inwards; `None` for a mesh that is not closed.
    pub inverted: Option<bool>,
    /// Enclosed volume [m^3], positive for normals outwards; without meaning for a mesh that is not closed.
    pub signed_volume: f64,
    /// The box around the mesh [m].
    pub bounds: Bounds,
    /// The holes, each a chain of open edges; in order of their lowest vertex.
    pub boundary_loops: Vec<BoundaryLoop>,
}

/// The rim of a hole.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct BoundaryLoop {
    /// Centre of the rim, every piece weighted by its length [m].
    pub centre: Vec3,
    /// Length of the rim [m].
    pub length: f64,
    /// Radius of the circle with the area that the rim encloses, sqrt(A / pi) [m].
    pub equivalent_radius: f64,
}

/// The triangles along one edge.
#[derive(Default)]
struct Edge {
    /// That run from the lower to the higher vertex.
    forward: usize,
    /// That run the other way.
    backward: usize,
}

impl MeshReport {
    /// True where every edge has as many triangles on one side as on the other.
    #[must_use]
    pub fn is_closed(&self) -> bool {
        self.inverted.is_some()
    }
}

impl TriangleMesh {
    /// Looks for everything that makes a mesh unfit as a wall or a region.
    #[must_use]
    pub fn inspect(&self) -> MeshReport {
        let edges = self.edges();
        let count = |wrong: fn(&Edge) -> bool| edges.values().filter(|edge| wrong(edge)).count();
        let signed_volume = self.signed_volume();
        let closed = !edges.is_empty() && count(|edge| (edge.forward + edge.backward) % 2 == 1) == 0;
        MeshReport {
            open_edges: count(|edge| edge.forward + edge.backward == 1),
            non_manifold_edges: count(|edge| edge.forward + edge.backward > 2),
            inconsistent_edges: count(|edge| edge.forward + edge.backward == 2 && edge.forward != 1),
            degenerate: (0..self.triangles.len()).filter(|&t| Triangle::new(self.corners(t)).is_degenerate()).count(),
            inverted: closed.then_some(signed_volume < 0.0),
            signed_volume,
            bounds: self.bounds(),
            boundary_loops: self.boundary_loops(&edges),
        }
    }

    /// The edges by their vertices, the lower first. A triangle that uses a vertex twice is a line and bounds nothing.
    fn edges(&self) -> BTreeMap<(u32, u32), Edge> {
        let mut edges: BTreeMap<(u32, u32), Edge> = BTreeMap::new();
        for &[a, b, c] in self.triangles.iter().filter(|[a, b, c]| a != b && b != c && c != a) {
            for (from, to) in [(a, b), (b, c), (c, a)] {
                let edge = edges.entry((from.min(to), from.max(to))).or_default();
                if from < to {
                    edge.forward += 1;
                } else {
                    edge.backward += 1;
                }
            }
        }
        edges
    }

    fn boundary_loops(&self, edges: &BTreeMap<(u32, u32), Edge>) -> Vec<BoundaryLoop> {
        let mut neighbours: BTreeMap<u32, Vec<u32>> = BTreeMap::new();
        for (&(low, high), _) in edges.iter().filter(|(_, edge)| edge.forward + edge.backward == 1) {
            neighbours.entry(low).or_default().push(high);
            neighbours.entry(high).or_default().push(low);
        }
        let mut loops = Vec::new();
        let starts: Vec<u32> = neighbours.keys().copied().collect();
        for start in starts {
            // a vertex where several holes meet begins several chains
            while let Some(chain) = take_chain(&mut neighbours, start) {
                loops.push(self.measure(&chain));
            }
        }
        loops
    }

    fn measure(&self, chain: &[u32]) -> BoundaryLoop {
        let points: Vec<Vec3> = chain.iter().map(|&vertex| self.vertices[vertex as usize]).collect();
        let mut length = 0.0;
        let mut weighted = Vec3::zeros();
        for pair in points.windows(2) {
            let piece = (pair[1] - pair[0]).norm();
            length += piece;
            weighted += (pair[0] + pair[1]) / 2.0 * piece;
        }
        let centre = if length > 0.0 { weighted / length } else { points[0] };
        let doubled_area: Vec3 = points.windows(2).map(|pair| doubled_area_vector(&[centre, pair[0], pair[1]])).sum();
        BoundaryLoop { centre, length, equivalent_radius: (doubled_area.norm() / 2.0 / PI).sqrt() }
    }
}

/// Takes a chain of edges out of the graph, from `start` until it comes back or ends; the first vertex is repeated where
/// it comes back. `None` where no edge is left at `start`.
fn take_chain(neighbours: &mut BTreeMap<u32, Vec<u32>>, start: u32) -> Option<Vec<u32>> {
    let mut chain = vec![start];
    let mut last = start;
    while let Some(next) = neighbours.get_mut(&last).and_then(Vec::pop) {
        if let Some(back) = neighbours.get_mut(&next) {
            back.retain(|&vertex| vertex != last);
        }
        chain.push(next);
        last = next;
        if last == start {
            break;
        }
    }
    (chain.len() > 1).then_some(chain)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::{Rotation, vec3};
    use std::f64::consts::TAU;

    fn unit_box() -> TriangleMesh {
        TriangleMesh::box_mesh(&Vec3::zeros(), &vec3(1.0, 1.0, 1.0))
    }

    #[test]
    fn a_box_is_closed_and_the_right_way_out() {
        let report = unit_box().inspect();
        assert_eq!((report.open_edges, report.non_manifold_edges, report.inconsistent_edges), (0, 0, 0));
        assert_eq!((report.degenerate, report.inverted), (0, Some(false)));
        assert!(report.boundary_loops.is_empty() && report.is_closed());
        let mut turned = unit_box();
        for triangle in &mut turned.triangles {
            triangle.swap(0, 1);
        }
        assert_eq!(turned.inspect().inverted, Some(true));
        let mut one_turned = unit_box();
        one_turned.triangles[0].swap(0, 1);
        assert_eq!(one_turned.inspect().inconsistent_edges, 3);
    }

    #[test]
    fn a_missing_triangle_is_a_hole() {
        let mut mesh = unit_box();
        mesh.triangles.remove(0);
        let report = mesh.inspect();
        assert_eq!((report.open_edges, report.inverted, report.boundary_loops.len()), (3, None, 1));
        let hole = report.boundary_loops[0];
        assert!((hole.length - (2.0 + 2.0_f64.sqrt())).abs() < 1e-15);
        assert!((hole.equivalent_radius - (0.5 / PI).sqrt()).abs() < 1e-15);
    }

    #[test]
    fn a_funnel_has_its_two_openings() {
        let sides = 24_u32;
        let rotation = Rotation::from_euler_angles(0.4, 0.5, 0.6);
        let (wide, narrow) = (0.5, 0.1);
        let vertex = |k: u32, radius: f64, z: f64| {
            let angle = TAU * f64::from(k % sides) / f64::from(sides);
            rotation * vec3(radius * angle.cos(), radius * angle.sin(), z)
        };
        let panel = |k: u32| {
            let [a, b] = [vertex(k, narrow, 0.0), vertex(k + 1, narrow, 0.0)];
            let [c, d] = [vertex(k + 1, wide, 1.0), vertex(k, wide, 1.0)];
            [[a, b, c], [a, c, d]]
        };
        let report = TriangleMesh::from_soup(&(0..sides).flat_map(panel).collect::<Vec<_>>()).inspect();
        assert_eq!((report.open_edges, report.boundary_loops.len()), (48, 2));
        let mut loops = report.boundary_loops;
        loops.sort_by(|a, b| a.length.total_cmp(&b.length));
        for (opening, radius, z) in [(loops[0], narrow, 0.0), (loops[1], wide, 1.0)] {
            // a regular polygon of n sides has the area n R^2 sin(2 pi / n) / 2 and the length 2 n R sin(pi / n)
            let n = f64::from(sides);
            assert!((opening.centre - rotation * vec3(0.0, 0.0, z)).norm() < 1e-14);
            assert!((opening.length - 2.0 * n * radius * (PI / n).sin()).abs() < 1e-13);
            let area = n * radius * radius * (TAU / n).sin() / 2.0;
            assert!((opening.equivalent_radius - (area / PI).sqrt()).abs() < 1e-14);
        }
    }

    #[test]
    fn two_holes_may_share_a_vertex() {
        let at = |x: f64, y: f64| vec3(x, y, 0.0);
        let mesh = TriangleMesh::from_soup(&[
            [at(0.0, 0.0), at(1.0, 0.0), at(0.0, 1.0)],
            [at(0.0, 0.0), at(-1.0, 0.0), at(0.0, -1.0)],
        ]);
        let report = mesh.inspect();
        assert_eq!((report.open_edges, report.boundary_loops.len()), (6, 2));
        let length: f64 = report.boundary_loops.iter().map(|rim| rim.length).sum();
        assert!((length - 2.0 * (2.0 + 2.0_f64.sqrt())).abs() < 1e-14);
    }

    #[test]
    fn fins_and_lines_are_counted() {
        let mut mesh = unit_box();
        mesh.vertices.push(vec3(0.0, -1.0, -1.0));
        mesh.triangles.extend([[0, 4, 8], [1, 1, 2], [0, 0, 0]]);
        let report = mesh.inspect();
        assert_eq!((report.non_manifold_edges, report.open_edges, report.degenerate), (1, 2, 2));
        assert_eq!(TriangleMesh::default().inspect().inverted, None);
    }
}
