//! Contacts as they are taken from one simulation and given to another.

use crate::common::*;
use std::collections::HashMap;
use tollgate::dem::ghost::PrescribedMotion;
use tollgate::dem::held_contact::HeldContact;
use tollgate::dem::inspect::Partner;
use tollgate::dem::law::{LawSettings, RollingLaw};
use tollgate::dem::particles::Path;
use tollgate::dem::release::Arrival;
use tollgate::dem::simulation::{Setup, Simulation};
use tollgate::dem::view::ParticleView;
use tollgate::geometry::part::Surface;
use tollgate::math::{Bounds, Vec3, vec3};
use tollgate::particle::{ParticleId, ParticleState};

const RADIUS: f64 = 0.005;

/// A bed of more than one chunk that has just been poured, on a plane, in a tube, beside a mesh.
fn poured() -> (Setup, Simulation) {
    let law = LawSettings { rolling: RollingLaw::Epsd2, ..HERTZ };
    let mut setup = empty(RADIUS, law, pair(0.5, 0.4, 0.1));
    setup.gravity = gravity();
    setup.overlap_limit = 0.9;
    let (start, end) = (Vec3::zeros(), vec3(0.0, 0.0, 1.0));
    let sheet = sheet(vec3(-0.06, -0.06, 0.0), vec3(0.12, 0.0, 0.0), vec3(0.0, 0.0, 0.1), 7, 5);
    setup.parts = vec![
        plane("floor", Vec3::zeros(), Vec3::z()),
        part("tube", Surface::Frustum { start, end, start_radius: 0.09, end_radius: 0.1 }, Vec::new()),
        part("sheet", Surface::Mesh(sheet), Vec::new()),
    ];
    let cloud = lattice([16, 16, 16], vec3(-0.075, -0.075, 0.006), 2.01 * RADIUS, RADIUS, 0.3, &mut Draw(7));
    let cloud: Vec<_> = cloud
        .into_iter()
        .filter(|p| p.position.xy().norm() < 0.084 && (p.position.y + 0.06).abs() > 1.1 * RADIUS)
        .collect();
    let mut simulation = with(setup.clone(), &cloud);
    run(&mut simulation, 1500);
    (setup, simulation)
}

fn motion(view: &ParticleView) -> PrescribedMotion {
    PrescribedMotion {
        position: view.position,
        velocity: view.velocity,
        spin: view.spin,
        acceleration: view.acceleration,
        spin_acceleration: view.spin_acceleration,
    }
}

/// Everything that the particles `ids` need to go on elsewhere.
fn arrivals(simulation: &Simulation, ids: &[ParticleId]) -> Vec<Arrival> {
    let states: HashMap<ParticleId, ParticleState> = simulation.particles().into_iter().map(|s| (s.id, s)).collect();
    let views: HashMap<ParticleId, ParticleView> = simulation.views().map(|view| (view.id, view)).collect();
    let arrival = |(id, contacts): (ParticleId, Vec<HeldContact>)| Arrival {
        state: states[&id],
        force: views[&id].force,
        torque: views[&id].torque,
        contacts: contacts.iter().map(|contact| (contact.partner, contact.memory)).collect(),
    };
    simulation.contacts_of(ids).into_iter().map(arrival).collect()
}

#[test]
fn contacts_are_the_same_seen_from_either_side() {
    let (_, simulation) = poured();
    let mut ids: Vec<ParticleId> = simulation.particles().iter().map(|state| state.id).collect();
    // neither the order asked for nor an unknown identity disturbs
    ids.reverse();
    ids.push(id(1_000_000));
    let held = simulation.contacts_of(&ids);
    assert!(held.iter().map(|(id, _)| id).eq(ids.iter().take(ids.len() - 1)));
    let held: HashMap<ParticleId, Vec<HeldContact>> = held.into_iter().collect();
    let all = simulation.contacts();
    let (mut sides, mut sliding) = (0, 0);
    for contact in &all {
        let find = |of: ParticleId, partner: Partner| {
            // a particle may touch one triangle once and one particle once
            held[&of].iter().find(|held| held.partner == partner).copied().expect("it is held")
        };
        let here = find(contact.i, contact.j);
        sides += 1;
        assert_eq!((here.normal, here.overlap), (contact.normal, contact.overlap));
        let scale = contact.force.norm();
        assert!((here.normal_force + here.tangential_force - contact.force).norm() <= 4e-16 * scale);
        // normal and tangential are meant
        assert!(here.normal_force.cross(&here.normal).norm() <= 1e-15 * scale);
        assert!(here.tangential_force.dot(&here.normal).abs() <= 1e-13 * scale, "{here:?}");
        sliding += usize::from(here.tangential_force.norm() > 1e-3 * scale);
        if let Partner::Particle(other) = contact.j {
            let there = find(other, Partner::Particle(contact.i));
            sides += 1;
            assert_eq!(there.memory, here.memory.mirrored());
            assert_eq!((there.normal, there.normal_force), (-here.normal, -here.normal_force));
            assert_eq!(there.tangential_force, -here.tangential_force);
            // each puts the point on the middle of the overlap, from its own centre
            assert!((there.point - here.point).norm() < 1e-15, "{:e}", (there.point - here.point).norm());
        }
    }
    assert_eq!(held.values().map(Vec::len).sum::<usize>(), sides, "nothing more is held");
    assert!(all.len() > 2000 && sliding > 1000, "{} {sliding}", all.len());
    // some, asked alone, are the same
    for (id, contacts) in simulation.contacts_of(&ids[17..19]) {
        assert_eq!(contacts, held[&id]);
    }
}

