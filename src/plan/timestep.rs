//! The time step: every limit by name, the one that binds, and the step chosen. And the neighbour skin.

use super::cost::Supply;
use super::impact::ImpactSpeed;
use super::pairs::{PossibleContact, particle_kinds};
use super::{PlanFinding, refusal, warning};
use crate::dem::law::NormalLaw;
use crate::dem::timescale::{self as scale, SpringBed};
use crate::material::Elasticity;
use crate::particle::Body;
use crate::scene::Scene;
use serde::Serialize;

/// Steps that resolve a contact at the limit; fewer do not resolve it at all. The usual fraction of 0.2 makes it 15 steps, at
/// which velocity-Verlet returns a head-on elastic impact's speed to 1e-3.
const STEPS_PER_CONTACT: f64 = 3.0;
/// The scene's fraction is meant for limits of accuracy; of a limit of stability three times as much is taken, at most
/// `LARGEST_SHARE`: below it the computation is stable, and how exact it is the other limits say.
const STABILITY_SHARE: f64 = 3.0;
const LARGEST_SHARE: f64 = 0.8;
/// Contacts of a particle at the same time: the kissing numbers of equal spheres and discs, and of them those with walls
/// in the corner of a box.
const CONTACTS_OF_SPHERE: (f64, f64) = (12.0, 3.0);
const CONTACTS_OF_DISC: (f64, f64) = (6.0, 2.0);
/// A given step that is smaller than this share of the binding limit is said to be wasteful.
const WASTEFUL: f64 = 0.01;
/// Steps in the run where nothing limits the time step.
const STEPS_WITHOUT_LIMIT: f64 = 1000.0;
/// Share of the mean diameter that the skin is in a dense bed, where lists live long: from 0.3 to 0.7 one is as fast as another. And among
/// free particles: of 0.75, 1 and 1.25 in a cloud that fills 2 % of its room, the latter two were equally fast.
const DENSE_SKIN: f64 = 0.35;
const DILUTE_SKIN: f64 = 1.0;
/// Steps between two lists that the skin should allow at the expected speed, and its largest share of a diameter then: a stream down a
/// chute took 43, 42 and 40 s with 0.35, 0.5 and 0.6, a bed of sizes 1:10 was fastest at 0.6 and 0.7.
const STEPS_PER_LIST: f64 = 60.0;
const WIDEST_DENSE_SKIN: f64 = 0.6;

/// A limit of the time step.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Limit {
    /// Name.
    pub name: &'static str,
    /// The largest time step it accepts [s]; infinite where it does not apply.
    pub value: f64,
    /// Whether the computation is unstable above it, rather than inaccurate.
    pub stability: bool,
    /// What it is and for which particle.
    pub note: String,
}

/// The time step chosen.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct TimestepChoice {
    /// Every limit.
    pub limits: Vec<Limit>,
    /// Name of the limit that binds: the smallest after its share; `None` where nothing limits.
    pub binding: Option<&'static str>,
    /// Share of the binding limit that the chosen step is [-].
    pub fraction: f64,
    /// The time step [s].
    pub chosen: f64,
    /// Whether the scene gives it.
    pub given: bool,
    /// Whether it is the step of the whole scene that a stage takes.
    pub of_whole: bool,
}

/// The neighbour skin chosen.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct SkinChoice {
    /// Skin [m].
    pub skin: f64,
    /// Why.
    pub reason: String,
}

