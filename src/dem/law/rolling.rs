//! Rolling resistance.

use super::{Compatibility, ContactStiffness, LawSettings, RollingLaw};
use crate::math::lanes::{LaneVector, Lanes, Mask};

/// What the rolling laws need of a contact.
#[derive(Debug, Clone, Copy)]
pub struct RollingMotion<L = f64> {
    /// omega_i - omega_j [rad/s].
    pub relative_spin: LaneVector<L>,
    /// R* [m].
    pub effective_radius: L,
    /// 1/I_i + 1/I_j [1/(kg m2)]; the wall's is 0.
    pub inverse_inertia: L,
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
pub fn rolling_torque<L: Lanes>(
    settings: &LawSettings,
    stiffness: &ContactStiffness<L>,
    repulsion: L,
    friction: L,
    direction: &LaneVector<L>,
    motion: &RollingMotion<L>,
    timestep: f64,
    history: &mut LaneVector<L>,
) -> LaneVector<L> {
    let spin = motion.relative_spin.plus(direction, -motion.relative_spin.dot(direction));
    let ours = settings.compatibility == Compatibility::Tollgate;
    let zero = L::zero();
    match settings.rolling {
        RollingLaw::None => LaneVector::zeros(),
        RollingLaw::Cdt => {
            let (force, square) = if ours {
                (repulsion.larger(zero), spin.norm_squared())
            } else {
                (stiffness.elastic, motion.relative_spin.norm_squared())
            };
            let length = square.sqrt();
            let mut torque = friction * motion.effective_radius * force;
            if ours && timestep > 0.0 {
                torque = torque.smaller(length / (motion.inverse_inertia * L::splat(timestep)));
            }
            (spin * (-torque / length)).only(length.exceeds(zero))
        }
        RollingLaw::Epsd2 => {
            let rolling = stiffness.tangential_stiffness * motion.effective_radius * motion.effective_radius;
            let (before, after) = if ours { (0.5 * timestep, 0.5 * timestep) } else { (timestep, 0.0) };
            let memory = if ours { history.plus(direction, -history.dot(direction)) } else { *history };
            let mut spring = memory.plus(&spin, L::splat(before) * rolling);
            let limit =
                friction * motion.effective_radius * if ours { repulsion.larger(zero) } else { repulsion.abs() };
            let square = spring.norm_squared();
            let rolls = square.exceeds(limit * limit);
            if rolls.any() {
                spring = spring * L::select(rolls, limit / square.sqrt(), L::splat(1.0));
            }
            *history = spring.plus(&spin, L::splat(after) * rolling);
            -spring
        }
    }
}
