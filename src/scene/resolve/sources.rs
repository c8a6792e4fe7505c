//! `[[feed]]`: fills, streams and initial states.

use super::{Context, Located, regions};
use crate::dem::feed::initial_state::{self, InitialStateError};
use crate::dem::feed::{Amount, Face, Feed, FeedKind, Rate, Region};
use crate::math::Vec3;
use crate::scene::diagnostics::Place;
use crate::scene::quantity;
use crate::scene::quantity::Dimension::{self, Mass, MassRate, NumberRate, Time, Velocity};
use crate::scene::reader::{Limit, Reader};
use crate::scene::tree::{Node, Value};

/// So many findings of one initial state are shown.
const MOST_FINDINGS: usize = 20;

#[derive(Clone, Copy)]
enum Kind {
    Fill,
    Stream,
    File,
}

/// All feeds, in the file's order.
pub(super) fn feeds(
    reader: &Reader<'_>,
    context: &Context<'_>,
    names: &mut Vec<(&'static str, String, Place)>,
) -> Vec<Located<Feed>> {
    let mut feeds = Vec::new();
    for (number, table) in reader.tables("feed", "feed").into_iter().enumerate() {
        let path = table.path();
        let place = table.place_of("name");
        let name = table.name();
        if let Some(name) = &name {
            names.push(("feed", name.clone(), place));
        }
        let kinds = [("fill", Kind::Fill), ("stream", Kind::Stream), ("file", Kind::File)];
        let Some(kind) = table.need_word("kind", &kinds) else { continue };
        let kind = match kind {
            Kind::Fill => fill(&table, context),
            Kind::Stream => stream(&table, context),
            Kind::File => file(&table, context, number),
        };
        table.finish();
        if let Some((name, kind)) = name.zip(kind) {
            feeds.push(Located { path, item: Feed { name, kind } });
        }
    }
    feeds
}

fn fill(reader: &Reader<'_>, context: &Context<'_>) -> Option<FeedKind> {
    let class = reader.reference("particle", "particle", &context.classes);
    let region = region(reader, context);
    let amount = amount(reader);
    if !reader.has("amount") {
        reader.missing("amount", "amount = 1000` (a count) or `amount = \"2 kg\"");
    }
    let velocity = reader.vector("velocity", Velocity).unwrap_or_else(Vec3::zeros);
    let start = reader.quantity("start", Time, Limit::NotNegative).unwrap_or(0.0);
    let until = reader.quantity("until", Time, Limit::NotNegative).unwrap_or(f64::INFINITY);
    let interval = reader.quantity("interval", Time, Limit::Positive).unwrap_or(f64::INFINITY);
    Some(FeedKind::Fill { class: class?, region: region?, amount: amount?, velocity, start, interval, until })
}

fn region(reader: &Reader<'_>, context: &Context<'_>) -> Option<Region> {
    if !reader.has("region") {
        reader.missing("region", "region = { shape = \"box\", min_mm = [0, 0, 0], max_mm = [100, 100, 100] }");
    }
    regions::region(reader.table("region", "feed.region")?, context)
}

fn stream(reader: &Reader<'_>, context: &Context<'_>) -> Option<FeedKind> {
    let class = reader.reference("particle", "particle", &context.classes);
    let face = face(reader);
    let rate = rate(reader);
    let amount = amount(reader);
    if reader.has("amount") && amount.is_none() {
        return None;
    }
    let velocity = reader.need_vector("velocity", Velocity);
    let start = reader.quantity("start", Time, Limit::NotNegative).unwrap_or(0.0);
    let until = reader.quantity("until", Time, Limit::NotNegative).unwrap_or(f64::INFINITY);
    Some(FeedKind::Stream { class: class?, face: face?, rate: rate?, amount, velocity: velocity?, start, until })
}

fn face(reader: &Reader<'_>) -> Option<Face> {
    if !reader.has("face") {
        let example = "face = { shape = \"disc\", centre_mm = [0, 0, 0], normal = [0, 0, -1], radius = \"50 mm\" }";
        reader.missing("face", example);
    }
    regions::face(reader.table("face", "feed.face")?)
}

/// `amount`: an integer counts particles, a mass weighs them.
fn amount(reader: &Reader<'_>) -> Option<Amount> {
    let (node, unit) = reader.measured("amount", &[Mass])?;
    match (&node.value, unit) {
        (Value::Integer(count), None) => {
            reader.limited("amount", node, *count as f64, Limit::Positive)?;
            u64::try_from(*count).ok().map(Amount::Count)
        }
        (_, unit) => {
            let mass = reader.number("amount", node, unit.map(|(_, factor)| factor), Mass)?;
            reader.limited("amount", node, mass, Limit::Positive).map(Amount::Mass)
        }
    }
}

/// `rate`: a mass a second or a number a second.
fn rate(reader: &Reader<'_>) -> Option<Rate> {
    if !reader.has("rate") {
        reader.missing("rate", "rate = \"5 kg/s\"` or `rate = \"200 1/s\"");
    }
    let (node, unit) = reader.measured("rate", &[MassRate, NumberRate])?;
    let dimension = match unit {
        Some((dimension, _)) => dimension,
        None => written_dimension(node),
    };
    let value = reader.number("rate", node, unit.map(|(_, factor)| factor), dimension)?;
    let value = reader.limited("rate", node, value, Limit::Positive)?;
    Some(if dimension == NumberRate { Rate::Count(value) } else { Rate::Mass(value) })
}

fn written_dimension(node: &Node) -> Dimension {
    match &node.value {
        Value::Text(text) if quantity::parse(text, NumberRate).is_ok() => NumberRate,
        _ => MassRate,
    }
}

fn file(reader: &Reader<'_>, context: &Context<'_>, number: usize) -> Option<FeedKind> {
    let name = reader.need_text("file", "start.csv")?;
    let materials: Vec<(String, Option<f64>)> =
        context.materials.iter().cloned().zip(context.densities.iter().copied()).collect();
    let path = context.base.join(name);
    if path.metadata().is_ok_and(|found| !found.is_file()) {
        // A device would be read for ever.
        let what = format!("\"{name}\" is no file");
        reader.report.error("initial-state", &reader.place_of("file"), what, "name a CSV file");
        return None;
    }
    match initial_state::read(&path, u32::try_from(number).ok()?, &materials) {
        Ok(particles) => Some(FeedKind::File { particles: particles.into() }),
        Err(InitialStateError::Unreadable { source, .. }) => {
            reader.report.error(
                "initial-state",
                &reader.place_of("file"),
                format!("the initial state \"{name}\" cannot be read: {source}"),
                "files are named from the folder of the scene",
            );
            None
        }
        Err(InitialStateError::Invalid { findings, .. }) => {
            for finding in findings.iter().take(MOST_FINDINGS) {
                reader.report.error(
                    "initial-state",
                    &reader.place_of("file"),
                    format!("{name}:{}: {}", finding.line, finding.text),
                    "correct the file; the reference of the scene explains its columns",
                );
            }
            None
        }
    }
}
