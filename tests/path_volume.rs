//! What recorded paths cost and what they are worth: size of the stream, error of the interpolation, and how far the split run of
//! a small hopper departs from the whole one, for every k-th time step stored.
//!
//! Not part of the ordinary suite, because it measures, and takes a minute of processor time: `./validate` runs it and keeps what it
//! prints as docs/validation/gate-paths.md.
#![expect(clippy::unwrap_used, reason = "a test fails by panicking")]

use std::collections::HashMap;
use std::fmt::Write;
use std::fs::File;
use std::io::{BufRead, BufReader};
use std::path::{Path, PathBuf};
use std::process::Command;
use tollgate::gate::crossing::Crossing;
use tollgate::gate::ghost::{RecordedPath, StreamTime};
use tollgate::gate::stream::reader::StreamReader;
use tollgate::math::{Vec3, vec3};

/// Time steps between two stored motions.
const EVERY: [u64; 3] = [1, 10, 100];
/// Heights of the gate plane \[mm\]: under the outlet, whose rim is at 200 mm, where the jet is free, and inside, where it is dense.
const HEIGHTS: [f64; 2] = [190.0, 203.0];
/// Times after the opening at which the runs are compared \[s\]; to the nearest frame.
const AFTER: [f64; 6] = [0.005, 0.01, 0.02, 0.05, 0.1, 0.2];
/// Largest diameter in the scene \[m\].
const DIAMETER: f64 = 0.005;

/// Runs the scene into `place` with more settings; why it was stopped, where it was.
fn run(place: &Path, more: &[String]) -> Result<(), String> {
    let scene = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/scenes/hopper");
    let settings = [
        "end.time=\"0.42 s\"",
        "end.at_rest.not_before=\"0.38 s\"",
        "output.formats=[\"lammps\"]",
        "output.frames=\"2.5 ms\"",
    ];
    let mut command = Command::new(env!("CARGO_BIN_EXE_tollgate"));
    command.arg("run").arg(scene).args(["--threads", "1", "--out"]).arg(place);
    for setting in settings {
        command.args(["--set", setting]);
    }
    let output = command.args(more).output().unwrap();
    let said = String::from_utf8_lossy(&output.stderr).into_owned();
    if output.status.success() { Ok(()) } else { Err(said) }
}

/// Places by identity at the frames of `steps`.
fn places(folder: &Path, steps: &[u64]) -> HashMap<u64, HashMap<u64, Vec3>> {
    let file = File::open(folder.join("dump.particles.lammpstrj")).unwrap();
    let mut lines = BufReader::new(file).lines().map(Result::unwrap);
    let mut frames = HashMap::new();
    while let Some(line) = lines.next() {
        assert_eq!(line, "ITEM: TIMESTEP");
        let step: u64 = lines.next().unwrap().parse().unwrap();
        let count: usize = lines.nth(1).unwrap().parse().unwrap();
        let columns = lines.nth(4).unwrap();
        assert!(columns.starts_with("ITEM: ATOMS id type x y z "), "{columns}");
        let rows = lines.by_ref().take(count);
        if !steps.contains(&step) {
            rows.for_each(drop);
            continue;
        }
        let place = |row: String| {
            let mut words = row.split_ascii_whitespace();
            let id = words.next().unwrap().parse::<u64>().unwrap();
            let numbers: Vec<f64> = words.skip(1).take(3).map(|word| word.parse().unwrap()).collect();
            (id, vec3(numbers[0], numbers[1], numbers[2]))
        };
        frames.insert(step, rows.map(place).collect());
    }
    frames
}

/// Step of each frame of a run.
fn frame_steps(folder: &Path) -> Vec<u64> {
    let file = File::open(folder.join("dump.particles.lammpstrj")).unwrap();
    let mut lines = BufReader::new(file).lines().map(Result::unwrap);
    let mut steps = Vec::new();
    while let Some(line) = lines.next() {
        if line == "ITEM: TIMESTEP" {
            steps.push(lines.next().unwrap().parse().unwrap());
        }
    }
    steps
}

/// The largest value and the median; zero of none.
fn largest_and_median(mut values: Vec<f64>) -> (f64, f64) {
    values.sort_by(f64::total_cmp);
    let median = values.get(values.len() / 2).copied().unwrap_or(0.0);
    (values.last().copied().unwrap_or(0.0), median)
}

/// Distances \[m\] of interpolated from true places at the steps that are not stored, where only every k-th motion is kept of paths
/// that have all.
fn interpolation_errors(stream: &StreamReader, every: u64) -> Vec<f64> {
    let origin = &stream.manifest().origin;
    let mut errors = Vec::new();
    for crossing in stream.crossings().map(Result::unwrap) {
        let first = crossing.path_start.next_multiple_of(every) - crossing.path_start;
        let path: Vec<_> = crossing.path.iter().skip(first as usize).step_by(every as usize).copied().collect();
        if path.is_empty() {
            continue;
        }
        let coarse = Crossing { path, path_start: crossing.path_start + first, ..crossing.clone() };
        let read = RecordedPath {
            crossing: &coarse,
            every,
            timestep: origin.timestep,
            gravity: origin.gravity,
            body: origin.body,
        };
        for (step, motion) in (crossing.path_start..).zip(&crossing.path).skip(first as usize) {
            let found = read.motion(StreamTime { step: step as i64, fraction: 0.0 });
            let stored = (step - coarse.path_start).is_multiple_of(every);
            assert!(!stored || found == *motion, "a stored motion comes back bit for bit");
            if !stored {
                errors.push((found.position - motion.position).norm());
            }
        }
    }
    errors
}

