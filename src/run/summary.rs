//! The summary of a run, from what its stage brought.

use super::stage::{StageOrder, StageOutcome};
use super::{RunRequest, gates, load};
use crate::analysis::{MassSeries, MeasureResult};
use crate::backend::stage::{EndReason, StageResult};
use crate::backend::{BackendError, PartEvent, RemovalCause};
use crate::dem::feed::{Amount, FeedReport};
use crate::exit_code;
use crate::output::series::{Series, mass_column};
use crate::output::summary::{
    EventSummary, FeedSummary, GradingSummary, Outcome, RemovalSummary, SceneProvenance, StageSummary, Summary,
};
use crate::plan::Plan;
use crate::scene::{Finding, MeasureKind, Scene};
use crate::stage::split::StageJob;
use crate::storage::StorageError;
use std::collections::BTreeMap;
use std::path::Path;

/// What the user is warned of before the run, in words.
pub fn warnings(findings: &[Finding], plan: &Plan) -> Vec<String> {
    let place = |f: &Finding| if f.line > 0 { format!("{}:{}", f.file, f.line) } else { f.file.clone() };
    let of_scene = findings.iter().map(|f| format!("{}: {}; {}", place(f), f.what, f.next));
    of_scene.chain(plan.findings.iter().map(|finding| finding.text.clone())).collect()
}

/// Mass beyond the plane of every mass flow rate, from the run's `series.csv`.
pub fn mass_series(scene: &Scene, folder: &Path) -> Result<Vec<MassSeries>, StorageError> {
    let wanted: Vec<&str> = scene
        .measures
        .iter()
        .filter(|measure| matches!(measure.kind, MeasureKind::MassFlowRate { .. }))
        .map(|measure| measure.name.as_str())
        .collect();
    if wanted.is_empty() {
        return Ok(Vec::new());
    }
    let series = Series::read(&folder.join("series.csv"))?;
    let times = series.column("time_s").unwrap_or_default();
    let samples = |name: &str| {
        let masses = series.column(&mass_column(name)).unwrap_or_default();
        times.iter().copied().zip(masses.iter().copied()).collect()
    };
    Ok(wanted.into_iter().map(|name| MassSeries { measure: name.to_owned(), samples: samples(name) }).collect())
}

fn provenance(request: &RunRequest, scene: &Scene) -> SceneProvenance {
    let file = if request.scene.is_dir() { request.scene.join("scene.toml") } else { request.scene.clone() };
    SceneProvenance {
        name: scene.name.clone(),
        file: file.display().to_string(),
        blake3: std::fs::read(&file).map_or_else(|_| String::new(), |bytes| blake3::hash(&bytes).to_hex().to_string()),
        seed: scene.seed,
        overrides: request.settings.iter().map(|(key, value)| format!("{key}={value}")).collect(),
        started_from: scene.start_checkpoint.as_ref().map(|path| path.display().to_string()),
    }
}

/// The summary of a stage that the backend did not bring to its end.
pub fn of_failure(order: &StageOrder, job: &StageJob, error: &BackendError, warnings: Vec<String>) -> Summary {
    let (time_s, steps) = match error {
        BackendError::Unstable { time, steps, .. }
        | BackendError::Gate { time, steps, .. }
        | BackendError::Failed { time, steps, .. } => (*time, *steps),
        _ => (0.0, 0),
    };
    Summary {
        scene: provenance(order.request, &job.scene),
        outcome: Outcome { exit_code: error.exit_code(), reason: error.to_string(), time_s },
        stages: vec![StageSummary {
            name: job.name.clone(),
            backend: job.backend.text().to_owned(),
            version: String::new(),
            steps,
            timestep_s: order.plan.timestep.chosen,
            ..StageSummary::default()
        }],
        warnings,
        ..Summary::default()
    }
}

/// The summary of a stage that came to its end or was interrupted.
pub fn of(
    order: &StageOrder,
    job: &StageJob,
    result: &StageResult,
    measures: &[MeasureResult],
    mut warnings: Vec<String>,
    folder: &Path,
) -> Result<Summary, StorageError> {
    let own = result.feeds.iter().enumerate().filter(|(index, _)| job.own_feeds.contains(index));
    let feeds: Vec<FeedSummary> = own.map(|(_, report)| feed(report)).collect();
    warnings
        .extend(feeds.iter().filter_map(|feed| Some(format!("feed '{}': {}", feed.name, feed.shortfall.as_ref()?))));
    warnings.extend(gates::warnings(&result.gates));
    warnings.extend(result.warnings.iter().cloned());
    let interrupted = result.end == EndReason::Interrupted;
    let mut summary = Summary {
        scene: provenance(order.request, &job.scene),
        outcome: Outcome {
            exit_code: if interrupted { exit_code::INTERRUPTED } else { exit_code::DONE },
            reason: result.end.text().to_owned(),
            time_s: result.time,
        },
        stages: vec![StageSummary {
            name: job.name.clone(),
            backend: result.identity.backend.text().to_owned(),
            version: result.identity.version.clone(),
            steps: result.steps,
            timestep_s: order.plan.timestep.chosen,
            particles: result.particles.len() as u64,
            wall_s: result.wall_s,
            cpu_s: result.used.cpu_s,
            particle_steps_per_s: result.particle_steps / result.wall_s,
            peak_memory_bytes: result.used.peak_memory_bytes,
            threads: result.identity.threads,
            simd: result.identity.simd,
        }],
        gates: gates::of_stage(&job.name, folder, &result.gates)?,
        feeds,
        removed: removals(result),
        events: events(&job.scene, result),
        timing_s: result.timing.seconds(),
        warnings,
        ..Summary::default()
    };
    for measure in measures {
        record_measure(&mut summary, measure);
    }
    Ok(summary)
}

