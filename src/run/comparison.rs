//! Result folders against each other: reads them, compares, writes what came out.

use super::gate_records::load_gate_records;
use crate::analysis::angle_of_repose::angle_of_repose;
use crate::analysis::centre_of_mass::centre_of_mass;
use crate::analysis::compare::{Comparison, GateRecord, HeapRecord, RunRecord, compare};
use crate::analysis::surface_profile::surface_profile;
use crate::exit_code;
use crate::output::final_state;
use crate::output::summary::Summary;
use crate::report::comparison::picture;
use crate::scene::{self, MeasureKind, Scene};
use crate::storage::StorageError;
use crate::storage::staging::write_whole;
use serde_json::Value;
use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};

/// What is asked to be compared.
#[derive(Debug, Clone, Default)]
pub struct CompareRequest {
    /// Result folders; one that holds `replicates/` stands for all of them.
    pub runs: Vec<PathBuf>,
    /// The same of the reference.
    pub reference: Vec<PathBuf>,
    /// Margins by name, as in ("heap_angle", "2 deg").
    pub margins: Vec<(String, String)>,
    /// Folder for `comparison.json` and `comparison.svg`.
    pub out: Option<PathBuf>,
}

/// Why nothing was compared: everything that was found wrong.
#[derive(Debug)]
pub struct CompareError {
    /// In the user's words.
    pub findings: Vec<String>,
    exit_code: u8,
}

impl CompareError {
    /// The exit status of a command that ends with this error.
    #[must_use]
    pub const fn exit_code(&self) -> u8 {
        self.exit_code
    }

    fn usage(findings: Vec<String>) -> Self {
        Self { findings, exit_code: exit_code::USAGE }
    }
}

impl From<StorageError> for CompareError {
    fn from(error: StorageError) -> Self {
        Self { exit_code: error.exit_code(), findings: vec![error.to_string()] }
    }
}

/// Compares result folders.
///
/// # Errors
/// Everything that is wrong with the folders and the margins; when `out` is taken or cannot be written.
pub fn compare_runs(request: &CompareRequest) -> Result<Comparison, CompareError> {
    compare_with(request, &load_gate_records)
}

type LoadGates<'a> = &'a dyn Fn(&Path) -> Result<Vec<GateRecord>, StorageError>;

fn compare_with(request: &CompareRequest, load_gates: LoadGates) -> Result<Comparison, CompareError> {
    let mut reading = Reading { load_gates, findings: Vec::new(), notes: Vec::new(), exit_code: exit_code::USAGE };
    let runs = reading.side(&request.runs);
    let reference = reading.side(&request.reference);
    reading.check_apart(&runs, &reference);
    if !reading.findings.is_empty() {
        return Err(CompareError { findings: reading.findings, exit_code: reading.exit_code });
    }
    let records = |side: Vec<Loaded>| side.into_iter().map(|run| run.record).collect::<Vec<_>>();
    let mut comparison = compare(&records(runs), &records(reference), &request.margins).map_err(CompareError::usage)?;
    reading.notes.dedup();
    comparison.notes.append(&mut reading.notes);
    if let Some(out) = &request.out {
        write(&comparison, out)?;
    }
    Ok(comparison)
}

/// Writes `comparison.json` and `comparison.svg`, never over another comparison.
fn write(comparison: &Comparison, out: &Path) -> Result<(), CompareError> {
    let text = serde_json::to_string_pretty(comparison).expect("a comparison is plain numbers and names") + "\n";
    let (place, shown) = (out.join("comparison.json"), out.display());
    let held = fs::read(&place).ok();
    let refused = match held {
        Some(bytes) if bytes == text.as_bytes() => None,
        Some(_) => Some(format!(
            "the folder {shown} holds another comparison, which is never overwritten; choose another --out"
        )),
        None if out.is_file() => Some(format!("{shown} is a file, not a folder; choose another --out")),
        None if fs::read_dir(out).is_ok_and(|mut entries| entries.next().is_some()) => {
            Some(format!("the folder {shown} is not empty and holds no comparison; choose another --out"))
        }
        None => None,
    };
    if let Some(refused) = refused {
        return Err(CompareError::usage(vec![refused]));
    }
    write_whole(&out.join("comparison.svg"), picture(comparison).as_bytes())?;
    Ok(write_whole(&place, text.as_bytes())?)
}

