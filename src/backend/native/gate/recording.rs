//! A gate that is recorded.

use crate::backend::BackendError;
use crate::backend::native::{NAME, NUMERICS_VERSION};
use crate::backend::recording::{self, Computed};
use crate::backend::stage::{RecordResult, StageRequest};
use crate::dem::held_contact::HeldContact;
use crate::dem::inspect::Partner;
use crate::dem::law::Compatibility;
use crate::dem::particles::Path;
use crate::dem::removal::RemovalCause;
use crate::dem::simulation::Simulation;
use crate::dem::view::{NearPlane, ParticleView, PlaneDistance};
use crate::gate::Cadence;
use crate::gate::crossing::{ContactPartner, Motion, Seen, StoredContact};
use crate::gate::quality::CrossingStatistics;
use crate::gate::record::{Recorder, RecorderState};
use crate::gate::stream::columns::{columns, from_columns};
use crate::gate::stream::format::StoredEvent;
use crate::gate::stream::writer::StreamWriter;
use crate::scene::Scene;
use crate::scene::gate::{ExclusionMode, Gate};
use crate::stage::split;
use crate::storage::StorageError;
use crate::storage::columns::{ColumnReader, ColumnWriter, read_all};

/// A gate that is recorded.
#[derive(Debug)]
pub struct Recording {
    order: split::Recording,
    recorder: Recorder,
    statistics: CrossingStatistics,
    writer: StreamWriter,
    zone: NearPlane,
    /// Particles that had left the run at the last look.
    left: usize,
}

impl Recording {
    /// Begins to record, or goes on from a checkpoint.
    pub fn open(
        scene: &Scene,
        order: &split::Recording,
        request: &StageRequest,
        simulation: &Simulation,
        held: Option<&ColumnReader>,
    ) -> Result<Self, BackendError> {
        let gate = &order.gate;
        let timestep = simulation.setup().timestep;
        let mut recorder = recording::recorder(scene, order, timestep, Cadence::NATIVE);
        let mut statistics = recording::statistics(scene, gate);
        let place = recording::stream_place(request, gate);
        let computed = Computed {
            backend: NAME,
            version: env!("CARGO_PKG_VERSION"),
            numerics_version: NUMERICS_VERSION,
            timestep,
            cadence: Cadence::NATIVE,
            contacts: true,
            laws: &laws(scene),
        };
        let origin = recording::origin(scene, order, request, &computed)?;
        let writer = match held {
            None => recording::start_stream(&place, origin)?,
            Some(reader) => {
                let prefix = prefix(gate);
                let path = request.folder;
                let state = recorder_state(reader, &prefix)?;
                recorder.restore(&state).map_err(|reason| unusable(&gate.name, &reason))?;
                statistics = from_text(reader.attribute_text(&format!("{prefix}statistics"))?, &gate.name)?;
                let pending = from_columns(path, &mut read_all(reader)?, &format!("{prefix}pending."))?;
                let sealed = reader.attribute_u64(&format!("{prefix}sealed"))? as usize;
                StreamWriter::resume(&place, origin, sealed, pending)?
            }
        };
        let plane = PlaneDistance::new(&gate.plane.point, &gate.plane.normal, recorder.passing_point());
        let zone = NearPlane::new(plane, recorder.zone());
        Ok(Self { order: order.clone(), recorder, statistics, writer, zone, left: simulation.removed().len() })
    }

    /// Looks at all particles after a time step.
    pub fn look(&mut self, simulation: &mut Simulation) -> Result<(), BackendError> {
        let gone = simulation.removed().get(self.left..).unwrap_or_default().iter();
        let lost = gone.filter(|removal| !matches!(removal.cause, RemovalCause::Gate | RemovalCause::Fate));
        self.recorder.count_removed(lost.map(|removal| removal.id));
        self.left = simulation.removed().len();
        let step = simulation.steps_done();
        let look = match self.recorder.view(step) {
            Some(range) => {
                let all = simulation.views_at(self.zone.plane(), range);
                self.recorder.look(step, all.map(|view| seen(&view)))
            }
            None => self.recorder.look(step, simulation.views_near(&mut self.zone).map(|view| seen(&view))),
        };
        for (id, contacts) in simulation.contacts_of(&look.crossed) {
            let Some((state, force, torque)) = simulation.loaded_state(id) else { continue };
            let contacts = contacts.iter().map(stored).collect();
            let crossing = self.recorder.crossing(state, force, torque, contacts);
            self.statistics.add(&crossing);
            self.writer.push(crossing)?;
        }
        match self.order.gate.exclusion.mode {
            ExclusionMode::Constant => simulation.prescribe(&look.freeze, Path::Constant),
            ExclusionMode::Ballistic => simulation.prescribe(&look.freeze, Path::Ballistic),
            ExclusionMode::Buffer => {}
        }
        if !look.exclude.is_empty() {
            simulation.remove_particles(&look.exclude, RemovalCause::Gate);
        }
        if !look.delete.is_empty() {
            simulation.remove_particles(&look.delete, RemovalCause::Fate);
        }
        match look.error {
            None => Ok(()),
            Some(what) => Err(BackendError::Gate { what, time: simulation.time(), steps: simulation.steps_done() }),
        }
    }

