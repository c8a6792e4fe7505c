//! A plan as text for a terminal: aligned columns, numbers with units.

use super::{Plan, Severity};
use std::fmt::Write;

impl Plan {
    /// The plan as text for a terminal.
    #[must_use]
    pub fn to_text(&self) -> String {
        let stage = self.stage.as_ref().map_or_else(String::new, |stage| format!(", stage {stage}"));
        let mut text = format!("plan of {}{stage}\n", self.scene);
        section(&mut text, "models", &self.model_rows());
        section(&mut text, "time step", &self.timestep_rows());
        section(&mut text, "expected", &self.expectation_rows());
        section(&mut text, "cost", &self.cost_rows());
        section(&mut text, "backends", &self.backend_rows());
        for finding in &self.findings {
            let severity = match finding.severity {
                Severity::Warning => "warning",
                Severity::Refusal => "refused (unless forced)",
            };
            let _ = write!(text, "\n{severity}: {} [{}]\n", finding.text, finding.name);
        }
        text
    }

    fn model_rows(&self) -> Vec<[String; 3]> {
        let row = |model: &super::ModelDecision| {
            let risk = model.risk.map_or(String::new(), |risk| format!("; risk: {risk}"));
            [model.name.to_owned(), on_off(model.on).to_owned(), format!("{}{risk}", model.reason)]
        };
        self.models.iter().map(row).collect()
    }

    fn timestep_rows(&self) -> Vec<[String; 3]> {
        let choice = &self.timestep;
        let mut rows: Vec<_> = choice
            .limits
            .iter()
            .map(|limit| {
                let binds = if choice.binding == Some(limit.name) { "binds: " } else { "" };
                [limit.name.to_owned(), seconds(limit.value), format!("{binds}{}", limit.note)]
            })
            .collect();
        let how = match (choice.given, choice.of_whole) {
            (true, _) => "given in the scene",
            (false, true) => "the step of all stages",
            (false, false) => "rounded down to two digits",
        };
        let of = choice.binding.map_or_else(String::new, |name| format!("{:.3} of {name}, ", choice.fraction));
        rows.push(["chosen".to_owned(), seconds(choice.chosen), format!("{of}{how}")]);
        rows
    }

    fn expectation_rows(&self) -> Vec<[String; 3]> {
        let mut rows = vec![
            ["impact_speed".to_owned(), format!("{:.4} m/s", self.impact.speed), self.impact.reason.clone()],
            ["skin".to_owned(), format!("{:.4} mm", 1e3 * self.skin.skin), self.skin.reason.clone()],
        ];
        if let Some(overlap) = &self.overlap {
            let need = if overlap.stiffening > 1.0 {
                format!(", would need {:.3} times the stiffness", overlap.stiffening)
            } else {
                String::new()
            };
            rows.push([
                "overlap".to_owned(),
                format!("{:.3} %", 100.0 * overlap.share),
                format!("of the radius, limit {:.3} %: {}{need}", 100.0 * overlap.limit, overlap.contact),
            ]);
        }
        rows
    }

    fn cost_rows(&self) -> Vec<[String; 3]> {
        let cost = &self.cost;
        let measured = |value: Option<f64>, text: fn(f64) -> String| value.map_or_else(|| "unknown".to_owned(), text);
        let feeds: Vec<String> =
            cost.feeds.iter().map(|feed| format!("{} of {}", feed.particles.round(), feed.name)).collect();
        vec![
            ["particles".to_owned(), format!("{}", cost.particles.round()), feeds.join(", ")],
            ["steps".to_owned(), format!("{}", cost.steps), String::new()],
            ["particle_steps".to_owned(), format!("{:.3e}", cost.particle_steps), String::new()],
            [
                "memory".to_owned(),
                measured(cost.memory_bytes, |bytes| format!("{:.1} MB", 1e-6 * bytes)),
                String::new(),
            ],
            ["wall_time".to_owned(), measured(cost.wall_s, duration), cost.basis.clone()],
        ]
    }

    fn backend_rows(&self) -> Vec<[String; 3]> {
        let rows = |verdict: &super::BackendVerdict| {
            let word = if verdict.can() { "can" } else { "cannot" };
            let mut reasons = verdict.reasons.iter().cloned();
            let mut rows = vec![[verdict.backend.clone(), word.to_owned(), reasons.next().unwrap_or_default()]];
            rows.extend(reasons.map(|reason| [String::new(), String::new(), reason]));
            rows
        };
        self.backends.iter().flat_map(rows).collect()
    }
}

pub(super) fn section(text: &mut String, title: &str, rows: &[[String; 3]]) {
    let width = |column: usize| rows.iter().map(|row| row[column].chars().count()).max().unwrap_or(0);
    let (first, second) = (width(0), width(1));
    let _ = write!(text, "\n{title}\n");
    for [name, value, note] in rows {
        let line = format!("  {name:<first$}  {value:>second$}  {note}");
        let _ = writeln!(text, "{}", line.trim_end());
    }
}

const fn on_off(on: bool) -> &'static str {
    if on { "on" } else { "off" }
}

fn seconds(time: f64) -> String {
    if time.is_finite() { format!("{time:.3e} s") } else { "none".to_owned() }
}

fn duration(time: f64) -> String {
    match time {
        short if short < 120.0 => format!("{short:.1} s"),
        medium if medium < 7200.0 => format!("{:.1} min", medium / 60.0),
        long => format!("{:.1} h", long / 3600.0),
    }
}
