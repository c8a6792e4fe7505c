//! The variants of a campaign: every combination of its factors' points.

use super::file::{Campaign, Column, Value};

/// One point of a campaign.
#[derive(Debug, Clone, PartialEq)]
pub struct Variant {
    /// Its place in the campaign, from 1.
    pub number: usize,
    /// Values of all columns, in the columns' order.
    pub values: Vec<Value>,
    /// What it changes in the base scene: dotted key, TOML value.
    pub settings: Vec<(String, String)>,
}

/// All columns of a campaign, factor by factor.
#[must_use]
pub fn columns(campaign: &Campaign) -> Vec<&Column> {
    campaign.factors.iter().flat_map(|factor| &factor.columns).collect()
}

/// All variants: factors crossed, the last one fastest; a campaign without factors has one.
#[must_use]
pub fn variants(campaign: &Campaign) -> Vec<Variant> {
    let columns = columns(campaign);
    let mut points: Vec<Vec<&Value>> = vec![Vec::new()];
    for factor in &campaign.factors {
        let crossed = points.iter().flat_map(|point| {
            factor.points.iter().map(move |more| point.iter().copied().chain(more).collect::<Vec<_>>())
        });
        points = crossed.collect();
    }
    let variant = |(index, point): (usize, Vec<&Value>)| {
        let own = columns
            .iter()
            .zip(&point)
            .flat_map(|(column, value)| column.keys.iter().map(|key| (key.clone(), value.setting.clone())));
        Variant {
            number: index + 1,
            settings: campaign.settings.iter().cloned().chain(own).collect(),
            values: point.into_iter().cloned().collect(),
        }
    };
    points.into_iter().enumerate().map(variant).collect()
}

/// What a variant is called: `tilt = 30 deg, speed = 8 rpm`.
#[must_use]
pub fn label(columns: &[&Column], variant: &Variant) -> String {
    let part = |(column, value): (&&Column, &Value)| {
        let unit = if column.unit.is_empty() { String::new() } else { format!(" {}", column.unit) };
        format!("{} = {}{unit}", column.name, shown(value))
    };
    let parts: Vec<String> = columns.iter().zip(&variant.values).map(part).collect();
    if parts.is_empty() { "the base scene".to_owned() } else { parts.join(", ") }
}

/// A value for people: a number with six digits.
#[must_use]
pub fn shown(value: &Value) -> String {
    match value.number() {
        Some(number) if value.cell.len() > 8 => format!("{}", format!("{number:.5e}").parse::<f64>().unwrap_or(number)),
        _ => value.cell.clone(),
    }
}

/// Which variants are meant, from the words of `--only`: a number `3`, numbers `2-5`, or a value `tilt=30`, which a number
/// meets to six digits. A variant must meet one of the numbers, where there are any, and of each column one of its values.
///
/// # Errors
/// Says which word names nothing.
pub fn chosen(columns: &[&Column], variants: &[Variant], words: &[String]) -> Result<Vec<usize>, String> {
    let mut numbers: Vec<(usize, usize)> = Vec::new();
    let mut values: Vec<Vec<&str>> = vec![Vec::new(); columns.len()];
    for word in words {
        let before = (numbers.len(), values.iter().map(Vec::len).sum::<usize>());
        if let Some((name, value)) = word.split_once('=') {
            let column = columns.iter().position(|column| column.name == name.trim() || column.header() == name.trim());
            if let Some(index) =
                column.filter(|index| variants.iter().any(|v| is_value(&v.values[*index], value.trim())))
            {
                values[index].push(value.trim());
            }
        } else {
            let (from, to) = word.split_once('-').unwrap_or((word, word));
            if let (Ok(from), Ok(to)) = (from.trim().parse::<usize>(), to.trim().parse::<usize>())
                && from >= 1
                && from <= to
                && to <= variants.len()
            {
                numbers.push((from, to));
            }
        }
        if before == (numbers.len(), values.iter().map(Vec::len).sum::<usize>()) {
            let names: Vec<&str> = columns.iter().map(|column| column.name.as_str()).collect();
            return Err(format!(
                "--only {word} names no variant; write a number from 1 to {}, a range such as 2-5, or NAME=VALUE with one of {}",
                variants.len(),
                names.join(", ")
            ));
        }
    }
    let is_meant = |variant: &Variant| {
        (numbers.is_empty() || numbers.iter().any(|(from, to)| (*from..=*to).contains(&variant.number)))
            && values
                .iter()
                .zip(&variant.values)
                .all(|(wanted, value)| wanted.is_empty() || wanted.iter().any(|wanted| is_value(value, wanted)))
    };
    Ok((0..variants.len()).filter(|index| is_meant(&variants[*index])).collect())
}

