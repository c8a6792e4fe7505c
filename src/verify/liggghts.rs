//! LIGGGHTS as an [`Experiment`]: each case becomes a deck of its own in a temporary folder, run by the installed binary.
//!
//! Positions, velocities and spins come from dumps of 17 digits at the end of time steps, where LIGGGHTS' velocities are full-step
//! ones. What is here needs no gate, feed or restart, so the deck is a small one, not that of a stage.

use super::{CaseSetup, Departure, Experiment, NotRun, Sample};
use crate::backend::liggghts::parameters::{self, Models};
use crate::backend::liggghts::{deck_number, probe};
use crate::geometry::part::{Surface, Trigger};
use crate::geometry::stl::write_stl_ascii;
use crate::math::{Vec3, vec3};
use crate::particle::{Body, ParticleState};
use std::fmt::Write as _;
use std::fs;
use std::path::Path;
use std::process::Command;

const DECK: &str = "in.liggghts";
const START: &str = "start.data";
const STATES: &str = "states.dump";
/// Numbers of a row of the dump: id, position, velocity, spin.
const COLUMNS: usize = 10;

/// Runs cases with the installed binary, one rank.
#[derive(Debug, Clone, Copy, Default)]
pub struct Liggghts;

impl Liggghts {
    /// Whether there is a LIGGGHTS that can be used.
    ///
    /// # Errors
    /// Why not, and what to install.
    pub fn available() -> Result<(), String> {
        probe::probe().map_err(|unusable| unusable.to_string())?;
        probe::Tools::find().missing(1).map_or(Ok(()), |missing| Err(missing.to_string()))
    }
}

impl Experiment for Liggghts {
    fn departures(&self) -> &'static [Departure] {
        DEPARTURES
    }

    fn run(&mut self, setup: &CaseSetup) -> Result<Vec<Sample>, NotRun> {
        let models = possible(setup)?;
        let folder = tempfile::tempdir().map_err(|error| format!("no temporary folder: {error}"))?;
        write_case(folder.path(), setup, &models).map_err(|error| format!("the case cannot be written: {error}"))?;
        launch(folder.path())?;
        let path = folder.path().join(STATES);
        let text = fs::read_to_string(&path).map_err(|error| format!("{STATES} cannot be read: {error}"))?;
        samples(&text, setup)
    }
}

/// Formulas of LIGGGHTS that show in the suite: docs/theory/conventions.md.
///
/// Each bound is a little above the largest difference found. It was computed beforehand for the lever arm at single impacts, by the
/// reference's equation of motion with r - delta / 2, and for the cap, by the dashpot's impulse gamma_t v dt / 2 of the first half step;
/// those of `chung-ooi-3` and `galilean-shift` were found by running them.
const DEPARTURES: &[Departure] = &[
    Departure {
        case: "chung-ooi-3",
        quantity: "slope of the rms error",
        bound: 0.06,
        is_relative: false,
        convention: "half-step velocities",
    },
    Departure {
        case: "chung-ooi-4",
        quantity: "e_t, total",
        bound: 2.2e-3,
        is_relative: false,
        convention: "lever arm at parts",
    },
    Departure {
        case: "chung-ooi-5",
        quantity: "steel",
        bound: 0.02,
        is_relative: false,
        convention: "lever arm at parts",
    },
    Departure {
        case: "chung-ooi-5",
        quantity: "polyethylene, psi",
        bound: 0.08,
        is_relative: false,
        convention: "lever arm at parts",
    },
    Departure {
        case: "slip-to-roll",
        quantity: "end of sliding",
        bound: 0.035,
        is_relative: true,
        convention: "cap on the spring alone",
    },
    Departure {
        case: "galilean-shift",
        quantity: "Hertz, total",
        bound: 1e-4,
        is_relative: false,
        convention: "spring kept after parting",
    },
];

/// The laws, where LIGGGHTS can do all that the setup asks for.
fn possible(setup: &CaseSetup) -> Result<Models, NotRun> {
    let mut reasons = Vec::new();
    if matches!(setup.body, Body::Disc { .. }) {
        reasons.push("LIGGGHTS knows spheres only, no discs".to_owned());
    }
    if setup.energy {
        reasons.push("LIGGGHTS keeps no energy budget of contacts".to_owned());
    }
    for part in &setup.parts {
        let lasts = part.appears == Trigger::Always && part.disappears == Trigger::Never && part.motion.is_static();
        if !lasts || matches!(part.surface, Surface::Frustum { .. }) {
            reasons.push(format!("`{}` is no plane and no mesh at rest", part.name));
        }
        if let Surface::Plane { normal, .. } = &part.surface
            && axis_of(normal).is_none()
        {
            reasons.push(format!("`{}` is a plane across no axis", part.name));
        }
    }
    match parameters::models(&setup.law, &setup.materials) {
        Ok(models) if reasons.is_empty() => Ok(models),
        Ok(_) => Err(NotRun::NotPossible(reasons.join("; "))),
        Err(faults) => Err(NotRun::NotPossible([reasons, faults].concat().join("; "))),
    }
}

