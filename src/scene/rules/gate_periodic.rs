//! `gate-periodic` (error): a gate across a periodic axis has its downstream on both sides, and an opening over a periodic border
//! would have to go on at the other side, and does not, unless it spans the whole period.

use super::{Subject, join};
use crate::geometry::plane::Aperture;

pub(super) fn check(subject: &Subject<'_>) {
    let domain = &subject.domain;
    for gate in &subject.draft.gates {
        let (plane, periods) = (&gate.item.plane, domain.periods());
        for (axis, name) in ["x", "y", "z"].into_iter().enumerate() {
            let Some(period) = periods[axis] else { continue };
            if plane.normal[axis].abs() > 1e-9 {
                subject.error(
                    "gate-periodic",
                    &join(&gate.path, "normal"),
                    format!("gate \"{}\" lies across {name}, which is periodic: its two sides are one", gate.item.name),
                    format!("give a normal without a {name} component, or make {name} open"),
                );
                continue;
            }
            let reach = match &plane.aperture {
                Aperture::Unbounded => continue,
                Aperture::Disc { radius } => *radius,
                Aperture::Rectangle { side_a, side_b } => 0.5 * (side_a[axis].abs() + side_b[axis].abs()),
            };
            let slack = 1e-9 * period;
            let crosses = plane.point[axis] - reach < domain.bounds.minimum[axis] - slack
                || plane.point[axis] + reach > domain.bounds.maximum[axis] + slack;
            // Only an opening that spans the period is made to reach farther.
            let mut along = [None; 3];
            along[axis] = Some(period);
            if crosses && plane.over_borders(&along) == *plane {
                subject.error(
                    "gate-periodic",
                    &join(&gate.path, "aperture"),
                    format!("the opening of gate \"{}\" crosses the periodic border along {name}", gate.item.name),
                    format!(
                        "let it end at the border, span the whole period with a side along {name}, or make {name} open"
                    ),
                );
            }
        }
    }
}
