//! The time step: velocity-Verlet with full-step velocities in the contact laws.
//!
//! With x, v, a at the time t: x += v dt + a dt^2 / 2; the laws see v + a dt, a first-order estimate of the velocity at t + dt
//! (Vyas, Ottino, Lueptow & Umbanhowar 2025), not the half-step velocity v + a dt / 2 that velocity-Verlet codes commonly pass
//! and that spoils static friction at large size ratios; the compatibility mode passes the latter. With the new loads,
//! v = v + (a_old + a_new) dt / 2. Spins likewise.

use super::law::Compatibility;
use super::neighborhood::Chunk;
use super::pair_contacts::{ContactScene, add_pair_loads};
use super::particles::{Acceleration, Load, Path, Velocity};
use super::simulation::Simulation;
use super::wall_contacts::{PartLoad, add_wall_loads};
use crate::math::Vec3;
use crate::particle::Body;
use std::ops::Range;
use std::time::Instant;

/// Splits a list at the chunks' borders.
fn split_at_chunks<T>(mut list: &mut [T], ranges: impl Iterator<Item = Range<usize>>) -> Vec<&mut [T]> {
    let mut pieces = Vec::new();
    for range in ranges {
        let (piece, rest) = list.split_at_mut(range.len());
        pieces.push(piece);
        list = rest;
    }
    pieces
}

impl Simulation {
    /// Share of a dt that the contact laws' velocities are ahead of the last full step.
    fn velocity_lead(&self) -> f64 {
        match self.setup.law.compatibility {
            Compatibility::Tollgate => 1.0,
            Compatibility::Liggghts => 0.5,
        }
    }

    /// What [`Simulation::advance`] adds to a particle's velocity [m/s].
    pub(super) fn velocity_gained(&self, index: usize) -> Vec3 {
        self.particles.accelerations[index].linear * (self.velocity_lead() * self.setup.timestep)
    }

    fn ranges(&self) -> Vec<Range<usize>> {
        self.neighborhood.chunks.iter().map(|chunk| chunk.range.clone()).collect()
    }

    /// Moves all particles to the end of the time step and gives them the velocities that the contact laws see.
    pub(super) fn advance(&mut self) {
        let started = Instant::now();
        let (dt, lead) = (self.setup.timestep, self.velocity_lead());
        let ranges = self.ranges();
        let mut farthest = vec![0.0_f64; ranges.len()];
        let accelerations = &self.particles.accelerations;
        let spheres = split_at_chunks(&mut self.particles.spheres, ranges.iter().cloned());
        let velocities = split_at_chunks(&mut self.particles.velocities, ranges.iter().cloned());
        let work = ranges.iter().zip(spheres).zip(velocities).zip(&mut farthest).collect();
        self.threads.for_each(work, |(((range, spheres), velocities), farthest)| {
            let mut square = 0.0_f64;
            let own = &accelerations[range.clone()];
            for ((sphere, velocity), acceleration) in spheres.iter_mut().zip(velocities).zip(own) {
                let linear = Vec3::from(velocity.linear);
                let way = linear * dt + acceleration.linear * (0.5 * dt * dt);
                sphere.centre = (sphere.position() + way).into();
                velocity.linear = (linear + acceleration.linear * (lead * dt)).into();
                velocity.angular = (Vec3::from(velocity.angular) + acceleration.angular * (lead * dt)).into();
                square = square.max(way.norm_squared());
            }
            *farthest = square;
        });
        let moved = farthest.into_iter().fold(0.0, f64::max).sqrt();
        self.neighborhood.note_motion(moved, self.walls.speed_bound() * dt);
        self.watchdog.note_displacement(moved);
        self.phases.integration += started.elapsed();
    }

    /// Loads and accelerations at time 0, memories untouched.
    pub(super) fn compute_initial_loads(&mut self) {
        self.loads_known = true;
        if self.neighborhood.chunks.is_empty() {
            return;
        }
        self.compute_loads(0.0);
        self.momentum.regrouped = true;
        let (gravity, body) = (self.setup.gravity, self.setup.body);
        for index in 0..self.particles.len() {
            let load = self.particles.loads[index];
            let (velocity, radius) = (&self.particles.velocities[index], self.particles.spheres[index].radius);
            let old = self.particles.accelerations[index];
            self.particles.accelerations[index] = acceleration(&load, velocity, radius, &old, &gravity, body);
        }
    }