/// Chooses the time step, or checks the one given; a stage takes that of the whole scene, `of_whole` [s].
pub fn choose(
    scene: &Scene,
    impact: &ImpactSpeed,
    contacts: &[PossibleContact],
    of_whole: Option<f64>,
    findings: &mut Vec<PlanFinding>,
) -> TimestepChoice {
    let limits = vec![
        rayleigh(scene),
        contact_duration(scene, impact, contacts),
        spring_period(scene, contacts),
        displacement(scene, "displacement", impact.particle_speed, "particles at the expected speed"),
        displacement(scene, "moving_wall", impact.wall_speed, "the fastest point of a part"),
    ];
    let fraction = scene.solver.timestep_fraction;
    let allowed = |limit: &Limit| {
        let share = if limit.stability { (STABILITY_SHARE * fraction).min(LARGEST_SHARE) } else { fraction };
        share * limit.value
    };
    let finite = limits.iter().filter(|limit| limit.value.is_finite());
    let smallest = finite.min_by(|a, b| allowed(a).total_cmp(&allowed(b)));
    let without_limit = scene.end.time / STEPS_WITHOUT_LIMIT;
    let given = of_whole.or(scene.solver.timestep);
    let chosen = given.unwrap_or_else(|| round_down(smallest.map_or(without_limit, allowed)));
    let bound = smallest.map_or(without_limit / fraction, |limit| limit.value);
    let choice = TimestepChoice {
        binding: smallest.map(|limit| limit.name),
        fraction: chosen / bound,
        chosen,
        given: scene.solver.timestep.is_some(),
        of_whole: of_whole.is_some(),
        limits,
    };
    check(&choice, findings);
    choice
}

fn check(choice: &TimestepChoice, findings: &mut Vec<PlanFinding>) {
    let step = choice.chosen;
    for limit in choice.limits.iter().filter(|limit| step > limit.value) {
        let passed =
            format!("the time step of {step:.3e} s passes {} = {:.3e} s ({})", limit.name, limit.value, limit.note);
        if limit.stability {
            let safe = round_down(0.5 * limit.value);
            let text =
                format!("{passed}: contacts gain energy from nothing; take {safe:.1e} s or less, or softer contacts");
            findings.push(refusal("unstable-timestep", text));
        } else {
            findings
                .push(warning("coarse-timestep", format!("{passed}: results depend on the step; take a smaller one")));
        }
    }
    if choice.given && !choice.of_whole && choice.binding.is_some() && choice.fraction < WASTEFUL {
        let text = format!(
            "the time step of {step:.3e} s is {:.1e} of the smallest limit: a larger one gives the same result sooner",
            choice.fraction
        );
        findings.push(warning("wasteful-timestep", text));
    }
}

/// The smallest Rayleigh time of any particle.
fn rayleigh(scene: &Scene) -> Limit {
    let mut limit = Limit {
        name: "rayleigh_time",
        value: f64::INFINITY,
        stability: false,
        note: "no particle has elastic constants".to_owned(),
    };
    for kind in particle_kinds(scene) {
        let elasticity = scene.materials.materials[usize::from(kind.material)].elasticity;
        let Some(Elasticity::Isotropic { youngs_modulus, poissons_ratio }) = elasticity else { continue };
        let shear = youngs_modulus / (2.0 * (1.0 + poissons_ratio));
        let time = scale::rayleigh_time(kind.smallest, kind.density, shear, poissons_ratio);
        if time < limit.value {
            limit.value = time;
            limit.note = format!("surface wave on {} of {:.4} mm", kind.name, 2e3 * kind.smallest);
        }
    }
    limit
}

fn contact_duration(scene: &Scene, impact: &ImpactSpeed, contacts: &[PossibleContact]) -> Limit {
    let hertz = scene.law.normal == NormalLaw::HertzMindlin;
    let name = if hertz { "hertz_contact_duration" } else { "linear_contact_duration" };
    let shortest = contacts
        .iter()
        .filter(|contact| contact.duration.is_finite() && contact.duration > 0.0)
        .min_by(|a, b| a.duration.total_cmp(&b.duration));
    let Some(shortest) = shortest else {
        let note = "nothing touches, or nothing moves".to_owned();
        return Limit { name, value: f64::INFINITY, stability: false, note };
    };
    let note = format!(
        "a contact of {:.3e} s in {STEPS_PER_CONTACT} steps: {} at {:.3} m/s",
        shortest.duration, shortest.name, impact.speed
    );
    Limit { name, value: shortest.duration / STEPS_PER_CONTACT, stability: false, note }
}

