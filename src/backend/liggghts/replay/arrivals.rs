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
use crate::math::{Vec3, vec3};
use crate::particle::ParticleState;
use crate::scene::gate::PathMode;
use std::collections::BTreeMap;
use std::fs::File;
use std::io::{BufRead, BufReader};
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
        dump: ArrivalDump::open(case, ended_at_step as f64 * prepared.schedule.timestep, ended_at_step)?,
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
    early: BTreeMap<u32, Arrived>,
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
        for arrived in self.dump.at(step)? {
            match self.missing.remove(&arrived.tag) {
                None => {
                    self.early.insert(arrived.tag, arrived);
                }
                Some((index, wanted)) => {
                    let on_time = self.prepared.particles[arrived.tag as usize - 1].release == step;
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

    fn book(&mut self, index: usize, wanted: &ParticleState, arrived: &Arrived, on_time: bool) {
        let now = arrived.state(wanted);
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
        for arrived in std::mem::take(&mut self.early).into_values() {
            let entered = self.prepared.particles.get(arrived.tag as usize - 1);
            let (Some(entered), Some(id)) = (entered, self.prepared.tags.id(arrived.tag)) else {
                return Err(self.dump.unreadable(&format!("particle {} has arrived, but never entered", arrived.tag)));
            };
            let Some(index) = entered.stream else {
                return Err(self
                    .dump
                    .unreadable(&format!("particle {} has arrived, but comes from a feed", arrived.tag)));
            };
            let like = ParticleState { id, ..arrived.likeness() };
            self.book(usize::from(index), &like, &arrived, false);
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

/// One row of the dump.
#[derive(Debug, Clone, Copy)]
struct Arrived {
    tag: u32,
    kind: u16,
    /// Radius, density, place, velocity, spin.
    values: [f64; 11],
}

impl Arrived {
    fn likeness(&self) -> ParticleState {
        let [radius, density, x, y, z, vx, vy, vz, wx, wy, wz] = self.values;
        ParticleState {
            id: crate::particle::ParticleId::new(0, 0),
            material: self.kind - 1,
            radius,
            density,
            position: vec3(x, y, z),
            velocity: vec3(vx, vy, vz),
            spin: vec3(wx, wy, wz),
        }
    }

    fn state(&self, wanted: &ParticleState) -> ParticleState {
        // A zero loses its sign where LIGGGHTS adds to it.
        let like = |found: Vec3, wanted: &Vec3| {
            Vec3::from_fn(|axis, _| if found[axis] == wanted[axis] { wanted[axis] } else { found[axis] })
        };
        let ParticleState { position, velocity, spin, .. } = self.likeness();
        ParticleState {
            id: wanted.id,
            position: like(position, &wanted.position),
            velocity: like(velocity, &wanted.velocity),
            spin: like(spin, &wanted.spin),
            ..self.likeness()
        }
    }

    /// A row `tag type radius density x y z vx vy vz wx wy wz`.
    fn parse(line: &str) -> Option<Self> {
        let mut fields = line.split_ascii_whitespace();
        let tag: u32 = fields.next()?.parse().ok().filter(|tag| *tag > 0)?;
        let kind: u16 = fields.next()?.parse().ok().filter(|kind| *kind > 0)?;
        let mut values = [0.0; 11];
        for value in &mut values {
            *value = fields.next()?.parse().ok()?;
        }
        fields.next().is_none().then_some(Self { tag, kind, values })
    }
}

/// The dump of arrivals, read snapshot by snapshot.
#[derive(Debug)]
struct ArrivalDump {
    case: PathBuf,
    time: f64,
    steps: u64,
    lines: std::io::Lines<BufReader<File>>,
    number: u64,
    /// Time step of the snapshot that comes next, its header being read.
    next: Option<u64>,
}

impl ArrivalDump {
    fn open(case: &Path, time: f64, steps: u64) -> Result<Self, BackendError> {
        let place = case.join(files::ARRIVALS);
        let file = File::open(&place).map_err(|source| crate::storage::StorageError::system("read", &place, source))?;
        let lines = BufReader::new(file).lines();
        let mut dump = Self { case: case.to_owned(), time, steps, lines, number: 0, next: None };
        dump.read_step()?;
        Ok(dump)
    }

    /// What arrived at the sample of a time step; earlier samples must have been asked for.
    fn at(&mut self, step: u64) -> Result<Vec<Arrived>, BackendError> {
        if self.next.is_some_and(|next| next < step) {
            return Err(self.unreadable(&format!("it has a sample at time step {:?}, where none is due", self.next)));
        }
        if self.next != Some(step) {
            return Ok(Vec::new());
        }
        self.expect_line("ITEM: NUMBER OF ATOMS")?;
        let count: usize = self.must("a number of particles")?;
        self.expect_line("ITEM: BOX BOUNDS")?;
        for _ in 0..3 {
            self.line()?;
        }
        self.expect_line("ITEM: ATOMS")?;
        let mut rows = Vec::new();
        for _ in 0..count {
            let line = self.line()?.unwrap_or_default();
            rows.push(Arrived::parse(&line).ok_or_else(|| self.unreadable("a row of 13 numbers was expected"))?);
        }
        self.read_step()?;
        Ok(rows)
    }

    /// Refuses samples behind the end.
    fn expect_end(&self, end: u64) -> Result<(), BackendError> {
        match self.next {
            None => Ok(()),
            Some(step) => Err(self.unreadable(&format!("it goes on to time step {step}, but the run ended at {end}"))),
        }
    }

    fn read_step(&mut self) -> Result<(), BackendError> {
        self.next = match self.line()? {
            None => None,
            Some(line) if line.starts_with("ITEM: TIMESTEP") => Some(self.must("a time step")?),
            Some(_) => return Err(self.unreadable("'ITEM: TIMESTEP' was expected")),
        };
        Ok(())
    }

    fn line(&mut self) -> Result<Option<String>, BackendError> {
        self.number += 1;
        self.lines.next().transpose().map_err(|error| self.unreadable(&error.to_string()))
    }

    fn expect_line(&mut self, start: &str) -> Result<(), BackendError> {
        match self.line()? {
            Some(line) if line.starts_with(start) => Ok(()),
            _ => Err(self.unreadable(&format!("'{start}' was expected"))),
        }
    }

    fn must<T: std::str::FromStr>(&mut self, what: &str) -> Result<T, BackendError> {
        let line = self.line()?.unwrap_or_default();
        line.trim().parse().map_err(|_| self.unreadable(&format!("{what} was expected")))
    }

    fn unreadable(&self, reason: &str) -> BackendError {
        BackendError::Failed {
            what: format!(
                "what LIGGGHTS wrote to {} cannot be used, line {}: {reason}; it was stopped half-way, or somebody else wrote \
                 there: compute the stage again",
                files::ARRIVALS,
                self.number
            ),
            case: self.case.clone(),
            rerun: format!("cd {} && liggghts -in {}", self.case.display(), files::DECK),
            time: self.time,
            steps: self.steps,
        }
    }
}
