//! Borders: leaving, repeating, removing.

use crate::common::*;
use std::collections::BTreeMap;
use tollgate::dem::law::{LawSettings, RollingLaw};
use tollgate::dem::removal::RemovalCause;
use tollgate::geometry::part::Surface;
use tollgate::math::{Bounds, Vec3, vec3};
use tollgate::particle::Body;

const RADIUS: f64 = 0.005;

#[test]
fn leavers_are_counted_by_the_border_they_cross() {
    let mut setup = empty(RADIUS, HERTZ, pair(0.5, 0.3, 0.0));
    setup.domain = Bounds { minimum: [-0.1, -0.2, -0.3], maximum: [0.1, 0.2, 0.3] };
    let directions = [Vec3::x(), Vec3::y(), Vec3::z()];
    let mut states = Vec::new();
    let mut expected = BTreeMap::new();
    for (axis, direction) in directions.into_iter().enumerate() {
        for upper in [false, true] {
            // 1, 2, ... 6 particles through the six borders, one behind the other
            let count = 2 * axis as u64 + u64::from(upper) + 1;
            expected.insert(RemovalCause::border(axis, upper), count);
            for number in 0..count {
                let way = direction * if upper { 1.0 } else { -1.0 };
                let place = way * (0.02 + 0.011 * number as f64);
                states.push(grain(states.len() as u64, RADIUS, place, way));
            }
        }
    }
    let mut simulation = with(setup, &states);
    let steps = (0.35 / simulation.setup().timestep) as u64;
    run(&mut simulation, steps);
    let mut counted = BTreeMap::new();
    for removal in simulation.removed() {
        *counted.entry(removal.cause).or_insert(0) += 1;
        // free flight: it left when its centre crossed, to the time step
        let state = states.iter().find(|state| state.id == removal.id).unwrap();
        let axis = state.velocity.iamax();
        let due = (simulation.setup().domain.maximum[axis] - state.position[axis].abs()) / state.velocity.norm();
        assert!((removal.time - due).abs() <= 2.0 * simulation.setup().timestep, "{removal:?} due {due}");
    }
    assert_eq!(counted, expected);
    assert_eq!(simulation.particle_count(), 0);
    let budget = simulation.energy();
    assert!(budget.sum().abs() < 1e-12 * budget.inserted, "all that came in went out: {budget:?}");
}

#[test]
fn a_collision_across_a_periodic_border_is_the_one_in_the_middle() {
    let law = LawSettings { rolling: RollingLaw::Epsd2, ..HERTZ };
    let length = 0.25;
    for axis in 0..3 {
        let run_at = |shift: f64| {
            let mut setup = empty(RADIUS, law, pair(0.7, 0.4, 0.1));
            setup.domain = Bounds { minimum: [0.0; 3], maximum: [length; 3] };
            setup.periodic = std::array::from_fn(|k| k == axis);
            let along = Vec3::from_fn(|k, _| if k == axis { 1.0 } else { 0.0 });
            let middle = Vec3::repeat(0.5 * length) + along * (shift - 0.5 * length);
            let aside = Vec3::from_fn(|k, _| if k == (axis + 1) % 3 { 0.3 * RADIUS } else { 0.0 });
            let mut a = grain(0, RADIUS, middle - along * (1.2 * RADIUS), 0.5 * along);
            let mut b = grain(1, 0.8 * RADIUS, middle + along * (1.2 * RADIUS) + aside, -0.3 * along);
            (a.spin, b.spin) = (vec3(10.0, 20.0, -30.0), vec3(-5.0, 40.0, 7.0));
            let mut simulation = with(setup, &[a, b]);
            run(&mut simulation, 600);
            (simulation.particles(), simulation.energy())
        };
        // powers of two, so that the shift itself loses no bit that matters
        let (middle, expected) = run_at(0.5 * length);
        for shift in [0.0, length, 0.5 * RADIUS] {
            let (states, budget) = run_at(shift);
            for (a, b) in states.iter().zip(&middle) {
                // 600 steps with coordinates of 0.25 m: round-off 600 * 3e-17 m and its growth in one collision
                assert!((a.velocity - b.velocity).norm() < 1e-9, "{:e}", (a.velocity - b.velocity).norm());
                assert!((a.spin - b.spin).norm() * RADIUS < 1e-9);
                let apart = a.position - b.position;
                let rest = (apart[axis] - shift + 0.5 * length).rem_euclid(length);
                assert!(rest.min(length - rest) < 1e-11, "{rest}");
                let across = (0..3).filter(|k| *k != axis).map(|k| apart[k].abs()).fold(0.0, f64::max);
                assert!(across < 1e-11, "{across}");
            }
            assert!((budget.dissipated() - expected.dissipated()).abs() < 1e-9 * expected.dissipated());
            assert!(expected.dissipated() > 0.0, "they have collided");
        }
    }
}

