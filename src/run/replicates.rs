//! The same run several times: other seeds, or another particle moved by a hair.

use super::{RunError, RunReport, RunRequest, run_once};
use crate::analysis::replicates::figures;
use crate::exit_code;
use crate::output::summary::Summary;
use serde_json::Value;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::atomic::AtomicBool;

/// Folder of replicate number `index` from 0.
fn folder(out: &Path, index: u64) -> PathBuf {
    out.join("replicates").join(format!("{:03}", index + 1))
}

/// Runs all replicates, one after the other, and puts their statistics into `out`.
pub fn run(request: &RunRequest, out: &Path, interrupted: &AtomicBool) -> Result<RunReport, RunError> {
    let first_seed = first_seed(request)?;
    let mut reports: Vec<RunReport> = Vec::new();
    for index in 0..request.replicates {
        let mut one = RunRequest { replicates: 1, ..request.clone() };
        // Kicked runs differ by their kick alone.
        if request.perturb.is_none() {
            one.settings.push(("seed".to_owned(), (first_seed + index).to_string()));
        }
        // A replicate that was never begun has nothing to go on from.
        let place = folder(out, index);
        one.resume = request.resume && place.exists();
        let report = run_once(&one, &place, index, interrupted)?;
        let ended = report.summary.outcome.exit_code;
        reports.push(report);
        if ended != exit_code::DONE {
            break;
        }
    }
    let summary = over(&reports.iter().map(|report| &report.summary).collect::<Vec<_>>());
    summary.write(&out.join("summary.json"))?;
    Ok(RunReport {
        folder: out.to_path_buf(),
        was_done: reports.iter().all(|report| report.was_done),
        timing: String::new(),
        summary,
    })
}

fn first_seed(request: &RunRequest) -> Result<u64, RunError> {
    let (scene, _) = crate::scene::read(&request.scene, &request.settings).map_err(RunError::Scene)?;
    Ok(scene.seed)
}

/// One summary over those of the replicates: the measures' means, and the statistics of each.
fn over(replicates: &[&Summary]) -> Summary {
    let last = replicates.last().copied().cloned().unwrap_or_default();
    let statistics = figures(replicates.iter().map(|summary| &summary.measures));
    let measures: BTreeMap<String, Value> =
        statistics.iter().map(|(name, figure)| (name.clone(), figure.mean.into())).collect();
    let mut summary = Summary {
        scene: last.scene,
        outcome: last.outcome,
        stages: replicates.iter().flat_map(|summary| summary.stages.clone()).collect(),
        measures,
        replicates: serde_json::to_value(&statistics).ok(),
        ..Summary::default()
    };
    let mut warned = std::collections::BTreeSet::new();
    for (index, replicate) in replicates.iter().enumerate() {
        let new = replicate.warnings.iter().filter(|warning| warned.insert((*warning).clone()));
        summary.warnings.extend(new.map(|warning| format!("replicate {:03}: {warning}", index + 1)));
    }
    summary
}
