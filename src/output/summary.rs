//! `summary.json`: the result of a run for machines; snake_case names with units.

use crate::math::lanes::SimdLevel;
use crate::storage::StorageError;
use crate::storage::staging::write_whole;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::fs;
use std::path::Path;

/// Version of the summary: another major means that a field changed its meaning or went away.
pub const FORMAT_MAJOR: u32 = 1;
/// A larger minor only adds fields.
pub const FORMAT_MINOR: u32 = 0;

/// The result of one run.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Summary {
    /// See [`FORMAT_MAJOR`].
    pub format_major: u32,
    /// See [`FORMAT_MINOR`].
    pub format_minor: u32,
    /// Version of the program that ran.
    pub tollgate_version: String,
    /// What was run.
    pub scene: SceneProvenance,
    /// How it ended.
    pub outcome: Outcome,
    /// One entry per stage, upstream first.
    pub stages: Vec<StageSummary>,
    /// One entry per gate.
    pub gates: Vec<serde_json::Value>,
    /// Measures by name (`heap_angle_deg`, `heap_angle_uncertainty_deg`, ...); null where one could not be taken.
    pub measures: BTreeMap<String, serde_json::Value>,
    /// What splitting at the gates costs and saves; null where nothing is cut, or not every stage has been run.
    #[serde(default)]
    pub load: Option<LoadAccount>,
    /// Replicates: statistics of each measure; null for a single run.
    #[serde(default)]
    pub replicates: Option<serde_json::Value>,
    /// What each feed was asked for and what it inserted.
    pub feeds: Vec<FeedSummary>,
    /// Particles that left, by cause.
    pub removed: Vec<RemovalSummary>,
    /// What happened when: parts that appeared or disappeared, feeds that ended.
    pub events: Vec<EventSummary>,
    /// Wall time by phase [s].
    pub timing_s: BTreeMap<String, f64>,
    /// Warnings, in the words the user saw.
    pub warnings: Vec<String>,
}

/// Where a result comes from.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize, Default)]
pub struct SceneProvenance {
    /// Name of the scene.
    pub name: String,
    /// The file, as the user gave it.
    pub file: String,
    /// blake3 digest of the scene file's bytes, hexadecimal.
    pub blake3: String,
    /// Seed of every random draw.
    pub seed: u64,
    /// Settings changed on the command line, as `key=value`.
    pub overrides: Vec<String>,
    /// The checkpoint it started from, where it did.
    pub started_from: Option<String>,
}

/// How a run ended.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, Default)]
pub struct Outcome {
    /// Exit status of the run.
    pub exit_code: u8,
    /// Why it ended: `time`, `at rest`, `empty`, `count`, `interrupted`, or the watchdog's words.
    pub reason: String,
    /// Plant time reached [s].
    pub time_s: f64,
}

/// One stage.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, Default)]
pub struct StageSummary {
    /// Name of the stage.
    pub name: String,
    /// Who computed it.
    pub backend: String,
    /// Version of who computed it.
    pub version: String,
    /// Time steps done.
    pub steps: u64,
    /// Time step [s].
    pub timestep_s: f64,
    /// Particles at the end.
    pub particles: u64,
    /// Wall time [s] of the process that ended the run; what was done before a resume is not in it.
    pub wall_s: f64,
    /// Processor time of all threads of that process [s]; null where the system does not tell.
    pub cpu_s: Option<f64>,
    /// Particles times steps per second of wall time [1/s].
    pub particle_steps_per_s: f64,
    /// Largest memory in use [bytes]; null where the system does not tell.
    pub peak_memory_bytes: Option<u64>,
    /// Threads used.
    pub threads: u64,
    /// Instruction set of the contact kernels; null of an external code.
    #[serde(default)]
    pub simd: Option<SimdLevel>,
}

/// Processor time split against unsplit, after figure 8 of patent JP5440448B2: an upstream load A run X times and a downstream
/// load B run Y times cost A X + B Y where the stream is stored, and (A + B) max(X, Y) where it is not.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, Default)]
pub struct LoadAccount {
    /// A: processor time of the stages that something follows [s].
    pub upstream_cpu_s: f64,
    /// X: how often they are run.
    pub upstream_runs: u64,
    /// B: mean processor time of a stage that nothing follows [s].
    pub downstream_cpu_s: f64,
    /// Y: number of stages that nothing follows.
    pub downstream_runs: u64,
    /// Measured: processor time of all stages [s].
    pub split_cpu_s: f64,
    /// A X + B Y with the median B for all of them [s].
    pub split_forecast_cpu_s: f64,
    /// (A + B) max(X, Y): what the same costs where nothing is stored [s].
    pub unsplit_forecast_cpu_s: f64,
    /// Unsplit over split [-].
    pub ratio: f64,
    /// Largest memory of any one stage [bytes]; null where the system does not tell.
    pub peak_memory_bytes: Option<u64>,
}

