//! Where a gate should be cut, as far as the scene alone tells: how far the parts of its upstream stage reach past the plane,
//! and what follows for the distance L1 of the exclusion plane.

use super::{PlanFinding, Severity, warning};
use crate::geometry::part::Trigger;
use crate::scene::Scene;
use crate::scene::gate::{ExclusionMode, Gate};
use crate::scene::layout::Layout;
use crate::scene::reach;
use serde::Serialize;
use std::fmt::Write;

/// Least distance from the gate plane to the exclusion plane that is proposed, in largest diameters.
const LEAST: f64 = 1.2;

/// What the scene tells about a gate.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct GateAdvice {
    /// Name of the gate.
    pub gate: String,
    /// The stage that records it.
    pub stage: String,
    /// How recorded particles move on.
    pub mode: ExclusionMode,
    /// L1 as the scene has it [m].
    pub exclusion_length: f64,
    /// L1 as proposed for ordinary particles (`buffer`) [m].
    pub proposed_length: f64,
    /// How far the last part of the upstream stage reaches past the gate plane [m], negative where it ends before; `None`
    /// where no part that stays is near the aperture.
    pub rim: Option<f64>,
    /// That part.
    pub rim_part: Option<String>,
    /// What should be known before the run starts.
    pub findings: Vec<PlanFinding>,
}

/// The advice for each gate of a scene, in its order.
#[must_use]
pub fn advise(scene: &Scene) -> Vec<GateAdvice> {
    let layout = Layout::of(scene);
    let advice = |(index, gate): (usize, &Gate)| {
        let recorder = layout.recorders(index).next()?;
        Some(advise_one(scene, &layout, gate, recorder))
    };
    scene.gates.iter().enumerate().filter_map(advice).collect()
}

fn advise_one(scene: &Scene, layout: &Layout<'_>, gate: &Gate, recorder: usize) -> GateAdvice {
    let largest = layout.largest;
    let rim = rim(layout, gate, recorder);
    let past_rim = rim.map_or(0.0, |(rim, _)| rim + largest);
    let rim_part = rim.map(|(_, part)| layout.parts[part].name.clone());
    let mut advice = GateAdvice {
        gate: gate.name.clone(),
        stage: scene.stages[recorder].name.clone(),
        mode: gate.exclusion.mode,
        exclusion_length: gate.exclusion.length,
        proposed_length: past_rim.max(LEAST * largest),
        rim: rim.map(|(rim, _)| rim),
        rim_part,
        findings: Vec::new(),
    };
    advice.findings = findings(&advice, largest);
    advice
}

/// How far the parts of a stage that begin before the plane reach past it, within a largest diameter of the aperture; and
/// the part that reaches farthest. What disappears is no rim: the flow begins when it has gone.
fn rim(layout: &Layout<'_>, gate: &Gate, stage: usize) -> Option<(f64, usize)> {
    let here = layout.parts_of(stage);
    let reaches = |part: usize| {
        if !here[part] || !matches!(layout.parts[part].disappears, Trigger::Never) {
            return None;
        }
        let (low, high) = reach::in_column(layout.parts[part], &gate.plane, layout.largest, layout.end)?;
        (low < 0.0).then_some((high, part))
    };
    (0..layout.parts.len()).filter_map(reaches).max_by(|a, b| a.0.total_cmp(&b.0))
}

fn findings(advice: &GateAdvice, largest: f64) -> Vec<PlanFinding> {
    let Some((rim, part)) = advice.rim.zip(advice.rim_part.as_deref()) else { return Vec::new() };
    let gate = &advice.gate;
    let place = if rim > 0.0 {
        format!("part '{part}' reaches {:.3} mm past the plane of gate '{gate}'", 1e3 * rim)
    } else {
        format!("the plane of gate '{gate}' lies {:.3} mm behind the end of part '{part}'", -1e3 * rim)
    };
    match advice.mode {
        ExclusionMode::Buffer if rim + largest > advice.exclusion_length * (1.0 + 1e-9) => vec![warning(
            "short-exclusion",
            format!(
                "{place}, and recorded particles are taken out at {:.3} mm: before the flow is free again, which is past \
                 the rim; taken out above the rim of a conical hopper they raised its discharge by 12 to 45 %; make \
                 exclusion.length {:.3} mm or more",
                1e3 * advice.exclusion_length,
                1e3 * advice.proposed_length
            ),
        )],
        ExclusionMode::Constant | ExclusionMode::Ballistic if rim > -LEAST * largest => vec![warning(
            "slow-floor",
            format!(
                "{place}, and recorded particles become ghosts: in a flow that is not free yet they are a slow floor \
                 (discharge of a conical hopper: -28 % two millimetres under the outlet, -80 % inside it); write \
                 exclusion.mode = \"buffer\", or move the gate {:.3} mm or more behind the part",
                1e3 * LEAST * largest
            ),
        )],
        _ => Vec::new(),
    }
}

