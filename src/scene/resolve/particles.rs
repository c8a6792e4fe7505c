//! `[particle.NAME]`: classes and their sizes.

use super::{Context, Located};
use crate::particle::{GradingBy, ParticleClass, SizeDistribution};
use crate::scene::quantity::Dimension::{Dimensionless, Length};
use crate::scene::reader::{Limit, Reader};
use crate::scene::tree::{Node, Value};

/// All classes, in the file's order; their names go to the context.
pub(super) fn classes(reader: &Reader<'_>, context: &mut Context<'_>) -> Vec<Located<Option<ParticleClass>>> {
    let tables = reader.named_tables("particle", "particle");
    context.classes = tables.iter().map(|(name, _)| name.clone()).collect();
    tables.into_iter().map(|(name, table)| Located { path: table.path(), item: class(name, table, context) }).collect()
}

fn class(name: String, reader: Reader<'_>, context: &Context<'_>) -> Option<ParticleClass> {
    let material = reader.reference("material", "material", &context.materials);
    let diameter = diameter(&reader);
    reader.finish();
    Some(ParticleClass { name, material: u16::try_from(material?).ok()?, diameter: diameter? })
}

fn diameter(reader: &Reader<'_>) -> Option<SizeDistribution> {
    let is_table = matches!(reader.measured("diameter", &[Length]), Some((Node { value: Value::Table(_), .. }, None)));
    if !is_table {
        let diameter = reader.need_quantity("diameter", Length, Limit::Positive)?;
        return Some(SizeDistribution::Fixed { diameter });
    }
    let table = reader.table("diameter", "particle.diameter")?;
    let kinds = ["uniform", "normal", "lognormal", "sieve"];
    let given: Vec<&str> = kinds.into_iter().filter(|kind| table.has(kind)).collect();
    if given.len() > 1 {
        table.report.error(
            "given-twice",
            &table.place_of(given[1]),
            format!("the sizes are given as `{}` and as `{}`", given[0], given[1]),
            "keep one of the two",
        );
    }
    if given.is_empty() {
        table.missing("uniform", "uniform = [\"3 mm\", \"5 mm\"]`, or one of `normal`, `lognormal`, `sieve");
    }
    let uniform = table.array::<2>("uniform", Length, Limit::Positive);
    let uniform = uniform.map(|[minimum, maximum]| SizeDistribution::Uniform { minimum, maximum });
    let normal = table.table("normal", "particle.diameter.normal").and_then(normal);
    let lognormal = table.table("lognormal", "particle.diameter.lognormal").and_then(lognormal);
    let sieve = table.table("sieve", "particle.diameter.sieve").and_then(sieve);
    table.finish();
    uniform.or(normal).or(lognormal).or(sieve)
}

fn normal(reader: Reader<'_>) -> Option<SizeDistribution> {
    let mean = reader.need_quantity("mean", Length, Limit::Positive);
    let deviation = reader.need_quantity("deviation", Length, Limit::Positive);
    let minimum = reader.need_quantity("minimum", Length, Limit::Positive);
    let maximum = reader.need_quantity("maximum", Length, Limit::Positive);
    reader.finish();
    Some(SizeDistribution::Normal { mean: mean?, deviation: deviation?, minimum: minimum?, maximum: maximum? })
}

fn lognormal(reader: Reader<'_>) -> Option<SizeDistribution> {
    let median = reader.need_quantity("median", Length, Limit::Positive);
    let above_one = Limit::Above(1.0);
    let geometric_deviation = reader.need_quantity("geometric_deviation", Dimensionless, above_one);
    let minimum = reader.need_quantity("minimum", Length, Limit::Positive);
    let maximum = reader.need_quantity("maximum", Length, Limit::Positive);
    reader.finish();
    Some(SizeDistribution::Lognormal {
        median: median?,
        geometric_deviation: geometric_deviation?,
        minimum: minimum?,
        maximum: maximum?,
    })
}

fn sieve(reader: Reader<'_>) -> Option<SizeDistribution> {
    let by = reader.need_word("by", &[("mass", GradingBy::Mass), ("number", GradingBy::Number)]);
    let sieves = reader.quantities("sizes", Length, Limit::Positive);
    let fractions = reader.quantities("fractions", Dimensionless, Limit::NotNegative);
    if !reader.has("sizes") {
        reader.missing("sizes", "sizes = [\"2 mm\", \"4 mm\", \"8 mm\"]");
    }
    if !reader.has("fractions") {
        reader.missing("fractions", "fractions = [0.3, 0.7]");
    }
    reader.finish();
    Some(SizeDistribution::Sieve { by: by?, sieves: sieves?, fractions: fractions? })
}
