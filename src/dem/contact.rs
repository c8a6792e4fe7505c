//! One contact: from the relative motion of two bodies to force, torque and what is lost.

use super::energy::Tally;
use super::law::constants::PairConstants;
use super::law::rolling::{RollingMotion, rolling_torque};
use super::law::tangential::{TangentialMotion, tangential_energy, tangential_force};
use super::law::{Compatibility, ContactStiffness, LawSettings, NormalContact, TangentialLaw};
use super::neighbor::list::Memory;
use crate::math::lanes::{LaneVector, Lanes};

/// Relative motion of body i and body j (a particle or a part) in contact.
#[derive(Debug, Clone, Copy)]
pub struct Touch<L = f64> {
    /// Unit normal from i to j.
    pub normal: LaneVector<L>,
    /// Overlap [m].
    pub overlap: L,
    /// v_i - v_j of the centres, or of centre and surface [m/s].
    pub velocity: LaneVector<L>,
    /// a_i omega_i + a_j omega_j with the lever arms a [m/s].
    pub lever_spin: LaneVector<L>,
    /// omega_i - omega_j [rad/s].
    pub relative_spin: LaneVector<L>,
    /// R* [m].
    pub effective_radius: L,
    /// m* [kg].
    pub effective_mass: L,
    /// 1/I_i + 1/I_j [1/(kg m2)].
    pub inverse_inertia: L,
    /// Closing speed less its mean over the time step [m/s]; known where losses are accounted for.
    pub closing_lag: L,
}

/// The springs that a contact remembers.
#[derive(Debug, Clone, Copy)]
pub struct Springs<L = f64> {
    /// Tangential, see [`super::law::tangential`].
    pub tangential: LaneVector<L>,
    /// Rolling [N m].
    pub rolling: LaneVector<L>,
}

/// What the contact does to body i; j gets the opposite force and rolling torque.
#[derive(Debug, Clone, Copy)]
pub struct Answer<L = f64> {
    /// Force on i [N].
    pub force: LaneVector<L>,
    /// n x F_t [N]: times its lever arm, the torque on either body.
    pub twist: LaneVector<L>,
    /// Rolling torque on i [N m].
    pub rolling: LaneVector<L>,
    /// Repulsion along the normal [N].
    pub repulsion: L,
    /// What it took in the time step; zero where losses are not accounted for.
    pub lost: Lost<L>,
}

/// Energies that a contact took in a time step [J], entries of [`super::energy::EnergyBudget`].
#[derive(Debug, Clone, Copy)]
pub struct Lost<L = f64> {
    /// In sliding.
    pub slip: L,
    /// In dashpots.
    pub dashpot: L,
    /// By rolling resistance.
    pub rolling: L,
    /// Made by the law itself.
    pub law_residual: L,
}

impl<L: Lanes> Springs<L> {
    /// No memory: not in contact.
    #[inline(always)]
    pub fn none() -> Self {
        Self { tangential: LaneVector::zeros(), rolling: LaneVector::zeros() }
    }
}

impl From<&Memory> for Springs {
    #[inline(always)]
    fn from(memory: &Memory) -> Self {
        Self { tangential: memory.tangential.into(), rolling: memory.rolling.into() }
    }
}

impl From<Springs> for Memory {
    #[inline(always)]
    fn from(springs: Springs) -> Self {
        Self { tangential: springs.tangential.into(), rolling: springs.rolling.into() }
    }
}

impl<L: Lanes> Lost<L> {
    #[inline(always)]
    fn nothing() -> Self {
        Self { slip: L::zero(), dashpot: L::zero(), rolling: L::zero(), law_residual: L::zero() }
    }

    /// Books the losses of the lanes that the bits of `concerned` pick, in their order. `share` is the part that is booked here
    /// (a pair computed by two chunks books one half in each).
    #[inline(always)]
    pub fn book(&self, share: f64, concerned: u16, tally: &mut Tally) {
        let (slip, dashpot) = (self.slip.to_array(), self.dashpot.to_array());
        let (rolling, residual) = (self.rolling.to_array(), self.law_residual.to_array());
        for lane in (0..L::COUNT).filter(|lane| concerned >> lane & 1 == 1) {
            tally.slip += share * slip[lane];
            tally.dashpot += share * dashpot[lane];
            tally.rolling += share * rolling[lane];
            tally.law_residual += share * residual[lane];
        }
    }
}

