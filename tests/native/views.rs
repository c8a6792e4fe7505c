//! Looking at the particles near a plane only.

use crate::common::*;
use tollgate::dem::ghost::PrescribedMotion;
use tollgate::dem::particles::Path;
use tollgate::dem::view::{NearPlane, ParticleView, PlaneDistance};
use tollgate::math::{Vec3, vec3};
use tollgate::particle::ParticleId;

const RADIUS: f64 = 0.002;

/// Distance of a particle's lowest point behind the slanted plane through the origin.
fn normal() -> Vec3 {
    vec3(0.6, 0.0, -0.8)
}
const PER_RADIUS: f64 = 0.8;
const ZONE: std::ops::RangeInclusive<f64> = -0.004..=0.003;

fn is_near(view: &ParticleView) -> bool {
    ZONE.contains(&(view.position.dot(&normal()) + view.radius * PER_RADIUS))
}

#[test]
fn nobody_near_the_plane_is_missed_however_the_lists_age() {
    let mut setup = empty(RADIUS, HERTZ, pair(0.5, 0.4, 0.0));
    setup.gravity = gravity();
    setup.overlap_limit = 1.9;
    setup.parts = vec![plane("floor", vec3(0.0, 0.0, -0.03), Vec3::z())];
    let mut draw = Draw(7);
    let mut states = Vec::new();
    for k in 0..400_u64 {
        let place = vec3((k % 10) as f64, (k / 10 % 5) as f64, (k / 50) as f64) * 0.0045 - vec3(0.02, 0.01, 0.01);
        let radius = RADIUS * (0.6 + 0.4 * draw.uniform());
        states.push(grain(k, radius, place, vec3(draw.uniform(), 0.0, -draw.uniform())));
    }
    let mut simulation = with(setup, &states);
    let distance = PlaneDistance::new(&Vec3::zeros(), &normal(), PER_RADIUS);
    let mut zone = NearPlane::new(distance, ZONE);
    let (mut shown, mut near, mut most) = (0, 0, 0);
    let steps = (0.04 / simulation.setup().timestep) as u64;
    for step in 0..steps {
        match step {
            // Jumps wider than any skin, into the zone and out of it.
            500 => assert!(simulation.displace(id(399), vec3(0.0, 0.0, -0.02))),
            501 => assert!(simulation.displace(id(399), vec3(0.03, 0.0, 0.05))),
            // Others come and go.
            700 => simulation.insert(&[grain(1000, RADIUS, vec3(0.0, 0.03, 0.0), Vec3::zeros())]),
            800 => simulation.remove_particles(&[id(3), id(250)], tollgate::dem::removal::RemovalCause::Asked),
            _ => {}
        }
        let found: Vec<ParticleView> = simulation.views_near(&mut zone).collect();
        let wanted: Vec<ParticleView> = simulation.views().filter(is_near).collect();
        let kept: Vec<ParticleView> = found.iter().filter(|view| is_near(view)).copied().collect();
        assert!(kept == wanted, "in step {step}");
        let all: Vec<ParticleView> = simulation.views_at(zone.plane(), ZONE).collect();
        assert!(all == wanted, "in step {step}");
        (shown, near, most) = (shown + found.len(), near + wanted.len(), most.max(wanted.len()));
        run(&mut simulation, 1);
    }
    assert!(most > 10 && shown < simulation.particle_count() * steps as usize, "{shown} shown, {near} near");
}

#[test]
fn whoever_joins_the_steered_ones_is_steered_from_then_on() {
    let setup = empty(RADIUS, HERTZ, pair(0.5, 0.4, 0.0));
    let states: Vec<_> = (0..4).map(|k| grain(k, RADIUS, vec3(0.01 * k as f64, 0.0, 0.0), Vec3::zeros())).collect();
    let mut simulation = with(setup, &states);
    let asked = |simulation: &mut tollgate::dem::simulation::Simulation| {
        let mut ids: Vec<ParticleId> = Vec::new();
        simulation.steer(|id| {
            ids.push(id);
            None::<PrescribedMotion>
        });
        ids.sort_unstable();
        ids
    };
    run(&mut simulation, 1);
    assert_eq!(asked(&mut simulation), []);
    simulation.prescribe(&[id(2)], Path::Recorded);
    assert_eq!(asked(&mut simulation), [id(2)]);
    simulation.prescribe(&[id(0)], Path::Recorded);
    assert_eq!(asked(&mut simulation), [id(0), id(2)]);
    simulation.prescribe(&[id(2)], Path::Constant);
    assert_eq!(asked(&mut simulation), [id(0)]);
    // The order of storage changes.
    simulation.insert(&[grain(9, RADIUS, vec3(-0.01, 0.0, 0.0), Vec3::zeros())]);
    assert_eq!(asked(&mut simulation), [id(0)]);
}
