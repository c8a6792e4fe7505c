//! Planted errors are found, equal sets are not called different, intervals hold what they say.

use super::*;
use crate::analysis::statistics::two_samples::CONFIDENCE;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

/// Relative scatter of a mass flow rate, and scatter of an angle [deg], from run to run.
const RATE_SCATTER: f64 = 0.015;
const ANGLE_SCATTER: f64 = 0.7;
const DRAWS: u32 = 1000;

/// Normal numbers (Box and Muller 1958).
fn normal(random: &mut ChaCha8Rng) -> f64 {
    let radius = (-2.0 * (1.0 - random.random::<f64>()).ln()).sqrt();
    radius * (std::f64::consts::TAU * random.random::<f64>()).cos()
}

/// A set of runs with a rate about 2 kg/s and an angle about 30 deg.
fn set(random: &mut ChaCha8Rng, runs: usize, rate_error: f64, angle_error: f64) -> Vec<RunRecord> {
    (0..runs)
        .map(|number| {
            let rate = 2.0 * (1.0 + rate_error) * (1.0 + RATE_SCATTER * normal(random));
            let angle = 30.0 + angle_error + ANGLE_SCATTER * normal(random);
            let measures = [("outflow_kg_per_s", rate), ("heap_angle_deg", angle)];
            RunRecord {
                name: format!("run {number}"),
                measures: measures.into_iter().map(|(name, value)| (name.to_owned(), Some(value))).collect(),
                ..RunRecord::default()
            }
        })
        .collect()
}

fn measure<'a>(comparison: &'a Comparison, name: &str) -> &'a MeasureComparison {
    comparison.measures.iter().find(|measure| measure.name == name).unwrap()
}

/// Share of draws in which `true` is found.
fn share(mut found: impl FnMut(&mut ChaCha8Rng) -> bool) -> f64 {
    let mut random = ChaCha8Rng::seed_from_u64(11);
    f64::from((0..DRAWS).filter(|_| found(&mut random)).count() as u32) / f64::from(DRAWS)
}

#[test]
fn planted_errors_are_caught() {
    for (rate_error, angle_error, name) in
        [(0.08, 0.0, "outflow"), (-0.08, 0.0, "outflow"), (0.0, 4.0, "heap_angle"), (0.0, -4.0, "heap_angle")]
    {
        let caught = share(|random| {
            let (runs, reference) = (set(random, 10, rate_error, angle_error), set(random, 10, 0.0, 0.0));
            let comparison = compare(&runs, &reference, &[]).unwrap();
            comparison.verdict == Verdict::Differs && measure(&comparison, name).verdict == Verdict::Differs
        });
        assert!(caught >= 0.99, "{name}: {caught}");
    }
}

#[test]
fn equal_sets_agree_and_are_never_called_different() {
    let mut different = 0;
    let agrees = share(|random| {
        let (runs, reference) = (set(random, 10, 0.0, 0.0), set(random, 10, 0.0, 0.0));
        let verdict = compare(&runs, &reference, &[]).unwrap().verdict;
        different += u32::from(verdict == Verdict::Differs);
        verdict == Verdict::Agrees
    });
    // To differ, an interval of +-1.4 % must clear 4 %: eight standard errors from the truth.
    assert_eq!(different, 0);
    // +-2 deg: half of the interval is 0.66 deg, so a difference of 1.34 deg is allowed, 4 standard errors.
    assert!(agrees > 0.99, "{agrees}");
}

#[test]
fn without_a_margin_equal_sets_differ_as_often_as_the_interval_errs() {
    let none = [("outflow".to_owned(), "0 %".to_owned()), ("heap_angle".to_owned(), "0 deg".to_owned())];
    let different = share(|random| {
        let (runs, reference) = (set(random, 10, 0.0, 0.0), set(random, 10, 0.0, 0.0));
        measure(&compare(&runs, &reference, &none).unwrap(), "heap_angle").verdict == Verdict::Differs
    });
    let expected = 1.0 - CONFIDENCE;
    // Three binomial deviations.
    assert!((different - expected).abs() < 3.0 * (expected * CONFIDENCE / f64::from(DRAWS)).sqrt(), "{different}");
}

#[test]
fn intervals_hold_the_true_difference_in_95_of_100_cases() {
    // Where one side has few runs, Welch's interval holds what two hundred thousand draws gave: too little, or more than asked.
    for (runs, reference, expected) in [
        (10, 10, CONFIDENCE),
        (5, 10, CONFIDENCE),
        (1, 6, CONFIDENCE),
        (6, 1, CONFIDENCE),
        (3, 12, 0.933),
        (2, 2, 0.977),
    ] {
        let held = share(|random| {
            let (runs, reference) = (set(random, runs, 0.0, 1.0), set(random, reference, 0.0, 0.0));
            let [low, high] = measure(&compare(&runs, &reference, &[]).unwrap(), "heap_angle").interval_95.unwrap();
            low <= 1.0 && 1.0 <= high
        });
        // Three binomial deviations.
        let tolerance = 3.0 * (expected * (1.0 - expected) / f64::from(DRAWS)).sqrt();
        assert!((held - expected).abs() < tolerance, "{runs} + {reference}: {held}");
    }
}

#[test]
fn few_runs_beside_many_are_warned_of() {
    let mut random = ChaCha8Rng::seed_from_u64(7);
    let mut note = |runs: usize, reference: usize| {
        let sides = (set(&mut random, runs, 0.0, 0.0), set(&mut random, reference, 0.0, 0.0));
        measure(&compare(&sides.0, &sides.1, &[]).unwrap(), "heap_angle").note.clone()
    };
    assert!(note(3, 12).contains("somewhat too narrow") && note(10, 2).contains("somewhat too narrow"));
    assert!(note(3, 3).is_empty() && note(5, 20).is_empty());
}

