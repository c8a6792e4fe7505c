//! The tangential spring with Coulomb's limit, with its memory of the contact.

use super::{Compatibility, LawSettings, NormalForce, TangentialLaw};
use crate::math::Vec3;

/// What the tangential law did in one evaluation.
#[derive(Debug, Clone, Copy)]
pub struct TangentialForce {
    /// Force on i [N].
    pub force: Vec3,
    /// Energy lost in sliding in this time step [J].
    pub slip: f64,
    /// Energy lost in the tangential dashpot in this time step [J].
    pub dashpot: f64,
    /// Energy that the law itself makes (> 0) or loses because its stiffness depends on the overlap [J].
    pub residual: f64,
}

/// F_t = -(k_t xi + gamma_t v_t), cut at mu |F_n|.
///
/// `history` is the spring, xi [m] (`Total`) or k_t xi accumulated [N] (`Incremental`); it is kept half a time step ahead, so
/// that full-step velocities v_t [m/s] integrate it to second order: xi(t) = h + v_t dt/2, then h = xi + v_t dt/2.
/// k_t tangential stiffness [N/m], gamma_t tangential damping [kg/s], mu sliding friction [-], F_n normal force [N], dt [s].
/// The limit acts on spring and dashpot together, and shortens the spring by the same ratio.
/// Source: Cundall & Strack (1979); full-step velocities: Vyas, Ottino, Lueptow & Umbanhowar (2025).
/// Rival convention: LIGGGHTS `tangential history` uses half-step velocities (h = xi + v_t dt), limits the spring alone and drops
/// the dashpot while sliding; the compatibility mode does that.
#[inline(always)]
#[must_use]
pub fn tangential_force<const ENERGY: bool>(
    settings: &LawSettings,
    normal: &NormalForce,
    friction: f64,
    direction: &Vec3,
    slip_velocity: &Vec3,
    timestep: f64,
    history: &mut Vec3,
) -> TangentialForce {
    let ours = settings.compatibility == Compatibility::Tollgate;
    let total = settings.tangential == TangentialLaw::Total;
    let stiffness = normal.tangential_stiffness;
    // xi = h * compliance, so that one code serves both memories.
    let (gain, compliance) =
        if total { (1.0, 1.0) } else { (stiffness, if stiffness > 0.0 { 1.0 / stiffness } else { 0.0 }) };
    let mut memory = *history - direction * history.dot(direction);
    if ours {
        memory *= length_restored(history, &memory);
    }
    let (before, after) = if ours { (0.5 * timestep, 0.5 * timestep) } else { (timestep, 0.0) };
    let trial = memory + slip_velocity * (before * gain);
    let spring_factor = if total { stiffness } else { 1.0 };
    let damping = if settings.tangential_damping { normal.tangential_damping } else { 0.0 };
    let limit = friction * if ours { normal.total.max(0.0) } else { normal.total.abs() };
    let mut force = trial * -spring_factor;
    if ours {
        force -= slip_velocity * damping;
    }
    let square = force.norm_squared();
    let mut kept = trial;
    let mut ratio = 1.0;
    if square > limit * limit {
        ratio = limit / square.sqrt();
        force *= ratio;
        kept *= ratio;
    } else if !ours {
        force -= slip_velocity * damping;
    }
    *history = kept + slip_velocity * (after * gain);
    let mut result = TangentialForce { force, slip: 0.0, dashpot: 0.0, residual: 0.0 };
    if ENERGY {
        let slip = (trial - kept) * compliance;
        let spring = kept * spring_factor;
        // Exact work of a spring kept half a step ahead: see docs/theory/energy.md.
        result.slip = spring.dot(&slip) + 0.5 * stiffness * slip.dot(&(slip - slip_velocity * timestep));
        let viscous = damping * slip_velocity.norm_squared() * timestep;
        if ratio == 1.0 {
            result.dashpot = viscous;
        } else if ours {
            // While it slides, all that the limited force takes is wear.
            result.slip += ratio * viscous;
        }
        // What the spring held as the step began changed its energy with the stiffness: k_t before over k_t now.
        let before = (1.0 - 2.0 * normal.stiffness_growth * timestep).max(0.0).sqrt();
        let energy = 0.5 * spring_factor * compliance * memory.norm_squared();
        result.residual = match (total, before > 0.0) {
            (true, _) => energy * (1.0 - before),
            (false, true) => energy * (1.0 - 1.0 / before),
            // A spring that was there without stiffness held nothing.
            (false, false) => 0.0,
        };
    }
    result
}

/// Factor that gives the projected spring its length before the projection, to second order: the spring turns with the contact.
#[inline(always)]
fn length_restored(before: &Vec3, after: &Vec3) -> f64 {
    let square = after.norm_squared();
    if square > 0.0 { 1.0 + 0.5 * (before.norm_squared() - square).min(square) / square } else { 1.0 }
}

/// Elastic energy of a tangential spring [J]: at the full step where `history` comes from
/// [`crate::dem::contact::present_memory`]; what [`tangential_force`] keeps runs half a time step ahead.
#[inline(always)]
#[must_use]
pub fn tangential_energy(settings: &LawSettings, stiffness: f64, history: &Vec3) -> f64 {
    let square = history.norm_squared();
    match settings.tangential {
        TangentialLaw::Total => 0.5 * stiffness * square,
        TangentialLaw::Incremental if stiffness > 0.0 => 0.5 * square / stiffness,
        TangentialLaw::Incremental => 0.0,
    }
}