#[test]
fn a_bed_copied_particle_by_particle_goes_on() {
    let (setup, mut original) = poured();
    assert!(original.particle_count() > 1728, "two chunks and more: {}", original.particle_count());
    let ids: Vec<ParticleId> = original.particles().iter().map(|state| state.id).collect();
    let states: HashMap<ParticleId, ParticleState> = original.particles().into_iter().map(|s| (s.id, s)).collect();
    let arrivals = arrivals(&original, &ids);
    let held = original.contacts_of(&ids);
    let of_parts = |(partner, _): &&(Partner, _)| matches!(partner, Partner::Part { .. });
    let with_parts = arrivals.iter().flat_map(|arrival| &arrival.contacts).filter(of_parts).count() as u64;
    let with_particles = original.contacts().len() as u64 - with_parts;

    let mut copy = Simulation::new(setup.clone());
    // every third comes as an arrival that is not here yet
    let ghosts: Vec<_> = original.views().filter(|view| view.id.serial() % 3 > 0).collect();
    let ghosts: Vec<_> = ghosts.iter().map(|view| (states[&view.id], Path::Recorded, motion(view))).collect();
    copy.insert_prescribed(&ghosts);
    assert!(copy.contacts().is_empty(), "prescribed particles have no contacts among themselves");
    let count = copy.release(&arrivals);
    // of two that arrive together, the first brings the memory
    assert_eq!((count.restored, count.kept_by_solver), (with_particles, with_particles));
    assert_eq!((count.without_partner, count.with_parts), (0, with_parts));
    assert!(with_parts > 100 && with_particles > 2000);
    // every bit of the contacts is here, on both sides of every chunk's border
    assert!(copy.contacts_of(&ids) == held);
    let views = |simulation: &Simulation| -> HashMap<ParticleId, ParticleView> {
        simulation.views().map(|view| (view.id, view)).collect()
    };
    assert!(views(&copy) == views(&original), "places, velocities and accelerations");

    run(&mut original, 1);
    run(&mut copy, 1);
    let addends: HashMap<ParticleId, f64> = original
        .contacts_of(&ids)
        .into_iter()
        .map(|(id, held)| (id, held.iter().map(|contact| contact.normal_force.norm()).sum()))
        .collect();
    let (before, after) = (views(&original), views(&copy));
    for (id, view) in &before {
        let other = &after[id];
        assert_eq!(view.position, other.position);
        // round-off of up to ten addends in another order
        assert!((view.force - other.force).norm() <= 1e-15 * addends[id], "{view:?} {other:?}");
    }
    run(&mut original, 100);
    run(&mut copy, 100);
    for (a, b) in original.particles().iter().zip(&copy.particles()) {
        // round-off, through a few collisions: measured 1.5e-14 of a radius
        assert!((a.position - b.position).norm() < 1e-12 * RADIUS, "{:e}", (a.position - b.position).norm() / RADIUS);
    }
}