/// The advice as text for a terminal.
#[must_use]
pub fn to_text(advice: &[GateAdvice]) -> String {
    let mut text = String::new();
    for one in advice {
        let _ = writeln!(text, "gate {}, recorded by stage {}", one.gate, one.stage);
        let mode = match one.mode {
            ExclusionMode::Constant => "ghosts at constant velocity",
            ExclusionMode::Ballistic => "ghosts in free fall",
            ExclusionMode::Buffer => "ordinary particles",
        };
        let rim = match (one.rim, &one.rim_part) {
            (Some(rim), Some(part)) if rim > 0.0 => format!("part {part} reaches {:.4} mm past the plane", 1e3 * rim),
            (Some(rim), Some(part)) => format!("part {part} ends {:.4} mm before the plane", -1e3 * rim),
            _ => "no part of the stage ends near the aperture".to_owned(),
        };
        super::text::section(
            &mut text,
            "exclusion",
            &[
                ["L1".to_owned(), format!("{:.4} mm", 1e3 * one.exclusion_length), mode.to_owned()],
                ["proposed".to_owned(), format!("{:.4} mm", 1e3 * one.proposed_length), rim],
            ],
        );
        for finding in &one.findings {
            let severity = match finding.severity {
                Severity::Warning => "warning",
                Severity::Refusal => "refused (unless forced)",
            };
            let _ = write!(text, "\n{severity}: {} [{}]\n", finding.text, finding.name);
        }
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    const GATES: &str = include_str!("../../tests/scenes/good/gates.toml");

    /// The advice for the gate under a cone that ends at 600 mm; the largest diameter is 5 mm.
    fn advice(height_mm: f64, mode: &str, length_mm: f64) -> GateAdvice {
        let settings = [
            ("gate.outlet.point_mm", format!("[0, 0, {height_mm}]")),
            ("gate.outlet.exclusion.mode", mode.to_owned()),
            ("gate.outlet.exclusion.length_mm", length_mm.to_string()),
        ];
        let settings = settings.map(|(key, value)| (key.to_owned(), value));
        let base = std::path::Path::new("tests/scenes/good");
        let (scene, _) = crate::scene::read_text(GATES, "gates.toml", base, &settings).expect("a valid scene");
        advise(&scene).swap_remove(0)
    }

    fn names(advice: &GateAdvice) -> Vec<&'static str> {
        advice.findings.iter().map(|finding| finding.name).collect()
    }

    #[test]
    fn the_exclusion_plane_is_proposed_a_diameter_past_the_rim() {
        let inside = advice(603.0, "buffer", 6.0);
        assert_eq!(inside.rim_part.as_deref(), Some("hopper"));
        // Heights in millimetres are rounded when they become metres.
        assert!((inside.rim.expect("a rim") - 0.003).abs() < 1e-12);
        assert!((inside.proposed_length - (0.003 + 0.005)).abs() < 1e-12);
        assert_eq!(names(&inside), ["short-exclusion"]);
        assert_eq!(names(&advice(603.0, "buffer", 8.01)), [""; 0]);
        let under = advice(594.0, "buffer", 6.0);
        assert!((under.rim.expect("a rim") + 0.006).abs() < 1e-12);
        assert!((under.proposed_length - 1.2 * 0.005).abs() < 1e-15);
        assert_eq!(names(&under), [""; 0]);
    }

    #[test]
    fn ghosts_near_the_rim_are_a_slow_floor() {
        assert_eq!(names(&advice(603.0, "constant", 20.0)), ["slow-floor"]);
        assert_eq!(names(&advice(598.0, "ballistic", 6.0)), ["slow-floor"]);
        assert_eq!(names(&advice(598.0, "buffer", 6.0)), [""; 0]);
        assert_eq!(names(&advice(593.0, "constant", 6.0)), [""; 0]);
        let text = to_text(&[advice(598.0, "ballistic", 6.0)]);
        assert!(text.contains("gate outlet, recorded by stage hopper\n") && text.contains("[slow-floor]"), "{text}");
    }
}
