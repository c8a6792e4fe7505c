//! The manifest of a stream: where it comes from, what it counts, and what identifies its content.

use crate::geometry::plane::{Aperture, GatePlane};
use crate::material::{Material, MaterialTable};
use crate::math::Vec3;
use crate::particle::Body;
use crate::scene::gate::{Exclusion, PassingPoint, PathRecording};
use crate::storage::columns::ColumnEntry;
use crate::storage::staging::write_whole;
use crate::storage::{StorageError, columns::NumberType};
use serde::{Deserialize, Serialize};
use std::fs;
use std::io;
use std::path::Path;

/// Version of the stream format: a reader refuses another major; a larger minor only adds.
pub const FORMAT_MAJOR: u32 = 1;
/// See [`FORMAT_MAJOR`].
pub const FORMAT_MINOR: u32 = 0;
/// Name of the manifest in the stream's folder.
pub const MANIFEST_FILE: &str = "manifest.json";
/// What the manifest says it is.
pub const KIND: &str = "tollgate stream";
/// The container's word for a chunk file.
pub const CHUNK_KIND: &str = "stream chunk";
const CHUNK_PREFIX: &str = "chunk-";
const CHUNK_SUFFIX: &str = ".columns";
const UNITS: &str = "SI: m, kg, s, rad, N, N m, Pa; times are plant times";
/// Field of the manifest that holds the digest of all others.
const OWN_DIGEST: &str = "blake3";
const NEXT: &str = "record the stream again";

/// A whole stream, except for its crossings.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Manifest {
    /// [`KIND`].
    pub kind: String,
    /// Version of the format.
    pub format_major: u32,
    /// Version of the format.
    pub format_minor: u32,
    /// Version of the program that wrote it.
    pub tollgate_version: String,
    /// Units of all values, in words.
    pub units: String,
    /// Where it comes from.
    pub origin: Origin,
    /// What it counts.
    pub counts: Counts,
    /// What happened to parts upstream, in order of time.
    pub events: Vec<StoredEvent>,
    /// Ledger and quality of the cut as the recording stage gives them at its end.
    pub quality: serde_json::Value,
    /// Chunk files, in order.
    pub chunks: Vec<ChunkEntry>,
}

/// Where a stream comes from: all that is known before the first crossing.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Origin {
    /// Name of the gate.
    pub gate: String,
    /// Gate plane.
    pub plane: GatePlane,
    /// Which point of a particle had to pass.
    pub passage: PassingPoint,
    /// Gravity under which it was recorded [m/s2].
    pub gravity: Vec3,
    /// What became of the particles upstream; `None` where the origin does not say.
    pub exclusion: Option<Exclusion>,
    /// How paths are stored; `None` where none are.
    pub paths: Option<PathRecording>,
    /// What the stream is for.
    pub role: Role,
    /// Name of the stage that recorded it.
    pub stage: String,
    /// Key of that stage; empty where it has none.
    pub stage_key: String,
    /// Who computed it.
    pub backend: String,
    /// Its version.
    pub backend_version: String,
    /// Version of what changes the backend's numbers.
    pub numerics_version: u32,
    /// Time step [s]; grid states are at its multiples.
    pub timestep: f64,
    /// Whether contacts were recorded; else a crossing without contacts says nothing.
    pub contacts: bool,
    /// Materials; a crossing's material is an index into this list.
    pub materials: Vec<Material>,
    /// Names of parts; a contact's part is an index into this list.
    pub part_names: Vec<String>,
    /// Mass and inertia of the particles.
    pub body: Body,
    /// Names of feeds by the feed number of particle ids.
    pub feeds: Vec<String>,
    /// Contact laws in words, and what their memories mean.
    pub laws: String,
    /// What was done to the stream since: imported from where, moved how; in order.
    pub provenance: Vec<String>,
}

/// What a stream is for.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Role {
    /// It replaces the upstream in another stage.
    HandOver,
    /// It was recorded where nothing is cut, to be looked at.
    Observed,
}

/// What a stream counts.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
pub struct Counts {
    /// Crossings.
    pub crossings: u64,
    /// Stored contacts.
    pub contacts: u64,
    /// Stored motions of paths.
    pub motions: u64,
    /// Mass that passed [kg].
    pub mass: f64,
    /// Extent in time; `None` without a crossing.
    pub range: Option<Range>,
}

