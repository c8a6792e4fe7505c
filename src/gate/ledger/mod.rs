//! The ledger of a gate: what was recorded, what arrived, and whether these are the same.

mod account;
mod sum;

pub use account::{EnergyAccount, EnergyEntry, MomentumAccount, MomentumEntry};
pub use sum::ExactSum;

use crate::math::Vec3;
use crate::particle::{Body, ParticleId, ParticleState};
use serde::{Deserialize, Serialize};

/// Identities that a list in the summary names at most.
const NAMED: usize = 20;

/// Sums over crossings, kept exactly.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct Sums {
    count: u64,
    mass: ExactSum,
    momentum: [ExactSum; 3],
    kinetic_energy: ExactSum,
}

impl Sums {
    /// Adds a particle. Its energy is that of translation and rotation, m v^2 / 2 + I omega^2 / 2.
    pub fn add(&mut self, state: &ParticleState, body: Body) {
        let mass = body.mass(state.radius, state.density);
        let inertia = body.inertia_factor() * mass * state.radius * state.radius;
        self.count += 1;
        self.mass.add(mass);
        for (axis, sum) in self.momentum.iter_mut().enumerate() {
            sum.add(mass * state.velocity[axis]);
        }
        self.kinetic_energy.add(0.5 * (mass * state.velocity.norm_squared() + inertia * state.spin.norm_squared()));
    }

    /// Number of particles.
    #[must_use]
    pub const fn count(&self) -> u64 {
        self.count
    }

    /// The sums as numbers.
    #[must_use]
    pub fn figures(&self) -> Figures {
        Figures {
            count: self.count,
            mass_kg: self.mass.value(),
            momentum_kg_m_s: [0, 1, 2].map(|axis: usize| self.momentum[axis].value()),
            kinetic_energy_J: self.kinetic_energy.value(),
        }
    }

    fn same_mass(&self, other: &Self) -> bool {
        self.count == other.count && self.mass.equals(&other.mass)
    }
}

/// Sums over crossings.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize)]
#[expect(non_snake_case, reason = "the names are keys of summary.json and end in the unit J")]
pub struct Figures {
    /// Number of particles.
    pub count: u64,
    /// Mass \[kg\].
    pub mass_kg: f64,
    /// Momentum \[kg m/s\].
    pub momentum_kg_m_s: [f64; 3],
    /// Energy of translation and rotation \[J\].
    pub kinetic_energy_J: f64,
}

/// Why a recorded crossing is not among those that arrived with the stored bits.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Exception {
    /// Its passage is outside of the window.
    OutsideWindow,
    /// Its passage is before the stage begins.
    BeforeStart,
    /// Its passage is after the stage's end, or it was still a ghost then.
    OnItsWay,
    /// It was lost as a ghost.
    LostInZone,
    /// It arrived with another state than the stored one, beyond the bars of who computed.
    Deviating,
    /// It arrived at another look than the one at which it was due.
    OutOfTime,
    /// It arrived more than once.
    Repeated,
    /// It arrived and was never recorded.
    Unknown,
    /// It is missing, and nothing says why.
    Missing,
}

/// Crossings of one kind of exception.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Exceptions {
    /// Why.
    pub reason: Exception,
    /// How many.
    pub count: u64,
    /// The first of them.
    pub first: Vec<ParticleId>,
}

/// Collects exceptions by reason.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
struct ExceptionList(Vec<Exceptions>);

impl ExceptionList {
    fn add(&mut self, reason: Exception, id: ParticleId) {
        let index = self.0.iter().position(|entry| entry.reason == reason).unwrap_or_else(|| {
            self.0.push(Exceptions { reason, count: 0, first: Vec::new() });
            self.0.len() - 1
        });
        let entry = &mut self.0[index];
        entry.count += 1;
        if entry.first.len() < NAMED {
            entry.first.push(id);
        }
    }
}

/// Books arrivals while the downstream runs; part of its checkpoint. Eight bytes a crossing, and what deviates.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct ArrivalBook {
    arrived: Vec<ParticleId>,
    lost: Vec<ParticleId>,
    sums: Sums,
    bit_equal: u64,
    exceptions: ExceptionList,
    /// Largest distance from the stored place [m] and difference from the stored velocity [m/s].
    largest_deviation: [f64; 2],
    histories: Histories,
}

/// How far from the stored state an arrival may be; its spin never.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Bars {
    /// Distance from the place [m].
    pub place: f64,
    /// Difference from the velocity [m/s].
    pub velocity: f64,
}

impl Bars {
    /// Not by a bit.
    pub const NONE: Self = Self { place: 0.0, velocity: 0.0 };
}

/// What became of the memories of contacts.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Histories {
    /// Put back as stored.
    pub restored: u64,
    /// Left to the solver, as the partner was an ordinary particle already.
    pub kept: u64,
    /// Stored for a partner that was not in contact.
    pub without_partner: u64,
}

