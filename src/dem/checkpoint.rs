//! The complete state of a simulation as plain columns: what a checkpoint file holds.
//!
//! Taking a record changes nothing. A simulation made from its record goes on bit for bit: particles keep their storage order,
//! the pair lists are made again at the very centres at which they were made, and every counter is kept.

use super::energy::EnergyBudget;
use super::feed::FeedRunnerState;
use super::ghost::PrescribedMotion;
use super::momentum::MomentumAccount;
use super::neighbor::list::Memory;
use super::neighborhood::ListSettings;
use super::particles::{Acceleration, Load, Particles, Path, Sphere, Velocity};
use super::presence::PresenceRecord;
use super::removal::Removal;
use super::simulation::{Setup, Simulation};
use super::tether::{Tether, TetherLaw};
use super::wall_list::WallContact;
use super::watchdog::EnergyWatch;
use super::wear::Wear;
use crate::math::Vec3;
use crate::particle::ParticleId;
use serde::{Deserialize, Serialize};

/// A simulation's state: named columns and a small text.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct SimulationRecord {
    /// Real columns by name.
    pub reals: Vec<(&'static str, Vec<f64>)>,
    /// Integer columns by name.
    pub integers: Vec<(&'static str, Vec<u64>)>,
    /// Everything small, as JSON.
    pub progress: String,
}

/// Names of the real columns of a record.
pub const REAL_COLUMNS: [&str; 10] = [
    "sphere",
    "velocity",
    "acceleration",
    "load",
    "density",
    "outer_reference",
    "inner_reference",
    "pair_memory",
    "wall_memory",
    "tether",
];
/// Names of the integer columns of a record.
pub const INTEGER_COLUMNS: [&str; 5] = ["id", "material", "path", "wall_contact", "tether_id"];

/// Why a record cannot be continued from.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct RecordError(pub String);

impl std::fmt::Display for RecordError {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(&self.0)
    }
}

impl std::error::Error for RecordError {}

/// The small part of a record.
#[derive(Debug, Serialize, Deserialize)]
struct Progress {
    steps: u64,
    loads_known: bool,
    part_names: Vec<String>,
    material_names: Vec<String>,
    lists: ListSettings,
    wear: Wear,
    booked: EnergyBudget,
    momentum: MomentumAccount,
    removed: Vec<Removal>,
    presence: PresenceRecord,
    energy_watch: EnergyWatch,
    feeds: FeedRunnerState,
    part_loads: Vec<[f64; 7]>,
    /// Empty while nobody was looked at whether it may fall asleep.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    calm_looks: Vec<u8>,
    /// Storage indices of those who slept when the inner lists were made.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    listed_asleep: Vec<u32>,
}

impl SimulationRecord {
    fn reals(&self, name: &str) -> Result<&[f64], RecordError> {
        let found = self.reals.iter().find(|(held, _)| *held == name).map(|(_, column)| column.as_slice());
        found.ok_or_else(|| RecordError(format!("column '{name}' is missing")))
    }

    fn integers(&self, name: &str) -> Result<&[u64], RecordError> {
        let found = self.integers.iter().find(|(held, _)| *held == name).map(|(_, column)| column.as_slice());
        found.ok_or_else(|| RecordError(format!("column '{name}' is missing")))
    }

    /// Rows of a real column, for `count` particles.
    fn rows<const WIDTH: usize>(&self, name: &str, count: Option<usize>) -> Result<Vec<[f64; WIDTH]>, RecordError> {
        let (rows, rest) = self.reals(name)?.as_chunks::<WIDTH>();
        if !rest.is_empty() || count.is_some_and(|count| rows.len() != count) {
            return Err(RecordError(format!("column '{name}' has {} rows, not {count:?}", rows.len())));
        }
        Ok(rows.to_vec())
    }

    fn progress(&self) -> Result<Progress, RecordError> {
        serde_json::from_str(&self.progress)
            .map_err(|error| RecordError(format!("the progress is unreadable: {error}")))
    }

