//! What a deck prints in time, as `series.csv`.

use super::replay::Prepared;
use super::{Schedule, files};
use crate::backend::Removal;
use crate::math::Vec3;
use crate::output::series::{SeriesRow, SeriesWriter, mass_column};
use crate::scene::{MeasureKind, Scene};
use crate::storage::StorageError;
use std::fs::File;
use std::io::{BufRead, BufReader};
use std::path::Path;

/// Columns that every series begins with.
const COLUMNS: [&str; 7] =
    ["step", "time_s", "atoms", "kinetic_energy_J", "rotational_energy_J", "rms_speed_m_per_s", "max_speed_m_per_s"];

/// Particles and time step of one row.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Count {
    step: u64,
    particles: u64,
}

/// Particles times time steps, the number of particles taken as linear between two rows.
#[must_use]
pub fn particle_steps(counts: &[Count]) -> f64 {
    let between = |pair: &[Count]| {
        0.5 * (pair[0].particles + pair[1].particles) as f64 * (pair[1].step.saturating_sub(pair[0].step)) as f64
    };
    counts.windows(2).map(between).sum()
}

/// Writes `series.csv` of a result folder from what a case has printed.
///
/// # Errors
/// When what was printed is not what the deck says, or the disk refuses.
pub fn convert(
    scene: &Scene,
    schedule: &Schedule,
    case: &Path,
    folder: &Path,
    removed: &[Removal],
    prepared: &Prepared,
) -> Result<Vec<Count>, StorageError> {
    let path = case.join(files::SERIES);
    let file = File::open(&path).map_err(|source| StorageError::system("open", &path, source))?;
    let mut lines = BufReader::new(file).lines();
    let mut next = || lines.next().transpose().map_err(|source| StorageError::system("read", &path, source));
    let header = next()?.unwrap_or_default();
    let names: Vec<&str> = header.split_ascii_whitespace().collect();
    if !names.starts_with(&COLUMNS) {
        return Err(StorageError::unusable(&path, format!("it begins with {header:?} instead of its columns")));
    }
    let mut planes = planes(scene);
    let mut removed = removed.iter().peekable();
    let (mut gone, mut taken) = (0, 0.0);
    let mut entering = prepared.particles.iter().peekable();
    let (mut inserted, mut brought) = (0, 0.0);
    let mut writer = SeriesWriter::create(&folder.join("series.csv"))?;
    let mut counts: Vec<Count> = Vec::new();
    while let Some(line) = next()? {
        // LIGGGHTS puts a title of its own, an empty one, behind ours.
        if line.trim().is_empty() {
            continue;
        }
        let values: Option<Vec<f64>> = line.split_ascii_whitespace().map(|text| text.parse().ok()).collect();
        let values = values
            .filter(|values| values.len() == names.len())
            .ok_or_else(|| StorageError::unusable(&path, format!("a row is damaged or half written: {line:?}")))?;
        let step = values[0] as u64;
        // Printed once more where a run of samples begins at the step at which the last one ended.
        if counts.last().is_some_and(|last| last.step >= step) {
            continue;
        }
        let time = schedule.time(step);
        // A row is printed before particles are taken out at its time step, and before others enter.
        while let Some(removal) = removed.next_if(|removal| removal.time < time - 0.5 * schedule.timestep) {
            gone += 1;
            taken += removal.mass;
            planes.iter_mut().for_each(|plane| plane.take(removal));
        }
        while let Some(entered) = entering.next_if(|entered| entered.step < step.max(1)) {
            inserted += 1;
            brought += scene.body.mass(entered.radius, entered.density);
        }
        let further = names.iter().zip(&values).skip(COLUMNS.len()).map(|(name, value)| {
            let beyond = planes.iter().find(|plane| plane.column == *name).map_or(0.0, |plane| plane.taken_beyond);
            ((*name).to_owned(), value + beyond)
        });
        let row = SeriesRow {
            time,
            step,
            particles: values[2] as u64,
            mass: brought - taken,
            kinetic_energy: values[3],
            rotational_energy: values[4],
            rms_speed: values[5],
            maximum_speed: values[6],
            inserted,
            removed: gone,
            further: further.collect(),
            ..SeriesRow::default()
        };
        counts.push(Count { step, particles: row.particles });
        writer.add(&row)?;
    }
    Ok(counts)
}

/// A plane that a mass flow rate is measured at.
#[derive(Debug)]
struct Plane {
    column: String,
    point: Vec3,
    normal: Vec3,
    /// Mass of what was taken out beyond it so far [kg]: it has passed, although nobody counts it any more.
    taken_beyond: f64,
}

impl Plane {
    fn take(&mut self, removal: &Removal) {
        if (Vec3::from(removal.position) - self.point).dot(&self.normal) >= 0.0 {
            self.taken_beyond += removal.mass;
        }
    }
}

fn planes(scene: &Scene) -> Vec<Plane> {
    let plane = |measure: &crate::scene::Measure| match measure.kind {
        MeasureKind::MassFlowRate { point, normal } => {
            Some(Plane { column: mass_column(&measure.name), point, normal, taken_beyond: 0.0 })
        }
        _ => None,
    };
    scene.measures.iter().filter_map(plane).collect()
}
