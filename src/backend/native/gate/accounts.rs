//! The accounts of a stage's particles.

use crate::dem::simulation::Simulation;
use crate::gate::ledger::{EnergyAccount, MomentumAccount};

/// Where the momentum of the free particles came from; `None` where it was not accounted for.
pub fn momentum(simulation: &Simulation) -> Option<MomentumAccount> {
    simulation.setup().momentum.then(|| {
        let budget = simulation.momentum_budget();
        let mut entries: Vec<(&str, [f64; 3])> = vec![
            ("gravity", budget.gravity.into()),
            ("parts", budget.walls.into()),
            ("ghosts", budget.ghosts.into()),
            ("tethers", budget.tethers.into()),
            ("hand_over", budget.hand_over.into()),
            ("came", budget.inserted.into()),
            ("went", (-budget.removed).into()),
        ];
        entries.extend(simulation.setup().sleeping.map(|_| ("sleep", budget.sleep.into())));
        MomentumAccount::new([0.0; 3], budget.momentum.into(), entries)
    })
}

/// Where the energy of the free particles came from; `None` where losses were not accounted for.
pub fn energy(simulation: &Simulation) -> Option<EnergyAccount> {
    simulation.setup().energy.then(|| {
        let budget = simulation.energy();
        let mut entries = vec![
            ("slip", -budget.slip),
            ("dashpot", -budget.dashpot),
            ("rolling", -budget.rolling),
            ("parts", budget.wall_work),
            ("ghosts", budget.prescribed_work),
            ("tethers", budget.tether_work),
            ("law", budget.law_residual),
            ("came", budget.inserted),
            ("went", -budget.removed),
        ];
        entries.extend(simulation.setup().sleeping.map(|_| ("sleep", -budget.sleep)));
        EnergyAccount::new(0.0, budget.mechanical(), entries)
    })
}
