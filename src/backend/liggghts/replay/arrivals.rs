//! What arrived in a case, against what its streams hold.

use super::{Prepared, solver};
use crate::backend::BackendError;
use crate::backend::incoming;
use crate::backend::liggghts::files;
use crate::backend::stage::ReplayResult;
use crate::gate::crossing::{ContactPartner, StoredContact};
use crate::gate::ledger::{ArrivalBook, Bars, Histories};
use crate::gate::replay::{Due, ReplayTally, Replayer};
use crate::gate::stream::format::Manifest;
use crate::math::Vec3;
use crate::output::lammps::DumpReader;
use crate::particle::{Body, ParticleState};
use crate::scene::gate::PathMode;
use crate::storage::StorageError;
use std::collections::BTreeMap;
use std::fs::File;
use std::io::BufReader;
use std::path::{Path, PathBuf};

/// Distance from the stored place that a ghost may have at its release [m]: round-off of up to 10^4 time steps at 1 m.
const PLACE: f64 = 1e-12;
/// Difference from the stored velocity that a falling ghost may have at its release [m/s].
const VELOCITY: f64 = 1e-12;

/// See [`Prepared::finish`].
pub fn finish(prepared: Prepared, case: &Path, ended_at_step: u64) -> Result<Vec<ReplayResult>, BackendError> {
    if prepared.orders.is_empty() {
        return Ok(Vec::new());
    }
    let streams = prepared.orders.iter().map(|order| {
        let (manifest, replayer) = incoming::open(&prepared.scene, order, solver(&prepared.schedule))?;
        let own_part = |name: &String| prepared.scene.parts.iter().any(|part| part.name == *name);
        Ok(Stream {
            parts: manifest.origin.part_names.iter().map(own_part).collect(),
            tally: replayer.tally(),
            book: ArrivalBook::default(),
            bars: bars(order.replay.path),
            manifest,
            replayer,
        })
    });
    let mut books = Books {
        streams: streams.collect::<Result<_, BackendError>>()?,
        dump: ArrivalDump::open(
            case,
            prepared.scene.body,
            ended_at_step as f64 * prepared.schedule.timestep,
            ended_at_step,
        )?,
        missing: BTreeMap::new(),
        early: BTreeMap::new(),
        prepared,
    };
    for step in (0..=ended_at_step).step_by(books.prepared.schedule.cadence.look as usize) {
        books.look(step, ended_at_step)?;
    }
    books.close(ended_at_step)
}

const fn bars(path: PathMode) -> Bars {
    match path {
        PathMode::Constant => Bars { place: PLACE, velocity: 0.0 },
        PathMode::Ballistic => Bars { place: PLACE, velocity: VELOCITY },
        // Set to the bit at the very sample.
        PathMode::Recorded | PathMode::Compliant => Bars::NONE,
    }
}

#[derive(Debug)]
struct Stream {
    manifest: Manifest,
    replayer: Replayer,
    /// For each part of the stream whether it is here, too.
    parts: Vec<bool>,
    book: ArrivalBook,
    bars: Bars,
    tally: ReplayTally,
}

#[derive(Debug)]
struct Books {
    prepared: Prepared,
    streams: Vec<Stream>,
    dump: ArrivalDump,
    /// Due, but not arrived so far, by tag: stream and state.
    missing: BTreeMap<u32, (usize, ParticleState)>,
    /// Arrived before they were due.
    early: BTreeMap<u32, ParticleState>,
}

impl Books {
    fn look(&mut self, step: u64, end: u64) -> Result<(), BackendError> {
        for index in 0..self.streams.len() {
            let stream = &mut self.streams[index];
            let before = stream.replayer.tally();
            let due = stream.replayer.due(step)?;
            stream.tally = stream.replayer.tally();
            if step == end && step > 0 {
                // Whoever was to enter with a batch after the last time step has not.
                stream.tally = ReplayTally { released: stream.tally.released, ..before };
            }
            self.expect(step, index, due);
        }
        for (tag, arrived) in self.dump.at(step)? {
            match self.missing.remove(&tag) {
                None => {
                    self.early.insert(tag, arrived);
                }
                Some((index, wanted)) => {
                    let on_time = self.prepared.particles[tag as usize - 1].release == step;
                    self.book(index, &wanted, &arrived, on_time);
                }
            }
        }
        Ok(())
    }

    fn expect(&mut self, step: u64, index: usize, due: Due) {
        for release in due.release {
            let Some(tag) = self.prepared.tags.tag(release.state.id) else { continue };
            let histories = self.histories(&release.contacts, index, step);
            self.streams[index].book.add_histories(histories);
            match self.early.remove(&tag) {
                Some(arrived) => self.book(index, &release.state, &arrived, false),
                None => {
                    self.missing.insert(tag, (index, release.state));
                }
            }
        }
    }

    /// LIGGGHTS builds up the memories of contacts while ghosts travel: with partners that are here.
    fn histories(&self, contacts: &[StoredContact], index: usize, step: u64) -> Histories {
        let is_here = |contact: &&StoredContact| match contact.partner {
            ContactPartner::Particle(id) => {
                let tag = self.prepared.tags.tag(id);
                tag.is_some_and(|tag| self.prepared.particles[tag as usize - 1].step < step)
            }
            ContactPartner::Part { part, .. } => self.streams[index].parts.get(usize::from(part)) == Some(&true),
        };
        let kept = contacts.iter().filter(is_here).count() as u64;
        Histories { restored: 0, kept, without_partner: contacts.len() as u64 - kept }
    }

