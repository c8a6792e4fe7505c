//! The particle-level suite on the native solver, and proof that it can fail.

use tollgate::material::{PairContact, PairProperties};
use tollgate::verify::{Case, CaseResult, CaseSetup, Experiment, Native, NotRun, Sample, run_case, suite, table};

fn case(name: &str) -> Case {
    suite().into_iter().find(|case| case.name == name).unwrap_or_else(|| panic!("no case {name}"))
}

#[test]
fn the_native_solver_is_within_every_tolerance() {
    let results: Vec<_> = suite().iter().map(|case| run_case(case, &mut Native)).collect();
    assert!(results.iter().all(CaseResult::passed), "{}", table(&results));
}

/// The native solver with a fault built in.
struct Faulty(fn(&mut CaseSetup), fn(&mut Sample));

impl Experiment for Faulty {
    fn run(&mut self, setup: &CaseSetup) -> Result<Vec<Sample>, NotRun> {
        let mut changed = setup.clone();
        (self.0)(&mut changed);
        let mut samples = Native.run(&changed)?;
        samples.iter_mut().skip(1).for_each(self.1);
        Ok(samples)
    }
}

fn change_pairs(setup: &mut CaseSetup, change: fn(PairProperties) -> PairProperties) {
    for (a, b) in [(0, 0), (0, 1)] {
        if let Some(pair) = setup.materials.pair(a, b).copied() {
            setup.materials.set_pair(a, b, change(pair));
        }
    }
}

fn caught(name: &str, change: fn(&mut CaseSetup), spoil: fn(&mut Sample)) {
    let result = run_case(&case(name), &mut Faulty(change, spoil));
    assert!(!result.passed(), "the fault went unnoticed:\n{}", table(&[result]));
}

#[test]
fn wrong_friction_is_noticed() {
    let change = |setup: &mut CaseSetup| {
        change_pairs(setup, |pair| PairProperties { sliding_friction: 1.02 * pair.sliding_friction, ..pair });
    };
    for name in ["chung-ooi-4", "chung-ooi-5", "incline-sliding", "slip-to-roll"] {
        caught(name, change, |_| {});
    }
}

#[test]
fn wrong_damping_is_noticed() {
    let change = |setup: &mut CaseSetup| {
        change_pairs(setup, |pair| {
            let contact = match pair.contact {
                PairContact::Restitution { coefficient } => {
                    PairContact::Restitution { coefficient: coefficient.powf(1.02) }
                }
                PairContact::Stiffness {
                    normal_stiffness,
                    tangential_stiffness,
                    normal_damping,
                    tangential_damping,
                } => PairContact::Stiffness {
                    normal_stiffness,
                    tangential_stiffness,
                    normal_damping: 1.05 * normal_damping,
                    tangential_damping,
                },
            };
            PairProperties { contact, ..pair }
        });
    };
    for name in ["chung-ooi-3", "restitution-cut-off", "mfix-dem01", "mfix-dem02"] {
        caught(name, change, |_| {});
    }
}

#[test]
fn wrong_stiffness_gravity_and_rolling_friction_are_noticed() {
    for name in ["chung-ooi-1", "chung-ooi-2"] {
        let heavier = |setup: &mut CaseSetup| setup.particles.iter_mut().for_each(|p| p.density *= 1.01);
        caught(name, heavier, |_| {});
    }
    for name in ["mfix-dem01", "incline-rolling", "order-in-timestep"] {
        caught(name, |setup| setup.gravity *= 1.005, |_| {});
    }
    for name in ["rolling-decay-cdt", "rolling-onset-epsd2"] {
        let change = |setup: &mut CaseSetup| {
            change_pairs(setup, |pair| PairProperties { rolling_friction: 1.03 * pair.rolling_friction, ..pair });
        };
        caught(name, change, |_| {});
    }
}

#[test]
fn broken_invariants_are_noticed() {
    for name in ["momentum", "chung-ooi-7"] {
        caught(name, |_| {}, |sample| sample.particles[0].spin.y *= 1.0 + 1e-6);
    }
    caught("galilean-shift", |_| {}, |sample| sample.particles.iter_mut().for_each(|p| p.position *= 1.0 - 1e-9));
    caught("renumbering", |_| {}, |sample| sample.particles[0].position.x += 1e-11);
    caught(
        "energy-of-impacts",
        |_| {},
        |sample| {
            if let Some(energy) = &mut sample.energy {
                energy.slip *= 1.05;
            }
        },
    );
    caught("chock", |setup| change_pairs(setup, |pair| PairProperties { sliding_friction: 0.0, ..pair }), |_| {});
}
