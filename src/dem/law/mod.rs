//! Contact laws, one a file, and the settings that choose among them.

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
