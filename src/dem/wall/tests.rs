//! Contacts with walls against closed forms.
//!
//! Tolerance 1e-12 d unless said otherwise: coordinates are of order 1 m and carry 1e-16 m, a distance a few of them, and
//! d = 0.1 m; so 1e-12 d = 1e-13 m leaves room for a hundred roundings.

use super::*;
use crate::dem::particles::Sphere;
use crate::geometry::motion::{MotionKind, MotionTerm};
use crate::geometry::part::{TriangleMesh, Trigger};
use crate::geometry::triangle::Triangle;
use crate::math::{Rotation, vec3};
use proptest::prelude::*;
use rand::SeedableRng as _;
use std::f64::consts::{PI, TAU};

const RADIUS: f64 = 0.05;
const TOLERANCE: f64 = 1e-12 * 2.0 * RADIUS;

fn part(surface: Surface) -> Part {
    let (appears, disappears) = (Trigger::Always, Trigger::Never);
    Part { name: "wall".into(), material: 0, surface, motion: Motion::default(), appears, disappears }
}

fn moving(surface: Surface, kinds: &[MotionKind]) -> Part {
    let terms = kinds.iter().map(|kind| MotionTerm { kind: kind.clone(), from: 0.0, until: f64::INFINITY });
    Part { motion: Motion { terms: terms.collect() }, ..part(surface) }
}

fn mesh(triangles: &[[Vec3; 3]]) -> Part {
    part(Surface::Mesh(TriangleMesh::from_soup(triangles)))
}

fn touch(walls: &Walls, centre: &Vec3, radius: f64) -> Vec<WallPoint> {
    let (mut candidates, mut found) = (Vec::new(), Vec::new());
    walls.candidates(centre, radius * 1.2, &mut candidates);
    walls.contacts(&candidates, centre, radius, &mut found);
    found
}

fn surface_velocity(walls: &Walls, point: &Vec3, normal: &Vec3) -> Vec3 {
    walls.surface_velocity::<f64>(0, &(*point).into(), &(*normal).into()).into()
}

fn assert_touch(found: &WallPoint, centre: &Vec3, point: &Vec3, radius: f64) {
    let offset = point - centre;
    assert!((found.point - point).norm() < TOLERANCE, "point {:?} instead of {point:?}", found.point);
    assert!((found.overlap - (radius - offset.norm())).abs() < TOLERANCE);
    // the normal loses what the distance does, over the distance
    assert!((found.normal - offset.normalize()).norm() < TOLERANCE / offset.norm());
}

/// The unit square in x and y at z = 0, cut into `columns` x `rows` slanted quadrilaterals of two triangles each,
/// with inner vertices moved within the plane so that no two triangles are alike.
fn cut_square(columns: u32, rows: u32, pose: &Pose) -> Vec<[Vec3; 3]> {
    let vertex = |i: u32, k: u32| {
        let inner = f64::from(u8::from(i > 0 && i < columns && k > 0 && k < rows));
        let (u, v) = (f64::from(i) / f64::from(columns), f64::from(k) / f64::from(rows));
        let shift = |phase: f64| inner * 0.3 * (7.0 * u + 11.0 * v + phase).sin();
        pose.apply(&vec3(u + shift(0.0) / f64::from(columns), v + shift(2.0) / f64::from(rows), 0.0))
    };
    let mut triangles = Vec::new();
    for k in 0..rows {
        for i in 0..columns {
            let [a, b, c, d] = [vertex(i, k), vertex(i + 1, k), vertex(i + 1, k + 1), vertex(i, k + 1)];
            triangles.extend([[a, b, c], [a, c, d]]);
        }
    }
    triangles
}

fn tilted() -> Pose {
    Pose { rotation: Rotation::from_euler_angles(0.3, -0.7, 1.1), translation: vec3(0.2, -0.5, 0.8) }
}