/// The whole run, and what it is compared by.
struct Whole {
    folder: PathBuf,
    steps: Vec<u64>,
    opening: f64,
}

impl Whole {
    fn new(folder: &Path) -> Self {
        run(&folder.join("whole"), &["--whole".to_owned()]).unwrap();
        let stage = folder.join("whole/stages/chute");
        let stream = StreamReader::open(&stage.join("streams/outlet")).unwrap();
        let events = &stream.manifest().events;
        let opening = events.iter().find(|event| event.part == "plate" && !event.present).unwrap().time;
        let timestep = stream.manifest().origin.timestep;
        let frames = frame_steps(&stage);
        let distance = |step: u64, time: f64| (step as f64 * timestep - time).abs();
        let nearest = |after: &f64| {
            let wanted = opening + after;
            *frames.iter().min_by(|a, b| distance(**a, wanted).total_cmp(&distance(**b, wanted))).unwrap()
        };
        let steps = AFTER.iter().map(nearest).collect();
        Self { folder: stage, steps, opening }
    }

    /// At each of the steps: particles beyond the plane, how many of them the split run lacks, and their distances from where the
    /// whole run has them \[m\].
    fn deviations(&self, split: &Path, height: f64) -> Vec<(usize, usize, Vec<f64>)> {
        let (ours, theirs) = (places(split, &self.steps), places(&self.folder, &self.steps));
        let at = |step: &u64| {
            // A run that was stopped has no more frames.
            let ours = ours.get(step)?;
            let beyond = theirs[step].iter().filter(|(_, place)| place.z < height * 1e-3);
            let found: Vec<Option<f64>> =
                beyond.map(|(id, place)| ours.get(id).map(|own| (own - place).norm())).collect();
            let missing = found.iter().filter(|distance| distance.is_none()).count();
            Some((found.len(), missing, found.into_iter().flatten().collect()))
        };
        self.steps.iter().map_while(at).collect()
    }
}

#[test]
#[ignore = "measures: seven runs of half a minute"]
fn volume_and_error_of_recorded_paths() {
    let folder = tempfile::tempdir().unwrap();
    let whole = Whole::new(folder.path());
    println!("The plate opens at {:.4} s.\n", whole.opening);
    let (mut volumes, mut departures) = (String::new(), String::new());
    for height in HEIGHTS {
        let plane = format!("gate.outlet.point_mm=[0,0,{height}]");
        let mut sizes = Vec::new();
        let mut errors = Vec::new();
        let mut all: Option<StreamReader> = None;
        for every in EVERY {
            let place = folder.path().join(format!("{height}-{every}"));
            let interval = format!("gate.outlet.paths.every={every}");
            let outcome = run(&place, &["--set".to_owned(), plane.clone(), "--set".to_owned(), interval]);
            let stream = StreamReader::open(&place.join("stages/hopper/streams/outlet")).unwrap();
            let (counts, chunks) = (stream.manifest().counts, &stream.manifest().chunks);
            let bytes: u64 = chunks.iter().map(|chunk| chunk.bytes).sum();
            let (crossings, motions) = (counts.crossings, counts.motions);
            let timestep = stream.manifest().origin.timestep;
            let (largest, median) = largest_and_median(interpolation_errors(all.get_or_insert(stream), every));
            if let Err(reason) = &outcome {
                // Ghosts that are told wrong places are driven into others.
                assert!(every > 1 && reason.contains("overlaps"), "{reason}");
                println!("- plane {height} mm, k = {every}: {}", reason.lines().next().unwrap_or_default());
            }
            writeln!(
                volumes,
                "| {height} | {every} | {crossings} | {motions} | {bytes} | {} | {largest:.1e} | {median:.1e} |",
                bytes / crossings
            )
            .unwrap();
            for ((step, (count, missing, distances)), after) in
                whole.steps.iter().zip(whole.deviations(&place.join("stages/chute"), height)).zip(AFTER)
            {
                let (far, middle) = largest_and_median(distances);
                let exact = 1e3 * (*step as f64 * timestep - whole.opening);
                writeln!(
                    departures,
                    "| {height} | {every} | {exact:.1} | {count} | {missing} | {far:.1e} | {middle:.1e} |"
                )
                .unwrap();
                // Shortly after the opening round-off has not grown yet: the exact replay is the whole run.
                assert!(every > 1 || after > 0.01 || far < 1e-9 * DIAMETER, "{far} m off, {after} s after the opening");
                assert!(every > 1 || missing == 0, "{missing} of {count} are missing");
            }
            sizes.push(bytes);
            errors.push((largest, median));
        }
        assert_eq!(errors[0], (0.0, 0.0), "every motion is stored");
        assert!(sizes[0] > 5 * sizes[1] && sizes[1] > sizes[2], "{sizes:?}");
        assert!(errors[2].1 > errors[1].1 && errors[1].1 > 0.0, "{errors:?}");
    }
    println!("\n## Volume, and error of the interpolation\n");
    println!(
        "| plane [mm] | k | crossings | motions | bytes | bytes a crossing | largest error [m] | median error [m] |"
    );
    println!("|---|---|---|---|---|---|---|---|\n{volumes}");
    println!("## Departure of the split run from the whole one\n");
    println!("| plane [mm] | k | after the opening [ms] | particles | missing | largest [m] | median [m] |");
    println!("|---|---|---|---|---|---|---|\n{departures}");
}