/// Extent in time.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Range {
    /// Step of the first grid state.
    pub first_step: u64,
    /// Step of the last grid state.
    pub last_step: u64,
    /// Earliest passage [s].
    pub first_time: f64,
    /// Latest passage [s].
    pub last_time: f64,
}

impl Range {
    /// The range that holds both.
    #[must_use]
    pub const fn union(self, other: Self) -> Self {
        Self {
            first_step: if self.first_step < other.first_step { self.first_step } else { other.first_step },
            last_step: if self.last_step > other.last_step { self.last_step } else { other.last_step },
            first_time: self.first_time.min(other.first_time),
            last_time: self.last_time.max(other.last_time),
        }
    }
}

/// A part that appeared or disappeared upstream.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct StoredEvent {
    /// The part's name.
    pub part: String,
    /// Whether it is there from then on.
    pub present: bool,
    /// Plant time [s].
    pub time: f64,
}

/// One chunk file.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct ChunkEntry {
    /// File name in the stream's folder.
    pub file: String,
    /// Size [bytes].
    pub bytes: u64,
    /// Crossings in it.
    pub crossings: u64,
    /// Contacts in it.
    pub contacts: u64,
    /// Motions of paths in it.
    pub motions: u64,
    /// Its extent in time.
    pub range: Range,
    /// Digest of its content ([`content_digest`]), hexadecimal.
    pub blake3: String,
}

/// File name of chunk `index`.
#[must_use]
pub fn chunk_file(index: usize) -> String {
    format!("{CHUNK_PREFIX}{index:06}{CHUNK_SUFFIX}")
}

/// True for a file name that a chunk could have.
pub(super) fn is_chunk_file(name: &str) -> bool {
    name.starts_with(CHUNK_PREFIX) && name.ends_with(CHUNK_SUFFIX)
}

/// Digest of a chunk's content: blake3 over its columns' names, types, lengths and digests, so that it does not depend on
/// the program's version in the file's header.
#[must_use]
pub fn content_digest(columns: &[ColumnEntry]) -> String {
    let mut hasher = blake3::Hasher::new();
    for ColumnEntry { name, number, components, length, offset: _, blake3 } in columns {
        let number = match number {
            NumberType::F64 => "f64",
            NumberType::U64 => "u64",
            NumberType::U32 => "u32",
            NumberType::U16 => "u16",
            NumberType::U8 => "u8",
        };
        hasher.update(format!("{name} {number} {components} {length} {blake3}\n").as_bytes());
    }
    hasher.finalize().to_hex().to_string()
}

/// What a scene expects of a stream.
#[derive(Debug, Clone, Copy)]
pub struct Expected<'a> {
    /// The scene's materials.
    pub materials: &'a MaterialTable,
    /// The scene's kind of particles.
    pub body: Body,
    /// The scene's gravity, before a transform of the stream is taken back [m/s2].
    pub gravity: Vec3,
    /// The plane it must have been recorded at, where the scene says.
    pub plane: Option<&'a GatePlane>,
    /// The key of the stage it must come from, where the scene says.
    pub stage_key: Option<&'a str>,
}

impl Manifest {
    /// The manifest of a stream without crossings yet.
    #[must_use]
    pub fn new(origin: Origin) -> Self {
        Self {
            kind: KIND.to_owned(),
            format_major: FORMAT_MAJOR,
            format_minor: FORMAT_MINOR,
            tollgate_version: env!("CARGO_PKG_VERSION").to_owned(),
            units: UNITS.to_owned(),
            origin,
            counts: Counts::default(),
            events: Vec::new(),
            quality: serde_json::Value::Null,
            chunks: Vec::new(),
        }
    }

