//! The tangential spring with Coulomb's limit, with its memory of the contact.

use super::{Compatibility, ContactStiffness, LawSettings, TangentialLaw};
use crate::math::lanes::{LaneVector, Lanes};

/// What the tangential law did in one evaluation.
#[derive(Debug, Clone, Copy)]
pub struct TangentialForce<L = f64> {
    /// Force on i [N].
    pub force: LaneVector<L>,
    /// n x F_t [N].
    pub twist: LaneVector<L>,
    /// Energy lost in sliding in this time step [J].
    pub slip: L,
    /// Energy lost in the tangential dashpot in this time step [J].
    pub dashpot: L,
    /// Energy that the law itself makes (> 0) or loses because its stiffness depends on the overlap [J].
    pub residual: L,
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
pub fn tangential_force<L: Lanes, const ENERGY: bool>(
    settings: &LawSettings,
    stiffness: &ContactStiffness<L>,
    friction: L,
    repulsion: L,
    direction: &LaneVector<L>,
    motion: &TangentialMotion<L>,
    timestep: f64,
    history: &mut LaneVector<L>,
) -> TangentialForce<L> {
    let ours = settings.compatibility == Compatibility::Tollgate;
    let total = settings.tangential == TangentialLaw::Total;
    let slip_velocity = &motion.slip_velocity;
    let lost = history.dot(direction);
    let mut memory = history.minus(direction, lost);
    if ours {
        memory = memory * length_restored(lost, history.norm_squared());
    }
    let (before, after) = if ours { (0.5 * timestep, 0.5 * timestep) } else { (timestep, 0.0) };
    let gain = if total { L::splat(1.0) } else { stiffness.tangential_stiffness };
    let trial = memory.plus(slip_velocity, L::splat(before) * gain);
    let damping = if settings.tangential_damping { stiffness.tangential_damping } else { L::zero() };
    let mut force = if total { trial * -stiffness.tangential_stiffness } else { -trial };
    if ours {
        force = force.minus(slip_velocity, damping);
    }
    let limit = friction * if ours { repulsion.larger(L::zero()) } else { repulsion.abs() };
    let square = force.norm_squared();
    let slides = square.exceeds(limit * limit);
    // No branch: which lanes slide cannot be foretold, and a wrong guess costs more than the root.
    let ratio = L::select(slides, limit / square.sqrt(), L::splat(1.0));
    // Turned before the limit is known, so that less waits for it.
    let mut twist = direction.cross(&force) * ratio;
    force = force * ratio;
    let kept = trial * ratio;
    if !ours {
        force = LaneVector::select(slides, &force, &force.minus(slip_velocity, damping));
        twist = direction.cross(&force);
    }
    *history = kept.plus(slip_velocity, L::splat(after) * gain);
    let mut result = TangentialForce { force, twist, slip: L::zero(), dashpot: L::zero(), residual: L::zero() };
    if ENERGY {
        let spring = Spring { memory, trial, kept, ratio, slides };
        book_losses(settings, stiffness, motion, &spring, timestep, &mut result);
    }
    result
}

/// Motion across the normal.
#[derive(Debug, Clone, Copy)]
pub struct TangentialMotion<L = f64> {
    /// v_t [m/s].
    pub slip_velocity: LaneVector<L>,
    /// d(ln k_t)/dt [1/s]; looked at where losses are accounted for.
    pub stiffness_growth: L,
}

/// The spring through one evaluation: as it was found and turned with the contact, before Coulomb's limit, and after.
struct Spring<L: Lanes> {
    memory: LaneVector<L>,
    trial: LaneVector<L>,
    kept: LaneVector<L>,
    ratio: L,
    slides: L::Mask,
}

/// Energies of one evaluation.
#[inline(always)]
fn book_losses<L: Lanes>(
    settings: &LawSettings,
    stiffness: &ContactStiffness<L>,
    motion: &TangentialMotion<L>,
    held: &Spring<L>,
    timestep: f64,
    result: &mut TangentialForce<L>,
) {
    let (zero, one, half, timestep) = (L::zero(), L::splat(1.0), L::splat(0.5), L::splat(timestep));
    let total = settings.tangential == TangentialLaw::Total;
    let (tangential, slip_velocity) = (stiffness.tangential_stiffness, &motion.slip_velocity);
    // xi = h * compliance, so that one code serves both memories. A spring that was there without stiffness held nothing.
    let compliance = if total { one } else { L::select(tangential.exceeds(zero), one / tangential, zero) };
    let spring_factor = if total { tangential } else { one };
    let damping = if settings.tangential_damping { stiffness.tangential_damping } else { zero };
    let slip = (held.trial - held.kept) * compliance;
    let spring = held.kept * spring_factor;
    // Exact work of a spring kept half a step ahead: see docs/theory/energy.md.
    let way = slip - *slip_velocity * timestep;
    result.slip = spring.dot(&slip) + half * tangential * slip.dot(&way);
    let viscous = damping * slip_velocity.norm_squared() * timestep;
    result.dashpot = L::select(held.slides, zero, viscous);
    if settings.compatibility == Compatibility::Tollgate {
        // While it slides, all that the limited force takes is wear.
        result.slip = result.slip + L::select(held.slides, held.ratio * viscous, zero);
    }
    // What the spring held as the step began changed its energy with the stiffness: k_t before over k_t now.
    let before = (one - L::splat(2.0) * motion.stiffness_growth * timestep).larger(zero).sqrt();
    let energy = half * spring_factor * compliance * held.memory.norm_squared();
    result.residual = if total {
        energy * (one - before)
    } else {
        L::select(before.exceeds(zero), energy * (one - one / before), zero)
    };
}

/// Factor that gives a spring of this `square` of its length its length back after the part `lost` along the normal was taken away, to
/// second order in that part: the spring turns with the contact.
#[inline(always)]
fn length_restored<L: Lanes>(lost: L, square: L) -> L {
    // Divided first: the spring is known long before the normal is.
    let inverse = L::splat(0.5) / square;
    let factor = (lost * lost).mul_add(inverse, L::splat(1.0));
    // A spring whose square is subnormal has an infinite inverse, which nothing lost turns into not-a-number: it is none.
    L::select(square.exceeds(L::splat(f64::MIN_POSITIVE)), factor, L::splat(1.0))
}

/// Elastic energy of a tangential spring [J]: at the full step where `history` comes from
/// [`crate::dem::contact::present_memory`]; what [`tangential_force`] keeps runs half a time step ahead.
#[inline(always)]
#[must_use]
pub fn tangential_energy<L: Lanes>(settings: &LawSettings, stiffness: L, history: &LaneVector<L>) -> L {
    let (square, half, zero) = (history.norm_squared(), L::splat(0.5), L::zero());
    match settings.tangential {
        TangentialLaw::Total => half * stiffness * square,
        TangentialLaw::Incremental => L::select(stiffness.exceeds(zero), half * square / stiffness, zero),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The spring of a grain that rests for long decays by the turning of its contact, through all subnormal squares to zero.
    #[test]
    fn a_spring_of_any_length_gives_a_number_and_never_grows() {
        for exponent in -330..=0_i32 {
            let length = 10f64.powi(exponent);
            for share in [0.0, 1e-9, 0.5, 1.0] {
                let factor = length_restored(share * length, length * length);
                assert!((1.0..=1.5).contains(&factor), "{factor} at a length of 1e{exponent} of which {share} is lost");
            }
        }
        // Second order in what is lost: 1 / sqrt(1 - s^2) = 1 + s^2 / 2 + ..., here with s = 1e-3.
        assert!((length_restored(1e-3, 1.0) - 1.0 / (1.0_f64 - 1e-6).sqrt()).abs() < 1e-12);
    }
}
