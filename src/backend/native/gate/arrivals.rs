//! A stream that enters a stage.

use super::pressure::{Pressure, PressureState};
use crate::backend::BackendError;
use crate::backend::incoming::{self, Solver};
use crate::backend::native::NAME;
use crate::backend::stage::{ReplayOrder, ReplayResult};
use crate::dem::ghost::PrescribedMotion;
use crate::dem::inspect::Partner;
use crate::dem::neighbor::list::Memory;
use crate::dem::particles::Path;
use crate::dem::release::Arrival;
use crate::dem::removal::RemovalCause;
use crate::dem::simulation::Simulation;
use crate::dem::tether::TetherLaw;
use crate::gate::Cadence;
use crate::gate::crossing::{ContactPartner, Motion, StoredContact};
use crate::gate::ledger::{ArrivalBook, Bars, Histories};
use crate::gate::replay::{Due, Release, Replayer};
use crate::gate::stream::format::{Manifest, StoredEvent};
use crate::geometry::plane::GatePlane;
use crate::math::Vec3;
use crate::particle::{Body, ParticleId};
use crate::scene::Scene;
use crate::scene::gate::{BackingUp, Fate, PathMode};
use crate::storage::columns::{ColumnReader, ColumnWriter};
use serde::{Deserialize, Serialize};
use std::collections::HashMap;

/// Stiffness of a tether, w2 c / |g|: a force of ten times the weight displaces a particle by 0.68 c, the root of x + x^3 = 1.
const TETHER_WEIGHTS: f64 = 10.0;

/// A stream on its way into a run.
#[derive(Debug)]
pub struct Arrivals {
    order: ReplayOrder,
    manifest: Manifest,
    replayer: Replayer,
    events: Vec<StoredEvent>,
    plane: GatePlane,
    /// For each part of the stream its number here.
    parts: Vec<Option<u16>>,
    tether: TetherLaw,
    due: Due,
    book: ArrivalBook,
    pressure: Pressure,
    body: Body,
    /// Particles that have arrived, and whether they went back upstream beyond the generation plane since.
    arrived: HashMap<ParticleId, bool>,
    left_upstream: u64,
}

/// What a checkpoint keeps beside the stream itself, from which everything else follows.
#[derive(Debug, Serialize, Deserialize)]
struct Progress {
    step: u64,
    book: ArrivalBook,
    pressure: PressureState,
    left_upstream: u64,
}

impl Arrivals {
    /// Opens a stream, at the start or where a checkpoint stands.
    pub fn open(
        scene: &Scene,
        order: &ReplayOrder,
        simulation: &Simulation,
        held: Option<&ColumnReader>,
    ) -> Result<Self, BackendError> {
        let timestep = simulation.setup().timestep;
        let (manifest, replayer) =
            incoming::open(scene, order, Solver { backend: NAME, timestep, cadence: Cadence::NATIVE })?;
        let own_part = |name: &String| scene.parts.iter().position(|part| part.name == *name).map(|index| index as u16);
        let diameter = scene.largest_diameter();
        let plane = order.replay.transform.plane(&manifest.origin.plane);
        let mut arrivals = Self {
            tether: TetherLaw {
                frequency_squared: TETHER_WEIGHTS * scene.gravity.norm() / order.replay.compliance,
                compliance: order.replay.compliance,
            },
            order: order.clone(),
            replayer,
            events: manifest.events.clone(),
            plane,
            parts: manifest.origin.part_names.iter().map(own_part).collect(),
            due: Due::default(),
            book: ArrivalBook::default(),
            pressure: Pressure::new(&order.name, plane, diameter, scene.gravity.norm(), upstream_overlap(&manifest)),
            body: scene.body,
            manifest,
            arrived: HashMap::new(),
            left_upstream: 0,
        };
        if let Some(reader) = held {
            arrivals.restore(reader)?;
        }
        Ok(arrivals)
    }

