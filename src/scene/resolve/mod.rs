//! From the tree to typed parts of a scene. What is wrong goes to the report; what is right goes on, so that rules
//! between keys can still be checked.

mod backends;
mod gates;
mod materials;
mod outputs;
mod particles;
mod parts;
mod regions;
mod sources;
mod stages;

use super::diagnostics::{Place, Report};
use super::extent;
use super::gate::Gate;
use super::meshes::Meshes;
use super::quantity::Dimension;
use super::read::Files;
use super::reader::{Limit, Reader};
use super::tree::{Node, Table, Value};
use super::{EndConditions, Measure, OutputSettings, SolverSettings};
use crate::dem::feed::Feed;
use crate::dem::law::LawSettings;
use crate::geometry::part::{AtRest, Part, Trigger};
use crate::material::{Material, PairProperties};
use crate::math::{Vec3, vec3};
use crate::particle::{Body, ParticleClass};
use crate::scene::backend::{BackendName, LiggghtsSettings};
use std::path::{Path, PathBuf};

/// The only version of the scene format so far.
const VERSION: u64 = 1;
/// Standard gravity [m/s2] (CGPM 1901, rounded as engineers do).
const GRAVITY: f64 = 9.81;

/// A name as given: what it names, itself, where it stands.
pub(super) type Name = (&'static str, String, Place);

/// Something resolved and the path of its keys, for the rules' findings.
#[derive(Debug)]
pub(super) struct Located<T> {
    /// Path: `feed.0`.
    pub path: String,
    /// The thing itself.
    pub item: T,
}

/// A pair as written.
#[derive(Debug)]
pub(super) struct PairDraft {
    /// First material.
    pub a: u16,
    /// Second material.
    pub b: u16,
    /// Its properties, where they are all right.
    pub properties: Option<PairProperties>,
}

/// A part, and whether its surface was read from an STL file.
#[derive(Debug)]
pub(super) struct PartDraft {
    /// The part.
    pub part: Part,
    /// Its file.
    pub file: Option<PathBuf>,
}

/// A scene on its way: only what could be resolved.
#[derive(Debug)]
pub(super) struct Draft {
    pub name: String,
    pub seed: u64,
    pub body: Body,
    pub gravity: Vec3,
    pub domain: DomainDraft,
    pub materials: Vec<Material>,
    pub pairs: Vec<Located<PairDraft>>,
    /// True where every pair names two materials.
    pub pairs_whole: bool,
    pub law: Option<LawSettings>,
    pub classes: Vec<Located<Option<ParticleClass>>>,
    pub feeds: Vec<Located<Feed>>,
    pub parts: Vec<Located<PartDraft>>,
    pub solver: SolverSettings,
    pub end: Option<EndConditions>,
    pub output: OutputSettings,
    pub measures: Vec<Located<MeasureDraft>>,
    pub gates: Vec<Located<Gate>>,
    pub stages: stages::Stages,
    pub backend: BackendName,
    pub liggghts: LiggghtsSettings,
    pub start_checkpoint: Option<PathBuf>,
    /// Names of feeds, parts, gates, stages and measures as given, with their places: also of those that did not resolve.
    pub names: Vec<Name>,
}

/// The domain as written.
#[derive(Debug, Default)]
pub(super) struct DomainDraft {
    /// Lower corner [m].
    pub minimum: Option<[f64; 3]>,
    /// Upper corner [m].
    pub maximum: Option<[f64; 3]>,
    /// Which axes repeat.
    pub periodic: [bool; 3],
}

/// A measure; its region is the domain where none is given.
#[derive(Debug)]
pub(super) struct MeasureDraft {
    /// The measure, with [`crate::math::Bounds::EMPTY`] for the domain.
    pub measure: Measure,
}

/// What resolving needs beside the tree.
pub(super) struct Context<'a> {
    /// Folder that files are named from.
    pub base: &'a Path,
    /// STL files that were read already.
    pub meshes: &'a Meshes,
    /// Names of the materials.
    pub materials: Vec<String>,
    /// Density of each material [kg/m3].
    pub densities: Vec<Option<f64>>,
    /// Names of the particle classes.
    pub classes: Vec<String>,
}

