//! `tollgate compare`: two sets of runs against each other.

use super::print;
use std::path::PathBuf;
use tollgate::analysis::compare::Verdict;
use tollgate::exit_code;
use tollgate::report::comparison::table;
use tollgate::run::comparison::{CompareRequest, compare_runs};

#[derive(Debug, clap::Args)]
pub struct Arguments {
    /// Result folders; one with replicates stands for all of them
    #[arg(required = true, value_name = "RUN")]
    runs: Vec<PathBuf>,
    /// Result folders of the reference
    #[arg(long = "with", required = true, num_args = 1.., value_name = "RUN")]
    reference: Vec<PathBuf>,
    /// Difference that would not matter, as in `heap_angle=2deg` or `outflow=4%`; may be repeated
    #[arg(long = "margin", value_name = "NAME=VALUE", value_parser = name_and_margin)]
    margins: Vec<(String, String)>,
    /// Folder for comparison.json and comparison.svg, never overwritten
    #[arg(long)]
    out: Option<PathBuf>,
    /// The comparison as JSON on stdout, and nothing else
    #[arg(long)]
    json: bool,
}

fn name_and_margin(text: &str) -> Result<(String, String), String> {
    let (name, margin) = text.split_once('=').ok_or("write NAME=VALUE, as in heap_angle=2deg or outflow=4%")?;
    Ok((name.trim().to_owned(), margin.trim().to_owned()))
}

pub fn run(arguments: &Arguments) -> u8 {
    let request = CompareRequest {
        runs: arguments.runs.clone(),
        reference: arguments.reference.clone(),
        margins: arguments.margins.clone(),
        out: arguments.out.clone(),
    };
    let comparison = match compare_runs(&request) {
        Ok(comparison) => comparison,
        Err(error) => {
            error.findings.iter().for_each(|finding| print::message(finding));
            return error.exit_code();
        }
    };
    if arguments.json {
        print::result(&serde_json::to_string_pretty(&comparison).expect("a comparison is plain numbers and names"));
    } else {
        print::result(&table(&comparison));
        if let Some(out) = &arguments.out {
            print::result(&format!("written to {}: comparison.json, comparison.svg", out.display()));
        }
    }
    if comparison.verdict == Verdict::Agrees { exit_code::DONE } else { exit_code::OUT_OF_TOLERANCE }
}