    /// Loads on all particles and parts; memories move by `timestep` [s].
    pub(super) fn compute_loads(&mut self, timestep: f64) {
        let started = Instant::now();
        let terms = self.terms;
        let scene = ContactScene {
            spheres: &self.particles.spheres,
            velocities: &self.particles.velocities,
            accelerations: &self.particles.accelerations,
            law: &self.law,
            images: &self.neighborhood.images,
            timestep,
            overlap_limit: self.setup.overlap_limit,
            inertia_factor: self.setup.body.inertia_factor(),
        };
        let walls = &self.walls;
        let ranges: Vec<_> = self.neighborhood.chunks.iter().map(|chunk| chunk.range.clone()).collect();
        let loads = split_at_chunks(&mut self.particles.loads, ranges.into_iter());
        let work: Vec<(&mut Chunk, &mut [Load])> = self.neighborhood.chunks.iter_mut().zip(loads).collect();
        self.threads.for_each(work, |(chunk, loads)| {
            loads.fill(Load::ZERO);
            chunk.part_loads.fill(PartLoad::default());
            chunk.tally = super::energy::Tally::default();
            match (terms.friction, terms.rolling, terms.energy) {
                (false, _, false) => load_chunk::<false, false, false>(&scene, walls, chunk, loads),
                (false, _, true) => load_chunk::<false, false, true>(&scene, walls, chunk, loads),
                (true, false, false) => load_chunk::<true, false, false>(&scene, walls, chunk, loads),
                (true, false, true) => load_chunk::<true, false, true>(&scene, walls, chunk, loads),
                (true, true, false) => load_chunk::<true, true, false>(&scene, walls, chunk, loads),
                (true, true, true) => load_chunk::<true, true, true>(&scene, walls, chunk, loads),
            }
        });
        self.sum_chunks(timestep);
        self.phases.contacts += started.elapsed();
    }

    /// Sums what the chunks found, in their order.
    fn sum_chunks(&mut self, timestep: f64) {
        self.part_loads.fill(PartLoad::default());
        for chunk in &self.neighborhood.chunks {
            self.part_loads.iter_mut().zip(&chunk.part_loads).for_each(|(sum, load)| sum.add(load));
            self.booked.slip += chunk.tally.slip;
            self.booked.dashpot += chunk.tally.dashpot;
            self.booked.rolling += chunk.tally.rolling;
            self.booked.law_residual += chunk.tally.law_residual;
            if let Some(deep) = chunk.tally.deep {
                self.watchdog.note_deep(deep);
            }
        }
        self.booked.wall_work -= self.part_loads.iter().map(|load| load.power).sum::<f64>() * timestep;
    }

