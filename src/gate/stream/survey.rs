//! What a stream contains: counts, flow, sizes, speeds, contacts, and what follows for the place of the cut.

use super::advice::{Advice, advise};
use super::columns::row_bytes;
use super::format::{Manifest, Range};
use super::reader::StreamReader;
use crate::gate::crossing::Crossing;
use crate::storage::StorageError;
use serde::Serialize;

/// Intervals of equal length into which the range of passages is cut.
const INTERVALS: usize = 10;

/// What a stream contains.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Survey {
    /// The stream's manifest, without its list of chunks.
    pub manifest: Manifest,
    /// Digest of its content.
    pub digest: String,
    /// Chunk files.
    pub chunks: u64,
    /// Bytes of the columns, by what they hold.
    pub bytes: Bytes,
    /// Time between the first and the last passage [s].
    pub duration_s: f64,
    /// Mass over duration [kg/s]; `None` where the duration is zero.
    pub mass_flow_kg_per_s: Option<f64>,
    /// The same in tenths of the duration [kg/s]; empty where the duration is zero.
    pub mass_flow_by_tenths_kg_per_s: Vec<f64>,
    /// Diameters by number [m].
    pub diameter_m: Spread,
    /// Speeds normal to the plane at the passage [m/s].
    pub normal_speed_m_per_s: Spread,
    /// Share of crossings with a contact [-]; `None` where contacts were not recorded or nothing crossed.
    pub contact_share: Option<f64>,
    /// Length L2 of the generation zone that `slow_share` is meant for [m].
    pub generation_length_m: f64,
    /// Share of crossings with |v_n| < sqrt(2 g L2) [-]: a free fall from rest over L2 is faster.
    pub slow_share: f64,
    /// What follows.
    pub advice: Advice,
}

/// Bytes by what they hold.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize)]
pub struct Bytes {
    /// Crossings.
    pub crossings: u64,
    /// Contacts.
    pub contacts: u64,
    /// Paths.
    pub paths: u64,
    /// The chunk files as a whole, with their headers.
    pub files: u64,
}

/// Spread of a quantity by number; zeros where there is nothing.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize)]
pub struct Spread {
    /// Smallest.
    pub minimum: f64,
    /// 1 % are below.
    pub p1: f64,
    /// 10 % are below.
    pub p10: f64,
    /// Median.
    pub p50: f64,
    /// 90 % are below.
    pub p90: f64,
    /// Largest.
    pub maximum: f64,
}

/// Values of which at most [`Thinned::LIMIT`] are kept, evenly over their order, so that a stream of any size is surveyed
/// in bounded memory. Minimum and maximum are exact.
#[derive(Debug)]
struct Thinned {
    values: Vec<f64>,
    stride: u64,
    seen: u64,
    minimum: f64,
    maximum: f64,
}

impl Thinned {
    const LIMIT: usize = 1 << 20;

    const fn new() -> Self {
        Self { values: Vec::new(), stride: 1, seen: 0, minimum: f64::INFINITY, maximum: f64::NEG_INFINITY }
    }

    fn push(&mut self, value: f64) {
        if self.seen.is_multiple_of(self.stride) {
            self.values.push(value);
        }
        self.seen += 1;
        self.minimum = self.minimum.min(value);
        self.maximum = self.maximum.max(value);
        if self.values.len() >= Self::LIMIT {
            let mut even = false;
            self.values.retain(|_| {
                even = !even;
                even
            });
            self.stride *= 2;
        }
    }

    fn spread(mut self) -> Spread {
        if self.values.is_empty() {
            return Spread::default();
        }
        self.values.sort_unstable_by(f64::total_cmp);
        // Nearest rank: the smallest value with at least the share p of all at or below it.
        let at = |p: f64| self.values[((p * self.values.len() as f64).ceil() as usize).clamp(1, self.values.len()) - 1];
        Spread { minimum: self.minimum, p1: at(0.01), p10: at(0.1), p50: at(0.5), p90: at(0.9), maximum: self.maximum }
    }
}

