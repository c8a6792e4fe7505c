//! Constants of each pair of materials, prepared once for the contact laws.

use super::{LawSettings, NormalLaw};
use crate::dem::timescale::damping_ratio;
use crate::material::{MaterialTable, PairContact, PairProperties};

/// Constants of one pair of materials.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PairConstants {
    /// Effective Young's modulus E* [Pa], 1/E* = (1 - nu_i^2)/E_i + (1 - nu_j^2)/E_j; 0 where the stiffness is given directly.
    pub effective_youngs_modulus: f64,
    /// Effective shear modulus G* [Pa], 1/G* = (2 - nu_i)/G_i + (2 - nu_j)/G_j; 0 where the stiffness is given directly.
    pub effective_shear_modulus: f64,
    /// Damping factor beta = -ln e / sqrt(pi^2 + ln^2 e) [-], the share of critical damping.
    pub damping_factor: f64,
    /// Root of Mindlin's ratio of tangential to normal tangent stiffness, sqrt(4 G* / E*) [-].
    pub root_of_stiffness_ratio: f64,
    /// Constants given directly; `None` where they follow from E, nu and e.
    pub direct: Option<DirectStiffness>,
    /// Sliding friction mu [-].
    pub sliding_friction: f64,
    /// Rolling friction mu_r [-].
    pub rolling_friction: f64,
}

/// Linear constants given directly.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct DirectStiffness {
    /// K_n [N/m].
    pub normal_stiffness: f64,
    /// K_t [N/m].
    pub tangential_stiffness: f64,
    /// eta_n [kg/s].
    pub normal_damping: f64,
    /// eta_t [kg/s].
    pub tangential_damping: f64,
}

impl PairConstants {
    /// The constants between materials `a` and `b`, where the scene gives them.
    #[must_use]
    pub fn of(table: &MaterialTable, a: u16, b: u16) -> Option<Self> {
        let properties = table.pair(a, b)?;
        let elasticity = |m: u16| table.materials[usize::from(m)].elasticity;
        let effective = |compliance: f64| if compliance > 0.0 { 1.0 / compliance } else { 0.0 };
        let (youngs, shear) = match (elasticity(a), elasticity(b)) {
            (Some(a), Some(b)) => (
                effective(a.normal_compliance() + b.normal_compliance()),
                effective(a.tangential_compliance() + b.tangential_compliance()),
            ),
            _ => (0.0, 0.0),
        };
        Some(Self::from_properties(properties, youngs, shear))
    }

    fn from_properties(properties: &PairProperties, youngs: f64, shear: f64) -> Self {
        let common = Self {
            effective_youngs_modulus: 0.0,
            effective_shear_modulus: 0.0,
            damping_factor: 0.0,
            root_of_stiffness_ratio: 0.0,
            direct: None,
            sliding_friction: properties.sliding_friction,
            rolling_friction: properties.rolling_friction,
        };
        match properties.contact {
            PairContact::Restitution { coefficient } => Self {
                effective_youngs_modulus: youngs,
                effective_shear_modulus: shear,
                damping_factor: damping_ratio(coefficient),
                root_of_stiffness_ratio: (4.0 * shear / youngs).sqrt(),
                ..common
            },
            PairContact::Stiffness { normal_stiffness, tangential_stiffness, normal_damping, tangential_damping } => {
                let direct =
                    DirectStiffness { normal_stiffness, tangential_stiffness, normal_damping, tangential_damping };
                Self { direct: Some(direct), ..common }
            }
        }
    }
}

/// The law's settings and the constants of all pairs, as the contact kernel reads them.
#[derive(Debug, Clone)]
pub struct LawTable {
    /// The scene's settings.
    pub settings: LawSettings,
    constants: Vec<PairConstants>,
    materials: usize,
}

impl LawTable {
    /// Prepares every pair that the scene gives; a pair it does not give must not come into contact (checked at the scene).
    #[must_use]
    pub fn new(settings: LawSettings, table: &MaterialTable) -> Self {
        let materials = table.materials.len();
        let pair = |index: usize| {
            let (a, b) = (index / materials, index % materials);
            let absent = PairConstants {
                effective_youngs_modulus: f64::NAN,
                effective_shear_modulus: f64::NAN,
                damping_factor: f64::NAN,
                root_of_stiffness_ratio: f64::NAN,
                direct: None,
                sliding_friction: f64::NAN,
                rolling_friction: f64::NAN,
            };
            // Not-a-number makes the watchdog stop a contact that the scene knows nothing about.
            PairConstants::of(table, a as u16, b as u16).unwrap_or(absent)
        };
        Self { settings, constants: (0..materials * materials).map(pair).collect(), materials }
    }

    /// The constants between materials `a` and `b`.
    #[inline(always)]
    #[must_use]
    pub fn pair(&self, a: u32, b: u32) -> &PairConstants {
        &self.constants[a as usize * self.materials + b as usize]
    }

    /// The constants of the only pair, where the scene has one material: no look-up is needed then.
    #[must_use]
    pub fn single_pair(&self) -> Option<PairConstants> {
        if let [only] = self.constants.as_slice() { Some(*only) } else { None }
    }

    /// True where some pair has sliding friction.
    #[must_use]
    pub fn has_sliding_friction(&self) -> bool {
        self.constants.iter().any(|pair| pair.sliding_friction > 0.0)
    }

    /// True where some pair has rolling friction.
    #[must_use]
    pub fn has_rolling_friction(&self) -> bool {
        self.constants.iter().any(|pair| pair.rolling_friction > 0.0)
    }

    /// True for the linear law.
    #[must_use]
    pub fn is_linear(&self) -> bool {
        self.settings.normal == NormalLaw::Linear
    }
}
