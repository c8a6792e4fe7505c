//! Head-on impacts: Chung and Ooi (2011), tests 1 to 3, and the restitution that the no-attraction cut-off leaves.

use super::experiment::{HERTZ, LINEAR, one_material, restitution};
use super::impact_measure::{MeasuredImpact, measure_impact, worst};
use super::reference::{self, HertzContact, hertz_impact, sphere_mass};
use super::{Case, CaseSetup, Check, Experiment, NotRun, Sample, Tolerance, published};
use crate::dem::law::LawSettings;
use crate::math::{Vec3, vec3};

pub(super) const CASES: &[Case] = &[
    Case {
        name: "chung-ooi-1",
        title: "two elastic spheres head-on, 50 steps per contact",
        source: "Chung and Ooi 2011, test 1",
        run: two_spheres,
    },
    Case {
        name: "chung-ooi-2",
        title: "elastic sphere on a rigid plane, 50 steps per contact",
        source: "Chung and Ooi 2011, test 2",
        run: sphere_on_plane,
    },
    Case {
        name: "chung-ooi-3",
        title: "restitution 0.2 to 1 on a rigid plane, 500 steps per contact, and its convergence",
        source: "Chung and Ooi 2011, test 3",
        run: restitutions,
    },
    Case {
        name: "restitution-cut-off",
        title: "realised restitution where the normal force may not attract",
        source: "Schwager and Poeschel 2007",
        run: cut_off,
    },
];

/// Phases between the first contact and the time grid at which every impact is repeated.
const PHASES: u32 = 8;
const ELASTIC_REASON: &str = "velocity-Verlet at 50 steps: (omega dt)^2 / 24 = 2e-4, worst of 8 phases";

/// A sphere and what it hits: rigid plane, or its own mirror image.
#[derive(Clone, Copy)]
struct HeadOn {
    radius: f64,
    density: f64,
    youngs_modulus: f64,
    poissons_ratio: f64,
    /// Speed of the one sphere [m/s].
    speed: f64,
    against_plane: bool,
}

impl HeadOn {
    fn contact(&self) -> HertzContact {
        let plane_strain = self.youngs_modulus / (1.0 - self.poissons_ratio.powi(2));
        let (mass, half) = (sphere_mass(self.radius, self.density), if self.against_plane { 1.0 } else { 0.5 });
        HertzContact { modulus: plane_strain * half, radius: self.radius * half, mass: mass * half }
    }

    /// Relative speed of approach [m/s].
    fn approach(&self) -> f64 {
        if self.against_plane { self.speed } else { 2.0 * self.speed }
    }

    /// Runs the impact at `timestep`; the first contact falls `phase` of a step after a point of the time grid.
    fn run(
        &self,
        experiment: &mut dyn Experiment,
        law: LawSettings,
        e: f64,
        [timestep, contact_time, phase]: [f64; 3],
    ) -> Result<MeasuredImpact, NotRun> {
        let table = one_material(self.density, self.youngs_modulus, self.poissons_ratio, restitution(e), 0.35);
        let mut setup = CaseSetup::new(table, law, 10.0 * self.radius);
        let gap = self.approach() * timestep * (3.0 + phase);
        if self.against_plane {
            setup.add_floor(1);
            let centre = vec3(0.0, 0.0, self.radius + gap);
            setup.add_sphere(self.radius, centre, vec3(0.0, 0.0, -self.speed), Vec3::zeros());
        } else {
            let centre = self.radius + 0.5 * gap;
            setup.add_sphere(self.radius, vec3(-centre, 0.0, 0.0), vec3(self.speed, 0.0, 0.0), Vec3::zeros());
            setup.add_sphere(self.radius, vec3(centre, 0.0, 0.0), vec3(-self.speed, 0.0, 0.0), Vec3::zeros());
        }
        setup.timestep = timestep;
        // a damped contact lasts longer than an elastic one: up to 3 times at restitution 0.1
        setup.steps = (4.0 * contact_time / timestep) as u64 + 20;
        let samples = experiment.run(&setup)?;
        measure_impact(&samples, |s| self.overlap(s), |s| self.rate(s))
    }

    fn overlap(&self, sample: &Sample) -> f64 {
        match sample.particles.as_slice() {
            [one] => self.radius - one.position.z,
            [one, other, ..] => 2.0 * self.radius - (other.position - one.position).norm(),
            [] => f64::NAN,
        }
    }

    fn rate(&self, sample: &Sample) -> f64 {
        match sample.particles.as_slice() {
            [one] => -one.velocity.z,
            [one, other, ..] => (one.velocity - other.velocity).dot(&(other.position - one.position).normalize()),
            [] => f64::NAN,
        }
    }
}

fn two_spheres(experiment: &mut dyn Experiment) -> Result<Vec<Check>, NotRun> {
    let sphere = |youngs_modulus, poissons_ratio, density| HeadOn {
        radius: 0.01,
        density,
        youngs_modulus,
        poissons_ratio,
        speed: 10.0,
        against_plane: false,
    };
    let mut checks = elastic(experiment, "glass", &sphere(4.8e10, 0.20, 2800.0))?;
    checks.extend(elastic(experiment, "limestone", &sphere(2.0e10, 0.25, 2500.0))?);
    Ok(checks)
}

fn sphere_on_plane(experiment: &mut dyn Experiment) -> Result<Vec<Check>, NotRun> {
    let sphere = |youngs_modulus, poissons_ratio, density| HeadOn {
        radius: 0.1,
        density,
        youngs_modulus,
        poissons_ratio,
        speed: 0.2,
        against_plane: true,
    };
    let mut checks = elastic(experiment, "aluminium alloy", &sphere(7e10, 0.30, 2699.0))?;
    checks.extend(elastic(experiment, "magnesium alloy", &sphere(4e10, 0.35, 1800.0))?);
    Ok(checks)
}

