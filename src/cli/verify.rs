//! `tollgate verify`: the solver against closed forms and published benchmarks.

use super::print;
use tollgate::{exit_code, verify};

#[derive(Debug, clap::Args)]
pub struct Arguments {
    /// Backend to verify
    #[arg(long, default_value = "native", value_parser = ["native"])]
    backend: String,
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
    let wanted =
        suite.iter().filter(|case| arguments.cases.is_empty() || arguments.cases.iter().any(|n| n == case.name));
    let mut experiment = verify::Native;
    let results: Vec<verify::CaseResult> = wanted.map(|case| verify::run_case(case, &mut experiment)).collect();
    print::result(&verify::table(&results));
    let failed = results.iter().filter(|result| !result.passed()).count();
    print::result(&format!("{}: {} cases, {failed} failed", arguments.backend, results.len()));
    if failed == 0 { exit_code::DONE } else { exit_code::OUT_OF_TOLERANCE }
}