/// Surveys a stream; every chunk is checked as it is read. `progress` is told the chunks done.
///
/// # Errors
/// When the stream is unusable.
pub fn survey(reader: &StreamReader, mut progress: impl FnMut(usize)) -> Result<Survey, StorageError> {
    let manifest = reader.manifest();
    let mut gathered = Gathered::new(manifest);
    for index in 0..reader.chunk_count() {
        reader.chunk(index)?.iter().for_each(|crossing| gathered.add(crossing));
        progress(index + 1);
    }
    Ok(gathered.survey())
}

struct Gathered<'a> {
    manifest: &'a Manifest,
    generation_length: f64,
    slow_speed: f64,
    mass: [f64; INTERVALS],
    diameters: Thinned,
    speeds: Thinned,
    in_contact: u64,
    slow: u64,
    fastest: f64,
    /// Speeds where no path length says what L2 is: the largest diameter does, and it is known at the end only.
    counted_late: Thinned,
}

impl<'a> Gathered<'a> {
    fn new(manifest: &'a Manifest) -> Self {
        let generation_length = manifest.origin.paths.map_or(0.0, |paths| paths.length);
        Self {
            manifest,
            generation_length,
            slow_speed: free_fall_speed(manifest, generation_length),
            mass: [0.0; INTERVALS],
            diameters: Thinned::new(),
            speeds: Thinned::new(),
            in_contact: 0,
            slow: 0,
            fastest: 0.0,
            counted_late: Thinned::new(),
        }
    }

    fn add(&mut self, crossing: &Crossing) {
        let origin = &self.manifest.origin;
        let speed = crossing.passage.velocity.dot(&origin.plane.normal);
        self.speeds.push(speed);
        self.diameters.push(2.0 * crossing.state.radius);
        self.in_contact += u64::from(!crossing.contacts.is_empty());
        if self.generation_length > 0.0 {
            self.slow += u64::from(speed.abs() < self.slow_speed);
        } else {
            self.counted_late.push(speed.abs());
        }
        self.fastest = self.fastest.max(crossing.passage.velocity.norm());
        if let Some(Range { first_time, last_time, .. }) = self.manifest.counts.range {
            let share = (crossing.passage.time - first_time) / (last_time - first_time);
            // The last passage, and all of them where they come at once, belong to an interval too.
            let interval = ((share * INTERVALS as f64) as usize).min(INTERVALS - 1);
            self.mass[interval] += origin.body.mass(crossing.state.radius, crossing.state.density);
        }
    }

    fn survey(self) -> Survey {
        let Self { manifest, .. } = self;
        let counts = &manifest.counts;
        let total = counts.crossings as f64;
        let duration_s = counts.range.map_or(0.0, |range| range.last_time - range.first_time);
        let diameter_m = self.diameters.spread();
        let late = self.generation_length == 0.0;
        let generation_length_m = if late { diameter_m.maximum } else { self.generation_length };
        let slow_share = if late {
            let limit = free_fall_speed(manifest, generation_length_m);
            let values = &self.counted_late.values;
            values.iter().filter(|speed| **speed < limit).count() as f64 / values.len().max(1) as f64
        } else {
            self.slow as f64 / total.max(1.0)
        };
        let contact_share = (manifest.origin.contacts && total > 0.0).then(|| self.in_contact as f64 / total);
        let rows = row_bytes();
        let (per_crossing, per_contact, per_motion) = rows;
        let flows = duration_s > 0.0;
        let per_interval = |mass: &f64| mass / (duration_s / INTERVALS as f64);
        Survey {
            manifest: Manifest { chunks: Vec::new(), ..manifest.clone() },
            digest: manifest.digest(),
            chunks: manifest.chunks.len() as u64,
            bytes: Bytes {
                crossings: per_crossing * counts.crossings,
                contacts: per_contact * counts.contacts,
                paths: per_motion * counts.motions,
                files: manifest.chunks.iter().map(|chunk| chunk.bytes).sum(),
            },
            duration_s,
            mass_flow_kg_per_s: flows.then(|| counts.mass / duration_s),
            mass_flow_by_tenths_kg_per_s: if flows { self.mass.iter().map(per_interval).collect() } else { vec![] },
            normal_speed_m_per_s: self.speeds.spread(),
            contact_share,
            generation_length_m,
            slow_share,
            advice: advise(manifest, contact_share, diameter_m.maximum, self.fastest),
            diameter_m,
        }
    }
}