    fn restore(&mut self, reader: &ColumnReader) -> Result<(), BackendError> {
        let prefix = self.prefix();
        let text = reader.attribute_text(&format!("{prefix}progress"))?;
        let progress: Progress = serde_json::from_str(text).map_err(|error| {
            BackendError::Checkpoint(format!("the state of stream '{}' cannot be used: {error}", self.order.name))
        })?;
        self.book = progress.book;
        self.pressure.restore(progress.pressure);
        self.left_upstream = progress.left_upstream;
        let (ids, gone) = (reader.u64s(&format!("{prefix}arrived"))?, reader.u8s(&format!("{prefix}upstream"))?);
        self.arrived = ids.into_iter().map(ParticleId).zip(gone.into_iter().map(|gone| gone != 0)).collect();
        Ok(self.replayer.seek(progress.step)?)
    }

    /// Puts its state into a checkpoint.
    pub fn save(&self, writer: &mut ColumnWriter, step: u64) {
        let prefix = self.prefix();
        let progress = Progress {
            step,
            book: self.book.clone(),
            pressure: self.pressure.state(),
            left_upstream: self.left_upstream,
        };
        let text = serde_json::to_string(&progress).expect("plain numbers become JSON");
        writer.attribute(&format!("{prefix}progress"), text);
        let mut arrived: Vec<(u64, u8)> = self.arrived.iter().map(|(id, gone)| (id.0, u8::from(*gone))).collect();
        arrived.sort_unstable();
        writer.column(&format!("{prefix}arrived"), arrived.iter().map(|row| row.0).collect::<Vec<u64>>());
        writer.column(&format!("{prefix}upstream"), arrived.iter().map(|row| row.1).collect::<Vec<u8>>());
    }

    /// Name under which the state stands in a checkpoint.
    fn prefix(&self) -> String {
        format!("replay.{}.{}.", self.order.feed_offset, self.order.name)
    }

    /// True while ghosts are on paths that somebody must tell the solver.
    pub const fn steers(&self) -> bool {
        matches!(self.order.replay.path, PathMode::Recorded | PathMode::Compliant)
    }

    /// Where a ghost of this stream is at `step`.
    pub fn motion(&self, id: ParticleId, step: u64) -> Option<PrescribedMotion> {
        self.replayer.motion(id, step).map(prescribed)
    }

    /// What the stream tells of parts upstream.
    pub fn events(&self) -> &[StoredEvent] {
        &self.events
    }

    /// True once everything has arrived.
    pub fn is_finished(&self) -> bool {
        self.replayer.is_finished()
    }

    /// Looks up what is due, and brings in ghosts.
    pub fn insert_due(&mut self, simulation: &mut Simulation, step: u64) -> Result<(), BackendError> {
        self.due = self.replayer.due(step)?;
        let path = match self.order.replay.path {
            PathMode::Constant => Path::Constant,
            PathMode::Ballistic => Path::Ballistic,
            PathMode::Recorded | PathMode::Compliant => Path::Recorded,
        };
        let ghosts: Vec<_> =
            self.due.insert.iter().map(|entry| (entry.state, path, prescribed(entry.motion))).collect();
        simulation.insert_prescribed(&ghosts);
        Ok(())
    }

    /// Turns ghosts into ordinary particles, ghosts steered to the present step.
    pub fn release_due(&mut self, simulation: &mut Simulation, step: u64) -> Result<(), BackendError> {
        let due = std::mem::take(&mut self.due);
        simulation.tether(&due.tether, self.tether);
        if !due.release.is_empty() {
            let ids: Vec<ParticleId> = due.release.iter().map(|release| release.state.id).collect();
            if self.order.replay.path == PathMode::Compliant {
                simulation.untether(&ids);
            }
            let arrivals: Vec<Arrival> = due.release.iter().map(|release| self.arrival(release)).collect();
            let count = simulation.release(&arrivals);
            self.book.add_histories(Histories {
                restored: count.restored + count.with_parts,
                kept: count.kept_by_solver,
                without_partner: count.without_partner,
            });
            for wanted in due.release.iter().map(|release| &release.state) {
                match simulation.loaded_state(wanted.id) {
                    Some((now, ..)) => self.book.arrived(wanted, &now, Bars::NONE, self.body),
                    None => self.book.lost(wanted.id),
                }
            }
            self.arrived.extend(ids.into_iter().map(|id| (id, false)));
        }
        if step.is_multiple_of(Cadence::NATIVE.hand_over) && !self.arrived.is_empty() {
            self.look_back(simulation)?;
            if let Some(backed_up) = self.pressure.look(simulation)
                && self.order.replay.backing_up == BackingUp::Stop
            {
                return Err(stopped(simulation, &self.order.name, &backed_up.words));
            }
        }
        Ok(())
    }

