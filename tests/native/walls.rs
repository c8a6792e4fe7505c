//! A surface is what it covers, however it is cut into triangles.

use crate::common::*;
use tollgate::dem::law::{LawSettings, RollingLaw};
use tollgate::dem::simulation::Simulation;
use tollgate::geometry::part::{Surface, TriangleMesh};
use tollgate::math::{Rotation, Vec3, vec3};
use tollgate::particle::ParticleState;

/// 10 mm spheres.
const RADIUS: f64 = 0.005;
/// Round-off of coordinates of 1 m is 1e-16 m, 1e-14 diameters a step; some 10^4 steps add up to far less than this.
const TOLERANCE: f64 = 1e-9 * 2.0 * RADIUS;

/// One triangle, 100 triangles and 10 000 triangles over the same floor, and the plane itself.
fn floors() -> Vec<Surface> {
    let corner = vec3(-0.5, -0.25, 0.0);
    let (a, b) = (vec3(1.0, 0.0, 0.0), vec3(0.0, 0.5, 0.0));
    let one = TriangleMesh::from_soup(&[[vec3(-4.0, -4.0, 0.0), vec3(8.0, -4.0, 0.0), vec3(-4.0, 8.0, 0.0)]]);
    let floors = [one, sheet(corner, a, b, 10, 5), sheet(corner, a, b, 100, 50)];
    assert_eq!(floors.each_ref().map(|mesh| mesh.triangles.len()), [1, 100, 10_000]);
    let plane = Surface::Plane { point: Vec3::zeros(), normal: Vec3::z() };
    std::iter::once(plane).chain(floors.map(Surface::Mesh)).collect()
}

/// States every 100 steps of a sphere that starts `above` the floor.
fn path(floor: &Surface, law: LawSettings, start: &ParticleState, steps: u64) -> Vec<ParticleState> {
    let mut setup = empty(RADIUS, law, pair(0.6, 0.3, 0.05));
    setup.gravity = gravity();
    setup.parts = vec![part("floor", floor.clone(), Vec::new())];
    let mut simulation = with(setup, &[*start]);
    let mut states = Vec::new();
    for _ in 0..steps / 100 {
        run(&mut simulation, 100);
        states.push(simulation.particles()[0]);
    }
    states
}

#[test]
fn a_plane_moves_a_sphere_alike_however_it_is_cut() {
    let epsd2 = LawSettings { rolling: RollingLaw::Epsd2, ..HERTZ };
    let cdt = LawSettings { rolling: RollingLaw::Cdt, ..LINEAR };
    // along the shared edge y = 0, across everything, nearly along a diagonal, and hopping
    let starts = [
        (vec3(-0.4, 0.0, 0.995 * RADIUS), vec3(0.5, 0.0, 0.0), vec3(0.0, -40.0, 0.0)),
        (vec3(-0.4, -0.2, 0.995 * RADIUS), vec3(0.5, 0.2, 0.0), vec3(30.0, 0.0, 20.0)),
        (vec3(-0.4, -0.2, 0.995 * RADIUS), vec3(0.4, 0.4 * (1.0 + 1e-7), 0.0), vec3(0.0, 0.0, 0.0)),
        (vec3(-0.4, 0.2, 3.0 * RADIUS), vec3(0.6, -0.3, 0.0), vec3(0.0, 60.0, -60.0)),
    ];
    let floors = floors();
    for law in [epsd2, cdt] {
        for (position, velocity, spin) in starts {
            let mut start = grain(0, RADIUS, position, velocity);
            start.spin = spin;
            let steps = (0.6 / empty(RADIUS, law, pair(0.6, 0.3, 0.05)).timestep) as u64;
            let expected = path(&floors[0], law, &start, steps);
            let way = (expected.last().unwrap().position - position).norm();
            assert!(way > 0.1, "the path crosses too few of the 1 cm triangles: {way} m");
            for floor in &floors[1..] {
                let got = path(floor, law, &start, steps);
                for (a, b) in expected.iter().zip(&got) {
                    let apart = (a.position - b.position).norm();
                    assert!(apart < TOLERANCE, "{apart:e} m apart at {:?}", a.position);
                    let turning = (a.spin - b.spin).norm() * RADIUS;
                    // over the 0.6 s of the run a difference in speed makes a difference in place
                    assert!(turning < TOLERANCE / 0.6, "{turning:e} m/s apart at {:?}", a.position);
                }
            }
        }
    }
}

/// Heights over the obstacle along `direction` while a sphere falls on it head-on and bounces.
fn bounce(obstacle: Surface, foot: &Vec3, direction: &Vec3) -> Vec<f64> {
    let mut setup = empty(RADIUS, HERTZ, pair(0.6, 0.3, 0.0));
    setup.parts = vec![part("obstacle", obstacle, Vec::new())];
    let start = grain(0, RADIUS, foot + direction * (1.02 * RADIUS), -0.4 * direction);
    let mut simulation = with(setup, &[start]);
    let mut heights = Vec::new();
    for _ in 0..2000 {
        run(&mut simulation, 1);
        heights.push((simulation.particles()[0].position - foot).dot(direction));
    }
    assert!(heights[1999] > 1.02 * RADIUS, "it has bounced");
    assert!(heights.iter().any(|height| *height < RADIUS), "it has touched");
    heights
}

