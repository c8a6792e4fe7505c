//! From a scene and its plan to the solver's setup.

use super::processor::Processor;
use crate::dem::law::RollingLaw;
use crate::dem::simulation::Setup;
use crate::dem::sleep::SleepSettings;
use crate::plan::Plan;
use crate::scene::Scene;

/// The solver's setup for a scene: the plan's time step, skin and models.
#[must_use]
pub fn setup(scene: &Scene, plan: &Plan, processor: Processor) -> Setup {
    let mut law = scene.law;
    let mut materials = scene.materials.clone();
    if !plan.is_on("rolling_resistance") {
        law.rolling = RollingLaw::None;
    }
    law.tangential_damping = plan.is_on("tangential_damping");
    if !plan.is_on("sliding_friction") {
        materials.remove_sliding_friction();
    }
    Setup {
        body: scene.body,
        gravity: scene.gravity,
        domain: scene.domain.bounds,
        periodic: scene.domain.periodic,
        materials,
        law,
        classes: scene.classes.clone(),
        feeds: scene.feeds.clone(),
        parts: scene.parts.clone(),
        seed: scene.seed,
        timestep: plan.timestep.chosen,
        skin: plan.skin.skin,
        overlap_limit: scene.solver.overlap_limit,
        energy: plan.is_on("energy_budget"),
        momentum: false,
        sleeping: scene.solver.sleeping.map(|sleeping| SleepSettings {
            speed: sleeping.speed,
            hold: sleeping.hold,
            acceleration: sleeping.unbalanced * scene.gravity.norm(),
        }),
        threads: processor.threads,
        simd: processor.simd,
    }
}