#[test]
fn a_plane_cut_into_many_triangles_is_one_plane() {
    let pose = tilted();
    let normal = pose.apply_direction(&Vec3::z());
    let corner = |x: f64, y: f64| pose.apply(&vec3(x, y, 0.0));
    let one = vec![[corner(-1.0, -1.0), corner(4.0, -1.0), corner(-1.0, 4.0)]];
    let mut random = rand_chacha::ChaCha8Rng::seed_from_u64(1);
    let mut heights = [0.999_999 * RADIUS, 0.9 * RADIUS, 0.3 * RADIUS, RADIUS * (1.0 - 1e-9)];
    for triangles in [one, cut_square(10, 5, &pose), cut_square(100, 50, &pose)] {
        let mut above: Vec<Vec3> =
            (0..500).map(|_| corner(random.random_range(0.0..1.0), random.random_range(0.0..1.0))).collect();
        // exactly above vertices, middles of edges, and middles of triangles
        for [a, b, c] in triangles.iter().step_by(1 + triangles.len() / 200) {
            above.extend([*a, *b, *c, (a + b) / 2.0, (b + c) / 2.0, (c + a) / 2.0, (a + b + c) / 3.0]);
        }
        let walls = Walls::new(&[mesh(&triangles)]);
        for foot in &above {
            heights.rotate_left(1);
            let centre = foot + normal * heights[0];
            let found = touch(&walls, &centre, RADIUS);
            assert_eq!(found.len(), 1, "{} triangles, height {}", triangles.len(), heights[0]);
            assert_touch(&found[0], &centre, foot, RADIUS);
            // and from below: the surface has two sides
            let centre = foot - normal * heights[0];
            let found = touch(&walls, &centre, RADIUS);
            assert_eq!(found.len(), 1);
            assert_touch(&found[0], &centre, foot, RADIUS);
        }
    }
}

/// Far from the origin round-off decides whether the sphere reaches a triangle of the plane at the border of the circle in
/// which it cuts the plane; it must not decide whether that is a second contact.
#[test]
fn round_off_at_the_border_of_the_footprint_makes_no_contact() {
    let pose = Pose { translation: vec3(900.0, -500.0, 700.0), ..tilted() };
    let corner = |x: f64, y: f64| pose.apply(&vec3(x, y, 0.0));
    let mut random = rand_chacha::ChaCha8Rng::seed_from_u64(3);
    let mut reached = 0;
    for _ in 0..2000 {
        let height = random.random_range(0.1..0.9) * RADIUS;
        let border = (RADIUS * RADIUS - height * height).sqrt() + random.random_range(-2e-12..2e-12) * RADIUS;
        let near = [corner(-1.0, -2.0), corner(border, 0.0), corner(-1.0, 2.0)];
        let beyond = [corner(border, -1.0), corner(1.0, 0.0), corner(border, 1.0)];
        let walls = Walls::new(&[mesh(&[near, beyond])]);
        let centre = pose.apply(&vec3(0.0, 0.0, height));
        assert_eq!(touch(&walls, &centre, RADIUS).len(), 1);
        let mut found = Vec::new();
        walls.contacts(&[Candidate { part: 0, element: 1 }], &centre, RADIUS, &mut found);
        reached += found.len();
    }
    assert!((100..1900).contains(&reached), "the border was not met: {reached}");
}

#[test]
fn faces_edges_and_corners_of_a_box_in_closed_form() {
    let one = vec3(1.0, 1.0, 1.0);
    let walls = Walls::new(&[part(Surface::Mesh(TriangleMesh::box_mesh(&-one, &one)))]);
    let mut random = rand_chacha::ChaCha8Rng::seed_from_u64(2);
    for _ in 0..2000 {
        // outside the box, whose closest point is the centre clamped to it
        let foot = Vec3::from_fn(|_, _| random.random_range(-1.0..1.0_f64));
        let direction = Vec3::from_fn(|_, _| random.random_range(-1.0..1.0_f64)).normalize();
        let pushed =
            Vec3::from_fn(|axis, _| if direction[axis].abs() > 0.5 { direction[axis].signum() } else { foot[axis] });
        let out = direction.map(|component| if component.abs() > 0.5 { component } else { 0.0 });
        if out == Vec3::zeros() {
            continue;
        }
        let centre = pushed + out.normalize() * (random.random_range(0.05..0.999) * RADIUS);
        let found = touch(&walls, &centre, RADIUS);
        assert_eq!(found.len(), 1, "convex: one contact at {centre:?}");
        assert_touch(&found[0], &centre, &pushed, RADIUS);
    }
}

