//! The time step: velocity-Verlet with full-step velocities in the contact laws.
//!
//! With x, v, a at the time t: x += v dt + a dt^2 / 2; the laws see v + a dt, a first-order estimate of the velocity at t + dt
//! (Vyas, Ottino, Lueptow & Umbanhowar 2025), not the half-step velocity v + a dt / 2 that velocity-Verlet codes commonly pass
//! and that spoils static friction at large size ratios; the compatibility mode passes the latter. With the new loads,
//! v = v + (a_old + a_new) dt / 2. Spins likewise.

use super::integrate::{Advance, Correct, MotionNote, StepNote, acceleration, border_rows};
use super::law::Compatibility;
use super::meeting::ContactScene;
use super::neighborhood::Chunk;
use super::pair_contacts::PairKernel;
use super::particles::Load;
use super::simulation::Simulation;
use super::wall_contacts::{PartLoad, WallKernel};
use super::wall_search::WallSearch;
use crate::math::Vec3;
use crate::math::lanes::{LaneWork, Lanes, at_level};
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
        let mut notes = vec![MotionNote::default(); ranges.len()];
        let (domain, simd) = (border_rows(&self.setup.domain, self.setup.periodic), self.setup.simd);
        let accelerations = &self.particles.accelerations;
        let spheres = split_at_chunks(&mut self.particles.spheres, ranges.iter().cloned());
        let velocities = split_at_chunks(&mut self.particles.velocities, ranges.iter().cloned());
        let work = self.neighborhood.chunks.iter().zip(spheres).zip(velocities).zip(&mut notes).collect();
        let changes = self.sleep_changes;
        self.threads.for_each(work, |(((chunk, spheres), velocities), note)| {
            if chunk.is_still(changes) {
                return;
            }
            let accelerations = &accelerations[chunk.range.clone()];
            *note = at_level(simd, Advance { spheres, velocities, accelerations, dt, lead, domain: &domain });
        });
        let moved = notes.iter().map(|note| note.farthest_squared).fold(0.0, f64::max).sqrt();
        self.has_leavers = notes.iter().any(|note| note.leaves);
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
            only_material: self.neighborhood.only_material,
            images: &self.neighborhood.images,
            timestep,
            overlap_limit: self.setup.overlap_limit,
            inertia_factor: self.setup.body.inertia_factor(),
            sleeping: self.setup.sleeping.is_some(),
        };
        let changes = self.sleep_changes;
        let (scene, walls, simd) = (&scene, &self.walls, self.setup.simd);
        let approached = self.neighborhood.approached_walls;
        let ranges: Vec<_> = self.neighborhood.chunks.iter().map(|chunk| chunk.range.clone()).collect();
        let loads = split_at_chunks(&mut self.particles.loads, ranges.into_iter());
        let work: Vec<(&mut Chunk, &mut [Load])> = self.neighborhood.chunks.iter_mut().zip(loads).collect();
        self.threads.for_each(work, |(chunk, loads)| {
            chunk.tally = super::energy::Tally::default();
            chunk.rest.skipped = chunk.is_still(changes);
            if chunk.rest.skipped {
                return;
            }
            loads.fill(Load::ZERO);
            chunk.part_loads.fill(PartLoad::default());
            let (energy, has_prescribed) = (terms.energy, chunk.has_prescribed);
            let Chunk { walls: list, scratch, .. } = &mut *chunk;
            let search = WallSearch { scene, walls, approached, list, scratch, has_prescribed, energy };
            chunk.tally.slip += at_level(simd, search);
            match (terms.friction, terms.rolling, terms.energy) {
                (false, _, false) => at_level(simd, ChunkLoads::<false, false, false> { scene, walls, chunk, loads }),
                (false, _, true) => at_level(simd, ChunkLoads::<false, false, true> { scene, walls, chunk, loads }),
                (true, false, false) => at_level(simd, ChunkLoads::<true, false, false> { scene, walls, chunk, loads }),
                (true, false, true) => at_level(simd, ChunkLoads::<true, false, true> { scene, walls, chunk, loads }),
                (true, true, false) => at_level(simd, ChunkLoads::<true, true, false> { scene, walls, chunk, loads }),
                (true, true, true) => at_level(simd, ChunkLoads::<true, true, true> { scene, walls, chunk, loads }),
            }
            if scene.sleeping {
                chunk.note_rest(changes, scene.velocities, walls);
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
        let unbalanced = |chunk: &Chunk| StepNote { unbalanced: chunk.rest.unbalanced, ..StepNote::SKIPPED };
        let mut notes: Vec<StepNote> = self.neighborhood.chunks.iter().map(unbalanced).collect();
        let (loads, spheres) = (&self.particles.loads, &self.particles.spheres);
        let velocities = split_at_chunks(&mut self.particles.velocities, ranges.iter().cloned());
        let accelerations = split_at_chunks(&mut self.particles.accelerations, ranges.iter().cloned());
        let work = self.neighborhood.chunks.iter().zip(velocities).zip(accelerations).zip(&mut notes).collect();
        let (simd, sleep) = (self.setup.simd, self.setup.sleeping.as_ref());
        self.threads.for_each(work, |(((chunk, velocities), accelerations), note)| {
            if chunk.rest.skipped {
                return;
            }
            let (loads, spheres) = (&loads[chunk.range.clone()], &spheres[chunk.range.clone()]);
            let springs = &chunk.springs;
            let work = Correct { velocities, accelerations, loads, spheres, springs, dt, lead, gravity, body, sleep };
            *note = at_level(simd, work);
        });
        if sleep.is_some() {
            self.note_sleepers(&notes);
        }
        self.booked.prescribed_work += notes.iter().map(|note| note.prescribed_work).sum::<f64>();
        self.momentum.ghost_force = notes.iter().map(|note| note.prescribed_force).sum();
        self.booked.dashpot -= notes.iter().map(|note| note.late_work).sum::<f64>();
        self.watchdog.note_finite(notes.iter().all(|note| note.is_finite));
        self.phases.integration += started.elapsed();
    }
}

/// The loads of one chunk's contacts.
struct ChunkLoads<'a, const FRICTION: bool, const ROLLING: bool, const ENERGY: bool> {
    scene: &'a ContactScene<'a>,
    walls: &'a super::wall::Walls,
    chunk: &'a mut Chunk,
    loads: &'a mut [Load],
}

impl<const FRICTION: bool, const ROLLING: bool, const ENERGY: bool> LaneWork
    for ChunkLoads<'_, FRICTION, ROLLING, ENERGY>
{
    type Output = ();

    #[inline(always)]
    fn run<L: Lanes>(self) {
        let Self { scene, walls, chunk, loads } = self;
        let Chunk { range, own, cross, has_prescribed, walls: near, springs, .. } = chunk;
        let (first, has_prescribed, tally) = (range.start, *has_prescribed, &mut chunk.tally);
        if ENERGY {
            springs.clear();
            springs.resize(loads.len(), Vec3::zeros());
        }
        PairKernel::<L, true, FRICTION, ROLLING, ENERGY>::new(scene, first, has_prescribed)
            .add_loads(own, loads, springs, tally);
        PairKernel::<L, false, FRICTION, ROLLING, ENERGY>::new(scene, first, has_prescribed)
            .add_loads(cross, loads, springs, tally);
        let part_loads = &mut chunk.part_loads;
        WallKernel { scene, walls, first, has_prescribed, loads, springs, part_loads, tally }
            .add_loads::<L, FRICTION, ROLLING, ENERGY>(near);
    }
}