/// The axis that a plane's normal points along.
fn axis_of(normal: &Vec3) -> Option<usize> {
    (0..3).find(|&axis| (normal[axis].abs() - 1.0).abs() < 1e-12)
}

fn write_case(folder: &Path, setup: &CaseSetup, models: &Models) -> std::io::Result<()> {
    fs::write(folder.join(DECK), deck(setup, models))?;
    fs::write(folder.join(START), start(&setup.particles))?;
    for (index, part) in setup.parts.iter().enumerate() {
        if let Surface::Mesh(mesh) = &part.surface {
            write_stl_ascii(mesh, "part", &mut fs::File::create(folder.join(mesh_file(index)))?)?;
        }
    }
    Ok(())
}

fn mesh_file(index: usize) -> String {
    format!("part_{index}.stl")
}

fn deck(setup: &CaseSetup, models: &Models) -> String {
    let mut text = system(setup, models) + &walls(setup, models);
    text.push_str("fix integration all nve/sphere\n");
    let g = setup.gravity;
    if g != Vec3::zeros() {
        let [x, y, z] = [g.x, g.y, g.z].map(deck_number);
        let _ = writeln!(text, "fix gravity all gravity {} vector {x} {y} {z}", deck_number(g.norm()));
    }
    let columns = "id x y z vx vy vz omegax omegay omegaz";
    let _ = writeln!(text, "dump states all custom {} {STATES} {columns}", setup.sample_every);
    let _ = writeln!(text, "dump_modify states sort id format \"%d{}\"", " %.17g".repeat(COLUMNS - 1));
    let _ = writeln!(text, "thermo {}\nrun {}", setup.steps.max(1), setup.steps);
    text
}

/// Planes as primitive walls, meshes as one wall of all.
fn walls(setup: &CaseSetup, models: &Models) -> String {
    let Models { wall_model: model, wall_options: options, .. } = models;
    let (mut text, mut meshes) = (String::new(), Vec::new());
    for (index, part) in setup.parts.iter().enumerate() {
        let kind = part.material + 1;
        if let Surface::Plane { point, normal } = &part.surface
            && let Some(axis) = axis_of(normal)
        {
            let plane = format!("{} {}", ["xplane", "yplane", "zplane"][axis], deck_number(point[axis]));
            let _ = writeln!(text, "fix wall_{index} all wall/gran {model} primitive type {kind} {plane} {options}");
        }
        if let Surface::Mesh(_) = &part.surface {
            let file = mesh_file(index);
            let _ = writeln!(text, "fix mesh_{index} all mesh/surface file {file} type {kind} curvature 1e-5");
            meshes.push(format!("mesh_{index}"));
        }
    }
    if !meshes.is_empty() {
        let (count, names) = (meshes.len(), meshes.join(" "));
        let _ = writeln!(text, "fix walls all wall/gran {model} mesh n_meshes {count} meshes {names} {options}");
    }
    text
}

fn system(setup: &CaseSetup, models: &Models) -> String {
    let bounds = setup.parts.iter().fold(setup.bounds, |mut bounds, part| {
        if let Surface::Mesh(mesh) = &part.surface {
            let own = mesh.bounds();
            for axis in 0..3 {
                bounds.minimum[axis] = bounds.minimum[axis].min(own.minimum[axis]);
                bounds.maximum[axis] = bounds.maximum[axis].max(own.maximum[axis]);
            }
        }
        bounds
    });
    // Meshes need bins; planes do not, and these domains are wide beside the particles.
    let search = if setup.parts.iter().any(|part| matches!(part.surface, Surface::Mesh(_))) { "bin" } else { "nsq" };
    let largest = setup.particles.iter().map(|p| p.radius).fold(0.0, f64::max);
    let edges: Vec<String> =
        (0..3).flat_map(|axis| [bounds.minimum[axis], bounds.maximum[axis]]).map(deck_number).collect();
    let mut text = String::from(
        "units si\natom_style granular\natom_modify map array sort 0 0\nboundary f f f\nnewton off\ncommunicate single vel yes\n",
    );
    let _ = writeln!(text, "region domain block {} units box", edges.join(" "));
    let _ = writeln!(text, "create_box {} domain", setup.materials.materials.len());
    let _ = writeln!(text, "neighbor {} {search}\nneigh_modify delay 0", deck_number(0.2 * largest));
    for property in &models.properties {
        let _ = writeln!(text, "{property}");
    }
    let _ = writeln!(text, "pair_style {}\npair_coeff * *", models.pair_style);
    let _ = writeln!(text, "timestep {}", deck_number(setup.timestep));
    let _ = writeln!(text, "read_data {START} add");
    text
}

