//! Predicted particles, steps, memory and wall time.

use super::Calibration;
use super::pairs::particle_kinds;
use crate::dem::feed::size::SizeSampler;
use crate::dem::feed::{Amount, Feed, FeedKind, Rate, Region};
use crate::math::Bounds;
use crate::particle::Body;
use crate::scene::Scene;
use serde::Serialize;

/// Share of a region that random sequential addition fills with equal spheres and discs (Torquato and Stillinger, 2010).
const FULL_OF_SPHERES: f64 = 0.38;
const FULL_OF_DISCS: f64 = 0.547;
/// Below this solid fraction, particles that nothing brings to rest on each other count as dilute.
const DILUTE: f64 = 0.1;
/// Share of its height through which a cloud must fall within the run to count as brought to rest: three quarters of it are still in the
/// air then, and long lists serve these.
const FALLEN: f64 = 0.25;

/// What a run costs.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct CostForecast {
    /// Particles that will have been inserted by the end.
    pub particles: f64,
    /// The same for each feed whose particles come here, in the scene's order.
    pub feeds: Vec<FeedSupply>,
    /// Time steps.
    pub steps: f64,
    /// Particle steps, particles that leave the domain counted to the end.
    pub particle_steps: f64,
    /// Memory [B]; `None` without a calibration.
    pub memory_bytes: Option<f64>,
    /// Wall time [s]; `None` without a calibration.
    pub wall_s: Option<f64>,
    /// What the figures rest on.
    pub basis: String,
}

/// What one feed will bring.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct FeedSupply {
    /// Name.
    pub name: String,
    /// Particles by the end of the run.
    pub particles: f64,
    /// Share of the run's time that they are there on average [-].
    pub presence: f64,
    /// Their volume [m3], or area [m2] of discs.
    #[serde(skip)]
    measure: f64,
    /// Sum of their diameters [m].
    #[serde(skip)]
    diameters: f64,
}

/// What all feeds will bring.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Supply {
    pub feeds: Vec<FeedSupply>,
    /// Whether particles mostly lie on each other.
    pub is_dense: bool,
    pub dense_reason: &'static str,
}

impl Supply {
    pub fn particles(&self) -> f64 {
        self.feeds.iter().map(|feed| feed.particles).sum()
    }

    /// Mean diameter by number [m]; of the classes where no feed brings anything.
    pub fn mean_diameter(&self, scene: &Scene) -> f64 {
        let particles = self.particles();
        if particles > 0.0 {
            return self.feeds.iter().map(|feed| feed.diameters).sum::<f64>() / particles;
        }
        let kinds = particle_kinds(scene);
        let sum: f64 = kinds.iter().map(|kind| kind.smallest + kind.largest).sum();
        if kinds.is_empty() { 1e-3 * scene.domain.bounds.size().max() } else { sum / kinds.len() as f64 }
    }
}

/// What the feeds will bring by the end of the run, each as many times as `passages` say; those of no passage are left out.
pub(super) fn supply(scene: &Scene, passages: Option<&[f64]>) -> Supply {
    let times = |index: usize| passages.map_or(1.0, |passages| passages[index]);
    let feeds = scene.feeds.iter().enumerate().filter(|(index, _)| times(*index) > 0.0);
    let feeds: Vec<FeedSupply> = feeds.map(|(index, feed)| supply_of(scene, feed).repeated(times(index))).collect();
    let solid = feeds.iter().map(|feed| feed.measure).sum::<f64>() / room(scene.body, &scene.domain.bounds);
    let pulled = (0..3).any(|axis| scene.gravity[axis] != 0.0 && !scene.domain.periodic[axis]);
    let (is_dense, dense_reason) = match (pulled, solid < DILUTE) {
        (true, _) if stays_a_cloud(scene) => {
            (false, "particles begin as a thin cloud and the run ends before they have fallen far")
        }
        (true, _) => (true, "gravity brings particles to rest on each other"),
        (false, true) => (false, "particles fill less than 0.1 of the domain and nothing pulls them together"),
        (false, false) => (true, "particles fill more than 0.1 of the domain"),
    };
    Supply { feeds, is_dense, dense_reason }
}

/// Volume [m3] of a box, or area [m2] of discs' plane in it.
fn room(body: Body, bounds: &Bounds) -> f64 {
    let size = bounds.size();
    match body {
        Body::Sphere => size.x * size.y * size.z,
        Body::Disc { .. } => size.x * size.z,
    }
}

/// Whether all particles come from files, are dilute in the box around them, and do not fall through much of it within the run.
fn stays_a_cloud(scene: &Scene) -> bool {
    let (mut bounds, mut measure) = (Bounds::EMPTY, 0.0);
    for feed in &scene.feeds {
        let FeedKind::File { particles } = &feed.kind else { return false };
        for particle in particles.iter() {
            bounds.include(&particle.position);
            measure += body_measure(scene.body, particle.radius);
        }
    }
    let fallen = scene.gravity.map(|gravity| 0.5 * gravity.abs() * scene.end.time.powi(2));
    scene.start_checkpoint.is_none()
        && measure < DILUTE * room(scene.body, &bounds)
        && (0..3).all(|axis| fallen[axis] <= FALLEN * bounds.size()[axis])
}