#[test]
fn concave_corners_give_one_contact_a_wall() {
    // inside of a box: face, edge and corner give one, two and three
    let one = vec3(1.0, 1.0, 1.0);
    let walls = Walls::new(&[part(Surface::Mesh(TriangleMesh::box_mesh(&Vec3::zeros(), &one)))]);
    for (gaps, expected) in [([0.5, 0.5, 0.9], 1), ([0.5, 0.8, 0.9], 2), ([0.7, 0.8, 0.9], 3), ([0.9, 0.9, 0.9], 3)] {
        let centre = Vec3::from_fn(|axis, _| if gaps[axis] > 0.5 { gaps[axis] * RADIUS } else { 0.5 });
        let found = touch(&walls, &centre, RADIUS);
        assert_eq!(found.len(), expected);
        assert!(found.is_sorted_by(|a, b| a.overlap >= b.overlap));
        for axis in (0..3).filter(|&axis| gaps[axis] > 0.5) {
            let touched = found.iter().find(|point| point.normal[axis] < -0.5).unwrap();
            let mut point = centre;
            point[axis] = 0.0;
            assert_touch(touched, &centre, &point, RADIUS);
        }
    }
}

#[test]
fn a_thin_plate_is_one_contact() {
    for thickness in [1e-9, 0.01, 0.2] {
        let (low, high) = (vec3(0.0, 0.0, -thickness * RADIUS), vec3(1.0, 1.0, 0.0));
        let walls = Walls::new(&[part(Surface::Mesh(TriangleMesh::box_mesh(&low, &high)))]);
        // flat on it, at its rim, and overlapping it by more than its thickness
        for (x, height) in [(0.5, 0.9), (1.0 + 0.3 * RADIUS, 0.5), (0.5, 0.7), (1.0, 0.99), (1.0, 0.6)] {
            let centre = vec3(x, 0.5, height * RADIUS);
            let found = touch(&walls, &centre, RADIUS);
            assert_eq!(found.len(), 1, "thickness {thickness}, x {x}, height {height}");
            assert_touch(&found[0], &centre, &vec3(x.min(1.0), 0.5, 0.0), RADIUS);
        }
    }
}

/// Inside of a regular prism along y, `facets` around, each an apothem of 1 from the axis.
fn prism(facets: u32) -> Vec<[Vec3; 3]> {
    let outer = 1.0 / (PI / f64::from(facets)).cos();
    let vertex = |k: u32, y: f64| {
        let angle = TAU * f64::from(k % facets) / f64::from(facets);
        vec3(outer * angle.cos(), y, outer * angle.sin())
    };
    let side = |k: u32| {
        let [a, b, c, d] = [vertex(k, -1.0), vertex(k + 1, -1.0), vertex(k + 1, 1.0), vertex(k, 1.0)];
        [[a, b, c], [a, c, d]]
    };
    (0..facets).flat_map(side).collect()
}

#[test]
fn facets_of_a_hollow_cylinder_count_once_within_the_footprint() {
    let facets = 64_u32;
    let walls = Walls::new(&[mesh(&prism(facets))]);
    let half_angle = PI / f64::from(facets);
    // above an edge both facets are equally near, at (R - rho) cos(half angle) from the middle of the sphere, and their
    // points are 2 s sin(half angle) apart: one contact exactly where that is less than sqrt(r^2 - s^2)
    let critical = 1.0 / (1.0 + (2.0 * half_angle.sin()).powi(2)).sqrt();
    let outer = 1.0 / half_angle.cos();
    for (share, expected) in [(critical * (1.0 - 1e-6), 1), (critical * (1.0 + 1e-6), 2), (0.9, 1), (0.9999, 2)] {
        let centre = vec3(outer - share * RADIUS / half_angle.cos(), 0.1, 0.0);
        let found = touch(&walls, &centre, RADIUS);
        assert_eq!(found.len(), expected, "distance over radius {share}");
        assert!(found.iter().all(|point| (point.overlap - RADIUS * (1.0 - share)).abs() < TOLERANCE));
    }
}

#[test]
fn distinct_parts_are_contacts_of_their_own() {
    let floor = || Surface::Plane { point: Vec3::zeros(), normal: Vec3::z() };
    let mut walls = Walls::new(&[part(floor()), part(floor())]);
    let centre = vec3(3.0, 4.0, 0.9 * RADIUS);
    assert_eq!(touch(&walls, &centre, RADIUS).iter().map(|point| point.part).collect::<Vec<_>>(), [0, 1]);
    walls.set_present(0, false);
    assert!(!walls.is_present(0) && walls.is_present(1));
    assert_eq!(touch(&walls, &centre, RADIUS).iter().map(|point| point.part).collect::<Vec<_>>(), [1]);
    // candidates found before a part vanished do no harm
    let mut found = Vec::new();
    let stale = [Candidate { part: 0, element: 0 }, Candidate { part: 1, element: 0 }];
    walls.contacts(&stale, &centre, RADIUS, &mut found);
    assert_eq!(found.len(), 1);
}

