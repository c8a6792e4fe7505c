//! What LIGGGHTS samples at the gates of a stage, turned into streams while it runs.
//!
//! Every M time steps the deck dumps the particles near each gate. The same recorder as for our own solver looks at these samples
//! in turn, finds who has passed, and interpolates the passage; the state at the sample is the grid state, to the last bit. A
//! sample is read once LIGGGHTS has finished it, and then removed, so that neither disk nor memory grow with the run.
//!
//! Forces in the samples hold the weight: the force of contacts is f - m g.

pub mod contacts;
pub mod local_dump;
pub mod samples;

use super::deck::parts::without_ends;
use super::tags::Tags;
use super::{NAME, NUMERICS_VERSION, Schedule, files};
use crate::backend::BackendError;
use crate::backend::recording::{self, Computed};
use crate::backend::stage::{RecordResult, StageRequest};
use crate::gate::crossing::{Motion, Seen, StoredContact};
use crate::gate::id_map::IdMap;
use crate::gate::quality::CrossingStatistics;
use crate::gate::record::{RecordTally, Recorder};
use crate::gate::stream::format::StoredEvent;
use crate::gate::stream::writer::StreamWriter;
use crate::geometry::part::{Part, Surface};
use crate::math::Vec3;
use crate::particle::{Body, ParticleId, ParticleState};
use crate::scene::Scene;
use crate::stage::split::Recording;
use crate::storage::StorageError;
use contacts::{Contacts, Found, Wanted};
use samples::{Row, Sample};
use std::fs;
use std::io::ErrorKind;
use std::path::{Path, PathBuf};

/// A contact force above this share of the weight counts: more than round-off of f - m g.
const CONTACT_FORCE: f64 = 1e-9;

/// All recorded gates of a stage.
#[derive(Debug)]
pub struct Recordings {
    gates: Vec<GateRecording>,
    contacts: Option<Contacts>,
    world: World,
    /// Contact dumps are removed at the end, samples once they are read.
    keep: bool,
    /// Time step of the next sample.
    next: u64,
    sample: Sample,
    bytes: u64,
}

/// Distances of centres from the gate plane \[m\], before (negative) and behind it, between which a deck must sample particles, where none
/// is faster than `speed` \[m/s\]: those on paths, those that pass, and those that have not yet been taken out. Beside an aperture
/// the samples must reach a path's length and a diameter farther.
#[must_use]
pub fn slab(scene: &Scene, order: &Recording, schedule: &Schedule, speed: f64) -> [f64; 2] {
    let recorder = recording::recorder(scene, order, schedule.timestep, schedule.cadence);
    let [look, batch] = [schedule.cadence.look, schedule.cadence.hand_over].map(|steps| speed * schedule.time(steps));
    // The passing point lies up to a radius beside the centre.
    let beside = 0.5 * scene.largest_diameter() * recorder.passing_point().abs();
    [-(recorder.band() + look + beside), order.gate.exclusion.length + batch + beside]
}

/// What is the same for all gates.
#[derive(Debug)]
struct World {
    schedule: Schedule,
    gravity: Vec3,
    body: Body,
    materials: usize,
    /// Particles by tag, the first of which is 1.
    ids: Vec<ParticleId>,
}

/// A gate that is recorded.
#[derive(Debug)]
struct GateRecording {
    order: Recording,
    recorder: Recorder,
    statistics: CrossingStatistics,
    writer: StreamWriter,
    /// Samples of this gate.
    folder: PathBuf,
    /// Crossings with a contact or a contact force.
    in_contact: u64,
    /// Who passed in the sample that is being read, by identity.
    passed: Vec<(ParticleId, Row)>,
}