    fn arrival(&self, release: &Release) -> Arrival {
        let own = |contact: &StoredContact| {
            let partner = match contact.partner {
                ContactPartner::Particle(id) => Partner::Particle(id),
                ContactPartner::Part { part, element } => {
                    Partner::Part { part: self.parts.get(usize::from(part)).copied().flatten()?, element }
                }
            };
            Some((partner, Memory { tangential: contact.tangential_memory, rolling: contact.rolling_memory }))
        };
        Arrival {
            state: release.state,
            force: release.force,
            torque: release.torque,
            contacts: release.contacts.iter().filter_map(own).collect(),
        }
    }

    /// Particles that have arrived and are upstream of the generation plane again.
    fn look_back(&mut self, simulation: &mut Simulation) -> Result<(), BackendError> {
        let mut back: Vec<(ParticleId, Vec3)> = Vec::new();
        for view in simulation.views() {
            if self.plane.distance(&view.position) < -self.order.replay.length && self.arrived.contains_key(&view.id) {
                back.push((view.id, view.position));
            }
        }
        back.sort_unstable_by_key(|(id, _)| *id);
        for (id, _) in &back {
            let gone = self.arrived.entry(*id).or_default();
            self.left_upstream += u64::from(!std::mem::replace(gone, true));
        }
        match (self.order.replay.leaving, back.first()) {
            (Fate::Keep, _) | (_, None) => Ok(()),
            (Fate::Delete, Some(_)) => {
                let ids: Vec<ParticleId> = back.iter().map(|(id, _)| *id).collect();
                for id in &ids {
                    self.arrived.remove(id);
                }
                simulation.remove_particles(&ids, RemovalCause::Fate);
                Ok(())
            }
            (Fate::Error, Some((id, place))) => Err(stopped(
                simulation,
                &self.order.name,
                &format!(
                    "particle {} of feed {} went back upstream beyond the generation plane, to ({:.6}, {:.6}, {:.6}) m; move \
                     the gate to where nothing comes back, or set `leaving` of the replay to \"keep\" or \"delete\"",
                    id.serial(),
                    id.feed(),
                    place.x,
                    place.y,
                    place.z
                ),
            )),
        }
    }

    /// Compares what arrived with what the stream holds, and passes on what came of the replay.
    pub fn finish(self) -> Result<ReplayResult, BackendError> {
        let finished = self.replayer.is_finished();
        let arrivals = incoming::account(&self.order, self.book, finished, self.body)?;
        let (overlaps, backed_up) = self.pressure.finish();
        Ok(ReplayResult {
            quality: incoming::judged(&self.manifest, Some(overlaps), self.order.replay.path),
            exact: self.replayer.is_exact(),
            tally: self.replayer.tally(),
            name: self.order.name,
            replay: self.order.replay,
            arrivals,
            backed_up,
            left_upstream: Some(self.left_upstream),
        })
    }
}

/// Largest overlap over the radius at the crossings of a stream [-]; 0 where it does not say.
fn upstream_overlap(manifest: &Manifest) -> f64 {
    manifest.quality["crossings"]["largest_overlap_share"].as_f64().unwrap_or(0.0)
}

fn stopped(simulation: &Simulation, stream: &str, what: &str) -> BackendError {
    BackendError::Gate {
        what: format!("stream '{stream}': {what}"),
        time: simulation.time(),
        steps: simulation.steps_done(),
    }
}

const fn prescribed(motion: Motion) -> PrescribedMotion {
    let Motion { position, velocity, spin, acceleration, spin_acceleration } = motion;
    PrescribedMotion { position, velocity, spin, acceleration, spin_acceleration }
}
