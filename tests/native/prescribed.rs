//! Particles on prescribed paths.

use crate::common::*;
use tollgate::dem::law::RollingLaw;
use tollgate::dem::law::{LawSettings, NormalLaw};
use tollgate::dem::particles::Path;
use tollgate::material::{PairContact, PairProperties};
use tollgate::math::{Vec3, vec3};

const RADIUS: f64 = 0.002;

#[test]
fn prescribed_paths_are_exact_and_heed_no_contact() {
    let mut setup = empty(RADIUS, HERTZ, pair(0.5, 0.4, 0.0));
    setup.gravity = vec3(0.3, 0.0, -9.81);
    setup.parts = vec![plane("floor", vec3(0.0, 0.0, -0.02), Vec3::z())];
    setup.overlap_limit = 1.9;
    let timestep = setup.timestep;
    let start = [(vec3(0.0, 0.0, 0.0), vec3(0.4, 0.1, -0.5)), (vec3(0.05, 0.0, 0.0), vec3(-0.5, 0.0, 0.2))];
    let mut states: Vec<_> = (0..2).map(|k| grain(k, RADIUS, start[k as usize].0, start[k as usize].1)).collect();
    states.iter_mut().for_each(|state| state.spin = vec3(3.0, 20.0, -7.0));
    // free particles in their way
    for k in 0..20_u64 {
        states.push(grain(10 + k, RADIUS, vec3(0.002 + 0.0045 * k as f64, 0.0001, -0.012), Vec3::zeros()));
    }
    let mut simulation = with(setup, &states);
    simulation.prescribe(&[id(0), id(99)], Path::Constant);
    simulation.prescribe(&[id(1)], Path::Ballistic);
    let steps = (0.06 / timestep) as u64;
    let mut pushed = 0.0_f64;
    for _ in 0..steps {
        run(&mut simulation, 1);
        pushed = pushed.max(simulation.contact_force(id(0)).unwrap().norm());
    }
    assert!(pushed > 0.0, "it has met somebody");
    let time = simulation.time();
    let g = simulation.setup().gravity;
    let now = simulation.particles();
    // adding up round-off of 1e-18 m a step over some thousand steps
    let close = |got: Vec3, expected: Vec3| assert!((got - expected).norm() < 1e-14, "{got} {expected}");
    close(now[0].position, start[0].0 + start[0].1 * time);
    assert_eq!(now[0].velocity, start[0].1);
    close(now[1].position, start[1].0 + start[1].1 * time + 0.5 * g * time * time);
    close(1e-2 * now[1].velocity, 1e-2 * (start[1].1 + g * time));
    assert_eq!((now[0].spin, now[1].spin), (states[0].spin, states[1].spin));
    assert!(now[1].position.z < -0.02 + RADIUS || now[0].position.z < -0.02 + RADIUS, "not even the floor stops them");
}

