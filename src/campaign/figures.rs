//! Pictures of a campaign: heap profiles of all variants on one axis, measures against each axis, load split against unsplit.

use super::CampaignError;
use super::file::Campaign;
use super::results::{Load, Results};
use super::status::State;
use super::task::{Graph, Run};
use super::variant::{Variant, columns, label, shown};
use super::workspace::Workspace;
use crate::analysis::angle_of_repose::angle_of_repose;
use crate::analysis::surface_profile::{SurfacePoint, surface_profile};
use crate::output::final_state;
use crate::report::figure::{Axis, Figure, Layer, Marks};
use crate::scene::{self, MeasureKind};
use crate::storage::staging::write_whole;
use std::collections::{BTreeMap, BTreeSet};
use std::path::PathBuf;

/// Profiles in one figure.
const MOST_PROFILES: usize = 60;
/// Names in a legend.
const MOST_NAMES: usize = 12;
/// Figures of measures.
const MOST_FIGURES: usize = 60;

/// Draws all figures into the workspace's folder `figures`; their places.
///
/// # Errors
/// When a stored state cannot be read, or the disk refuses.
pub fn draw(
    workspace: &Workspace,
    campaign: &Campaign,
    variants: &[Variant],
    graph: &Graph,
    states: &[State],
    results: &Results,
) -> Result<Vec<PathBuf>, CampaignError> {
    let mut figures = profiles(workspace, campaign, variants, graph, states, results)?;
    figures.extend(measures(campaign, variants, results));
    figures.extend(results.load.as_ref().map(|load| ("load".to_owned(), load_figure(campaign, load))));
    let mut places = Vec::new();
    for (name, figure) in figures {
        let place = workspace.root.join("figures").join(format!("{name}.svg"));
        write_whole(&place, figure.to_svg().as_bytes())?;
        places.push(place);
    }
    Ok(places)
}

/// The surface of one heap.
struct Profile {
    variant: usize,
    /// Points (place along the heap, height) [mm]; not a number where the surface has a gap.
    points: Vec<[f64; 2]>,
}

/// The heaps of one measure of an angle of repose.
#[derive(Default)]
struct Heaps {
    /// Horizontal axis: 0 = x, 1 = y.
    along: usize,
    profiles: Vec<Profile>,
}

/// The heaps of every measure of an angle of repose: replicate 1 of each variant.
fn profiles(
    workspace: &Workspace,
    campaign: &Campaign,
    variants: &[Variant],
    graph: &Graph,
    states: &[State],
    results: &Results,
) -> Result<Vec<(String, Figure)>, CampaignError> {
    let mut found: BTreeMap<String, Heaps> = BTreeMap::new();
    // Spread over all variants: more lines than can be told apart need not be read.
    let first = |run: &&Run| run.replicate == 1 && run.refused.is_none();
    let all: Vec<usize> = graph.runs.iter().filter(first).map(|run| run.variant).collect();
    let every = all.len().div_ceil(MOST_PROFILES).max(1);
    let drawn: BTreeSet<usize> = all.iter().copied().step_by(every).collect();
    for (run, index, _) in results.leaves(graph) {
        let (run, task) = (&graph.runs[run], &graph.tasks[index]);
        let State::Stored(folder) = &states[index] else { continue };
        let Some(file) = final_state::place(&workspace.place(&task.group(), folder)) else { continue };
        if run.replicate != 1 || !drawn.contains(&run.variant) {
            continue;
        }
        let Ok((scene, _)) = scene::read(&campaign.scene, &task.settings) else { continue };
        let particles = final_state::read(&file)?;
        for measure in &scene.measures {
            let MeasureKind::AngleOfRepose { region, along } = &measure.kind else { continue };
            let Ok(heap) = angle_of_repose(&particles, scene.body, region, *along) else { continue };
            let surface = surface_profile(&particles, region, *along, heap.bin_width);
            let point = |point: SurfacePoint| [1e3 * point.position, 1e3 * point.height];
            let points = surface.into_iter().map(|bin| bin.map_or([f64::NAN; 2], point)).collect();
            let name = if graph.is_cut { format!("{}.{}", task.stage, measure.name) } else { measure.name.clone() };
            let heaps = found.entry(name).or_default();
            heaps.along = *along;
            heaps.profiles.push(Profile { variant: run.variant, points });
        }
    }
    let figure = |(name, heaps): (String, Heaps)| {
        (format!("profiles-{}", file_name(&name)), profile_figure(campaign, variants, &name, heaps, all.len()))
    };
    Ok(found.into_iter().map(figure).collect())
}

