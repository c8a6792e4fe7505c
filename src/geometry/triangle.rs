//! One triangle and the point of it that is closest to a given point.

use crate::math::lanes::{LaneVector, Lanes, MOST_LANES};
use crate::math::{Bounds, Vec3};

/// Height of a triangle over its longest edge below which it has no usable normal and counts as its three edges.
///
/// Its inside is then nowhere farther from the edges than 1e-12 of the longest edge, which is the round-off of the
/// vertices' own coordinates within a factor of a few thousand.
const DEGENERATE_HEIGHT: f64 = 1e-12;

/// A triangle prepared for distance queries: three rows of four numbers, as lanes gather them.
#[derive(Debug, Clone, Copy, PartialEq)]
#[repr(C)]
pub struct Triangle {
    corners: [Vec3; 3],
    /// Zero for a degenerate triangle.
    normal: Vec3,
}

/// The closest point of a surface, as seen from the point that asked.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Foot {
    /// From the asking point to the surface [m].
    pub offset: Vec3,
    /// Its squared length [m^2].
    pub squared_distance: f64,
    /// True where it is reached along the surface's normal; false on an edge or at a corner.
    pub on_face: bool,
}

impl Foot {
    fn on_edge(offset: Vec3) -> Self {
        Self { offset, squared_distance: offset.norm_squared(), on_face: false }
    }
}

impl Triangle {
    /// A triangle from its corners [m], in right-handed order about its normal.
    #[must_use]
    pub fn new(corners: [Vec3; 3]) -> Self {
        let [a, b, c] = corners;
        let longest_squared = (b - a).norm_squared().max((c - b).norm_squared()).max((a - c).norm_squared());
        let doubled_area = doubled_area_vector(&corners);
        let length = doubled_area.norm();
        // length = longest edge * height; a comparison that NaN fails makes the triangle degenerate
        let sound = length > DEGENERATE_HEIGHT * longest_squared;
        Self { corners, normal: if sound { doubled_area / length } else { Vec3::zeros() } }
    }

    /// The corners [m].
    #[must_use]
    pub fn corners(&self) -> &[Vec3; 3] {
        &self.corners
    }

    /// Unit normal, right-handed about the corners [-]; zero for a degenerate triangle.
    #[must_use]
    pub fn normal(&self) -> &Vec3 {
        &self.normal
    }

    /// True where the area vanishes (height below 1e-12 of the longest edge).
    #[must_use]
    pub fn is_degenerate(&self) -> bool {
        self.normal == Vec3::zeros()
    }

    /// The smallest box around it.
    #[must_use]
    pub fn bounds(&self) -> Bounds {
        let mut bounds = Bounds::EMPTY;
        for corner in &self.corners {
            bounds.include(corner);
        }
        bounds
    }

    /// The closest point of the triangle to `point` [m].
    ///
    /// Where the perpendicular from `point` onto the plane meets the inside, that is the closest point. Else the
    /// closest point q lies on an edge beyond which `point` lies: inside an edge, `point` - q is along that edge's
    /// outward in-plane normal (plus the plane's normal); at a corner it is a sum w = alpha n1 + beta n2 of the two
    /// edges' outward normals with alpha, beta >= 0, and w.w > 0 forces w.n1 > 0 or w.n2 > 0. So the nearest of the
    /// edges that `point` lies beyond gives the answer, also for obtuse triangles.
    /// Same result as the region tests of C. Ericson, Real-time collision detection (2005), 5.1.5, but the face is
    /// reached by the unit normal, so that distance and direction keep full precision however near the surface is.
    #[must_use]
    pub fn closest(&self, point: &Vec3) -> Foot {
        let [a, b, c] = self.corners.map(|corner| corner - point);
        let edges = [(a, b), (b, c), (c, a)];
        let degenerate = self.is_degenerate();
        let mut nearest: Option<Foot> = None;
        for (from, to) in edges {
            // positive where `point`, here the origin, lies on the inner side of the edge
            let inner = self.normal.dot(&from.cross(&to));
            if degenerate || inner < 0.0 {
                let foot = closest_on_segment(&from, &to);
                if nearest.is_none_or(|best| foot.squared_distance < best.squared_distance) {
                    nearest = Some(foot);
                }
            }
        }
        nearest.unwrap_or_else(|| {
            let height = self.normal.dot(&a);
            Foot { offset: self.normal * height, squared_distance: height * height, on_face: true }
        })
    }
}

