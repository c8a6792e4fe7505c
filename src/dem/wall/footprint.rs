//! Which of the points where a sphere overlaps a surface are contacts of their own.
//!
//! A surface is cut into triangles at will, and a sphere of radius r overlaps many of them at once. Each triangle has a
//! closest point c_k to the centre x, at the distance s_k < r with the overlap delta_k = r - s_k. Going from the deepest
//! point to the shallowest, a point is a contact unless it lies in the *footprint* of one already accepted:
//!
//! |c_1 - c_2|^2 < a^2,    a^2 = r^2 - s_1^2 = 2 r delta_1 - delta_1^2,
//!
//! a the radius of the circle in which the sphere cuts the plane through c_1 across the normal n_1 = (c_1 - x) / s_1,
//! the tangent plane of the accepted contact.
//!
//! *What that does.* Let h be the height of c_2 above that plane, towards the centre. Then (c_1 - x).(c_2 - c_1) = -s_1 h,
//! so s_2^2 = |(c_1 - x) + (c_2 - c_1)|^2 = s_1^2 - 2 s_1 h + |c_1 - c_2|^2, that is
//!
//! |c_1 - c_2|^2 - a^2 = 2 s_1 h - (r^2 - s_2^2).
//!
//! The second point is a contact exactly where h >= (r^2 - s_2^2) / (2 s_1), about delta_2: where the surface rises above
//! the first contact's tangent plane by more than it is overlapped there. Hence
//! - h = 0 (the same plane, however cut; shared edges and vertices): never counted twice;
//! - h < 0 (all of a convex body beyond c_1, the side faces at its edges and vertices, the back of a thin plate): never;
//! - h small (facets of a hollow cylinder at a small angle, once the overlap exceeds the facets' deviation): once;
//! - h of the order of r (the second wall of a corner, a step, a slot): a contact of its own.
//!
//! The rule reads the sphere and the points only, not how triangles are connected: meshes with gaps, T-junctions,
//! duplicate or two-sided faces behave as what they cover.

use super::WallPoint;

/// Round-off allowed in the comparison, as a share of r^2.
///
/// Positions carry about 1e-16 L with L the size of the coordinates, so both sides of the comparison carry a few 1e-16 L r:
/// this covers plants of a million radii. It merges contacts closer than 3e-5 r, or overlapped by less than 1e-9 r more
/// than the first plane allows: neither can be felt.
const ROUND_OFF: f64 = 1e-9;

/// Overlaps that differ by less count as equal, as a share of r: the round-off of a plant of a million radii, as above.
///
/// A foot on an edge at the distance e beside a face's is shallower by e^2 / 2r only: for e below 1e-8 r the two cannot be told
/// apart by depth, yet their normals differ by e / r. The face's is the surface's own, so it goes first.
const SAME_DEPTH: f64 = 1e-9;

/// Of the points from `start` on, all of one part and one sphere of radius `radius` [m], keeps those that are contacts of
/// their own, deepest first; of equally deep ones those on a face, then by element.
pub(super) fn keep_separate(points: &mut Vec<WallPoint>, start: usize, radius: f64) {
    let mut kept = start;
    while points.len() > kept + 1 {
        let deepest = points[kept..].iter().fold(0.0_f64, |most, point| most.max(point.overlap));
        let equal = |point: &WallPoint| point.overlap >= deepest - SAME_DEPTH * radius;
        let better = |a: &WallPoint, b: &WallPoint| {
            let depth = a.overlap.total_cmp(&b.overlap);
            a.on_face.cmp(&b.on_face).then(depth).then(b.element.cmp(&a.element))
        };
        let rivals = (kept..points.len()).filter(|&index| equal(&points[index]));
        let Some(best) = rivals.max_by(|&a, &b| better(&points[a], &points[b])) else { return };
        points.swap(kept, best);
        let accepted = points[kept];
        kept += 1;
        let mut next = kept;
        for index in kept..points.len() {
            if !covers(&accepted, &points[index], radius) {
                points.swap(next, index);
                next += 1;
            }
        }
        points.truncate(next);
    }
}

/// True where `other` lies in the footprint of `accepted`.
fn covers(accepted: &WallPoint, other: &WallPoint, radius: f64) -> bool {
    let squared_footprint = accepted.overlap * (2.0 * radius - accepted.overlap);
    (accepted.point - other.point).norm_squared() < squared_footprint + ROUND_OFF * radius * radius
}