#[test]
fn candidates_that_are_not_due_are_not_missed() {
    let rate = 0.5;
    let turn = MotionKind::Rotate { origin: vec3(0.5, 0.5, 0.0), axis: Vec3::x(), rate };
    let square = cut_square(40, 40, &Pose::IDENTITY);
    let Surface::Mesh(swinging) = mesh(&square).surface else { unreachable!("a mesh") };
    let plane = Surface::Plane { point: vec3(0.0, 0.0, -0.01), normal: Vec3::z() };
    let mut walls = Walls::new(&[moving(Surface::Mesh(swinging), &[turn]), part(plane)]);
    // A sphere that rolls to and fro on the mesh and hops a little.
    let place = |time: f64| vec3(0.5 + 0.02 * (9.0 * time).sin(), 0.45, RADIUS * (0.97 + 0.05 * (40.0 * time).sin()));
    let (mut candidates, mut near, mut approached) = (Vec::new(), NearElements::default(), f64::INFINITY);
    let (skin, step) = (0.5 * RADIUS, 1e-4);
    let (mut expected, mut due, mut touches, mut looks, mut all) = (Vec::new(), Due::default(), 0, 0, 0);
    let mut last = place(0.0);
    for number in 0..2000 {
        let time = step * f64::from(number);
        let centre = place(time);
        walls.set_time(time);
        approached += (centre - last).norm() + walls.speed_bound() * step;
        last = centre;
        if approached > skin {
            walls.candidates(&centre, RADIUS + skin, &mut candidates);
            candidates.retain(|candidate| candidate.part == 0);
            (near, approached) = (NearElements::default(), 0.0);
            near.push(0, &candidates);
        }
        looks += near.count_due(approached);
        all += candidates.len();
        walls.contacts(&candidates, &centre, RADIUS, &mut expected);
        let (spheres, mut found) = ([Sphere { centre: centre.into(), radius: RADIUS }], Vec::new());
        let take = |particle: u32, points: &[WallPoint]| {
            assert_eq!(particle, 0);
            found.extend_from_slice(points);
        };
        walls.contacts_when_due::<f64>(&mut near, approached, &spheres, |_| false, &mut due, take);
        assert_eq!(found, expected, "at {time} s");
        touches += found.len();
    }
    assert!(touches > 400, "only {touches} contacts prove nothing");
    assert!(looks * 2 < all, "{looks} looks at {all} candidates: nothing is saved");
}

#[test]
fn a_centre_behind_a_plane_is_pushed_back() {
    let walls = Walls::new(&[part(Surface::Plane { point: vec3(0.0, 0.0, 1.0), normal: Vec3::z() })]);
    let found = touch(&walls, &vec3(0.3, 0.4, 0.9), RADIUS);
    assert_eq!(found.len(), 1);
    assert!((found[0].overlap - (RADIUS + 0.1)).abs() < TOLERANCE);
    assert_eq!(found[0].normal, -Vec3::z());
    assert!((found[0].point - vec3(0.3, 0.4, 1.0)).norm() < TOLERANCE);
    assert!(touch(&walls, &vec3(0.3, 0.4, 1.0 + RADIUS), RADIUS).is_empty());
}

#[test]
fn a_sphere_as_wide_as_a_pipe_touches_it_on_both_sides() {
    let (start, end) = (vec3(0.0, 0.0, -1.0), vec3(0.0, 0.0, 1.0));
    let wide = 0.99 * RADIUS;
    let pipe = || part(Surface::Frustum { start, end, start_radius: wide, end_radius: wide });
    let centre = vec3(0.0003, 0.0, 0.2);
    let found = touch(&Walls::new(&[pipe()]), &centre, RADIUS);
    assert_eq!(found.iter().map(|point| point.element).collect::<Vec<_>>(), [0, 1]);
    assert_touch(&found[0], &centre, &vec3(wide, 0.0, 0.2), RADIUS);
    assert_touch(&found[1], &centre, &vec3(-wide, 0.0, 0.2), RADIUS);
    // on the axis the two cancel
    let found = touch(&Walls::new(&[pipe()]), &vec3(0.0, 0.0, 0.2), RADIUS);
    assert!((found[0].normal + found[1].normal).norm() < 1e-15 && found[0].overlap == found[1].overlap);
    // resting on the rim
    let centre = vec3(0.0, 0.0, 1.0 + 0.1 * RADIUS);
    let found = touch(&Walls::new(&[pipe()]), &centre, RADIUS);
    assert_eq!(found.len(), 2);
    let distance = wide.hypot(0.1 * RADIUS);
    for point in found {
        assert!((point.overlap - (RADIUS - distance)).abs() < TOLERANCE);
        assert!((point.normal.z + 0.1 * RADIUS / distance).abs() < 1e-12);
    }
    // outside of it only the near side counts
    assert_eq!(touch(&Walls::new(&[pipe()]), &vec3(1.9 * RADIUS, 0.0, 0.0), RADIUS).len(), 1);
}

