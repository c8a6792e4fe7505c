//! Plans of the stages of a scene that is cut at gates. All of them step as the whole scene would.

use super::cost::{self, CostForecast};
use super::gates::{self, GateAdvice};
use super::{Calibration, Plan, Terms, plan, plan_on};
use crate::scene::Scene;
use crate::scene::gate::StreamSource;
use crate::scene::layout::Layout;
use crate::stage::split::{StageJob, stage_jobs};
use serde::Serialize;
use std::borrow::Cow;
use std::path::PathBuf;

/// What follows from a scene with stages.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct SplitPlan {
    /// Each stage, upstream first.
    pub stages: Vec<Plan>,
    /// What is known about each gate before it has run.
    pub gates: Vec<GateAdvice>,
    /// What the split is expected to cost and to save.
    pub load: LoadForecast,
}

/// Load split against unsplit in particle steps, after figure 8 of patent JP5440448B2: A X + B Y against (A + B) max(X, Y).
/// An upper bound for every stage: particles count from their start to its end, the time before they pass a gate included.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct LoadForecast {
    /// A: of the stages that something follows, each run once (X = 1).
    pub upstream_particle_steps: f64,
    /// Sum of B over the stages that nothing follows (B Y).
    pub downstream_particle_steps: f64,
    /// Y: their number.
    pub downstream_runs: u64,
    /// Wall time of the split run [s]; `None` without a calibration.
    pub split_wall_s: Option<f64>,
    /// Wall time of the same without stored streams [s]; `None` without a calibration.
    pub unsplit_wall_s: Option<f64>,
}

impl LoadForecast {
    fn of(jobs: &[StageJob], plans: &[Plan]) -> Self {
        let of = |leaf: bool| jobs.iter().zip(plans).filter(move |(job, _)| job.is_leaf == leaf).map(|(_, plan)| plan);
        let steps = |leaf: bool| of(leaf).map(|plan| plan.cost.particle_steps).sum::<f64>();
        let wall = |leaf: bool| of(leaf).map(|plan| plan.cost.wall_s).sum::<Option<f64>>();
        let runs = of(true).count() as u64;
        Self {
            upstream_particle_steps: steps(false),
            downstream_particle_steps: steps(true),
            downstream_runs: runs,
            split_wall_s: wall(false).zip(wall(true)).map(|(a, b)| a + b),
            unsplit_wall_s: wall(false).zip(wall(true)).map(|(a, b)| a * runs as f64 + b),
        }
    }

    fn to_text(&self) -> String {
        let (a, b, runs) = (self.upstream_particle_steps, self.downstream_particle_steps, self.downstream_runs);
        let mean = b / runs.max(1) as f64;
        let mut text = format!(
            "load, at most\n  upstream    {a:.3e} particle steps x 1\n  downstream  {mean:.3e} particle steps x {runs}\n  \
             split       {:.3e}, unsplit {:.3e}: {:.2} times\n",
            a + b,
            a * runs as f64 + b,
            (a * runs as f64 + b) / (a + b)
        );
        if let (Some(split), Some(unsplit)) = (self.split_wall_s, self.unsplit_wall_s) {
            text += &format!("  wall_time   split {:.1} min, unsplit {:.1} min\n", split / 60.0, unsplit / 60.0);
        }
        text
    }
}

impl SplitPlan {
    /// The plans of a scene's stages; wall time and memory only with a `calibration`.
    #[must_use]
    pub fn of(scene: &Scene, calibration: Option<Calibration>) -> Self {
        let timestep = plan(scene, None).timestep.chosen;
        let jobs = stage_jobs(scene);
        let stages: Vec<Plan> = jobs.iter().map(|job| plan_stage(scene, job, timestep, calibration)).collect();
        Self { load: LoadForecast::of(&jobs, &stages), stages, gates: gates::advise(scene) }
    }

    /// Whether a stage must not start unless it is forced.
    #[must_use]
    pub fn is_refused(&self) -> bool {
        self.stages.iter().any(Plan::is_refused)
    }

    /// All of it as text for a terminal, a block for each stage and one for the gates.
    #[must_use]
    pub fn to_text(&self) -> String {
        let mut blocks: Vec<String> = self.stages.iter().map(Plan::to_text).collect();
        blocks.extend((!self.gates.is_empty()).then(|| gates::to_text(&self.gates)));
        blocks.push(self.load.to_text());
        blocks.join("\n")
    }
}

/// What follows from one stage of `whole`, or from a whole run of it, at the time step of all [s].
///
/// What comes through gates counts as if its feeds were here: particles can be as large, as fast and as many as those feeds
/// make them, whatever they lose on their way.
#[must_use]
pub fn plan_stage(whole: &Scene, job: &StageJob, timestep: f64, calibration: Option<Calibration>) -> Plan {
    let fed = fed(whole, job);
    let passages = passages(whole, job);
    let terms = Terms { timestep: Some(timestep), passages: Some(&passages), calibration };
    Plan { stage: Some(job.name.clone()), ..plan_on(&fed, &job.scene, &terms) }
}

/// What one stage costs: that of [`plan_stage`] alone, which is all that a campaign wants to know of ten thousand stages.
#[must_use]
pub fn stage_cost(whole: &Scene, job: &StageJob, timestep: f64, calibration: Option<Calibration>) -> CostForecast {
    let fed = fed(whole, job);
    let supply = cost::supply(&fed, Some(&passages(whole, job)));
    cost::forecast(&fed, &supply, timestep, calibration)
}

