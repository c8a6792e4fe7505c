//! Tasks: stages that must be computed, each once however many variants and replicates need it.

use super::CampaignError;
use super::file::Campaign;
use super::variant::{Variant, columns, label};
use crate::plan::Calibration;
use crate::plan::stages::stage_cost;
use crate::run::{Prepared, RunError, RunRequest, prepare_from};
use crate::scene::Source;
use crate::scene::backend::BackendName;
use std::collections::HashMap;

/// A stage that must be computed.
#[derive(Debug, Clone, PartialEq)]
pub struct Task {
    /// Key of the stage by what it is made of, hexadecimal.
    pub key: String,
    /// Key of what it writes and measures, hexadecimal.
    pub outputs_key: String,
    /// What it writes and measures: JSON.
    pub outputs: String,
    /// Name of the stage; of a whole run that of its last stage.
    pub stage: String,
    /// True where it is a whole run.
    pub is_whole: bool,
    /// Processor cores that it takes; `None` where it takes as many as it is given.
    pub cores: Option<usize>,
    /// Settings of the first variant and replicate that need it: dotted key, TOML value.
    pub settings: Vec<(String, String)>,
    /// Tasks whose streams it replays.
    pub upstream: Vec<usize>,
    /// True where nothing replays what leaves it.
    pub is_leaf: bool,
    /// What it is expected to cost.
    pub forecast: Forecast,
    /// How many variants and replicates need it.
    pub users: usize,
}

/// What a task is expected to cost; an upper bound, as [`stage_cost`] counts.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Forecast {
    /// Particles that will have been there.
    pub particles: f64,
    /// Particle steps.
    pub particle_steps: f64,
    /// Frames that it writes.
    pub frames: f64,
    /// Wall time on the threads of the calibration [s]; `None` without one.
    pub wall_s: Option<f64>,
    /// Memory [bytes]; `None` without a calibration.
    pub memory_bytes: Option<f64>,
}

impl Task {
    /// What groups it with tasks of its kind: the stage's name, marked where it is a whole run.
    #[must_use]
    pub fn group(&self) -> String {
        if self.is_whole { format!("{}.whole", self.stage) } else { self.stage.clone() }
    }

    /// Name of its files in the workspace.
    #[must_use]
    pub fn name(&self) -> String {
        format!("{}.{}", &self.key[..32], &self.outputs_key[..8])
    }
}

/// One variant with one seed.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct Run {
    /// Index of the variant.
    pub variant: usize,
    /// Its replicate, from 1.
    pub replicate: u64,
    /// Its seed.
    pub seed: u64,
    /// Why its scene cannot run; it has no tasks then.
    pub refused: Option<String>,
    /// Its tasks, one a stage, upstream first.
    pub tasks: Vec<usize>,
    /// Its whole runs, one a last stage; empty where it has none.
    pub whole: Vec<usize>,
}

/// Everything that a campaign consists of.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Graph {
    /// The tasks, upstream first.
    pub tasks: Vec<Task>,
    /// The runs, in the order of variants and replicates.
    pub runs: Vec<Run>,
    /// Whether the scene is cut: then measures are named after their stage.
    pub is_cut: bool,
}

/// A run before equal tasks are put together.
struct Expanded {
    seed: u64,
    split: Vec<Draft>,
    whole: Vec<Draft>,
    is_cut: bool,
}

/// A task whose upstream are places in its own run.
struct Draft {
    task: Task,
    upstream: Vec<usize>,
}