/// A run that was read.
struct Loaded {
    record: RunRecord,
    place: PathBuf,
    key: Option<String>,
}

/// Reads runs and gathers what is wrong with them.
struct Reading<'a> {
    load_gates: LoadGates<'a>,
    findings: Vec<String>,
    notes: Vec<String>,
    exit_code: u8,
}

impl Reading<'_> {
    fn side(&mut self, folders: &[PathBuf]) -> Vec<Loaded> {
        let mut side: Vec<Loaded> = Vec::new();
        for folder in folders.iter().flat_map(|folder| replicates_of(folder)) {
            let Some(run) = self.run(&folder) else { continue };
            let twin =
                side.iter().find(|other| other.place == run.place || (run.key.is_some() && other.key == run.key));
            if let Some(twin) = twin {
                self.findings.push(format!(
                    "{} is the same run as {}, not a replicate of it; give runs that differ by their seed",
                    run.record.name, twin.record.name
                ));
            } else {
                side.push(run);
            }
        }
        side
    }

    fn check_apart(&mut self, runs: &[Loaded], reference: &[Loaded]) {
        let both = runs.iter().filter(|run| reference.iter().any(|other| other.place == run.place));
        self.findings.extend(both.map(|run| format!("{} stands on both sides", run.record.name)));
    }

    fn run(&mut self, folder: &Path) -> Option<Loaded> {
        let shown = folder.display();
        let path = folder.join("summary.json");
        if !path.is_file() {
            self.findings.push(format!(
                "{shown} is no result of a run: it holds no summary.json; run a scene with --out {shown}"
            ));
            return None;
        }
        match self.read(folder, &path) {
            Ok(run) => Some(run),
            Err(CompareError { findings, exit_code }) => {
                if exit_code != exit_code::USAGE {
                    self.exit_code = exit_code;
                }
                self.findings.extend(findings);
                None
            }
        }
    }

    fn read(&mut self, folder: &Path, path: &Path) -> Result<Loaded, CompareError> {
        let summary = Summary::read(path)?;
        let shown = folder.display().to_string();
        if summary.outcome.exit_code != exit_code::DONE {
            let reason = &summary.outcome.reason;
            return Err(CompareError::usage(vec![format!(
                "{shown} did not come to its end ({reason}); finish it with --resume, or leave it out"
            )]));
        }
        let mut measures: BTreeMap<String, Option<f64>> = summary
            .measures
            .iter()
            .filter(|(_, v)| !v.is_string())
            .map(|(name, v)| (name.clone(), v.as_f64()))
            .collect();
        let heaps = self.heaps(folder, &summary, &mut measures)?;
        let gates = (self.load_gates)(folder)?;
        let place = fs::canonicalize(folder).map_err(|source| StorageError::system("find", folder, source))?;
        let record = RunRecord { name: shown, measures, gates, heaps };
        Ok(Loaded { record, place, key: key_of(folder) })
    }

    /// Surfaces of the heaps whose angle was measured; their centres of mass join the measures.
    fn heaps(
        &mut self,
        folder: &Path,
        summary: &Summary,
        measures: &mut BTreeMap<String, Option<f64>>,
    ) -> Result<Vec<HeapRecord>, CompareError> {
        if !measures.iter().any(|(name, value)| name.ends_with("_deg") && value.is_some()) {
            return Ok(Vec::new());
        }
        let scene = match scene_of(summary) {
            Ok(scene) => scene,
            Err(reason) => {
                let name = &summary.scene.name;
                self.notes.push(format!("{name}: surfaces and centres of mass of heaps are left out: {reason}"));
                return Ok(Vec::new());
            }
        };
        let mut heaps = Vec::new();
        for (prefix, state) in final_states(folder) {
            let measured = scene.measures.iter().filter_map(|measure| match &measure.kind {
                MeasureKind::AngleOfRepose { region, along } => {
                    Some((format!("{prefix}{}", measure.name), region, *along))
                }
                _ => None,
            });
            let measured: Vec<_> = measured
                .filter(|(name, ..)| measures.get(&format!("{name}_deg")).is_some_and(Option::is_some))
                .collect();
            if measured.is_empty() {
                continue;
            }
            let particles = final_state::read(&state)?;
            for (name, region, along) in measured {
                let Ok(heap) = angle_of_repose(&particles, scene.body, region, along) else { continue };
                let profile = surface_profile(&particles, region, along, heap.bin_width);
                let surface = profile.into_iter().flatten().map(|point| [point.position, point.height]).collect();
                let centre = centre_of_mass(&particles, scene.body, region);
                for (axis, letter) in ["x", "y", "z"].into_iter().enumerate() {
                    measures.insert(format!("{name}_heap_centre_{letter}_m"), centre.map(|centre| centre[axis]));
                }
                heaps.push(HeapRecord { measure: name, surface });
            }
        }
        Ok(heaps)
    }
}