#[test]
fn a_centre_in_the_surface_and_degenerate_triangles_give_finite_numbers() {
    let [a, b, c] = [vec3(0.0, 0.0, 0.0), vec3(1.0, 0.0, 0.0), vec3(0.0, 1.0, 0.0)];
    let walls = Walls::new(&[mesh(&[[a, b, c], [a, b, (a + b) / 2.0], [c, c, c]])]);
    let found = touch(&walls, &vec3(0.25, 0.25, 0.0), RADIUS);
    assert_eq!(found.len(), 1);
    assert_eq!((found[0].normal, found[0].overlap), (-Vec3::z(), RADIUS));
    for centre in [c, (a + b) / 2.0, a] {
        let found = touch(&walls, &centre, RADIUS);
        assert_eq!(found.len(), 1);
        assert!((found[0].normal.norm() - 1.0).abs() < 1e-15 && found[0].overlap == RADIUS);
    }
    let alone = Walls::new(&[mesh(&[[c, c, c]])]);
    let found = touch(&alone, &c, RADIUS);
    assert!((found[0].normal.norm() - 1.0).abs() < 1e-15);
    let axis = Surface::Frustum { start: a, end: vec3(0.0, 0.0, 1.0), start_radius: 0.5, end_radius: 0.5 };
    let found = touch(&Walls::new(&[part(axis)]), &vec3(0.5, 0.0, 0.5), RADIUS);
    assert_eq!((found.len(), found[0].normal), (1, vec3(-1.0, 0.0, 0.0)));
}

fn swing() -> MotionKind {
    MotionKind::Rotate { origin: vec3(0.2, 0.1, -0.3), axis: vec3(2.0, -1.0, 2.0) / 3.0, rate: 3.0 }
}

proptest! {
    #[test]
    fn a_rotating_mesh_sees_the_counter_rotated_particle(
        x in 0.0..1.0_f64, y in 0.0..1.0_f64, z in -0.9..0.9_f64, time in 0.0..10.0_f64,
    ) {
        let surface = || Surface::Mesh(TriangleMesh::from_soup(&cut_square(20, 10, &Pose::IDENTITY)));
        let turning = moving(surface(), &[swing()]);
        let pose = turning.motion.pose(time);
        let mut walls = Walls::new(&[turning]);
        walls.set_time(time);
        let body = vec3(x, y, z * RADIUS);
        let expected = touch(&Walls::new(&[part(surface())]), &body, RADIUS);
        let found = touch(&walls, &pose.apply(&body), RADIUS);
        prop_assert_eq!(found.len(), expected.len());
        for (found, expected) in found.iter().zip(&expected) {
            prop_assert!((found.overlap - expected.overlap).abs() < TOLERANCE);
            prop_assert!((found.point - pose.apply(&expected.point)).norm() < TOLERANCE);
            let moved = found.normal - pose.apply_direction(&expected.normal);
            prop_assert!(moved.norm() * (RADIUS - found.overlap) < TOLERANCE);
        }
    }

    #[test]
    fn candidates_are_those_of_brute_force(
        x in -0.2..1.2_f64, y in -0.2..1.2_f64, z in -0.4..0.4_f64, reach in 0.0..0.3_f64, time in 0.0..3.0_f64,
    ) {
        let triangles = cut_square(12, 9, &Pose::IDENTITY);
        let surface = || Surface::Mesh(TriangleMesh::from_soup(&triangles));
        let parts = [part(surface()), moving(surface(), &[swing()]), part(surface())];
        let mut walls = Walls::new(&parts);
        walls.set_time(time);
        walls.set_present(2, false);
        let centre = vec3(x, y, z);
        let mut expected = Vec::new();
        for part in 0..2_u16 {
            let body = parts[usize::from(part)].motion.pose(time).inverse_apply(&centre);
            for (element, corners) in (0_u32..).zip(&triangles) {
                if Triangle::new(*corners).closest(&body).squared_distance <= reach * reach {
                    expected.push(Candidate { part, element });
                }
            }
        }
        let mut found = vec![Candidate { part: 9, element: 9 }];
        walls.candidates(&centre, reach, &mut found);
        prop_assert_eq!(found, expected);
    }
}