/// The tasks of the `chosen` variants of a campaign; wall times and memory only with a `calibration`.
///
/// # Errors
/// When the scenes of all of them are wrong, or cannot run: the first [`MOST_WRONG`]. One that is wrong among others is refused,
/// and stops nothing.
pub fn graph(
    campaign: &Campaign,
    variants: &[Variant],
    chosen: &[usize],
    calibration: Option<Calibration>,
) -> Result<Graph, CampaignError> {
    let whole = whole_runs(campaign, chosen);
    let source = Source::open(&campaign.scene).map_err(CampaignError::Findings)?;
    let expand = |variant: usize| expand(&source, campaign, &variants[variant], whole.contains(&variant), calibration);
    let expanded = in_parallel(chosen, &expand);
    let points = chosen.iter().flat_map(|variant| (1..=campaign.replicates).map(|replicate| (*variant, replicate)));
    let points: Vec<(usize, u64)> = points.collect();
    let mut graph = Graph::default();
    let mut known: HashMap<(String, String), usize> = HashMap::new();
    let mut wrong: Vec<(usize, RunError)> = Vec::new();
    for (result, (variant, replicate)) in expanded.into_iter().flatten().zip(&points) {
        let mut run = Run { variant: *variant, replicate: *replicate, ..Run::default() };
        match result {
            Ok(expanded) => {
                graph.is_cut = expanded.is_cut;
                run.seed = expanded.seed;
                run.tasks = graph.take(expanded.split, &mut known);
                run.whole = graph.take(expanded.whole, &mut known);
            }
            Err(error) => {
                run.refused = Some(error.to_string());
                wrong.push((*variant, error));
            }
        }
        graph.runs.push(run);
    }
    if wrong.len() < points.len() || points.is_empty() {
        return Ok(graph);
    }
    wrong.dedup_by_key(|(variant, _)| *variant);
    wrong.truncate(MOST_WRONG);
    let columns = columns(campaign);
    let labelled = wrong.into_iter().map(|(variant, error)| (label(&columns, &variants[variant]), error));
    Err(CampaignError::Variants(labelled.collect()))
}

/// Variants with wrong scenes that are told at once.
pub const MOST_WRONG: usize = 20;

/// Variants that are also run unsplit, spread over all that are chosen.
fn whole_runs(campaign: &Campaign, chosen: &[usize]) -> Vec<usize> {
    let wanted = (campaign.whole_runs as usize).min(chosen.len());
    let place = |k: usize| if wanted == 1 { 0 } else { k * (chosen.len() - 1) / (wanted - 1) };
    (0..wanted).map(|k| chosen[place(k)]).collect()
}

impl Graph {
    /// Adds the tasks of a run, or finds them; their places.
    fn take(&mut self, drafts: Vec<Draft>, known: &mut HashMap<(String, String), usize>) -> Vec<usize> {
        let mut places: Vec<usize> = Vec::new();
        for Draft { mut task, upstream } in drafts {
            let identity = (task.key.clone(), task.outputs_key.clone());
            let place = *known.entry(identity).or_insert_with(|| {
                task.upstream = upstream.iter().map(|index| places[*index]).collect();
                self.tasks.push(task);
                self.tasks.len() - 1
            });
            self.tasks[place].users += 1;
            places.push(place);
        }
        places
    }
}

/// All replicates of a variant.
fn expand(
    source: &Source,
    campaign: &Campaign,
    variant: &Variant,
    has_whole: bool,
    calibration: Option<Calibration>,
) -> Vec<Result<Expanded, RunError>> {
    let request = RunRequest {
        scene: campaign.scene.clone(),
        settings: variant.settings.clone(),
        replicates: 1,
        ..RunRequest::default()
    };
    let mut expanded = vec![
        prepare_from(source, &request)
            .and_then(|prepared| replicate(source, prepared, request.clone(), has_whole, calibration)),
    ];
    let first_seed = expanded[0].as_ref().map_or(0, |first| first.seed);
    for index in 1..campaign.replicates {
        let mut request = request.clone();
        request.settings.push(("seed".to_owned(), (first_seed + index).to_string()));
        expanded.push(
            prepare_from(source, &request)
                .and_then(|prepared| replicate(source, prepared, request, false, calibration)),
        );
    }
    expanded
}

fn replicate(
    source: &Source,
    prepared: Prepared,
    request: RunRequest,
    has_whole: bool,
    calibration: Option<Calibration>,
) -> Result<Expanded, RunError> {
    let split = drafts(&prepared, &request, calibration)?;
    let is_cut = prepared.scene.is_cut();
    let whole = if has_whole && is_cut {
        let request = RunRequest { whole: true, ..request };
        drafts(&prepare_from(source, &request)?, &request, calibration)?
    } else {
        Vec::new()
    };
    Ok(Expanded { seed: prepared.scene.seed, split, whole, is_cut })
}

