//! Particle-level verification: one contact in closed form, and what no time step may break.
//!
//! A [`Case`] describes experiments with ground-floor types only ([`CaseSetup`]), has them run by an [`Experiment`]
//! (a backend), and compares the trajectories that come back with an independent solution ([`reference`]). So the same
//! suite checks every backend. What belongs to bulk behaviour or to another code is not here.

mod bounce;
mod chock;
mod energy;
mod experiment;
mod impact_measure;
mod incline;
mod invariants;
mod liggghts;
mod native;
mod normal_impact;
mod oblique_impact;
mod order;
mod published;
pub mod reference;
mod rolling_resistance;
mod table;

pub use experiment::{CaseSetup, Departure, EnergySample, Experiment, NotRun, Sample};
pub use liggghts::Liggghts;
pub use native::Native;
pub use table::table;

/// A verification case.
#[derive(Debug, Clone, Copy)]
pub struct Case {
    /// Name for `--case`.
    pub name: &'static str,
    /// What it shows, in one line.
    pub title: &'static str,
    /// Where case and reference come from: author and year, or the principle.
    pub source: &'static str,
    /// Runs its experiments and compares.
    pub run: fn(&mut dyn Experiment) -> Result<Vec<Check>, NotRun>,
}

/// One compared quantity.
#[derive(Debug, Clone, PartialEq)]
pub struct Check {
    /// What is compared, with the parameter values that tell it from its neighbours.
    pub quantity: String,
    /// What it should be.
    pub reference: f64,
    /// What the experiment gave.
    pub measured: f64,
    /// How far both may be apart.
    pub tolerance: Tolerance,
    /// Why so far and no further.
    pub reason: &'static str,
    /// Unit of `reference` and `measured`.
    pub unit: &'static str,
    /// Where the reference comes from: a formula, or author and year of a published value.
    pub source: &'static str,
}

/// How far a measured value may be from its reference.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Tolerance {
    /// |measured - reference| <= value, in the check's unit.
    Absolute(f64),
    /// |measured - reference| <= value |reference|.
    Relative(f64),
    /// measured >= reference.
    AtLeast,
    /// measured <= reference.
    AtMost,
}

impl Check {
    /// True where the measured value is finite and within tolerance.
    #[must_use]
    pub fn passed(&self) -> bool {
        let difference = (self.measured - self.reference).abs();
        self.measured.is_finite()
            && match self.tolerance {
                Tolerance::Absolute(limit) => difference <= limit,
                Tolerance::Relative(limit) => difference <= limit * self.reference.abs(),
                Tolerance::AtLeast => self.measured >= self.reference,
                Tolerance::AtMost => self.measured <= self.reference,
            }
    }
}

/// What came out of one case.
#[derive(Debug, Clone)]
pub struct CaseResult {
    /// The case.
    pub case: Case,
    /// Its checks, or why it could not be run.
    pub checks: Result<Vec<Check>, NotRun>,
    /// Differences of formulas that the backend is known for.
    pub departures: &'static [Departure],
    /// Wall time [s].
    pub wall_time: f64,
}

/// What a check came to.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Verdict {
    /// Within tolerance.
    Passed,
    /// Out of tolerance by no more than a known difference of formulas explains.
    Differs(&'static Departure),
    /// Out of tolerance.
    Failed,
}

impl CaseResult {
    /// True where the case ran, checked something, and every check is within tolerance or explained; or where it is not possible.
    #[must_use]
    pub fn passed(&self) -> bool {
        match &self.checks {
            Ok(checks) => !checks.is_empty() && checks.iter().all(|check| self.verdict(check) != Verdict::Failed),
            Err(NotRun::NotPossible(_)) => true,
            Err(NotRun::Failed(_)) => false,
        }
    }