/// Heaps of some of `all` variants on one axis, the colours in the order of the variants.
fn profile_figure(campaign: &Campaign, variants: &[Variant], name: &str, heaps: Heaps, all: usize) -> Figure {
    let columns = columns(campaign);
    let profiles = heaps.profiles;
    let count = profiles.len();
    let every = count.div_ceil(MOST_NAMES).max(1);
    let layer = |(place, profile): (usize, Profile)| Layer {
        label: if place % every == 0 { short_label(&columns, &variants[profile.variant]) } else { String::new() },
        colour: place,
        marks: Marks::Line(profile.points),
    };
    let shown = if count < all { format!("{count} of {all}") } else { format!("{count}") };
    Figure {
        title: format!("{}: surface of {name}", campaign.title),
        x: Axis { label: format!("{} [mm]", ["x", "y"][heaps.along]), ..Axis::default() },
        y: Axis { label: "z [mm]".to_owned(), ..Axis::default() },
        layers: profiles.into_iter().enumerate().map(layer).collect(),
        ordered_colours: count,
        caption: format!(
            "Highest sphere tops, medians across in bins of about one median diameter, at the end of the run; first replicate of {shown} variants."
        ),
    }
}

/// The name of a variant without the units, which the legend has no room for.
fn short_label(columns: &[&super::file::Column], variant: &Variant) -> String {
    match columns {
        [one] => format!("{} {}", shown(&variant.values[0]), one.unit),
        _ => label(columns, variant),
    }
}

/// Every figure that is a number against every axis that is numbers.
fn measures(campaign: &Campaign, variants: &[Variant], results: &Results) -> Vec<(String, Figure)> {
    let by_variant = results.by_variant();
    let mut figures = Vec::new();
    for (place, column) in columns(campaign).into_iter().enumerate() {
        if variants.iter().any(|variant| variant.values[place].number().is_none()) {
            continue;
        }
        for name in &results.measures {
            let point = |(variant, measured): &(usize, BTreeMap<String, _>)| {
                let figure: &crate::analysis::replicates::ReplicateFigure = measured.get(name)?;
                let half = figure.interval_95.map_or(0.0, |[low, high]| 0.5 * (high - low));
                Some([variants[*variant].values[place].number()?, figure.mean, half])
            };
            let points: Vec<[f64; 3]> = by_variant.iter().filter_map(point).collect();
            if points.len() < 2 || figures.len() >= MOST_FIGURES {
                continue;
            }
            let repeated = if campaign.replicates > 1 {
                format!("Means of {} replicates with 95 % intervals.", campaign.replicates)
            } else {
                "One replicate a variant: no interval.".to_owned()
            };
            let drawn = Figure {
                title: format!("{}: {name}", campaign.title),
                x: Axis { label: column.label(), ..Axis::default() },
                y: Axis { label: name.clone(), ..Axis::default() },
                layers: vec![Layer { label: String::new(), colour: 0, marks: Marks::Points(points) }],
                caption: repeated,
                ..Figure::default()
            };
            figures.push((format!("{}-over-{}", file_name(name), file_name(&column.name)), drawn));
        }
    }
    figures
}

/// Load over the number of downstream runs: after figure 8 of patent JP5440448B2.
fn load_figure(campaign: &Campaign, load: &Load) -> Figure {
    let account = &load.account;
    let (runs, a, b) = (account.downstream_runs as f64, account.upstream_cpu_s, account.downstream_cpu_s);
    let line = |first: f64, slope: f64| vec![[0.0, first], [runs, first + slope * runs]];
    let upstream = a * account.upstream_runs as f64;
    let split = line(upstream, account.median_downstream_cpu_s());
    let measured = vec![[runs, account.split_cpu_s, 0.0]];
    let mut layers = vec![
        Layer { label: "split: A X + B Y".to_owned(), colour: 0, marks: Marks::Line(split) },
        Layer { label: "unsplit: (A + B) Y".to_owned(), colour: 1, marks: Marks::DashedLine(line(0.0, a + b)) },
        Layer { label: "split, measured".to_owned(), colour: 0, marks: Marks::Points(measured) },
    ];
    let mut caption = format!(
        "A = {a:.1} s of processor time, run X = {} times; B = {b:.1} s in the mean, {:.1} s in the median, Y = {} times. Measured: split {:.1} s, {:+.1} % off A X + B Y with the median B; (A + B) Y is {:.2} times the measured split.",
        account.upstream_runs,
        account.median_downstream_cpu_s(),
        account.downstream_runs,
        account.split_cpu_s,
        100.0 * (account.split_cpu_s / account.split_forecast_cpu_s - 1.0),
        account.ratio
    );
    if let (Some(whole), Some(unsplit), Some(ratio)) = (load.whole_cpu_s, load.unsplit_cpu_s, load.ratio_measured) {
        layers.push(Layer {
            label: "unsplit, by measured whole runs".to_owned(),
            colour: 1,
            marks: Marks::Line(line(0.0, whole)),
        });
        caption += &format!(
            " {} whole runs took {whole:.1} s each on average: {unsplit:.1} s for all, {ratio:.2} times the measured split.",
            load.whole_runs
        );
    }
    Figure {
        title: format!("{}: load, split and unsplit", campaign.title),
        x: Axis { label: "downstream runs Y".to_owned(), range: Some([0.0, 1.04 * runs]), logarithmic: false },
        y: Axis { label: "processor time [s]".to_owned(), ..Axis::default() },
        layers,
        caption,
        ..Figure::default()
    }
}

/// A name that can stand in a file's.
fn file_name(name: &str) -> String {
    name.chars().map(|c| if c.is_ascii_alphanumeric() || "_.-".contains(c) { c } else { '_' }).collect()
}