impl ArrivalBook {
    /// A particle has been released: the state that was `wanted`, and the one that it has now.
    pub fn arrived(&mut self, wanted: &ParticleState, now: &ParticleState, bars: Bars, body: Body) {
        self.arrived.push(now.id);
        self.sums.add(now, body);
        if same_bits(wanted, now) {
            self.bit_equal += 1;
            return;
        }
        let found = [(wanted.position - now.position).norm(), (wanted.velocity - now.velocity).norm()];
        // Whatever is neither place nor velocity has to be the same to the bit; so has either of them without a bar.
        let spared = ParticleState {
            position: if bars.place > 0.0 { wanted.position } else { now.position },
            velocity: if bars.velocity > 0.0 { wanted.velocity } else { now.velocity },
            ..*now
        };
        let within = found[0] <= bars.place && found[1] <= bars.velocity;
        if !within || !same_bits(wanted, &spared) {
            self.exceptions.add(Exception::Deviating, now.id);
        }
        for (largest, found) in self.largest_deviation.iter_mut().zip(found) {
            *largest = largest.max(found);
        }
    }

    /// An arrival did not happen at the look at which it was due.
    pub fn out_of_time(&mut self, id: ParticleId) {
        self.exceptions.add(Exception::OutOfTime, id);
    }

    /// A ghost is no longer there at its release.
    pub fn lost(&mut self, id: ParticleId) {
        self.lost.push(id);
        self.exceptions.add(Exception::LostInZone, id);
    }

    /// Memories of contacts at releases.
    pub fn add_histories(&mut self, found: Histories) {
        self.histories.restored += found.restored;
        self.histories.kept += found.kept;
        self.histories.without_partner += found.without_partner;
    }

    /// Compares with everything that was recorded: each crossing's state under the identity that it has in the stage, and why it
    /// cannot have arrived, if so ([`Exception::OutsideWindow`], [`Exception::BeforeStart`], [`Exception::OnItsWay`]).
    #[must_use]
    pub fn close(
        mut self,
        recorded: impl Iterator<Item = (ParticleState, Option<Exception>)>,
        body: Body,
    ) -> ArrivalReport {
        self.arrived.sort_unstable();
        self.lost.sort_unstable();
        let mut sums = Sums::default();
        let mut due = Sums::default();
        let mut known: Vec<ParticleId> = Vec::new();
        for (state, excuse) in recorded {
            sums.add(&state, body);
            known.push(state.id);
            let from = self.arrived.partition_point(|id| *id < state.id);
            let times = self.arrived[from..].iter().take_while(|id| **id == state.id).count();
            match (times, excuse) {
                (0, Some(reason)) => self.exceptions.add(reason, state.id),
                (0, None) if self.lost.binary_search(&state.id).is_err() => {
                    self.exceptions.add(Exception::Missing, state.id);
                }
                (0, None) => {}
                (1, _) => {}
                (_, _) => self.exceptions.add(Exception::Repeated, state.id),
            }
            if times > 0 {
                due.add(&state, body);
            }
        }
        known.sort_unstable();
        let unknown: Vec<ParticleId> =
            self.arrived.iter().copied().filter(|id| known.binary_search(id).is_err()).collect();
        unknown.into_iter().for_each(|id| self.exceptions.add(Exception::Unknown, id));
        self.exceptions.0.sort_by_key(|entry| entry.reason);
        let wrong = |entry: &Exceptions| {
            matches!(
                entry.reason,
                Exception::Missing | Exception::Repeated | Exception::Unknown | Exception::LostInZone
            )
        };
        ArrivalReport {
            recorded: sums.figures(),
            arrived: self.sums.figures(),
            sums_exact: due.same_mass(&self.sums),
            each_once: !self.exceptions.0.iter().any(wrong),
            bit_equal: self.bit_equal,
            largest_deviation_m: self.largest_deviation[0],
            largest_deviation_m_s: self.largest_deviation[1],
            histories: self.histories,
            exceptions: self.exceptions.0,
        }
    }
}

/// What arrived, against what was recorded.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct ArrivalReport {
    /// All that the stream holds.
    pub recorded: Figures,
    /// All that arrived.
    pub arrived: Figures,
    /// Whether number and mass of what arrived are those of the same crossings as recorded, without any rounding.
    pub sums_exact: bool,
    /// Whether every crossing that could arrive did so exactly once.
    pub each_once: bool,
    /// Arrivals with the stored bits.
    pub bit_equal: u64,
    /// Largest distance between the stored and the actual place \[m\].
    pub largest_deviation_m: f64,
    /// Largest difference between the stored and the actual velocity \[m/s\].
    pub largest_deviation_m_s: f64,
    /// Memories of contacts.
    pub histories: Histories,
    /// Everything that is not as stored, by reason.
    pub exceptions: Vec<Exceptions>,
}