#[test]
fn the_surface_moves_with_the_part_and_the_belt_along_it() {
    let belt = MotionKind::Conveyor { velocity: vec3(2.0, 0.0, 1.0) };
    let lift = MotionKind::Translate { velocity: vec3(0.0, 0.0, 0.5) };
    let floor = Surface::Plane { point: Vec3::zeros(), normal: Vec3::z() };
    let mut walls = Walls::new(&[moving(floor, &[belt, lift])]);
    walls.set_time(2.0);
    let centre = vec3(0.0, 0.0, 1.0 + 0.9 * RADIUS);
    let found = touch(&walls, &centre, RADIUS);
    assert_touch(&found[0], &centre, &vec3(0.0, 0.0, 1.0), RADIUS);
    assert_eq!(surface_velocity(&walls, &found[0].point, &found[0].normal), vec3(2.0, 0.0, 0.5));
    assert_eq!(walls.speed_bound(), 0.5);
    walls.set_present(0, false);
    assert_eq!(walls.speed_bound(), 0.0);
}

#[test]
fn turning_about_its_own_axis_brings_a_surface_nowhere() {
    let turn = |origin: Vec3, axis: Vec3| MotionKind::Rotate { origin, axis, rate: 5.0 };
    let start = vec3(1.0, 0.0, 0.0);
    let drum = || Surface::Frustum { start, end: vec3(1.0, 2.0, 0.0), start_radius: 0.5, end_radius: 0.5 };
    let own = turn(vec3(1.0, 7.0, 0.0), -Vec3::y());
    assert_eq!(Walls::new(&[moving(drum(), std::slice::from_ref(&own))]).speed_bound(), 0.0);
    let walls = Walls::new(&[moving(drum(), &[own])]);
    assert!((surface_velocity(&walls, &vec3(1.5, 0.0, 0.0), &Vec3::x()) - vec3(0.0, 0.0, 2.5)).norm() < 1e-15);
    let bound = Walls::new(&[moving(drum(), &[turn(Vec3::zeros(), Vec3::y())])]).speed_bound();
    assert!((bound - 5.0 * 1.5_f64.hypot(0.5)).abs() < 1e-14);
    // a table turns in itself; a swinging one has no bound, and is always looked at instead
    let table = || Surface::Plane { point: Vec3::zeros(), normal: Vec3::z() };
    let far = vec3(100.0, 0.0, 5.0);
    let mut found = Vec::new();
    let turntable = Walls::new(&[moving(table(), &[turn(Vec3::zeros(), Vec3::z())])]);
    turntable.candidates(&far, RADIUS, &mut found);
    assert!(found.is_empty() && turntable.speed_bound() == 0.0);
    let flap = Walls::new(&[moving(table(), &[turn(Vec3::zeros(), Vec3::y())])]);
    flap.candidates(&far, RADIUS, &mut found);
    assert!(found.len() == 1 && flap.speed_bound() == 0.0);
}

#[test]
fn bounds_follow_the_present_pose() {
    let one = vec3(1.0, 1.0, 1.0);
    let block = Surface::Mesh(TriangleMesh::box_mesh(&Vec3::zeros(), &one));
    let shift = MotionKind::Translate { velocity: vec3(1.0, 0.0, 0.0) };
    let floor = Surface::Plane { point: Vec3::zeros(), normal: Vec3::z() };
    let mut walls = Walls::new(&[moving(block, &[shift]), part(floor)]);
    walls.set_time(3.0);
    let bounds = walls.bounds();
    assert!((Vec3::from(bounds.minimum) - vec3(3.0, 0.0, 0.0)).norm() < 1e-14);
    assert!((Vec3::from(bounds.maximum) - vec3(4.0, 1.0, 1.0)).norm() < 1e-14);
    assert_eq!(walls.part_names().len(), 2);
    walls.set_present(0, false);
    assert!(walls.bounds().is_empty());
}