    fn book(&mut self, index: usize, wanted: &ParticleState, arrived: &ParticleState, on_time: bool) {
        let now = settled(wanted, arrived, &self.prepared.scene.domain.periods());
        let Stream { book, bars, .. } = &mut self.streams[index];
        book.arrived(wanted, &now, *bars, self.prepared.scene.body);
        if !on_time {
            book.out_of_time(now.id);
        }
    }

    fn close(mut self, end: u64) -> Result<Vec<ReplayResult>, BackendError> {
        self.dump.expect_end(end)?;
        for (index, state) in std::mem::take(&mut self.missing).into_values() {
            self.streams[index].book.lost(state.id);
        }
        for (tag, arrived) in std::mem::take(&mut self.early) {
            let entered = self.prepared.particles.get(tag as usize - 1);
            let (Some(entered), Some(id)) = (entered, self.prepared.tags.id(tag)) else {
                return Err(self.dump.unusable(format!("particle {tag} has arrived, but never entered")));
            };
            let Some(index) = entered.stream else {
                return Err(self.dump.unusable(format!("particle {tag} has arrived, but comes from a feed")));
            };
            self.book(usize::from(index), &ParticleState { id, ..arrived }, &arrived, false);
        }
        let body = self.prepared.scene.body;
        let results = self.prepared.orders.into_iter().zip(self.streams).map(|(order, stream)| {
            let arrivals = incoming::account(&order, stream.book, stream.replayer.is_finished(), body)?;
            let all_stored = arrivals.bit_equal == arrivals.arrived.count;
            Ok(ReplayResult {
                exact: stream.replayer.is_exact() && order.replay.path == PathMode::Recorded && all_stored,
                quality: incoming::judged(&stream.manifest, None, order.replay.path),
                name: order.name,
                replay: order.replay,
                tally: stream.tally,
                arrivals,
                backed_up: None,
                left_upstream: None,
            })
        });
        results.collect()
    }
}

/// What arrived, but for the sign of a zero, which LIGGGHTS adds to, and whole `periods` \[m\], by which it moves who is near a border.
fn settled(wanted: &ParticleState, arrived: &ParticleState, periods: &[Option<f64>; 3]) -> ParticleState {
    let like = |found: Vec3, wanted: &Vec3| {
        Vec3::from_fn(|axis, _| if found[axis] == wanted[axis] { wanted[axis] } else { found[axis] })
    };
    let mut place = arrived.position;
    for (axis, period) in periods.iter().enumerate() {
        let turns = period.map_or(0.0, |period| ((wanted.position[axis] - place[axis]) / period).round() * period);
        if turns != 0.0 {
            place[axis] += turns;
        }
    }
    ParticleState {
        id: wanted.id,
        position: like(place, &wanted.position),
        velocity: like(arrived.velocity, &wanted.velocity),
        spin: like(arrived.spin, &wanted.spin),
        ..*arrived
    }
}

/// The dump of arrivals, read sample by sample. Its ids are LIGGGHTS' tags.
#[derive(Debug)]
struct ArrivalDump {
    case: PathBuf,
    body: Body,
    time: f64,
    steps: u64,
    dump: DumpReader<BufReader<File>>,
    /// Time step of the sample that comes next.
    next: Option<u64>,
}

impl ArrivalDump {
    fn open(case: &Path, body: Body, time: f64, steps: u64) -> Result<Self, BackendError> {
        let dump = DumpReader::open(&case.join(files::ARRIVALS))?;
        let mut arrivals = Self { case: case.to_owned(), body, time, steps, dump, next: None };
        arrivals.go_on()?;
        Ok(arrivals)
    }

    /// What arrived at the sample of a time step; earlier samples must have been asked for.
    fn at(&mut self, step: u64) -> Result<Vec<(u32, ParticleState)>, BackendError> {
        if let Some(next) = self.next.filter(|next| *next < step) {
            return Err(self.unusable(format!("it has a sample at time step {next}, where none is due")));
        }
        if self.next != Some(step) {
            return Ok(Vec::new());
        }
        let particles = self.dump.particles(&self.body).map_err(|error| self.unreadable(&error))?;
        self.go_on()?;
        let tagged = particles.into_iter().map(|particle| match u32::try_from(particle.id.0) {
            Ok(tag @ 1..) => Ok((tag, particle)),
            _ => Err(self.unusable(format!("{} is no particle's number", particle.id.0))),
        });
        tagged.collect()
    }

    /// Refuses samples behind the end.
    fn expect_end(&self, end: u64) -> Result<(), BackendError> {
        match self.next {
            None => Ok(()),
            Some(step) => Err(self.unusable(format!("it goes on to time step {step}, but the run ended at {end}"))),
        }
    }

    fn go_on(&mut self) -> Result<(), BackendError> {
        let frame = self.dump.next_frame().map_err(|error| self.unreadable(&error))?;
        self.next = frame.map(|frame| frame.step);
        Ok(())
    }

    fn unusable(&self, reason: String) -> BackendError {
        self.unreadable(&StorageError::unusable(&self.case.join(files::ARRIVALS), reason))
    }

    fn unreadable(&self, error: &StorageError) -> BackendError {
        BackendError::Failed {
            what: format!(
                "{error}; LIGGGHTS was stopped half-way, or somebody else wrote there: compute the stage again"
            ),
            case: self.case.clone(),
            rerun: format!("cd {} && liggghts -in {}", self.case.display(), files::DECK),
            time: self.time,
            steps: self.steps,
        }
    }
}
