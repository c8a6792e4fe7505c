//! `measure-upstream` (warning): measures are taken of the last stages, and one that lies before the plane through which
//! particles enter them sees none.

use super::{Subject, join};
use crate::math::Bounds;
use crate::scene::{MeasureKind, extent};

pub(super) fn check(subject: &Subject<'_>) {
    let stages = &subject.draft.stages;
    if !stages.whole || stages.stages.is_empty() {
        return;
    }
    let is_leaf = |stage: &usize| (0..stages.stages.len()).all(|other| !subject.layout.parents(other).contains(stage));
    let leaves: Vec<usize> = (0..stages.stages.len()).filter(is_leaf).collect();
    for measure in &subject.draft.measures {
        let (key, bounds) = match &measure.item.measure.kind {
            MeasureKind::MassFlowRate { point, .. } => {
                ("point", Bounds { minimum: (*point).into(), maximum: (*point).into() })
            }
            MeasureKind::AngleOfRepose { region, .. }
            | MeasureKind::CoordinationNumber { region }
            | MeasureKind::SolidFraction { region }
            | MeasureKind::CentreOfMass { region }
            | MeasureKind::SizeDistribution { region } => ("region", *region),
        };
        let is_before = |stage: &usize| {
            let planes = subject.layout.entering(*stage);
            let before = |corner| planes.iter().any(|(plane, _)| plane.distance(&corner) < 0.0);
            !bounds.is_empty() && extent::corners(&bounds).into_iter().all(before)
        };
        if !leaves.is_empty() && leaves.iter().all(is_before) {
            let name = &measure.item.measure.name;
            subject.warning(
                "measure-upstream",
                &join(&measure.path, key),
                format!("measure \"{name}\" lies before the gate of every last stage, and only those are measured"),
                "move it behind the gate; what passes a gate is in the results of the gate",
            );
        }
    }
}