/// [`Triangle::closest`] of a triangle and a point in each lane, bit for bit: the offset, its square, and where it is on the face.
///
/// All three edges are looked at in every lane: most lanes need one of them or none, but which ones cannot be foretold, and a wrong
/// guess costs a single triangle more than this does.
///
/// # Panics
/// Where there is no such triangle.
#[inline(always)]
#[must_use]
pub fn closest_in_lanes<L: Lanes>(
    triangles: &[Triangle],
    index: &[u32],
    point: &LaneVector<L>,
) -> (LaneVector<L>, L, L::Mask) {
    assert!(index.iter().all(|&index| (index as usize) < triangles.len()), "triangles that there are");
    let mut rows = [0; MOST_LANES];
    rows.iter_mut().zip(index).for_each(|(row, &index)| *row = 3 * index);
    let (first, rows) = (triangles.as_ptr().cast::<[f64; 4]>(), &rows[..L::COUNT]);
    // SAFETY: a triangle is twelve numbers one after the other, three rows of four; there are as many as just looked at.
    let ([ax, ay, az, bx], [by, bz, cx, cy], [cz, nx, ny, nz]) = unsafe {
        (L::gather_four(first, rows), L::gather_four(first.add(1), rows), L::gather_four(first.add(2), rows))
    };
    let normal = LaneVector::new(nx, ny, nz);
    let a = LaneVector::new(ax, ay, az) - *point;
    let b = LaneVector::new(bx, by, bz) - *point;
    let c = LaneVector::new(cx, cy, cz) - *point;
    let (zero, sound) = (L::zero(), dot(&normal, &normal).exceeds(L::zero()));
    let height = dot(&normal, &a);
    let mut nearest = normal * height;
    let mut best = L::splat(f64::INFINITY);
    let mut beyond_some = !sound;
    for (from, to) in [(a, b), (b, c), (c, a)] {
        let beyond = !sound | dot(&normal, &cross(&from, &to)).below(zero);
        let edge = to - from;
        let squared_length = dot(&edge, &edge);
        let along = -dot(&from, &edge);
        let inside = from + edge * (along / squared_length);
        let before_end = LaneVector::select(along.below(squared_length), &inside, &to);
        let foot = LaneVector::select(along.exceeds(zero), &before_end, &from);
        let square = dot(&foot, &foot);
        let nearer = beyond & square.below(best);
        nearest = LaneVector::select(nearer, &foot, &nearest);
        best = L::select(nearer, square, best);
        beyond_some = beyond_some | beyond;
    }
    (nearest, L::select(beyond_some, best, height * height), !beyond_some)
}

/// Scalar product, its products rounded on their own as those of [`Triangle::closest`] are.
#[inline(always)]
fn dot<L: Lanes>(a: &LaneVector<L>, b: &LaneVector<L>) -> L {
    a.x * b.x + a.y * b.y + a.z * b.z
}

/// Vector product, likewise.
#[inline(always)]
fn cross<L: Lanes>(a: &LaneVector<L>, b: &LaneVector<L>) -> LaneVector<L> {
    LaneVector::new(a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x)
}

/// Twice the area times the normal, (b - a) x (c - a) [m^2], with the pair of shortest edges, which loses least to
/// round-off in thin triangles.
#[must_use]
pub fn doubled_area_vector(corners: &[Vec3; 3]) -> Vec3 {
    let [a, b, c] = corners;
    let (ab, bc, ca) = (b - a, c - b, a - c);
    let (along_ab, along_bc, along_ca) = (ab.norm_squared(), bc.norm_squared(), ca.norm_squared());
    if along_ab >= along_bc && along_ab >= along_ca {
        bc.cross(&ca)
    } else if along_bc >= along_ca {
        ca.cross(&ab)
    } else {
        ab.cross(&bc)
    }
}

