//! The page: tables of what was measured, as Markdown, for the terminal and for `docs/performance.md`.

use crate::check::Check;
use crate::code::Code;
use crate::example::{self, Example};
use crate::rounds::{Plan, Series, Spread};
use crate::scene::Scene;
use std::fmt::Write as _;
use std::fs;
use std::process::Command;

/// Everything that was found out about one scene.
#[derive(Debug)]
pub struct Findings {
    pub scene: Scene,
    pub measured: Vec<Series>,
    pub checks: Vec<Check>,
}

impl Findings {
    fn of(&self, code: Code, threads: u32) -> Option<&Series> {
        self.measured.iter().find(|series| series.code == code && series.threads == threads)
    }

    fn groups(&self) -> Vec<u32> {
        let mut groups: Vec<u32> = self.measured.iter().map(|series| series.threads).collect();
        groups.dedup();
        groups
    }

    /// The scene's part of the page.
    pub fn section(&self) -> String {
        let scene = &self.scene;
        let mut text = format!("## {}\n\n{}.\n", scene.name, capital(scene.about));
        let _ = writeln!(text, "Time step {} us; long minus short run: {}.", scene.timestep, self.lengths());
        if !scene.peers.is_empty() {
            let _ = writeln!(text, "{}", self.settings());
        }
        for threads in self.groups() {
            text += &self.rates(threads);
        }
        text + &self.physics()
    }

    fn lengths(&self) -> String {
        let of = |code: Code| self.measured.iter().find(|series| series.code == code);
        let said = |series: &Series| format!("{} - {} steps", series.steps.long, series.steps.short);
        let own = of(Code::Yade).map(|series| format!(", of YADE {}", said(series)));
        of(Code::Tollgate).map_or_else(String::new, said) + &own.unwrap_or_default()
    }

    fn settings(&self) -> String {
        let Scene { skins, tried, bin, yade_skin, two_sizes, peers, .. } = self.scene;
        let bins = if bin > 0.0 { format!(" with bins of {} mm", bin * 1e3) } else { String::new() };
        let mut said = vec![format!("LIGGGHTS {} mm{bins}", skins[0] * 1e3)];
        if peers.contains(&Code::Lammps) {
            let lists = if two_sizes.is_some() { " with a list for each size (`multi`)" } else { "" };
            said.push(format!("LAMMPS {} mm{lists}", skins[1] * 1e3));
        }
        if peers.contains(&Code::Yade) {
            said.push(format!("YADE {} mm (`verletDist`)", yade_skin * 1e3));
        }
        format!("Skins: {}; tollgate as its plan chooses. Tried in short runs: {tried}.", said.join(", "))
    }

    /// By processor time for one thread, by wall time for more.
    fn rates(&self, threads: u32) -> String {
        let one = threads == 1;
        let second = if one { "CPU second" } else { "wall second" };
        let rates = |series: &Series| if one { series.by_cpu.clone() } else { series.by_wall.clone() };
        let narrow = self.of(Code::Avx2, threads).map(rates);
        let mut columns = vec![
            if one { "one thread".to_owned() } else { format!("{threads} threads or ranks") },
            format!("million particle steps per {second}"),
            "tollgate is faster by".to_owned(),
        ];
        columns.extend(narrow.is_some().then(|| "with AVX2 only".to_owned()));
        columns.extend((!one).then(|| "against one thread".to_owned()));
        let mut text = format!("\n| {} |\n|{}\n", columns.join(" | "), "---|".repeat(columns.len()));
        let Some(ours) = self.of(Code::Tollgate, threads).map(rates) else { return text };
        for series in self.measured.iter().filter(|series| series.threads == threads) {
            let (name, theirs) = (series.code.name(), rates(series));
            let ratio = |ours: &[f64], own: bool| {
                if own { "-".into() } else { Spread::of_ratio(ours, &theirs).to_string() }
            };
            let _ = write!(text, "| {name} | {} |", Spread::of(theirs.iter().copied()));
            let _ = write!(text, " {} |", ratio(&ours, series.code == Code::Tollgate));
            if let Some(narrow) = &narrow {
                let _ = write!(text, " {} |", ratio(narrow, series.code.is_ours()));
            }
            if !one {
                let single = self.of(series.code, 1).map(|single| Spread::of_ratio(&series.by_wall, &single.by_wall));
                let _ = write!(text, " {} |", single.map_or("-".into(), |gain| gain.to_string()));
            }
            text.push('\n');
        }
        text
    }

    fn physics(&self) -> String {
        if self.checks.is_empty() {
            return String::new();
        }
        let mut text = "\n| check | steps | quantity | tollgate | other | difference | tolerance | |\n|---|---|---|---|---|---|---|---|\n".to_owned();
        for check in &self.checks {
            let name =
                format!("{}, {} thread{}", check.code.name(), check.threads, if check.threads > 1 { "s" } else { "" });
            for row in &check.rows {
                let [difference, tolerance] = [row.difference(), row.tolerance].map(|share| 100.0 * share);
                let verdict = if row.holds() { "holds" } else { "FAILED" };
                let _ = writeln!(
                    text,
                    "| {name} | {} | {} | {:.6e} | {:.6e} | {difference:+.3} % | {tolerance:.1} % | {verdict} |",
                    check.steps, row.what, row.ours, row.theirs
                );
            }
        }
        text
    }
}

