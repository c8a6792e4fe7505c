//! `[solver]`, `[end]`, `[output]` and `[[measure]]`.

use super::{Located, MeasureDraft, at_rest};
use crate::math::Bounds;
use crate::scene::diagnostics::Place;
use crate::scene::quantity::Dimension::{Dimensionless, Length, Time, Velocity};
use crate::scene::reader::{Limit, Reader};
use crate::scene::tree::{Node, Value};
use crate::scene::{EndConditions, Measure, MeasureKind, OutputSettings, Sleeping, SolverSettings};

/// Share of the binding time-step limit [-].
const TIMESTEP_FRACTION: f64 = 0.2;
/// Largest overlap, as a share of the smaller radius [-].
const OVERLAP_LIMIT: f64 = 0.1;
/// Unbalanced force over the weight at which a sleeper wakes [-].
const UNBALANCED: f64 = 0.01;
/// Rows of `series.csv` where the scene does not say.
const SERIES_ROWS: f64 = 200.0;

/// Reads `[solver]`.
pub(super) fn solver(reader: &Reader<'_>) -> SolverSettings {
    let mut settings = SolverSettings {
        timestep: None,
        timestep_fraction: TIMESTEP_FRACTION,
        skin: None,
        overlap_limit: OVERLAP_LIMIT,
        impact_speed: None,
        sleeping: None,
        forced_models: Vec::new(),
    };
    let Some(table) = reader.table("solver", "solver") else { return settings };
    let auto = matches!(table.measured("timestep", &[Time]), Some((Node { value: Value::Text(text), .. }, None)) if text == "auto");
    if !auto {
        settings.timestep = table.quantity("timestep", Time, Limit::Positive);
    }
    let one = Limit::Within(0.0, 1.0);
    settings.timestep_fraction = table.quantity("timestep_fraction", Dimensionless, one).unwrap_or(TIMESTEP_FRACTION);
    settings.skin = table.quantity("skin", Length, Limit::Positive);
    settings.overlap_limit = table.quantity("overlap_limit", Dimensionless, one).unwrap_or(OVERLAP_LIMIT);
    settings.impact_speed = table.quantity("impact_speed", Velocity, Limit::Positive);
    settings.sleeping = table.table("sleeping", "solver.sleeping").and_then(sleeping);
    if let Some(models) = table.table("models", "solver.models") {
        for entry in models.entries().entries.iter() {
            match entry.node.value {
                Value::Boolean(on) => settings.forced_models.push((entry.key.clone(), on)),
                _ => models.wrong_type(&entry.key, &entry.node, "true or false", "true"),
            }
        }
    }
    table.finish();
    settings
}

/// The keys of `sleeping`.
fn sleeping(table: Reader<'_>) -> Option<Sleeping> {
    let speed = table.need_quantity("speed", Velocity, Limit::Positive);
    let hold = table.need_quantity("hold", Time, Limit::Positive);
    let unbalanced = table.quantity("unbalanced", Dimensionless, Limit::Within(0.0, 1.0)).unwrap_or(UNBALANCED);
    table.finish();
    Some(Sleeping { speed: speed?, hold: hold?, unbalanced })
}

/// Reads `[end]`.
pub(super) fn end(reader: &Reader<'_>) -> Option<EndConditions> {
    let Some(table) = reader.table("end", "end") else {
        if !reader.has("end") {
            reader.missing("end", "[end]` with `time = \"10 s\"");
        }
        return None;
    };
    end_conditions(table)
}

/// The keys of `[end]`, of the scene or of a stage.
pub(super) fn end_conditions(table: Reader<'_>) -> Option<EndConditions> {
    let time = table.need_quantity("time", Time, Limit::Positive);
    let rest = table.table("at_rest", "at_rest").and_then(at_rest);
    let empty = table.boolean("empty", false);
    let left_count = table.integer("left_count", 1000);
    table.finish();
    Some(EndConditions { time: time?, at_rest: rest, empty, left_count })
}

#[derive(Clone, Copy, PartialEq)]
enum Format {
    Vtp,
    Lammps,
}

