//! `tollgate campaign`: many variants of a scene.

use super::print;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;
use tollgate::backend::native;
use tollgate::campaign::claim::Watch;
use tollgate::campaign::file::{self, Campaign};
use tollgate::campaign::results::Results;
use tollgate::campaign::scheduler::{Board, Outcome, Rerun, local, slurm};
use tollgate::campaign::slurm::{Commands, Site};
use tollgate::campaign::status::{State, states, tally};
use tollgate::campaign::task::{Graph, graph};
use tollgate::campaign::variant::{Variant, chosen, columns, label, variants};
use tollgate::campaign::work::{Ended, work};
use tollgate::campaign::workspace::{Contents, Workspace};
use tollgate::campaign::{CampaignError, clean, figures, reason, results};
use tollgate::exit_code;
use tollgate::math::lanes::SimdLevel;
use tollgate::output::progress::Verbosity;
use tollgate::output::tally::Tally;
use tollgate::plan::{self, Calibration};
use tollgate::scene::diagnostics::render;

#[derive(Debug, clap::Args)]
pub struct Arguments {
    #[command(subcommand)]
    verb: Verb,
}

#[derive(Debug, clap::Subcommand)]
enum Verb {
    /// Compute every variant, each stage once
    Run(Run),
    /// Where the campaign stands
    Status(Status),
    /// Remove results that no variant refers to any more
    Clean(Clean),
    /// Compute one stage of a campaign: what `run` starts
    #[command(hide = true)]
    Task(Task),
}

#[derive(Debug, clap::Args)]
struct Place {
    /// Campaign file, or a folder that holds a campaign.toml
    file: PathBuf,
    /// Folder of the campaign's results [default: runs/<campaign>]
    #[arg(long)]
    out: Option<PathBuf>,
}

#[derive(Debug, clap::Args)]
struct Run {
    #[command(flatten)]
    place: Place,
    /// Stages at a time [default: one a physical core]
    #[arg(long, value_parser = super::threads)]
    jobs: Option<usize>,
    /// Only these variants: a number, a range such as 2-5, or NAME=VALUE; may be repeated
    #[arg(long, value_name = "WHICH")]
    only: Vec<String>,
    /// Compute again what failed, or what lacks outputs that are asked for now; may be repeated
    #[arg(long, value_name = "failed|outputs", value_parser = ["failed", "outputs"])]
    rerun: Vec<String>,
    /// Go on with stages that were begun and have not ended
    #[arg(long)]
    resume: bool,
    /// Who starts the stages: this computer, or a cluster with Slurm
    #[arg(long, value_name = "local|slurm", value_parser = ["local", "slurm"], default_value = "local")]
    scheduler: String,
    /// With --scheduler slurm: file with account, partition, modules and wall time (docs/slurm.md)
    #[arg(long, value_name = "FILE")]
    site: Option<PathBuf>,
    /// Only say what would be computed, what is used again, and why
    #[arg(long)]
    dry_run: bool,
    /// With --dry-run: as JSON on stdout, every stage of every variant
    #[arg(long, requires = "dry_run")]
    json: bool,
    /// Progress lines also where stderr is no terminal
    #[arg(short, long)]
    verbose: bool,
}

#[derive(Debug, clap::Args)]
struct Status {
    #[command(flatten)]
    place: Place,
}

#[derive(Debug, clap::Args)]
struct Clean {
    #[command(flatten)]
    place: Place,
    /// Only say what would be removed, and how much that frees
    #[arg(long)]
    dry_run: bool,
}

#[derive(Debug, clap::Args)]
struct Task {
    /// Folder of the campaign's results
    workspace: PathBuf,
    /// Name of the task
    name: String,
    /// Threads [default: one a physical core]
    #[arg(long, value_parser = super::threads)]
    threads: Option<usize>,
    /// Instruction set of the contact kernels [default: the fastest there is]
    #[arg(long, value_parser = super::simd)]
    simd: Option<SimdLevel>,
    /// Process that this one belongs to: when it ends, so does this one, with a checkpoint
    #[arg(long)]
    parent: Option<i32>,
}

/// Wall time for each lattice of the calibration: a forecast to a tenth is enough to plan with.
const CALIBRATION: Duration = Duration::from_millis(100);

/// Set by Ctrl-C, or by the system's request to end.
static INTERRUPTED: AtomicBool = AtomicBool::new(false);

pub fn run(arguments: &Arguments) -> u8 {
    let result = match &arguments.verb {
        Verb::Run(run) => compute(run),
        Verb::Status(status) => tell(status),
        Verb::Clean(clean) => remove(clean),
        Verb::Task(task) => compute_one(task),
    };
    result.unwrap_or_else(|error| {
        print::message(&explain(&error));
        error.exit_code()
    })
}

