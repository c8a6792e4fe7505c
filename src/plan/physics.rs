//! Which models a scene requires, each on or off with its reason.

use super::pairs::particle_kinds;
use super::{PlanFinding, refusal, warning};
use crate::dem::feed::FeedKind;
use crate::dem::law::constants::PairConstants;
use crate::dem::law::{RollingLaw, TangentialLaw};
use crate::geometry::motion::MotionKind;
use crate::geometry::part::{Part, Surface, Trigger};
use crate::particle::Body;
use crate::scene::{Scene, Sleeping};
use serde::Serialize;

/// Models that can be forced on or off by name; all others are what the scene is made of.
pub const FORCIBLE: [&str; 4] = ["sliding_friction", "tangential_damping", "rolling_resistance", "energy_budget"];

/// One model of the plan.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct ModelDecision {
    /// Name.
    pub name: &'static str,
    /// Whether it acts.
    pub on: bool,
    /// Why.
    pub reason: String,
    /// What a forced decision risks; `None` where nothing was forced.
    pub risk: Option<&'static str>,
}

/// What the scene's contents require of the models.
struct Needs<'a> {
    scene: &'a Scene,
    pairs: Vec<PairConstants>,
}

/// Decides on every model.
pub fn decide(scene: &Scene, findings: &mut Vec<PlanFinding>) -> Vec<ModelDecision> {
    let needs = Needs { scene, pairs: occurring_pairs(scene) };
    let mut models = vec![
        needs.gravity(),
        needs.normal_damping(),
        force(needs.sliding_friction(), scene, "particles slide where they would stick: heaps and flows become wrong"),
        force(needs.rolling_resistance(), scene, "round particles roll freely: heaps become flatter"),
    ];
    let friction = models[2].on;
    let rolling = models[3].on;
    models.push(needs.tangential_history(friction));
    models.push(force(
        needs.tangential_damping(friction),
        scene,
        "tangential springs ring on: beds take longer to come to rest",
    ));
    models.push(needs.spin(friction, rolling));
    models.push(needs.material_table());
    models.extend(needs.walls());
    models.push(needs.periodic_borders());
    models.push(needs.plane_problem());
    let blind = "losses are not booked: the budget's columns stay empty";
    models.push(force(needs.energy_budget(), scene, blind));
    models.extend(needs.sleeping());
    check_forced_names(scene, &models, findings);
    models
}

fn decision(name: &'static str, on: bool, reason: impl Into<String>) -> ModelDecision {
    ModelDecision { name, on, reason: reason.into(), risk: None }
}

