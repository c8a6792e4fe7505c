//! `tollgate verify`: the solver against closed forms and published benchmarks.

use super::print;
use tollgate::{exit_code, verify};

#[derive(Debug, clap::Args)]
pub struct Arguments {
    /// Backend to verify; may be repeated
    #[arg(long = "backend", value_name = "NAME", default_value = "native", value_parser = ["native", "liggghts"])]
    backends: Vec<String>,
    /// Only these cases, by name; may be repeated
    #[arg(long = "case", value_name = "NAME")]
    cases: Vec<String>,
}

pub fn run(arguments: &Arguments) -> u8 {
    let suite = verify::suite();
    let unknown: Vec<&String> =
        arguments.cases.iter().filter(|name| suite.iter().all(|case| case.name != name.as_str())).collect();
    if !unknown.is_empty() {
        let known: Vec<&str> = suite.iter().map(|case| case.name).collect();
        print::message(&format!("unknown cases: {unknown:?}; there are: {}", known.join(", ")));
        return exit_code::USAGE;
    }
    let wanted: Vec<verify::Case> = suite
        .into_iter()
        .filter(|case| arguments.cases.is_empty() || arguments.cases.iter().any(|name| name == case.name))
        .collect();
    let mut code = exit_code::DONE;
    for backend in &arguments.backends {
        let mut experiment: Box<dyn verify::Experiment> = if backend == "liggghts" {
            if let Err(reason) = verify::Liggghts::available() {
                print::message(&reason);
                return exit_code::NO_BACKEND;
            }
            Box::new(verify::Liggghts)
        } else {
            Box::new(verify::Native)
        };
        if !verified(backend, &wanted, experiment.as_mut()) {
            code = exit_code::OUT_OF_TOLERANCE;
        }
    }
    code
}

/// Runs the cases and prints their table; false where one is out of tolerance.
fn verified(backend: &str, cases: &[verify::Case], experiment: &mut dyn verify::Experiment) -> bool {
    let results: Vec<verify::CaseResult> = cases.iter().map(|case| verify::run_case(case, experiment)).collect();
    print::result(&verify::table(&results));
    let failed = results.iter().filter(|result| !result.passed()).count();
    print::result(&format!("{backend}: {} cases, {failed} failed", results.len()));
    failed == 0
}
