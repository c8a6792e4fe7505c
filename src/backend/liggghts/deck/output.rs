//! The section of output: series and frames.

use super::names::{file_name, lines, vector};
use super::parts::Wall;
use super::template::Templates;
use crate::backend::liggghts::{COLUMNS, Schedule, deck_number};
use crate::scene::{MeasureKind, Scene};

/// Columns of the series before those of measures and parts.
pub const SERIES: [&str; 7] =
    ["step", "time_s", "atoms", "kinetic_energy_J", "rotational_energy_J", "rms_speed_m_per_s", "max_speed_m_per_s"];

/// Renders the section.
///
/// # Errors
/// Of templates.
pub fn output(scene: &Scene, walls: &[Wall<'_>], schedule: &Schedule, templates: &Templates) -> Result<String, String> {
    let mut title: Vec<String> = SERIES.map(str::to_owned).to_vec();
    let columns = ["step", "time", "atoms", "ke", "ke_rotation", "rms_speed", "max_speed"];
    let mut row: Vec<String> = columns.map(|name| format!("${{{name}}}")).to_vec();
    let (mut computes, mut variables) = (Vec::new(), Vec::new());
    let planes = scene.measures.iter().filter_map(|measure| match &measure.kind {
        MeasureKind::MassFlowRate { point, normal } => Some((measure, point, normal)),
        _ => None,
    });
    for ((measure, point, normal), number) in planes.zip(1..) {
        let terms = (0..3)
            .filter(|k| normal[*k] != 0.0)
            .map(|k| format!("({}-({}))*({})", ["x", "y", "z"][k], deck_number(point[k]), deck_number(normal[k])));
        let distance = terms.collect::<Vec<_>>().join("+");
        computes.push(format!("# mass [kg] beyond the plane through ({}) m", vector(point)));
        computes.push(format!("variable beyond_{number} atom mass*({distance}>=0)"));
        computes.push(format!("compute beyond_{number} all reduce sum v_beyond_{number}"));
        variables.push(format!("variable mass_beyond_{number} equal c_beyond_{number}"));
        title.push(format!("{}.mass_beyond_kg", file_name(&measure.name)));
        row.push(format!("${{mass_beyond_{number}}}"));
    }
    for wall in walls.iter().filter(|wall| wall.mesh().is_some()) {
        for (axis, number) in ["x", "y", "z"].into_iter().zip(1..) {
            let name = format!("force_{axis}_{}", wall.id);
            variables.push(format!("variable {name} equal f_part_{}[{number}]", wall.id));
            row.push(format!("${{{name}}}"));
            title.push(format!("{}.force_{axis}_N", file_name(&wall.part.name)));
        }
    }
    let steps = |interval: f64| ((interval / schedule.timestep).round() as u64).max(1);
    let frames = scene.output.frame_interval.map_or_else(String::new, |interval| {
        let every = steps(interval).next_multiple_of(schedule.cadence.hand_over);
        format!("dump frames all custom {every} frames/*.bin {COLUMNS}\n")
    });
    templates.fill(
        "output.in",
        &[
            ("computes", &lines(computes)),
            ("variables", &lines(variables)),
            ("title", &title.join(" ")),
            ("row", &row.join(" ")),
            ("every", &steps(scene.output.series_interval).to_string()),
            ("batch", &schedule.cadence.hand_over.to_string()),
            ("frames", &frames),
        ],
    )
}
