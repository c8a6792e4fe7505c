//! The time step: velocity-Verlet with full-step velocities in the contact laws.
//!
//! With x, v, a at the time t: x += v dt + a dt^2 / 2; the laws see v + a dt, a first-order estimate of the velocity at t + dt
//! (Vyas, Ottino, Lueptow & Umbanhowar 2025), not the half-step velocity v + a dt / 2 that velocity-Verlet codes commonly pass
//! and that spoils static friction at large size ratios; the compatibility mode passes the latter. With the new loads,
//! v = v + (a_old + a_new) dt / 2. Spins likewise.
//!
//! Where nothing else happens between this correction and the next time step's motion, both are one pass over the particles
//! (`docs/decisions/late-corrections.md`): the step is then left late, see [`super::particles::Particles`].

use super::integrate::{
    Advance, Correct, Correction, ModerateLoads, MotionNote, Moved, StepNote, acceleration, border_rows,
};
use super::law::Compatibility;
use super::meeting::ContactScene;
use super::neighborhood::Chunk;
use super::pair_contacts::PairKernel;
use super::particles::{Load, MotionLists};
use super::pieces::split_at_ranges;
use super::simulation::{Setup, Simulation};
use super::touched::Effects;
use super::wall_contacts::{PartLoad, WallKernel};
use super::wall_search::WallSearch;
use crate::math::Vec3;
use crate::math::lanes::{LaneWork, Lanes, at_level};
use std::ops::Range;
use std::time::Instant;

impl Simulation {
    /// Share of a dt that the contact laws' velocities are ahead of the last full step.
    const fn velocity_lead(&self) -> f64 {
        match self.setup.law.compatibility {
            Compatibility::Tollgate => 1.0,
            Compatibility::Liggghts => 0.5,
        }
    }

    /// What [`Simulation::advance`] adds to a particle's velocity [m/s].
    pub(super) fn velocity_gained(&self, index: usize) -> Vec3 {
        self.particles.acceleration(index).linear * (self.velocity_lead() * self.setup.timestep)
    }

    const fn correction(&self) -> Correction {
        let Setup { timestep, gravity, body, .. } = self.setup;
        Correction { dt: timestep, lead: self.velocity_lead(), gravity, body }
    }

    fn ranges(&self) -> Vec<Range<usize>> {
        self.neighborhood.chunks.iter().map(|chunk| chunk.range.clone()).collect()
    }

    /// Moves all particles to the end of the time step and gives them the velocities that the contact laws see. Completes the time
    /// step before, if that is late.
    pub(super) fn advance(&mut self) {
        let started = Instant::now();
        let (late, correction) = (self.particles.take_late().is_some(), &self.correction());
        let ranges = self.ranges();
        let mut notes = vec![MotionNote::default(); ranges.len()];
        let (domain, simd) = (border_rows(&self.setup.domain, self.setup.periodic), self.setup.simd);
        let MotionLists { spheres, velocities, accelerations, loads } = self.particles.kept_lists();
        let loads = &*loads;
        let spheres = split_at_ranges(spheres, ranges.iter().cloned());
        let velocities = split_at_ranges(velocities, ranges.iter().cloned());
        let accelerations = split_at_ranges(accelerations, ranges.iter().cloned());
        let chunks = self.neighborhood.chunks.iter_mut();
        let work = chunks.zip(spheres).zip(velocities).zip(accelerations).zip(&mut notes).collect();
        let changes = self.sleep_changes;
        self.threads.for_each(work, |((((chunk, spheres), velocities), accelerations), note)| {
            if chunk.is_still(changes) {
                return;
            }
            let (loads, domain) = (&loads[chunk.range.clone()], &domain);
            let among_falling = chunk.touched.among_falling().filter(|_| late);
            let moved = Moved { spheres, velocities, accelerations, loads, correction, domain, among_falling };
            *note = if late { at_level(simd, Advance::<true>(moved)) } else { at_level(simd, Advance::<false>(moved)) };
            chunk.touched.note_motion(late);
        });
        let moved = notes.iter().map(|note| note.farthest_squared).fold(0.0, f64::max).sqrt();
        self.has_leavers = notes.iter().any(|note| note.leaves);
        self.is_moderate = notes.iter().all(|note| note.is_moderate);
        self.neighborhood.wear.note_motion(moved, self.walls.speed_bound() * self.setup.timestep);
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
        let MotionLists { spheres, velocities, accelerations, loads } = self.particles.kept_lists();
        for (index, held) in accelerations.iter_mut().enumerate() {
            *held = acceleration(&loads[index], &velocities[index], spheres[index].radius, held, &gravity, body);
        }
    }