    /// What one of its checks came to.
    #[must_use]
    pub fn verdict(&self, check: &Check) -> Verdict {
        if check.passed() {
            return Verdict::Passed;
        }
        let explains = |departure: &&Departure| {
            let limit = departure.bound * if departure.is_relative { check.reference.abs() } else { 1.0 };
            departure.case == self.case.name
                && check.quantity.contains(departure.quantity)
                && (check.measured - check.reference).abs() <= limit
        };
        self.departures.iter().find(explains).map_or(Verdict::Failed, Verdict::Differs)
    }
}

/// All cases, cheapest question first.
#[must_use]
pub fn suite() -> Vec<Case> {
    [
        normal_impact::CASES,
        oblique_impact::CASES,
        bounce::CASES,
        incline::CASES,
        rolling_resistance::CASES,
        chock::CASES,
        invariants::CASES,
        order::CASES,
        energy::CASES,
    ]
    .concat()
}

/// Runs one case on one backend.
#[must_use]
pub fn run_case(case: &Case, experiment: &mut dyn Experiment) -> CaseResult {
    let start = std::time::Instant::now();
    let checks = (case.run)(experiment);
    CaseResult { case: *case, checks, departures: experiment.departures(), wall_time: start.elapsed().as_secs_f64() }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn check(reference: f64, measured: f64, tolerance: Tolerance) -> Check {
        Check { quantity: "x".into(), reference, measured, tolerance, reason: "test", unit: "-", source: "test" }
    }

    #[test]
    fn a_check_fails_outside_of_its_tolerance_and_on_nan() {
        assert!(check(2.0, 2.1, Tolerance::Absolute(0.11)).passed());
        assert!(!check(2.0, 2.1, Tolerance::Absolute(0.09)).passed());
        assert!(check(-2.0, -2.1, Tolerance::Relative(0.06)).passed());
        assert!(!check(-2.0, 2.0, Tolerance::Relative(0.06)).passed());
        assert!(check(2.0, 2.0, Tolerance::AtLeast).passed() && !check(2.0, 1.9, Tolerance::AtLeast).passed());
        assert!(check(2.0, 2.0, Tolerance::AtMost).passed() && !check(2.0, 2.1, Tolerance::AtMost).passed());
        assert!(!check(2.0, f64::NAN, Tolerance::Absolute(1.0)).passed());
    }

    #[test]
    fn case_names_are_unique_and_fit_the_command_line() {
        let names: Vec<_> = suite().iter().map(|case| case.name).collect();
        for (k, name) in names.iter().enumerate() {
            assert!(!names[..k].contains(name), "{name} twice");
            assert!(name.chars().all(|c| c.is_ascii_lowercase() || c.is_ascii_digit() || c == '-'), "{name}");
        }
    }

    #[test]
    fn a_case_that_checks_nothing_has_not_passed() {
        let case = Case { name: "empty", title: "", source: "", run: |_| Ok(Vec::new()) };
        let result = |checks| CaseResult { case, checks, departures: &[], wall_time: 0.0 };
        assert!(!result(Ok(Vec::new())).passed());
        assert!(!result(Err("no".into())).passed());
        assert!(result(Err(NotRun::NotPossible("no such law".into()))).passed(), "said, not failed");
    }

    #[test]
    fn a_known_difference_explains_no_more_than_its_bound() {
        const KNOWN: &[Departure] =
            &[Departure { case: "empty", quantity: "x", bound: 0.1, is_relative: true, convention: "lever arm" }];
        let case = Case { name: "empty", title: "", source: "", run: |_| Ok(Vec::new()) };
        let result = CaseResult { case, checks: Ok(Vec::new()), departures: KNOWN, wall_time: 0.0 };
        let at = |measured| result.verdict(&check(2.0, measured, Tolerance::Relative(1e-3)));
        assert_eq!(at(2.001), Verdict::Passed);
        assert_eq!(at(2.19), Verdict::Differs(&KNOWN[0]));
        assert_eq!(at(2.21), Verdict::Failed);
        assert_eq!(at(f64::NAN), Verdict::Failed);
        let other = Check { quantity: "y".into(), ..check(2.0, 2.1, Tolerance::Relative(1e-3)) };
        assert_eq!(result.verdict(&other), Verdict::Failed);
    }
}
