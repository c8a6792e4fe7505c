//! Rolling resistance.

use super::{Compatibility, LawSettings, NormalForce, RollingLaw};
use crate::math::Vec3;

/// What the rolling laws need of a contact.
#[derive(Debug, Clone, Copy)]
pub struct RollingMotion {
    /// omega_i - omega_j [rad/s].
    pub relative_spin: Vec3,
    /// R* [m].
    pub effective_radius: f64,
    /// 1/I_i + 1/I_j [1/(kg m2)]; the wall's is 0.
    pub inverse_inertia: f64,
}

/// Torque on i [N m]; on j the opposite.
///
/// `Cdt`: M = -mu_r R* F_n w/|w|, w the tangential part of the relative spin; ours is limited to the torque that stops w within
/// the time step, so that a particle at rest does not chatter. `Epsd2`: dM = -k_r w dt with k_r = k_t R*^2, |M| <= mu_r R* F_n,
/// no dashpot; `history` is the torque of the spring [N m], half a step ahead as in [`super::tangential`].
/// mu_r rolling friction [-], R* effective radius [m], F_n normal force [N], k_t tangential stiffness [N/m].
/// Source: Zhou et al. (1999) (CDT), Iwashita & Oda (1998), Ai et al. (2011). Rival convention: LIGGGHTS `cdt` takes the elastic
/// part of F_n and divides by the length of the whole relative spin; the compatibility mode does that.
#[inline(always)]
#[must_use]
pub fn rolling_torque(
    settings: &LawSettings,
    normal: &NormalForce,
    friction: f64,
    direction: &Vec3,
    motion: &RollingMotion,
    timestep: f64,
    history: &mut Vec3,
) -> Vec3 {
    let spin = motion.relative_spin - direction * motion.relative_spin.dot(direction);
    let ours = settings.compatibility == Compatibility::Tollgate;
    match settings.rolling {
        RollingLaw::None => Vec3::zeros(),
        RollingLaw::Cdt => {
            let (force, length) =
                if ours { (normal.total.max(0.0), spin.norm()) } else { (normal.elastic, motion.relative_spin.norm()) };
            if length == 0.0 {
                return Vec3::zeros();
            }
            let mut torque = friction * motion.effective_radius * force;
            if ours && timestep > 0.0 {
                torque = torque.min(length / (motion.inverse_inertia * timestep));
            }
            spin * (-torque / length)
        }
        RollingLaw::Epsd2 => {
            let stiffness = normal.tangential_stiffness * motion.effective_radius * motion.effective_radius;
            let (before, after) = if ours { (0.5 * timestep, 0.5 * timestep) } else { (timestep, 0.0) };
            let memory = if ours { *history - direction * history.dot(direction) } else { *history };
            let mut spring = memory + spin * (before * stiffness);
            let limit =
                friction * motion.effective_radius * if ours { normal.total.max(0.0) } else { normal.total.abs() };
            let square = spring.norm_squared();
            if square > limit * limit {
                spring *= limit / square.sqrt();
            }
            *history = spring + spin * (after * stiffness);
            -spring
        }
    }
}