    /// Puts its state into a checkpoint.
    pub fn save(&self, writer: &mut ColumnWriter) {
        let prefix = prefix(&self.order.gate);
        let state = self.recorder.state();
        for (name, column) in state.reals {
            writer.column(&format!("{prefix}{name}"), column);
        }
        for (name, column) in state.integers {
            writer.column(&format!("{prefix}{name}"), column);
        }
        writer.attribute(&format!("{prefix}progress"), state.progress);
        let statistics = serde_json::to_string(&self.statistics).expect("plain numbers become JSON");
        writer.attribute(&format!("{prefix}statistics"), statistics);
        writer.attribute(&format!("{prefix}sealed"), self.writer.sealed() as u64);
        for (name, column) in columns(self.writer.pending()) {
            writer.column(&format!("{prefix}pending.{name}"), column);
        }
    }

    /// Closes the stream of a run that came to its end; an interrupted one goes on later.
    pub fn finish(
        self,
        simulation: &Simulation,
        upstream: &[StoredEvent],
        ended: bool,
    ) -> Result<RecordResult, BackendError> {
        let tally = self.recorder.tally();
        let parts = &simulation.setup().parts;
        let events = simulation.part_events().iter().map(|event| StoredEvent {
            part: parts[usize::from(event.part)].name.clone(),
            present: event.present,
            time: event.time,
        });
        let mut events: Vec<StoredEvent> = events.collect();
        events.extend(upstream.iter().filter(|event| parts.iter().all(|part| part.name != event.part)).cloned());
        events.sort_by(|a, b| a.time.total_cmp(&b.time));
        recording::close(self.order, tally, &self.statistics, self.writer, events, ended)
    }
}

fn unusable(gate: &str, reason: &str) -> BackendError {
    BackendError::Checkpoint(format!("the state of gate '{gate}' cannot be used: {reason}"))
}

fn from_text(text: &str, gate: &str) -> Result<CrossingStatistics, BackendError> {
    serde_json::from_str(text).map_err(|error| unusable(gate, &error.to_string()))
}

/// Name under which a gate's state stands in a checkpoint.
fn prefix(gate: &Gate) -> String {
    format!("record.{}.", gate.name)
}

fn recorder_state(reader: &ColumnReader, prefix: &str) -> Result<RecorderState, StorageError> {
    let mut state = RecorderState {
        progress: reader.attribute_text(&format!("{prefix}progress"))?.to_owned(),
        ..RecorderState::default()
    };
    for name in RecorderState::REALS {
        state.reals.push((name, reader.f64s(&format!("{prefix}{name}"))?));
    }
    for name in RecorderState::INTEGERS {
        state.integers.push((name, reader.u64s(&format!("{prefix}{name}"))?));
    }
    Ok(state)
}

/// What the laws' memories mean, in words.
fn laws(scene: &Scene) -> String {
    let law = &scene.law;
    let ahead = match law.compatibility {
        Compatibility::Tollgate => "memories stand half a time step ahead of the grid state",
        Compatibility::Liggghts => "memories stand at the grid state",
    };
    format!("{:?}, tangential {:?}, rolling {:?}; {ahead}", law.normal, law.tangential, law.rolling)
}

fn seen(view: &ParticleView) -> Seen {
    Seen {
        id: view.id,
        radius: view.radius,
        motion: Motion {
            position: view.position,
            velocity: view.velocity,
            spin: view.spin,
            acceleration: view.acceleration,
            spin_acceleration: view.spin_acceleration,
        },
    }
}

fn stored(contact: &HeldContact) -> StoredContact {
    StoredContact {
        partner: match contact.partner {
            Partner::Particle(id) => ContactPartner::Particle(id),
            Partner::Part { part, element } => ContactPartner::Part { part, element },
        },
        point: contact.point,
        normal: contact.normal,
        overlap: contact.overlap,
        normal_force: contact.normal_force,
        tangential_force: contact.tangential_force,
        tangential_memory: contact.memory.tangential,
        rolling_memory: contact.memory.rolling,
    }
}
