//! Result folders of two sets, written as runs write them.

use super::*;
use crate::analysis::compare::Verdict;
use crate::output::summary::Outcome;
use crate::storage::columns::ColumnWriter;

const SCENE: &str = r#"
version = 1
[contact]
law = "hertz-mindlin"
[domain]
min_mm = [-200, -50, -10]
max_mm = [200, 50, 200]
[material.glass]
density = "2500 kg/m3"
youngs_modulus = "1 MPa"
poissons_ratio = 0.25
[material.wall]
youngs_modulus = "rigid"
[[pair]]
between = ["glass", "glass"]
restitution = 0.5
friction = 0.5
[[pair]]
between = ["glass", "wall"]
restitution = 0.5
friction = 0.5
[particle.bead]
material = "glass"
diameter_mm = 10
[[part]]
name = "floor"
material = "wall"
shape = "plane"
point_mm = [0, 0, 0]
normal = [0, 0, 1]
[[feed]]
name = "fill"
kind = "fill"
particle = "bead"
region = { shape = "box", min_mm = [-20, -20, 5], max_mm = [20, 20, 100] }
amount = 20
[[measure]]
name = "heap"
kind = "angle-of-repose"
along = "x"
region = { min_mm = [-200, -50, -10], max_mm = [200, 50, 200] }
[end]
time = "1 s"
"#;

struct Bench {
    folder: tempfile::TempDir,
}

impl Bench {
    fn new() -> Self {
        let folder = tempfile::tempdir().unwrap();
        fs::write(folder.path().join("scene.toml"), SCENE).unwrap();
        Self { folder }
    }