#[test]
fn an_edge_and_a_vertex_hit_head_on_answer_like_a_plane() {
    let expected = bounce(Surface::Plane { point: Vec3::zeros(), normal: Vec3::z() }, &Vec3::zeros(), &Vec3::z());
    let cube = TriangleMesh::box_mesh(&vec3(-0.1, -0.1, -0.1), &vec3(0.1, 0.1, 0.1));
    // a wedge of 30 degrees whose ridge is cut into three
    let ridge = |x: f64| vec3(x, 0.0, 0.0);
    let low = |x: f64, side: f64| vec3(x, side * 15_f64.to_radians().tan(), -1.0);
    let mut soup = Vec::new();
    for pair in [-0.5, -0.1, 0.02, 0.5_f64].windows(2) {
        for side in [-1.0, 1.0] {
            soup.push([ridge(pair[0]), ridge(pair[1]), low(pair[0], side)]);
            soup.push([ridge(pair[1]), low(pair[0], side), low(pair[1], side)]);
        }
    }
    let wedge = TriangleMesh::from_soup(&soup);
    let turned = Rotation::from_euler_angles(0.3, -0.8, 1.9);
    let away = vec3(0.4, -0.7, 0.2);
    let hits = [
        (&cube, vec3(0.03, 0.1, 0.1), vec3(0.0, 1.0, 1.0)),
        (&cube, vec3(0.1, 0.1, 0.1), vec3(1.0, 1.0, 1.0)),
        (&cube, vec3(0.1, 0.1, 0.1), vec3(0.2, 1.0, 0.4)),
        (&wedge, vec3(0.0, 0.0, 0.0), vec3(0.0, 0.0, 1.0)),
        (&wedge, vec3(0.02, 0.0, 0.0), vec3(0.0, 0.0, 1.0)),
    ];
    for (mesh, foot, direction) in hits {
        for rotation in [Rotation::identity(), turned] {
            let surface = Surface::Mesh(mesh.transform(1.0, &rotation, &away));
            let foot = rotation * foot + away;
            let got = bounce(surface, &foot, &(rotation * direction.normalize()));
            let worst = got.iter().zip(&expected).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
            assert!(worst < TOLERANCE, "{worst:e} m from the plane's bounce");
        }
    }
}

#[test]
fn a_corner_is_two_contacts_however_its_walls_are_cut() {
    // a sphere that rolls along a floor into a wall of the same part, at an angle
    let run_into = |cells: u32| {
        let mut setup = empty(RADIUS, HERTZ, pair(0.5, 0.4, 0.0));
        setup.gravity = gravity();
        setup.parts =
            vec![part("box", Surface::Mesh(open_box(vec3(-0.1, -0.1, 0.0), vec3(0.1, 0.1, 0.1), cells)), Vec::new())];
        let mut simulation = with(setup, &[grain(0, RADIUS, vec3(0.05, 0.013, 0.999 * RADIUS), vec3(0.6, 0.1, 0.0))]);
        let mut states = Vec::new();
        let mut most = 0;
        for _ in 0..4000 {
            run(&mut simulation, 1);
            most = most.max(simulation.contacts().len());
            states.push(simulation.particles()[0]);
        }
        assert_eq!(most, 2, "floor and wall");
        states
    };
    let (whole, cut) = (run_into(1), run_into(23));
    for (a, b) in whole.iter().zip(&cut) {
        assert!((a.position - b.position).norm() < TOLERANCE, "{:?} {:?}", a.position, b.position);
    }
}

#[test]
fn a_moving_mesh_carries_and_a_plane_swinging_through_hits() {
    use tollgate::geometry::motion::MotionKind::{Rotate, Translate};
    // a plate that flies at 5 m/s into a resting sphere, many skins a second; restitution 1: the sphere leaves at 10 m/s
    let mut setup = empty(RADIUS, HERTZ, pair(1.0, 0.3, 0.0));
    setup.overlap_limit = 0.9;
    setup.timestep *= 0.1;
    let plate = sheet(vec3(0.2, -0.1, -0.1), vec3(0.0, 0.2, 0.0), vec3(0.0, 0.0, 0.2), 7, 7);
    setup.parts = vec![part("plate", Surface::Mesh(plate), vec![Translate { velocity: vec3(-5.0, 0.0, 0.0) }])];
    let steps = (0.045 / setup.timestep) as u64;
    let mut simulation = with(setup, &[grain(0, RADIUS, Vec3::zeros(), Vec3::zeros())]);
    run(&mut simulation, steps);
    let speed = simulation.particles()[0].velocity.x;
    // more than a hundred steps a contact: the integration error of an elastic impact is of the order of 1e-4
    assert!((speed + 10.0).abs() < 10.0 * 1e-3, "{speed} m/s");

    // a plane that swings about a far axis sweeps past the sphere: it is pushed along and never lies behind
    let mut setup = empty(RADIUS, HERTZ, pair(0.5, 0.3, 0.0));
    let surface = Surface::Plane { point: vec3(0.0, 0.0, -0.1), normal: Vec3::z() };
    let swing = Rotate { origin: vec3(-2.0, 0.0, -0.1), axis: vec3(0.0, -1.0, 0.0), rate: 0.5 };
    setup.parts = vec![part("flap", surface, vec![swing])];
    let steps = (0.2 / setup.timestep) as u64;
    let mut simulation = Simulation::new(setup);
    simulation.insert(&[grain(0, RADIUS, Vec3::zeros(), Vec3::zeros())]);
    run(&mut simulation, steps);
    let state = simulation.particles()[0];
    let angle: f64 = 0.5 * simulation.time();
    let normal = vec3(-angle.sin(), 0.0, angle.cos());
    let height = (state.position - vec3(-2.0, 0.0, -0.1)).dot(&normal);
    assert!(height > 0.95 * RADIUS, "{height} m over the flap");
    assert!(state.velocity.norm() > 0.9, "the flap moves at 1 m/s here: {}", state.velocity);
}