impl Example {
    /// The example's part of the page.
    pub fn section(&self) -> String {
        let [ours, theirs] = &self.seconds;
        let mut text = format!(
            "## {}\n\n`examples/sinter-chute`, stages hopper and chute-40, `tollgate run` from start to end with all its output, one thread.\n\n\
             | backend | CPU seconds of the whole run | native is faster by | arrived on the chute | heap angle |\n|---|---|---|---|---|\n",
            example::NAME
        );
        for (which, backend) in example::BACKENDS.iter().enumerate() {
            let ratio = if which == 0 { "-".into() } else { Spread::of_ratio(theirs, ours).to_string() };
            let seconds = Spread::of(self.seconds[which].iter().copied());
            let _ = writeln!(
                text,
                "| {backend} | {seconds} | {ratio} | {} | {:.1} deg |",
                self.arrived[which], self.angle[which]
            );
        }
        let verdict = if self.holds() { "holds" } else { "FAILED" };
        let _ = writeln!(
            text,
            "\nCheck: as many arrive, and heap angles within 2 deg, three deviations of single runs: {verdict}."
        );
        text
    }
}

/// How tollgate's speed changes with threads and with size, from all scenes that were measured.
pub fn scaling(all: &[Findings]) -> String {
    let mut text = String::new();
    for findings in all {
        let Some(single) = findings.of(Code::Tollgate, 1) else { continue };
        for threads in findings.groups().into_iter().filter(|&threads| threads > 1) {
            let gain =
                findings.of(Code::Tollgate, threads).map(|more| Spread::of_ratio(&more.by_wall, &single.by_wall));
            let gain = gain.map_or("-".into(), |gain| gain.to_string());
            let _ = writeln!(text, "| {}: {threads} threads over one, wall time | {gain} |", findings.scene.name);
        }
    }
    let alone = |name: &str| all.iter().find(|f| f.scene.name == name).and_then(|f| f.of(Code::Tollgate, 1));
    if let Some((large, small)) = alone("settled-bed-1m").zip(alone("settled-bed-20k")) {
        let [large, small] = [large, small].map(|series| Spread::of(series.by_cpu.iter().copied()).median);
        let _ = writeln!(
            text,
            "| rate with a million spheres over that with 20 000, one thread, medians | {:.2} |",
            large / small
        );
    }
    if text.is_empty() { text } else { format!("## Scaling of tollgate\n\n| | |\n|---|---|\n{text}") }
}

/// What stands above the scenes.
pub fn head(all: &[Findings], plan: &Plan, missing: &[String]) -> String {
    let command = std::env::args().skip(1).filter(|word| word != "--bench").collect::<Vec<_>>().join(" ");
    let mut text = format!("# Speed beside other codes\n\n- Command: `cargo bench --bench peers -- {command}`\n");
    let _ = writeln!(text, "- Date: {}", said_by("date", &["-u", "+%Y-%m-%d"]));
    let _ = writeln!(text, "- {}", versions(all, plan).join("; "));
    let _ = writeln!(
        text,
        "- Commit {}, {}",
        said_by("git", &["rev-parse", "--short", "HEAD"]),
        said_by("rustc", &["--version"])
    );
    let cpu = fs::read_to_string("/proc/cpuinfo").unwrap_or_default();
    let model = cpu
        .lines()
        .find_map(|line| line.strip_prefix("model name")?.split_once(": "))
        .map_or("unknown", |(_, name)| name);
    let cores = std::thread::available_parallelism().map_or(0, |count| count.get());
    let _ = writeln!(text, "- Processor: {model}, {cores} cores; rounds: {}", plan.rounds);
    let load = fs::read_to_string("/proc/loadavg").unwrap_or_default();
    let load: Vec<&str> = load.split_whitespace().take(3).collect();
    let _ = writeln!(text, "- Load at the end, means of 1, 5 and 15 minutes: {}", load.join(", "));
    for line in missing {
        let _ = writeln!(text, "- NOT MEASURED: {line}");
    }
    if plan.share < 1.0 {
        let _ = writeln!(text, "- SHORTENED to {} of the steps: a trial, no measurement", plan.share);
    }
    text.push('\n');
    text + HOW
}

const HOW: &str = include_str!("how.md");

fn versions(all: &[Findings], plan: &Plan) -> Vec<String> {
    let mut versions: Vec<String> = Vec::new();
    for findings in all {
        for series in &findings.measured {
            let version = series.code.version(&findings.scene, &plan.tollgate);
            if !versions.contains(&version) {
                versions.push(version);
            }
        }
    }
    versions
}

fn said_by(program: &str, arguments: &[&str]) -> String {
    let output = Command::new(program).args(arguments).current_dir(crate::scene::root()).output();
    output.map_or("unknown".into(), |output| String::from_utf8_lossy(&output.stdout).trim().to_owned())
}

fn capital(text: &str) -> String {
    let mut letters = text.chars();
    letters.next().map_or_else(String::new, |first| first.to_uppercase().chain(letters).collect())
}