    fn path(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    /// A run whose last state is a heap of slope `slope`, in stage `stage` where there is one.
    fn run(&self, name: &str, stage: Option<&str>, slope: f64) -> PathBuf {
        let folder = self.path(name);
        let state = stage.map_or_else(|| folder.clone(), |stage| folder.join("stages").join(stage));
        fs::create_dir_all(&state).unwrap();
        let file = self.path("scene.toml");
        let mut summary = Summary::default();
        summary.scene.name = "heap".into();
        summary.scene.file = file.display().to_string();
        summary.scene.blake3 = blake3::hash(&fs::read(&file).unwrap()).to_hex().to_string();
        summary.outcome = Outcome { exit_code: 0, reason: "time".into(), time_s: 1.0 };
        let prefix = stage.map_or_else(String::new, |stage| format!("{stage}."));
        summary.measure(&format!("{prefix}heap_deg"), slope.atan().to_degrees());
        summary.measure(&format!("{prefix}heap_uncertainty_deg"), 0.5);
        summary.measure(&format!("{prefix}heap_note"), "slope");
        summary.write(&folder.join("summary.json")).unwrap();
        fs::write(folder.join("run.json"), format!("{{\"key\": \"{name}\"}}")).unwrap();
        // A flank of 30 columns of beads, 8 deep.
        let mut spheres = Vec::new();
        for k in 0..240 {
            let (place, depth) = (f64::from(k / 8) * 0.01, f64::from(k % 8) * 0.01);
            spheres.extend([-0.15 + place, -0.035 + depth, 0.19 - slope * place, 0.005]);
        }
        let mut writer = ColumnWriter::new("checkpoint");
        let (densities, ids, materials) = (vec![2500.0; 240], (0..240).collect::<Vec<u64>>(), vec![0_u64; 240]);
        writer.column("sphere", spheres.as_slice());
        writer.column("density", densities.as_slice());
        writer.column("id", ids.as_slice());
        writer.column("material", materials.as_slice());
        writer.write(&state.join("state.checkpoint")).unwrap();
        folder
    }

    fn set(&self, name: &str, stage: Option<&str>, slopes: &[f64]) -> Vec<PathBuf> {
        slopes.iter().enumerate().map(|(k, slope)| self.run(&format!("{name}{k}"), stage, *slope)).collect()
    }
}

fn no_gates(_: &Path) -> Result<Vec<GateRecord>, StorageError> {
    Ok(Vec::new())
}

fn request(runs: &[PathBuf], reference: &[PathBuf]) -> CompareRequest {
    CompareRequest { runs: runs.to_vec(), reference: reference.to_vec(), ..CompareRequest::default() }
}

#[test]
fn heaps_are_read_from_the_last_state() {
    let bench = Bench::new();
    // Of stages on one side, whole on the other.
    let split = bench.set("split", Some("chute"), &[0.50, 0.51, 0.52]);
    let whole = bench.set("whole", None, &[0.50, 0.51, 0.52]);
    let found = compare_with(&request(&split, &whole), &no_gates).unwrap();
    let names: Vec<&str> = found.measures.iter().map(|measure| measure.name.as_str()).collect();
    let expected = ["chute.heap", "chute.heap_heap_centre_x", "chute.heap_heap_centre_y", "chute.heap_heap_centre_z"];
    assert_eq!(names, expected, "{:?}", found.notes);
    assert_eq!(found.curves[0].name, "chute.heap.surface");
    for measure in &found.measures {
        assert_eq!(measure.difference, Some(0.0), "{}", measure.name);
    }
    // The centre of a flank of 30 columns from x = -0.15 m: half of its length of 0.29 m on.
    let centre = found.measures[1].runs.as_ref().unwrap().mean;
    assert!((centre - (-0.15 + 0.145)).abs() < 1e-12, "{centre}");
    // The surface ends 0.29 m (0.50 to 0.52) below its beginning.
    let surface = found.curves[0].runs.as_ref().unwrap();
    let fall = surface.mean[0] - surface.mean[surface.mean.len() - 1];
    assert!((fall - 0.51 * 0.29).abs() < 1e-9, "{fall}");
    assert!(found.notes.is_empty(), "{:?}", found.notes);
}

#[test]
fn a_steeper_heap_differs_and_its_surface_too() {
    let bench = Bench::new();
    let steep = bench.set("steep", None, &[0.60, 0.601, 0.602, 0.599]);
    let flat = bench.set("flat", None, &[0.50, 0.501, 0.502, 0.499]);
    let found = compare_with(&request(&steep, &flat), &no_gates).unwrap();
    assert_eq!(found.measures[0].verdict, Verdict::Differs);
    assert_eq!(found.curves[0].verdict, Verdict::Differs);
    // 0.1 steeper over 0.29 m, at the lower end.
    assert!((found.curves[0].difference.unwrap() - 0.029).abs() < 1e-9, "{:?}", found.curves[0].difference);
}

#[test]
fn replicates_stand_for_all_of_them_and_gates_are_asked_for() {
    let bench = Bench::new();
    let slopes = [0.50, 0.51, 0.52];
    bench.set("a/replicates/00", None, &slopes);
    let whole = bench.set("b", None, &slopes);
    let gates = |folder: &Path| {
        assert!(folder.join("summary.json").is_file());
        let gate = GateRecord {
            gate: "outlet".into(),
            times: (0..50).map(f64::from).collect(),
            masses: vec![0.1; 50],
            normal_speeds: vec![1.0; 50],
            diameters: vec![0.01; 50],
        };
        Ok(vec![gate])
    };
    let found = compare_with(&request(&[bench.path("a")], &whole), &gates).unwrap();
    assert_eq!(found.runs.len(), 3);
    assert!(found.runs[0].ends_with("a/replicates/000"), "{:?}", found.runs);
    assert!(found.measures.iter().any(|measure| measure.name == "gate.outlet.mass_flow_rate"));
    let broken = |folder: &Path| Err(StorageError::unusable(folder, "it is torn"));
    let refused = compare_with(&request(&[bench.path("a")], &whole), &broken).unwrap_err();
    assert_eq!((refused.exit_code(), refused.findings.len()), (exit_code::STREAM_UNUSABLE, 6));
}

#[test]
fn everything_wrong_with_the_folders_is_said_at_once() {
    let bench = Bench::new();
    let a = bench.run("a", None, 0.5);
    let b = bench.run("b", None, 0.5);
    let stopped = bench.run("stopped", None, 0.5);
    let mut summary = Summary::read(&stopped.join("summary.json")).unwrap();
    summary.outcome = Outcome { exit_code: exit_code::INTERRUPTED, reason: "interrupted".into(), time_s: 0.1 };
    summary.write(&stopped.join("summary.json")).unwrap();
    let copy = bench.run("copy", None, 0.5);
    fs::copy(a.join("run.json"), copy.join("run.json")).unwrap();
    let request = request(&[a.clone(), copy, stopped, b.clone()], &[b, bench.path("nowhere")]);
    let findings = compare_with(&request, &no_gates).unwrap_err().findings;
    let told = [
        "is the same run as",
        "did not come to its end (interrupted)",
        "holds no summary.json",
        "stands on both sides",
    ];
    assert_eq!(findings.len(), told.len(), "{findings:#?}");
    for words in told {
        assert!(findings.iter().any(|finding| finding.contains(words)), "{words}: {findings:#?}");
    }
}

#[test]
fn a_changed_scene_leaves_the_surfaces_out_and_says_so() {
    let bench = Bench::new();
    let a = bench.set("a", None, &[0.50, 0.51]);
    let b = bench.set("b", None, &[0.50, 0.51]);
    fs::write(bench.path("scene.toml"), format!("{SCENE}# changed\n")).unwrap();
    let found = compare_with(&request(&a, &b), &no_gates).unwrap();
    assert_eq!((found.measures.len(), found.curves.len(), found.notes.len()), (1, 0, 1));
    assert!(found.notes[0].contains("was changed after the run"), "{:?}", found.notes);
}

#[test]
fn a_comparison_is_written_and_never_overwritten() {
    let bench = Bench::new();
    let (a, b) = (bench.set("a", None, &[0.50, 0.51]), bench.set("b", None, &[0.50, 0.51]));
    let mut request = CompareRequest { out: Some(bench.path("out")), ..request(&a, &b) };
    compare_with(&request, &no_gates).unwrap();
    let bytes = fs::read(bench.path("out/comparison.json")).unwrap();
    let value: Value = serde_json::from_slice(&bytes).unwrap();
    assert_eq!(value["format_major"], 1);
    assert!(fs::read_to_string(bench.path("out/comparison.svg")).unwrap().starts_with("<svg"));
    compare_with(&request, &no_gates).unwrap();
    request.margins = vec![("heap".into(), "5 deg".into())];
    let refused = compare_with(&request, &no_gates).unwrap_err();
    assert!(refused.findings[0].contains("never overwritten"), "{refused:?}");
    assert_eq!(fs::read(bench.path("out/comparison.json")).unwrap(), bytes);
    request.out = Some(a[0].clone());
    assert!(compare_with(&request, &no_gates).unwrap_err().findings[0].contains("is not empty"));
}
