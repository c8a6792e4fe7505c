//! A running simulation: its state, and the order in which a time step happens.

use super::energy::EnergyBudget;
use super::feed::Feed;
use super::feed::runner::FeedRunner;
use super::ghost::RecordedParticles;
use super::inspect::Partner;
use super::law::constants::LawTable;
use super::law::{LawSettings, RollingLaw};
use super::momentum::MomentumAccount;
use super::neighborhood::{ListSettings, Neighborhood};
use super::particles::Particles;
use super::presence::{PartEvent, Presence};
use super::removal::Removal;
use super::sleep::{SleepChanges, SleepSettings};
use super::tether::Tether;
use super::threads::Threads;
use super::wall::Walls;
use super::wall_contacts::PartLoad;
use super::watchdog::{Stop, Watchdog};
use crate::geometry::part::Part;
use crate::material::MaterialTable;
use crate::math::lanes::SimdLevel;
use crate::math::{Bounds, Vec3};
use crate::particle::{Body, ParticleClass, ParticleId, ParticleState};
use std::collections::HashSet;

/// Everything a simulation is made from; SI units.
#[derive(Debug, Clone)]
pub struct Setup {
    /// Spheres, or discs in the plane y = 0.
    pub body: Body,
    /// Gravity [m/s2].
    pub gravity: Vec3,
    /// Particles whose centre leaves it are removed.
    pub domain: Bounds,
    /// Axes along which the domain repeats.
    pub periodic: [bool; 3],
    /// Materials and pairs.
    pub materials: MaterialTable,
    /// Contact laws.
    pub law: LawSettings,
    /// Particle classes of the feeds.
    pub classes: Vec<ParticleClass>,
    /// Feeds.
    pub feeds: Vec<Feed>,
    /// Parts.
    pub parts: Vec<Part>,
    /// Seed of the feeds' draws.
    pub seed: u64,
    /// Time step [s].
    pub timestep: f64,
    /// Neighbour skin [m].
    pub skin: f64,
    /// Largest overlap over the smaller radius that the watchdog allows [-].
    pub overlap_limit: f64,
    /// Whether losses are accounted for.
    pub energy: bool,
    /// Whether the momentum is accounted for; it is too where `energy` is set.
    pub momentum: bool,
    /// When resting particles fall asleep, where they may.
    pub sleeping: Option<SleepSettings>,
    /// Number of threads; changes no bit of the result.
    pub threads: usize,
    /// Instruction set to compute contacts with; changes no bit of the result.
    pub simd: SimdLevel,
}

/// Which terms the contact kernel computes.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct KernelTerms {
    /// Tangential forces.
    pub friction: bool,
    /// Rolling resistance.
    pub rolling: bool,
    /// Losses.
    pub energy: bool,
}

/// A running simulation.
#[derive(Debug)]
pub struct Simulation {
    pub(super) setup: Setup,
    pub(super) law: LawTable,
    pub(super) terms: KernelTerms,
    pub(super) threads: Threads,
    pub(super) particles: Particles,
    pub(super) neighborhood: Neighborhood,
    pub(super) walls: Walls,
    pub(super) presence: Presence,
    pub(super) feeds: FeedRunner,
    pub(super) part_loads: Vec<PartLoad>,
    pub(super) steps: u64,
    /// False until the loads at the present time have been computed once.
    pub(super) loads_known: bool,
    /// Particles will still come from outside.
    awaits_arrivals: bool,
    /// Accumulated entries of the budget; the instantaneous ones are computed when asked for.
    pub(super) booked: EnergyBudget,
    pub(super) momentum: MomentumAccount,
    pub(super) tethers: Vec<Tether>,
    pub(super) recorded: RecordedParticles,
    pub(super) removed: Vec<Removal>,
    pub(super) watchdog: Watchdog,
    pub(super) sleep_changes: SleepChanges,
    /// Whether a particle went beyond an open border when all were moved.
    pub(super) has_leavers: bool,
    /// Whether places, velocities and loads of this time step were all found to be numbers far from overflow.
    pub(super) is_moderate: bool,
    pub(super) phases: super::phase::PhaseTimes,
}