fn is_value(value: &Value, wanted: &str) -> bool {
    value.cell == wanted || shown(value) == wanted
}

#[cfg(test)]
mod tests {
    use super::chosen as chosen_of;
    use super::*;
    use crate::campaign::file::read_text;
    use std::path::Path;

    fn campaign(text: &str) -> Campaign {
        read_text(&format!("version = 1\n{text}"), Path::new("tests/campaigns/campaign.toml"))
            .expect("a valid campaign")
    }

    const CROSSED: &str = r#"
[[axis]]
name = "tilt"
keys = "part.chute.place.rotate.angle"
unit = "deg"
from = 30
to = 50
count = 3
[[axis]]
name = "friction"
keys = ["pair.ore-liner.friction", "pair.ore-steel.friction"]
values = [0.4, 0.5]
zip = "wear"
[[axis]]
name = "liner"
keys = "part.chute.material"
values = ["steel", "liner"]
zip = "wear"
"#;

    #[test]
    fn factors_are_crossed_and_zipped_axes_advance_together() {
        let campaign = campaign(CROSSED);
        let columns = columns(&campaign);
        let all = variants(&campaign);
        let labels: Vec<String> = all.iter().map(|variant| label(&columns, variant)).collect();
        assert_eq!(labels.len(), 6);
        assert_eq!(labels[0], "tilt = 30 deg, friction = 0.4, liner = steel");
        assert_eq!(labels[3], "tilt = 40 deg, friction = 0.5, liner = liner");
        let set: Vec<(&str, &str)> =
            all[3].settings.iter().map(|(key, value)| (key.as_str(), value.as_str())).collect();
        let expected = [
            ("part.chute.place.rotate.angle", "\"40 deg\""),
            ("pair.ore-liner.friction", "0.5"),
            ("pair.ore-steel.friction", "0.5"),
            ("part.chute.material", "\"liner\""),
        ];
        assert_eq!(set, expected);
    }

    #[test]
    fn only_chooses_by_number_and_by_value() {
        let campaign = campaign(CROSSED);
        let (columns, all) = (columns(&campaign), variants(&campaign));
        let chosen = |words: &[&str]| {
            let words: Vec<String> = words.iter().map(|word| (*word).to_owned()).collect();
            chosen_of(&columns, &all, &words)
        };
        assert_eq!(chosen(&[]).unwrap().len(), 6);
        assert_eq!(chosen(&["3", "5-6"]).unwrap(), [2, 4, 5]);
        assert_eq!(chosen(&["tilt=40"]).unwrap(), [2, 3]);
        assert_eq!(chosen(&["tilt_deg=40", "tilt=50", "liner=liner"]).unwrap(), [3, 5]);
        for wrong in ["0", "7", "tilt=41", "slope=40", "x"] {
            assert!(chosen(&[wrong]).unwrap_err().contains("names no variant"), "{wrong}");
        }
    }

    #[test]
    fn no_factor_is_one_variant() {
        assert_eq!(variants(&campaign("")).len(), 1);
    }

    #[test]
    fn long_numbers_are_shown_short_and_set_in_full() {
        let campaign =
            campaign("[[axis]]\nname = \"t\"\nkeys = \"end.time\"\nunit = \"s\"\nfrom = 0\nto = 1\ncount = 4\n");
        let second = &variants(&campaign)[1];
        assert_eq!(
            (shown(&second.values[0]).as_str(), second.settings[0].1.as_str()),
            ("0.333333", "\"0.3333333333333333 s\"")
        );
    }
}
