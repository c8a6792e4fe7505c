//! One contact: from the relative motion of two bodies to force, torque and what is lost.

use super::energy::Tally;
use super::law::constants::PairConstants;
use super::law::rolling::{RollingMotion, rolling_torque};
use super::law::tangential::{tangential_energy, tangential_force};
use super::law::{Compatibility, LawSettings, NormalForce, NormalMotion, TangentialLaw};
use super::neighbor::list::Memory;
use crate::math::Vec3;

/// Relative motion of body i and body j (a particle or a part) in contact.
#[derive(Debug, Clone, Copy)]
pub struct Touch {
    /// Unit normal from i to j.
    pub normal: Vec3,
    /// Overlap [m].
    pub overlap: f64,
    /// v_i - v_j of the centres, or of centre and surface [m/s].
    pub velocity: Vec3,
    /// a_i omega_i + a_j omega_j with the lever arms a [m/s].
    pub lever_spin: Vec3,
    /// omega_i - omega_j [rad/s].
    pub relative_spin: Vec3,
    /// R* [m].
    pub effective_radius: f64,
    /// m* [kg].
    pub effective_mass: f64,
    /// 1/I_i + 1/I_j [1/(kg m2)].
    pub inverse_inertia: f64,
    /// Closing speed less its mean over the time step [m/s]; known where losses are accounted for.
    pub closing_lag: f64,
}

/// What the contact does to body i; j gets the opposite force and rolling torque.
#[derive(Debug, Clone, Copy)]
pub struct Answer {
    /// Force on i [N].
    pub force: Vec3,
    /// n x F_t [N]: times its lever arm, the torque on either body.
    pub twist: Vec3,
    /// Rolling torque on i [N m].
    pub rolling: Vec3,
    /// The normal law's answer.
    pub normal: NormalForce,
}

impl Touch {
    /// Tangential velocity at the contact point [m/s] and closing speed [m/s].
    #[inline(always)]
    fn split_velocity(&self) -> (Vec3, f64) {
        let closing = self.velocity.dot(&self.normal);
        (self.velocity - self.normal * closing + self.lever_spin.cross(&self.normal), closing)
    }
}

/// Evaluates the laws on a contact. `share` is the part of its losses that this call books (a pair computed by two chunks books
/// one half in each).
#[inline(always)]
pub fn answer<const FRICTION: bool, const ROLLING: bool, const ENERGY: bool>(
    law: &LawSettings,
    pair: &PairConstants,
    touch: &Touch,
    timestep: f64,
    memory: &mut Memory,
    tally: &mut Tally,
    share: f64,
) -> Answer {
    let closing_speed = touch.velocity.dot(&touch.normal);
    let motion = NormalMotion {
        overlap: touch.overlap,
        closing_speed,
        effective_radius: touch.effective_radius,
        effective_mass: touch.effective_mass,
    };
    let mut normal = law.normal_force(pair, &motion);
    if ENERGY {
        normal.stiffness_growth -= normal.growth_by_overlap * touch.closing_lag;
    }
    let mut result =
        Answer { force: touch.normal * -normal.total, twist: Vec3::zeros(), rolling: Vec3::zeros(), normal };
    if ENERGY {
        tally.dashpot += share * (normal.total - normal.elastic) * closing_speed * timestep;
    }
    if FRICTION {
        let (slip_velocity, _) = touch.split_velocity();
        let tangential = tangential_force::<ENERGY>(
            law,
            &normal,
            pair.sliding_friction,
            &touch.normal,
            &slip_velocity,
            timestep,
            &mut memory.tangential,
        );
        result.force += tangential.force;
        result.twist = touch.normal.cross(&tangential.force);
        if ENERGY {
            tally.slip += share * tangential.slip;
            tally.dashpot += share * tangential.dashpot;
            tally.law_residual += share * tangential.residual;
        }
    }
    if ROLLING {
        let motion = RollingMotion {
            relative_spin: touch.relative_spin,
            effective_radius: touch.effective_radius,
            inverse_inertia: touch.inverse_inertia,
        };
        result.rolling =
            rolling_torque(law, &normal, pair.rolling_friction, &touch.normal, &motion, timestep, &mut memory.rolling);
        if ENERGY {
            tally.rolling -= share * result.rolling.dot(&touch.relative_spin) * timestep;
        }
    }
    result
}

/// The memory at the present full step: what is kept runs half a time step ahead in our convention.
#[must_use]
pub fn present_memory(law: &LawSettings, pair: &PairConstants, touch: &Touch, timestep: f64, kept: &Memory) -> Memory {
    if law.compatibility == Compatibility::Liggghts {
        return *kept;
    }
    let (slip_velocity, closing_speed) = touch.split_velocity();
    let motion = NormalMotion {
        overlap: touch.overlap,
        closing_speed,
        effective_radius: touch.effective_radius,
        effective_mass: touch.effective_mass,
    };
    let stiffness = law.normal_force(pair, &motion).tangential_stiffness;
    let gain = if law.tangential == TangentialLaw::Total { 1.0 } else { stiffness };
    let roll = touch.relative_spin - touch.normal * touch.relative_spin.dot(&touch.normal);
    let rolling_gain = stiffness * touch.effective_radius * touch.effective_radius;
    Memory {
        tangential: kept.tangential - slip_velocity * (0.5 * timestep * gain),
        rolling: kept.rolling - roll * (0.5 * timestep * rolling_gain),
    }
}

/// Elastic energy of a contact [J], `memory` as [`present_memory`] gives it.
#[must_use]
pub fn elastic_energy(law: &LawSettings, normal: &NormalForce, memory: &Memory) -> f64 {
    normal.elastic_energy + tangential_energy(law, normal.tangential_stiffness, &memory.tangential)
}
