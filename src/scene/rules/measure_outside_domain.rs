//! `measure-outside-domain` (error): a region of a measure that lies outside of the domain never holds a particle.

use super::{Subject, join};
use crate::math::Bounds;
use crate::scene::MeasureKind;

pub(super) fn check(subject: &Subject<'_>) {
    for measure in &subject.draft.measures {
        let name = &measure.item.measure.name;
        let outside = match &measure.item.measure.kind {
            MeasureKind::MassFlowRate { point, .. } => {
                let mut here = Bounds::EMPTY;
                here.include(point);
                !touch(&here, &subject.domain.bounds)
            }
            MeasureKind::AngleOfRepose { region, .. }
            | MeasureKind::CoordinationNumber { region }
            | MeasureKind::SolidFraction { region }
            | MeasureKind::CentreOfMass { region }
            | MeasureKind::SizeDistribution { region } => !region.is_empty() && !touch(region, &subject.domain.bounds),
        };
        if outside {
            let key =
                if matches!(measure.item.measure.kind, MeasureKind::MassFlowRate { .. }) { "point" } else { "region" };
            subject.error(
                "measure-outside-domain",
                &join(&measure.path, key),
                format!("measure \"{name}\" lies outside of the domain"),
                "move it, or enlarge [domain]",
            );
        }
    }
}

fn touch(a: &Bounds, b: &Bounds) -> bool {
    (0..3).all(|axis| a.minimum[axis] <= b.maximum[axis] && b.minimum[axis] <= a.maximum[axis])
}