fn explain(error: &CampaignError) -> String {
    match error {
        CampaignError::Findings(findings) => {
            let source = findings.first().map(|finding| std::fs::read_to_string(&finding.file).unwrap_or_default());
            render(findings, &source.unwrap_or_default())
        }
        CampaignError::Variants(variants) => format!("{error}\n{} variants cannot run", variants.len()),
        other => other.to_string(),
    }
}

/// A campaign, its variants, and its folder.
struct Opened {
    campaign: Campaign,
    variants: Vec<Variant>,
    workspace: Workspace,
}

fn open(place: &Place) -> Result<Opened, CampaignError> {
    let campaign = file::read(&place.file)?;
    let root = place.out.clone().unwrap_or_else(|| Path::new("runs").join(&campaign.name));
    let workspace = Workspace::at(&root, &campaign)?;
    Ok(Opened { variants: variants(&campaign), campaign, workspace })
}

impl Opened {
    fn all(&self) -> Vec<usize> {
        (0..self.variants.len()).collect()
    }

    fn graph(&self, chosen: &[usize], calibration: Option<Calibration>) -> Result<Graph, CampaignError> {
        graph(&self.campaign, &self.variants, chosen, calibration)
    }

    /// How fast this computer is with the campaign's laws; `None` where its scene cannot be read, which others tell.
    fn calibration(&self) -> Option<Calibration> {
        let settings = self.variants.first().map_or(&[][..], |variant| &variant.settings);
        let (scene, _) = tollgate::scene::read(&self.campaign.scene, settings).ok()?;
        let processor = native::processor::Processor::new(Some(1), None);
        native::calibrate::calibrate(&scene, &plan::plan(&scene, None), processor, CALIBRATION)
    }
}

fn compute(run: &Run) -> Result<u8, CampaignError> {
    let opened = open(&run.place)?;
    let Opened { campaign, variants, workspace } = &opened;
    let chosen = chosen(&columns(campaign), variants, &run.only).map_err(CampaignError::Request)?;
    // What was measured in earlier runs tells more than a calibration, which takes a second.
    let is_known = !Contents::of(workspace).stages.is_empty();
    let calibration = if run.dry_run && is_known { None } else { opened.calibration() };
    let graph = opened.graph(&chosen, calibration)?;
    let rerun = Rerun {
        failed: run.rerun.iter().any(|what| what == "failed"),
        outputs: run.rerun.iter().any(|what| what == "outputs"),
        resume: run.resume,
    };
    if run.dry_run {
        let dry = reason::dry_run(workspace, campaign, variants, chosen.len(), &graph, rerun);
        if run.json {
            print::result(&serde_json::to_string_pretty(&dry).expect("a dry run is plain numbers and names"));
        } else {
            print::result(&dry.to_text());
        }
        return Ok(exit_code::DONE);
    }
    let site = site(run)?;
    workspace.make(campaign)?;
    let noted = ctrlc::set_handler(|| INTERRUPTED.store(true, Ordering::Relaxed));
    if let Err(error) = noted {
        print::message(&format!("Ctrl-C will end the campaign without last checkpoints ({error})"));
    }
    let program = std::env::current_exe().unwrap_or_else(|_| PathBuf::from("tollgate"));
    let board = Board::new(workspace, campaign, &graph, rerun);
    let mut tally = Tally::on_stderr(if run.verbose { Verbosity::Verbose } else { Verbosity::Normal });
    let outcome = if let Some(site) = site {
        let commands = Commands::default().with_interrupt(&INTERRUPTED);
        slurm::run(board, &slurm::Request { site, commands, program }, &mut tally, &INTERRUPTED)?
    } else {
        local::run(board, &local::Request { jobs: run.jobs, program }, &mut tally, &INTERRUPTED)?
    };
    drop(tally);
    let results = results::collect(workspace, &graph, &outcome.states)?;
    results.write(workspace, campaign, variants)?;
    let figures = figures::draw(workspace, campaign, variants, &graph, &outcome.states, &results)?;
    show(&opened, &graph, &outcome, &results, figures.len());
    Ok(outcome.exit_code())
}

/// What the cluster wants to know, where it is to compute.
fn site(run: &Run) -> Result<Option<Site>, CampaignError> {
    match (run.scheduler.as_str(), &run.site) {
        ("slurm", Some(site)) => Site::read(site).map(Some).map_err(CampaignError::Findings),
        ("slurm", None) => Err(CampaignError::Request(
            "--scheduler slurm needs --site FILE, which says at least the wall time (docs/slurm.md)".to_owned(),
        )),
        (_, Some(_)) => Err(CampaignError::Request("--site goes with --scheduler slurm".to_owned())),
        (_, None) => Ok(None),
    }
}

