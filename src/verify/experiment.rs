//! What a case asks of a backend, and what it gets back.

use crate::dem::law::{Compatibility, LawSettings, NormalLaw, RollingLaw, TangentialLaw};
use crate::geometry::motion::Motion;
use crate::geometry::part::{Part, Surface, Trigger};
use crate::material::{Elasticity, Material, MaterialTable, PairContact, PairProperties};
use crate::math::{Bounds, Vec3, vec3};
use crate::particle::{Body, ParticleId, ParticleState};

/// A backend as the suite sees it.
pub trait Experiment {
    /// Where the backend's formulas are known to be others than the suite's.
    fn departures(&self) -> &'static [Departure] {
        &[]
    }

    /// Runs `setup` from time 0 and returns the state at step 0, `sample_every`, 2 `sample_every`, ... up to `steps`.
    ///
    /// # Errors
    /// What the backend cannot do at all, or why a run failed.
    fn run(&mut self, setup: &CaseSetup) -> Result<Vec<Sample>, NotRun>;
}

/// Why an experiment gave no samples, in the user's words.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum NotRun {
    /// The backend has no such law, body or account.
    NotPossible(String),
    /// It has, but the run failed or its result cannot be used.
    Failed(String),
}

impl From<String> for NotRun {
    fn from(reason: String) -> Self {
        Self::Failed(reason)
    }
}

impl From<&str> for NotRun {
    fn from(reason: &str) -> Self {
        Self::Failed(reason.to_owned())
    }
}

/// A known difference of formulas: it explains why a check is out of tolerance, within a bound.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Departure {
    /// Case it shows in.
    pub case: &'static str,
    /// Part of the quantities' text; empty for all of the case.
    pub quantity: &'static str,
    /// Largest difference that it explains, as a share of the reference where `is_relative`, else in the check's unit.
    pub bound: f64,
    /// Whether the bound is a share of the reference.
    pub is_relative: bool,
    /// Name of the convention, as in docs/theory/conventions.md.
    pub convention: &'static str,
}

/// A small scene, complete: what is not here does not act.
#[derive(Debug, Clone)]
pub struct CaseSetup {
    /// Sphere in space, or disc in the plane y = 0.
    pub body: Body,
    /// Gravity [m/s2].
    pub gravity: Vec3,
    /// Domain; particles never leave it in these cases.
    pub bounds: Bounds,
    /// Materials and pairs.
    pub materials: MaterialTable,
    /// Contact laws.
    pub law: LawSettings,
    /// Particles at time 0.
    pub particles: Vec<ParticleState>,
    /// Parts.
    pub parts: Vec<Part>,
    /// Time step [s].
    pub timestep: f64,
    /// Steps to run.
    pub steps: u64,
    /// Steps from one sample to the next.
    pub sample_every: u64,
    /// Largest overlap as a share of the smaller radius [-] that still counts as a sane run.
    pub overlap_limit: f64,
    /// Whether the samples carry the energy budget.
    pub energy: bool,
}

/// The state at one time.
#[derive(Debug, Clone)]
pub struct Sample {
    /// Time [s].
    pub time: f64,
    /// Particles, ascending id; velocities belong to the same time as positions.
    pub particles: Vec<ParticleState>,
    /// Energy budget, where asked for and known to the backend.
    pub energy: Option<EnergySample>,
}

/// Energy budget [J]: contents now, and what was dissipated or fed in since time 0.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct EnergySample {
    /// Kinetic energy of the centres and of spin.
    pub kinetic: f64,
    /// In gravity.
    pub gravitational: f64,
    /// In contact springs.
    pub elastic: f64,
    /// Lost by sliding.
    pub slip: f64,
    /// Lost in normal and tangential dashpots.
    pub dashpot: f64,
    /// Lost by rolling resistance.
    pub rolling: f64,
    /// Fed in by moving walls.
    pub wall_work: f64,
    /// Made (> 0) or taken (< 0) by a law that is not conservative.
    pub law_residual: f64,
}

impl EnergySample {
    /// Dissipated so far [J].
    #[must_use]
    pub fn dissipated(&self) -> f64 {
        self.slip + self.dashpot + self.rolling
    }

