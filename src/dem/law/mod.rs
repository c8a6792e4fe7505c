//! Contact laws, one a file, and the settings that choose among them.

pub mod constants;
pub mod hertz_mindlin;
pub mod linear;
pub mod rolling;
pub mod tangential;

use crate::math::lanes::Lanes;
use constants::PairConstants;
use serde::Serialize;

/// The contact laws of a scene.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct LawSettings {
    /// Normal law.
    pub normal: NormalLaw,
    /// How the tangential spring is kept.
    pub tangential: TangentialLaw,
    /// Whether the tangential dashpot acts.
    pub tangential_damping: bool,
    /// Whether the normal force may attract at the end of a contact (dashpot over spring); the no-attraction cut-off sets it to zero.
    pub attraction: bool,
    /// Rolling resistance.
    pub rolling: RollingLaw,
    /// Characteristic collision velocity v_c [m/s] of the linear stiffness that follows from E and nu.
    pub characteristic_velocity: f64,
    /// Reproduce another code's conventions instead of ours.
    pub compatibility: Compatibility,
}

/// Normal contact laws.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum NormalLaw {
    /// Linear spring-dashpot.
    Linear,
    /// Hertz, with Mindlin's tangential stiffness and Tsuji's damping.
    HertzMindlin,
}

/// Tangential spring.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum TangentialLaw {
    /// F_t = k_t(delta) xi: the present stiffness times the whole displacement (LIGGGHTS `history`).
    Total,
    /// F_t += k_t(delta) dxi: the force is accumulated.
    Incremental,
}

/// Rolling resistance.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum RollingLaw {
    /// None.
    None,
    /// Constant directional torque.
    Cdt,
    /// Elastic-plastic spring torque without dashpot.
    Epsd2,
}

/// Whose conventions hold.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Compatibility {
    /// Ours: velocities at full steps in the tangential law, exact lever arms, cap on spring and dashpot together.
    Tollgate,
    /// LIGGGHTS: half-step velocities, lever arm r - delta/2 also at walls, cap on the spring alone.
    Liggghts,
}

/// Two bodies in contact, along the normal.
#[derive(Debug, Clone, Copy)]
pub struct NormalContact<L = f64> {
    /// Overlap delta_n [m], > 0.
    pub overlap: L,
    /// R* [m].
    pub effective_radius: L,
    /// m* [kg].
    pub effective_mass: L,
}

/// What a normal law makes of an overlap, whatever the speed.
#[derive(Debug, Clone, Copy)]
pub struct ContactStiffness<L = f64> {
    /// Elastic repulsion [N].
    pub elastic: L,
    /// gamma_n [kg/s].
    pub normal_damping: L,
    /// k_t [N/m].
    pub tangential_stiffness: L,
    /// gamma_t [kg/s].
    pub tangential_damping: L,
    /// Elastic energy of the normal spring [J].
    pub elastic_energy: L,
    /// d(ln k_t)/d(delta_n) [1/m].
    pub growth_by_overlap: L,
}

impl<L: Lanes> ContactStiffness<L> {
    /// None.
    #[inline(always)]
    pub fn zero() -> Self {
        let zero = L::zero();
        Self {
            elastic: zero,
            normal_damping: zero,
            tangential_stiffness: zero,
            tangential_damping: zero,
            elastic_energy: zero,
            growth_by_overlap: zero,
        }
    }
}

impl LawSettings {
    /// The scene's normal law at an overlap.
    #[inline(always)]
    #[must_use]
    pub fn stiffness<L: Lanes>(&self, pair: &PairConstants<L>, contact: &NormalContact<L>) -> ContactStiffness<L> {
        match self.normal {
            NormalLaw::Linear => linear::stiffness(self, pair, contact),
            NormalLaw::HertzMindlin => hertz_mindlin::stiffness(pair, contact),
        }
    }

    /// Repulsion [N] at a closing speed [m/s], > 0 while the bodies approach: F_n = F_elastic + gamma_n v_n, with the
    /// no-attraction cut-off where it is on.
    #[inline(always)]
    #[must_use]
    pub fn repulsion<L: Lanes>(&self, stiffness: &ContactStiffness<L>, closing_speed: L) -> L {
        let total = stiffness.normal_damping.mul_add(closing_speed, stiffness.elastic);
        if self.attraction { total } else { total.larger(L::zero()) }
    }
}