fn spring_period(scene: &Scene, contacts: &[PossibleContact]) -> Limit {
    let ((all, with_walls), dimensions) = match scene.body {
        Body::Sphere => (CONTACTS_OF_SPHERE, 3.0),
        Body::Disc { .. } => (CONTACTS_OF_DISC, 2.0),
    };
    let mut limit =
        Limit { name: "spring_period", value: f64::INFINITY, stability: true, note: "nothing touches".to_owned() };
    for contact in contacts {
        let same = contacts.iter().filter(|other| other.mass == contact.mass && other.radius == contact.radius);
        // a particle of a bed, with as many walls as a corner has, while one more body hits it
        let (mut by_particle, mut by_wall, mut hit) = (0.0_f64, 0.0_f64, 0.0_f64);
        let (mut ratio, mut damping) = (0.0_f64, 0.0_f64);
        for other in same {
            let stiffest = if other.with_wall { &mut by_wall } else { &mut by_particle };
            *stiffest = stiffest.max(other.resting_stiffness);
            hit = hit.max(other.normal_stiffness);
            ratio = ratio.max(other.tangential_ratio);
            damping = damping.max(other.damping_ratio);
        }
        let count = if by_particle > 0.0 { all } else { with_walls };
        let resting = (all - with_walls) * by_particle + with_walls * by_wall.max(by_particle);
        let total = resting * (count - 1.0) / count + hit;
        let value = scale::spring_period_timestep(&SpringBed {
            mass: contact.mass,
            inertia_factor: scene.body.inertia_factor(),
            normal_stiffness: total / count,
            tangential_ratio: ratio,
            contacts: count,
            dimensions,
            damping_ratio: damping,
        });
        if value < limit.value {
            limit.value = value;
            limit.note = format!(
                "2 / omega_max of the lightest particle ({:.4} mm) with {count} contacts of {:.3e} N/m on average",
                2e3 * contact.radius,
                total / count
            );
        }
    }
    limit
}

/// A way of the allowed overlap in one step.
fn displacement(scene: &Scene, name: &'static str, speed: f64, who: &str) -> Limit {
    let smallest = particle_kinds(scene).iter().map(|kind| kind.smallest).fold(f64::INFINITY, f64::min);
    let way = scene.solver.overlap_limit * smallest;
    if speed <= 0.0 || !way.is_finite() {
        return Limit { name, value: f64::INFINITY, stability: false, note: "nothing moves".to_owned() };
    }
    let note = format!("{who}, {speed:.3} m/s, move by the allowed overlap of {:.4} mm", 1e3 * way);
    Limit { name, value: scale::displacement_timestep(way, speed), stability: false, note }
}

/// `value` rounded down to two significant digits, exactly the number that its digits say.
#[must_use]
pub fn round_down(value: f64) -> f64 {
    if !value.is_finite() || value <= 0.0 {
        return value;
    }
    let exponent = value.log10().floor() as i32 - 1;
    // a value that is two digits already, but for round-off, stays what it is
    let digits = (value / 10_f64.powi(exponent) * (1.0 + 1e-12)).floor();
    format!("{digits}e{exponent}").parse().unwrap_or(value)
}

/// Chooses the neighbour skin, or takes the one given.
pub(super) fn choose_skin(scene: &Scene, impact: &ImpactSpeed, supply: &Supply, timestep: f64) -> SkinChoice {
    if let Some(skin) = scene.solver.skin {
        return SkinChoice { skin, reason: "given in the scene".to_owned() };
    }
    let diameter = supply.mean_diameter(scene);
    let travel = 2.0 * impact.speed * timestep * STEPS_PER_LIST;
    let (skin, reason) = if supply.is_dense {
        let skin = (DENSE_SKIN * diameter).max(travel.min(WIDEST_DENSE_SKIN * diameter));
        (
            skin,
            format!(
                "dense: from {DENSE_SKIN} to {WIDEST_DENSE_SKIN} mean diameters, for {STEPS_PER_LIST} steps a list"
            ),
        )
    } else {
        (DILUTE_SKIN * diameter, format!("few contacts: {DILUTE_SKIN} mean diameters, since long lists cost little"))
    };
    SkinChoice { skin: round_down(skin), reason }
}
