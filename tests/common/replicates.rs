//! Replicates of the small hopper, split and whole, on any backend: computed once, compared, printed as Markdown.
//! Runs go to `TOLLGATE_VALIDATION_RUNS`, else to target/gate_validation; what is there already is not computed again.

use std::path::{Path, PathBuf};
use std::sync::atomic::AtomicBool;
use tollgate::analysis::compare::{Comparison, Verdict};
use tollgate::exit_code;
use tollgate::output::summary::Summary;
use tollgate::run::comparison::{CompareRequest, compare_runs};
use tollgate::run::{RunError, RunRequest, run};

pub fn root() -> PathBuf {
    PathBuf::from(env!("CARGO_MANIFEST_DIR"))
}

pub fn runs() -> PathBuf {
    std::env::var_os("TOLLGATE_VALIDATION_RUNS").map_or_else(|| root().join("target/gate_validation"), PathBuf::from)
}

/// A run of the small hopper, or what an earlier one left.
pub struct Order<'a> {
    pub scene: &'a str,
    pub out: PathBuf,
    pub settings: Vec<(String, String)>,
    pub whole: bool,
    pub replicates: u64,
    pub perturb: Option<f64>,
    pub reuse: Vec<PathBuf>,
    /// These stages only; all where it is empty.
    pub stages: Vec<String>,
}

impl<'a> Order<'a> {
    pub fn new(scene: &'a str, out: &str) -> Self {
        Self {
            scene,
            out: runs().join(out),
            settings: Vec::new(),
            whole: false,
            replicates: 1,
            perturb: None,
            reuse: Vec::new(),
            stages: Vec::new(),
        }
    }

    pub fn set(mut self, key: &str, value: impl ToString) -> Self {
        self.settings.push((key.to_owned(), value.to_string()));
        self
    }

    /// The summary, also of a run that the watchdog or LIGGGHTS stopped.
    pub fn run(&self) -> Summary {
        let request = RunRequest {
            scene: root().join("tests/scenes/hopper").join(self.scene),
            settings: self.settings.clone(),
            out: Some(self.out.clone()),
            whole: self.whole,
            replicates: self.replicates,
            perturb: self.perturb,
            threads: Some(1),
            reuse: self.reuse.clone(),
            stages: self.stages.clone(),
            resume: self.out.exists(),
            ..RunRequest::default()
        };
        match run(&request, &AtomicBool::new(false)) {
            Ok(report) => report.summary,
            Err(RunError::Backend(error))
                if [exit_code::UNSTABLE, exit_code::BACKEND_FAILED].contains(&error.exit_code()) =>
            {
                stopped(&self.out)
            }
            Err(RunError::StoppedBefore(_)) => stopped(&self.out),
            Err(error) => panic!("{}: {error:?}", self.out.display()),
        }
    }
}

/// The summary of the stage that was stopped.
pub fn stopped(out: &Path) -> Summary {
    let stages = ["chute", "hopper"].map(|stage| out.join("stages").join(stage).join("summary.json"));
    let found = stages.iter().filter(|path| path.exists()).map(|path| Summary::read(path).unwrap());
    found.into_iter().find(|summary| summary.outcome.exit_code != exit_code::DONE).unwrap()
}

pub fn number(value: &serde_json::Value) -> f64 {
    value.as_f64().unwrap_or(f64::NAN)
}

/// Whole runs that every comparison is made against. Rates of such runs scatter by 3 %, the margin is 4 %: with ten on either side a
/// difference of 2 % is inconclusive, and a comparison asks for 16.
pub const WHOLE_RUNS: u64 = 20;
/// The whole runs, computed by whichever test comes first.
pub fn whole_runs() -> PathBuf {
    let mut whole = Order::new("scene.toml", "statistics-whole").set("output.frames", "1 s");
    (whole.whole, whole.replicates) = (true, WHOLE_RUNS);
    whole.run();
    whole.out
}

/// Rate, heap and centre of mass of the small hopper's chute.
pub const CHUTE: [&str; 4] = ["chute.rate", "chute.heap", "chute.centre_x", "chute.centre_z"];

/// Those of the measures, each the first whose name begins so, that differ.
pub fn disagreement(comparison: &Comparison, what: &str, measures: &[&str]) -> Vec<String> {
    let measure = |name: &str| {
        let found = comparison.measures.iter().find(|measure| measure.name.starts_with(name));
        found.unwrap_or_else(|| panic!("no measure {name}: {:?}", names(comparison)))
    };
    let differs = measures.iter().map(|name| measure(name)).filter(|found| found.verdict == Verdict::Differs);
    differs.map(|found| format!("{what}: {found:?}")).collect()
}