/// The summary of a cut scene, from those of its stages that have been run.
pub fn of_stages(order: &StageOrder, scene: &Scene, jobs: &[StageJob], outcomes: &[StageOutcome]) -> Summary {
    let mut whole = Summary { scene: provenance(order.request, scene), ..Summary::default() };
    let mut warned = std::collections::BTreeSet::new();
    for outcome in outcomes {
        let (stage, part) = (&outcome.stage, &outcome.summary);
        whole.stages.extend(part.stages.iter().cloned());
        whole.gates.extend(part.gates.iter().cloned());
        whole.measures.extend(part.measures.iter().map(|(name, value)| (format!("{stage}.{name}"), value.clone())));
        whole.feeds.extend(part.feeds.iter().cloned());
        let named = |cause: &str| format!("{stage}: {cause}");
        whole.removed.extend(part.removed.iter().map(|row| RemovalSummary { cause: named(&row.cause), ..row.clone() }));
        whole.events.extend(part.events.iter().map(|event| EventSummary { what: named(&event.what), ..event.clone() }));
        for (phase, seconds) in &part.timing_s {
            *whole.timing_s.entry(phase.clone()).or_default() += seconds;
        }
        whole.warnings.extend(outcome.not_reused.iter().cloned());
        let new = part.warnings.iter().filter(|warning| warned.insert((*warning).clone()));
        whole.warnings.extend(new.map(
            |warning| {
                if order.warnings.contains(warning) { warning.clone() } else { named(warning) }
            },
        ));
        if part.outcome.exit_code != exit_code::DONE || whole.outcome.reason.is_empty() {
            whole.outcome = part.outcome.clone();
        }
        whole.outcome.time_s = whole.outcome.time_s.max(part.outcome.time_s);
    }
    whole.gates = gates::by_name(whole.gates);
    let missing = jobs.len() - outcomes.len();
    if whole.outcome.exit_code == exit_code::DONE {
        whole.outcome.reason = if missing == 0 {
            "all stages done".to_owned()
        } else {
            format!("{missing} of {} stages not run yet", jobs.len())
        };
    }
    whole.load = load::account(jobs, &whole.stages);
    whole
}

/// `NAME_UNIT` and `NAME_uncertainty_UNIT`, in the summary's spelling of units.
fn record_measure(summary: &mut Summary, measure: &MeasureResult) {
    let unit = match measure.unit {
        "-" => String::new(),
        unit => format!("_{}", unit.replace('/', "_per_").replace('%', "percent")),
    };
    let name = measure.name.replace('.', "_");
    summary.measure(&format!("{name}{unit}"), measure.value);
    if let Some(uncertainty) = measure.uncertainty {
        summary.measure(&format!("{name}_uncertainty{unit}"), uncertainty);
    }
    if !measure.note.is_empty() {
        summary.measure(&format!("{name}_note"), measure.note.as_str());
    }
}

fn feed(report: &FeedReport) -> FeedSummary {
    let (count, mass) = match report.asked {
        Amount::Count(count) => (Some(count), None),
        Amount::Mass(mass) => (None, Some(mass)),
    };
    FeedSummary {
        name: report.name.clone(),
        asked_count: count,
        asked_mass_kg: mass,
        inserted_count: report.inserted_count,
        inserted_mass_kg: report.inserted_mass,
        grading: report
            .grading
            .iter()
            .map(|row| GradingSummary {
                from_m: row.from,
                to_m: row.to,
                asked_fraction: row.asked,
                inserted_fraction: row.inserted,
            })
            .collect(),
        shortfall: report.shortfall.as_ref().map(|shortfall| {
            let missing = match shortfall.missing {
                Amount::Count(count) => format!("{count} particles"),
                Amount::Mass(mass) => format!("{mass:.4e} kg"),
            };
            format!("{missing} are missing: {}", shortfall.cause)
        }),
    }
}

fn removals(result: &StageResult) -> Vec<RemovalSummary> {
    let mut by_cause: BTreeMap<RemovalCause, (u64, f64)> = BTreeMap::new();
    for removal in &result.removed {
        let entry = by_cause.entry(removal.cause).or_default();
        entry.0 += 1;
        entry.1 += removal.mass;
    }
    let row = |(cause, (count, mass_kg)): (RemovalCause, (u64, f64))| RemovalSummary {
        cause: cause.text().to_owned(),
        count,
        mass_kg,
    };
    by_cause.into_iter().map(row).collect()
}

fn events(scene: &Scene, result: &StageResult) -> Vec<EventSummary> {
    let text = |event: &PartEvent| event_text(&scene.parts[usize::from(event.part)].name, event.present);
    result.events.iter().map(|event| EventSummary { time_s: event.time, what: text(event) }).collect()
}

/// A part that has come (`present`) or gone, in words.
pub fn event_text(part: &str, present: bool) -> String {
    format!("part '{part}' {}", if present { "appeared" } else { "disappeared" })
}
