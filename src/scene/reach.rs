//! How far parts reach along a gate's direction of passage, as a whole and within the column of its aperture.

use super::extent;
use super::gate::Transform;
use crate::geometry::motion::MotionKind;
use crate::geometry::part::{Part, Surface};
use crate::geometry::plane::{Aperture, GatePlane};
use crate::math::{Rotation, Vec3};
use nalgebra::Unit;
use std::f64::consts::TAU;

/// Sides of the polygon around a disc, and facets of a cone; the polygon's corners lie 0.5 % outside of the disc.
const SIDES: usize = 32;

/// Everything on one side: offset - normal . x >= 0.
type HalfSpace = (Vec3, f64);

impl Transform {
    /// Where a point of the stream comes to lie [m].
    #[must_use]
    pub fn point(&self, mut point: Vec3) -> Vec3 {
        if let Some((origin, normal)) = self.mirror {
            point -= normal * (2.0 * (point - origin).dot(&normal));
        }
        if let Some((axis, angle, origin)) = self.rotation {
            point = turned(&axis, angle, point - origin) + origin;
        }
        point + self.translation
    }

    /// Where a direction of the stream, or a velocity, points then.
    #[must_use]
    pub fn direction(&self, mut direction: Vec3) -> Vec3 {
        if let Some((_, normal)) = self.mirror {
            direction -= normal * (2.0 * direction.dot(&normal));
        }
        match self.rotation {
            Some((axis, angle, _)) => turned(&axis, angle, direction),
            None => direction,
        }
    }

    /// The calculation plane of a stream whose storage plane is `plane`.
    #[must_use]
    pub fn plane(&self, plane: &GatePlane) -> GatePlane {
        if self.is_identity() {
            return *plane;
        }
        let aperture = match plane.aperture {
            Aperture::Rectangle { side_a, side_b } => {
                Aperture::Rectangle { side_a: self.direction(side_a), side_b: self.direction(side_b) }
            }
            other => other,
        };
        GatePlane { point: self.point(plane.point), normal: self.direction(plane.normal), aperture }
    }
}

fn turned(axis: &Vec3, angle: f64, vector: Vec3) -> Vec3 {
    Rotation::from_axis_angle(&Unit::new_normalize(*axis), angle) * vector
}

/// True where the part stays in its place; its surface may still move in itself.
fn stays(part: &Part) -> bool {
    part.motion.terms.iter().all(|term| matches!(term.kind, MotionKind::Conveyor { .. }))
}

/// Smallest and largest distance s [m] from `plane` that the part reaches until `end` [s]; `None` for an unbounded surface.
#[must_use]
pub(crate) fn along(part: &Part, plane: &GatePlane, end: f64) -> Option<(f64, f64)> {
    range(&polygons(part, end)?, plane)
}

/// The same for what of the part lies in the column of the aperture, widened by `margin` [m]; `None` also where nothing does.
#[must_use]
pub(crate) fn in_column(part: &Part, plane: &GatePlane, margin: f64, end: f64) -> Option<(f64, f64)> {
    range(&clipped(polygons(part, end)?, &column(plane, margin)), plane)
}

/// True where the part comes between the distances `low` and `high` [m] from `plane` in the column of its aperture.
#[must_use]
pub(crate) fn enters(part: &Part, plane: &GatePlane, (low, high): (f64, f64), end: f64) -> bool {
    let Some(polygons) = polygons(part, end) else { return false };
    let inside = clipped(polygons, &column(plane, 0.0));
    if !stays(part) {
        // The polygons are the faces of a box that the part moves in: what they enclose counts.
        return range(&inside, plane).is_some_and(|(least, greatest)| least < high && greatest > low);
    }
    let at = plane.normal.dot(&plane.point);
    let slab = [(plane.normal, at + high), (-plane.normal, -at - low)];
    let cut = clipped(inside, &slab);
    // What only touches one end of the slab does not enter it.
    cut.iter().any(|polygon| {
        range(std::slice::from_ref(polygon), plane).is_some_and(|(least, greatest)| least < high && greatest > low)
    })
}

fn range(polygons: &[Vec<Vec3>], plane: &GatePlane) -> Option<(f64, f64)> {
    let distances = polygons.iter().flatten().map(|point| plane.distance(point));
    let range = distances.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), s| (low.min(s), high.max(s)));
    (range.0 <= range.1).then_some(range)
}