#[test]
fn a_bed_in_a_periodic_box_is_the_bed_moved_along() {
    let length = 8.0 * 2.0 * RADIUS;
    let settle = |shift: f64| {
        let mut setup = empty(RADIUS, HERTZ, pair(0.5, 0.4, 0.0));
        setup.gravity = gravity();
        setup.domain = Bounds { minimum: [0.0, 0.0, -0.1], maximum: [length, length, 2.0] };
        setup.periodic = [true, true, false];
        setup.parts = vec![plane("floor", Vec3::zeros(), Vec3::z())];
        let cloud = lattice([7, 7, 5], vec3(0.003, 0.002, 0.01), 2.2 * RADIUS, RADIUS, 0.1, &mut Draw(9));
        let moved: Vec<_> = cloud
            .into_iter()
            .map(|mut state| {
                state.position.x += shift;
                state
            })
            .collect();
        let mut simulation = with(setup, &moved);
        run(&mut simulation, 1000);
        simulation
    };
    let still = settle(0.0);
    let moved = settle(0.37 * length);
    assert_eq!(still.contacts().len(), moved.contacts().len());
    assert!(still.contacts().len() > 100, "{}", still.contacts().len());
    for (a, b) in still.particles().iter().zip(&moved.particles()) {
        // round-off 1e-17 m grows in collisions, by the ratio of free path to radius each; a handful of them here
        assert!((a.velocity - b.velocity).norm() < 1e-7, "{:e}", (a.velocity - b.velocity).norm());
    }
}

#[test]
fn a_chute_that_repeats_downhill_keeps_its_books() {
    // gravity has a component along a periodic axis: particles run down and come back at the top
    let mut setup = empty(RADIUS, HERTZ, pair(0.5, 0.4, 0.0));
    let slope = 25_f64.to_radians();
    setup.gravity = vec3(9.81 * slope.sin(), 0.0, -9.81 * slope.cos());
    setup.domain = Bounds { minimum: [0.0, 0.0, -0.1], maximum: [0.08, 0.08, 2.0] };
    setup.periodic = [true, true, false];
    // the books close with the square of the time step
    setup.timestep *= 0.5;
    setup.parts = vec![plane("bed", Vec3::zeros(), Vec3::z())];
    let mut cloud = lattice([6, 6, 3], vec3(0.005, 0.005, 0.006), 2.4 * RADIUS, RADIUS, 0.1, &mut Draw(2));
    cloud.iter_mut().for_each(|state| state.velocity.x += 1.0);
    let mut simulation = with(setup, &cloud);
    let start = simulation.energy().sum();
    run(&mut simulation, 10_000);
    let budget = simulation.energy();
    // the way down gives m g sin(slope) v t; the books must not wander by more than the time step's error
    assert!(budget.dissipated() > 0.0 && budget.inserted > 0.0);
    assert!((budget.sum() - start).abs() < 1e-3 * budget.dissipated(), "{:e} of {budget:?}", budget.sum() - start);
}

