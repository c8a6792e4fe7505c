//! `tollgate run`: a scene end to end.

use super::{SceneArguments, print};
use std::path::PathBuf;
use std::sync::atomic::{AtomicBool, Ordering};
use tollgate::exit_code;
use tollgate::math::lanes::SimdLevel;
use tollgate::output::progress::Verbosity;
use tollgate::output::summary::Summary;
use tollgate::run::gates;
use tollgate::run::{RunError, RunReport, RunRequest, run as run_scene};

#[derive(Debug, clap::Args)]
pub struct Arguments {
    #[command(flatten)]
    scene: SceneArguments,
    /// Folder for the results, never overwritten [default: runs/<scene>]
    #[arg(long)]
    out: Option<PathBuf>,
    /// Threads; they change no bit of the result [default: one a physical core]
    #[arg(long, value_parser = super::threads)]
    threads: Option<usize>,
    /// Instruction set of the contact kernels: scalar, baseline, avx2 or avx512; it changes no bit of the result [default: the
    /// fastest there is]
    #[arg(long, value_parser = super::simd)]
    simd: Option<SimdLevel>,
    /// Start from another run's checkpoint, with its contacts
    #[arg(long, value_name = "CHECKPOINT")]
    from: Option<PathBuf>,
    /// Do not cut at the gates: each last stage with all that is upstream of it in one run
    #[arg(long)]
    whole: bool,
    /// Only this stage; may be repeated. What is upstream of it must have been run
    #[arg(long = "stage", value_name = "NAME")]
    stages: Vec<String>,
    /// Take stages from another run where their keys are the same; may be repeated
    #[arg(long, value_name = "RUN")]
    reuse: Vec<PathBuf>,
    /// Use streams although they do not fit the scene
    #[arg(long)]
    accept_stream: bool,
    /// Run so many times, each with the next seed (with --perturb: another particle moved)
    #[arg(long, default_value_t = 1, value_parser = clap::value_parser!(u64).range(1..=9999))]
    replicates: u64,
    /// Move one particle by this length at the start, as in 1nm
    #[arg(long, value_name = "LENGTH", value_parser = length)]
    perturb: Option<f64>,
    /// Continue an unfinished run: finished stages stay, an unfinished one goes on from its checkpoint
    #[arg(long)]
    resume: bool,
    /// Run although the plan refuses
    #[arg(long)]
    force: bool,
    /// Only say what would be run
    #[arg(long)]
    dry_run: bool,
    /// The summary as JSON on stdout, and nothing else
    #[arg(long)]
    json: bool,
    /// Progress lines also where stderr is no terminal
    #[arg(short, long)]
    verbose: bool,
}

/// Set by Ctrl-C: the run ends after its time step, with a checkpoint.
static INTERRUPTED: AtomicBool = AtomicBool::new(false);

pub fn run(arguments: &Arguments) -> u8 {
    if arguments.dry_run {
        return dry_run(arguments);
    }
    let noted = ctrlc::set_handler(|| INTERRUPTED.store(true, Ordering::Relaxed));
    if let Err(error) = noted {
        print::message(&format!("Ctrl-C will end the run without a last checkpoint ({error})"));
    }
    match run_scene(&request(arguments), &INTERRUPTED) {
        Ok(report) => {
            show(arguments, &report);
            report.summary.outcome.exit_code
        }
        Err(error) => {
            print::message(&explain(&arguments.scene, &error));
            error.exit_code()
        }
    }
}

fn length(text: &str) -> Result<f64, String> {
    let length = tollgate::scene::quantity_in(text, "m")?;
    if length > 0.0 { Ok(length) } else { Err("write a length above 0, as in 1nm".to_owned()) }
}

/// What the command line changes in the scene, `--from` included.
fn settings(arguments: &Arguments) -> Vec<(String, String)> {
    let mut settings = arguments.scene.all_settings();
    let from = arguments.from.as_ref().map(|path| std::path::absolute(path).unwrap_or_else(|_| path.clone()));
    settings.extend(from.map(|path| ("start_checkpoint".to_owned(), format!("{:?}", path.display().to_string()))));
    settings
}

fn request(arguments: &Arguments) -> RunRequest {
    let settings = settings(arguments);
    RunRequest {
        scene: arguments.scene.scene.clone(),
        settings,
        out: arguments.out.clone(),
        threads: arguments.threads,
        simd: arguments.simd,
        force: arguments.force,
        resume: arguments.resume,
        whole: arguments.whole,
        stages: arguments.stages.clone(),
        reuse: arguments.reuse.clone(),
        accept_stream: arguments.accept_stream,
        replicates: arguments.replicates,
        perturb: arguments.perturb,
        verbosity: match (arguments.json, arguments.verbose) {
            (true, _) => Verbosity::Silent,
            (false, true) => Verbosity::Verbose,
            (false, false) => Verbosity::Normal,
        },
    }
}

