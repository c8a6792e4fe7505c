//! The table a user reads: reference, measured, tolerance, source.

use super::{CaseResult, Check, NotRun, Tolerance, Verdict};
use std::fmt::Write as _;

/// Renders results as text; every line that is out of tolerance starts with `FAIL`.
#[must_use]
pub fn table(results: &[CaseResult]) -> String {
    let mut text = String::new();
    for result in results {
        let _ = writeln!(
            text,
            "{}: {} [{}] ({:.1} s)",
            result.case.name, result.case.title, result.case.source, result.wall_time
        );
        match &result.checks {
            Ok(checks) => text.push_str(&rows(result, checks)),
            Err(NotRun::NotPossible(reason)) => {
                let _ = writeln!(text, "  --    not possible: {reason}");
            }
            Err(NotRun::Failed(reason)) => {
                let _ = writeln!(text, "  FAIL  not run: {reason}");
            }
        }
        text.push('\n');
    }
    let failed = results.iter().filter(|result| !result.passed()).count();
    let checks: usize = results.iter().filter_map(|result| result.checks.as_ref().ok()).map(Vec::len).sum();
    let impossible = results.iter().filter(|r| matches!(r.checks, Err(NotRun::NotPossible(_)))).count();
    let differing: usize = results.iter().map(differences).sum();
    let _ = write!(text, "{} cases, {checks} checks, {failed} cases out of tolerance", results.len());
    if differing > 0 {
        let _ = write!(text, "; {differing} checks differ by a known convention");
    }
    if impossible > 0 {
        let _ = write!(text, "; {impossible} cases not possible");
    }
    text.push('\n');
    text
}

fn differences(result: &CaseResult) -> usize {
    let differs = |check: &&Check| matches!(result.verdict(check), Verdict::Differs(_));
    result.checks.as_ref().map_or(0, |checks| checks.iter().filter(differs).count())
}

fn rows(result: &CaseResult, checks: &[Check]) -> String {
    let width = checks.iter().map(|check| check.quantity.chars().count()).max().unwrap_or(0).max(8);
    let mut text = format!(
        "        {:width$} {:>13} {:>13} {:>10}  {:24} source\n",
        "quantity", "reference", "measured", "difference", "tolerance"
    );
    for check in checks {
        let (verdict, note) = match result.verdict(check) {
            Verdict::Passed => ("ok", String::new()),
            Verdict::Differs(known) => ("diff", format!("; differs by: {}", known.convention)),
            Verdict::Failed => ("FAIL", String::new()),
        };
        let _ = writeln!(
            text,
            "  {verdict:4}  {:width$} {:>13} {:>13} {:>10.1e}  {:24} {} [{}]; {}{note}",
            check.quantity,
            number(check.reference),
            number(check.measured),
            check.measured - check.reference,
            allowed(check),
            check.source,
            check.unit,
            check.reason,
        );
    }
    text
}

fn allowed(check: &Check) -> String {
    match check.tolerance {
        Tolerance::Absolute(limit) => format!("+- {limit:.1e} {}", check.unit),
        Tolerance::Relative(limit) => format!("+- {limit:.1e} of it"),
        Tolerance::AtLeast => "at least".into(),
        Tolerance::AtMost => "at most".into(),
    }
}

fn number(value: f64) -> String {
    if value == 0.0 || (1e-3..1e5).contains(&value.abs()) { format!("{value:.6}") } else { format!("{value:.5e}") }
}

#[cfg(test)]
mod tests {
    use super::super::Case;
    use super::*;

    #[test]
    fn a_failed_check_and_a_case_that_did_not_run_are_marked() {
        let case = Case { name: "impact", title: "t", source: "s", run: |_| Ok(Vec::new()) };
        let check = |measured| Check {
            quantity: "height".into(),
            reference: 1.0,
            measured,
            tolerance: Tolerance::Relative(1e-3),
            reason: "why",
            unit: "m",
            source: "Hertz 1882",
        };
        let ran = CaseResult { case, checks: Ok(vec![check(1.0005), check(1.5)]), departures: &[], wall_time: 0.1 };
        let failed = CaseResult { case, checks: Err("no such law".into()), departures: &[], wall_time: 0.1 };
        let text = table(&[ran, failed]);
        assert_eq!(text.matches("FAIL").count(), 2, "{text}");
        assert!(text.contains("  ok    height") && text.contains("not run: no such law"), "{text}");
        assert!(text.contains("2 cases, 2 checks, 2 cases out of tolerance"), "{text}");
    }
}