impl<L: Lanes> Touch<L> {
    /// Tangential velocity at the contact point [m/s] and closing speed [m/s].
    #[inline(always)]
    fn split_velocity(&self) -> (LaneVector<L>, L) {
        let closing = self.velocity.dot(&self.normal);
        (self.lever_spin.cross(&self.normal) + self.velocity.minus(&self.normal, closing), closing)
    }

    /// What the normal laws look at.
    #[inline(always)]
    pub fn normal_contact(&self) -> NormalContact<L> {
        NormalContact {
            overlap: self.overlap,
            effective_radius: self.effective_radius,
            effective_mass: self.effective_mass,
        }
    }
}

/// Evaluates the laws on contacts, one a lane. Lanes without overlap give anything.
#[inline(always)]
pub fn answer<L: Lanes, const FRICTION: bool, const ROLLING: bool, const ENERGY: bool>(
    law: &LawSettings,
    pair: &PairConstants<L>,
    stiffness: &ContactStiffness<L>,
    touch: &Touch<L>,
    timestep: f64,
    memory: &mut Springs<L>,
) -> Answer<L> {
    let (slip_velocity, closing_speed) = touch.split_velocity();
    let repulsion = law.repulsion(stiffness, closing_speed);
    let mut lost = Lost::nothing();
    if ENERGY {
        lost.dashpot = (repulsion - stiffness.elastic) * closing_speed * L::splat(timestep);
    }
    let (mut force, mut twist, mut rolling) = (LaneVector::zeros(), LaneVector::zeros(), LaneVector::zeros());
    if FRICTION {
        let motion = TangentialMotion {
            slip_velocity,
            stiffness_growth: stiffness.growth_by_overlap * (closing_speed - touch.closing_lag),
        };
        let (friction, history) = (pair.sliding_friction, &mut memory.tangential);
        let tangential = tangential_force::<L, ENERGY>(
            law,
            stiffness,
            friction,
            repulsion,
            &touch.normal,
            &motion,
            timestep,
            history,
        );
        force = tangential.force;
        twist = tangential.twist;
        if ENERGY {
            lost.slip = tangential.slip;
            lost.dashpot = lost.dashpot + tangential.dashpot;
            lost.law_residual = tangential.residual;
        }
    }
    force = force.minus(&touch.normal, repulsion);
    if ROLLING {
        let motion = RollingMotion {
            relative_spin: touch.relative_spin,
            effective_radius: touch.effective_radius,
            inverse_inertia: touch.inverse_inertia,
        };
        let (friction, history) = (pair.rolling_friction, &mut memory.rolling);
        rolling = rolling_torque(law, stiffness, repulsion, friction, &touch.normal, &motion, timestep, history);
        if ENERGY {
            lost.rolling = -(rolling.dot(&touch.relative_spin) * L::splat(timestep));
        }
    }
    Answer { force, twist, rolling, repulsion, lost }
}

/// The memory at the present full step of contacts that have one: what is kept runs half a time step ahead in our convention.
#[inline(always)]
#[must_use]
pub fn present_memory<L: Lanes>(
    law: &LawSettings,
    stiffness: &ContactStiffness<L>,
    touch: &Touch<L>,
    timestep: f64,
    kept: Springs<L>,
) -> Springs<L> {
    if law.compatibility == Compatibility::Liggghts {
        return kept;
    }
    let (slip_velocity, _) = touch.split_velocity();
    let tangential = stiffness.tangential_stiffness;
    let gain = if law.tangential == TangentialLaw::Total { L::splat(1.0) } else { tangential };
    let roll = touch.relative_spin - touch.normal * touch.relative_spin.dot(&touch.normal);
    let half = L::splat(0.5 * timestep);
    let rolling_gain = tangential * touch.effective_radius * touch.effective_radius;
    Springs {
        tangential: kept.tangential - slip_velocity * (half * gain),
        rolling: kept.rolling - roll * (half * rolling_gain),
    }
}

/// Elastic energy of a contact [J], `memory` as [`present_memory`] gives it.
#[inline(always)]
#[must_use]
pub fn elastic_energy<L: Lanes>(law: &LawSettings, stiffness: &ContactStiffness<L>, memory: &Springs<L>) -> L {
    stiffness.elastic_energy + tangential_energy(law, stiffness.tangential_stiffness, &memory.tangential)
}