impl Simulation {
    /// A simulation at time 0 with no particle yet; feeds due at time 0 act at the first step.
    #[must_use]
    pub fn new(setup: Setup) -> Self {
        let law = LawTable::new(setup.law, &setup.materials);
        let rolling = setup.law.rolling != RollingLaw::None && law.has_rolling_friction();
        let terms = KernelTerms { friction: rolling || law.has_sliding_friction(), rolling, energy: setup.energy };
        let mut walls = Walls::new(&setup.parts);
        let presence = Presence::new(&setup.parts, &mut walls);
        walls.set_time(0.0);
        let densities: Vec<Option<f64>> = setup.materials.materials.iter().map(|m| m.density).collect();
        let feeds = FeedRunner::new(&setup.feeds, &setup.classes, &densities, setup.body, setup.seed);
        let lists = ListSettings {
            skin: setup.skin,
            domain: setup.domain,
            periodic: setup.periodic,
            remembers: terms.friction || terms.rolling,
            remembers_rolling: terms.rolling,
        };
        Self {
            law,
            terms,
            threads: Threads::new(setup.threads),
            particles: Particles::default(),
            neighborhood: Neighborhood::new(lists, setup.simd),
            walls,
            presence,
            feeds,
            part_loads: vec![PartLoad::default(); setup.parts.len()],
            steps: 0,
            loads_known: false,
            awaits_arrivals: false,
            booked: EnergyBudget::default(),
            momentum: MomentumAccount::default(),
            tethers: Vec::new(),
            recorded: RecordedParticles::default(),
            removed: Vec::new(),
            watchdog: Watchdog::default(),
            sleep_changes: SleepChanges::default(),
            has_leavers: false,
            is_moderate: false,
            phases: super::phase::PhaseTimes::default(),
            setup,
        }
    }

    /// Inserts what is due at the present time and computes loads, so that the start can be looked at. Changes no result.
    pub fn prepare(&mut self) {
        self.feed_due_particles();
        if !self.loads_known {
            self.compute_initial_loads();
        }
    }

    /// One time step.
    ///
    /// # Errors
    /// When the watchdog finds the run unstable; the state is then that of the end of this step and can still be written.
    pub fn step(&mut self) -> Result<(), Stop> {
        self.feed_due_particles();
        self.watch_presence();
        if !self.loads_known {
            self.compute_initial_loads();
        }
        self.advance();
        self.remove_leavers();
        self.book_old_forces();
        self.steps += 1;
        self.walls.set_time(self.time());
        self.refresh_neighborhood();
        self.compute_loads(self.setup.timestep);
        self.complete();
        self.book_new_forces();
        self.lay_to_sleep();
        self.watch()
    }

    /// Number of time steps done.
    #[must_use]
    pub const fn steps_done(&self) -> u64 {
        self.steps
    }

    /// Plant time [s].
    #[must_use]
    pub fn time(&self) -> f64 {
        self.steps as f64 * self.setup.timestep
    }

    /// What it was made from.
    #[must_use]
    pub const fn setup(&self) -> &Setup {
        &self.setup
    }

    /// Adds free particles outside of the feeds.
    pub fn insert(&mut self, states: &[ParticleState]) {
        if states.is_empty() {
            return;
        }
        for state in states {
            self.particles.push(state, self.setup.body);
            let last = self.particles.len() - 1;
            self.booked.inserted += self.mechanical_energy_of(&self.particles.state(last));
            // A newcomer falls freely until its first contact; loads at time 0 are computed before the first step.
            self.particles.accelerations_mut()[last].linear = self.setup.body.in_plane(&self.setup.gravity);
            self.note_comer(self.momentum_of(last));
        }
        self.watchdog.expect_new_energy();
        self.rebuild_neighborhood();
        if self.terms.energy {
            let new: HashSet<ParticleId> = states.iter().map(|state| state.id).collect();
            let is_new = |partner| matches!(partner, Partner::Particle(other) if new.contains(&other));
            self.booked.inserted += self.spring_energy(|id, partner| new.contains(&id) || is_new(partner));
        }
    }

