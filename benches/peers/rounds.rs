//! Alternating rounds: in each one every code makes its short run, then every code its long run. What lies between the two
//! is the stepping loop; reading, set-up and writing cancel.

use crate::code::{Code, Conventions, Job};
use crate::scene::{Scene, Steps};
use std::path::{Path, PathBuf};

/// What is asked of every scene.
#[derive(Debug, Clone)]
pub struct Plan {
    pub tollgate: PathBuf,
    pub rounds: u32,
    pub threads: Vec<u32>,
    /// The peers that were asked for.
    pub peers: Vec<Code>,
    /// Of the steps of each scene.
    pub share: f64,
}

/// A code with a number of threads, round by round.
#[derive(Debug, Clone)]
pub struct Series {
    pub code: Code,
    pub threads: u32,
    pub steps: Steps,
    /// Million particle steps a second of user processor time.
    pub by_cpu: Vec<f64>,
    /// Million particle steps a second of wall time.
    pub by_wall: Vec<f64>,
    /// State after the last long run.
    pub state: PathBuf,
}

impl Plan {
    /// Codes that a scene is measured with, ours first.
    pub fn codes(&self, scene: &Scene, threads: u32) -> Vec<Code> {
        let peers = scene.peers.iter().copied();
        let there = peers.filter(|peer| self.peers.contains(peer) && peer.missing(threads).is_none());
        std::iter::once(Code::Tollgate).chain(there).collect()
    }
}

/// All rounds of a scene with so many spheres.
pub fn measure(scene: &Scene, count: usize, plan: &Plan) -> Vec<Series> {
    let start = |threads: u32| {
        let codes = plan.codes(scene, threads).into_iter();
        codes.map(move |code| Series {
            code,
            threads,
            steps: scene.steps_of(code, plan.share),
            by_cpu: Vec::new(),
            by_wall: Vec::new(),
            state: PathBuf::new(),
        })
    };
    let mut all: Vec<Vec<Series>> = plan.threads.iter().map(|&threads| start(threads).collect()).collect();
    for round in 1..=plan.rounds {
        for group in &mut all {
            one_round(scene, count, &plan.tollgate, group);
            let told =
                group.iter().map(|s| format!("{} {:.2}", s.code.name(), s.last())).collect::<Vec<_>>().join(", ");
            eprintln!(
                "{}, round {round}, {} threads: {told} million particle steps per CPU second",
                scene.name, group[0].threads
            );
        }
    }
    all.concat()
}

fn one_round(scene: &Scene, count: usize, tollgate: &Path, group: &mut [Series]) {
    let job = |series: &Series, steps| Job {
        scene,
        tollgate,
        steps,
        threads: series.threads,
        count,
        conventions: Conventions::Tollgate,
    };
    let short: Vec<_> = group.iter().map(|series| series.code.run(&job(series, series.steps.short)).0).collect();
    for (series, short) in group.iter_mut().zip(short) {
        let (long, state) = series.code.run(&job(series, series.steps.long));
        let million = count as f64 * (series.steps.long - series.steps.short) as f64 / 1e6;
        series.by_cpu.push(million / (long.user - short.user));
        series.by_wall.push(million / (long.wall - short.wall));
        series.state = series.kept(scene, &state);
    }
}

impl Series {
    fn last(&self) -> f64 {
        self.by_cpu.last().copied().unwrap_or(f64::NAN)
    }

    /// Moves a state out of the way of the next run.
    fn kept(&self, scene: &Scene, state: &Path) -> PathBuf {
        let kept = scene.folder().join(format!("{}-{}.last", self.code.name(), self.threads));
        std::fs::rename(state, &kept).expect("the last state");
        kept
    }
}

/// Median, lowest and highest.
#[derive(Debug, Clone, Copy)]
pub struct Spread {
    pub median: f64,
    pub lowest: f64,
    pub highest: f64,
}

impl Spread {
    pub fn of(values: impl IntoIterator<Item = f64>) -> Self {
        let mut values: Vec<f64> = values.into_iter().collect();
        values.sort_by(f64::total_cmp);
        let [lowest, highest] = [values.first(), values.last()].map(|value| value.copied().unwrap_or(f64::NAN));
        let [below, above] = [(values.len().max(1) - 1) / 2, values.len() / 2].map(|at| values.get(at).copied());
        let median = below.zip(above).map_or(f64::NAN, |(below, above)| f64::midpoint(below, above));
        Self { median, lowest, highest }
    }

    /// Of the quotients, round by round.
    pub fn of_ratio(above: &[f64], below: &[f64]) -> Self {
        Self::of(above.iter().zip(below).map(|(above, below)| above / below))
    }
}

impl std::fmt::Display for Spread {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "{:.2} ({:.2}, {:.2})", self.median, self.lowest, self.highest)
    }
}