    /// Digest of what the stream brings into a replay, hexadecimal. The same for equal content, whoever recorded it under
    /// whatever name: without names of gate, stage and files, program version, stage key, quality and provenance.
    ///
    /// # Panics
    /// Never: a manifest is plain names and numbers.
    #[must_use]
    pub fn digest(&self) -> String {
        // Field by field, so that a new field is a decision, not an accident.
        let Self { origin, counts, events, chunks, .. } = self;
        let content = serde_json::json!({
            "format_major": self.format_major,
            "plane": origin.plane,
            "passage": origin.passage,
            "gravity": origin.gravity,
            "exclusion": origin.exclusion,
            "paths": origin.paths,
            "backend": origin.backend,
            "numerics_version": origin.numerics_version,
            "timestep": origin.timestep,
            "contacts": origin.contacts,
            "materials": origin.materials,
            "part_names": origin.part_names,
            "body": origin.body,
            "laws": origin.laws,
            "counts": counts,
            "events": events,
            "chunks": chunks.iter().map(|chunk| &chunk.blake3).collect::<Vec<_>>(),
        });
        blake3::hash(content.to_string().as_bytes()).to_hex().to_string()
    }

    /// What of the stream does not fit the scene, in the user's words; empty where all does.
    #[must_use]
    pub fn misfits(&self, expected: &Expected) -> Vec<String> {
        let origin = &self.origin;
        let mut found: Vec<String> =
            origin.materials.iter().filter_map(|stored| material_misfit(stored, expected.materials)).collect();
        if origin.body != expected.body {
            found.push(format!("its particles are {}, the scene's are {}", body(origin.body), body(expected.body)));
        }
        let gravity = origin.gravity - expected.gravity;
        if gravity.norm() > SAME * expected.gravity.norm() {
            let (stored, own) = (vector(&origin.gravity), vector(&expected.gravity));
            found.push(format!("it was recorded under gravity {stored} m/s2, the scene has {own} m/s2"));
        }
        if let Some(plane) = expected.plane {
            found.extend(plane_misfit(&origin.plane, plane));
        }
        if let Some(key) = expected.stage_key.filter(|key| *key != origin.stage_key) {
            found.push(format!(
                "it was recorded by stage {:?} with key {}, the scene's stage has key {}: something that influences the \
                 result differs",
                origin.stage,
                short(&origin.stage_key),
                short(key)
            ));
        }
        found
    }

    /// For each material of the stream its number in `materials`, by name; `None` where there is none.
    #[must_use]
    pub fn material_numbers(&self, materials: &MaterialTable) -> Vec<Option<u16>> {
        let number = |stored: &Material| {
            let found = materials.materials.iter().position(|own| own.name == stored.name);
            found.and_then(|index| u16::try_from(index).ok())
        };
        self.origin.materials.iter().map(number).collect()
    }

    /// Writes the manifest into the stream's folder.
    pub(super) fn write(&self, folder: &Path) -> Result<(), StorageError> {
        let place = folder.join(MANIFEST_FILE);
        let mismatch = |error: serde_json::Error| StorageError::mismatch(&place, error.to_string());
        let mut value = serde_json::to_value(self).map_err(mismatch)?;
        value[OWN_DIGEST] = value_digest(&value).into();
        let text = serde_json::to_string_pretty(&value).map_err(mismatch)?;
        write_whole(&place, text.as_bytes())
    }

    /// Reads the manifest of the stream in `folder`.
    ///
    /// # Errors
    /// When there is none, or it is foreign, edited, or of another format version.
    pub fn read(folder: &Path) -> Result<Self, StorageError> {
        let place = folder.join(MANIFEST_FILE);
        let refuse = |reason: String| StorageError::unusable(&place, reason);
        let text = fs::read_to_string(&place).map_err(|source| match source.kind() {
            io::ErrorKind::NotFound | io::ErrorKind::NotADirectory => {
                StorageError::unusable(folder, format!("it is not a stream of tollgate: it has no {MANIFEST_FILE}"))
            }
            io::ErrorKind::InvalidData => refuse(format!("it is not text: damaged or foreign; {NEXT}")),
            _ => StorageError::system("read", &place, source),
        })?;
        let unreadable = |error: serde_json::Error| refuse(format!("it cannot be understood ({error}); {NEXT}"));
        let mut value: serde_json::Value = serde_json::from_str(&text).map_err(unreadable)?;
        if value["kind"] != KIND {
            return Err(refuse(format!("it is not the manifest of a {KIND}")));
        }
        let (major, minor) = (&value["format_major"], &value["format_minor"]);
        // The version first: a newer manifest may look different.
        if *major != FORMAT_MAJOR {
            let version = value["tollgate_version"].as_str().unwrap_or("unknown");
            return Err(refuse(format!(
                "it has format {major}.{minor} of tollgate {version}; this program reads format {FORMAT_MAJOR}; use the \
                 version that wrote it"
            )));
        }
        let stored = value.as_object_mut().and_then(|fields| fields.remove(OWN_DIGEST));
        if stored != Some(value_digest(&value).into()) {
            return Err(refuse(format!("it was edited or damaged: its own digest does not fit; {NEXT}")));
        }
        serde_json::from_value(value).map_err(unreadable)
    }
}