/// Speed sqrt(2 g L) [m/s] after a free fall over `length` [m].
fn free_fall_speed(manifest: &Manifest, length: f64) -> f64 {
    (2.0 * manifest.origin.gravity.norm() * length).sqrt()
}

impl Survey {
    /// The survey in words.
    #[must_use]
    pub fn to_text(&self) -> String {
        let Manifest { origin, counts, events, quality, .. } = &self.manifest;
        let mut lines = vec![format!(
            "stream of gate {:?}, recorded by stage {:?} on {} {}",
            origin.gate, origin.stage, origin.backend, origin.backend_version
        )];
        let mut row = |name: &str, text: String| lines.push(format!("  {name:<18}{text}"));
        let plane = &origin.plane;
        let (point, normal) = (super::format::vector(&plane.point), super::format::vector(&plane.normal));
        row("plane", format!("through {point} m, normal {normal}, {}", aperture(plane)));
        row("digest", self.digest.clone());
        origin.provenance.iter().for_each(|step| row("since then", step.clone()));
        row("crossings", format!("{}, {:.6} kg", counts.crossings, counts.mass));
        if let Some(Range { first_step, last_step, first_time, last_time }) = counts.range {
            row("passages", format!("from {first_time:.6} s to {last_time:.6} s, steps {first_step} to {last_step}"));
        }
        if let Some(flow) = self.mass_flow_kg_per_s {
            let tenths: Vec<String> = self.mass_flow_by_tenths_kg_per_s.iter().map(|f| format!("{f:.4}")).collect();
            row("mass flow", format!("{flow:.4} kg/s; by tenths of the time: {}", tenths.join(" ")));
        }
        row("diameter", format!("{} mm", spread(&self.diameter_m, 1e3)));
        row("normal speed", format!("{} m/s", spread(&self.normal_speed_m_per_s, 1.0)));
        let contact = self.contact_share.map_or("not recorded".to_owned(), percent);
        row("with contact", contact);
        let length = 1e3 * self.generation_length_m;
        row("slow", format!("{} slower than a free fall over {length:.3} mm", percent(self.slow_share)));
        for event in events {
            let what = if event.present { "appeared" } else { "disappeared" };
            row("event", format!("{:.6} s: {:?} {what}", event.time, event.part));
        }
        quality_rows(quality, "", &mut |name, text| row(name, text));
        let Bytes { crossings, contacts, paths, files } = self.bytes;
        let (chunks, motions) = (self.chunks, counts.motions);
        row(
            "bytes",
            format!(
                "{files} in {chunks} files: crossings {crossings}, contacts {contacts} ({}), paths {paths} ({motions} \
                 motions)",
                counts.contacts
            ),
        );
        self.advice.lines().into_iter().for_each(|(name, text)| row(name, text));
        lines.join("\n")
    }
}

fn aperture(plane: &crate::geometry::plane::GatePlane) -> String {
    use crate::geometry::plane::Aperture;
    match plane.aperture {
        Aperture::Unbounded => "unbounded".to_owned(),
        Aperture::Disc { radius } => format!("disc of radius {radius} m"),
        Aperture::Rectangle { side_a, side_b } => format!("rectangle of {} m x {} m", side_a.norm(), side_b.norm()),
    }
}

fn spread(spread: &Spread, factor: f64) -> String {
    let Spread { minimum, p1, p10, p50, p90, maximum } = spread;
    let [minimum, p1, p10, p50, p90, maximum] = [minimum, p1, p10, p50, p90, maximum].map(|value| value * factor);
    format!("{minimum:.4} to {maximum:.4}; 1 % below {p1:.4}, 10 % {p10:.4}, 50 % {p50:.4}, 90 % {p90:.4}")
}

fn percent(share: f64) -> String {
    format!("{:.1} %", 100.0 * share)
}

/// The recording stage's own figures, whatever they are: one row a number or word, lists left out.
fn quality_rows(value: &serde_json::Value, name: &str, row: &mut dyn FnMut(&str, String)) {
    match value {
        serde_json::Value::Object(fields) => {
            for (key, value) in fields {
                let name = if name.is_empty() { key.clone() } else { format!("{name}.{key}") };
                quality_rows(value, &name, row);
            }
        }
        serde_json::Value::Array(_) | serde_json::Value::Null => {}
        other => row("recorded", format!("{name}: {}", other.as_str().map_or(other.to_string(), str::to_owned))),
    }
}

