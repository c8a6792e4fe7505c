//! The energy budget: where the energy of a run is and where it went.

use serde::{Deserialize, Serialize};

/// Energies [J]. With accounting on,
/// kinetic + rotational + gravitational + elastic + slip + dashpot + rolling - wall_work - prescribed_work - tether_work - inserted
/// + removed + sleep - law_residual stays constant up to the error of the time step.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
pub struct EnergyBudget {
    /// Of the centres' motion.
    pub kinetic: f64,
    /// Of the spins.
    pub rotational: f64,
    /// -sum m g.x, zero at the plant's origin.
    pub gravitational: f64,
    /// In the normal and tangential springs.
    pub elastic: f64,
    /// Lost in sliding.
    pub slip: f64,
    /// Lost in the dashpots, the no-attraction cut-off included.
    pub dashpot: f64,
    /// Taken by rolling resistance (lost, and stored in its springs).
    pub rolling: f64,
    /// Work of moving parts on the particles.
    pub wall_work: f64,
    /// Work of prescribed particles on the others.
    pub prescribed_work: f64,
    /// Work of the tethers.
    pub tether_work: f64,
    /// Brought in by feeds.
    pub inserted: f64,
    /// Taken out with particles that left.
    pub removed: f64,
    /// Made (> 0) by the law itself, whose tangential stiffness depends on the overlap.
    pub law_residual: f64,
    /// Of motion, taken from particles that fell asleep.
    #[serde(default, skip_serializing_if = "super::sleep::is_zero")]
    pub sleep: f64,
}

impl EnergyBudget {
    /// All entries with their signs [J]: constant up to the error of the time step.
    #[must_use]
    pub fn sum(&self) -> f64 {
        self.kinetic + self.rotational + self.gravitational + self.elastic + self.slip + self.dashpot + self.rolling
            - self.wall_work
            - self.prescribed_work
            - self.tether_work
            - self.inserted
            + self.removed
            + self.sleep
            - self.law_residual
    }

    /// Energy lost for good, plus what rolling springs hold [J].
    #[must_use]
    pub fn dissipated(&self) -> f64 {
        self.slip + self.dashpot + self.rolling + self.sleep
    }

    /// Mechanical energy [J]: motion, height and springs.
    #[must_use]
    pub fn mechanical(&self) -> f64 {
        self.kinetic + self.rotational + self.gravitational + self.elastic
    }
}

/// What contacts took within a time step, summed chunk by chunk in the chunks' order.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Tally {
    /// Lost in sliding [J].
    pub slip: f64,
    /// Lost in dashpots [J].
    pub dashpot: f64,
    /// Taken by rolling resistance [J].
    pub rolling: f64,
    /// Made by the law itself [J].
    pub law_residual: f64,
    /// Work of prescribed particles [J].
    pub prescribed_work: f64,
    /// Largest overlap as a share of the smaller radius beyond the limit, and where.
    pub deep: Option<DeepContact>,
}

/// An overlap beyond the watchdog's limit.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct DeepContact {
    /// Storage index of the particle.
    pub particle: u32,
    /// Storage index of the partner; `None` for a part.
    pub partner: Option<u32>,
    /// Part touched.
    pub part: Option<u16>,
    /// Overlap over the smaller radius [-].
    pub ratio: f64,
}

impl Tally {
    /// Notes a deep contact; the deepest is kept.
    pub fn note_deep(&mut self, contact: DeepContact) {
        if self.deep.is_none_or(|held| contact.ratio > held.ratio) {
            self.deep = Some(contact);
        }
    }
}