/// The closest point to the origin on the segment from `from` to `to` [m].
fn closest_on_segment(from: &Vec3, to: &Vec3) -> Foot {
    let edge = to - from;
    let squared_length = edge.norm_squared();
    let along = -from.dot(&edge);
    // the corner itself, not from + 1 * edge: neighbours at a vertex then agree to the last bit
    if along <= 0.0 || squared_length == 0.0 {
        Foot::on_edge(*from)
    } else if along >= squared_length {
        Foot::on_edge(*to)
    } else {
        Foot::on_edge(from + edge * (along / squared_length))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::lanes::{LaneWork, Mask as _, SimdLevel, at_level};
    use crate::math::vec3;
    use proptest::prelude::*;

    struct AllLanes<'a> {
        triangles: &'a [Triangle],
        index: &'a [u32],
        points: &'a [Vec3],
    }

    impl LaneWork for AllLanes<'_> {
        type Output = Vec<Foot>;

        #[inline(always)]
        fn run<L: Lanes>(self) -> Vec<Foot> {
            let mut feet = Vec::new();
            for from in (0..self.points.len()).step_by(L::COUNT) {
                let component = |axis: usize| -> Vec<f64> { self.points.iter().map(|point| point[axis]).collect() };
                let point = LaneVector::read_from(&[component(0), component(1), component(2)], from);
                let index = &self.index[from..from + L::COUNT];
                let (offset, square, on_face) = closest_in_lanes::<L>(self.triangles, index, &point);
                let ([x, y, z], square) = (offset.to_arrays(), square.to_array());
                feet.extend((0..L::COUNT).map(|lane| Foot {
                    offset: vec3(x[lane], y[lane], z[lane]),
                    squared_distance: square[lane],
                    on_face: on_face.bits() >> lane & 1 == 1,
                }));
            }
            feet
        }
    }

    fn coordinates() -> impl Strategy<Value = Vec3> {
        (-1.0..1.0, -1.0..1.0, -1.0..1.0).prop_map(|(x, y, z)| vec3(x, y, z))
    }

    proptest! {
        /// The closest point q of a convex set is the one with (x - q).(p - q) <= 0 for every x of the set, and it is
        /// enough to ask the corners. Tolerance: round-off of products of coordinates of order 1, in triangles whose
        /// height may be 1e-3 of their size.
        #[test]
        fn satisfies_the_variational_inequality(corners in [coordinates(), coordinates(), coordinates()], p in coordinates()) {
            let triangle = Triangle::new(corners);
            prop_assume!(doubled_area_vector(&corners).norm() > 1e-3);
            let foot = triangle.closest(&p);
            let q = p + foot.offset;
            for corner in &corners {
                prop_assert!((corner - q).dot(&(p - q)) <= 1e-12);
            }
            // q is in the triangle: in its plane, and on the inner side of every edge
            prop_assert!((q - corners[0]).dot(triangle.normal()).abs() <= 1e-12);
            for k in 0..3 {
                let (from, to) = (corners[k], corners[(k + 1) % 3]);
                prop_assert!(triangle.normal().dot(&(to - from).cross(&(q - from))) >= -1e-12);
            }
            // a unit normal's length is one within 2 units in the last place, so the offset's square within 4 and two more of its
            // own sum: 8 units in the last place of the square itself
            prop_assert!((foot.offset.norm_squared() - foot.squared_distance).abs() <= 8.0 * f64::EPSILON * foot.squared_distance);
        }

        /// Lanes give the same bits, at every level; degenerate triangles and points above faces, edges and corners among them.
        #[test]
        fn lanes_change_no_bit(
            corners in prop::collection::vec([coordinates(), coordinates(), coordinates()], 1..5),
            points in prop::collection::vec((coordinates(), 0..4_usize, 0.0..1.0), MOST_LANES),
        ) {
            let mut triangles: Vec<Triangle> = corners.iter().copied().map(Triangle::new).collect();
            let [a, b, _] = corners[0];
            triangles.push(Triangle::new([a, b, a + (b - a) * 0.5]));
            triangles.push(Triangle::new([a, a, a]));
            let index: Vec<u32> = (0..MOST_LANES).map(|lane| (lane % triangles.len()) as u32).collect();
            let point = |lane: usize| {
                let ((point, kind, share), [a, b, c]) = (points[lane], *triangles[index[lane] as usize].corners());
                [point, a, a + (b - a) * share, (a + b + c) / 3.0][kind]
            };
            let points: Vec<Vec3> = (0..MOST_LANES).map(point).collect();
            let expected: Vec<Foot> =
                points.iter().zip(&index).map(|(point, &index)| triangles[index as usize].closest(point)).collect();
            for level in SimdLevel::ALL.into_iter().filter(|level| level.is_available()) {
                let work = AllLanes { triangles: &triangles, index: &index, points: &points };
                prop_assert_eq!(&at_level(level, work), &expected, "{}", level.name());
            }
        }

        /// A degenerate triangle is the segment it covers, and nothing is NaN.
        #[test]
        fn a_degenerate_triangle_is_a_segment(a in coordinates(), b in coordinates(), share in 0.0..1.0, p in coordinates()) {
            let corners = [a, b, a + (b - a) * share];
            let triangle = Triangle::new(corners);
            prop_assert!(triangle.is_degenerate());
            let expected = closest_on_segment(&(a - p), &(b - p));
            prop_assert!((triangle.closest(&p).squared_distance - expected.squared_distance).abs() <= 1e-14);
            let collapsed = Triangle::new([a, a, a]);
            prop_assert_eq!(collapsed.closest(&p).offset, a - p);
        }
    }

    #[test]
    fn an_obtuse_triangle_finds_the_far_edge() {
        // the point lies beyond two edges, the nearer edge is not the one whose line is nearest
        let triangle = Triangle::new([vec3(0.0, 0.0, 0.0), vec3(10.0, 0.0, 0.0), vec3(-5.0, 1.0, 0.0)]);
        let foot = triangle.closest(&vec3(-1.0, -1.0, 2.0));
        let edge = vec3(-5.0, 1.0, 0.0);
        let p = vec3(-1.0, -1.0, 2.0);
        let t = (p.dot(&edge) / edge.norm_squared()).clamp(0.0, 1.0);
        let expected = (edge * t - p).norm_squared();
        assert!((foot.squared_distance - expected).abs() < 1e-14);
    }
}
