//! What passes a gate, compared: numbers, discharge, speeds, sizes.

use super::curves::{Curves, discharge_curves, distribution_curves};
use super::margin::Kind;
use super::matching::{Quantity, records};
use super::{GateRecord, RunRecord};
use crate::analysis::mass_flow_rate::mass_flow_rate_of_crossings;
use crate::analysis::statistics::{mean, standard_deviation};
use std::collections::BTreeSet;

/// Shares of the mass whose passing is timed [%].
const SHARES: [u32; 3] = [10, 50, 90];

/// Names of all gates.
pub(super) fn names(sides: [&[RunRecord]; 2]) -> Vec<String> {
    let all = sides.into_iter().flatten().flat_map(|run| &run.gates);
    all.map(|record| record.gate.clone()).collect::<BTreeSet<_>>().into_iter().collect()
}

/// The numbers of a gate, in a fixed order, with a note for every side whose flow is not steady enough for a rate.
pub(super) fn quantities(gate: &str, sides: [&[RunRecord]; 2], notes: &mut Vec<String>) -> Vec<Quantity> {
    let records = records(gate, sides);
    let figures = [0, 1].map(|side| {
        let of_run = |record: &Option<&GateRecord>| record.map(figures);
        records[side].iter().map(of_run).collect::<Vec<_>>()
    });
    for side in 0..2 {
        let reasons: BTreeSet<&str> = figures[side]
            .iter()
            .flatten()
            .filter_map(|figures| figures.rate.as_ref().err().map(String::as_str))
            .collect();
        let side_name = super::SIDES[side];
        notes.extend(
            reasons.iter().map(|reason| format!("gate {gate}: no mass flow rate in some of {side_name}: {reason}")),
        );
    }
    let quantity = |name: String, unit: &str, kind: Kind, get: &dyn Fn(&Figures) -> Option<f64>| Quantity {
        name: format!("gate.{gate}.{name}"),
        unit: unit.to_owned(),
        kind,
        sources: [0, 1].map(|_| format!("gate.{gate}.{name}")),
        values: [0, 1].map(|side| figures[side].iter().map(|f| get(f.as_ref()?)).collect()),
        note: None,
    };
    let mut found = vec![
        quantity("crossings".into(), "", Kind::Count, &|f| Some(f.crossings)),
        quantity("mass".into(), "kg", Kind::Mass, &|f| Some(f.mass)),
        quantity("mass_flow_rate".into(), "kg/s", Kind::MassFlowRate, &|f| f.rate.as_ref().ok().copied()),
    ];
    for (k, share) in SHARES.into_iter().enumerate() {
        found.push(quantity(format!("time_of_{share}_percent"), "s", Kind::Time, &move |f| f.times[k]));
    }
    found.push(quantity("normal_speed_mean".into(), "m/s", Kind::Other, &|f| f.speed_mean));
    found.push(quantity("normal_speed_deviation".into(), "m/s", Kind::Other, &|f| f.speed_deviation));
    found
}

/// The curves of all gates.
pub(super) fn curves(gates: &[String], sides: [&[RunRecord]; 2]) -> Vec<Curves> {
    let mut all = Vec::new();
    for gate in gates {
        let records = records(gate, sides).map(|side| side.into_iter().flatten().collect::<Vec<_>>());
        let name = |what: &str| format!("gate.{gate}.{what}");
        all.push(discharge_curves(
            &name("discharge"),
            [0, 1].map(|side| records[side].iter().map(|r| passages(r)).collect()),
        ));
        let samples =
            |get: fn(&GateRecord) -> &[f64]| [0, 1].map(|side| records[side].iter().map(|r| get(r).to_vec()).collect());
        all.push(distribution_curves(&name("normal_speeds"), "normal speed", "m/s", samples(|r| &r.normal_speeds)));
        all.push(distribution_curves(&name("sizes"), "diameter", "m", samples(|r| &r.diameters)));
    }
    all
}

/// Time [s] and mass [kg] of every passage, in order of time.
fn passages(record: &GateRecord) -> Vec<(f64, f64)> {
    let mut passages: Vec<(f64, f64)> = record.times.iter().copied().zip(record.masses.iter().copied()).collect();
    passages.sort_by(|a, b| a.0.total_cmp(&b.0));
    passages
}

struct Figures {
    crossings: f64,
    mass: f64,
    rate: Result<f64, String>,
    times: [Option<f64>; 3],
    speed_mean: Option<f64>,
    speed_deviation: Option<f64>,
}

fn figures(record: &GateRecord) -> Figures {
    let passages = passages(record);
    let mass: f64 = passages.iter().map(|(_, mass)| mass).sum();
    Figures {
        crossings: passages.len() as f64,
        mass,
        rate: mass_flow_rate_of_crossings(&passages).map(|flow| flow.rate).map_err(|reason| reason.0),
        times: SHARES.map(|share| time_of_share(&passages, f64::from(share) / 100.0 * mass)),
        speed_mean: mean(&record.normal_speeds),
        speed_deviation: standard_deviation(&record.normal_speeds),
    }
}

/// The time at which `wanted` mass [kg] has passed.
fn time_of_share(passages: &[(f64, f64)], wanted: f64) -> Option<f64> {
    let mut passed = 0.0;
    passages.iter().find_map(|(time, mass)| {
        passed += mass;
        // The sum of all masses, in this order, is reached by its last one also after rounding.
        (passed >= wanted * (1.0 - 1e-12)).then_some(*time)
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use approx::assert_relative_eq;

    #[test]
    fn figures_of_a_steady_stream() {
        // 1000 particles of 2 g, one every 5 ms, stored backwards.
        let times: Vec<f64> = (1..=1000).rev().map(|k| 0.005 * f64::from(k)).collect();
        let speeds: Vec<f64> = (0..1000).map(|k| if k % 2 == 0 { 0.5 } else { 1.5 }).collect();
        let record = GateRecord {
            gate: "outlet".into(),
            masses: vec![2e-3; 1000],
            diameters: vec![1e-2; 1000],
            normal_speeds: speeds,
            times,
        };
        let found = figures(&record);
        assert_eq!(found.crossings, 1000.0);
        assert_relative_eq!(found.mass, 2.0, max_relative = 1e-12);
        // Counted in 128 intervals of about 8 crossings, so a slope is off by less than one crossing in 600.
        assert_relative_eq!(found.rate.unwrap(), 0.4, max_relative = 1.0 / 600.0);
        assert_relative_eq!(found.times[1].unwrap(), 2.5, max_relative = 1e-12);
        assert_relative_eq!(found.times[2].unwrap(), 4.5, max_relative = 1e-12);
        assert_relative_eq!(found.speed_mean.unwrap(), 1.0, max_relative = 1e-12);
        assert_relative_eq!(found.speed_deviation.unwrap(), (0.25_f64 * 1000.0 / 999.0).sqrt(), max_relative = 1e-12);
    }

    #[test]
    fn an_empty_gate_has_a_count_and_nothing_else() {
        let found = figures(&GateRecord::default());
        assert_eq!((found.crossings, found.mass, found.times, found.speed_mean), (0.0, 0.0, [None; 3], None));
        assert!(found.rate.is_err());
    }
}
