//! Constants of each pair of materials, prepared once for the contact laws.

use super::{LawSettings, NormalLaw};
use crate::dem::timescale::damping_ratio;
use crate::material::{MaterialTable, PairContact, PairProperties};
use crate::math::lanes::{Lanes, MOST_LANES, Mask};

/// Constants of one pair of materials.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PairConstants<L: Lanes = f64> {
    /// Effective Young's modulus E* [Pa], 1/E* = (1 - nu_i^2)/E_i + (1 - nu_j^2)/E_j; 0 where the stiffness is given directly.
    pub effective_youngs_modulus: L,
    /// Effective shear modulus G* [Pa], 1/G* = (2 - nu_i)/G_i + (2 - nu_j)/G_j; 0 where the stiffness is given directly.
    pub effective_shear_modulus: L,
    /// Damping factor beta = -ln e / sqrt(pi^2 + ln^2 e) [-], the share of critical damping.
    pub damping_factor: L,
    /// Root of Mindlin's ratio of tangential to normal tangent stiffness, sqrt(4 G* / E*) [-].
    pub root_of_stiffness_ratio: L,
    /// Linear constants given directly, and where: the others follow from E, nu and e. `None` where they do everywhere.
    pub given: Option<(GivenStiffness<L>, L::Mask)>,
    /// Sliding friction mu [-].
    pub sliding_friction: L,
    /// Rolling friction mu_r [-].
    pub rolling_friction: L,
}

/// Linear constants given directly.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct GivenStiffness<L: Lanes = f64> {
    /// K_n [N/m].
    pub normal_stiffness: L,
    /// K_t [N/m].
    pub tangential_stiffness: L,
    /// eta_n [kg/s].
    pub normal_damping: L,
    /// eta_t [kg/s].
    pub tangential_damping: L,
}

impl<L: Lanes> GivenStiffness<L> {
    /// These in the lanes of the mask, else the others.
    #[inline(always)]
    pub(super) fn or(&self, here: L::Mask, others: &Self) -> Self {
        let pick = |this, other| L::select(here, this, other);
        Self {
            normal_stiffness: pick(self.normal_stiffness, others.normal_stiffness),
            tangential_stiffness: pick(self.tangential_stiffness, others.tangential_stiffness),
            normal_damping: pick(self.normal_damping, others.normal_damping),
            tangential_damping: pick(self.tangential_damping, others.tangential_damping),
        }
    }

    /// The constants that `of` gives for each lane.
    #[inline(always)]
    fn by_lane(of: impl Fn(usize) -> GivenStiffness) -> Self {
        Self {
            normal_stiffness: lane_by_lane(|lane| of(lane).normal_stiffness),
            tangential_stiffness: lane_by_lane(|lane| of(lane).tangential_stiffness),
            normal_damping: lane_by_lane(|lane| of(lane).normal_damping),
            tangential_damping: lane_by_lane(|lane| of(lane).tangential_damping),
        }
    }
}

#[inline(always)]
fn lane_by_lane<L: Lanes>(of: impl Fn(usize) -> f64) -> L {
    let mut list = [0.0; MOST_LANES];
    (0..L::COUNT).for_each(|lane| list[lane] = of(lane));
    L::from_slice(&list)
}

impl<L: Lanes> PairConstants<L> {
    /// The same pair in every lane.
    #[inline(always)]
    #[must_use]
    pub fn everywhere(pair: &PairConstants) -> Self {
        Self::by_lane(|_| pair)
    }

