//! The particle-level suite on LIGGGHTS: a fast part of it. `tollgate verify --backend liggghts` runs all.

use std::process::Command;
use tollgate::verify::{
    Case, CaseResult, CaseSetup, Experiment, Liggghts, NotRun, Sample, Verdict, run_case, suite, table,
};

fn case(name: &str) -> Case {
    suite().into_iter().find(|case| case.name == name).unwrap_or_else(|| panic!("no case {name}"))
}

fn conventions(result: &CaseResult) -> Vec<&'static str> {
    let checks = result.checks.as_ref().unwrap();
    let differs = |verdict| if let Verdict::Differs(known) = verdict { Some(known.convention) } else { None };
    checks.iter().filter_map(|check| differs(result.verdict(check))).collect()
}

#[test]
fn what_liggghts_shares_with_the_references_is_within_tolerance() {
    let names = ["chung-ooi-2", "chung-ooi-7", "mfix-dem01", "incline-sliding", "rolling-decay-cdt", "momentum"];
    for name in names {
        let result = run_case(&case(name), &mut Liggghts);
        assert!(result.passed() && conventions(&result).is_empty(), "{}", table(&[result]));
    }
}

#[test]
fn a_difference_of_formulas_is_named_and_no_failure() {
    let result = run_case(&case("slip-to-roll"), &mut Liggghts);
    assert!(result.passed(), "{}", table(std::slice::from_ref(&result)));
    assert_eq!(conventions(&result), ["cap on the spring alone"; 2], "one at each speed");
    let text = table(&[result]);
    assert!(text.contains("  diff  ") && text.contains("differs by: cap on the spring alone"), "{text}");
}

#[test]
fn what_liggghts_cannot_do_is_said() {
    for (name, reason) in [("momentum-incremental", "use \"total\""), ("energy-of-impacts", "no energy budget")] {
        let result = run_case(&case(name), &mut Liggghts);
        let Err(NotRun::NotPossible(said)) = &result.checks else { panic!("{name} ran") };
        assert!(said.contains(reason), "{said}");
        assert!(table(&[result]).contains("not possible: "));
    }
}

/// LIGGGHTS with a fault built in.
struct Faulty(fn(&mut CaseSetup));

impl Experiment for Faulty {
    fn departures(&self) -> &'static [tollgate::verify::Departure] {
        Liggghts.departures()
    }

    fn run(&mut self, setup: &CaseSetup) -> Result<Vec<Sample>, NotRun> {
        let mut changed = setup.clone();
        (self.0)(&mut changed);
        Liggghts.run(&changed)
    }
}

#[test]
fn a_wrong_deck_is_noticed() {
    let heavier = |setup: &mut CaseSetup| setup.particles.iter_mut().for_each(|p| p.density *= 1.01);
    assert!(!run_case(&case("chung-ooi-2"), &mut Faulty(heavier)).passed());
    let weaker = |setup: &mut CaseSetup| setup.gravity *= 0.99;
    assert!(!run_case(&case("slip-to-roll"), &mut Faulty(weaker)).passed(), "known differences must not hide others");
}

#[test]
fn a_run_that_fails_says_what_liggghts_said() {
    // Two particles in one place: LIGGGHTS goes on with not-a-number to the end and reports success.
    let coincident = |setup: &mut CaseSetup| {
        let twin = setup.particles[0];
        setup
            .particles
            .push(tollgate::particle::ParticleState { id: tollgate::particle::ParticleId::new(0, 9), ..twin });
    };
    let result = run_case(&case("mfix-dem01"), &mut Faulty(coincident));
    let Err(NotRun::Failed(said)) = &result.checks else { panic!("{}", table(&[result])) };
    assert!(said.contains("is not a number"), "{said}");
    let outside = |setup: &mut CaseSetup| setup.particles[0].position.z = 50.0;
    let result = run_case(&case("mfix-dem01"), &mut Faulty(outside));
    let Err(NotRun::Failed(said)) = &result.checks else { panic!("{}", table(&[result])) };
    assert!(said.contains("LIGGGHTS stopped: ERROR") && said.contains("atoms"), "{said}");
}

#[test]
fn without_the_binary_the_program_says_what_to_install() {
    let empty = tempfile::tempdir().unwrap();
    let output = Command::new(env!("CARGO_BIN_EXE_tollgate"))
        .args(["verify", "--backend", "liggghts", "--case", "chung-ooi-7"])
        .env("PATH", empty.path())
        .output()
        .unwrap();
    let message = String::from_utf8_lossy(&output.stderr).into_owned();
    assert_eq!(output.status.code(), Some(3), "{message}");
    assert!(message.contains("apt-get install liggghts"), "{message}");
}
