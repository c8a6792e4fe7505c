//! Energy balance of two-particle impacts, law by law.

use super::experiment::{HERTZ, LINEAR, with_rolling};
use super::{Case, CaseSetup, Check, EnergySample, Experiment, NotRun, Tolerance};
use crate::dem::law::{LawSettings, NormalLaw, RollingLaw, TangentialLaw};
use crate::material::PairContact;
use crate::math::vec3;

pub(super) const CASES: &[Case] = &[Case {
    name: "energy-of-impacts",
    title: "every law: energy before = energy after + slip + dashpots + rolling resistance + residual of the law",
    source: "conservation of energy",
    run: impacts,
}];

fn impacts(experiment: &mut dyn Experiment) -> Result<Vec<Check>, NotRun> {
    let mut checks = Vec::new();
    for (normal, base) in [("linear", LINEAR), ("Hertz", HERTZ)] {
        for (tangential, law) in [("total", TangentialLaw::Total), ("incremental", TangentialLaw::Incremental)] {
            for (rolling, resistance) in
                [("no rolling", RollingLaw::None), ("CDT", RollingLaw::Cdt), ("EPSD2", RollingLaw::Epsd2)]
            {
                for attraction in [true, false] {
                    let law = LawSettings {
                        tangential: law,
                        rolling: resistance,
                        attraction,
                        tangential_damping: attraction,
                        ..base
                    };
                    let cut = if attraction { ", tangential dashpot" } else { ", cut-off" };
                    checks.extend(balance(experiment, &format!("{normal}, {tangential}, {rolling}{cut}"), law)?);
                }
            }
        }
    }
    Ok(checks)
}

/// Two unlike spheres meet obliquely and with spin, and part.
fn balance(experiment: &mut dyn Experiment, name: &str, law: LawSettings) -> Result<Vec<Check>, NotRun> {
    let table = with_rolling(2500.0, 1e8, 0.3, PairContact::Restitution { coefficient: 0.7 }, [0.05, 0.05]);
    let mut setup = CaseSetup::new(table, law, 1.0);
    setup.energy = true;
    let (small, big) = (0.004, 0.006);
    setup.add_sphere(small, vec3(-0.0089, 0.0, 0.005), vec3(1.0, 0.3, 0.0), vec3(30.0, -60.0, 20.0));
    setup.add_sphere(big, vec3(0.0, 0.0, 0.0), vec3(-0.5, 0.0, 0.05), vec3(0.0, 20.0, -10.0));
    // about 1000 steps a contact of 1e-4 s, and 5 contacts long
    setup.run_for(8e-4, 1e-7, 1);
    let samples = experiment.run(&setup)?;
    let (Some(first), Some(last)) = (samples.first(), samples.last()) else {
        return Err("no state came back".into());
    };
    let (Some(before), Some(after)) = (first.energy, last.energy) else {
        return Err("the backend does not account for energy".into());
    };
    let lost = after.dissipated();
    // what the trajectory itself says, without the backend's account
    let kinetic = |sample: &super::Sample| {
        let of = |p: &crate::particle::ParticleState| {
            let mass = setup.body.mass(p.radius, p.density);
            0.5 * mass * p.velocity.norm_squared() + 0.2 * mass * p.radius.powi(2) * p.spin.norm_squared()
        };
        sample.particles.iter().map(of).sum::<f64>()
    };
    let row = |quantity: &str, reference, measured, tolerance: f64, reason| Check {
        quantity: format!("{name}: {quantity}"),
        reference,
        measured,
        tolerance: Tolerance::Absolute(tolerance * lost.abs()),
        reason,
        unit: "J",
        source: "energy before the impact",
    };
    let closes = "1e-3 of the dissipation: 1000 steps per contact, power sampled at both ends of a step";
    let mut checks = vec![
        row("kinetic energy as accounted", kinetic(last), after.kinetic, 1e-9, "round-off"),
        row("sum of all columns", before.sum(), after.sum(), 1e-3, closes),
        Check {
            tolerance: Tolerance::AtMost,
            ..row("dissipated", kinetic(first), lost, 0.0, "not more than there was")
        },
    ];
    if law.normal == NormalLaw::Linear && law.rolling != RollingLaw::Epsd2 {
        let sum = EnergySample::sum_without_residual;
        checks.push(row("sum without the residual", sum(&before), sum(&after), 1e-3, closes));
    }
    let idle = [after.slip, after.dashpot].iter().any(|&part| part < 0.05 * lost) && !law.tangential_damping;
    if lost <= 0.01 * kinetic(first) || idle {
        return Err(format!("{name}: the impact leaves a column of the budget next to empty: {after:?}").into());
    }
    Ok(checks)
}
