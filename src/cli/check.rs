//! `tollgate check`: all findings at once.

use super::{SceneArguments, print};
use tollgate::scene::{self, Severity};
use tollgate::{exit_code, plan};

#[derive(Debug, clap::Args)]
pub struct Arguments {
    #[command(flatten)]
    scene: SceneArguments,
    /// Findings as JSON on stdout
    #[arg(long)]
    json: bool,
}

pub fn run(arguments: &Arguments) -> u8 {
    let (scene, mut findings) = match scene::read(&arguments.scene.scene, &arguments.scene.all_settings()) {
        Ok((scene, warnings)) => (Some(scene), warnings),
        Err(findings) => (None, findings),
    };
    findings.sort_by_key(|finding| (finding.line, finding.column));
    let planned = scene.as_ref().map(|scene| plan::plan(scene, None));
    let refused = planned.as_ref().is_none_or(plan::Plan::is_refused);
    let planned = planned.map(|plan| plan.findings).unwrap_or_default();
    if arguments.json {
        let all = serde_json::json!({ "scene": findings, "plan": planned });
        print::result(&all.to_string());
    } else {
        print::message(&arguments.scene.rendered(&findings));
        planned.iter().for_each(|finding| print::message(&format!("plan: {}", finding.text)));
        let errors = findings.iter().filter(|finding| finding.severity == Severity::Error).count();
        let refusals = planned.iter().filter(|finding| finding.severity == plan::Severity::Refusal).count();
        let warnings = findings.len() - errors + planned.len() - refusals;
        let counted = |count: usize, word: &str| format!("{count} {word}{}", if count == 1 { "" } else { "s" });
        print::result(&format!("{}, {}", counted(errors + refusals, "error"), counted(warnings, "warning")));
    }
    if refused { exit_code::USAGE } else { exit_code::DONE }
}