fn show(opened: &Opened, graph: &Graph, outcome: &Outcome, results: &Results, figures: usize) {
    let Opened { campaign, variants, workspace } = opened;
    print::result(&counts(graph, &outcome.states));
    let columns = columns(campaign);
    for row in results.rows.iter().filter(|row| row.status != "done") {
        let which = label(&columns, &variants[row.variant]);
        print::message(&format!("{}: {which}, replicate {}: {}", row.status, row.replicate, row.reason));
    }
    if let Some(load) = &results.load {
        print::result(&load.to_text());
    }
    let done = results.rows.iter().filter(|row| row.status == "done").count();
    print::result(&format!(
        "{done} of {} runs done; results in {}: results.csv, summary.csv, figures ({figures})",
        results.rows.len(),
        workspace.root.display()
    ));
    if let Some(reason) = &outcome.stopped {
        print::message(&format!("{reason}\nno further stage was started; when that is mended, go on with --resume"));
    } else if outcome.was_interrupted {
        print::message("interrupted; go on with the same command and --resume (jobs of a cluster go on by themselves)");
    } else if outcome.states.iter().any(|state| matches!(state, State::Failed(_))) {
        print::message("compute failed ones again with --rerun failed");
    }
}

fn counts(graph: &Graph, states: &[State]) -> String {
    let lines = tally(graph, states).into_iter().map(|((group, word), count)| format!("{group}: {count} {word}"));
    lines.collect::<Vec<_>>().join("\n")
}

fn tell(status: &Status) -> Result<u8, CampaignError> {
    let opened = open(&status.place)?;
    let graph = opened.graph(&opened.all(), None)?;
    let states = states(&opened.workspace, &graph, &mut Watch::default());
    print::result(&counts(&graph, &states));
    let columns = columns(&opened.campaign);
    let mut told = 0;
    for run in &graph.runs {
        if let Some(refusal) = &run.refused {
            told += 1;
            if told <= MOST_TOLD {
                print::result(&format!("refused: {}: {refusal}", label(&columns, &opened.variants[run.variant])));
            }
        }
        for index in run.tasks.iter().chain(&run.whole) {
            let text = match &states[*index] {
                State::Failed(failure) => format!("exit {}: {}", failure.exit_code, failure.reason),
                State::Running(holder) => format!("process {} on {}", holder.process, holder.host),
                _ => continue,
            };
            told += 1;
            if told <= MOST_TOLD {
                let (task, which) = (&graph.tasks[*index], label(&columns, &opened.variants[run.variant]));
                print::result(&format!("{} {}: {which}: {text}", states[*index].word(), task.group()));
            }
        }
    }
    if told > MOST_TOLD {
        print::result(&format!("... and {} more", told - MOST_TOLD));
    }
    let is_wrong = |state: &State| matches!(state, State::Failed(_) | State::HeldUp(_));
    let has_failed = states.iter().any(is_wrong) || graph.runs.iter().any(|run| run.refused.is_some());
    let place = opened.workspace.root.display();
    print::result(&format!("results in {place}, {} on disk", megabytes(results::size_of(&opened.workspace.root))));
    Ok(if has_failed { exit_code::VARIANTS_FAILED } else { exit_code::DONE })
}

/// Failures and running stages that `status` tells in full.
const MOST_TOLD: usize = 20;

fn megabytes(bytes: u64) -> String {
    format!("{:.1} MB", bytes as f64 / 1e6)
}

fn remove(arguments: &Clean) -> Result<u8, CampaignError> {
    let opened = open(&arguments.place)?;
    let graph = opened.graph(&opened.all(), None)?;
    let found = clean::unreferenced(&opened.workspace, &graph);
    for one in &found {
        print::result(&format!("{} ({})", one.place.display(), megabytes(one.bytes)));
    }
    let bytes = megabytes(found.iter().map(|one| one.bytes).sum());
    if arguments.dry_run {
        print::result(&format!("{} results that no variant refers to; removing them frees {bytes}", found.len()));
    } else {
        clean::remove(&found)?;
        print::result(&format!("removed {} results that no variant refers to: {bytes} freed", found.len()));
    }
    Ok(exit_code::DONE)
}

fn compute_one(task: &Task) -> Result<u8, CampaignError> {
    if let Some(parent) = task.parent {
        // Asked for before looking, so that a parent that ends in between is not missed.
        let asked = rustix::process::set_parent_process_death_signal(Some(rustix::process::Signal::TERM));
        let is_orphan = rustix::process::getppid().is_none_or(|now| now.as_raw_nonzero().get() != parent);
        if asked.is_ok() && is_orphan {
            return Ok(exit_code::INTERRUPTED);
        }
    }
    if let Err(error) = ctrlc::set_handler(|| INTERRUPTED.store(true, Ordering::Relaxed)) {
        print::message(&format!("an interruption will end this stage without a last checkpoint ({error})"));
    }
    let workspace = Workspace::existing(&task.workspace)?;
    let ended = work(&workspace, &task.name, task.threads, task.simd, &INTERRUPTED)?;
    match &ended {
        Ended::Failed(failure) => print::message(&failure.reason),
        Ended::Elsewhere => print::message("another process is computing it"),
        Ended::Done | Ended::Interrupted => {}
    }
    Ok(ended.exit_code())
}