    /// The pair that `of` gives for each lane.
    #[inline(always)]
    #[must_use]
    fn by_lane<'a>(of: impl Fn(usize) -> &'a PairConstants) -> Self {
        let given = (0..L::COUNT).fold(0_u16, |bits, lane| bits | u16::from(of(lane).given.is_some()) << lane);
        let stiffness = |lane: usize| of(lane).given.map_or(GivenStiffness::NONE, |(stiffness, _)| stiffness);
        Self {
            effective_youngs_modulus: lane_by_lane(|lane| of(lane).effective_youngs_modulus),
            effective_shear_modulus: lane_by_lane(|lane| of(lane).effective_shear_modulus),
            damping_factor: lane_by_lane(|lane| of(lane).damping_factor),
            root_of_stiffness_ratio: lane_by_lane(|lane| of(lane).root_of_stiffness_ratio),
            given: (given != 0).then(|| (GivenStiffness::by_lane(stiffness), L::Mask::from_bits(given))),
            sliding_friction: lane_by_lane(|lane| of(lane).sliding_friction),
            rolling_friction: lane_by_lane(|lane| of(lane).rolling_friction),
        }
    }
}

impl<L: Lanes> PairConstants<L> {
    /// From the columns of rows, one row a lane.
    #[inline(always)]
    fn from_columns([youngs, shear, damping, root, sliding, rolling, ..]: [L; 8]) -> Self {
        Self {
            effective_youngs_modulus: youngs,
            effective_shear_modulus: shear,
            damping_factor: damping,
            root_of_stiffness_ratio: root,
            given: None,
            sliding_friction: sliding,
            rolling_friction: rolling,
        }
    }
}

impl GivenStiffness {
    const NONE: Self =
        Self { normal_stiffness: 0.0, tangential_stiffness: 0.0, normal_damping: 0.0, tangential_damping: 0.0 };
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

    /// The constants in a row, unless the stiffness is given directly. See [`PairConstants::from_columns`].
    fn row(&self) -> Option<[f64; 8]> {
        self.given.is_none().then_some([
            self.effective_youngs_modulus,
            self.effective_shear_modulus,
            self.damping_factor,
            self.root_of_stiffness_ratio,
            self.sliding_friction,
            self.rolling_friction,
            0.0,
            0.0,
        ])
    }

    fn from_properties(properties: &PairProperties, youngs: f64, shear: f64) -> Self {
        let common = Self {
            effective_youngs_modulus: 0.0,
            effective_shear_modulus: 0.0,
            damping_factor: 0.0,
            root_of_stiffness_ratio: 0.0,
            given: None,
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
                let given =
                    GivenStiffness { normal_stiffness, tangential_stiffness, normal_damping, tangential_damping };
                Self { given: Some((given, true)), ..common }
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
    /// The same as rows, as lanes gather them; none where a pair has its stiffness given.
    rows: Vec<[f64; 8]>,
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
                given: None,
                sliding_friction: f64::NAN,
                rolling_friction: f64::NAN,
            };
            // Not-a-number makes the watchdog stop a contact that the scene knows nothing about.
            PairConstants::of(table, a as u16, b as u16).unwrap_or(absent)
        };
        let constants: Vec<PairConstants> = (0..materials * materials).map(pair).collect();
        let rows: Option<Vec<[f64; 8]>> = constants.iter().map(PairConstants::row).collect();
        Self { settings, constants, rows: rows.unwrap_or_default(), materials }
    }

    /// The constants between the materials that `of` gives for each lane.
    ///
    /// # Panics
    /// Where there is no such material.
    #[inline(always)]
    #[must_use]
    pub fn pairs<L: Lanes>(&self, of: impl Fn(usize) -> [u32; 2]) -> PairConstants<L> {
        let mut index = [0_u32; MOST_LANES];
        for (lane, pair) in index[..L::COUNT].iter_mut().enumerate() {
            let [a, b] = of(lane);
            *pair = a * self.materials as u32 + b;
        }
        let index = &index[..L::COUNT];
        if self.rows.is_empty() {
            return PairConstants::by_lane(|lane| &self.constants[index[lane] as usize]);
        }
        assert!(index.iter().all(|&pair| (pair as usize) < self.rows.len()), "materials that there are");
        // SAFETY: as just looked at.
        PairConstants::from_columns(unsafe { L::gather_eight(self.rows.as_ptr(), index) })
    }

    /// The constants between materials `a` and `b`.
    #[inline(always)]
    #[must_use]
    pub fn pair(&self, a: u32, b: u32) -> &PairConstants {
        &self.constants[a as usize * self.materials + b as usize]
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