/// Bit for bit: 0.0 and -0.0 differ.
fn same_bits(one: &ParticleState, other: &ParticleState) -> bool {
    let vector = |v: &Vec3| [v.x, v.y, v.z].map(f64::to_bits);
    let bits = |state: &ParticleState| {
        (
            (state.id, state.material, state.radius.to_bits(), state.density.to_bits()),
            [vector(&state.position), vector(&state.velocity), vector(&state.spin)],
        )
    };
    bits(one) == bits(other)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::vec3;

    fn state(serial: u64) -> ParticleState {
        ParticleState {
            id: ParticleId::new(1, serial),
            material: 0,
            radius: 0.001 * (1.0 + 0.1 * serial as f64),
            density: 2500.0,
            position: vec3(0.1, 0.2, 0.3),
            velocity: vec3(0.0, 0.0, -1.0 - serial as f64),
            spin: vec3(1.0, 0.0, 0.0),
        }
    }

    fn count(report: &ArrivalReport, reason: Exception) -> u64 {
        report.exceptions.iter().find(|entry| entry.reason == reason).map_or(0, |entry| entry.count)
    }

    fn all(number: u64) -> impl Iterator<Item = (ParticleState, Option<Exception>)> {
        (0..number).map(|serial| (state(serial), None))
    }

    #[test]
    fn a_faultless_replay_has_an_empty_list_in_any_order() {
        let mut book = ArrivalBook::default();
        (0..30).rev().for_each(|serial| book.arrived(&state(serial), &state(serial), Bars::NONE, Body::Sphere));
        let text = serde_json::to_string(&book).unwrap();
        assert_eq!(serde_json::from_str::<ArrivalBook>(&text).unwrap(), book, "a checkpoint keeps all");
        let report = book.close(all(30), Body::Sphere);
        assert!(report.sums_exact && report.each_once && report.exceptions.is_empty());
        assert_eq!((report.bit_equal, report.recorded), (30, report.arrived));
        let mass: f64 = (0..30).map(|serial| Body::Sphere.mass(state(serial).radius, 2500.0)).sum();
        assert!((report.arrived.mass_kg - mass).abs() < 1e-15 * 30.0 * mass);
        let momentum: f64 =
            (0..30).map(|serial| Body::Sphere.mass(state(serial).radius, 2500.0) * state(serial).velocity.z).sum();
        assert!((report.arrived.momentum_kg_m_s[2] / momentum - 1.0).abs() < 1e-14);
    }

    #[test]
    fn every_fault_is_listed_with_its_reason() {
        let mut book = ArrivalBook::default();
        for serial in 0..25 {
            let mut now = state(serial);
            match serial {
                2 => continue,
                3 => book.lost(now.id),
                4 => now.velocity.x = -0.0,
                5 => now.position.z = f64::from_bits(now.position.z.to_bits() ^ 1),
                6 => book.arrived(&state(6), &now, Bars::NONE, Body::Sphere),
                7 => continue,
                _ => {}
            }
            if serial != 3 {
                book.arrived(&state(serial), &now, Bars::NONE, Body::Sphere);
            }
        }
        book.arrived(&state(99), &state(99), Bars::NONE, Body::Sphere);
        let excused = all(25).map(|(state, _)| (state, (state.id.serial() == 7).then_some(Exception::OnItsWay)));
        let report = book.close(excused, Body::Sphere);
        for reason in
            [Exception::Missing, Exception::LostInZone, Exception::Repeated, Exception::Unknown, Exception::OnItsWay]
        {
            assert_eq!(count(&report, reason), 1, "{reason:?}");
        }
        assert_eq!(count(&report, Exception::Deviating), 2);
        assert!(!report.each_once && !report.sums_exact);
        assert!(report.largest_deviation_m > 0.0 && report.largest_deviation_m < 1e-16);
        // 22 of the 25 and two that should not be; two of all these are not bit-equal.
        assert_eq!((report.arrived.count, report.bit_equal), (24, 22));
    }

    #[test]
    fn one_bit_of_one_mass_breaks_the_sum_and_lists_stay_short() {
        let mut book = ArrivalBook::default();
        for serial in 0..1000 {
            let mut now = state(serial);
            if serial == 500 {
                now.density = f64::from_bits(now.density.to_bits() ^ 1);
            }
            now.velocity.y = 1e-9;
            book.arrived(&state(serial), &now, Bars::NONE, Body::Sphere);
        }
        let report = book.close(all(1000), Body::Sphere);
        assert!(!report.sums_exact && report.each_once);
        let list = &report.exceptions[0];
        assert_eq!((list.count, list.first.len(), list.reason), (1000, NAMED, Exception::Deviating));
        assert!((report.largest_deviation_m_s - 1e-9).abs() < 1e-24);
    }
}