fn elastic(experiment: &mut dyn Experiment, material: &str, body: &HeadOn) -> Result<Vec<Check>, NotRun> {
    let contact = body.contact();
    let exact = hertz_impact(&contact, body.approach());
    let timestep = exact.duration / 50.0;
    let measured = phases(|phase| body.run(experiment, HERTZ, 1.0, [timestep, exact.duration, phase]))?;
    let check = |what: &str, unit, reference: f64, value: fn(&MeasuredImpact) -> f64, scale: f64| Check {
        quantity: format!("{material}: {what}"),
        reference,
        measured: worst(measured.iter().map(|m| scale * value(m)), reference),
        tolerance: Tolerance::Relative(1e-3),
        reason: ELASTIC_REASON,
        unit,
        source: "Hertz 1882, closed form",
    };
    Ok(vec![
        check("largest overlap", "m", exact.overlap, |m| m.overlap, 1.0),
        check("largest force", "N", exact.force, |m| m.acceleration, contact.mass),
        check("contact duration", "s", exact.duration, |m| m.duration, 1.0),
        check("restitution", "-", 1.0, |m| m.restitution, 1.0),
    ])
}

const TEST_3: [(&str, HeadOn); 2] = [
    (
        "aluminium oxide",
        HeadOn {
            radius: 2.5e-3,
            density: 4000.0,
            youngs_modulus: 3.8e11,
            poissons_ratio: 0.23,
            speed: 3.9,
            against_plane: true,
        },
    ),
    (
        "cast iron",
        HeadOn {
            radius: 2.5e-3,
            density: 7000.0,
            youngs_modulus: 1.0e11,
            poissons_ratio: 0.25,
            speed: 3.9,
            against_plane: true,
        },
    ),
];

fn restitutions(experiment: &mut dyn Experiment) -> Result<Vec<Check>, NotRun> {
    let mut checks = Vec::new();
    for (material, body) in TEST_3 {
        checks.extend(elastic(experiment, material, &body)?);
        let contact_time = hertz_impact(&body.contact(), body.approach()).duration;
        for e in [0.2, 0.4, 0.6, 0.8] {
            let mut realised = |steps: f64| -> Result<Vec<f64>, NotRun> {
                let timestep = contact_time / steps;
                let measured = phases(|phase| body.run(experiment, HERTZ, e, [timestep, contact_time, phase]))?;
                Ok(measured.iter().map(|m| m.restitution).collect())
            };
            let fine = worst(realised(500.0)?, e);
            let errors = [rms_error(&realised(100.0)?, e), rms_error(&realised(900.0)?, e)];
            checks.push(Check {
                quantity: format!("{material}, e = {e}: restitution at 500 steps"),
                reference: e,
                measured: fine,
                tolerance: Tolerance::Absolute(1e-3),
                reason: "bar of the suite at 500 steps per contact, worst of 8 phases",
                unit: "-",
                source: "the asked restitution (Tsuji 1992; Antypov and Elliott 2011)",
            });
            checks.push(slope(&format!("{material}, e = {e}"), errors));
        }
    }
    Ok(checks)
}

/// Root mean square of the deviations from `e`: an impact's error swings with its phase on the time grid.
fn rms_error(values: &[f64], e: f64) -> f64 {
    (values.iter().map(|value| (value - e).powi(2)).sum::<f64>() / values.len() as f64).sqrt()
}

fn slope(what: &str, errors: [f64; 2]) -> Check {
    Check {
        quantity: format!("{what}: slope of the rms error, 100 to 900 steps"),
        reference: 1.0,
        measured: (errors[0] / errors[1]).ln() / 9.0_f64.ln(),
        tolerance: Tolerance::AtLeast,
        reason: "dashpot force starts like delta^(1/4): the method is at least of first order there",
        unit: "-",
        source: "error falls at least in proportion to the step",
    }
}

fn cut_off(experiment: &mut dyn Experiment) -> Result<Vec<Check>, NotRun> {
    let body = TEST_3[0].1;
    let contact_time = hertz_impact(&body.contact(), body.approach()).duration;
    let mut checks = Vec::new();
    for (asked, _) in published::CUT_OFF {
        let formula = reference::cut_off_restitution(asked);
        for (name, law) in [("Hertz", HERTZ), ("linear", LINEAR)] {
            // the linear stiffness is the solver's choice, its contact lasts about as long at a matching characteristic speed
            let law = LawSettings { attraction: false, characteristic_velocity: body.approach(), ..law };
            let measured =
                phases(|phase| body.run(experiment, law, asked, [contact_time / 500.0, contact_time, phase]))?;
            checks.push(Check {
                quantity: format!("{name}, asked {asked}: realised"),
                reference: formula,
                measured: worst(measured.iter().map(|m| m.restitution), formula),
                tolerance: Tolerance::Absolute(2e-3),
                reason: "500 steps per contact; the linear dashpot starts with a jump, so first order: omega dt / 4 of the loss",
                unit: "-",
                source: "closed form; table to four digits agrees",
            });
        }
    }
    Ok(checks)
}

fn phases(mut run: impl FnMut(f64) -> Result<MeasuredImpact, NotRun>) -> Result<Vec<MeasuredImpact>, NotRun> {
    (0..PHASES).map(|k| run(f64::from(k) / f64::from(PHASES))).collect()
}
