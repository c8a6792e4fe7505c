//! The solver watches itself: not-a-number, deep overlaps, energy from nothing.

use super::energy::DeepContact;
use super::simulation::Simulation;
use super::tether::{STABLE, StiffTether};
use crate::particle::ParticleId;
use serde::{Deserialize, Serialize};
use std::time::Instant;

/// Why a run was stopped.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Stop {
    /// What was seen.
    pub cause: StopCause,
    /// Plant time [s].
    pub time: f64,
    /// Time step number.
    pub step: u64,
    /// The particle concerned, where there is one.
    pub particle: Option<ParticleId>,
    /// What happened, with figures.
    pub what: String,
    /// What to change.
    pub next: String,
}

/// What the watchdog saw.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum StopCause {
    /// A velocity or position is not a number.
    NotANumber,
    /// An overlap beyond the stated share of the radius.
    DeepOverlap,
    /// A particle moved too far in one time step.
    FastParticle,
    /// Mechanical energy grew without work being done.
    EnergyFromNothing,
    /// A tether too stiff for the time step.
    StiffTether,
}

impl std::fmt::Display for Stop {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "{} at {:.6e} s (step {}); {}", self.what, self.time, self.step, self.next)
    }
}

impl std::error::Error for Stop {}

/// What the watchdog has seen so far.
#[derive(Debug, Clone, Default)]
pub struct Watchdog {
    deep: Option<DeepContact>,
    stiff: Option<StiffTether>,
    not_finite: bool,
    displacement: f64,
    energy: EnergyWatch,
}

/// Watches the energy that the run may have: it can only fall.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize)]
pub struct EnergyWatch {
    /// Lowest available energy seen [J]; `None` until looked at once.
    lowest: Option<f64>,
    /// Largest energy of motion and springs seen [J].
    scale: f64,
    /// Set where new particles bring energy that was not there before.
    renew: bool,
}

/// Time steps between two looks at the energy: it costs about one time step.
const ENERGY_INTERVAL: u64 = 256;
/// Growth of the available energy over the largest energy of motion and springs seen, at which a run is stopped. A stable run's
/// integration error stays far below (1e-3 at ten steps a contact); an unstable one passes it within a few contacts.
const ENERGY_GROWTH_LIMIT: f64 = 0.05;
/// Displacement in one time step over the smallest radius at which a run is stopped: beyond it contacts are missed.
const DISPLACEMENT_LIMIT: f64 = 0.5;

impl Watchdog {
    pub(super) fn note_deep(&mut self, contact: DeepContact) {
        if self.deep.is_none_or(|held| contact.ratio > held.ratio) {
            self.deep = Some(contact);
        }
    }

    pub(super) fn note_stiff_tether(&mut self, tether: StiffTether) {
        self.stiff = Some(tether);
    }

    pub(super) fn note_finite(&mut self, finite: bool) {
        self.not_finite |= !finite;
    }

    pub(super) fn note_displacement(&mut self, displacement: f64) {
        self.displacement = displacement;
    }

    pub(super) fn expect_new_energy(&mut self) {
        self.energy.renew = true;
    }

    pub(super) fn energy_watch(&self) -> EnergyWatch {
        self.energy
    }

    pub(super) fn restore_energy_watch(&mut self, watch: EnergyWatch) {
        self.energy = watch;
    }
}

impl Simulation {
    /// The watchdog's look at the end of a time step.
    pub(super) fn watch(&mut self) -> Result<(), Stop> {
        if self.watchdog.not_finite {
            return Err(self.stop_not_a_number());
        }
        if let Some(deep) = self.watchdog.deep.take() {
            return Err(self.stop_deep(&deep));
        }
        if let Some(stiff) = self.watchdog.stiff.take() {
            return Err(self.stop_stiff(&stiff));
        }
        let smallest = self.neighborhood.smallest_radius();
        if self.watchdog.displacement > DISPLACEMENT_LIMIT * smallest {
            return Err(self.stop_fast());
        }
        if !self.looks_at_energy() {
            return Ok(());
        }
        let started = Instant::now();
        let verdict = self.watch_energy();
        self.phases.watchdog += started.elapsed();
        verdict
    }

    /// Whether the energy is looked at at the end of the present time step.
    pub(super) const fn looks_at_energy(&self) -> bool {
        self.steps.is_multiple_of(ENERGY_INTERVAL)
    }