impl Needs<'_> {
    fn gravity(&self) -> ModelDecision {
        let gravity = self.scene.gravity.norm();
        let on = gravity > 0.0;
        decision("gravity", on, if on { format!("{gravity:.4} m/s2") } else { "the scene has none".to_owned() })
    }

    fn normal_damping(&self) -> ModelDecision {
        let dissipates = |pair: &PairConstants| {
            pair.damping_factor > 0.0 || pair.given.is_some_and(|(given, _)| given.normal_damping > 0.0)
        };
        let count = self.pairs.iter().filter(|pair| dissipates(pair)).count();
        let reason = match count {
            0 => "every pair that can touch has restitution 1".to_owned(),
            _ => format!("{count} of {} pairs that can touch lose energy", self.pairs.len()),
        };
        decision("normal_damping", count > 0, reason)
    }

    fn sliding_friction(&self) -> ModelDecision {
        let count = self.pairs.iter().filter(|pair| pair.sliding_friction > 0.0).count();
        let reason = match count {
            0 => "no pair that can touch has friction: no tangential force, nothing to remember".to_owned(),
            _ => format!("{count} of {} pairs that can touch have friction", self.pairs.len()),
        };
        decision("sliding_friction", count > 0, reason)
    }

    fn tangential_history(&self, friction: bool) -> ModelDecision {
        let reason = match (friction, self.scene.law.tangential) {
            (false, _) => "no friction, so no tangential spring",
            (true, TangentialLaw::Total) => "friction needs the displacement of each contact (law: total)",
            (true, TangentialLaw::Incremental) => "friction needs the force of each contact (law: incremental)",
        };
        decision("tangential_history", friction, reason)
    }

    fn tangential_damping(&self, friction: bool) -> ModelDecision {
        let asked = self.scene.law.tangential_damping;
        let reason = match (asked, friction) {
            (false, _) => "the law has none",
            (true, false) => "no friction, so no tangential force",
            (true, true) => "the law asks for it",
        };
        decision("tangential_damping", asked && friction, reason)
    }

    fn rolling_resistance(&self) -> ModelDecision {
        let has = self.pairs.iter().any(|pair| pair.rolling_friction > 0.0);
        let (on, reason) = match (self.scene.law.rolling, has) {
            (RollingLaw::None, true) => (false, "pairs have rolling friction, but the law says none"),
            (RollingLaw::None, false) => (false, "the law has none"),
            (_, false) => (false, "no pair that can touch has rolling friction"),
            (RollingLaw::Cdt, true) => (true, "pairs have rolling friction (law: constant directional torque)"),
            (RollingLaw::Epsd2, true) => (true, "pairs have rolling friction (law: elastic-plastic spring)"),
        };
        decision("rolling_resistance", on, reason)
    }

    fn spin(&self, friction: bool, rolling: bool) -> ModelDecision {
        let spins = self.scene.feeds.iter().any(|feed| match &feed.kind {
            FeedKind::File { particles } => particles.iter().any(|particle| particle.spin.norm_squared() > 0.0),
            _ => false,
        });
        let reason = match (friction || rolling, spins) {
            (true, _) => "tangential forces turn particles",
            (false, true) => "an initial state has spinning particles, whose spin stays as it is",
            (false, false) => "nothing turns a particle",
        };
        decision("spin", friction || rolling || spins, reason)
    }

    fn material_table(&self) -> ModelDecision {
        let several = self.pairs.windows(2).any(|pair| pair[0] != pair[1]);
        let reason = match (self.pairs.len(), several) {
            (0, _) => "nothing can touch anything".to_owned(),
            (1, _) => "one pair of materials: constants need no look-up".to_owned(),
            (count, false) => format!("all {count} pairs that can touch have the same constants"),
            (count, true) => format!("{count} pairs of materials can touch"),
        };
        decision("material_table", several, reason)
    }

    fn walls(&self) -> Vec<ModelDecision> {
        let parts = &self.scene.parts;
        let count = |holds: &dyn Fn(&Part) -> bool| parts.iter().filter(|part| holds(part)).count();
        let some = |name: &'static str, number: usize, what: &str, none: &str| {
            let reason = if number > 0 { format!("{number} of {} parts {what}", parts.len()) } else { none.to_owned() };
            decision(name, number > 0, reason)
        };
        let triangles: usize = parts
            .iter()
            .map(|part| if let Surface::Mesh(mesh) = &part.surface { mesh.triangles.len() } else { 0 })
            .sum();
        let moves = |part: &Part| !part.motion.is_static() || belt_speed(part) > 0.0;
        let comes_or_goes =
            |part: &Part| !matches!(part.appears, Trigger::Always) || !matches!(part.disappears, Trigger::Never);
        vec![
            some("walls", parts.len(), "touch particles", "the scene has no parts"),
            some("moving_walls", count(&moves), "move", "no part moves"),
            some(
                "meshes",
                count(&|part| matches!(part.surface, Surface::Mesh(_))),
                &format!("are meshes, {triangles} triangles together"),
                "no part is a mesh",
            ),
            some("part_events", count(&comes_or_goes), "appear or disappear", "all parts are there all the time"),
        ]
    }

    fn periodic_borders(&self) -> ModelDecision {
        let axes: Vec<&str> = ["x", "y", "z"]
            .into_iter()
            .zip(self.scene.domain.periodic)
            .filter_map(|(name, on)| on.then_some(name))
            .collect();
        let reason = if axes.is_empty() {
            "no axis repeats".to_owned()
        } else {
            format!("the domain repeats along {}", axes.join(", "))
        };
        decision("periodic_borders", !axes.is_empty(), reason)
    }

    fn plane_problem(&self) -> ModelDecision {
        match self.scene.body {
            Body::Sphere => decision("plane_problem", false, "spheres in space"),
            Body::Disc { thickness } => {
                decision("plane_problem", true, format!("discs of {thickness} m thickness in the plane y = 0"))
            }
        }
    }

    /// A shortcut: said where it is taken.
    fn sleeping(&self) -> Option<ModelDecision> {
        let Sleeping { speed, hold, unbalanced } = self.scene.solver.sleeping?;
        let (speed, hold, share) = (1e3 * speed, 1e3 * hold, 100.0 * unbalanced);
        let reason = format!(
            "a shortcut: who is slower than {speed:.4} mm/s for {hold:.4} ms stays put until out of balance by {share:.4} % of its weight"
        );
        Some(decision("sleeping", true, reason))
    }

    fn energy_budget(&self) -> ModelDecision {
        let on = self.scene.output.energy;
        decision("energy_budget", on, if on { "the outputs ask for it" } else { "no output asks for it" })
    }
}