#[cfg(test)]
mod tests {
    use super::super::sample;
    use super::*;
    use std::fs;

    #[test]
    fn ranks_of_a_hundred_numbers() {
        let mut values = Thinned::new();
        (1..=100).rev().for_each(|number| values.push(f64::from(number)));
        let spread = values.spread();
        assert_eq!(spread, Spread { minimum: 1.0, p1: 1.0, p10: 10.0, p50: 50.0, p90: 90.0, maximum: 100.0 });
        assert_eq!(Thinned::new().spread(), Spread::default());
    }

    #[test]
    fn a_thinned_series_keeps_its_ranks() {
        let mut values = Thinned::new();
        let count = 5 * Thinned::LIMIT as u64;
        (0..count).for_each(|number| values.push(number as f64));
        assert!(values.values.len() < Thinned::LIMIT);
        let spread = values.spread();
        assert_eq!((spread.minimum, spread.maximum), (0.0, (count - 1) as f64));
        // Every eighth value is left, so a rank is met within eight.
        assert!((spread.p50 - 0.5 * count as f64).abs() <= 8.0);
        assert!((spread.p90 - 0.9 * count as f64).abs() <= 8.0);
    }

    #[test]
    fn a_survey_adds_up_and_speaks_of_the_whole_stream() {
        let folder = tempfile::tempdir().unwrap();
        let place = folder.path().join("outlet");
        let count = 9000;
        let manifest = sample::write(&place, count);
        let survey = survey(&StreamReader::open(&place).unwrap(), |_| {}).unwrap();
        let all: Vec<Crossing> = (0..count).map(sample::crossing).collect();
        let share = |holds: &dyn Fn(&Crossing) -> bool| all.iter().filter(|c| holds(c)).count() as f64 / count as f64;
        assert_eq!(survey.contact_share, Some(share(&|crossing| !crossing.contacts.is_empty())));
        let limit = (2.0 * 9.81 * 0.006_f64).sqrt();
        assert_eq!(survey.slow_share, share(&|crossing| crossing.passage.velocity.z.abs() < limit));
        // Tenths of the time have a tenth of the flow each: their mean is the flow; the sum is made in another order.
        let mean = survey.mass_flow_by_tenths_kg_per_s.iter().sum::<f64>() / 10.0;
        assert!((mean / survey.mass_flow_kg_per_s.unwrap() - 1.0).abs() < 1e-12);
        let mut speeds: Vec<f64> = all.iter().map(|crossing| -crossing.passage.velocity.z).collect();
        speeds.sort_by(f64::total_cmp);
        assert_eq!(survey.normal_speed_m_per_s.p10, speeds[count as usize / 10 - 1]);
        // What is not columns in the files are their headers.
        let Bytes { crossings, contacts, paths, files } = survey.bytes;
        let on_disk: u64 =
            manifest.chunks.iter().map(|chunk| fs::metadata(place.join(&chunk.file)).unwrap().len()).sum();
        assert_eq!(files, on_disk);
        let headers = files - crossings - contacts - paths;
        assert!((1..20_000 * survey.chunks).contains(&headers), "{headers}");
        let text = survey.to_text();
        for words in
            ["gate \"outlet\"", "9000, ", "\"lid\" disappeared", "contact_share: 0.31", "advice: L2", "in 2 files"]
        {
            assert!(text.contains(words), "{words}\n{text}");
        }
    }

    #[test]
    fn rows_take_the_bytes_that_the_columns_say() {
        // Documented with the format.
        assert_eq!(row_bytes(), (258, 165, 120));
    }

    #[test]
    fn an_empty_stream_is_surveyed() {
        let folder = tempfile::tempdir().unwrap();
        let place = folder.path().join("outlet");
        sample::write(&place, 0);
        let survey = survey(&StreamReader::open(&place).unwrap(), |_| {}).unwrap();
        assert_eq!((survey.contact_share, survey.mass_flow_kg_per_s, survey.slow_share), (None, None, 0.0));
        assert!(!survey.to_text().contains("NaN") && !survey.to_text().contains("inf"), "{}", survey.to_text());
    }
}