/// A run whose gate passes `count` particles at 2 kg/s, faster by `speed_error`.
fn gate_run(random: &mut ChaCha8Rng, speed_error: f64, rate_error: f64) -> RunRecord {
    let count = 2000;
    let (rate, shift) = (2.0 * (1.0 + rate_error) * (1.0 + RATE_SCATTER * normal(random)), 0.02 * normal(random));
    let mut record = GateRecord { gate: "outlet".into(), ..GateRecord::default() };
    for k in 0..count {
        record.times.push(0.5 + f64::from(k) * 1e-3 / rate);
        record.masses.push(1e-3);
        record.normal_speeds.push(1.0 + speed_error + 0.2 * (normal(random) + shift));
        record.diameters.push(10e-3 + 2e-3 * random.random::<f64>());
    }
    RunRecord { name: "run".into(), gates: vec![record], ..RunRecord::default() }
}

fn gate_set(random: &mut ChaCha8Rng, speed_error: f64, rate_error: f64) -> Vec<RunRecord> {
    (0..10).map(|_| gate_run(random, speed_error, rate_error)).collect()
}

#[test]
fn what_passes_a_gate_is_compared_in_numbers_and_curves() {
    let mut random = ChaCha8Rng::seed_from_u64(3);
    let reference = gate_set(&mut random, 0.0, 0.0);
    let equal = compare(&gate_set(&mut random, 0.0, 0.0), &reference, &[]).unwrap();
    let curve = |comparison: &Comparison, name: &str| {
        comparison.curves.iter().find(|curve| curve.name == format!("gate.outlet.{name}")).unwrap().clone()
    };
    assert_eq!(equal.verdict, Verdict::Agrees, "{equal:#?}");
    assert_eq!(equal.measures.len(), 8);
    // 8 % slower, and faster by a sixth of the speeds' spread.
    let other = compare(&gate_set(&mut random, 0.1, -0.08), &reference, &[]).unwrap();
    for name in ["gate.outlet.mass_flow_rate", "gate.outlet.normal_speed_mean"] {
        assert_eq!(measure(&other, name).verdict, Verdict::Differs, "{name}");
    }
    assert_eq!(measure(&other, "gate.outlet.crossings").verdict, Verdict::Agrees);
    assert_eq!(curve(&other, "discharge").verdict, Verdict::Differs);
    assert_eq!(curve(&other, "normal_speeds").verdict, Verdict::Differs);
    assert_eq!(curve(&other, "sizes").verdict, Verdict::Agrees);
    assert!(curve(&other, "sizes").difference.unwrap() < curve(&other, "sizes").noise_95.unwrap());
}

#[test]
fn what_is_missing_is_listed_and_decides_nothing() {
    let mut random = ChaCha8Rng::seed_from_u64(4);
    let mut runs = set(&mut random, 5, 0.0, 0.0);
    let reference = set(&mut random, 5, 0.0, 0.0);
    runs[2].measures.insert("heap_angle_deg".into(), None);
    for run in &mut runs {
        run.measures.insert("extra_m".into(), Some(1.0));
    }
    runs[0].gates.push(GateRecord { gate: "outlet".into(), ..GateRecord::default() });
    let found = compare(&runs, &reference, &[]).unwrap();
    let angle = measure(&found, "heap_angle");
    assert_eq!(angle.verdict, Verdict::Inconclusive);
    assert!(angle.interval_95.is_some() && angle.note.contains("only 4 of 5 of the runs"), "{}", angle.note);
    let extra = measure(&found, "extra");
    assert_eq!((extra.verdict, extra.difference), (Verdict::Inconclusive, None));
    assert!(extra.note.contains("the reference has no value"), "{}", extra.note);
    assert!(measure(&found, "gate.outlet.crossings").note.contains("the reference has no value"));
    assert_eq!(found.verdict, Verdict::Inconclusive);
    assert!(compare(&[], &reference, &[]).unwrap_err()[0].contains("at least one run"));
}

#[test]
fn single_runs_say_what_their_interval_rests_on() {
    let mut random = ChaCha8Rng::seed_from_u64(5);
    let (one, five) = (set(&mut random, 1, 0.0, 0.0), set(&mut random, 5, 0.0, 0.0));
    let angle = |runs: &[RunRecord], reference: &[RunRecord]| {
        measure(&compare(runs, reference, &[]).unwrap(), "heap_angle").clone()
    };
    let found = angle(&one, &five);
    assert!(found.interval_95.is_some() && found.note.contains("rests on the reference's scatter"));
    assert_eq!(found.degrees_of_freedom, Some(4.0));
    assert!(angle(&five, &one).note.contains("rests on the runs' scatter"));
    let both = angle(&one, &one);
    assert_eq!((both.difference, both.interval_95, both.verdict), (Some(0.0), None, Verdict::Inconclusive));
    assert!(both.note.contains("nothing is known of the scatter"));
}

#[test]
fn an_undecided_measure_says_how_many_runs_would_decide() {
    let mut random = ChaCha8Rng::seed_from_u64(6);
    let (runs, reference) = (set(&mut random, 3, 0.03, 0.0), set(&mut random, 3, 0.0, 0.0));
    let found = compare(&runs, &reference, &[]).unwrap();
    let rate = measure(&found, "outflow");
    assert_eq!(rate.verdict, Verdict::Inconclusive);
    assert!(rate.runs_needed.unwrap() > 3, "{rate:?}");
}
