//! The picture of a run's last state: of one stage, and of all last stages of a cut scene side by side.

use super::stage::StageOutcome;
use super::summary::event_text;
use crate::analysis::MeasureResult;
use crate::analysis::angle_of_repose::angle_of_repose;
use crate::analysis::surface_profile::SurfacePoint;
use crate::backend::stage::StageResult;
use crate::exit_code;
use crate::geometry::part::{Part, Trigger};
use crate::math::{Bounds, Vec3};
use crate::output::final_state;
use crate::output::summary::{EventSummary, Summary};
use crate::particle::ParticleState;
use crate::report::outline::{Outline, gate_outline, outline};
use crate::report::panels::{GateMark, Panel, side_by_side};
use crate::report::picture::{Annotations, ColourBy, SlopeLine, View, side_view};
use crate::scene::gate::Gate;
use crate::scene::{MeasureKind, Scene};
use crate::stage::split::StageJob;
use crate::storage::StorageError;
use crate::storage::staging::write_whole;
use serde_json::Value;
use std::path::Path;

/// Writes `picture.svg`: particles by diameter, the parts that are there, and the slopes of every measured heap.
pub fn draw(
    scene: &Scene,
    result: &StageResult,
    measures: &[MeasureResult],
    folder: &Path,
) -> Result<(), StorageError> {
    let view = view_of(scene);
    let bounds = bounds_of(scene, &result.particles);
    let parts: Vec<Outline> = scene
        .parts
        .iter()
        .zip(&result.present)
        .filter(|(_, present)| **present)
        .map(|(part, _)| outline(&part.surface, &part.motion.pose(result.time), &view.sight(), &bounds))
        .collect();
    let annotations = Annotations {
        title: scene.name.clone(),
        slopes: slopes(scene, &result.particles),
        caption: caption(scene, result, measures),
    };
    let svg = side_view(&result.particles, &parts, &view, ColourBy::Diameter, &annotations);
    write_whole(&folder.join("picture.svg"), svg.as_bytes())
}

/// Along the width of the heaps: the first one that is measured decides.
fn view_of(scene: &Scene) -> View {
    let along = scene.measures.iter().find_map(|measure| match measure.kind {
        MeasureKind::AngleOfRepose { along, .. } => Some(along),
        _ => None,
    });
    if along == Some(1) { View::side() } else { View::front() }
}

/// Where particles are; without any, the domain.
fn bounds_of<'a>(scene: &Scene, particles: impl IntoIterator<Item = &'a ParticleState>) -> Bounds {
    let mut bounds = Bounds::EMPTY;
    particles.into_iter().for_each(|particle| bounds.include(&particle.position));
    if bounds.is_empty() { scene.domain.bounds } else { bounds }
}

/// A last stage that came to its end: its job, its result, its particles.
struct Finished<'a> {
    job: &'a StageJob,
    outcome: &'a StageOutcome,
    particles: Vec<ParticleState>,
}

