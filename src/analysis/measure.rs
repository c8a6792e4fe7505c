//! Evaluates what a scene asks to be measured.

use super::angle_of_repose::angle_of_repose;
use super::centre_of_mass::centre_of_mass;
use super::coordination_number::coordination_number;
use super::mass_flow_rate::mass_flow_rate;
use super::size_distribution::SizeDistribution;
use super::solid_fraction::solid_fraction;
use crate::math::Bounds;
use crate::particle::{Body, GradingBy, ParticleId, ParticleState};
use crate::scene::{Measure, MeasureKind};
use serde::Serialize;

/// What was observed of a run.
#[derive(Debug, Clone, Copy)]
pub struct Observed<'a> {
    /// Particle body, for masses.
    pub body: Body,
    /// Final state.
    pub particles: &'a [ParticleState],
    /// Pairs of particles in contact, final state, each pair once.
    pub contacts: &'a [(ParticleId, ParticleId)],
    /// Particles in contact with a part, final state, one entry a contact.
    pub wall_contacts: &'a [ParticleId],
    /// Mass beyond the plane of every mass flow rate.
    pub mass_series: &'a [MassSeries],
}

/// Mass beyond a plane against time.
#[derive(Debug, Clone, PartialEq)]
pub struct MassSeries {
    /// Name of the measure whose plane it is.
    pub measure: String,
    /// Time [s], mass beyond the plane [kg].
    pub samples: Vec<(f64, f64)>,
}

/// One figure of a measure.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct MeasureResult {
    /// Name of the measure, with `.part` where it has several figures.
    pub name: String,
    /// Value in `unit`; `None` where there is nothing to measure, and `note` says why.
    pub value: Option<f64>,
    /// Unit.
    pub unit: &'static str,
    /// Standard uncertainty in `unit`; `None` where the value is exact for the state.
    pub uncertainty: Option<f64>,
    /// What the figure covers, or what is doubtful about it.
    pub note: String,
}

/// Evaluates `measures` in their order. A measure that finds nothing to measure yields its figures without values.
#[must_use]
pub fn evaluate(measures: &[Measure], observed: &Observed) -> Vec<MeasureResult> {
    measures.iter().flat_map(|measure| evaluate_one(measure, observed)).collect()
}

fn evaluate_one(measure: &Measure, observed: &Observed) -> Vec<MeasureResult> {
    let name = &measure.name;
    match &measure.kind {
        MeasureKind::AngleOfRepose { region, along } => vec![heap_angle(name, observed, region, *along)],
        MeasureKind::MassFlowRate { .. } => vec![flow_rate(name, observed)],
        MeasureKind::CoordinationNumber { region } => coordination(name, observed, region),
        MeasureKind::SolidFraction { region } => vec![solidity(name, observed, region)],
        MeasureKind::CentreOfMass { region } => centre(name, observed, region),
        MeasureKind::SizeDistribution { region } => sizes(name, observed, region),
    }
}

fn heap_angle(name: &str, observed: &Observed, region: &Bounds, along: usize) -> MeasureResult {
    match angle_of_repose(observed.particles, observed.body, region, along) {
        Err(reason) => nothing(name, "deg", &reason.0),
        Ok(heap) => {
            let flanks: Vec<String> = heap
                .flanks
                .iter()
                .map(|f| {
                    let [angle, roughness, extent] = [f.angle, f.roughness, f.extent].map(f64::to_degrees);
                    format!("{angle:.2} deg over {} bins (roughness {roughness:.2}, extent {extent:.2})", f.bins)
                })
                .collect();
            let note = format!("slope of {}, bins of {:.2} mm", flanks.join(" and "), heap.bin_width * 1e3);
            figure(name, heap.angle.to_degrees(), "deg", Some(heap.uncertainty.to_degrees()), note)
        }
    }
}

fn flow_rate(name: &str, observed: &Observed) -> MeasureResult {
    let series = observed.mass_series.iter().find(|series| series.measure == name);
    let found = series.map_or(&[][..], |series| &series.samples);
    match mass_flow_rate(found) {
        Err(reason) => nothing(name, "kg/s", &reason.0),
        Ok(flow) => {
            let [from, to] = flow.window;
            let mut note = format!("steady part {from:.4} s to {to:.4} s");
            if flow.drift.abs() > 3.0 * flow.drift_uncertainty {
                note += &format!("; not steady: changes by {:.1} % between its halves", 100.0 * flow.drift);
            }
            figure(name, flow.rate, "kg/s", Some(flow.uncertainty), note)
        }
    }
}

fn coordination(name: &str, observed: &Observed, region: &Bounds) -> Vec<MeasureResult> {
    let mechanical_name = format!("{name}.mechanical");
    let found = coordination_number(observed.particles, observed.contacts, observed.wall_contacts, region);
    let Some(found) = found else {
        return [name, &mechanical_name].map(|name| nothing(name, "-", NO_PARTICLE)).into();
    };
    let note = format!("contacts with particles, {} particles", found.particles);
    let rattlers = format!("without {:.1} % rattlers", 100.0 * found.rattlers);
    let mechanical = match found.mechanical {
        Some(value) => figure(&mechanical_name, value, "-", found.mechanical_uncertainty, rattlers),
        None => nothing(&mechanical_name, "-", "every particle is a rattler"),
    };
    vec![figure(name, found.mean, "-", Some(found.uncertainty).filter(|u| u.is_finite()), note), mechanical]
}

fn solidity(name: &str, observed: &Observed, region: &Bounds) -> MeasureResult {
    match solid_fraction(observed.particles, observed.contacts, observed.body, region) {
        Some(found) => {
            let note = "uncertainty: overlaps, counted for both partners".into();
            figure(name, found.value, "-", Some(found.overlap), note)
        }
        None => nothing(name, "-", "the region has no volume"),
    }
}