impl LoadAccount {
    /// Of the processor times [s] of all upstream stages, which `upstream_runs` runs of the upstream consist of, and of each downstream
    /// run; `None` where one of them is missing.
    #[must_use]
    pub fn of(upstream: &[f64], upstream_runs: usize, downstream: &[f64]) -> Option<Self> {
        if upstream_runs == 0 || downstream.is_empty() {
            return None;
        }
        let (x, y) = (upstream_runs as f64, downstream.len() as f64);
        let (all_upstream, all_downstream): (f64, f64) = (upstream.iter().sum(), downstream.iter().sum());
        let (a, b) = (all_upstream / x, all_downstream / y);
        let mut each = downstream.to_vec();
        each.sort_by(f64::total_cmp);
        let (split, unsplit) = (all_upstream + all_downstream, (a + b) * x.max(y));
        Some(Self {
            upstream_cpu_s: a,
            upstream_runs: upstream_runs as u64,
            downstream_cpu_s: b,
            downstream_runs: downstream.len() as u64,
            split_cpu_s: split,
            split_forecast_cpu_s: all_upstream + each[each.len() / 2] * y,
            unsplit_forecast_cpu_s: unsplit,
            ratio: unsplit / split,
            peak_memory_bytes: None,
        })
    }

    /// The median of the downstream runs' processor times, which the forecast of the split rests on [s].
    #[must_use]
    pub fn median_downstream_cpu_s(&self) -> f64 {
        (self.split_forecast_cpu_s - self.upstream_cpu_s * self.upstream_runs as f64) / self.downstream_runs as f64
    }
}

/// One feed.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, Default)]
pub struct FeedSummary {
    /// Name of the feed.
    pub name: String,
    /// Particles asked for, where the scene counts them.
    pub asked_count: Option<u64>,
    /// Mass asked for [kg], where the scene weighs it.
    pub asked_mass_kg: Option<f64>,
    /// Particles inserted.
    pub inserted_count: u64,
    /// Mass inserted [kg].
    pub inserted_mass_kg: f64,
    /// Size classes, asked against inserted.
    pub grading: Vec<GradingSummary>,
    /// Why less was inserted than asked for; null where nothing is missing.
    pub shortfall: Option<String>,
}

/// One size class of a feed.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, Default)]
pub struct GradingSummary {
    /// Lower sieve [m].
    pub from_m: f64,
    /// Upper sieve [m].
    pub to_m: f64,
    /// Share asked for [-].
    pub asked_fraction: f64,
    /// Share inserted [-].
    pub inserted_fraction: f64,
}

/// Particles that left by one cause.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, Default)]
pub struct RemovalSummary {
    /// The cause: the border of the domain, a condition, ...
    pub cause: String,
    /// How many.
    pub count: u64,
    /// Their mass [kg].
    pub mass_kg: f64,
}

/// Something that happened.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, Default)]
pub struct EventSummary {
    /// Plant time [s].
    pub time_s: f64,
    /// What happened.
    pub what: String,
}

impl Default for Summary {
    fn default() -> Self {
        Self {
            format_major: FORMAT_MAJOR,
            format_minor: FORMAT_MINOR,
            tollgate_version: env!("CARGO_PKG_VERSION").to_owned(),
            scene: SceneProvenance::default(),
            outcome: Outcome::default(),
            stages: Vec::new(),
            gates: Vec::new(),
            measures: BTreeMap::new(),
            load: None,
            replicates: None,
            feeds: Vec::new(),
            removed: Vec::new(),
            events: Vec::new(),
            timing_s: BTreeMap::new(),
            warnings: Vec::new(),
        }
    }
}

impl Summary {
    /// Sets a measure. JSON knows no NaN and no infinity: such a value becomes null.
    pub fn measure(&mut self, name: &str, value: impl Into<serde_json::Value>) {
        self.measures.insert(name.to_owned(), value.into());
    }

    /// Writes the summary; an older one stays until the new one is whole.
    ///
    /// # Errors
    /// When the disk refuses.
    pub fn write(&self, path: &Path) -> Result<(), StorageError> {
        let mut text =
            serde_json::to_vec_pretty(self).map_err(|error| StorageError::mismatch(path, error.to_string()))?;
        text.push(b'\n');
        write_whole(path, &text)
    }