    fn particles(&self) -> Result<Particles, RecordError> {
        let (ids, material, path) = (self.integers("id")?, self.integers("material")?, self.integers("path")?);
        let count = ids.len();
        if material.len() != count || path.len() != count {
            return Err(RecordError("the columns 'id', 'material' and 'path' differ in length".to_owned()));
        }
        let paths: Option<Vec<Path>> = path.iter().map(|&n| Path::from_number(u8::try_from(n).ok()?)).collect();
        let paths = paths.ok_or_else(|| RecordError("column 'path' holds an unknown kind of path".to_owned()))?;
        let velocities = self.rows::<7>("velocity", Some(count))?;
        let velocities = velocities.iter().zip(material).zip(paths).map(|((row, &material), path)| Velocity {
            linear: [row[0], row[1], row[2]],
            inverse_mass: row[3],
            angular: [row[4], row[5], row[6]],
            material: material as u32,
            path,
        });
        let two = |row: &[f64; 6]| (Vec3::new(row[0], row[1], row[2]), Vec3::new(row[3], row[4], row[5]));
        let spheres = self.rows::<4>("sphere", Some(count))?;
        let accelerations = self.rows::<6>("acceleration", Some(count))?;
        let loads = self.rows::<6>("load", Some(count))?;
        Ok(Particles::of_records(
            spheres.iter().map(|r| Sphere { centre: [r[0], r[1], r[2]], radius: r[3] }).collect(),
            velocities.collect(),
            accelerations.iter().map(|row| Acceleration::new(two(row).0, two(row).1)).collect(),
            loads.iter().map(|row| Load::new(two(row).0, two(row).1)).collect(),
            ids.iter().map(|&id| ParticleId(id)).collect(),
            self.rows::<1>("density", Some(count))?.iter().map(|row| row[0]).collect(),
        ))
    }

    fn tethers(&self) -> Result<Vec<Tether>, RecordError> {
        let ids = self.integers("tether_id")?;
        let rows = self.rows::<20>("tether", Some(ids.len()))?;
        let tether = |(id, row): (&u64, &[f64; 20])| {
            let vector = |first: usize| Vec3::new(row[first], row[first + 1], row[first + 2]);
            let law = TetherLaw { frequency_squared: row[0], compliance: row[1] };
            let target = PrescribedMotion {
                position: vector(2),
                velocity: vector(5),
                spin: vector(8),
                acceleration: vector(11),
                spin_acceleration: vector(14),
            };
            Tether::new(ParticleId(*id), law, target, vector(17))
        };
        Ok(ids.iter().zip(&rows).map(tether).collect())
    }

    fn wall_contacts(&self, count: usize, parts: &[Option<u16>]) -> Result<Vec<WallContact>, RecordError> {
        let (keys, rest) = self.integers("wall_contact")?.as_chunks::<3>();
        let memories = self.rows::<9>("wall_memory", Some(keys.len()))?;
        let bad = || RecordError("column 'wall_contact' names a particle or part that does not exist".to_owned());
        if !rest.is_empty() || keys.iter().any(|key| key[0] >= count as u64 || key[1] >= parts.len() as u64) {
            return Err(bad());
        }
        let contact = |(key, row): (&[u64; 3], &[f64; 9])| {
            Some(WallContact {
                particle: key[0] as u32,
                part: parts[key[1] as usize]?,
                element: key[2] as u32,
                normal: Vec3::new(row[0], row[1], row[2]),
                memory: memory(&[row[3], row[4], row[5], row[6], row[7], row[8]]),
            })
        };
        Ok(keys.iter().zip(&memories).filter_map(contact).collect())
    }
}

fn memory(row: &[f64; 6]) -> Memory {
    Memory { tangential: Vec3::new(row[0], row[1], row[2]), rolling: Vec3::new(row[3], row[4], row[5]) }
}

fn memory_row(memory: Memory) -> impl Iterator<Item = f64> {
    memory.tangential.iter().chain(memory.rolling.iter()).copied().collect::<Vec<f64>>().into_iter()
}

fn tether_row(tether: &Tether) -> Vec<f64> {
    let PrescribedMotion { position, velocity, spin, acceleration, spin_acceleration } = &tether.target;
    let law = [tether.law.frequency_squared, tether.law.compliance];
    let vectors = [position, velocity, spin, acceleration, spin_acceleration, &tether.force];
    law.into_iter().chain(vectors.into_iter().flat_map(|vector| vector.iter().copied())).collect()
}