/// Resolves a scene as written.
pub(super) fn resolve(table: &Table, name: &str, files: Files<'_>, report: &Report<'_>) -> Draft {
    let base = files.base;
    let reader = Reader::root(table, "scene", report);
    version(&reader);
    let body = body(&reader);
    let law = contact(&reader);
    let materials = materials::materials(&reader);
    let mut context = Context {
        base,
        meshes: files.meshes,
        materials: materials.iter().map(|material| material.name.clone()).collect(),
        densities: materials.iter().map(|material| material.density).collect(),
        classes: Vec::new(),
    };
    let (pairs, pairs_whole) = materials::pairs(&reader, &context, law.as_ref());
    let classes = particles::classes(&reader, &mut context);
    let mut names = Vec::new();
    let feeds = sources::feeds(&reader, &context, &mut names);
    let parts = parts::parts(&reader, &context, &mut names);
    let end = outputs::end(&reader);
    let largest = extent::largest_diameter(&classes, &feeds);
    let gates = gates::gates(&reader, largest, &mut names);
    let stages = {
        let part_names = parts.iter().map(|part| part.item.part.name.clone()).collect();
        let mut stage_names = Vec::new();
        let known = stages::Known { names: &names, parts: part_names, feeds: &feeds, gates: &gates, largest };
        let stages = stages::stages(&reader, &context, &known, &mut stage_names);
        names.append(&mut stage_names);
        stages
    };
    let draft = Draft {
        name: reader.text("title").map_or_else(|| name.to_owned(), str::to_owned),
        seed: reader.integer("seed", 1).unwrap_or(1),
        body,
        gravity: reader.vector("gravity", Dimension::Acceleration).unwrap_or(vec3(0.0, 0.0, -GRAVITY)),
        domain: domain(&reader),
        materials,
        pairs,
        pairs_whole,
        law,
        classes,
        feeds,
        parts,
        solver: outputs::solver(&reader),
        output: outputs::output(&reader, end.as_ref()),
        end,
        measures: outputs::measures(&reader, &mut names),
        gates,
        stages,
        backend: backends::backend(&reader).unwrap_or_default(),
        liggghts: backends::liggghts(&reader, base),
        start_checkpoint: reader.text("start_checkpoint").map(|path| base.join(path)),
        names,
    };
    reader.finish();
    draft
}

fn version(reader: &Reader<'_>) {
    if !reader.has("version") {
        reader.missing("version", &format!("version = {VERSION}"));
    }
    if let Some(version) = reader.integer("version", VERSION)
        && version != VERSION
    {
        reader.report.error(
            "unknown-version",
            &reader.place_of("version"),
            format!("version {version} of the scene format is not known"),
            format!("write `version = {VERSION}`, or use a newer tollgate"),
        );
    }
}

fn body(reader: &Reader<'_>) -> Body {
    let dimensions = reader.integer("dimensions", 3).unwrap_or(3);
    let thickness = reader.quantity("thickness", Dimension::Length, Limit::Positive);
    let place = reader.place_of(if reader.has("thickness") { "thickness" } else { "dimensions" });
    match dimensions {
        3 => {
            if reader.has("thickness") {
                reader.report.error(
                    "plane-thickness",
                    &place,
                    "`thickness` is given, but the scene has three dimensions",
                    "remove it, or write `dimensions = 2`",
                );
            }
            Body::Sphere
        }
        2 => {
            if !reader.has("thickness") {
                reader.report.error(
                    "plane-thickness",
                    &place,
                    "a plane problem needs the `thickness` of its slice",
                    "add for example `thickness = \"3 mm\"`",
                );
            }
            Body::Disc { thickness: thickness.unwrap_or(1.0) }
        }
        other => {
            reader.report.error(
                "out-of-range",
                &place,
                format!("`dimensions` must be 2 or 3, and is {other}"),
                "write 3 for space, or 2 for a plane problem in x and z",
            );
            Body::Sphere
        }
    }
}