/// Reads `[output]`.
pub(super) fn output(reader: &Reader<'_>, end: Option<&EndConditions>) -> OutputSettings {
    let mut settings = OutputSettings {
        frame_interval: None,
        vtp: true,
        lammps: false,
        contacts: false,
        series_interval: end.map_or(1.0, |end| end.time / SERIES_ROWS),
        energy: false,
        checkpoint_interval: None,
    };
    let Some(table) = reader.table("output", "output") else { return settings };
    settings.frame_interval = table.quantity("frames", Time, Limit::Positive);
    if let Some(node) = table.node("formats") {
        let formats = formats(&table, node);
        settings.vtp = formats.contains(&Format::Vtp);
        settings.lammps = formats.contains(&Format::Lammps);
    }
    settings.contacts = table.boolean("contacts", false);
    if let Some(interval) = table.quantity("series", Time, Limit::Positive) {
        settings.series_interval = interval;
    }
    settings.energy = table.boolean("energy", false);
    settings.checkpoint_interval = table.quantity("checkpoints", Time, Limit::Positive);
    table.finish();
    settings
}

fn formats(table: &Reader<'_>, node: &Node) -> Vec<Format> {
    let Value::Array(items) = &node.value else {
        table.wrong_type("formats", node, "an array", "[\"vtp\", \"lammps\"]");
        return Vec::new();
    };
    let words = [("vtp", Format::Vtp), ("lammps", Format::Lammps)];
    items.iter().filter_map(|item| table.word_of("formats", item, &words)).collect()
}

#[derive(Clone, Copy)]
enum Kind {
    AngleOfRepose,
    MassFlowRate,
    CoordinationNumber,
    SolidFraction,
    CentreOfMass,
    SizeDistribution,
}

/// All measures, in the file's order.
pub(super) fn measures(
    reader: &Reader<'_>,
    names: &mut Vec<(&'static str, String, Place)>,
) -> Vec<Located<MeasureDraft>> {
    let mut measures = Vec::new();
    for table in reader.tables("measure", "measure") {
        let path = table.path();
        let place = table.place_of("name");
        let name = table.name();
        if let Some(name) = &name {
            names.push(("measure", name.clone(), place));
        }
        let kinds = [
            ("angle-of-repose", Kind::AngleOfRepose),
            ("mass-flow-rate", Kind::MassFlowRate),
            ("coordination-number", Kind::CoordinationNumber),
            ("solid-fraction", Kind::SolidFraction),
            ("centre-of-mass", Kind::CentreOfMass),
            ("size-distribution", Kind::SizeDistribution),
        ];
        let Some(kind) = table.need_word("kind", &kinds) else { continue };
        let kind = measure(&table, kind);
        table.finish();
        if let Some((name, kind)) = name.zip(kind) {
            measures.push(Located { path, item: MeasureDraft { measure: Measure { name, kind } } });
        }
    }
    measures
}

fn measure(reader: &Reader<'_>, kind: Kind) -> Option<MeasureKind> {
    if matches!(kind, Kind::MassFlowRate) {
        let (point, normal) = (reader.need_vector("point", Length), reader.need_direction("normal"));
        return Some(MeasureKind::MassFlowRate { point: point?, normal: normal? });
    }
    let region = region(reader);
    Some(match kind {
        Kind::AngleOfRepose => {
            let along = reader.need_word("along", &[("x", 0), ("y", 1)]);
            MeasureKind::AngleOfRepose { region: region?, along: along? }
        }
        Kind::CoordinationNumber => MeasureKind::CoordinationNumber { region: region? },
        Kind::SolidFraction => MeasureKind::SolidFraction { region: region? },
        Kind::CentreOfMass => MeasureKind::CentreOfMass { region: region? },
        Kind::SizeDistribution => MeasureKind::SizeDistribution { region: region? },
        Kind::MassFlowRate => unreachable!("returned above"),
    })
}

/// The region of a measure; empty bounds stand for the domain, which is not known yet.
fn region(reader: &Reader<'_>) -> Option<Bounds> {
    if !reader.has("region") {
        return Some(Bounds::EMPTY);
    }
    let table = reader.table("region", "measure.region")?;
    let (minimum, maximum) = (table.need_vector("min", Length), table.need_vector("max", Length));
    let corners = super::regions::corners(&table, minimum, maximum);
    table.finish();
    corners.map(|(minimum, maximum)| Bounds { minimum: minimum.into(), maximum: maximum.into() })
}
