//! What follows from a scene before anything is computed: which models act, which time step, what it costs, and which
//! backends can. A plan changes nothing; every decision carries its reason.

pub mod choose;
pub mod cost;
pub mod gates;
pub mod impact;
pub mod pairs;
pub mod physics;
pub mod stages;
mod text;
pub mod timestep;

use crate::scene::Scene;
use crate::scene::gate::StreamSource;
use choose::BackendVerdict;
use cost::CostForecast;
use impact::{ImpactSpeed, OverlapForecast};
use physics::ModelDecision;
use serde::Serialize;
use std::path::PathBuf;
use timestep::{SkinChoice, TimestepChoice};

/// What follows from a scene.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Plan {
    /// The scene's name.
    pub scene: String,
    /// The stage's name; `None` for a scene as a whole.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub stage: Option<String>,
    /// Each model, on or off, with the reason.
    pub models: Vec<ModelDecision>,
    /// The speed at which particles are expected to hit something.
    pub impact: ImpactSpeed,
    /// Every limit of the time step, the one that binds, and the step chosen.
    pub timestep: TimestepChoice,
    /// The neighbour skin.
    pub skin: SkinChoice,
    /// The deepest overlap expected; `None` where no two bodies can touch.
    pub overlap: Option<OverlapForecast>,
    /// Particles, steps, memory, wall time.
    pub cost: CostForecast,
    /// Which backends can.
    pub backends: Vec<BackendVerdict>,
    /// What should be known before the run starts.
    pub findings: Vec<PlanFinding>,
}

/// Something to know before the run starts.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct PlanFinding {
    /// Whether the run is refused for it, unless forced.
    pub severity: Severity,
    /// Name of the finding.
    pub name: &'static str,
    /// What is wrong and what to do.
    pub text: String,
}

/// How bad a finding is.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Severity {
    /// The run goes on.
    Warning,
    /// The run is refused unless it is forced.
    Refusal,
}

/// Speed of a backend on this computer, measured before the run.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Calibration {
    /// Particle steps in a second of wall time in a settled bed [1/s].
    pub particle_steps_per_second_dense: f64,
    /// Particle steps in a second of wall time among particles that rarely touch [1/s].
    pub particle_steps_per_second_dilute: f64,
    /// Memory that one particle takes, its share of the neighbour lists included [B].
    pub bytes_per_particle: f64,
    /// Memory of the program with the scene read and no particle [B]; 0 where the system does not tell.
    pub base_bytes: f64,
    /// Number of threads it was measured with.
    pub threads: usize,
}

/// What a stage takes from the scene that it is part of.
#[derive(Debug, Clone, Copy, Default)]
struct Terms<'a> {
    /// Time step of the whole scene [s].
    timestep: Option<f64>,
    /// How often the particles of each feed come in; once where it is not given.
    passages: Option<&'a [f64]>,
    /// Speed of the backend.
    calibration: Option<Calibration>,
}

/// What follows from `scene` as a whole, its gates only observed; wall time and memory only with a `calibration`.
#[must_use]
pub fn plan(scene: &Scene, calibration: Option<Calibration>) -> Plan {
    let terms = Terms { calibration, ..Terms::default() };
    let mut replays = scene.stages.iter().flat_map(|stage| &stage.replays);
    let mut plan = if replays.any(|replay| matches!(replay.source, StreamSource::Folder(_))) {
        // Nothing is known about the particles of a stored stream but that they belong to the classes, as of a checkpoint.
        let start_checkpoint = scene.start_checkpoint.clone().or_else(|| Some(PathBuf::new()));
        plan_on(&Scene { start_checkpoint, ..scene.clone() }, scene, &terms)
    } else {
        plan_on(scene, scene, &terms)
    };
    plan.findings.extend(gates::advise(scene).into_iter().flat_map(|advice| advice.findings));
    plan
}

/// What follows from `asked`, where particles come as the feeds of `scene` say.
fn plan_on(scene: &Scene, asked: &Scene, terms: &Terms<'_>) -> Plan {
    let mut findings = Vec::new();
    let models = physics::decide(scene, &mut findings);
    let impact = impact::expected_speed(scene);
    let contacts = pairs::possible_contacts(scene, impact.speed);
    let timestep = timestep::choose(scene, &impact, &contacts, terms.timestep, &mut findings);
    let overlap = impact::forecast_overlap(scene, &contacts, &mut findings);
    let supply = cost::supply(scene, terms.passages);
    let skin = timestep::choose_skin(scene, &impact, &supply, timestep.chosen);
    let cost = cost::forecast(scene, &supply, timestep.chosen, terms.calibration);
    let backends = vec![choose::verdict(asked, &choose::Capabilities::native())];
    Plan { scene: scene.name.clone(), stage: None, models, impact, timestep, skin, overlap, cost, backends, findings }
}

impl Plan {
    /// Whether the run must not start unless it is forced.
    #[must_use]
    pub fn is_refused(&self) -> bool {
        self.findings.iter().any(|finding| finding.severity == Severity::Refusal)
    }

    /// Whether a model acts; `false` for a name that is none.
    #[must_use]
    pub fn is_on(&self, model: &str) -> bool {
        self.models.iter().any(|decision| decision.name == model && decision.on)
    }
}

fn warning(name: &'static str, text: String) -> PlanFinding {
    PlanFinding { severity: Severity::Warning, name, text }
}

fn refusal(name: &'static str, text: String) -> PlanFinding {
    PlanFinding { severity: Severity::Refusal, name, text }
}

#[cfg(test)]
mod tests;