fn contact(reader: &Reader<'_>) -> Option<LawSettings> {
    use crate::dem::law::{Compatibility, NormalLaw, RollingLaw, TangentialLaw};
    let Some(contact) = reader.table("contact", "contact") else {
        if !reader.has("contact") {
            reader.missing("contact", "[contact]` with `law = \"hertz-mindlin\"");
        }
        return None;
    };
    let normal = contact.need_word("law", &[("linear", NormalLaw::Linear), ("hertz-mindlin", NormalLaw::HertzMindlin)]);
    let law = LawSettings {
        normal: normal.unwrap_or(NormalLaw::HertzMindlin),
        tangential: contact
            .word("tangential", &[("total", TangentialLaw::Total), ("incremental", TangentialLaw::Incremental)])
            .unwrap_or(TangentialLaw::Total),
        tangential_damping: contact.boolean("tangential_damping", true),
        attraction: contact.boolean("attraction", true),
        rolling: contact
            .word("rolling", &[("none", RollingLaw::None), ("cdt", RollingLaw::Cdt), ("epsd2", RollingLaw::Epsd2)])
            .unwrap_or(RollingLaw::None),
        characteristic_velocity: contact
            .quantity("characteristic_velocity", Dimension::Velocity, Limit::Positive)
            .unwrap_or(0.0),
        compatibility: contact
            .word("compatibility", &[("tollgate", Compatibility::Tollgate), ("liggghts", Compatibility::Liggghts)])
            .unwrap_or(Compatibility::Tollgate),
    };
    contact.finish();
    normal.map(|_| law)
}

fn domain(reader: &Reader<'_>) -> DomainDraft {
    let Some(domain) = reader.table("domain", "domain") else { return DomainDraft::default() };
    let mut draft = DomainDraft {
        minimum: domain.array("min", Dimension::Length, Limit::Any),
        maximum: domain.array("max", Dimension::Length, Limit::Any),
        periodic: [false; 3],
    };
    if let Some(boundary) = domain.table("boundary", "domain.boundary") {
        for (axis, key) in ["x", "y", "z"].into_iter().enumerate() {
            draft.periodic[axis] = boundary.word(key, &[("open", false), ("periodic", true)]).unwrap_or(false);
        }
        boundary.finish();
    }
    domain.finish();
    draft
}

/// The table `at_rest`, or any of the same keys.
fn at_rest(reader: Reader<'_>) -> Option<AtRest> {
    let speed = reader.need_quantity("speed", Dimension::Velocity, Limit::Positive);
    let hold = reader.need_quantity("hold", Dimension::Time, Limit::NotNegative);
    let not_before = reader.quantity("not_before", Dimension::Time, Limit::NotNegative).unwrap_or(0.0);
    reader.finish();
    Some(AtRest { speed: speed?, hold: hold?, not_before })
}

/// A trigger: a time, or a table with `at_rest`.
fn trigger(reader: &Reader<'_>, key: &'static str, default: Trigger) -> Trigger {
    let is_table =
        matches!(reader.measured(key, &[Dimension::Time]), Some((Node { value: Value::Table(_), .. }, None)));
    if !is_table {
        return match reader.quantity(key, Dimension::Time, Limit::NotNegative) {
            Some(time) => Trigger::At { time },
            None => default,
        };
    }
    let Some(table) = reader.table(key, "trigger") else { return default };
    let found = match table.table("at_rest", "at_rest") {
        Some(inner) => at_rest(inner),
        None => {
            if !table.has("at_rest") {
                table.missing("at_rest", "at_rest = { speed = \"1 mm/s\", hold = \"0.1 s\" }");
            }
            None
        }
    };
    table.finish();
    found.map_or(default, Trigger::AtRest)
}