    /// Loads on all particles and parts; memories move by `timestep` [s].
    pub(super) fn compute_loads(&mut self, timestep: f64) {
        let started = Instant::now();
        let (terms, looks) = (self.terms, self.may_be_late());
        let MotionLists { spheres, velocities, accelerations, loads } = self.particles.kept_lists();
        let scene = ContactScene {
            spheres,
            velocities,
            accelerations,
            law: &self.law,
            only_material: self.neighborhood.only_material,
            images: &self.neighborhood.images,
            remembers: terms.friction,
            timestep,
            overlap_limit: self.setup.overlap_limit,
            inertia_factor: self.setup.body.inertia_factor(),
            sleeping: self.setup.sleeping.is_some(),
        };
        let changes = self.sleep_changes;
        let (scene, walls, simd) = (&scene, &self.walls, self.setup.simd);
        let approached = self.neighborhood.wear.towards_parts;
        let ranges: Vec<_> = self.neighborhood.chunks.iter().map(|chunk| chunk.range.clone()).collect();
        let loads = split_at_ranges(loads, ranges.into_iter());
        let work: Vec<(&mut Chunk, &mut [Load])> = self.neighborhood.chunks.iter_mut().zip(loads).collect();
        self.threads.for_each(work, |(chunk, loads): (&mut Chunk, &mut [Load])| {
            chunk.tally = super::energy::Tally::default();
            chunk.rest.skipped = chunk.is_still(changes);
            if chunk.rest.skipped {
                return;
            }
            chunk.part_loads.fill(PartLoad::default());
            let (energy, has_prescribed) = (terms.energy, chunk.has_prescribed);
            let Chunk { walls: list, scratch, .. } = &mut *chunk;
            let search = WallSearch { scene, walls, approached, list, scratch, has_prescribed, energy };
            chunk.tally.slip += at_level(simd, search);
            let contacts = chunk.own.len() + chunk.cross.len() + chunk.walls.count();
            chunk.touched.begin(loads, contacts, looks);
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
            chunk.touched.end(chunk.range.start);
            chunk.is_moderate = looks && at_level(simd, ModerateLoads { loads, of: chunk.touched.places() });
        });
        self.sum_chunks(timestep);
        self.phases.contacts += started.elapsed();
    }