#[test]
fn removing_a_particle_leaves_the_others_contacts_alone() {
    let mut setup = empty(RADIUS, LawSettings { rolling: RollingLaw::Epsd2, ..HERTZ }, pair(0.4, 0.5, 0.1));
    setup.gravity = gravity();
    setup.parts = vec![part("box", Surface::Mesh(open_box(vec3(0.0, 0.0, 0.0), vec3(0.08, 0.08, 0.2), 3)), Vec::new())];
    let cloud = lattice([7, 7, 17], vec3(0.006, 0.006, 0.006), 2.2 * RADIUS, RADIUS, 0.05, &mut Draw(4));
    let mut simulation = with(setup, &cloud);
    run(&mut simulation, 3000);
    let before = simulation.contacts();
    let gone: Vec<_> = cloud.iter().map(|state| state.id).step_by(50).collect();
    let sum = simulation.energy().sum();
    simulation.remove_particles(&gone, RemovalCause::Asked);
    let mut after = simulation.contacts().into_iter();
    let involves = |c: &tollgate::dem::inspect::ContactRecord| {
        use tollgate::dem::inspect::Partner::Particle;
        gone.contains(&c.i) || matches!(c.j, Particle(j) if gone.contains(&j))
    };
    for contact in before.iter().filter(|c| !involves(c)) {
        let held = after.next().expect("no contact is lost");
        assert_eq!((held.i, held.j), (contact.i, contact.j));
        // the same bits, perhaps seen from the other particle
        assert!((held.force - contact.force).norm() <= 1e-13 * contact.force.norm());
    }
    assert!(after.next().is_none());
    assert_eq!(simulation.removed().len(), gone.len());
    assert!(simulation.removed().iter().all(|removal| removal.cause == RemovalCause::Asked));
    let jump = simulation.energy().sum() - sum;
    assert!(jump.abs() < 1e-12 * simulation.energy().inserted, "{jump:e}");
    run(&mut simulation, 10);
}

#[test]
fn discs_stay_in_their_plane() {
    let thickness = 0.004;
    let mut setup = empty(RADIUS, LawSettings { rolling: RollingLaw::Epsd2, ..LINEAR }, pair(0.5, 0.4, 0.1));
    setup.body = Body::Disc { thickness };
    // a scene that is not flat itself: gravity, velocities, spins and a wall's normal point out of the plane
    setup.gravity = vec3(1.0, 2.0, -9.0);
    setup.parts =
        vec![plane("floor", Vec3::zeros(), vec3(0.1, 0.0, 1.0)), plane("side", vec3(-0.03, 0.0, 0.0), Vec3::x())];
    let mut states = Vec::new();
    for k in 0..60_u64 {
        let place = vec3(0.011 * (k % 6) as f64, 0.0, 0.01 + 0.011 * (k / 6) as f64);
        let mut state = grain(k, RADIUS * (0.6 + 0.4 * (k % 3) as f64 / 2.0), place, vec3(0.1, 0.3, -0.2));
        state.spin = vec3(4.0, 5.0, 6.0);
        states.push(state);
    }
    let mut simulation = with(setup, &states);
    let moved: f64 = simulation.energy().kinetic;
    let disc = |r: f64| std::f64::consts::PI * r * r * thickness * DENSITY;
    let expected: f64 = states.iter().map(|s| 0.5 * disc(s.radius) * (0.1_f64.powi(2) + 0.2_f64.powi(2))).sum();
    assert!((moved - expected).abs() < 1e-12 * expected, "mass of a disc: {moved} {expected}");
    let turned = simulation.energy().rotational;
    let expected: f64 = states.iter().map(|s| 0.5 * 0.5 * disc(s.radius) * s.radius.powi(2) * 25.0).sum();
    assert!((turned - expected).abs() < 1e-12 * expected, "inertia of a disc: {turned} {expected}");
    // They fall in a heap and run down the floor: how many touch at its end is chance, not how many do on the way.
    let mut most = 0;
    for _ in 0..40 {
        run(&mut simulation, 100);
        most = most.max(simulation.contacts().len());
        for state in simulation.particles() {
            assert_eq!((state.position.y, state.velocity.y), (0.0, 0.0));
            assert_eq!((state.spin.x, state.spin.z), (0.0, 0.0));
        }
    }
    assert!(most > 30, "{most} contacts of 60 discs");
}