/// Writes `picture.svg` of a cut scene: a panel for each of its last stages that has been run, from the state that lies in the
/// stage's folder, whoever computed it. The stages upstream are there with their parts.
pub fn draw_stages(
    scene: &Scene,
    jobs: &[StageJob],
    outcomes: &[StageOutcome],
    summary: &Summary,
    folder: &Path,
) -> Result<(), StorageError> {
    let outcome_of = |job: &StageJob| {
        outcomes.iter().find(|o| o.stage == job.name && o.summary.outcome.exit_code == exit_code::DONE)
    };
    let mut finished = Vec::new();
    for job in jobs.iter().filter(|job| job.is_leaf) {
        let Some(outcome) = outcome_of(job) else { continue };
        let Some(state) = final_state::place(&outcome.folder) else { continue };
        let particles = final_state::read(&state)?;
        finished.push(Finished { job, outcome, particles });
    }
    if finished.is_empty() {
        return Ok(());
    }
    let view = view_of(scene);
    let mut bounds = bounds_of(scene, finished.iter().flat_map(|stage| &stage.particles));
    scene.gates.iter().for_each(|gate| bounds.include(&gate.plane.point));
    let drawn = |job: &StageJob, outcome: &StageOutcome, without: &[Part]| -> Vec<Outline> {
        let summary = &outcome.summary;
        let there =
            |part: &&Part| is_present(part, &summary.events) && !without.iter().any(|other| other.name == part.name);
        let pose = |part: &Part| part.motion.pose(summary.outcome.time_s);
        let parts = job.scene.parts.iter().filter(there);
        parts.map(|part| outline(&part.surface, &pose(part), &view.sight(), &bounds)).collect()
    };
    let panel = |stage: Finished| {
        let (job, outcome) = (stage.job, stage.outcome);
        let upstream =
            ancestors(jobs, job).into_iter().filter_map(|index| Some((&jobs[index], outcome_of(&jobs[index])?)));
        Panel {
            heading: job.name.clone(),
            parts: drawn(job, outcome, &[]),
            earlier_parts: upstream.flat_map(|(earlier, its)| drawn(earlier, its, &job.scene.parts)).collect(),
            slopes: slopes(&job.scene, &stage.particles),
            particles: stage.particles,
        }
    };
    let panels: Vec<Panel> = finished.into_iter().map(panel).collect();
    let mark = |gate: &Gate| GateMark {
        name: gate.name.clone(),
        border: gate_outline(&gate.plane, &view.sight(), &bounds),
        middle: gate.plane.point,
    };
    let gates: Vec<GateMark> = scene.gates.iter().map(mark).collect();
    let svg = side_by_side(&panels, &gates, &view, &scene.name, &stages_caption(summary, panels.len()));
    write_whole(&folder.join("picture.svg"), svg.as_bytes())
}

/// All jobs that `job` waits for, and those that these wait for.
fn ancestors(jobs: &[StageJob], job: &StageJob) -> Vec<usize> {
    let mut found = job.waits_for.clone();
    let mut next = 0;
    while let Some(&index) = found.get(next) {
        let new: Vec<usize> = jobs[index].waits_for.iter().copied().filter(|other| !found.contains(other)).collect();
        found.extend(new);
        next += 1;
    }
    found
}

/// Whether a part is there after `events`, those of its stage in the order of time.
fn is_present(part: &Part, events: &[EventSummary]) -> bool {
    let told =
        |event: &EventSummary| [true, false].into_iter().find(|present| event.what == event_text(&part.name, *present));
    events.iter().rev().find_map(told).unwrap_or(part.appears == Trigger::Always)
}

/// What passed the gates, and what the split cost.
fn stages_caption(summary: &Summary, panels: usize) -> String {
    let stages =
        if panels == 1 { "last state of a stage".to_owned() } else { format!("last states of {panels} stages") };
    let mut sentences = vec![format!("{}, {stages}.", summary.scene.name)];
    sentences.extend(summary.gates.iter().filter_map(gate_caption));
    if let Some(load) = &summary.load {
        let seconds = |time: f64| {
            // Three digits, as many as a processor time is good for.
            let places = (2.0 - time.log10().floor()).clamp(0.0, 3.0) as usize;
            format!("{time:.places$} s")
        };
        sentences.push(format!(
            "Processor time: upstream A = {} once, downstream B = {} a stage; split {}, unsplit (A + B) x {} = {}, ratio {:.2}.",
            seconds(load.upstream_cpu_s),
            seconds(load.downstream_cpu_s),
            seconds(load.split_cpu_s),
            load.downstream_runs,
            seconds(load.unsplit_forecast_cpu_s),
            load.ratio
        ));
    }
    sentences.join(" ")
}

/// How many crossings were recorded and how many arrived; `None` where no stream is there.
fn gate_caption(gate: &Value) -> Option<String> {
    let name = gate["name"].as_str()?;
    let crossings = gate["recorded"].as_array()?.first()?["stream"]["crossings"].as_u64()?;
    let replayed = gate["replayed"].as_array()?;
    let sum = |of: &dyn Fn(&Value) -> &Value| replayed.iter().filter_map(|one| of(one).as_u64()).sum::<u64>();
    if replayed.is_empty() {
        return Some(format!("Gate {name}: {crossings} crossings."));
    }
    let times = if replayed.len() == 1 { "once".to_owned() } else { format!("{} times", replayed.len()) };
    Some(format!(
        "Gate {name}: {crossings} crossings recorded once, replayed {times}; {} of {} arrived with the recorded bits.",
        sum(&|one| &one["arrivals"]["bit_equal"]),
        sum(&|one| &one["arrivals"]["recorded"]["count"])
    ))
}