    fn feed_due_particles(&mut self) {
        let time = self.time();
        if !self.feeds.due(time) {
            return;
        }
        let started = std::time::Instant::now();
        let occupancy = super::occupancy::SolverOccupancy {
            particles: &self.particles,
            neighborhood: &self.neighborhood,
            walls: &self.walls,
        };
        let states = self.feeds.insert(time, &occupancy);
        self.phases.feeds += started.elapsed();
        self.insert(&states);
    }

    fn watch_presence(&mut self) {
        let fed = self.feeds_finished();
        let (time, steps) = (self.time(), self.steps);
        let particles = &self.particles;
        let speed = || particles.rms_speed();
        let changed = self.presence.update(time, steps, self.setup.timestep, fed, particles.is_empty(), speed);
        if !changed.is_empty() {
            let changes = |partner, present| {
                let is = |event: &PartEvent| {
                    event.present == present && matches!(partner, Partner::Part { part, .. } if part == event.part)
                };
                changed.iter().any(is)
            };
            // A part that ceases to exist takes the springs of its contacts with it; one that comes into being loads new ones.
            if self.terms.energy {
                self.booked.removed += self.spring_energy(|_, partner| changes(partner, false));
            }
            for event in &changed {
                self.walls.set_present(event.part, event.present);
                self.neighborhood.forget_wall_contacts(|contact| contact.part == event.part);
            }
            self.collect_wall_candidates();
            if changed.iter().any(|event| event.present) {
                self.watchdog.expect_new_energy();
                if self.terms.energy {
                    self.booked.inserted += self.spring_energy(|_, partner| changes(partner, true));
                }
            }
        }
    }

    /// Parts that appeared or disappeared, in order.
    #[must_use]
    pub fn part_events(&self) -> &[PartEvent] {
        self.presence.events()
    }

    /// Particles that left, counted by cause.
    #[must_use]
    pub fn removed(&self) -> &[Removal] {
        &self.removed
    }

    /// What the particles do to each part at the present time.
    #[must_use]
    pub fn part_loads(&self) -> &[PartLoad] {
        &self.part_loads
    }

    /// What each feed was asked for and brought.
    #[must_use]
    pub fn feed_reports(&self) -> Vec<super::feed::report::FeedReport> {
        self.feeds.reports()
    }

    /// True once nothing more comes: neither from a feed, nor otherwise ([`Simulation::expect_arrivals`]).
    #[must_use]
    pub fn feeds_finished(&self) -> bool {
        !self.awaits_arrivals && self.feeds.finished(self.time())
    }

    /// Says whether particles will still be inserted from outside: what waits for the particles to rest waits for them too.
    pub const fn expect_arrivals(&mut self, expected: bool) {
        self.awaits_arrivals = expected;
    }

    /// Moves a particle by `way` [m]; it keeps its contacts' memory. Returns false where there is no such particle.
    pub fn displace(&mut self, id: ParticleId, way: Vec3) -> bool {
        let Some(index) = self.particles.ids.iter().position(|held| *held == id) else { return false };
        self.wake(index);
        let marked = self.marks(std::iter::once(index));
        let (springs, height) = (self.springs_of(&marked), self.mechanical_energy_of(&self.particles.state(index)));
        let centre = self.particles.spheres[index].position() + way;
        self.particles.spheres[index].centre = centre.into();
        self.booked.inserted += self.mechanical_energy_of(&self.particles.state(index)) - height;
        self.book_springs(&marked, springs);
        self.neighborhood.wear.note_motion(way.norm(), 0.0);
        self.watchdog.expect_new_energy();
        true
    }

    /// Wall time by phase.
    #[must_use]
    pub const fn phase_times(&self) -> &super::phase::PhaseTimes {
        &self.phases
    }
}
