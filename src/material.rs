//! Materials, and what holds between two of them.

use serde::{Deserialize, Serialize};

/// A material of the scene.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Material {
    /// Name in the scene.
    pub name: String,
    /// Particle density rho [kg/m3]; not needed for a wall.
    pub density: Option<f64>,
    /// Elastic constants; absent where every pair of this material gives its stiffness directly.
    pub elasticity: Option<Elasticity>,
}

/// Elastic constants of an isotropic solid.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub enum Elasticity {
    /// Young's modulus E [Pa] and Poisson's ratio nu [-].
    Isotropic {
        /// Young's modulus E [Pa].
        youngs_modulus: f64,
        /// Poisson's ratio nu [-].
        poissons_ratio: f64,
    },
    /// Does not deform: 1/E = 1/G = 0. For walls.
    Rigid,
}

impl Elasticity {
    /// Normal compliance (1 - nu^2) / E [1/Pa].
    #[must_use]
    pub fn normal_compliance(&self) -> f64 {
        match *self {
            Self::Isotropic { youngs_modulus, poissons_ratio } => (1.0 - poissons_ratio.powi(2)) / youngs_modulus,
            Self::Rigid => 0.0,
        }
    }

    /// Tangential compliance (2 - nu) / G = 2 (2 - nu) (1 + nu) / E [1/Pa].
    #[must_use]
    pub fn tangential_compliance(&self) -> f64 {
        match *self {
            Self::Isotropic { youngs_modulus, poissons_ratio } => {
                2.0 * (2.0 - poissons_ratio) * (1.0 + poissons_ratio) / youngs_modulus
            }
            Self::Rigid => 0.0,
        }
    }
}

/// What holds between two materials (symmetric).
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct PairProperties {
    /// How the contact is elastic and dissipates.
    pub contact: PairContact,
    /// Sliding friction mu [-].
    pub sliding_friction: f64,
    /// Rolling friction mu_r [-].
    pub rolling_friction: f64,
}

/// Stiffness and dissipation of a pair: from the materials, or given directly; never both.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub enum PairContact {
    /// Stiffness from both materials' elastic constants, dissipation from the coefficient of restitution.
    Restitution {
        /// Coefficient of restitution e_n [-], 0 < e_n <= 1.
        coefficient: f64,
    },
    /// Constants given directly; linear law only.
    Stiffness {
        /// Normal stiffness K_n [N/m].
        normal_stiffness: f64,
        /// Tangential stiffness K_t [N/m].
        tangential_stiffness: f64,
        /// Normal damping eta_n [kg/s].
        normal_damping: f64,
        /// Tangential damping eta_t [kg/s].
        tangential_damping: f64,
    },
}

/// All materials of a scene and the properties of their pairs.
#[derive(Debug, Clone, PartialEq, Default, Serialize)]
pub struct MaterialTable {
    /// The materials; an index into this list is a material's number everywhere.
    pub materials: Vec<Material>,
    /// Row-major square table; `None` where the scene says nothing about a pair.
    pairs: Vec<Option<PairProperties>>,
}

impl MaterialTable {
    /// A table with no pair set yet.
    #[must_use]
    pub fn new(materials: Vec<Material>) -> Self {
        let count = materials.len();
        Self { materials, pairs: vec![None; count * count] }
    }

    /// Sets a pair, in both orders.
    pub fn set_pair(&mut self, a: u16, b: u16, properties: PairProperties) {
        let count = self.materials.len();
        self.pairs[usize::from(a) * count + usize::from(b)] = Some(properties);
        self.pairs[usize::from(b) * count + usize::from(a)] = Some(properties);
    }

    /// Sets sliding friction to zero for every pair.
    pub fn remove_sliding_friction(&mut self) {
        self.pairs.iter_mut().flatten().for_each(|pair| pair.sliding_friction = 0.0);
    }

    /// The table without the materials that are not `kept`, and without their pairs; numbers stay. `kept` has one entry a material.
    #[must_use]
    pub fn of_those(&self, kept: &[bool]) -> Self {
        let is_kept = |index: usize| kept.get(index).is_none_or(|kept| *kept);
        let count = self.materials.len();
        let mut table = self.clone();
        for (index, material) in table.materials.iter_mut().enumerate().filter(|(index, _)| !is_kept(*index)) {
            *material = Material { name: index.to_string(), density: None, elasticity: None };
        }
        for (place, pair) in table.pairs.iter_mut().enumerate() {
            *pair = pair.filter(|_| is_kept(place / count) && is_kept(place % count));
        }
        table
    }

    /// The properties between `a` and `b`, where the scene gives them.
    #[must_use]
    pub fn pair(&self, a: u16, b: u16) -> Option<&PairProperties> {
        self.pairs[usize::from(a) * self.materials.len() + usize::from(b)].as_ref()
    }
}