impl Simulation {
    /// The complete state.
    #[must_use]
    pub fn record(&self) -> SimulationRecord {
        let p = &self.particles;
        let motions = || (0..p.len()).map(|index| p.motion(index));
        let pair = |[a, b]: [&Vec3; 2]| [a.x, a.y, a.z, b.x, b.y, b.z];
        let neighborhood = &self.neighborhood;
        let walls: Vec<WallContact> = neighborhood.chunks.iter().flat_map(|chunk| chunk.walls.contacts()).collect();
        let lists = neighborhood.chunks.iter().flat_map(|chunk| [&chunk.own, &chunk.cross]);
        let pairs = lists.flat_map(|list| (0..list.len()).filter_map(|entry| list.memory.get(entry)));
        let velocity = |v: &Velocity| {
            [v.linear[0], v.linear[1], v.linear[2], v.inverse_mass, v.angular[0], v.angular[1], v.angular[2]]
        };
        let columns: [Vec<f64>; 10] = [
            p.spheres.iter().flat_map(|s| [s.centre[0], s.centre[1], s.centre[2], s.radius]).collect(),
            motions().flat_map(|(v, _)| velocity(&v)).collect(),
            motions().flat_map(|(_, a)| pair([&a.linear, &a.angular])).collect(),
            p.loads().iter().flat_map(|load| pair([&load.force, &load.torque])).collect(),
            p.densities.clone(),
            neighborhood.outer_reference.iter().flatten().copied().collect(),
            neighborhood.inner_reference.iter().flatten().copied().collect(),
            pairs.flat_map(memory_row).collect(),
            walls
                .iter()
                .flat_map(|c| c.normal.iter().copied().chain(memory_row(c.memory)).collect::<Vec<_>>())
                .collect(),
            self.tethers.iter().flat_map(tether_row).collect(),
        ];
        let keys = walls.iter().flat_map(|c| [u64::from(c.particle), u64::from(c.part), u64::from(c.element)]);
        let integers: [Vec<u64>; 5] = [
            p.ids.iter().map(|id| id.0).collect(),
            p.laws_velocities().iter().map(|v| u64::from(v.material)).collect(),
            p.laws_velocities().iter().map(|v| v.path as u64).collect(),
            keys.collect(),
            self.tethers.iter().map(|tether| tether.id.0).collect(),
        ];
        SimulationRecord {
            reals: REAL_COLUMNS.into_iter().zip(columns).collect(),
            integers: INTEGER_COLUMNS.into_iter().zip(integers).collect(),
            progress: self.progress_text(),
        }
    }

    fn progress_text(&self) -> String {
        let load = |l: &super::wall_contacts::PartLoad| {
            [l.force.x, l.force.y, l.force.z, l.torque.x, l.torque.y, l.torque.z, l.power]
        };
        let progress = Progress {
            steps: self.steps,
            loads_known: self.loads_known,
            part_names: self.setup.parts.iter().map(|part| part.name.clone()).collect(),
            material_names: self.setup.materials.materials.iter().map(|material| material.name.clone()).collect(),
            lists: self.neighborhood.settings(),
            wear: self.neighborhood.wear,
            booked: self.booked,
            momentum: self.momentum,
            removed: self.removed.clone(),
            presence: self.presence.record(),
            energy_watch: self.watchdog.energy_watch(),
            feeds: self.feeds.state(),
            part_loads: self.part_loads.iter().map(load).collect(),
            calm_looks: self.particles.calm_looks.clone(),
            listed_asleep: self.neighborhood.listed_asleep(),
        };
        serde_json::to_string(&progress).expect("plain numbers and names become JSON")
    }

    /// Continues from a record of the same setup, bit for bit.
    ///
    /// # Errors
    /// Where the record does not fit the setup, or is inconsistent.
    pub fn resume(setup: Setup, record: &SimulationRecord) -> Result<Self, RecordError> {
        let progress = record.progress()?;
        let mut simulation = Self::new(setup);
        let names = simulation.setup.parts.iter().map(|part| &part.name);
        if !names.eq(&progress.part_names) {
            return Err(RecordError("the parts are not those of the scene that wrote it".to_owned()));
        }
        if !simulation.feeds.fits(&progress.feeds) {
            return Err(RecordError("the feeds are not those of the scene that wrote it".to_owned()));
        }
        if simulation.neighborhood.settings() != progress.lists {
            return Err(RecordError(
                "the domain, skin or friction are not those of the scene that wrote it".to_owned(),
            ));
        }
        simulation.take_particles(record, &progress)?;
        simulation.take_sleep(progress.calm_looks)?;
        simulation.steps = progress.steps;
        simulation.loads_known = progress.loads_known;
        simulation.booked = progress.booked;
        simulation.momentum = progress.momentum;
        simulation.removed = progress.removed;
        simulation.presence.restore(progress.presence, &mut simulation.walls);
        simulation.watchdog.restore_energy_watch(progress.energy_watch);
        simulation.feeds.restore(progress.feeds);
        for (load, row) in simulation.part_loads.iter_mut().zip(&progress.part_loads) {
            load.force = Vec3::new(row[0], row[1], row[2]);
            load.torque = Vec3::new(row[3], row[4], row[5]);
            load.power = row[6];
        }
        simulation.walls.set_time(simulation.time());
        simulation.collect_wall_candidates();
        simulation.neighborhood.wear = progress.wear;
        Ok(simulation)
    }