/// A folder of replicates stands for all of them, any other for itself.
fn replicates_of(folder: &Path) -> Vec<PathBuf> {
    let Ok(entries) = fs::read_dir(folder.join("replicates")) else { return vec![folder.to_path_buf()] };
    let mut found: Vec<PathBuf> = entries.flatten().map(|entry| entry.path()).filter(|path| path.is_dir()).collect();
    found.sort();
    if found.is_empty() { vec![folder.to_path_buf()] } else { found }
}

/// The key of a run's result, where its folder tells.
fn key_of(folder: &Path) -> Option<String> {
    let record: Value = serde_json::from_slice(&fs::read(folder.join("run.json")).ok()?).ok()?;
    record["key"].as_str().map(str::to_owned)
}

/// The scene that was run: where its heaps are is not in the result.
fn scene_of(summary: &Summary) -> Result<Scene, String> {
    let file = &summary.scene.file;
    let bytes = fs::read(file).map_err(|error| format!("the scene {file} cannot be read ({error})"))?;
    if blake3::hash(&bytes).to_hex().as_str() != summary.scene.blake3 {
        return Err(format!("the scene {file} was changed after the run"));
    }
    let settings: Vec<(String, String)> = summary
        .scene
        .overrides
        .iter()
        .filter_map(|setting| setting.split_once('='))
        .map(|(key, value)| (key.to_owned(), value.to_owned()))
        .collect();
    scene::read(Path::new(file), &settings).map(|(scene, _)| scene).map_err(|findings| {
        let first = findings.first().map_or("", |finding| finding.what.as_str());
        format!("the scene {file} is no longer valid: {first}")
    })
}

/// Files of a run's last states, with what stands before the names of the measures taken there.
fn final_states(folder: &Path) -> Vec<(String, PathBuf)> {
    let mut folders = vec![(String::new(), folder.to_path_buf())];
    if let Ok(entries) = fs::read_dir(folder.join("stages")) {
        let mut stages: Vec<PathBuf> = entries.flatten().map(|entry| entry.path()).collect();
        stages.sort();
        let named = |stage: PathBuf| Some((format!("{}.", stage.file_name()?.to_str()?), stage));
        folders.extend(stages.into_iter().filter_map(named));
    }
    folders.into_iter().filter_map(|(prefix, folder)| Some((prefix, final_state::place(&folder)?))).collect()
}

#[cfg(test)]
mod tests;