/// Digest of a JSON value, however it is laid out in the file.
fn value_digest(value: &serde_json::Value) -> String {
    blake3::hash(value.to_string().as_bytes()).to_hex().to_string()
}

/// Relative difference of numbers that come from the same text through different units or rotations: some roundings.
const SAME: f64 = 1e-12;

fn material_misfit(stored: &Material, scene: &MaterialTable) -> Option<String> {
    let name = &stored.name;
    let Some(own) = scene.materials.iter().find(|own| own.name == *name) else {
        return Some(format!("its material {name:?} is not in the scene"));
    };
    let number = |value: Option<f64>| value.map_or("none".to_owned(), |value| format!("{value} kg/m3"));
    if own.density != stored.density {
        let (was, is) = (number(stored.density), number(own.density));
        return Some(format!("material {name:?} had density {was}, the scene gives {is}"));
    }
    // A table of another code gives no elastic constants.
    (stored.elasticity.is_some() && own.elasticity != stored.elasticity).then(|| {
        let (was, is) = (elasticity(stored), elasticity(own));
        format!("material {name:?} was {was}, in the scene it is {is}")
    })
}

fn elasticity(material: &Material) -> String {
    use crate::material::Elasticity;
    match material.elasticity {
        None => "without elastic constants".to_owned(),
        Some(Elasticity::Rigid) => "rigid".to_owned(),
        Some(Elasticity::Isotropic { youngs_modulus, poissons_ratio }) => {
            format!("elastic with E = {youngs_modulus} Pa and nu = {poissons_ratio}")
        }
    }
}

fn plane_misfit(stored: &GatePlane, own: &GatePlane) -> Option<String> {
    let scale = stored.point.norm().max(own.point.norm()).max(1e-3);
    let same_point = match (&stored.aperture, &own.aperture) {
        // A plane without borders is the same wherever its point lies in it.
        (Aperture::Unbounded, Aperture::Unbounded) => own.distance(&stored.point).abs() <= SAME * scale,
        _ => (stored.point - own.point).norm() <= SAME * scale,
    };
    if !same_point || (stored.normal - own.normal).norm() > SAME {
        return Some(format!(
            "it was recorded at the plane through {} m with normal {}, the scene's plane goes through {} m with normal {}",
            vector(&stored.point),
            vector(&stored.normal),
            vector(&own.point),
            vector(&own.normal)
        ));
    }
    (!same_aperture(&stored.aperture, &own.aperture))
        .then(|| format!("the opening of its plane was {:?}, the scene's is {:?}", stored.aperture, own.aperture))
}

fn same_aperture(stored: &Aperture, own: &Aperture) -> bool {
    let close = |a: &Vec3, b: &Vec3| (a - b).norm() <= SAME * a.norm();
    match (stored, own) {
        (Aperture::Unbounded, Aperture::Unbounded) => true,
        (Aperture::Disc { radius: a }, Aperture::Disc { radius: b }) => (a - b).abs() <= SAME * a,
        (Aperture::Rectangle { side_a, side_b }, Aperture::Rectangle { side_a: a, side_b: b }) => {
            close(side_a, a) && close(side_b, b)
        }
        _ => false,
    }
}

fn body(body: Body) -> String {
    match body {
        Body::Sphere => "spheres".to_owned(),
        Body::Disc { thickness } => format!("discs of {thickness} m thickness"),
    }
}

/// A vector in the shortest digits that read back.
pub(super) fn vector(vector: &Vec3) -> String {
    format!("({}, {}, {})", vector.x, vector.y, vector.z)
}

fn short(key: &str) -> &str {
    if key.is_empty() { "(none)" } else { key.get(..12).unwrap_or(key) }
}
