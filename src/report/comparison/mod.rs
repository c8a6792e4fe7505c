//! A comparison of two sets of runs, to read and to look at.

mod picture;
mod table;

pub use picture::picture;
pub use table::table;

use crate::analysis::compare::{Comparison, CurveComparison, Margin, MeasureComparison, Verdict};

/// One judged line of a comparison: a number or a curve.
#[derive(Debug, Clone, Copy)]
enum Row<'a> {
    Number(&'a MeasureComparison),
    Curve(&'a CurveComparison),
}

fn rows(comparison: &Comparison) -> Vec<Row<'_>> {
    comparison.measures.iter().map(Row::Number).chain(comparison.curves.iter().map(Row::Curve)).collect()
}

impl<'a> Row<'a> {
    fn name(self) -> &'a str {
        match self {
            Self::Number(measure) => &measure.name,
            Self::Curve(curve) => &curve.name,
        }
    }

    /// Unit of the difference.
    fn unit(self) -> &'a str {
        match self {
            Self::Number(measure) => &measure.unit,
            Self::Curve(curve) => match curve.distance {
                crate::analysis::compare::Distance::LargestDifference => &curve.y.unit,
                crate::analysis::compare::Distance::KolmogorovSmirnov => "",
            },
        }
    }

    fn difference(self) -> Option<f64> {
        match self {
            Self::Number(measure) => measure.difference,
            Self::Curve(curve) => curve.difference,
        }
    }

    fn interval(self) -> Option<[f64; 2]> {
        match self {
            Self::Number(measure) => measure.interval_95,
            Self::Curve(curve) => curve.interval_95,
        }
    }

    fn margin(self) -> Option<f64> {
        match self {
            Self::Number(measure) => measure.margin,
            Self::Curve(curve) => curve.margin,
        }
    }

    fn margin_asked(self) -> Margin {
        match self {
            Self::Number(measure) => measure.margin_asked,
            Self::Curve(curve) => curve.margin_asked,
        }
    }

    fn verdict(self) -> Verdict {
        match self {
            Self::Number(measure) => measure.verdict,
            Self::Curve(curve) => curve.verdict,
        }
    }

    fn runs_needed(self) -> Option<u64> {
        match self {
            Self::Number(measure) => measure.runs_needed,
            Self::Curve(curve) => curve.runs_needed,
        }
    }

    fn note(self) -> &'a str {
        match self {
            Self::Number(measure) => &measure.note,
            Self::Curve(curve) => &curve.note,
        }
    }

    /// What decides how many digits of a difference mean something: its interval, and no less than a hundredth of its margin.
    fn scale(self) -> f64 {
        let half = self.interval().map_or(0.0, |[low, high]| 0.5 * (high - low));
        let scale = half.max(0.01 * self.margin().unwrap_or(0.0));
        if scale > 0.0 { scale } else { self.difference().unwrap_or(0.0).abs() }
    }

    /// The verdict with the number of runs that would decide it.
    fn words(self) -> String {
        match self.runs_needed() {
            Some(needed) => format!("{}: about {needed} runs a side would decide", self.verdict().word()),
            None => self.verdict().word().to_owned(),
        }
    }
}

/// `value` with as many decimals as show two digits of `scale`, as "1.234" or "1.2e-7".
fn rounded(value: f64, scale: f64) -> String {
    if value == 0.0 && scale == 0.0 {
        return "0".to_owned();
    }
    let scale = if scale > 0.0 && scale.is_finite() { scale } else { value.abs() * 0.01 };
    let places = 1.0 - scale.log10().floor();
    if value.abs().max(scale) >= 1e7 || places > 9.0 {
        return format!("{value:.3e}");
    }
    let text = format!("{value:.*}", places.max(0.0) as usize);
    // No "-0.00".
    if text.trim_start_matches(['-', '0', '.']).is_empty() { text.trim_start_matches('-').to_owned() } else { text }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::analysis::compare::{GateRecord, RunRecord, compare};

    /// Three runs a side: the runs are 8 % slower; one figure is missing in the reference.
    pub(super) fn example() -> Comparison {
        let run = |number: usize, slower: f64| {
            let wobble = 1.0 + 0.01 * (number as f64 - 1.0);
            let count = 600_u32;
            let mut gate = GateRecord { gate: "outlet".into(), ..GateRecord::default() };
            for k in 0..count {
                gate.times.push(0.3 + f64::from(k) * 0.002 * slower * wobble);
                gate.masses.push(4e-3);
                gate.normal_speeds.push(1.0 + 0.2 * (f64::from(k) * 0.7).sin() * wobble);
                gate.diameters.push(0.010 + 0.002 * f64::from(k) / f64::from(count));
            }
            let mut measures = std::collections::BTreeMap::new();
            measures.insert("chute.heap_angle_deg".to_owned(), Some(31.0 + 0.3 * wobble * number as f64));
            if slower > 1.0 {
                measures.insert("chute.contacts".to_owned(), Some(4.0 * wobble));
            }
            RunRecord { name: format!("runs/{number}"), measures, gates: vec![gate], heaps: Vec::new() }
        };
        let side = |slower: f64| (0..3).map(|number| run(number, slower)).collect::<Vec<_>>();
        compare(&side(1.08), &side(1.0), &[]).unwrap()
    }

    #[test]
    fn numbers_are_rounded_by_their_scatter() {
        assert_eq!(rounded(31.23456, 0.31), "31.23");
        assert_eq!(rounded(-0.0004, 0.31), "0.00");
        assert_eq!(rounded(2835.0, 12.0), "2835");
        assert_eq!(rounded(1.5e-12, 1e-13), "1.500e-12");
        assert_eq!(rounded(0.0, 0.0), "0");
    }

    #[test]
    fn the_table_names_every_line_with_its_verdict() {
        let example = example();
        let text = table(&example);
        for row in rows(&example) {
            let line = text.lines().find(|line| line.trim_start().starts_with(row.name())).unwrap();
            assert!(line.contains(row.verdict().word()), "{line}");
        }
        assert!(text.contains("the reference has no value"), "{text}");
        assert!(text.lines().last().unwrap().starts_with("differs: "), "{text}");
    }

    #[test]
    fn the_picture_shows_every_line_and_curve() {
        let example = example();
        let svg = picture(&example);
        assert!(svg.starts_with("<svg") && svg.ends_with("</svg>\n") && !svg.contains("NaN") && !svg.contains("inf"));
        for row in rows(&example) {
            assert!(svg.contains(&format!(">{}<", row.name())), "{}", row.name());
        }
        assert_eq!(svg.matches("<clipPath").count(), example.curves.len());
    }
}
