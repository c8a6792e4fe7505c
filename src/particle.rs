//! What a particle is before anybody moves it: its identity, its class, the distribution of its size.

use crate::math::Vec3;
use serde::{Deserialize, Serialize};

/// A particle's identity: the feed that made it and its serial number there. Never reused within a run.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
pub struct ParticleId(pub u64);

impl ParticleId {
    const SERIAL_BITS: u32 = 40;

    /// Identity number `serial` of feed number `feed`.
    ///
    /// # Panics
    /// When `serial` does not fit 40 bits or `feed` does not fit 24 bits.
    #[must_use]
    pub fn new(feed: u32, serial: u64) -> Self {
        assert!(serial >> Self::SERIAL_BITS == 0, "a feed holds at most 2^40 particles");
        assert!(u64::from(feed) >> (64 - Self::SERIAL_BITS) == 0, "a scene holds at most 2^24 feeds");
        Self(u64::from(feed) << Self::SERIAL_BITS | serial)
    }

    /// The feed's number in the scene.
    #[must_use]
    pub const fn feed(self) -> u32 {
        (self.0 >> Self::SERIAL_BITS) as u32
    }

    /// The serial number within the feed, from 0.
    #[must_use]
    pub const fn serial(self) -> u64 {
        self.0 & ((1 << Self::SERIAL_BITS) - 1)
    }
}

/// One particle as a feed, a frame or an observer sees it.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct ParticleState {
    /// Identity.
    pub id: ParticleId,
    /// Index into the scene's materials.
    pub material: u16,
    /// Radius [m].
    pub radius: f64,
    /// Particle density [kg/m3].
    pub density: f64,
    /// Centre [m].
    pub position: Vec3,
    /// Velocity of the centre [m/s].
    pub velocity: Vec3,
    /// Own rotation [rad/s].
    pub spin: Vec3,
}

/// Mass and inertia of the particle body that a scene's dimensions imply.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub enum Body {
    /// Spheres in space: m = 4/3 pi r^3 rho, I = 2/5 m r^2.
    Sphere,
    /// Plane problem (motion in x and z, spin about y): discs of `thickness` [m], m = pi r^2 t rho, I = 1/2 m r^2.
    Disc {
        /// Thickness t of the slice [m].
        thickness: f64,
    },
}

impl Body {
    /// Mass [kg] of a particle of `radius` [m] and `density` [kg/m3].
    #[must_use]
    pub fn mass(&self, radius: f64, density: f64) -> f64 {
        match self {
            Self::Sphere => 4.0 / 3.0 * std::f64::consts::PI * radius.powi(3) * density,
            Self::Disc { thickness } => std::f64::consts::PI * radius * radius * thickness * density,
        }
    }

    /// The part of a velocity or force [any unit] that this body can follow: discs stay in the plane y = 0.
    #[must_use]
    pub const fn in_plane(&self, vector: &Vec3) -> Vec3 {
        match self {
            Self::Sphere => *vector,
            Self::Disc { .. } => {
                let [[x, _, z]] = vector.data.0;
                Vec3::new(x, 0.0, z)
            }
        }
    }

    /// The part of a spin or torque [any unit] that this body can follow: discs turn about y.
    #[must_use]
    pub const fn about_plane(&self, vector: &Vec3) -> Vec3 {
        match self {
            Self::Sphere => *vector,
            Self::Disc { .. } => {
                let [[_, y, _]] = vector.data.0;
                Vec3::new(0.0, y, 0.0)
            }
        }
    }

    /// Factor c of the moment of inertia I = c m r^2 [-].
    #[must_use]
    pub const fn inertia_factor(&self) -> f64 {
        match self {
            Self::Sphere => 0.4,
            Self::Disc { .. } => 0.5,
        }
    }
}

/// A particle class of the scene.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct ParticleClass {
    /// Name in the scene.
    pub name: String,
    /// Index into the scene's materials.
    pub material: u16,
    /// Distribution of the diameter.
    pub diameter: SizeDistribution,
}

/// Distribution of a particle diameter [m].
#[derive(Debug, Clone, PartialEq, Serialize)]
pub enum SizeDistribution {
    /// One size.
    Fixed {
        /// Diameter [m].
        diameter: f64,
    },
    /// Uniform in diameter, by number.
    Uniform {
        /// Smallest diameter [m].
        minimum: f64,
        /// Largest diameter [m].
        maximum: f64,
    },
    /// Normal in diameter, by number, cut at both ends (drawn again outside of them).
    Normal {
        /// Mean diameter before the cut [m].
        mean: f64,
        /// Standard deviation before the cut [m].
        deviation: f64,
        /// Smallest diameter [m].
        minimum: f64,
        /// Largest diameter [m].
        maximum: f64,
    },
    /// ln(diameter) is normal, by number, cut at both ends (drawn again outside of them).
    Lognormal {
        /// Median diameter before the cut [m].
        median: f64,
        /// Geometric standard deviation before the cut [-], > 1.
        geometric_deviation: f64,
        /// Smallest diameter [m].
        minimum: f64,
        /// Largest diameter [m].
        maximum: f64,
    },
    /// Sieve classes: `fractions[k]` lies between `sieves[k]` and `sieves[k + 1]`, uniform in diameter within a class.
    Sieve {
        /// Whether the fractions count mass or particles.
        by: GradingBy,
        /// Ascending sieve sizes [m], one more than the fractions.
        sieves: Vec<f64>,
        /// Fractions [-], sum 1.
        fractions: Vec<f64>,
    },
}

/// What the fractions of a grading count.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum GradingBy {
    /// Fractions of the mass.
    Mass,
    /// Fractions of the number of particles.
    Number,
}