impl Recordings {
    /// Begins to record the gates of `request` from the case in the folder `case`, which LIGGGHTS of version `version` computes.
    ///
    /// # Errors
    /// When LIGGGHTS cannot do what a gate asks for, or the disk refuses.
    pub fn open(
        scene: &Scene,
        request: &StageRequest,
        schedule: &Schedule,
        case: &Path,
        tags: &Tags,
        version: &str,
    ) -> Result<Self, BackendError> {
        let periods = scene.domain.periods();
        let laws = laws(scene);
        let computed = Computed {
            backend: NAME,
            version,
            numerics_version: NUMERICS_VERSION,
            timestep: schedule.timestep,
            cadence: schedule.cadence,
            contacts: scene.liggghts.contacts,
            laws: &laws,
        };
        let open = |order: &Recording| -> Result<GateRecording, BackendError> {
            let origin = recording::origin(scene, order, request, &computed)?;
            let place = recording::stream_place(request, &order.gate);
            let recorder = recording::recorder(scene, order, schedule.timestep, schedule.cadence);
            Ok(GateRecording {
                order: order.clone(),
                recorder,
                statistics: recording::statistics(scene, &order.gate),
                writer: recording::start_stream(&place, origin)?,
                folder: case.join(files::SAMPLES).join(&order.gate.name),
                in_contact: 0,
                passed: Vec::new(),
            })
        };
        let own = |part: &Part| match &part.surface {
            Surface::Mesh(mesh) => without_ends(mesh, &scene.domain).is_none(),
            Surface::Plane { .. } | Surface::Frustum { .. } => false,
        };
        let meshes = || scene.parts.iter().map(own).collect();
        let contacts = scene.liggghts.contacts.then(|| Contacts::new(case, meshes(), periods));
        Ok(Self {
            gates: request.records.iter().map(open).collect::<Result<_, _>>()?,
            contacts,
            world: World {
                schedule: *schedule,
                gravity: scene.gravity,
                body: scene.body,
                materials: scene.materials.materials.len(),
                ids: tags.ids().to_vec(),
            },
            keep: scene.liggghts.keep_samples,
            next: 0,
            sample: Sample::default(),
            bytes: 0,
        })
    }

    /// Reads the samples of time steps up to `step`, all of which LIGGGHTS must have finished, and removes them unless they
    /// are to be kept.
    ///
    /// # Errors
    /// When a sample is missing or damaged, a particle's fate ends the run, or the disk refuses.
    pub fn read_up_to(&mut self, step: u64) -> Result<(), BackendError> {
        if self.gates.is_empty() {
            return Ok(());
        }
        while self.next <= step {
            self.read(self.next)?;
            self.next += self.world.schedule.cadence.look;
        }
        Ok(())
    }

    fn read(&mut self, step: u64) -> Result<(), BackendError> {
        for gate in &mut self.gates {
            let path = gate.folder.join(format!("{step}.bin"));
            self.sample.read(&path, step)?;
            self.bytes += self.sample.bytes() as u64;
            gate.look(&self.world, &self.sample, &path)?;
        }
        let contacts = self.contacts_at(step)?;
        for gate in &mut self.gates {
            gate.store(&self.world, &contacts)?;
        }
        if !self.keep {
            for gate in &self.gates {
                remove(&gate.folder.join(format!("{step}.bin")))?;
            }
        }
        Ok(())
    }

    /// Contacts of all that passed at any gate, by tag.
    fn contacts_at(&mut self, step: u64) -> Result<Found, StorageError> {
        let Some(contacts) = &mut self.contacts else { return Ok(Found::new()) };
        let passed = self.gates.iter().flat_map(|gate| &gate.passed);
        let wanted = passed.map(|(_, row)| Wanted { tag: row.tag, position: row.position, radius: row.radius });
        let mut wanted: Vec<Wanted> = wanted.collect();
        if wanted.is_empty() {
            return Ok(Found::new());
        }
        wanted.sort_unstable_by_key(|wanted| wanted.tag);
        wanted.dedup_by_key(|wanted| wanted.tag);
        contacts.of(step, &wanted, &|tag| self.world.id(tag))
    }

    /// Says who is still in the run at its end: recorded particles that are not, and were not taken out at the exclusion plane, were
    /// lost after they had passed.
    pub fn settle(&mut self, present: &IdMap<()>) {
        for gate in &mut self.gates {
            let lost: Vec<ParticleId> = gate.recorder.gone_through().filter(|id| !present.contains_key(id)).collect();
            gate.recorder.count_removed(lost.into_iter());
        }
    }

    /// Crossings of each gate so far.
    pub fn tallies(&self) -> impl Iterator<Item = (&str, RecordTally)> {
        self.gates.iter().map(|gate| (gate.order.gate.name.as_str(), gate.tally()))
    }

    /// Bytes of samples and contacts that have been read.
    #[must_use]
    pub fn bytes_read(&self) -> u64 {
        self.bytes + self.contacts.as_ref().map_or(0, Contacts::bytes)
    }

    /// Closes the streams of a run that came to its end (`ended`); of another one they stay unfinished. `events` is what happened
    /// to parts, here and upstream, in order of time.
    ///
    /// # Errors
    /// When the disk refuses.
    pub fn finish(self, events: Vec<StoredEvent>, ended: bool) -> Result<Vec<RecordResult>, BackendError> {
        let close = |gate: GateRecording| {
            let tally = gate.tally();
            recording::close(gate.order, tally, &gate.statistics, gate.writer, events.clone(), ended)
        };
        let results = self.gates.into_iter().map(close).collect::<Result<Vec<_>, _>>()?;
        if let Some(contacts) = self.contacts.filter(|_| ended && !self.keep) {
            contacts.files().into_iter().try_for_each(remove)?;
        }
        Ok(results)
    }
}