/// The part's surface as polygons: triangles of a mesh, facets of a cone, or, where it moves, the faces of the box that it
/// stays in; `None` for an unbounded surface.
fn polygons(part: &Part, end: f64) -> Option<Vec<Vec<Vec3>>> {
    if matches!(part.surface, Surface::Plane { .. }) {
        return None;
    }
    if !stays(part) {
        let bounds = extent::moved(extent::of_surface(&part.surface), &part.motion, end);
        let c = extent::corners(&bounds);
        let face = |[i, j, k, l]: [usize; 4]| vec![c[i], c[j], c[k], c[l]];
        let faces = [[0, 1, 3, 2], [4, 5, 7, 6], [0, 1, 5, 4], [2, 3, 7, 6], [0, 2, 6, 4], [1, 3, 7, 5]];
        return Some(faces.map(face).to_vec());
    }
    Some(match &part.surface {
        Surface::Plane { .. } => return None,
        Surface::Mesh(mesh) => {
            let corner = |index: &u32| mesh.vertices[*index as usize];
            mesh.triangles.iter().map(|triangle| triangle.iter().map(corner).collect()).collect()
        }
        Surface::Frustum { start, end, start_radius, end_radius } => {
            let rims = [(start, start_radius), (end, end_radius)];
            let (a, b) = across(&(end - start).normalize());
            let rim = |k: usize, (centre, radius): (&Vec3, &f64)| {
                let angle = TAU * k as f64 / SIDES as f64;
                // Corners outside of the circle, so that the facets enclose it.
                centre + (a * angle.cos() + b * angle.sin()) * (radius / (0.5 * TAU / SIDES as f64).cos())
            };
            (0..SIDES)
                .map(|k| vec![rim(k, rims[0]), rim(k + 1, rims[0]), rim(k + 1, rims[1]), rim(k, rims[1])])
                .collect()
        }
    })
}

/// Two unit vectors at right angles to a unit vector and to each other.
fn across(axis: &Vec3) -> (Vec3, Vec3) {
    let least = (0..3).min_by(|i, j| axis[*i].abs().total_cmp(&axis[*j].abs())).unwrap_or(0);
    let mut other = Vec3::zeros();
    other[least] = 1.0;
    let first = axis.cross(&other).normalize();
    (first, axis.cross(&first))
}

/// The column of an aperture, widened by `margin` [m]; without sides where the aperture has no bounds.
fn column(plane: &GatePlane, margin: f64) -> Vec<HalfSpace> {
    match plane.aperture {
        Aperture::Unbounded => Vec::new(),
        Aperture::Disc { radius } => {
            let (a, b) = across(&plane.normal);
            let side = |k: usize| {
                let angle = TAU * k as f64 / SIDES as f64;
                let outward = a * angle.cos() + b * angle.sin();
                (outward, outward.dot(&plane.point) + radius + margin)
            };
            (0..SIDES).map(side).collect()
        }
        Aperture::Rectangle { side_a, side_b } => [(side_a, side_b), (side_b, side_a)]
            .into_iter()
            .flat_map(|(side, other)| {
                let outward = plane.normal.cross(&other).normalize();
                let reach = 0.5 * outward.dot(&side).abs() + margin;
                [outward, -outward].map(|outward| (outward, outward.dot(&plane.point) + reach))
            })
            .collect(),
    }
}