#[test]
fn what_finds_no_partner_is_counted() {
    let (setup, original) = poured();
    let is_whole = |contacts: &[HeldContact]| contacts.iter().any(|c| matches!(c.partner, Partner::Part { .. }));
    let ids: Vec<ParticleId> = original.particles().iter().map(|state| state.id).collect();
    let (chosen, contacts) = original
        .contacts_of(&ids)
        .into_iter()
        .find(|(_, contacts)| contacts.len() > 3 && is_whole(contacts))
        .expect("somebody lies at a wall");
    let partners: Vec<ParticleId> = contacts
        .iter()
        .filter_map(|contact| match contact.partner {
            Partner::Particle(id) => Some(id),
            Partner::Part { .. } => None,
        })
        .collect();
    let arrival = arrivals(&original, &[chosen]);
    let states: HashMap<ParticleId, ParticleState> = original.particles().into_iter().map(|s| (s.id, s)).collect();
    let view = |id: ParticleId| original.views().find(|view| view.id == id).expect("it is here");

    // the first partner is a ghost, the second is free, the others are not here; the part's number is not known
    let mut copy = with(setup, &[states[&partners[1]]]);
    copy.insert_prescribed(&[(states[&partners[0]], Path::Recorded, motion(&view(partners[0])))]);
    let mut arrival = arrival;
    let memory = arrival[0].contacts[0].1;
    arrival[0].contacts.push((Partner::Part { part: 99, element: 0 }, memory));
    let count = copy.release(&arrival);
    assert_eq!((count.restored, count.kept_by_solver), (1, 1));
    assert_eq!(count.without_partner, partners.len() as u64 - 2 + 1);
    assert_eq!(count.with_parts, (contacts.len() - partners.len()) as u64);
    let [(_, held)] = copy.contacts_of(&[chosen]).try_into().expect("one was asked for");
    let with = |partner: ParticleId| held.iter().find(|c| c.partner == Partner::Particle(partner)).expect("a contact");
    let stored = |partner: ParticleId| contacts.iter().find(|c| c.partner == Partner::Particle(partner)).expect("held");
    assert_eq!(with(partners[0]).memory, stored(partners[0]).memory);
    assert_eq!(with(partners[1]).memory.tangential, Vec3::zeros(), "the solver's own memory of a contact that is new");
    // whoever is free already is left alone
    let before = copy.record();
    assert_eq!(copy.release(&arrival), Default::default());
    assert!(copy.record().reals == before.reals);
}

#[test]
fn a_ghost_on_the_other_side_of_a_periodic_border_is_the_same_ghost() {
    // a ring of length 0.1 m along x: a ghost drives round it and pushes a resident before it
    let mut setup = empty(RADIUS, HERTZ, pair(0.5, 0.3, 0.0));
    setup.domain = Bounds { minimum: [0.0, -1.0, -1.0], maximum: [0.1, 1.0, 1.0] };
    setup.periodic = [true, false, false];
    let speed = 0.5;
    let timestep = setup.timestep;
    let ghost = grain(0, RADIUS, vec3(0.09, 0.0, 0.0), vec3(speed, 0.0, 0.0));
    let resident = grain(1, RADIUS, vec3(0.09 + 2.05 * RADIUS, 0.0, 0.0), Vec3::zeros());
    let at = |step: u64| PrescribedMotion {
        // the record never wraps: it lies rounds away after a while
        position: vec3(0.09 + speed * (step as f64 * timestep), 0.0, 0.0),
        velocity: vec3(speed, 0.0, 0.0),
        spin: Vec3::zeros(),
        acceleration: Vec3::zeros(),
        spin_acceleration: Vec3::zeros(),
    };
    let mut simulation = with(setup.clone(), &[resident]);
    simulation.insert_prescribed(&[(ghost, Path::Recorded, at(0))]);
    // without steering, a constant path does the same
    let mut reference = with(setup, &[ghost, resident]);
    reference.prescribe(&[id(0)], Path::Constant);
    let (mut pushed, mut sides) = (0, 0);
    for step in 1..=20_000 {
        run(&mut simulation, 1);
        simulation.steer(|_| Some(at(step)));
        run(&mut reference, 1);
        let pressure = simulation.ghost_pressure();
        pushed += pressure.len();
        for contact in &pressure {
            assert_eq!((contact.ghost, contact.resident), (id(0), id(1)));
            // the resident is driven forwards, and comes round to the ghost's back
            assert!(contact.overlap_ratio > 0.0 && contact.resident_velocity.x >= 0.0);
            sides |= u32::from(contact.normal_force.x > 0.0) + 2 * u32::from(contact.normal_force.x < 0.0);
        }
    }
    assert!(pushed > 5 && sides == 3, "{pushed} {sides}");
    assert!(at(20_000).position.x > 0.4, "four rounds");
    let (a, b) = (simulation.particles(), reference.particles());
    let gap = |x: f64| x - (x / 0.1).round() * 0.1;
    for (a, b) in a.iter().zip(&b) {
        assert!(gap(a.position.x - b.position.x).abs() < 1e-9, "{} {}", a.position.x, b.position.x);
        assert!((a.velocity - b.velocity).norm() < 1e-7, "{} {}", a.velocity, b.velocity);
    }
}