    /// Starts anew at time 0 with the particles and contacts of another run's record, under this setup's parts and feeds.
    /// Contacts with parts of the same name keep their memory. The particles' feed numbers move behind this setup's own feeds.
    ///
    /// # Errors
    /// Where the record is inconsistent, or a particle has a material that this setup lacks.
    pub fn start_from(setup: Setup, record: &SimulationRecord) -> Result<Self, RecordError> {
        let progress = record.progress()?;
        let mut simulation = Self::new(setup);
        let settings = simulation.neighborhood.settings();
        simulation.neighborhood.change_settings(progress.lists);
        simulation.take_particles(record, &progress)?;
        simulation.neighborhood.change_settings(settings);
        simulation.rename_materials(&progress.material_names)?;
        // Who slept there has nothing known to rest on here.
        let sleepers =
            simulation.particles.velocities_mut().iter_mut().filter(|velocity| velocity.path == Path::Asleep);
        sleepers.for_each(|velocity| velocity.path = Path::Free);
        let own = simulation.setup.feeds.len() as u32;
        for id in &mut simulation.particles.ids {
            *id = ParticleId::new(id.feed() + own, id.serial());
        }
        for tether in &mut simulation.tethers {
            tether.id = ParticleId::new(tether.id.feed() + own, tether.id.serial());
        }
        for index in 0..simulation.particles.len() {
            if !simulation.particles.path(index).is_prescribed() {
                simulation.book_comer(index);
            }
        }
        simulation.watchdog.expect_new_energy();
        simulation.rebuild_neighborhood();
        if simulation.terms.energy {
            simulation.booked.inserted += simulation.spring_energy(|_, _| true);
        }
        Ok(simulation)
    }

    /// Goes on with who sleeps, and who was calm how often.
    fn take_sleep(&mut self, calm_looks: Vec<u8>) -> Result<(), RecordError> {
        let asleep = (0..self.particles.len()).any(|index| self.particles.path(index) == Path::Asleep);
        if self.setup.sleeping.is_none() && (asleep || !calm_looks.is_empty()) {
            return Err(RecordError("its particles may sleep, and those of this scene may not".to_owned()));
        }
        if !calm_looks.is_empty() && calm_looks.len() != self.particles.len() {
            return Err(RecordError("the progress counts the calm looks of other particles".to_owned()));
        }
        self.particles.calm_looks = calm_looks;
        Ok(())
    }

    /// Gives the particles the numbers that their materials, known by name, have here.
    fn rename_materials(&mut self, names: &[String]) -> Result<(), RecordError> {
        let own = &self.setup.materials.materials;
        for velocity in self.particles.velocities_mut() {
            let missing = || RecordError("its particles have materials that it does not name".to_owned());
            let name = names.get(velocity.material as usize).ok_or_else(missing)?;
            let found = own.iter().position(|material| material.name == *name);
            let missing = || RecordError(format!("its particles are of material '{name}', which this scene lacks"));
            velocity.material = found.ok_or_else(missing)? as u32;
        }
        Ok(())
    }

    fn take_particles(&mut self, record: &SimulationRecord, progress: &Progress) -> Result<(), RecordError> {
        self.particles = record.particles()?;
        self.tethers = record.tethers()?;
        let count = self.particles.len();
        if count == 0 {
            return Ok(());
        }
        let outer = record.rows::<3>("outer_reference", Some(count))?;
        let inner = record.rows::<3>("inner_reference", Some(count))?;
        let (asleep, wear) = (&progress.listed_asleep, progress.wear);
        self.neighborhood.restore(&self.particles, [outer, inner], asleep, wear, &self.threads);
        let memories = record.rows::<6>("pair_memory", None)?;
        self.neighborhood.set_pair_memory(&mut memories.iter().map(memory)).map_err(RecordError)?;
        let same_name =
            |name: &String| self.setup.parts.iter().position(|part| part.name == *name).map(|index| index as u16);
        let parts: Vec<Option<u16>> = progress.part_names.iter().map(same_name).collect();
        let walls = record.wall_contacts(count, &parts)?;
        self.give_wall_contacts(&walls);
        Ok(())
    }
}
