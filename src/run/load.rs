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
    let account = LoadAccount::of(&of(false).collect::<Vec<f64>>(), 1, &of(true).collect::<Vec<f64>>())?;
    Some(LoadAccount {
        peak_memory_bytes: stages.iter().map(|stage| stage.peak_memory_bytes).max().flatten(),
        ..account
    })
}
