//! Speed and results of tollgate beside LIGGGHTS, LAMMPS and YADE, from the same start states.
//!
//! `cargo bench --bench peers -- --help` says what can be asked for; `--write` makes `docs/performance.md`. The decks are in
//! `benches/peers/decks`, `liggghts_inputs` and `yade_scripts`; what is made on the way is kept under `target/peers`.
#![expect(clippy::print_stdout, clippy::print_stderr, reason = "a program for the terminal")]

#[path = "../../tests/liggghts_bed/bed.rs"]
#[expect(
    clippy::unwrap_used,
    dead_code,
    reason = "shared with the tests, which fail by panicking; its runs are not used here"
)]
mod bed;
mod check;
mod code;
mod commands;
mod example;
mod mesh;
mod page;
mod process;
mod rounds;
mod scene;
mod start;
#[path = "../../tests/liggghts_bed/state.rs"]
#[expect(clippy::unwrap_used, reason = "shared with the tests, which fail by panicking")]
mod state;

use clap::Parser;
use clap::builder::PossibleValuesParser;
use code::Code;
use example::Example;
use page::Findings;
use rounds::Plan;
use scene::{SCENES, Scene, root};
use std::fs;
use std::path::PathBuf;
use std::process::ExitCode;

/// Speed of tollgate beside other codes, and whether they compute the same
#[derive(Debug, Parser)]
struct Options {
    /// Measure this scene; may be repeated [default: all but settled-bed-1m]
    #[arg(long = "scene", value_parser = PossibleValuesParser::new(names()))]
    scenes: Vec<String>,
    /// Rounds; in each one every code runs twice
    #[arg(long, default_value_t = 5, value_parser = clap::value_parser!(u32).range(1..))]
    rounds: u32,
    /// Codes to compare with
    #[arg(long, value_delimiter = ',', default_values = ["liggghts", "lammps", "yade"])]
    peers: Vec<Code>,
    /// Numbers of threads, or MPI ranks
    #[arg(long, value_delimiter = ',', default_values = ["1", "2"], value_parser = clap::value_parser!(u32).range(1..))]
    threads: Vec<u32>,
    /// Write docs/performance.md
    #[arg(long)]
    write: bool,
    /// Another tollgate than the one just built
    #[arg(long, default_value = env!("CARGO_BIN_EXE_tollgate"), hide_default_value = true)]
    tollgate: PathBuf,
    /// Share of the steps to make, to try a scene; a trial, no measurement
    #[arg(long, default_value_t = 1.0)]
    share: f64,
    /// Given by cargo
    #[arg(long, hide = true)]
    bench: bool,
}

fn names() -> Vec<&'static str> {
    SCENES.iter().map(|scene| scene.name).chain([example::NAME]).collect()
}

impl Options {
    fn wants(&self, name: &str, only_by_name: bool) -> bool {
        if self.scenes.is_empty() { !only_by_name } else { self.scenes.iter().any(|wanted| wanted == name) }
    }

    fn plan(&self) -> Plan {
        let peers = self.peers.iter().copied().filter(|&peer| peer != Code::Tollgate).collect();
        Plan {
            tollgate: self.tollgate.clone(),
            rounds: self.rounds,
            threads: self.threads.clone(),
            peers,
            share: self.share,
        }
    }
}

fn main() -> ExitCode {
    let options = Options::parse();
    let plan = options.plan();
    let most = plan.threads.iter().copied().max().unwrap_or(1);
    let missing: Vec<String> = plan.peers.iter().filter_map(|peer| peer.missing(most)).collect();
    missing.iter().for_each(|line| println!("NOT MEASURED: {line}"));
    let (mut all, mut sections, mut holds) = (Vec::new(), Vec::new(), true);
    for scene in SCENES.iter().filter(|scene| options.wants(scene.name, scene.only_by_name)) {
        let findings = find_out(scene, &plan);
        holds &= findings.checks.iter().all(check::Check::holds);
        sections.push(findings.section());
        println!("{}", sections[sections.len() - 1]);
        all.push(findings);
    }
    if options.wants(example::NAME, false) && Code::Liggghts.missing(1).is_none() {
        let example = Example::measure(&plan);
        holds &= example.holds();
        sections.push(example.section());
        println!("{}", sections[sections.len() - 1]);
    }
    let scaling = page::scaling(&all);
    println!("{scaling}");
    if options.write {
        let text = [page::head(&all, &plan, &missing), sections.join("\n"), scaling].join("\n");
        let path = root().join("docs/performance.md");
        fs::write(&path, text.trim_end().to_owned() + "\n").expect("docs/performance.md");
        println!("written: {}", path.display());
    }
    if holds {
        return ExitCode::SUCCESS;
    }
    eprintln!("a check FAILED: see the tables");
    ExitCode::FAILURE
}

fn find_out(scene: &Scene, plan: &Plan) -> Findings {
    eprintln!("{}: start state ...", scene.name);
    let count = start::prepare(scene, &plan.tollgate);
    let measured = rounds::measure(scene, count, plan);
    let checks = check::check(scene, count, plan, &measured);
    Findings { scene: *scene, measured, checks }
}