    /// Reads a summary, also of a newer minor version.
    ///
    /// # Errors
    /// When the file cannot be read, is no summary, or has another major version.
    pub fn read(path: &Path) -> Result<Self, StorageError> {
        #[derive(Deserialize)]
        struct VersionOnly {
            format_major: u32,
        }
        let text = fs::read(path).map_err(|source| StorageError::system("read", path, source))?;
        let unusable =
            |error: serde_json::Error| StorageError::unusable(path, format!("it is no summary of a run ({error})"));
        let version: VersionOnly = serde_json::from_slice(&text).map_err(unusable)?;
        if version.format_major != FORMAT_MAJOR {
            let reason = format!(
                "it has format {}; this program reads format {FORMAT_MAJOR}; use the version that wrote it",
                version.format_major
            );
            return Err(StorageError::unusable(path, reason));
        }
        serde_json::from_slice(&text).map_err(unusable)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn sample() -> Summary {
        let mut summary = Summary {
            scene: SceneProvenance { name: "chute".to_owned(), seed: u64::MAX, ..SceneProvenance::default() },
            outcome: Outcome { exit_code: 0, reason: "time".to_owned(), time_s: 0.1 + 0.2 },
            stages: vec![StageSummary {
                timestep_s: 1.0 / 3.0 * 1e-5,
                particle_steps_per_s: 1e7 / 3.0,
                peak_memory_bytes: Some(123),
                ..StageSummary::default()
            }],
            feeds: vec![FeedSummary { shortfall: Some("full".to_owned()), ..FeedSummary::default() }],
            removed: vec![RemovalSummary::default()],
            events: vec![EventSummary { time_s: 5e-324, what: "gate opened".to_owned() }],
            warnings: vec!["mind the gap".to_owned()],
            ..Summary::default()
        };
        summary.measure("heap_angle_deg", 37.1);
        summary.timing_s.insert("contacts".to_owned(), 1.5);
        summary
    }

    #[test]
    fn a_summary_reads_back_to_the_last_bit() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("summary.json");
        sample().write(&path).unwrap();
        assert_eq!(Summary::read(&path).unwrap(), sample());
    }

    #[test]
    fn a_load_is_that_of_the_patents_example() {
        // Figure 8: A = 10 once, B = 2 ten times: 30 where the stream is stored, 120 where it is not, 4 times.
        let load = LoadAccount::of(&[4.0, 6.0], 1, &[2.0; 10]).unwrap();
        assert_eq!((load.upstream_cpu_s, load.downstream_cpu_s, load.split_cpu_s), (10.0, 2.0, 30.0));
        assert_eq!((load.split_forecast_cpu_s, load.unsplit_forecast_cpu_s, load.ratio), (30.0, 120.0, 4.0));
        // The mean counts for the load, the median for its forecast.
        let uneven = LoadAccount::of(&[10.0, 10.0], 2, &[1.0, 2.0, 6.0]).unwrap();
        assert_eq!(
            (uneven.upstream_cpu_s, uneven.downstream_cpu_s, uneven.median_downstream_cpu_s()),
            (10.0, 3.0, 2.0)
        );
        assert_eq!(
            (uneven.split_cpu_s, uneven.split_forecast_cpu_s, uneven.unsplit_forecast_cpu_s),
            (29.0, 26.0, 39.0)
        );
        assert_eq!(LoadAccount::of(&[], 0, &[1.0]), None);
        assert_eq!(LoadAccount::of(&[1.0], 1, &[]), None);
    }

    #[test]
    fn a_measure_that_is_not_a_number_becomes_null() {
        let mut summary = sample();
        summary.measure("heap_angle_deg", f64::NAN);
        assert!(summary.measures["heap_angle_deg"].is_null());
    }

    #[test]
    fn newer_and_foreign_summaries_are_told_apart() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("summary.json");
        let read = |text: String| {
            fs::write(&path, text).unwrap();
            Summary::read(&path)
        };
        let text = serde_json::to_string(&sample()).unwrap();
        assert_eq!(read(text.replacen('{', "{\"later\":1,", 1)).unwrap(), sample(), "a newer minor only adds");
        let newer = read(text.replace("\"format_major\":1", "\"format_major\":2")).unwrap_err();
        assert!(newer.to_string().contains("it has format 2; this program reads format 1"), "{newer}");
        assert!(read("{}".to_owned()).unwrap_err().to_string().contains("no summary of a run"));
        assert!(read(text[..text.len() / 2].to_owned()).is_err());
    }
}