#[test]
fn a_prescribed_particle_acts_with_its_true_mass() {
    // A moving sphere of prescribed velocity hits a resting free one of the same size; linear spring and dashpot given directly.
    // In the pair law the effective mass is m/2 (it enters nothing here but the reference), the free one's motion is that of m
    // against a spring and dashpot whose other end moves at v: m x'' = k (v t - x) + c (v - x').
    let (stiffness, damping) = (1000.0, 0.01);
    let contact = PairContact::Stiffness {
        normal_stiffness: stiffness,
        tangential_stiffness: 300.0,
        normal_damping: damping,
        tangential_damping: 0.0,
    };
    let law = LawSettings { normal: NormalLaw::Linear, attraction: true, ..HERTZ };
    let mut setup = empty(RADIUS, law, PairProperties { contact, sliding_friction: 0.4, rolling_friction: 0.0 });
    let mass = DENSITY * 4.0 / 3.0 * std::f64::consts::PI * RADIUS.powi(3);
    // 2000 steps a contact: the time step's error is of the order of 1e-6
    setup.timestep = std::f64::consts::PI * (mass / stiffness).sqrt() / 2000.0;
    let timestep = setup.timestep;
    let speed = 1.0;
    let ghost = grain(0, RADIUS, vec3(-2.0 * RADIUS, 0.0, 0.0), vec3(speed, 0.0, 0.0));
    let mut simulation = with(setup, &[ghost, grain(1, RADIUS, Vec3::zeros(), Vec3::zeros())]);
    simulation.prescribe(&[id(0)], Path::Constant);
    run(&mut simulation, 2500);
    let got = simulation.particles()[1].velocity.x;
    // in the frame of the ghost the free one rebounds: v' = v (1 + e), e = exp(-pi c / (2 m w)), w^2 = k/m - (c/2m)^2
    let rate = damping / (2.0 * mass);
    let omega = (stiffness / mass - rate * rate).sqrt();
    let expected = speed * (1.0 + (-std::f64::consts::PI * rate / omega).exp());
    assert!((got - expected).abs() < 1e-4 * expected, "{got} {expected}");
    let budget = simulation.energy();
    // the ghost's account: the work of its force on the other over its own way
    let work = mass * got * speed;
    assert!((budget.prescribed_work - work).abs() < 1e-3 * work, "{budget:?} {work}");
    assert!((budget.sum()).abs() < 1e-3 * work, "{budget:?}");
    assert_eq!(budget.wall_work, 0.0);

    // with restitution the true mass makes the damping: m/2, not the free particle's m
    let mut setup = empty(RADIUS, LawSettings { attraction: true, ..LINEAR }, pair(0.4, 0.0, 0.0));
    setup.timestep = timestep;
    let mut simulation = with(setup, &[ghost, grain(1, RADIUS, Vec3::zeros(), Vec3::zeros())]);
    simulation.prescribe(&[id(0)], Path::Constant);
    run(&mut simulation, 20_000);
    let got = simulation.particles()[1].velocity.x;
    // damping c = 2 beta sqrt(m/2 k) acts on a body of mass m: share of critical damping beta / sqrt 2
    let logarithm = 0.4_f64.ln();
    let beta = -logarithm / (std::f64::consts::PI.powi(2) + logarithm * logarithm).sqrt() / 2.0_f64.sqrt();
    let expected = speed * (1.0 + (-std::f64::consts::PI * beta / (1.0 - beta * beta).sqrt()).exp());
    assert!((got - expected).abs() < 1e-3, "{got} {expected}");
}

#[test]
fn release_goes_on_as_a_free_particle_and_keeps_the_books() {
    let mut setup = empty(RADIUS, LawSettings { rolling: RollingLaw::Epsd2, ..HERTZ }, pair(0.6, 0.4, 0.1));
    setup.gravity = gravity();
    setup.overlap_limit = 1.5;
    setup.parts = vec![plane("floor", Vec3::zeros(), Vec3::z())];
    let cloud = lattice([5, 5, 5], vec3(0.0, 0.0, 0.0021), 2.0 * RADIUS, RADIUS, 0.1, &mut Draw(8));
    let mut simulation = with(setup, &cloud);
    run(&mut simulation, 500);
    let start = simulation.energy().sum();
    let chosen: Vec<_> = cloud.iter().map(|state| state.id).step_by(3).collect();
    for (round, path) in
        [Path::Constant, Path::Free, Path::Ballistic, Path::Constant, Path::Free].into_iter().enumerate()
    {
        let sum = simulation.energy().sum();
        match path {
            Path::Free => release_as_they_are(&mut simulation, &chosen),
            _ => simulation.prescribe(&chosen, path),
        }
        let jump = simulation.energy().sum() - sum;
        let scale = simulation.energy().inserted;
        // changing a path moves nothing: the books close to round-off
        assert!(jump.abs() < 1e-12 * scale, "round {round}: {jump:e} of {scale:e}");
        run(&mut simulation, 150);
    }
    let budget = simulation.energy();
    assert!((budget.sum() - start).abs() < 2e-2 * budget.dissipated(), "{:e} {budget:?}", budget.sum() - start);

    // a lone particle released in flight flies as one that was never prescribed
    let mut setup = empty(RADIUS, HERTZ, pair(0.6, 0.4, 0.0));
    setup.gravity = gravity();
    let thrown = grain(0, RADIUS, Vec3::zeros(), vec3(0.3, 0.2, 1.0));
    let mut free = with(setup.clone(), &[thrown]);
    let mut held = with(setup, &[thrown]);
    held.prescribe(&[id(0)], Path::Ballistic);
    run(&mut free, 400);
    run(&mut held, 200);
    release_as_they_are(&mut held, &[id(0)]);
    run(&mut held, 200);
    assert_eq!(free.particles(), held.particles());
}
