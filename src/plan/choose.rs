//! Requirements of a scene against the capabilities of a backend.

use super::Plan;
use crate::dem::feed::{FeedKind, Region};
use crate::dem::law::{NormalLaw, RollingLaw, TangentialLaw};
use crate::geometry::motion::MotionKind;
use crate::geometry::part::{Surface, Trigger};
use crate::material::{PairContact, PairProperties};
use crate::particle::{Body, SizeDistribution};
use crate::scene::Scene;
use crate::scene::backend::BackendName;
use crate::scene::gate::PathMode;
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
    /// Replays whose ghosts yield on their recorded paths.
    CompliantGhosts,
    /// Sleep of resting particles.
    Sleeping,
}

impl Requirement {
    /// Every requirement there is.
    pub const ALL: [Self; 24] = [
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
        Self::CompliantGhosts,
        Self::Sleeping,
    ];

    /// What a scene asks for with it, and what may be done where a backend does not have it.
    #[must_use]
    pub const fn words(self) -> &'static str {
        match self {
            Self::LinearLaw => "the linear law; use contact.law = \"hertz-mindlin\"",
            Self::HertzMindlinLaw => "the Hertz-Mindlin law; use contact.law = \"linear\"",
            Self::DirectStiffness => "stiffnesses in N/m; give Young's modulus and restitution",
            Self::MixedStiffness => {
                "stiffnesses in N/m for some pairs and from Young's modulus for others; give all in one way"
            }
            Self::IncrementalTangentialLaw => {
                "a tangential force accumulated step by step; use contact.tangential = \"total\""
            }
            Self::Attraction => {
                "normal forces that may attract at the end of a contact; use contact.attraction = false"
            }
            Self::CdtRolling => "rolling resistance by a constant directional torque; use another contact.rolling",
            Self::Epsd2Rolling => "rolling resistance by an elastic-plastic spring; use another contact.rolling",
            Self::PlaneProblem => "discs in a plane; use spheres in a thin slice between two frictionless walls",
            Self::PeriodicBorders => "periodic borders; use open ones and walls",
            Self::Meshes => "triangle meshes; use planes, cylinders and cones",
            Self::Frustums => "exact cylinders and cones; use STL files",
            Self::MovingParts => "parts that move; let them stand still",
            Self::Conveyors => "surfaces that move in themselves; let the part move",
            Self::TimedParts => "parts that appear or disappear at a time; let them stay",
            Self::RestTriggeredParts => "parts that wait for rest; give a time",
            Self::MeshFills => "a feed that fills the inside of a mesh; fill a box or cylinder",
            Self::Streams => "feeds that bring a stream; fill a region at the start",
            Self::InitialStates => "particles from an initial state; fill a region instead",
            Self::ContinuousSizes => "normal or lognormal sizes; give a list of diameters",
            Self::Checkpoints => {
                "a start from a checkpoint, whose contacts only the native solver knows; start from an initial state (a feed of kind \
                 \"file\")"
            }
            Self::EnergyBudget => "the energy budget; set output.energy = false",
            Self::CompliantGhosts => "ghosts that yield (path = \"compliant\"); use path = \"recorded\"",
            Self::Sleeping => "particles that sleep; remove solver.sleeping",
        }
    }
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
        Self { backend: BackendName::Native.text().to_owned(), can: Requirement::ALL.to_vec() }
    }

    /// LIGGGHTS, by what decks are rendered for, installed or not: all but what its laws, its spheres and its accounts lack.
    #[must_use]
    pub fn liggghts() -> Self {
        // An energy budget is left out with a warning: it is something to be written, and changes no result.
        const LACKS: [Requirement; 6] = [
            Requirement::MixedStiffness,
            Requirement::IncrementalTangentialLaw,
            Requirement::PlaneProblem,
            Requirement::Checkpoints,
            Requirement::CompliantGhosts,
            Requirement::Sleeping,
        ];
        let can = Requirement::ALL.into_iter().filter(|need| !LACKS.contains(need)).collect();
        Self { backend: BackendName::Liggghts.text().to_owned(), can }
    }
}

/// Whether a backend can run a scene.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct BackendVerdict {
    /// The backend's name.
    pub backend: String,
    /// What it lacks.
    pub missing: Vec<Requirement>,
    /// Why it cannot, and what to do: a sentence for each thing it lacks, and for each value it does not take; empty where it can.
    pub reasons: Vec<String>,
}

impl BackendVerdict {
    /// Whether it can.
    #[must_use]
    pub const fn can(&self) -> bool {
        self.missing.is_empty() && self.reasons.is_empty()
    }
}

/// Whether a backend with `capabilities` can run `scene`, and if not, what is missing.
#[must_use]
pub fn verdict(scene: &Scene, capabilities: &Capabilities) -> BackendVerdict {
    let missing: Vec<Requirement> =
        requirements(scene).into_iter().filter(|need| !capabilities.can.contains(need)).collect();
    let reasons = missing.iter().map(|need| need.words().to_owned()).collect();
    BackendVerdict { backend: capabilities.backend.clone(), missing, reasons }
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
    need(scene.solver.sleeping.is_some(), Requirement::Sleeping);
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
    let mut replays = scene.stages.iter().flat_map(|stage| &stage.replays);
    need(replays.any(|replay| replay.path == PathMode::Compliant), Requirement::CompliantGhosts);
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
