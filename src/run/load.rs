//! What a split costs and saves, in processor seconds.

use crate::output::summary::{LoadAccount, StageSummary};
use crate::stage::split::StageJob;

/// The account of a cut scene all of whose stages have been run; `None` else, or where the system tells no processor time.
pub fn account(jobs: &[StageJob], stages: &[StageSummary]) -> Option<LoadAccount> {
    if stages.len() != jobs.len() || jobs.iter().all(|job| job.is_leaf) {
        return None;
    }
    let cpu: Option<Vec<f64>> = stages.iter().map(|stage| stage.cpu_s).collect();
    let cpu = cpu?;
    let of = |leaf: bool| jobs.iter().zip(&cpu).filter(move |(job, _)| job.is_leaf == leaf).map(|(_, cpu)| *cpu);
    let (upstream, downstream): (f64, f64) = (of(false).sum(), of(true).sum());
    let runs = of(true).count() as u64;
    let mean = downstream / runs as f64;
    let mut each: Vec<f64> = of(true).collect();
    each.sort_by(f64::total_cmp);
    let median = each[each.len() / 2];
    let unsplit = (upstream + mean) * runs as f64;
    Some(LoadAccount {
        upstream_cpu_s: upstream,
        upstream_runs: 1,
        downstream_cpu_s: mean,
        downstream_runs: runs,
        split_cpu_s: upstream + downstream,
        split_forecast_cpu_s: upstream + median * runs as f64,
        unsplit_forecast_cpu_s: unsplit,
        ratio: unsplit / (upstream + downstream),
        peak_memory_bytes: stages.iter().map(|stage| stage.peak_memory_bytes).max().flatten(),
    })
}
