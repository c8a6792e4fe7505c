//! The command line: one file a subcommand; no physics.

mod campaign;
mod check;
mod compare;
mod deck;
mod doctor;
mod init;
mod plan;
mod run;
mod stream;
mod verify;

use clap::{Args, Parser, Subcommand};
use std::path::PathBuf;
use std::process::ExitCode;
use tollgate::exit_code;
use tollgate::math::lanes::SimdLevel;
use tollgate::scene::Finding;
use tollgate::scene::diagnostics::render;

/// Discrete element (DEM) simulations of plants, stage by stage.
#[derive(Debug, Parser)]
#[command(version, max_term_width = 100)]
struct Cli {
    #[command(subcommand)]
    verb: Verb,
}

#[derive(Debug, Subcommand)]
enum Verb {
    /// Write a commented scene that runs
    Init(init::Arguments),
    /// Check a scene: all findings at once, with what to do next
    Check(check::Arguments),
    /// Say what follows from a scene: models, time-step limits, cost
    Plan(plan::Arguments),
    /// Run a scene
    Run(run::Arguments),
    /// Run many variants of a scene, every stage that they share once
    Campaign(campaign::Arguments),
    /// Render the decks of an external code, without running them
    Deck(deck::Arguments),
    /// Compare two sets of runs: differences with 95 % intervals, and a verdict
    Compare(compare::Arguments),
    /// Say what is installed, what it can do, and what to install
    Doctor(doctor::Arguments),
    /// Show, check, export, import or move what was recorded at a gate
    Stream(stream::Arguments),
    /// Verify the solver against closed forms and published benchmarks
    Verify(verify::Arguments),
}

/// The scene, and what is changed in it.
#[derive(Debug, Clone, Args)]
struct SceneArguments {
    /// Scene file, or the folder that holds scene.toml
    scene: PathBuf,
    /// Change a key of the scene, as in `part.chute.material=steel`; may be repeated
    #[arg(long = "set", value_name = "KEY=VALUE", value_parser = key_and_value)]
    settings: Vec<(String, String)>,
    /// Seed of every random draw
    #[arg(long, value_parser = clap::value_parser!(u64).range(..=i64::MAX as u64))]
    seed: Option<u64>,
    /// Force a model on or off; may be repeated
    #[arg(long = "model", value_name = "NAME=on|off", value_parser = model_and_state)]
    models: Vec<(String, bool)>,
    /// Who computes stages that do not say it themselves: native or liggghts; STAGE=NAME for one stage; may be repeated
    #[arg(long = "backend", value_name = "[STAGE=]NAME")]
    backends: Vec<String>,
    /// MPI ranks of LIGGGHTS
    #[arg(long = "np", value_name = "N", value_parser = clap::value_parser!(u32).range(1..=4096))]
    ranks: Option<u32>,
}

fn key_and_value(text: &str) -> Result<(String, String), String> {
    let (key, value) = text.split_once('=').ok_or("write KEY=VALUE, as in seed=7")?;
    Ok((key.trim().to_owned(), value.trim().to_owned()))
}

fn model_and_state(text: &str) -> Result<(String, bool), String> {
    match text.split_once('=') {
        Some((name, "on")) => Ok((name.to_owned(), true)),
        Some((name, "off")) => Ok((name.to_owned(), false)),
        _ => Err("write NAME=on or NAME=off, as in rolling_resistance=off".to_owned()),
    }
}

/// Most threads that can be asked for: more than any computer has, and few enough to be started.
const MOST_THREADS: usize = 1024;

fn threads(text: &str) -> Result<usize, String> {
    let count = text.parse().ok().filter(|count| (1..=MOST_THREADS).contains(count));
    count.ok_or_else(|| format!("write a number of threads from 1 to {MOST_THREADS}"))
}

fn simd(text: &str) -> Result<SimdLevel, String> {
    let named = SimdLevel::ALL.into_iter().find(|level| level.name() == text);
    match named {
        Some(level) if level.is_available() => Ok(level),
        Some(_) => {
            Err(format!("this processor has no {text}; the fastest that it has is {}", SimdLevel::best().name()))
        }
        None => Err(format!("write one of {}", SimdLevel::ALL.map(SimdLevel::name).join(", "))),
    }
}

impl SceneArguments {
    /// All changes as settings of the scene.
    fn all_settings(&self) -> Vec<(String, String)> {
        let mut settings = self.settings.clone();
        settings.extend(self.seed.map(|seed| ("seed".to_owned(), seed.to_string())));
        settings.extend(self.backends.iter().map(|choice| match choice.split_once('=') {
            Some((stage, name)) => (format!("stage.{stage}.backend"), name.to_owned()),
            None => ("backend".to_owned(), choice.clone()),
        }));
        settings.extend(self.ranks.map(|ranks| ("liggghts.ranks".to_owned(), ranks.to_string())));
        settings.extend(self.models.iter().map(|(name, on)| (format!("solver.models.{name}"), on.to_string())));
        settings
    }

    /// The findings with the lines they speak of.
    fn rendered(&self, findings: &[Finding]) -> String {
        let file = if self.scene.is_dir() { self.scene.join("scene.toml") } else { self.scene.clone() };
        render(findings, &std::fs::read_to_string(file).unwrap_or_default())
    }
}

/// Prints for the user: results on stdout, everything else on stderr. A closed pipe is no failure.
mod print {
    use std::io::Write;

    pub fn result(text: &str) {
        drop(writeln!(std::io::stdout(), "{}", text.trim_end()));
    }

    pub fn message(text: &str) {
        drop(writeln!(std::io::stderr(), "{}", text.trim_end()));
    }
}

/// Parses the command line and runs its subcommand.
pub fn main() -> ExitCode {
    let cli = match Cli::try_parse() {
        Ok(cli) => cli,
        Err(error) => {
            let asked = !error.use_stderr();
            drop(error.print());
            return ExitCode::from(if asked { exit_code::DONE } else { exit_code::USAGE });
        }
    };
    ExitCode::from(match cli.verb {
        Verb::Init(arguments) => init::run(&arguments),
        Verb::Check(arguments) => check::run(&arguments),
        Verb::Plan(arguments) => plan::run(&arguments),
        Verb::Run(arguments) => run::run(&arguments),
        Verb::Campaign(arguments) => campaign::run(&arguments),
        Verb::Deck(arguments) => deck::run(&arguments),
        Verb::Compare(arguments) => compare::run(&arguments),
        Verb::Doctor(arguments) => doctor::run(&arguments),
        Verb::Stream(arguments) => stream::run(&arguments),
        Verb::Verify(arguments) => verify::run(&arguments),
    })
}