    /// Turns loads into velocities at the end of the time step.
    pub(super) fn correct(&mut self) {
        let started = Instant::now();
        let (dt, lead) = (self.setup.timestep, self.velocity_lead());
        let (gravity, body) = (self.setup.gravity, self.setup.body);
        let ranges = self.ranges();
        let mut notes = vec![StepNote::default(); ranges.len()];
        let (loads, spheres) = (&self.particles.loads, &self.particles.spheres);
        let velocities = split_at_chunks(&mut self.particles.velocities, ranges.iter().cloned());
        let accelerations = split_at_chunks(&mut self.particles.accelerations, ranges.iter().cloned());
        let work = self.neighborhood.chunks.iter().zip(velocities).zip(accelerations).zip(&mut notes).collect();
        self.threads.for_each(work, |(((chunk, velocities), accelerations), note)| {
            let range = &chunk.range;
            let mut springs = chunk.springs.iter();
            let own = loads[range.clone()].iter().zip(&spheres[range.clone()]);
            for ((velocity, old), (load, sphere)) in velocities.iter_mut().zip(accelerations).zip(own) {
                let new = acceleration(load, velocity, sphere.radius, old, &gravity, body);
                let linear = Vec3::from(velocity.linear) + (new.linear * 0.5 + old.linear * (0.5 - lead)) * dt;
                let angular = Vec3::from(velocity.angular) + (new.angular * 0.5 + old.angular * (0.5 - lead)) * dt;
                if let Some(spring) = springs.next() {
                    // The laws booked what they took at the velocities they saw; it was done at these.
                    let late = (linear - Vec3::from(velocity.linear), angular - Vec3::from(velocity.angular));
                    note.late_work += ((load.force - spring).dot(&late.0) + load.torque.dot(&late.1)) * dt;
                }
                velocity.linear = linear.into();
                velocity.angular = angular.into();
                *old = new;
                if velocity.path.is_prescribed() {
                    note.prescribed_force += load.force;
                    // Its contacts do this work on it; it gives the same to the others.
                    note.prescribed_work -= (load.force.dot(&linear) + load.torque.dot(&angular)) * dt;
                }
                note.speed_square_sum += linear.norm_squared() + angular.norm_squared();
                note.place_sum += sphere.centre.iter().sum::<f64>();
            }
        });
        let total = notes.iter().map(|note| note.speed_square_sum).sum::<f64>();
        self.booked.prescribed_work += notes.iter().map(|note| note.prescribed_work).sum::<f64>();
        self.momentum.ghost_force = notes.iter().map(|note| note.prescribed_force).sum();
        self.booked.dashpot -= notes.iter().map(|note| note.late_work).sum::<f64>();
        let places = notes.iter().map(|note| note.place_sum).sum::<f64>();
        self.watchdog.note_finite(total.is_finite() && places.is_finite());
        self.phases.integration += started.elapsed();
    }
}

/// What a chunk's particles did in a time step.
#[derive(Debug, Clone, Copy, Default)]
struct StepNote {
    /// Work that contacts did, springs in normal direction apart, beyond what the laws have booked [J].
    late_work: f64,
    prescribed_work: f64,
    /// Sum of the loads on prescribed particles [N].
    prescribed_force: Vec3,
    /// Finite exactly while every velocity is.
    speed_square_sum: f64,
    /// Finite exactly while every place is.
    place_sum: f64,
}

fn load_chunk<const FRICTION: bool, const ROLLING: bool, const ENERGY: bool>(
    scene: &ContactScene,
    walls: &super::wall::Walls,
    chunk: &mut Chunk,
    loads: &mut [Load],
) {
    let first = chunk.range.start;
    let tally = &mut chunk.tally;
    let springs = &mut chunk.springs;
    if ENERGY {
        springs.clear();
        springs.resize(loads.len(), Vec3::zeros());
    }
    add_pair_loads::<true, FRICTION, ROLLING, ENERGY>(scene, first, &mut chunk.own, loads, springs, tally);
    add_pair_loads::<false, FRICTION, ROLLING, ENERGY>(scene, first, &mut chunk.cross, loads, springs, tally);
    add_wall_loads::<FRICTION, ROLLING, ENERGY>(
        scene,
        walls,
        first,
        &chunk.near_walls,
        &mut chunk.wall_contacts,
        loads,
        springs,
        &mut chunk.part_loads,
        tally,
        &mut chunk.scratch,
    );
}

/// Acceleration of a particle under its load and gravity; a prescribed one follows its path, on a recorded path with the
/// acceleration `held` that came with it.
#[inline(always)]
pub(super) fn acceleration(
    load: &Load,
    velocity: &Velocity,
    radius: f64,
    held: &Acceleration,
    gravity: &Vec3,
    body: Body,
) -> Acceleration {
    match velocity.path {
        Path::Free | Path::Tethered => {
            let inverse_inertia = velocity.inverse_mass / (body.inertia_factor() * radius * radius);
            Acceleration {
                linear: body.in_plane(&(load.force * velocity.inverse_mass + gravity)),
                angular: body.about_plane(&(load.torque * inverse_inertia)),
            }
        }
        Path::Constant => Acceleration { linear: Vec3::zeros(), angular: Vec3::zeros() },
        Path::Recorded => *held,
        Path::Ballistic => Acceleration { linear: body.in_plane(gravity), angular: Vec3::zeros() },
    }
}
