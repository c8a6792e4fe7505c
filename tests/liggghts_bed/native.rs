//! The bed on the native solver, in the conventions of LIGGGHTS, as a user would run it: from a scene to a folder of results.

use crate::bed::Bed;
use crate::state::{read_dump, write_table};
use std::fs;
use std::path::Path;
use std::sync::atomic::AtomicBool;
use tollgate::particle::ParticleState;
use tollgate::run::{RunRequest, run as run_scene};

/// State after `steps` steps.
pub fn run(bed: &Bed, start: &[ParticleState], steps: u64, threads: usize) -> Vec<ParticleState> {
    let folder = tempfile::tempdir_in(bed.folder()).unwrap();
    write_table(&folder.path().join("fill_bed.csv"), start);
    let scene = Path::new(env!("CARGO_MANIFEST_DIR")).join("benches/peers/decks/box.toml");
    fs::copy(scene, folder.path().join("scene.toml")).unwrap();
    let out = folder.path().join("out");
    let request = RunRequest {
        scene: folder.path().join("scene.toml"),
        settings: settings(bed, steps),
        out: Some(out.clone()),
        threads: Some(threads),
        ..RunRequest::default()
    };
    let report = run_scene(&request, &AtomicBool::new(false)).unwrap_or_else(|error| panic!("{error:?}"));
    read_dump(&dump_in(&report.folder))
}

/// What differs from the scene of 20 000 spheres.
fn settings(bed: &Bed, steps: u64) -> Vec<(String, String)> {
    let size = bed.size();
    let corner = format!("[\"{} m\", \"{} m\", \"{} m\"]", size.x, size.y, size.z);
    let mut settings = vec![
        ("contact.compatibility".into(), "liggghts".into()),
        ("domain.max".into(), corner.clone()),
        ("solver.timestep".into(), "10 us".into()),
        ("solver.skin".into(), "0.5 mm".into()),
        ("end.time".into(), format!("{} us", 10 * steps)),
        ("output".into(), "{ formats = [\"lammps\"] }".into()),
    ];
    for part in ["right", "back", "lid"] {
        settings.push((format!("part.{part}.point"), corner.clone()));
    }
    settings
}

/// The one text dump of a run's folder.
fn dump_in(folder: &Path) -> std::path::PathBuf {
    let mut found: Vec<_> =
        walk(folder).into_iter().filter(|path| path.extension().is_some_and(|e| e == "lammpstrj")).collect();
    assert_eq!(found.len(), 1, "{found:?}");
    found.remove(0)
}

fn walk(folder: &Path) -> Vec<std::path::PathBuf> {
    let entries = fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path());
    entries.flat_map(|path| if path.is_dir() { walk(&path) } else { vec![path] }).collect()
}