pub fn names(comparison: &Comparison) -> Vec<&str> {
    comparison.measures.iter().map(|measure| measure.name.as_str()).collect()
}

pub fn compared(runs: &Path, reference: &Path) -> Comparison {
    let request = CompareRequest {
        runs: vec![runs.to_path_buf()],
        reference: vec![reference.to_path_buf()],
        margins: Vec::new(),
        out: None,
    };
    compare_runs(&request).unwrap()
}

pub fn print(title: &str, comparison: &Comparison) {
    println!("\n## {title}\n\n```text\n{}\n```", tollgate::report::comparison::table(comparison).trim_end());
}

pub fn row(height: f64, upstream: &str, downstream: &str, summary: &Summary, out: &Path) {
    let gate = |list: &str| summary.gates.iter().find_map(|gate| gate[list].get(0)).cloned().unwrap_or_default();
    let (recorded, replayed) = (gate("recorded"), gate("replayed"));
    let lost: u64 =
        summary.removed.iter().filter(|row| !row.cause.contains("through a gate")).map(|row| row.count).sum();
    let measure = |name: &str| summary.measures.get(&format!("chute.{name}")).map_or(f64::NAN, number);
    let ended = if summary.outcome.exit_code == exit_code::DONE { "done" } else { "stopped" };
    println!(
        "| {height} | {upstream} | {downstream} | {:.2} | {:.4} | {:.1} | {:.1} | {:.0} | {:.1} | {} | {} | {ended} |",
        number(&recorded["crossings"]["contact_share"]),
        measure("rate_kg_per_s"),
        measure("heap_deg"),
        1e3 * measure("centre_x_m"),
        100.0 * number(&replayed["quality"]["overlaps"]["largest_share"]),
        largest_speed(&out.join("stages/chute/series.csv")),
        lost + replayed["left_upstream"].as_u64().unwrap_or(0),
        replayed["quality"]["grade"].as_str().unwrap_or(""),
    );
}

pub fn largest_speed(series: &Path) -> f64 {
    tollgate::output::series::Series::read(series).map_or(f64::NAN, |series| {
        series.column("maximum_speed_m_per_s").unwrap_or_default().iter().copied().fold(0.0, f64::max)
    })
}

/// Planes by height [mm] with the length of a buffer that reaches 5 mm below the outlet's rim (z = 200 mm).
pub const PLANES: [(f64, f64); 4] = [(198.0, 6.0), (203.0, 8.0), (207.5, 12.5), (215.0, 20.0)];

/// Prints the table of every pair of modes at the dense cuts, both stages on `backend`, downstream `paths`, paths stored every
/// `every` time steps.
pub fn pairs_of_modes(backend: &str, paths: &[&str], every: u64) {
    println!(
        "| plane | upstream | downstream | in contact | rate kg/s | heap deg | centre x mm | overlap % | speed m/s | lost | cut | ended |"
    );
    println!("|---|---|---|---|---|---|---|---|---|---|---|---|");
    // The native runs keep the names that they have had.
    let name = |name: String| if backend == "native" { name } else { format!("{backend}-{name}") };
    for (height, length) in PLANES {
        let at = |out: String| {
            Order::new("scene.toml", &name(out))
                .set("backend", backend)
                .set("output.frames", "1 s")
                .set("stage.chute.replay.0.backing_up", "warn")
                .set("gate.outlet.point_mm", format!("[0, 0, {height}]"))
        };
        let mut whole = at(format!("whole-{height}"));
        whole.whole = true;
        row(height, "whole", "", &whole.run(), &whole.out);
        for exclusion in ["buffer", "ballistic", "constant"] {
            let mut first: Option<PathBuf> = None;
            for path in paths {
                let l1 = if exclusion == "buffer" { length } else { 6.0 };
                let mut order = at(format!("{height}-{exclusion}-{path}"))
                    .set("gate.outlet.exclusion.mode", exclusion)
                    .set("gate.outlet.exclusion.length_mm", l1)
                    .set("gate.outlet.paths.every", every)
                    .set("stage.chute.replay.0.path", path)
                    .set("solver.overlap_limit", 1);
                order.reuse.extend(first.clone());
                row(height, exclusion, path, &order.run(), &order.out);
                first.get_or_insert(order.out);
            }
        }
    }
}