fn dry_run(arguments: &Arguments) -> u8 {
    super::plan::run(&super::plan::Arguments {
        scene: SceneArguments {
            settings: settings(arguments),
            seed: None,
            models: Vec::new(),
            backends: Vec::new(),
            ranks: None,
            ..arguments.scene.clone()
        },
        threads: arguments.threads,
        simd: arguments.simd,
        json: arguments.json,
    })
}

fn show(arguments: &Arguments, report: &RunReport) {
    if arguments.json {
        print::result(&serde_json::to_string_pretty(&report.summary).expect("a summary is plain numbers and names"));
        return;
    }
    if report.was_done {
        print::message("this run was done before; nothing was computed");
    }
    report.summary.warnings.iter().for_each(|warning| print::message(&format!("warning: {warning}")));
    print::result(&lines(&report.summary).join("\n"));
    if !report.timing.is_empty() {
        print::message(&report.timing);
    }
    let folder = report.folder.display();
    let names =
        ["summary.json", "series.csv", "frames.pvd", "dump.particles.lammpstrj", "picture.svg", "stages", "replicates"];
    let there: Vec<&str> = names.into_iter().filter(|name| report.folder.join(name).exists()).collect();
    print::result(&format!("results in {folder}: {}", there.join(", ")));
    if report.summary.outcome.exit_code == exit_code::INTERRUPTED {
        print::message(&format!("interrupted; go on with the same command and --resume (results so far in {folder})"));
    }
}

/// The summary in words.
fn lines(summary: &Summary) -> Vec<String> {
    let mut lines = Vec::new();
    let is_cut = summary.stages.len() > 1 || !summary.gates.is_empty();
    for stage in &summary.stages {
        // How each of several stages ended stands in its own summary.
        let ended = if is_cut { String::new() } else { format!("ended by {} ", summary.outcome.reason) };
        let time = if is_cut { stage.steps as f64 * stage.timestep_s } else { summary.outcome.time_s };
        lines.push(format!(
            "{}: {ended}at {time:.6} s after {} steps of {:.3e} s; {} particles; {:.1} s wall, {:.2} million particle steps a second",
            stage.name,
            stage.steps,
            stage.timestep_s,
            stage.particles,
            stage.wall_s,
            stage.particle_steps_per_s / 1e6
        ));
    }
    lines.extend(is_cut.then(|| summary.outcome.reason.clone()));
    lines.extend(gates::lines(&summary.gates));
    lines.extend(summary.load.iter().map(|load| {
        format!(
            "load: upstream A = {:.1} s x {}, downstream B = {:.1} s x {}; split {:.1} s of processor time, unsplit {:.1} s by forecast: {:.2} times",
            load.upstream_cpu_s,
            load.upstream_runs,
            load.downstream_cpu_s,
            load.downstream_runs,
            load.split_cpu_s,
            load.unsplit_forecast_cpu_s,
            load.ratio
        )
    }));
    for feed in &summary.feeds {
        let asked = match (feed.asked_count, feed.asked_mass_kg) {
            (Some(count), _) => format!("{count} particles asked"),
            (None, Some(mass)) => format!("{mass:.4} kg asked"),
            (None, None) => "no amount asked".to_owned(),
        };
        lines.push(format!(
            "feed '{}': {asked}, {} particles inserted ({:.4} kg)",
            feed.name, feed.inserted_count, feed.inserted_mass_kg
        ));
    }
    lines.extend(
        summary.removed.iter().map(|r| format!("left {}: {} particles, {:.4} kg", r.cause, r.count, r.mass_kg)),
    );
    lines.extend(summary.events.iter().map(|event| format!("{:.4} s: {}", event.time_s, event.what)));
    for (name, value) in &summary.measures {
        match value.as_f64() {
            Some(number) => lines.push(format!("{name}: {number:.5}")),
            None => lines.push(format!("{name}: {}", value.as_str().unwrap_or("no value"))),
        }
    }
    lines
}

/// An error in words, with the lines of the scene that it speaks of.
pub fn explain(scene: &SceneArguments, error: &RunError) -> String {
    match error {
        RunError::Scene(findings) => scene.rendered(findings),
        RunError::Refused(plan) => {
            format!("{}\nthe plan refuses this run; change the scene as it says, or --force it", plan.to_text())
        }
        other => other.to_string(),
    }
}