/// What of the polygons lies in all half spaces (Sutherland and Hodgman 1974).
fn clipped(polygons: Vec<Vec<Vec3>>, spaces: &[HalfSpace]) -> Vec<Vec<Vec3>> {
    let cut = |mut polygon: Vec<Vec3>| {
        for (normal, offset) in spaces {
            let depth = |point: &Vec3| offset - normal.dot(point);
            match polygon.iter().filter(|point| depth(point) >= 0.0).count() {
                0 => return Vec::new(),
                all if all == polygon.len() => continue,
                _ => {}
            }
            let mut kept = Vec::with_capacity(polygon.len() + 1);
            for (index, point) in polygon.iter().enumerate() {
                let next = &polygon[(index + 1) % polygon.len()];
                let (here, there) = (depth(point), depth(next));
                if here >= 0.0 {
                    kept.push(*point);
                }
                if (here >= 0.0) != (there >= 0.0) {
                    kept.push(point + (next - point) * (here / (here - there)));
                }
            }
            polygon = kept;
        }
        polygon
    };
    polygons.into_iter().map(cut).filter(|polygon| !polygon.is_empty()).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::motion::{Motion, MotionTerm};
    use crate::geometry::part::{TriangleMesh, Trigger};
    use crate::math::vec3;

    fn part(surface: Surface) -> Part {
        let (appears, disappears) = (Trigger::Always, Trigger::Never);
        Part { name: "part".to_owned(), material: 0, surface, motion: Motion::default(), appears, disappears }
    }

    fn box_part(minimum: Vec3, maximum: Vec3) -> Part {
        part(Surface::Mesh(TriangleMesh::box_mesh(&minimum, &maximum)))
    }

    fn downward(aperture: Aperture) -> GatePlane {
        GatePlane { point: vec3(0.0, 0.0, 1.0), normal: vec3(0.0, 0.0, -1.0), aperture }
    }

    fn close(range: Option<(f64, f64)>, low: f64, high: f64) {
        let (least, greatest) = range.expect("a range");
        // Cutting rounds a few times.
        assert!((least - low).abs() < 1e-12 && (greatest - high).abs() < 1e-12, "{least} {greatest}");
    }

    #[test]
    fn a_part_reaches_along_the_direction_of_passage() {
        let cube = box_part(vec3(-0.1, -0.1, 0.7), vec3(0.1, 0.1, 1.2));
        close(along(&cube, &downward(Aperture::Unbounded), 1.0), -0.2, 0.3);
        let floor = part(Surface::Plane { point: Vec3::zeros(), normal: Vec3::z() });
        assert_eq!(along(&floor, &downward(Aperture::Unbounded), 1.0), None);
        let mut rising = cube;
        rising.motion.terms.push(MotionTerm {
            kind: MotionKind::Translate { velocity: vec3(0.0, 0.0, 0.5) },
            from: 1.0,
            until: f64::INFINITY,
        });
        close(along(&rising, &downward(Aperture::Unbounded), 3.0), -1.2, 0.3);
    }

    #[test]
    fn a_tilted_face_counts_only_where_the_column_cuts_it() {
        // A chute from (0, 0) down to (1, -1): in a column of half width 0.1 around x = 0.5 it lies at z = -0.4 ... -0.6.
        let corners = vec![vec3(0.0, -1.0, 0.0), vec3(1.0, -1.0, -1.0), vec3(1.0, 1.0, -1.0), vec3(0.0, 1.0, 0.0)];
        let chute = part(Surface::Mesh(TriangleMesh { vertices: corners, triangles: vec![[0, 1, 2], [0, 2, 3]] }));
        let side = |x, y| vec3(x, y, 0.0);
        let aperture = Aperture::Rectangle { side_a: side(0.2, 0.0), side_b: side(0.0, 0.2) };
        let plane = GatePlane { point: vec3(0.5, 0.0, 0.0), normal: vec3(0.0, 0.0, -1.0), aperture };
        close(in_column(&chute, &plane, 0.0, 1.0), 0.4, 0.6);
        close(in_column(&chute, &plane, 0.05, 1.0), 0.35, 0.65);
        assert!(enters(&chute, &plane, (0.5, 0.52), 1.0) && !enters(&chute, &plane, (0.0, 0.39), 1.0));
        assert!(!enters(&chute, &plane, (0.61, 2.0), 1.0));
        let aside = GatePlane { point: vec3(2.0, 0.0, 0.0), ..plane };
        assert_eq!(in_column(&chute, &aside, 0.0, 1.0), None);
    }

    #[test]
    fn a_cone_reaches_its_rims_within_the_facets() {
        let cone = part(Surface::Frustum {
            start: vec3(0.0, 0.0, 0.9),
            end: vec3(0.0, 0.0, 1.5),
            start_radius: 0.1,
            end_radius: 0.7,
        });
        close(along(&cone, &downward(Aperture::Unbounded), 1.0), -0.5, 0.1);
        // Within 0.2 of the axis there is the wall from its lower rim up to where it is 0.2 wide; facets lie up to 0.5 % off.
        let (low, high) = in_column(&cone, &downward(Aperture::Disc { radius: 0.2 }), 0.0, 1.0).expect("a range");
        assert!((high - 0.1).abs() < 1e-12 && (low - 0.0).abs() < 0.01 * 0.2, "{low} {high}");
        assert_eq!(in_column(&cone, &downward(Aperture::Disc { radius: 0.05 }), 0.0, 1.0), None);
    }

    #[test]
    fn a_moving_part_fills_the_box_it_moves_in() {
        let mut bar = box_part(vec3(-0.5, -0.5, -0.5), vec3(0.5, 0.5, 0.5));
        let plane = GatePlane { point: Vec3::zeros(), normal: Vec3::z(), aperture: Aperture::Disc { radius: 0.01 } };
        assert!(!enters(&bar, &plane, (-0.1, 0.0), 1.0), "the inside of a shell at rest is empty");
        let axis = Vec3::z();
        let kind = MotionKind::Rotate { origin: Vec3::zeros(), axis, rate: 1.0 };
        bar.motion.terms.push(MotionTerm { kind, from: 0.0, until: 1.0 });
        assert!(enters(&bar, &plane, (-0.1, 0.0), 1.0));
    }

    #[test]
    fn a_plane_is_mirrored_then_turned_then_moved() {
        let side_a = vec3(0.0, 0.1, 0.0);
        let plane = GatePlane {
            point: vec3(1.0, 0.0, 0.0),
            normal: vec3(1.0, 0.0, 0.0),
            aperture: Aperture::Rectangle { side_a, side_b: vec3(0.0, 0.0, 0.2) },
        };
        let transform = Transform {
            mirror: Some((Vec3::zeros(), vec3(1.0, 0.0, 0.0))),
            rotation: Some((vec3(0.0, 0.0, 1.0), TAU / 4.0, Vec3::zeros())),
            translation: vec3(0.0, 0.0, 5.0),
        };
        let moved = transform.plane(&plane);
        // (1, 0, 0) mirrored is (-1, 0, 0), turned by a quarter (0, -1, 0).
        assert!(
            (moved.point - vec3(0.0, -1.0, 5.0)).norm() < 1e-15 && (moved.normal - vec3(0.0, -1.0, 0.0)).norm() < 1e-15
        );
        let Aperture::Rectangle { side_a: turned_a, .. } = moved.aperture else { panic!("a rectangle") };
        assert!((turned_a - vec3(-0.1, 0.0, 0.0)).norm() < 1e-15);
        assert_eq!(Transform::IDENTITY.plane(&plane), plane);
    }
}
