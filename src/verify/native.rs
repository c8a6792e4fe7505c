//! The native solver as an [`Experiment`].

use super::{CaseSetup, EnergySample, Experiment, NotRun, Sample};
use crate::dem::simulation::{Setup, Simulation};
use crate::math::lanes::SimdLevel;

/// Runs cases on the native solver, one thread.
#[derive(Debug, Clone, Copy, Default)]
pub struct Native;

impl Experiment for Native {
    fn run(&mut self, setup: &CaseSetup) -> Result<Vec<Sample>, NotRun> {
        let largest = setup.particles.iter().map(|p| p.radius).fold(0.0, f64::max);
        let mut simulation = Simulation::new(Setup {
            body: setup.body,
            gravity: setup.gravity,
            domain: setup.bounds,
            periodic: [false; 3],
            materials: setup.materials.clone(),
            law: setup.law,
            classes: Vec::new(),
            feeds: Vec::new(),
            parts: setup.parts.clone(),
            seed: 1,
            timestep: setup.timestep,
            skin: 0.2 * largest,
            overlap_limit: setup.overlap_limit,
            energy: setup.energy,
            momentum: false,
            sleeping: None,
            threads: 1,
            simd: SimdLevel::best(),
        });
        simulation.insert(&setup.particles);
        let mut samples = vec![sample(&simulation, setup)];
        for step in 1..=setup.steps {
            simulation.step().map_err(|stop| stop.to_string())?;
            if step % setup.sample_every == 0 {
                samples.push(sample(&simulation, setup));
            }
        }
        Ok(samples)
    }
}

fn sample(simulation: &Simulation, setup: &CaseSetup) -> Sample {
    let energy = setup.energy.then(|| {
        let budget = simulation.energy();
        EnergySample {
            kinetic: budget.kinetic + budget.rotational,
            gravitational: budget.gravitational,
            elastic: budget.elastic,
            slip: budget.slip,
            dashpot: budget.dashpot,
            rolling: budget.rolling,
            wall_work: budget.wall_work,
            law_residual: budget.law_residual,
        }
    });
    Sample { time: simulation.time(), particles: simulation.particles(), energy }
}