fn drafts(prepared: &Prepared, request: &RunRequest, calibration: Option<Calibration>) -> Result<Vec<Draft>, RunError> {
    let recipes = prepared.recipes()?;
    let draft = |(index, recipe): (usize, crate::stage::key::StageKey)| {
        let job = &prepared.jobs[index];
        let cost = stage_cost(&prepared.scene, job, prepared.plan.timestep.chosen, calibration);
        let frames = job.scene.output.frame_interval.map_or(0.0, |interval| job.scene.end.time / interval + 1.0);
        let task = Task {
            key: recipe.key,
            outputs_key: recipe.outputs_key,
            outputs: recipe.outputs,
            stage: job.name.clone(),
            is_whole: request.whole,
            cores: (job.backend == BackendName::Liggghts).then_some(job.scene.liggghts.ranks as usize),
            settings: request.settings.clone(),
            upstream: Vec::new(),
            is_leaf: job.is_leaf,
            forecast: Forecast {
                particles: cost.particles,
                particle_steps: cost.particle_steps,
                frames,
                wall_s: cost.wall_s,
                memory_bytes: cost.memory_bytes,
            },
            users: 0,
        };
        Ok(Draft { task, upstream: prepared.upstream(index)? })
    };
    recipes.into_iter().enumerate().map(draft).collect()
}

/// `of` for each of `items`, on all cores, in their order.
fn in_parallel<I: Copy + Sync, O: Send>(items: &[I], of: &(dyn Fn(I) -> O + Sync)) -> Vec<O> {
    let threads = std::thread::available_parallelism().map_or(1, std::num::NonZero::get);
    let share = items.len().div_ceil(threads).max(1);
    std::thread::scope(|scope| {
        let work = |items: &'_ [I]| items.iter().map(|item| of(*item)).collect::<Vec<O>>();
        let handles: Vec<_> = items.chunks(share).map(|items| scope.spawn(move || work(items))).collect();
        let joined = handles.into_iter().flat_map(|handle| match handle.join() {
            Ok(found) => found,
            Err(panic) => std::panic::resume_unwind(panic),
        });
        joined.collect()
    })
}

#[cfg(test)]
mod tests {
    use super::super::file::read_text;
    use super::super::variant::variants;
    use super::*;
    use std::path::Path;

    /// Two axes that share nothing, one whose values meet the same part, and one with a value that no scene may have.
    const CAMPAIGN: &str = "version = 1\nreplicates = 2\n\
        [[axis]]\nname = \"tilt\"\nkeys = \"part.chute.place.rotate.angle\"\nunit = \"deg\"\nvalues = [30, 40, 0, -0.0]\n\
        [[axis]]\nname = \"lift\"\nkeys = \"part.chute.place.move_mm\"\nvalues = [[0, 0, 150], [0, -0.0, 150]]\n\
        [[axis]]\nname = \"friction\"\nkeys = \"pair.sinter-steel.friction\"\nvalues = [0.5, 0.25, -1]\n";

    fn identities(graph: &Graph, run: &Run) -> Vec<(String, String, String)> {
        let identity = |index: &usize| {
            let task = &graph.tasks[*index];
            (task.group(), format!("{} {}", task.key, task.outputs_key), format!("{:?}", task.forecast))
        };
        run.tasks.iter().map(identity).collect()
    }

    #[test]
    fn variants_together_have_the_tasks_that_each_has_alone() {
        let campaign =
            read_text(CAMPAIGN, Path::new("examples/chute-tilt-campaign/campaign.toml")).expect("a campaign");
        let variants = variants(&campaign);
        let all: Vec<usize> = (0..variants.len()).collect();
        let together = graph(&campaign, &variants, &all, None).expect("most of them can run");
        let mut keys = std::collections::BTreeSet::new();
        for &variant in &all {
            let of_variant: Vec<&Run> = together.runs.iter().filter(|run| run.variant == variant).collect();
            assert_eq!(of_variant.len(), 2);
            match graph(&campaign, &variants, &[variant], None) {
                Ok(alone) => {
                    for (run, other) in of_variant.iter().zip(&alone.runs) {
                        assert_eq!(run.refused, None);
                        assert_eq!(run.seed, other.seed);
                        assert_eq!(identities(&together, run), identities(&alone, other));
                        keys.extend(run.tasks.iter().map(|index| together.tasks[*index].name()));
                    }
                }
                Err(CampaignError::Variants(wrong)) => {
                    assert_eq!(of_variant[0].refused, Some(wrong[0].1.to_string()));
                }
                Err(other) => panic!("{other}"),
            }
        }
        assert_eq!(together.runs.iter().filter(|run| run.refused.is_some()).count(), 4 * 2 * 2);
        assert_eq!(keys.len(), together.tasks.len());
    }
}