/// The scene of a job with the feeds whose particles come through gates.
fn fed<'a>(whole: &Scene, job: &'a StageJob) -> Cow<'a, Scene> {
    let mut fed = Cow::Borrowed(&job.scene);
    for feed in &job.upstream_feeds {
        fed.to_mut().feeds[*feed].clone_from(&whole.feeds[*feed]);
    }
    let has_stored = job.replays.iter().any(|replay| matches!(replay.source, StreamSource::Folder(_)));
    if has_stored && fed.start_checkpoint.is_none() {
        // Nothing is known about these particles either but that they belong to the classes.
        fed.to_mut().start_checkpoint = Some(PathBuf::new());
    } else if !job.replays.is_empty() {
        fed.to_mut().start_checkpoint.clone_from(&whole.start_checkpoint);
    }
    fed
}

/// How often the particles of each feed come into a job: once from its own, through a gate once for each loop.
fn passages(whole: &Scene, job: &StageJob) -> Vec<f64> {
    let layout = Layout::of(whole);
    let mut found = vec![0.0; whole.feeds.len()];
    job.own_feeds.iter().for_each(|feed| found[*feed] += 1.0);
    for replay in &job.replays {
        let StreamSource::Gate(gate) = replay.source else { continue };
        for recorder in layout.recorders(gate) {
            through(&layout, recorder, replay.loops as f64, &mut found);
        }
    }
    found
}

/// Adds what leaves `stage`, `times` over.
fn through(layout: &Layout<'_>, stage: usize, times: f64, found: &mut [f64]) {
    layout.feeds_of(stage).iter().for_each(|feed| found[*feed] += times);
    for replay in &layout.stages[stage].replays {
        let StreamSource::Gate(gate) = replay.source else { continue };
        for recorder in layout.recorders(gate) {
            through(layout, recorder, times * replay.loops as f64, found);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::stage::split::whole_jobs;

    const GATES: &str = include_str!("../../tests/scenes/good/gates.toml");

    fn scene(settings: &[(&str, &str)]) -> Scene {
        let settings: Vec<_> = settings.iter().map(|(key, value)| ((*key).to_owned(), (*value).to_owned())).collect();
        let base = std::path::Path::new("tests/scenes/good");
        crate::scene::read_text(GATES, "gates.toml", base, &settings).expect("a valid scene").0
    }

    fn stage(scene: &Scene, name: &str) -> Plan {
        let plans = SplitPlan::of(scene, None);
        plans.stages.into_iter().find(|plan| plan.stage.as_deref() == Some(name)).expect("a stage")
    }

    #[test]
    fn all_stages_step_as_the_whole_scene() {
        let scene = scene(&[]);
        let whole = plan(&scene, None).timestep.chosen;
        let plans = SplitPlan::of(&scene, None);
        assert_eq!(plans.stages.len(), 4);
        assert!(plans.stages.iter().all(|plan| plan.timestep.chosen == whole && plan.timestep.of_whole));
        assert!(plans.to_text().contains("plan of gates, stage chute\n"), "{}", plans.to_text());
    }

    #[test]
    fn a_stage_without_feeds_knows_what_its_streams_bring() {
        let scene = scene(&[]);
        let particles = |name: &str| stage(&scene, name).cost.particles;
        assert_eq!(particles("hopper"), 300.0);
        assert_eq!(particles("chute"), 300.0);
        assert_eq!(particles("plate"), 3.0 * 300.0, "three loops");
        // Its own stream brings 20 a second for half a second; nothing is known about the stored one.
        assert_eq!(particles("box"), 300.0 + 10.0);
        let chute = stage(&scene, "chute");
        assert!(chute.is_on("sliding_friction") && chute.timestep.binding.is_some());
        assert_eq!(chute.cost.feeds.iter().map(|feed| feed.name.as_str()).collect::<Vec<_>>(), ["fill"]);
        let contact = chute.overlap.expect("a contact").contact;
        assert!(contact.contains("ore"), "{contact}");
    }

    #[test]
    fn a_stage_costs_what_its_plan_says() {
        let scene = scene(&[]);
        let calibration = Calibration {
            particle_steps_per_second_dense: 1e7,
            particle_steps_per_second_dilute: 3e7,
            bytes_per_particle: 600.0,
            base_bytes: 2e6,
            threads: 2,
        };
        for job in stage_jobs(&scene).iter().chain(&whole_jobs(&scene)) {
            for calibration in [None, Some(calibration)] {
                let plan = plan_stage(&scene, job, 2e-6, calibration);
                assert_eq!(stage_cost(&scene, job, 2e-6, calibration), plan.cost, "{}", job.name);
            }
        }
    }

    #[test]
    fn a_whole_run_has_the_particles_of_all_its_stages() {
        let scene = scene(&[]);
        let step = plan(&scene, None).timestep.chosen;
        let particles: Vec<f64> =
            whole_jobs(&scene).iter().map(|job| plan_stage(&scene, job, step, None).cost.particles).collect();
        assert_eq!(particles, [300.0, 310.0]);
    }

    #[test]
    fn impacts_are_as_fast_as_a_fall_from_the_feed_above_the_gate() {
        // From the top of the fill (690 mm) to the lower face of the plate (440 mm).
        let speed = (2.0_f64 * 9.81 * 0.25).sqrt();
        let plan = stage(&scene(&[]), "plate");
        assert!((plan.impact.particle_speed - speed).abs() < 1e-9 * speed, "{:?}", plan.impact);
        // Of a stored stream nothing is known but the domain, which is 800 mm high and ends in the box at 100 mm.
        let plan = stage(&scene(&[]), "box");
        let speed = (2.0_f64 * 9.81 * 0.7).sqrt();
        assert!((plan.impact.particle_speed - speed).abs() < 1e-9 * speed, "{:?}", plan.impact);
    }
}