impl World {
    fn id(&self, tag: u32) -> Option<ParticleId> {
        self.ids.get((tag as usize).checked_sub(1)?).copied()
    }

    fn mass(&self, row: &Row) -> f64 {
        self.body.mass(row.radius, row.density)
    }

    fn seen(&self, row: &Row) -> Option<Seen> {
        let mass = self.mass(row);
        let inertia = self.body.inertia_factor() * mass * row.radius * row.radius;
        let motion = Motion {
            position: row.position,
            velocity: row.velocity,
            spin: row.spin,
            acceleration: row.force / mass,
            spin_acceleration: row.torque / inertia,
        };
        Some(Seen { id: self.id(row.tag)?, radius: row.radius, motion })
    }

    /// Force of the contacts on a particle \[N\]; exactly none where there is but round-off.
    fn contact_force(&self, row: &Row) -> Vec3 {
        let weight = self.gravity * self.mass(row);
        let force = row.force - weight;
        if force.norm() > CONTACT_FORCE * weight.norm() { force } else { Vec3::zeros() }
    }

    fn state(&self, id: ParticleId, row: &Row) -> ParticleState {
        ParticleState {
            id,
            material: row.kind - 1,
            radius: row.radius,
            density: row.density,
            position: row.position,
            velocity: row.velocity,
            spin: row.spin,
        }
    }
}

impl GateRecording {
    /// Looks at a sample, and keeps who has passed.
    fn look(&mut self, world: &World, sample: &Sample, path: &Path) -> Result<(), BackendError> {
        if let Some(row) =
            sample.rows().find(|row| world.id(row.tag).is_none() || usize::from(row.kind) > world.materials)
        {
            let (tag, kind) = (row.tag, row.kind);
            let (particles, materials) = (world.ids.len(), world.materials);
            let reason = format!(
                "it holds particle {tag} of type {kind}; there are {particles} particles and {materials} materials: it is of another \
                 case; run the stage again"
            );
            return Err(StorageError::unusable(path, reason).into());
        }
        let step = sample.step();
        let look = self.recorder.look(step, sample.rows().filter_map(|row| world.seen(&row)));
        self.passed.clear();
        if !look.crossed.is_empty() {
            let passed = sample.rows().filter_map(|row| Some((world.id(row.tag)?, row)));
            self.passed.extend(passed.filter(|(id, _)| look.crossed.binary_search(id).is_ok()));
            self.passed.sort_unstable_by_key(|(id, _)| *id);
        }
        match look.error {
            None => Ok(()),
            Some(what) => Err(BackendError::Gate { what, time: world.schedule.time(step), steps: step }),
        }
    }

    /// Stores who has passed, with their contacts.
    fn store(&mut self, world: &World, contacts: &Found) -> Result<(), BackendError> {
        for (id, row) in std::mem::take(&mut self.passed) {
            let start = contacts.partition_point(|(tag, _)| *tag < row.tag);
            let own = contacts[start..].iter().take_while(|(tag, _)| *tag == row.tag);
            let own: Vec<StoredContact> = own.map(|(_, contact)| *contact).collect();
            let force = world.contact_force(&row);
            self.in_contact += u64::from(!own.is_empty() || force != Vec3::zeros());
            let crossing = self.recorder.crossing(world.state(id, &row), force, row.torque, own);
            self.statistics.add(&crossing);
            self.writer.push(crossing)?;
        }
        Ok(())
    }

    fn tally(&self) -> RecordTally {
        RecordTally { in_contact: self.in_contact, ..self.recorder.tally() }
    }
}

/// What LIGGGHTS' contacts mean, in words.
fn laws(scene: &Scene) -> String {
    let law = &scene.law;
    format!(
        "{:?}, tangential {:?}, rolling {:?}, as LIGGGHTS computes them; tangential memory: displacement of the contact point [m] at the \
         grid state; rolling memory: torque of the spring [N m]; forces of contacts hold for the velocities of the grid state, the force \
         of a crossing for those half a time step before; LIGGGHTS restores no memory, contacts remember anew while ghosts travel",
        law.normal, law.tangential, law.rolling
    )
}

fn remove(path: &Path) -> Result<(), StorageError> {
    match fs::remove_file(path) {
        Err(source) if source.kind() != ErrorKind::NotFound => Err(StorageError::system("remove", path, source)),
        _ => Ok(()),
    }
}

#[cfg(test)]
mod tests;