    fn watch_energy(&mut self) -> Result<(), Stop> {
        let budget = self.energy();
        // What is left after work, feeds and removals: losses can only lower it.
        let available = budget.sum() - budget.dissipated();
        let stored = budget.kinetic + budget.rotational + budget.elastic;
        let watch = &mut self.watchdog.energy;
        watch.scale = watch.scale.max(stored);
        let Some(lowest) = watch.lowest.filter(|_| !watch.renew) else {
            watch.lowest = Some(available);
            watch.renew = false;
            return Ok(());
        };
        watch.lowest = Some(lowest.min(available));
        let growth = available - lowest;
        if growth <= ENERGY_GROWTH_LIMIT * watch.scale {
            return Ok(());
        }
        let fastest = self.fastest_particle();
        Err(self.stop(
            StopCause::EnergyFromNothing,
            fastest,
            format!(
                "the mechanical energy grew by {growth:.3e} J without work being done (largest energy of motion and springs so \
                 far {:.3e} J)",
                self.watchdog.energy.scale
            ),
            "the time step is too long for the stiffness and mass of these contacts: lower solver.timestep, or soften",
        ))
    }

    fn stop(&self, cause: StopCause, particle: Option<usize>, what: String, next: &str) -> Stop {
        Stop {
            cause,
            time: self.time(),
            step: self.steps,
            particle: particle.map(|index| self.particles.ids[index]),
            what,
            next: next.to_owned(),
        }
    }

    fn stop_not_a_number(&self) -> Stop {
        let bad = (0..self.particles.len()).find(|&index| {
            let (velocity, centre) = (self.particles.velocity(index), &self.particles.spheres[index].centre);
            !velocity.linear.iter().chain(&velocity.angular).chain(centre).all(|x| x.is_finite())
        });
        let state = bad.map(|index| self.particles.state(index));
        let what = match state {
            Some(state) => format!(
                "particle {} of feed {} has a place or velocity that is not a number, at ({:.4}, {:.4}, {:.4}) m",
                state.id.serial(),
                state.id.feed(),
                state.position.x,
                state.position.y,
                state.position.z
            ),
            None => "the places or velocities are too large for a number".to_owned(),
        };
        self.stop(
            StopCause::NotANumber,
            bad,
            what,
            "two particles may coincide, or a pair of materials in contact has no properties: look at the start state and the \
             pairs; else lower solver.timestep",
        )
    }

    fn stop_deep(&self, deep: &DeepContact) -> Stop {
        let index = deep.particle as usize;
        let id = self.particles.ids[index];
        let with = match (deep.partner, deep.part) {
            (Some(partner), _) => {
                let other = self.particles.ids[partner as usize];
                format!("particle {} of feed {}", other.serial(), other.feed())
            }
            (None, Some(part)) => format!("part '{}'", self.setup.parts[usize::from(part)].name),
            (None, None) => "another body".to_owned(),
        };
        let what = format!(
            "particle {} of feed {} overlaps {with} by {:.1} % of the smaller radius (limit {:.1} %)",
            id.serial(),
            id.feed(),
            100.0 * deep.ratio,
            100.0 * self.setup.overlap_limit
        );
        let next = "raise the stiffness (overlap falls with E^-0.4 in an impact), lower the impact speed, or raise \
                    solver.overlap_limit if such overlaps are meant; if it happens at once, the start state overlaps";
        self.stop(StopCause::DeepOverlap, Some(index), what, next)
    }

    fn stop_stiff(&self, stiff: &StiffTether) -> Stop {
        let id = self.particles.ids[stiff.particle];
        let what = format!(
            "particle {} of feed {} is {:.3e} m off its recorded path, where its tether is too stiff for the time step (w2 dt^2 \
             (1 + 3 (e/c)^2) = {:.2}, limit {STABLE})",
            id.serial(),
            id.feed(),
            stiff.excursion,
            stiff.number
        );
        let next = "the particles beyond the gate do not yield as they did in the record: allow a larger compliance, or place \
                    the gate where the flow is free; if it happens at once, lower solver.timestep";
        self.stop(StopCause::StiffTether, Some(stiff.particle), what, next)
    }

    fn stop_fast(&self) -> Stop {
        let fastest = self.fastest_particle();
        let what = format!(
            "a particle moved {:.3e} m in one time step, more than {DISPLACEMENT_LIMIT} of the smallest radius",
            self.watchdog.displacement
        );
        let next = "contacts are missed at this speed: lower solver.timestep; if nothing should be that fast, an overlap in the \
                    start state or a too long time step has shot it off";
        self.stop(StopCause::FastParticle, fastest, what, next)
    }

    fn fastest_particle(&self) -> Option<usize> {
        let speed = |index: &usize| {
            let velocity = self.particles.velocity(*index).linear;
            velocity.iter().map(|x| x * x).sum::<f64>()
        };
        (0..self.particles.len()).max_by(|a, b| speed(a).total_cmp(&speed(b)))
    }
}