    /// Contents plus losses minus input [J]: constant in time, the residual of the law left out.
    #[must_use]
    pub fn sum_without_residual(&self) -> f64 {
        self.kinetic + self.gravitational + self.elastic + self.dissipated() - self.wall_work
    }

    /// Contents plus losses minus input [J]: constant in time.
    #[must_use]
    pub fn sum(&self) -> f64 {
        self.sum_without_residual() - self.law_residual
    }
}

impl CaseSetup {
    /// An empty scene without gravity around the origin: one material, spheres, one step.
    #[must_use]
    pub fn new(materials: MaterialTable, law: LawSettings, extent: f64) -> Self {
        Self {
            body: Body::Sphere,
            gravity: Vec3::zeros(),
            bounds: Bounds { minimum: [-extent; 3], maximum: [extent; 3] },
            materials,
            law,
            particles: Vec::new(),
            parts: Vec::new(),
            timestep: 0.0,
            steps: 1,
            sample_every: 1,
            overlap_limit: 0.5,
            energy: false,
        }
    }

    /// Adds a particle of material 0; its density is that of the material.
    pub fn add_sphere(&mut self, radius: f64, position: Vec3, velocity: Vec3, spin: Vec3) {
        let id = ParticleId::new(0, self.particles.len() as u64);
        let density = self.materials.materials[0].density.unwrap_or_default();
        self.particles.push(ParticleState { id, material: 0, radius, density, position, velocity, spin });
    }

    /// Adds the half space z < 0 as a solid of material `material`.
    pub fn add_floor(&mut self, material: u16) {
        self.parts.push(Part {
            name: "floor".into(),
            material,
            surface: Surface::Plane { point: Vec3::zeros(), normal: vec3(0.0, 0.0, 1.0) },
            motion: Motion::default(),
            appears: Trigger::Always,
            disappears: Trigger::Never,
        });
    }

    /// Runs for `duration` [s] at `timestep` [s], sampled about `samples` times.
    pub fn run_for(&mut self, duration: f64, timestep: f64, samples: u64) {
        self.timestep = timestep;
        let steps = (duration / timestep).ceil() as u64;
        self.sample_every = (steps / samples).max(1);
        self.steps = steps.div_ceil(self.sample_every) * self.sample_every;
    }
}

/// One elastic material against itself, and the same against a rigid wall (material 1).
#[must_use]
pub(super) fn one_material(
    density: f64,
    youngs_modulus: f64,
    poissons_ratio: f64,
    contact: PairContact,
    friction: f64,
) -> MaterialTable {
    with_rolling(density, youngs_modulus, poissons_ratio, contact, [friction, 0.0])
}

/// As [`one_material`], `friction` = sliding and rolling.
#[must_use]
pub(super) fn with_rolling(
    density: f64,
    youngs_modulus: f64,
    poissons_ratio: f64,
    contact: PairContact,
    friction: [f64; 2],
) -> MaterialTable {
    let elasticity = Elasticity::Isotropic { youngs_modulus, poissons_ratio };
    let mut table = MaterialTable::new(vec![
        Material { name: "grain".into(), density: Some(density), elasticity: Some(elasticity) },
        Material { name: "rigid".into(), density: None, elasticity: Some(Elasticity::Rigid) },
    ]);
    let pair = PairProperties { contact, sliding_friction: friction[0], rolling_friction: friction[1] };
    table.set_pair(0, 0, pair);
    table.set_pair(0, 1, pair);
    table
}

/// Hertz-Mindlin with the `total` tangential spring, no tangential dashpot, attraction allowed, no rolling resistance.
pub(super) const HERTZ: LawSettings = LawSettings {
    normal: NormalLaw::HertzMindlin,
    tangential: TangentialLaw::Total,
    tangential_damping: false,
    attraction: true,
    rolling: RollingLaw::None,
    characteristic_velocity: 1.0,
    compatibility: Compatibility::Tollgate,
};

/// As [`HERTZ`] with the linear normal law.
pub(super) const LINEAR: LawSettings = LawSettings { normal: NormalLaw::Linear, ..HERTZ };

/// Dissipation by a coefficient of restitution.
pub(super) const fn restitution(coefficient: f64) -> PairContact {
    PairContact::Restitution { coefficient }
}