impl FeedSupply {
    fn repeated(mut self, times: f64) -> Self {
        self.particles *= times;
        self.measure *= times;
        self.diameters *= times;
        self
    }
}

fn supply_of(scene: &Scene, feed: &Feed) -> FeedSupply {
    let end = scene.end.time;
    let nothing = FeedSupply { name: feed.name.clone(), particles: 0.0, presence: 0.0, measure: 0.0, diameters: 0.0 };
    match &feed.kind {
        FeedKind::File { particles } => FeedSupply {
            particles: particles.len() as f64,
            presence: 1.0,
            measure: particles.iter().map(|particle| body_measure(scene.body, particle.radius)).sum(),
            diameters: particles.iter().map(|particle| 2.0 * particle.radius).sum(),
            ..nothing
        },
        FeedKind::Fill { class, region, amount, start, interval, until, .. } => {
            let Some(size) = ClassSize::of(scene, *class) else { return nothing };
            let last = until.min(end);
            let insertions = match last - start {
                window if window < 0.0 => 0.0,
                window => (window / interval).floor() + 1.0,
            };
            let asked = size.count(amount);
            let at_once = full_region(region, scene.body) / size.mean_measure;
            let particles = asked.min(at_once * insertions).floor();
            let needed = (particles / at_once.max(1.0)).ceil();
            let middle = if needed > 1.0 { start + 0.5 * (needed - 1.0) * interval } else { *start };
            size.supply(nothing, particles, middle, end)
        }
        FeedKind::Stream { class, rate, amount, start, until, .. } => {
            let Some(size) = ClassSize::of(scene, *class) else { return nothing };
            let per_second = match rate {
                Rate::Count(rate) => *rate,
                Rate::Mass(rate) => rate / size.mean_mass,
            };
            let window = (until.min(end) - start).max(0.0);
            let by_time = (per_second * window).ceil();
            let particles = amount.as_ref().map_or(by_time, |amount| by_time.min(size.count(amount)));
            size.supply(nothing, particles, start + 0.5 * particles / per_second, end)
        }
    }
}

/// Means of a class, by number.
struct ClassSize {
    mean_mass: f64,
    mean_measure: f64,
    mean_diameter: f64,
}

impl ClassSize {
    fn of(scene: &Scene, class: usize) -> Option<Self> {
        let class = scene.classes.get(class)?;
        let density = scene.materials.materials[usize::from(class.material)].density?;
        let sampler = SizeSampler::new(&class.diameter, scene.body);
        let mean_mass = sampler.mean_mass(scene.body, density);
        // mass over density is a volume; of a disc, over its thickness an area
        let depth = if let Body::Disc { thickness } = scene.body { thickness } else { 1.0 };
        let mean_measure = mean_mass / density / depth;
        Some(Self { mean_mass, mean_measure, mean_diameter: sampler.mean_power(1) })
    }

    fn count(&self, amount: &Amount) -> f64 {
        match amount {
            Amount::Count(count) => *count as f64,
            Amount::Mass(mass) => (mass / self.mean_mass).ceil(),
        }
    }

    fn supply(&self, feed: FeedSupply, particles: f64, middle: f64, end: f64) -> FeedSupply {
        FeedSupply {
            particles,
            presence: ((end - middle) / end).clamp(0.0, 1.0),
            measure: particles * self.mean_measure,
            diameters: particles * self.mean_diameter,
            ..feed
        }
    }
}

fn full_region(region: &Region, body: Body) -> f64 {
    let full = if matches!(body, Body::Sphere) { FULL_OF_SPHERES } else { FULL_OF_DISCS };
    full * region.measure(body)
}

fn body_measure(body: Body, radius: f64) -> f64 {
    match body {
        Body::Sphere => Body::Sphere.mass(radius, 1.0),
        Body::Disc { .. } => Body::Disc { thickness: 1.0 }.mass(radius, 1.0),
    }
}

/// Particles, steps, memory and wall time.
pub(super) fn forecast(
    scene: &Scene,
    supply: &Supply,
    timestep: f64,
    calibration: Option<Calibration>,
) -> CostForecast {
    // an end that is a whole number of steps but for round-off takes that number
    let steps = (scene.end.time / timestep * (1.0 - 1e-12)).ceil();
    let present: f64 = supply.feeds.iter().map(|feed| feed.particles * feed.presence).sum();
    let particle_steps = present * steps;
    let rate = |calibration: &Calibration| match supply.is_dense {
        true => calibration.particle_steps_per_second_dense,
        false => calibration.particle_steps_per_second_dilute,
    };
    let threads = calibration.map_or_else(
        || "no calibration on this computer".to_owned(),
        |calibration| format!("calibrated on this computer with {} threads", calibration.threads),
    );
    let checkpoint = if scene.start_checkpoint.is_some() {
        "; what a checkpoint or a stored stream brings is not counted"
    } else {
        ""
    };
    CostForecast {
        particles: supply.particles(),
        feeds: supply.feeds.clone(),
        steps,
        particle_steps,
        memory_bytes: calibration.map(|c| c.base_bytes + c.bytes_per_particle * supply.particles()),
        wall_s: calibration.map(|calibration| particle_steps / rate(&calibration)),
        basis: format!("{}; {threads}; particles that leave counted to the end{checkpoint}", supply.dense_reason),
    }
}