    /// Sums what the chunks found, in their order.
    fn sum_chunks(&mut self, timestep: f64) {
        self.part_loads.fill(PartLoad::default());
        for chunk in &self.neighborhood.chunks {
            self.is_moderate &= chunk.is_moderate;
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

    /// Whether nothing within a time step needs full-step velocities: no account, no sleep, no path, no look at the energy.
    fn may_be_late(&self) -> bool {
        let setup = &self.setup;
        let accounts = setup.energy || setup.momentum || setup.sleeping.is_some();
        let paths = !self.tethers.is_empty() || self.neighborhood.chunks.iter().any(|chunk| chunk.has_prescribed);
        !accounts && !paths && !self.looks_at_energy()
    }

    /// Turns loads into velocities at the end of the time step, or leaves that to the next one. What is not finite is to be seen now.
    pub(super) fn complete(&mut self) {
        if self.may_be_late() && self.is_moderate {
            self.momentum.ghost_force = Vec3::zeros();
            self.particles.put_off(self.correction());
            return;
        }
        self.pull_tethers();
        self.correct();
        self.book_tethers();
    }

    fn correct(&mut self) {
        let started = Instant::now();
        let correction = &self.correction();
        let ranges = self.ranges();
        let unbalanced = |chunk: &Chunk| StepNote { unbalanced: chunk.rest.unbalanced, ..StepNote::SKIPPED };
        let mut notes: Vec<StepNote> = self.neighborhood.chunks.iter().map(unbalanced).collect();
        let MotionLists { spheres, velocities, accelerations, loads } = self.particles.kept_lists();
        let (spheres, loads) = (&*spheres, &*loads);
        let velocities = split_at_ranges(velocities, ranges.iter().cloned());
        let accelerations = split_at_ranges(accelerations, ranges.iter().cloned());
        let work = self.neighborhood.chunks.iter().zip(velocities).zip(accelerations).zip(&mut notes).collect();
        let (simd, sleep) = (self.setup.simd, self.setup.sleeping.as_ref());
        self.threads.for_each(work, |(((chunk, velocities), accelerations), note)| {
            if chunk.rest.skipped {
                return;
            }
            let (loads, spheres) = (&loads[chunk.range.clone()], &spheres[chunk.range.clone()]);
            let springs = &chunk.springs;
            *note = at_level(simd, Correct { velocities, accelerations, loads, spheres, springs, correction, sleep });
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
        let (first, has_prescribed) = (range.start, *has_prescribed);
        if ENERGY {
            springs.clear();
            springs.resize(loads.len(), Vec3::zeros());
        }
        let mut effects = Effects { loads, springs, tally: &mut chunk.tally, touched: &mut chunk.touched };
        PairKernel::<L, true, FRICTION, ROLLING, ENERGY>::new(scene, first, has_prescribed)
            .add_loads(own, &mut effects);
        PairKernel::<L, false, FRICTION, ROLLING, ENERGY>::new(scene, first, has_prescribed)
            .add_loads(cross, &mut effects);
        let part_loads = &mut chunk.part_loads;
        WallKernel { scene, walls, first, has_prescribed, part_loads, effects }
            .add_loads::<L, FRICTION, ROLLING, ENERGY>(near);
    }
}

#[cfg(test)]
pub(super) mod tests {
    use super::super::ghost::PrescribedMotion;
    use super::super::law::{Compatibility, LawSettings, NormalLaw, RollingLaw, TangentialLaw};
    use super::super::particles::Path;
    use super::super::sleep::SleepSettings;
    use super::*;
    use crate::material::{Elasticity, Material, MaterialTable, PairContact, PairProperties};
    use crate::math::Bounds;
    use crate::math::lanes::SimdLevel;
    use crate::particle::{Body, ParticleId, ParticleState};

    pub(in crate::dem) fn setup() -> Setup {
        let elasticity = Elasticity::Isotropic { youngs_modulus: 5e6, poissons_ratio: 0.3 };
        let grain = Material { name: "grain".to_owned(), density: Some(2500.0), elasticity: Some(elasticity) };
        let mut materials = MaterialTable::new(vec![grain]);
        let contact = PairContact::Restitution { coefficient: 0.5 };
        materials.set_pair(0, 0, PairProperties { contact, sliding_friction: 0.3, rolling_friction: 0.0 });
        let law = LawSettings {
            normal: NormalLaw::HertzMindlin,
            tangential: TangentialLaw::Incremental,
            tangential_damping: true,
            attraction: false,
            rolling: RollingLaw::None,
            characteristic_velocity: 1.0,
            compatibility: Compatibility::Tollgate,
        };
        Setup {
            body: Body::Sphere,
            gravity: Vec3::zeros(),
            domain: Bounds { minimum: [-1.0; 3], maximum: [1.0; 3] },
            periodic: [false; 3],
            materials,
            law,
            classes: Vec::new(),
            feeds: Vec::new(),
            parts: Vec::new(),
            seed: 1,
            timestep: 1e-5,
            skin: 1e-3,
            overlap_limit: 0.3,
            energy: false,
            momentum: false,
            sleeping: None,
            threads: 1,
            simd: SimdLevel::best(),
        }
    }

    pub(in crate::dem) fn grain(serial: u64, x: f64) -> ParticleState {
        let (position, still) = (Vec3::new(x, 0.0, 0.0), Vec3::zeros());
        ParticleState {
            id: ParticleId::new(9, serial),
            material: 0,
            radius: 1e-3,
            density: 2500.0,
            position,
            velocity: still,
            spin: still,
        }
    }

    /// Whether the step is late that has just been done.
    fn is_late(simulation: &mut Simulation) -> bool {
        simulation.step().expect("nothing happens");
        simulation.particles.clone().take_late().is_some()
    }

    #[test]
    fn a_step_is_late_where_nobody_needs_it_and_else_completed() {
        let mut plain = Simulation::new(setup());
        plain.insert(&[grain(1, 0.0), grain(2, 0.1)]);
        let late: Vec<u64> = (1..=257).filter(|_| is_late(&mut plain)).collect();
        // the watchdog looks at the energy after step 256
        assert_eq!(late, (1..=255).chain([257]).collect::<Vec<u64>>());
        // who is put on a path, or inserted on one, needs all steps, until it is gone
        plain.prescribe(&[ParticleId::new(9, 2)], Path::Constant);
        assert!(!is_late(&mut plain));
        plain.remove_particles(&[ParticleId::new(9, 2)], super::super::removal::RemovalCause::Asked);
        assert!(is_late(&mut plain));
        let ghost = grain(3, 0.2);
        let (position, none) = (ghost.position, Vec3::zeros());
        let motion =
            PrescribedMotion { position, velocity: none, spin: none, acceleration: none, spin_acceleration: none };
        plain.insert_prescribed(&[(ghost, Path::Recorded, motion)]);
        assert!(!is_late(&mut plain));

        let sleeping = Some(SleepSettings { speed: 1e-3, hold: 0.01, acceleration: 0.1 });
        let accounts =
            [Setup { energy: true, ..setup() }, Setup { momentum: true, ..setup() }, Setup { sleeping, ..setup() }];
        for setup in accounts {
            let mut simulation = Simulation::new(setup);
            simulation.insert(&[grain(1, 0.0)]);
            assert!(!is_late(&mut simulation));
        }
    }

    /// Eight grains far from each other under gravity, but for two that meet.
    fn thin() -> Simulation {
        let mut simulation = Simulation::new(Setup { gravity: Vec3::z() * -9.81, skin: 4e-3, ..setup() });
        let mut states: Vec<ParticleState> = (0..7).map(|k| grain(k, 0.1 * k as f64)).collect();
        states.push(ParticleState { velocity: Vec3::x() * -1.0, ..grain(7, 2.02e-3) });
        simulation.insert(&states);
        simulation
    }

    fn acted_upon(simulation: &Simulation) -> Option<Vec<u64>> {
        let places = simulation.neighborhood.chunks[0].touched.among_falling()?;
        Some(places.iter().map(|&place| simulation.particles.ids[place as usize].serial()).collect())
    }

    #[test]
    fn records_of_who_falls_are_not_looked_at_and_of_who_was_touched_are() {
        let (mut simulation, mut whole) = (thin(), Simulation::new(Setup { momentum: true, ..thin().setup().clone() }));
        whole.insert(&thin().particles());
        let mut seen = vec![acted_upon(&simulation)];
        for step in 0..60 {
            // What is not a number shows up in whatever it is read for.
            let falls_unseen = |id: ParticleId| seen.last() != Some(&None) && (1..7).contains(&id.serial());
            mark(&mut simulation, falls_unseen, f64::NAN);
            simulation.step().expect("it is stable");
            mark(&mut simulation, falls_unseen, 0.0);
            whole.step().expect("it is stable");
            assert_eq!(simulation.particles(), whole.particles(), "step {step}");
            seen.push(acted_upon(&simulation));
            seen.dedup();
        }
        assert_eq!(seen, [None, Some(vec![]), Some(vec![0, 7]), Some(vec![])]);
        simulation.particles.velocities_mut();
        simulation.step().expect("it is stable");
        assert_eq!(acted_upon(&simulation), None, "the step before was completed early");
    }

    /// Overwrites loads and accelerations along x of the particles that `chosen` picks.
    fn mark(simulation: &mut Simulation, chosen: impl Fn(ParticleId) -> bool, value: f64) {
        let ids = simulation.particles.ids.clone();
        let MotionLists { loads, accelerations, .. } = simulation.particles.kept_lists();
        for index in (0..ids.len()).filter(|&index| chosen(ids[index])) {
            loads[index].force.x = value;
            accelerations[index].linear.x = value;
        }
    }
}
