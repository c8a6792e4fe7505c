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
    #[arg(long, value_delimiter = ',', default_values = ["avx2", "liggghts", "lammps", "yade"])]
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

/// What was measured, and what could not be.
#[derive(Debug, Default)]
struct Results {
    findings: Vec<Findings>,
    /// One for each scene, in their order.
    sections: Vec<String>,
    /// What is not measured, with the reason.
    missing: Vec<String>,
    failed: bool,
}

fn main() -> ExitCode {
    let options = Options::parse();
    let mut plan = options.plan();
    let mut results = Results::default();
    let cores = std::thread::available_parallelism().map_or(1, |count| count.get() as u32);
    for threads in plan.threads.extract_if(.., |threads| *threads > cores) {
        results.not_measured(format!("{threads} threads: this computer has {cores} cores"));
    }
    let most = plan.threads.iter().copied().max().unwrap_or(1);
    plan.peers.iter().filter_map(|peer| peer.missing(most)).for_each(|line| results.not_measured(line));
    for scene in SCENES.iter().filter(|scene| options.wants(scene.name, scene.only_by_name)) {
        match start::missing(scene) {
            Some(line) => results.not_measured(line),
            None => results.add_scene(scene, &plan),
        }
    }
    if options.wants(example::NAME, false) {
        results.add_example(&plan);
    }
    println!("{}", page::scaling(&results.findings));
    if options.write {
        results.write(&plan);
    }
    if results.failed {
        eprintln!("a check FAILED: see the tables");
    }
    if results.failed { ExitCode::FAILURE } else { ExitCode::SUCCESS }
}

impl Results {
    fn not_measured(&mut self, line: String) {
        println!("NOT MEASURED: {line}\n");
        self.missing.push(line);
    }

    fn add_section(&mut self, section: String, holds: bool) {
        println!("{section}");
        self.sections.push(section);
        self.failed |= !holds;
    }

    fn add_scene(&mut self, scene: &Scene, plan: &Plan) {
        eprintln!("{}: start state ...", scene.name);
        let count = start::prepare(scene, &plan.tollgate);
        let measured = rounds::measure(scene, count, plan);
        let checks = check::check(scene, count, plan, &measured);
        let holds = checks.iter().all(check::Check::holds);
        let findings = Findings { scene: *scene, measured, checks };
        self.add_section(findings.section(), holds);
        self.findings.push(findings);
    }

    fn add_example(&mut self, plan: &Plan) {
        if !plan.peers.contains(&Code::Liggghts) {
            return self.not_measured(format!("{}, which is compared with LIGGGHTS only", example::NAME));
        }
        if let Some(line) = Code::Liggghts.missing(1) {
            return self.not_measured(format!("{}: {line}", example::NAME));
        }
        let example = Example::measure(plan);
        self.add_section(example.section(), example.holds());
    }

    fn write(&self, plan: &Plan) {
        let head = page::head(&self.findings, plan, &self.missing);
        let text = [head, self.sections.join("\n"), page::scaling(&self.findings)].join("\n");
        let path = root().join("docs/performance.md");
        fs::write(&path, text.trim_end().to_owned() + "\n").expect("docs/performance.md");
        println!("written: {}", path.display());
    }
}
