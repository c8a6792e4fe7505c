//! Contact laws, one a file, and the settings that choose among them.

pub mod constants;
pub mod hertz_mindlin;
pub mod linear;
pub mod rolling;
pub mod tangential;

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

/// Approach of two bodies in contact, along the normal.
#[derive(Debug, Clone, Copy)]
pub struct NormalMotion {
    /// Overlap delta_n [m], > 0.
    pub overlap: f64,
    /// Rate of the overlap [m/s], > 0 while they approach.
    pub closing_speed: f64,
    /// R* [m].
    pub effective_radius: f64,
    /// m* [kg].
    pub effective_mass: f64,
}

/// Answer of a normal law.
#[derive(Debug, Clone, Copy)]
pub struct NormalForce {
    /// Elastic part of the repulsion [N].
    pub elastic: f64,
    /// Repulsion [N].
    pub total: f64,
    /// k_t [N/m].
    pub tangential_stiffness: f64,
    /// gamma_t [kg/s].
    pub tangential_damping: f64,
    /// Elastic energy of the normal spring [J].
    pub elastic_energy: f64,
    /// d(ln k_t)/dt [1/s].
    pub stiffness_growth: f64,
    /// d(ln k_t)/d(delta_n) [1/m].
    pub growth_by_overlap: f64,
}

impl LawSettings {
    /// The scene's normal law, with the no-attraction cut-off where it is on.
    #[inline(always)]
    #[must_use]
    pub fn normal_force(&self, pair: &PairConstants, motion: &NormalMotion) -> NormalForce {
        let mut force = match self.normal {
            NormalLaw::Linear => linear::normal_force(self, pair, motion),
            NormalLaw::HertzMindlin => hertz_mindlin::normal_force(pair, motion),
        };
        if !self.attraction {
            force.total = force.total.max(0.0);
        }
        force
    }
}
