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
mod native;
mod normal_impact;
mod oblique_impact;
mod order;
mod published;
pub mod reference;
mod rolling_resistance;
mod table;

pub use experiment::{CaseSetup, EnergySample, Experiment, Sample};
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
    pub run: fn(&mut dyn Experiment) -> Result<Vec<Check>, String>,
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
    pub checks: Result<Vec<Check>, String>,
    /// Wall time [s].
    pub wall_time: f64,
}

impl CaseResult {
    /// True where the case ran, checked something, and every check is within tolerance.
    #[must_use]
    pub fn passed(&self) -> bool {
        self.checks.as_ref().is_ok_and(|checks| !checks.is_empty() && checks.iter().all(Check::passed))
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
    CaseResult { case: *case, checks, wall_time: start.elapsed().as_secs_f64() }
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
        assert!(!CaseResult { case, checks: Ok(Vec::new()), wall_time: 0.0 }.passed());
        assert!(!CaseResult { case, checks: Err("no".into()), wall_time: 0.0 }.passed());
    }
}
