//! What a contact costs.

use crate::common::*;
use std::time::Instant;
use tollgate::dem::inspect::{ContactRecord, Partner};
use tollgate::dem::law::{LawSettings, RollingLaw};
use tollgate::math::{Bounds, Vec3, vec3};
use tollgate::particle::ParticleState;

/// Seconds per contact and time step of a pressed packing of radius `small`, with spheres twenty times as large in it or without.
fn cost(large_ones: bool) -> f64 {
    let small = 0.0005;
    // so that both packings have some 50 000 small spheres
    let cells: u64 = if large_ones { 44 } else { 37 };
    let pitch = 1.99 * small;
    let edge = pitch * cells as f64;
    let mut large: Vec<ParticleState> = Vec::new();
    if large_ones {
        // eight in the box: two fifths of its volume
        for k in 0..8_u32 {
            let share = |bit: u32| if k >> bit & 1 == 0 { 0.25 } else { 0.75 };
            let place = vec3(share(0), share(1), share(2)) * edge;
            large.push(grain(1_000_000 + u64::from(k), 20.0 * small, place, Vec3::zeros()));
        }
    }
    let fine = lattice([cells; 3], Vec3::repeat(0.5 * pitch), pitch, small, 0.0, &mut Draw(6));
    let apart = |a: &Vec3, b: &Vec3| (a - b).map(|x| x - (x / edge).round() * edge).norm();
    let mut states: Vec<ParticleState> = fine
        .into_iter()
        .filter(|p| large.iter().all(|l| apart(&l.position, &p.position) > l.radius + 0.7 * p.radius))
        .collect();
    states.extend(large);
    let law = LawSettings { rolling: RollingLaw::Epsd2, ..HERTZ };
    let mut setup = empty(small, law, pair(0.5, 0.4, 0.1));
    setup.domain = Bounds { minimum: [0.0; 3], maximum: [edge; 3] };
    setup.periodic = [true; 3];
    setup.overlap_limit = 1.9;
    setup.energy = false;
    let mut simulation = with(setup, &states);
    run(&mut simulation, 50);
    let contacts = simulation.contacts().len();
    let steps = 100;
    let started = Instant::now();
    run(&mut simulation, steps);
    let seconds = started.elapsed().as_secs_f64() / steps as f64;
    let now = simulation.contacts().len();
    assert!(contacts > 2 * simulation.particle_count(), "a pressed packing: {contacts}");
    if large_ones {
        let touching = |c: &ContactRecord| matches!(c.j, Partner::Particle(j) if j.serial() >= 1_000_000);
        let at_large = simulation.contacts().iter().filter(|contact| touching(contact)).count();
        assert!(at_large > 1000, "the large spheres are in it: {at_large}");
    }
    seconds / (0.5 * (contacts + now) as f64)
}

#[test]
#[ignore = "measures time on a quiet machine: run by ./validate"]
fn a_contact_costs_at_most_three_times_as_much_at_a_size_ratio_of_twenty() {
    let best = |large| (0..3).map(|_| cost(large)).fold(f64::INFINITY, f64::min);
    let (equal, mixed) = (best(false), best(true));
    println!("{:.1} ns a contact with equal sizes, {:.1} ns at 1:20: {:.2}", 1e9 * equal, 1e9 * mixed, mixed / equal);
    assert!(mixed < 3.0 * equal);
}
