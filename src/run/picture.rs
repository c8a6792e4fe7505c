//! The picture of a run's last state.

use crate::analysis::MeasureResult;
use crate::analysis::angle_of_repose::angle_of_repose;
use crate::analysis::surface_profile::SurfacePoint;
use crate::backend::native::StageResult;
use crate::math::{Bounds, Vec3};
use crate::report::outline::{Outline, outline};
use crate::report::picture::{Annotations, ColourBy, SlopeLine, View, side_view};
use crate::scene::{MeasureKind, Scene};
use crate::storage::StorageError;
use crate::storage::staging::write_whole;
use std::path::Path;

/// Writes `picture.svg`: particles by diameter, the parts that are there, and the slopes of every measured heap.
pub fn draw(
    scene: &Scene,
    result: &StageResult,
    measures: &[MeasureResult],
    folder: &Path,
) -> Result<(), StorageError> {
    let along = scene.measures.iter().find_map(|measure| match measure.kind {
        MeasureKind::AngleOfRepose { along, .. } => Some(along),
        _ => None,
    });
    let view = if along == Some(1) { View::side() } else { View::front() };
    let mut bounds = Bounds::EMPTY;
    result.particles.iter().for_each(|particle| bounds.include(&particle.position));
    if result.particles.is_empty() {
        bounds = scene.domain.bounds;
    }
    let parts: Vec<Outline> = scene
        .parts
        .iter()
        .zip(&result.present)
        .filter(|(_, present)| **present)
        .map(|(part, _)| outline(&part.surface, &part.motion.pose(result.time), &view.sight(), &bounds))
        .collect();
    let annotations = Annotations {
        title: scene.name.clone(),
        slopes: slopes(scene, result),
        caption: caption(scene, result, measures),
    };
    let svg = side_view(&result.particles, &parts, &view, ColourBy::Diameter, &annotations);
    write_whole(&folder.join("picture.svg"), svg.as_bytes())
}

fn slopes(scene: &Scene, result: &StageResult) -> Vec<SlopeLine> {
    let mut lines = Vec::new();
    for measure in &scene.measures {
        let MeasureKind::AngleOfRepose { region, along } = &measure.kind else { continue };
        let Ok(heap) = angle_of_repose(&result.particles, scene.body, region, *along) else { continue };
        for flank in &heap.flanks {
            let place = |surface: SurfacePoint| {
                let mut point = Vec3::zeros();
                point[*along] = surface.position;
                point.z = surface.height;
                point
            };
            lines.push(SlopeLine {
                ends: [place(flank.upper), place(flank.lower)],
                label: format!("{:.1} \u{b1} {:.1}\u{b0}", flank.angle.to_degrees(), flank.uncertainty().to_degrees()),
            });
        }
    }
    lines
}

/// What the picture shows, with the measures that belong to a heap and its stream.
fn caption(scene: &Scene, result: &StageResult, measures: &[MeasureResult]) -> String {
    let mut parts = vec![format!("{}: {} particles at {:.3} s", scene.name, result.particles.len(), result.time)];
    for measure in measures {
        let told = scene.measures.iter().any(|asked| {
            asked.name == measure.name
                && matches!(asked.kind, MeasureKind::AngleOfRepose { .. } | MeasureKind::MassFlowRate { .. })
        });
        let (Some(value), Some(uncertainty), true) = (measure.value, measure.uncertainty, told) else { continue };
        // Two digits of the uncertainty, and the value to the same place.
        let places = (1.0 - uncertainty.abs().log10().floor()).clamp(0.0, 9.0) as usize;
        let name = measure.name.replace('_', " ");
        parts.push(format!("{name} {value:.places$} \u{b1} {uncertainty:.places$} {}", measure.unit));
    }
    parts.join("; ")
}
