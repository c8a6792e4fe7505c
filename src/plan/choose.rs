//! Requirements of a scene against the capabilities of a backend.

use super::Plan;
use crate::dem::feed::{FeedKind, Region};
use crate::dem::law::{NormalLaw, RollingLaw, TangentialLaw};
use crate::geometry::motion::MotionKind;
use crate::geometry::part::{Surface, Trigger};
use crate::material::{PairContact, PairProperties};
use crate::particle::{Body, SizeDistribution};
use crate::scene::Scene;
use serde::Serialize;

/// Something a scene requires that a backend may not have.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Requirement {
    /// Linear spring-dashpot law.
    LinearLaw,
    /// Hertz-Mindlin law.
    HertzMindlinLaw,
    /// Stiffnesses given directly for some pairs.
    DirectStiffness,
    /// Stiffnesses given directly for some pairs and from elastic constants for others.
    MixedStiffness,
    /// Tangential force accumulated step by step.
    IncrementalTangentialLaw,
    /// Normal forces that attract at the end of a contact.
    Attraction,
    /// Constant directional torque.
    CdtRolling,
    /// Elastic-plastic spring torque.
    Epsd2Rolling,
    /// Discs in a plane.
    PlaneProblem,
    /// Periodic borders.
    PeriodicBorders,
    /// Triangle meshes.
    Meshes,
    /// Cylinders and cones as exact surfaces.
    Frustums,
    /// Parts that move from their place.
    MovingParts,
    /// Surfaces that move in themselves.
    Conveyors,
    /// Parts that appear or disappear at a time.
    TimedParts,
    /// Parts that appear or disappear once particles are at rest.
    RestTriggeredParts,
    /// Feeds that fill the inside of a mesh.
    MeshFills,
    /// Streams.
    Streams,
    /// Particles from an initial-state file.
    InitialStates,
    /// Normal or lognormal sizes.
    ContinuousSizes,
    /// A start from a checkpoint.
    Checkpoints,
    /// An energy budget.
    EnergyBudget,
}

impl Requirement {
    /// Every requirement there is.
    pub const ALL: [Self; 22] = [
        Self::LinearLaw,
        Self::HertzMindlinLaw,
        Self::DirectStiffness,
        Self::MixedStiffness,
        Self::IncrementalTangentialLaw,
        Self::Attraction,
        Self::CdtRolling,
        Self::Epsd2Rolling,
        Self::PlaneProblem,
        Self::PeriodicBorders,
        Self::Meshes,
        Self::Frustums,
        Self::MovingParts,
        Self::Conveyors,
        Self::TimedParts,
        Self::RestTriggeredParts,
        Self::MeshFills,
        Self::Streams,
        Self::InitialStates,
        Self::ContinuousSizes,
        Self::Checkpoints,
        Self::EnergyBudget,
    ];
}

/// What a backend can do.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Capabilities {
    /// The backend's name.
    pub backend: String,
    /// All that it can.
    pub can: Vec<Requirement>,
}

impl Capabilities {
    /// The native solver: all a scene can ask for.
    #[must_use]
    pub fn native() -> Self {
        Self { backend: "native".to_owned(), can: Requirement::ALL.to_vec() }
    }
}

/// Whether a backend can run a scene.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct BackendVerdict {
    /// The backend's name.
    pub backend: String,
    /// What it lacks; empty where it can.
    pub missing: Vec<Requirement>,
}

impl BackendVerdict {
    /// Whether it can.
    #[must_use]
    pub const fn can(&self) -> bool {
        self.missing.is_empty()
    }
}

/// Whether a backend with `capabilities` can run `scene`, and if not, what is missing.
#[must_use]
pub fn verdict(scene: &Scene, capabilities: &Capabilities) -> BackendVerdict {
    let missing = requirements(scene).into_iter().filter(|need| !capabilities.can.contains(need)).collect();
    BackendVerdict { backend: capabilities.backend.clone(), missing }
}

impl Plan {
    /// Adds the verdict on another backend.
    pub fn add_backend(&mut self, scene: &Scene, capabilities: &Capabilities) {
        self.backends.push(verdict(scene, capabilities));
    }
}

/// All that a scene requires, each once.
#[must_use]
pub fn requirements(scene: &Scene) -> Vec<Requirement> {
    let mut needs = law_requirements(scene);
    let mut need = |holds: bool, requirement: Requirement| {
        if holds {
            needs.push(requirement);
        }
    };
    need(matches!(scene.body, Body::Disc { .. }), Requirement::PlaneProblem);
    need(scene.domain.periodic.contains(&true), Requirement::PeriodicBorders);
    need(scene.start_checkpoint.is_some(), Requirement::Checkpoints);
    need(scene.output.energy, Requirement::EnergyBudget);
    for part in &scene.parts {
        need(matches!(part.surface, Surface::Mesh(_)), Requirement::Meshes);
        need(matches!(part.surface, Surface::Frustum { .. }), Requirement::Frustums);
        need(!part.motion.is_static(), Requirement::MovingParts);
        let belt = part.motion.terms.iter().any(|term| matches!(term.kind, MotionKind::Conveyor { .. }));
        need(belt, Requirement::Conveyors);
        for trigger in [part.appears, part.disappears] {
            need(matches!(trigger, Trigger::At { .. }), Requirement::TimedParts);
            need(matches!(trigger, Trigger::AtRest(_)), Requirement::RestTriggeredParts);
        }
    }
    for feed in &scene.feeds {
        need(matches!(feed.kind, FeedKind::Fill { region: Region::Inside(_), .. }), Requirement::MeshFills);
        need(matches!(feed.kind, FeedKind::Stream { .. }), Requirement::Streams);
        need(matches!(feed.kind, FeedKind::File { .. }), Requirement::InitialStates);
    }
    let continuous =
        |size: &SizeDistribution| matches!(size, SizeDistribution::Normal { .. } | SizeDistribution::Lognormal { .. });
    need(scene.classes.iter().any(|class| continuous(&class.diameter)), Requirement::ContinuousSizes);
    needs.sort_unstable();
    needs.dedup();
    needs
}

fn law_requirements(scene: &Scene) -> Vec<Requirement> {
    let mut needs = vec![match scene.law.normal {
        NormalLaw::Linear => Requirement::LinearLaw,
        NormalLaw::HertzMindlin => Requirement::HertzMindlinLaw,
    }];
    match scene.law.rolling {
        RollingLaw::None => {}
        RollingLaw::Cdt => needs.push(Requirement::CdtRolling),
        RollingLaw::Epsd2 => needs.push(Requirement::Epsd2Rolling),
    }
    if scene.law.tangential == TangentialLaw::Incremental {
        needs.push(Requirement::IncrementalTangentialLaw);
    }
    if scene.law.attraction {
        needs.push(Requirement::Attraction);
    }
    let count = u16::try_from(scene.materials.materials.len()).unwrap_or(u16::MAX);
    let pairs = (0..count).flat_map(|a| (a..count).map(move |b| (a, b)));
    let (direct, derived): (Vec<&PairProperties>, Vec<&PairProperties>) = pairs
        .filter_map(|(a, b)| scene.materials.pair(a, b))
        .partition(|pair| matches!(pair.contact, PairContact::Stiffness { .. }));
    if !direct.is_empty() {
        needs.push(Requirement::DirectStiffness);
        if !derived.is_empty() {
            needs.push(Requirement::MixedStiffness);
        }
    }
    needs
}