/// Speed of a part's surface in itself [m/s].
pub(super) fn belt_speed(part: &Part) -> f64 {
    let belt = |kind: &MotionKind| if let MotionKind::Conveyor { velocity } = kind { velocity.norm() } else { 0.0 };
    part.motion.terms.iter().map(|term| belt(&term.kind)).sum()
}

/// The constants of every pair of materials that can touch, each pair once.
fn occurring_pairs(scene: &Scene) -> Vec<PairConstants> {
    let mut particles: Vec<u16> = particle_kinds(scene).iter().map(|kind| kind.material).collect();
    particles.sort_unstable();
    particles.dedup();
    let mut pairs: Vec<(u16, u16)> = Vec::new();
    for &a in &particles {
        let partners = particles.iter().copied().chain(scene.parts.iter().map(|part| part.material));
        pairs.extend(partners.map(|b| (a.min(b), a.max(b))));
    }
    pairs.sort_unstable();
    pairs.dedup();
    pairs.into_iter().filter_map(|(a, b)| PairConstants::of(&scene.materials, a, b)).collect()
}

/// Applies what the scene forces.
fn force(mut model: ModelDecision, scene: &Scene, risk: &'static str) -> ModelDecision {
    let Some((_, on)) = scene.solver.forced_models.iter().rfind(|(name, _)| same_name(name, model.name)) else {
        return model;
    };
    let (needed, word) = (model.on, if *on { "on" } else { "off" });
    model.reason =
        format!("forced {word}; by itself it would be {}: {}", if needed { "on" } else { "off" }, model.reason);
    model.risk = Some(match (needed, *on) {
        (true, false) => risk,
        (false, true) => "costs time and changes no particle's path where nothing needs it",
        _ => "none: it is what the scene requires",
    });
    model.on = *on;
    model
}

/// Names in a scene may be written with dashes.
fn same_name(written: &str, name: &str) -> bool {
    written.replace('-', "_") == name
}

fn check_forced_names(scene: &Scene, models: &[ModelDecision], findings: &mut Vec<PlanFinding>) {
    for (name, _) in &scene.solver.forced_models {
        if FORCIBLE.iter().any(|known| same_name(name, known)) {
            continue;
        }
        let known = models.iter().any(|model| same_name(name, model.name));
        let what = if known {
            format!("model '{name}' follows from what the scene contains and cannot be forced: change the scene")
        } else {
            format!("unknown model '{name}'")
        };
        findings
            .push(refusal("forced-model", format!("{what}; models that can be forced are {}", FORCIBLE.join(", "))));
    }
    for model in models.iter().filter(|model| !model.on) {
        if let Some(risk) = model.risk
            && model.reason.contains("would be on")
        {
            findings.push(warning("forced-model", format!("{} is forced off: {risk}", model.name)));
        }
    }
}