/// Particles as a file for `read_data FILE add`: id, type, diameter, density, position; then velocity and spin.
fn start(particles: &[ParticleState]) -> String {
    let mut text = format!("start\n\n{} atoms\n\nAtoms\n\n", particles.len());
    for (tag, p) in (1..).zip(particles) {
        let [x, y, z] = p.position.into();
        let (d, density) = (2.0 * p.radius, p.density);
        let _ = writeln!(text, "{tag} {} {d:e} {density:e} {x:e} {y:e} {z:e}", p.material + 1);
    }
    text.push_str("\nVelocities\n\n");
    for (tag, p) in (1..).zip(particles) {
        let ([vx, vy, vz], [wx, wy, wz]): ([f64; 3], [f64; 3]) = (p.velocity.into(), p.spin.into());
        let _ = writeln!(text, "{tag} {vx:e} {vy:e} {vz:e} {wx:e} {wy:e} {wz:e}");
    }
    text
}

/// Runs the deck. Messages of a single rank get lost in a pipe unless the output is buffered by lines.
fn launch(folder: &Path) -> Result<(), NotRun> {
    let output = Command::new("stdbuf")
        .arg("-oL")
        .arg(probe::program())
        .args(["-in", DECK])
        .env("LC_ALL", "C")
        .current_dir(folder)
        .output()
        .map_err(|error| {
            format!("stdbuf and liggghts cannot be started ({error}); install: apt-get install liggghts")
        })?;
    let screen = String::from_utf8_lossy(&output.stdout);
    match scanned_error(&screen) {
        Some(error) => Err(format!("LIGGGHTS stopped: {error}").into()),
        None if output.status.success() => Ok(()),
        None => {
            let last = screen.lines().last().unwrap_or_default().to_owned();
            Err(format!("LIGGGHTS ended with {}; its last line: {last}", output.status).into())
        }
    }
}

/// The first error that LIGGGHTS printed, where it did: what stands in a line from `ERROR` on.
fn scanned_error(screen: &str) -> Option<&str> {
    screen.lines().find_map(|line| line.find("ERROR").map(|at| line[at..].trim_end()))
}

/// The frames of the dump. LIGGGHTS says nothing of particles that it loses or that are not-a-number.
fn samples(text: &str, setup: &CaseSetup) -> Result<Vec<Sample>, NotRun> {
    let mut samples = Vec::new();
    let mut lines = text.lines();
    while let Some(head) = lines.next() {
        if head != "ITEM: TIMESTEP" {
            return Err(format!("`{head}` where a frame should begin in {STATES}").into());
        }
        let step: u64 =
            lines.next().and_then(|line| line.trim().parse().ok()).ok_or("a frame without its time step")?;
        let rows = lines.by_ref().skip_while(|line| !line.starts_with("ITEM: ATOMS")).skip(1);
        let particles = rows
            .take(setup.particles.len())
            .zip(&setup.particles)
            .enumerate()
            .map(|(index, (row, start))| state(row, index + 1, start))
            .collect::<Option<Vec<ParticleState>>>()
            .filter(|particles| particles.len() == setup.particles.len())
            .ok_or_else(|| format!("a particle was lost or is not a number in time step {step}"))?;
        samples.push(Sample { time: step as f64 * setup.timestep, particles, energy: None });
    }
    let expected = setup.steps / setup.sample_every + 1;
    if samples.len() as u64 == expected {
        return Ok(samples);
    }
    Err(format!("{} of {expected} frames came back from LIGGGHTS", samples.len()).into())
}

fn state(row: &str, tag: usize, start: &ParticleState) -> Option<ParticleState> {
    let cells: Vec<f64> = row.split_whitespace().map(|cell| cell.parse().ok()).collect::<Option<_>>()?;
    let is_sound = cells.len() == COLUMNS && cells[0] == tag as f64 && cells.iter().all(|cell| cell.is_finite());
    is_sound.then(|| ParticleState {
        position: vec3(cells[1], cells[2], cells[3]),
        velocity: vec3(cells[4], cells[5], cells[6]),
        spin: vec3(cells[7], cells[8], cells[9]),
        ..*start
    })
}