fn centre(name: &str, observed: &Observed, region: &Bounds) -> Vec<MeasureResult> {
    let found = centre_of_mass(observed.particles, observed.body, region);
    ["x", "y", "z"]
        .into_iter()
        .enumerate()
        .map(|(axis, letter)| {
            let name = format!("{name}.{letter}");
            match found {
                Some(centre) => figure(&name, centre[axis], "m", None, "exact for this state".into()),
                None => nothing(&name, "m", NO_PARTICLE),
            }
        })
        .collect()
}

fn sizes(name: &str, observed: &Observed, region: &Bounds) -> Vec<MeasureResult> {
    let mut results = Vec::new();
    for (by, words) in [(GradingBy::Mass, "mass"), (GradingBy::Number, "number")] {
        let found = SizeDistribution::of(observed.particles, observed.body, by, region);
        for percent in [10, 50, 90] {
            let name = format!("{name}.d{percent}_by_{words}");
            results.push(match &found {
                Some(sizes) => {
                    let at = sizes.percentile(f64::from(percent) / 100.0);
                    let note = "uncertainty: as a sample of what was fed".into();
                    figure(&name, at.diameter, "m", Some(at.uncertainty), note)
                }
                None => nothing(&name, "m", NO_PARTICLE),
            });
        }
    }
    results
}

const NO_PARTICLE: &str = "no particle in the region";

fn figure(name: &str, value: f64, unit: &'static str, uncertainty: Option<f64>, note: String) -> MeasureResult {
    MeasureResult { name: name.into(), value: Some(value), unit, uncertainty, note }
}

fn nothing(name: &str, unit: &'static str, reason: &str) -> MeasureResult {
    MeasureResult { name: name.into(), value: None, unit, uncertainty: None, note: reason.into() }
}

#[cfg(test)]
pub(crate) mod tests {
    use super::*;
    use crate::math::{Vec3, vec3};
    use approx::assert_relative_eq;

    /// A particle of density 1 kg/m3 at rest.
    pub(crate) fn particle(id: u64, position: [f64; 3], radius: f64) -> ParticleState {
        ParticleState {
            id: ParticleId(id),
            material: 0,
            radius,
            density: 1.0,
            position: position.into(),
            velocity: Vec3::zeros(),
            spin: Vec3::zeros(),
        }
    }

    fn all_kinds(region: Bounds) -> Vec<Measure> {
        [
            ("angle", MeasureKind::AngleOfRepose { region, along: 0 }),
            ("flow", MeasureKind::MassFlowRate { point: Vec3::zeros(), normal: vec3(0.0, 0.0, -1.0) }),
            ("contacts", MeasureKind::CoordinationNumber { region }),
            ("solid", MeasureKind::SolidFraction { region }),
            ("centre", MeasureKind::CentreOfMass { region }),
            ("sizes", MeasureKind::SizeDistribution { region }),
        ]
        .map(|(name, kind)| Measure { name: name.into(), kind })
        .into()
    }

    #[test]
    fn every_kind_gives_its_figures_in_order() {
        // A staircase of 40 unit spheres with slope 1 : 2, touching nothing, and a flow of 3 kg/s.
        let particles: Vec<_> = (0..40).map(|k| particle(k, [2.5 * k as f64, 0.0, -1.25 * k as f64], 1.0)).collect();
        let contacts = [(particles[0].id, particles[1].id), (particles[1].id, particles[2].id)];
        let samples = (0..=50).map(|k| (f64::from(k), 3.0 * f64::from(k))).collect();
        let observed = Observed {
            body: Body::Sphere,
            particles: &particles,
            contacts: &contacts,
            wall_contacts: &[],
            mass_series: &[MassSeries { measure: "flow".into(), samples }],
        };
        let region = Bounds { minimum: [-1e3; 3], maximum: [1e3; 3] };
        let results = evaluate(&all_kinds(region), &observed);
        let value = |name: &str| results.iter().find(|r| r.name == name).unwrap().value.unwrap();
        assert_relative_eq!(value("angle"), 0.5_f64.atan().to_degrees(), epsilon = 1e-6);
        assert_relative_eq!(value("flow"), 3.0, epsilon = 1e-9);
        assert_relative_eq!(value("contacts"), 4.0 / 40.0, epsilon = 1e-12);
        assert_relative_eq!(value("contacts.mechanical"), 2.0, epsilon = 1e-12);
        let spheres = 40.0 * 4.0 / 3.0 * std::f64::consts::PI;
        assert_relative_eq!(value("solid"), spheres / 8e9, max_relative = 1e-12);
        assert_relative_eq!(value("centre.x"), 2.5 * 19.5, epsilon = 1e-9);
        assert_relative_eq!(value("sizes.d50_by_number"), 2.0, epsilon = 1e-12);
        let names: Vec<&str> = results.iter().map(|r| r.name.as_str()).collect();
        assert_eq!(names[..6], ["angle", "flow", "contacts", "contacts.mechanical", "solid", "centre.x"]);
        assert_eq!(results.len(), 14);
    }

    #[test]
    fn nothing_to_measure_is_said_not_guessed() {
        let observed =
            Observed { body: Body::Sphere, particles: &[], contacts: &[], wall_contacts: &[], mass_series: &[] };
        let region = Bounds { minimum: [0.0; 3], maximum: [1.0; 3] };
        for result in evaluate(&all_kinds(region), &observed) {
            let expected = if result.name == "solid" { Some(0.0) } else { None };
            assert_eq!(result.value, expected, "{result:?}");
            assert!(!result.note.is_empty());
        }
    }
}