fn slopes(scene: &Scene, particles: &[ParticleState]) -> Vec<SlopeLine> {
    let mut lines = Vec::new();
    for measure in &scene.measures {
        let MeasureKind::AngleOfRepose { region, along } = &measure.kind else { continue };
        let Ok(heap) = angle_of_repose(particles, scene.body, region, *along) else { continue };
        for flank in &heap.flanks {
            let place = |surface: SurfacePoint| {
                let mut point = Vec3::zeros();
                point[*along] = surface.position;
                point.z = surface.height;
                point
            };
            lines.push(SlopeLine {
                ends: [place(flank.upper), place(flank.lower)],
                label: format!("{:.1} \u{b1} {:.1}\u{b0}", flank.angle.to_degrees(), flank.uncertainty().to_degrees()),
            });
        }
    }
    lines
}

/// What the picture shows, with the measures that belong to a heap and its stream.
fn caption(scene: &Scene, result: &StageResult, measures: &[MeasureResult]) -> String {
    let mut parts = vec![format!("{}: {} particles at {:.3} s", scene.name, result.particles.len(), result.time)];
    for measure in measures {
        let told = scene.measures.iter().any(|asked| {
            asked.name == measure.name
                && matches!(asked.kind, MeasureKind::AngleOfRepose { .. } | MeasureKind::MassFlowRate { .. })
        });
        let (Some(value), Some(uncertainty), true) = (measure.value, measure.uncertainty, told) else { continue };
        // Two digits of the uncertainty, and the value to the same place.
        let places = (1.0 - uncertainty.abs().log10().floor()).clamp(0.0, 9.0) as usize;
        let name = measure.name.replace('_', " ");
        parts.push(format!("{name} {value:.places$} \u{b1} {uncertainty:.places$} {}", measure.unit));
    }
    parts.join("; ")
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    fn job(waits_for: &[usize]) -> StageJob {
        let scene = crate::scene::read_text(
            include_str!("../../templates/scene.default.toml"),
            "scene.toml",
            Path::new("."),
            &[],
        );
        StageJob { waits_for: waits_for.to_vec(), ..StageJob::uncut(&scene.unwrap().0) }
    }

    #[test]
    fn everything_upstream_is_found_once() {
        let jobs = [job(&[]), job(&[0]), job(&[0]), job(&[1, 2])];
        let mut found = ancestors(&jobs, &jobs[3]);
        found.sort_unstable();
        assert_eq!(found, [0, 1, 2]);
        assert!(ancestors(&jobs, &jobs[0]).is_empty());
    }

    #[test]
    fn a_part_is_there_as_its_last_event_says() {
        let mut part = job(&[]).scene.parts[0].clone();
        let event = |name: &str, present| EventSummary { time_s: 0.1, what: event_text(name, present) };
        let other = event("another", false);
        assert!(is_present(&part, std::slice::from_ref(&other)));
        assert!(!is_present(&part, &[event(&part.name, false), other.clone()]));
        part.appears = Trigger::At { time: 0.1 };
        assert!(!is_present(&part, &[other]));
        assert!(is_present(&part, &[event(&part.name, true)]));
    }

    #[test]
    fn the_caption_counts_every_replay() {
        let replayed = |count: u64, bits: u64| json!({"arrivals": {"recorded": {"count": count}, "bit_equal": bits}});
        let gate = |replayed: Vec<Value>| json!({"name": "outlet", "recorded": [{"stream": {"crossings": 9}}], "replayed": replayed});
        let caption = gate_caption(&gate(vec![replayed(9, 9), replayed(9, 7)])).unwrap();
        assert!(caption.contains("9 crossings recorded once, replayed 2 times; 16 of 18 arrived"), "{caption}");
        assert_eq!(gate_caption(&gate(Vec::new())).unwrap(), "Gate outlet: 9 crossings.");
        assert_eq!(gate_caption(&json!({"name": "outlet", "recorded": [], "replayed": []})), None);
    }
}
