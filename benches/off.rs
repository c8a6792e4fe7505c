//! What is off costs nothing: for each model that a plan can switch, the time of a step with it on, with it off in a scene that could
//! have it, and in a scene that never had it.
//!
//! The simulations of a model are stepped in turn, a few steps each, so that whatever else the computer does meets all of them.
//! `cargo bench --bench off` prints the ratios off / never and on / never, and fails where off costs something; `-- NAME` takes one.
#![expect(clippy::print_stdout, reason = "a program for the terminal")]

use rustix::time::{ClockId, clock_gettime};
use std::path::Path;
use std::process::ExitCode;
use tollgate::backend::native::processor::Processor;
use tollgate::backend::native::setup::setup;
use tollgate::dem::simulation::Simulation;
use tollgate::math::{Vec3, vec3};
use tollgate::particle::{ParticleId, ParticleState};
use tollgate::plan::plan;
use tollgate::scene::read_text;

/// A box of soft grains without anything that can be switched.
const PLAIN: &str = r#"
version = 1
[domain]
min_mm = [0, 0, 0]
max_mm = [104, 104, 160]
BOUNDARY
[contact]
law = "hertz-mindlin"
CONTACT
[material.grain]
density = "2500 kg/m3"
youngs_modulus = "5 MPa"
poissons_ratio = 0.45
[[pair]]
between = ["grain", "grain"]
restitution = 0.3
PAIR
[particle.bead]
material = "grain"
diameter = { uniform_mm = [3, 5] }
[[feed]]
name = "beads"
kind = "fill"
particle = "bead"
region = { shape = "box", min_mm = [10, 10, 10], max_mm = [90, 90, 90] }
amount = 100
[[part]]
name = "floor"
material = "grain"
shape = "plane"
point_mm = [0, 0, 0]
normal = [0, 0, 1]
WALLS
[solver]
timestep = "20 us"
skin = "0.8 mm"
overlap_limit = 0.5
MODELS
[end]
time = "200 s"
FURTHER
"#;

/// Four sides of the box, unless the borders are periodic.
const WALLS: &str = r#"
[[part]]
name = "left"
material = "grain"
shape = "plane"
point_mm = [1, 0, 0]
normal = [1, 0, 0]
[[part]]
name = "right"
material = "grain"
shape = "plane"
point_mm = [103, 0, 0]
normal = [-1, 0, 0]
[[part]]
name = "front"
material = "grain"
shape = "plane"
point_mm = [0, 1, 0]
normal = [0, 1, 0]
[[part]]
name = "back"
material = "grain"
shape = "plane"
point_mm = [0, 103, 0]
normal = [0, -1, 0]
"#;

/// What takes the places of the words in capitals; a place that is not named stays empty, but for the walls.
type Filling = &'static [(&'static str, &'static str)];

/// A model and three scenes that differ in it.
struct Case {
    name: &'static str,
    on: Filling,
    /// It could be on: the scene has all it needs, but for one word or one particle.
    off: Filling,
    never: Filling,
}

const FRICTION: (&str, &str) = ("PAIR", "friction = 0.5");
const ROLLING: [(&str, &str); 2] =
    [("PAIR", "friction = 0.5\nrolling_friction = 0.05"), ("CONTACT", "rolling = \"cdt\"")];
const ENERGY: (&str, &str) = ("FURTHER", "[output]\nenergy = true");

/// A box above the bed, which touches nobody, with `$more` keys.
macro_rules! paddle {
    ($more:literal) => {
        (
            "FURTHER",
            concat!(
                "[[part]]\nname = \"paddle\"\nmaterial = \"grain\"\nshape = \"box\"\nmin_mm = [40, 40, 150]\nmax_mm = [60, 60, 155]\n",
                $more
            ),
        )
    };
}

/// A second material with constants of its own, and `$more`.
macro_rules! ore {
    ($more:literal) => {
        (
            "FURTHER",
            concat!(
                "[material.ore]\ndensity = \"2500 kg/m3\"\nyoungs_modulus = \"5 MPa\"\npoissons_ratio = 0.45\n",
                "[[pair]]\nbetween = [\"ore\", \"ore\"]\nrestitution = 0.4\nfriction = 0.4\n",
                "[[pair]]\nbetween = [\"ore\", \"grain\"]\nrestitution = 0.3\nfriction = 0.5\n",
                "[particle.ore]\nmaterial = \"ore\"\ndiameter_mm = 4\n",
                $more
            ),
        )
    };
}

const CASES: [Case; 8] = [
    Case {
        name: "sliding_friction",
        on: &[FRICTION],
        off: &[FRICTION, ("MODELS", "models = { sliding_friction = false }")],
        never: &[("PAIR", "friction = 0")],
    },
    Case {
        name: "rolling_resistance",
        on: &ROLLING,
        off: &[ROLLING[0], ROLLING[1], ("MODELS", "models = { rolling_resistance = false }")],
        never: &[FRICTION],
    },
    Case {
        name: "energy_budget",
        on: &[FRICTION, ENERGY],
        off: &[FRICTION, ENERGY, ("MODELS", "models = { energy_budget = false }")],
        never: &[FRICTION],
    },
    Case {
        name: "tangential_damping",
        on: &[FRICTION],
        off: &[FRICTION, ("MODELS", "models = { tangential_damping = false }")],
        never: &[FRICTION, ("CONTACT", "tangential_damping = false")],
    },
    Case {
        name: "moving_walls",
        on: &[
            FRICTION,
            paddle!("motion = [{ kind = \"oscillate\", amplitude_mm = [1, 0, 0], frequency = \"10 Hz\" }]"),
        ],
        off: &[FRICTION, paddle!("")],
        never: &[FRICTION],
    },
    Case {
        name: "part_events",
        on: &[FRICTION, paddle!("disappears = \"100 s\"")],
        off: &[FRICTION, paddle!("appears = \"100 s\"")],
        never: &[FRICTION],
    },
    Case {
        name: "periodic_borders",
        on: &[FRICTION, ("BOUNDARY", "boundary = { x = \"periodic\", y = \"periodic\" }"), ("WALLS", "")],
        off: &[FRICTION, ("BOUNDARY", "boundary = { x = \"open\", y = \"open\" }")],
        never: &[FRICTION],
    },
    Case {
        name: "material_table",
        on: &[
            FRICTION,
            ore!(
                "[[feed]]\nname = \"ore\"\nkind = \"fill\"\nparticle = \"ore\"\nregion = { shape = \"box\", min_mm = [10, 10, 100], max_mm = [90, 90, 130] }\namount = 10\n"
            ),
        ],
        off: &[FRICTION, ore!("")],
        never: &[FRICTION],
    },
];

/// A simulation of the scene, with these particles in place of what its feeds bring; those of a second feed's material are one in two.
fn simulation(filling: Filling, particles: &[ParticleState]) -> Simulation {
    let mut text = PLAIN.to_owned();
    for place in ["BOUNDARY", "CONTACT", "PAIR", "WALLS", "MODELS", "FURTHER"] {
        let unnamed = if place == "WALLS" { WALLS } else { "" };
        let filled = filling.iter().find(|(name, _)| *name == place).map_or(unnamed, |(_, text)| *text);
        text = text.replacen(place, filled, 1);
    }
    let (scene, _) =
        read_text(&text, "off.toml", Path::new("."), &[]).unwrap_or_else(|found| panic!("{found:?}\n{text}"));
    let mut setup = setup(&scene, &plan(&scene, None), Processor::new(Some(1), None));
    let materials = setup.feeds.len() as u64;
    setup.feeds.clear();
    let mut simulation = Simulation::new(setup);
    let states: Vec<ParticleState> = particles
        .iter()
        .map(|state| ParticleState { material: (state.id.serial() % materials) as u16, ..*state })
        .collect();
    simulation.insert(&states);
    simulation
}

/// Spheres of 3 to 5 mm, loosely stacked, then settled: all simulations begin here.
fn bed() -> Vec<ParticleState> {
    const SIDE: u64 = 20;
    const LAYERS: u64 = 24;
    let loose: Vec<ParticleState> = (0..SIDE * SIDE * LAYERS)
        .map(|serial| {
            let cell = [serial % SIDE, serial / SIDE % SIDE, serial / (SIDE * SIDE)].map(|n| n as f64 + 0.5);
            ParticleState {
                id: ParticleId::new(0, serial),
                material: 0,
                radius: 1.5e-3 + 0.25e-3 * (serial * 7 % 5) as f64,
                density: 2500.0,
                position: vec3(1.5e-3, 1.5e-3, 0.0) + Vec3::from(cell) * 5.05e-3,
                velocity: vec3((serial % 7) as f64 - 3.0, (serial % 11) as f64 - 5.0, 0.0) * 0.01,
                spin: Vec3::zeros(),
            }
        })
        .collect();
    let mut simulation = simulation(&[FRICTION], &loose);
    for _ in 0..6000 {
        simulation.step().expect("a stable bed");
    }
    simulation.particles()
}

/// Processor time of this thread [s]: who else computes does not count, but for the memory shared with him.
fn processor_time() -> f64 {
    let time = clock_gettime(ClockId::ThreadCPUTime);
    time.tv_sec as f64 + 1e-9 * time.tv_nsec as f64
}

fn timed_steps(simulation: &mut Simulation) -> f64 {
    const STEPS: u32 = 40;
    let started = processor_time();
    for _ in 0..STEPS {
        simulation.step().expect("a stable bed");
    }
    processor_time() - started
}

/// Median of some ratios, and its standard error by their median deviation: sqrt(pi / 2) 1.4826 MAD / sqrt(n), for normal ones.
#[derive(Clone, Copy)]
struct Ratio {
    median: f64,
    error: f64,
}

impl Ratio {
    fn of(times: &[f64], base: &[f64]) -> Self {
        let ratios: Vec<f64> = times.iter().zip(base).map(|(time, base)| time / base).collect();
        let middle = median(ratios.clone());
        let deviation = median(ratios.iter().map(|ratio| (ratio - middle).abs()).collect());
        let error = (std::f64::consts::FRAC_PI_2).sqrt() * 1.4826 * deviation / (ratios.len() as f64).sqrt();
        Self { median: middle, error }
    }
}

fn median(mut values: Vec<f64>) -> f64 {
    values.sort_by(f64::total_cmp);
    let half = values.len() / 2;
    if values.len().is_multiple_of(2) { 0.5 * (values[half - 1] + values[half]) } else { values[half] }
}

/// Ratios of a step's time to that of the scene that never had the model: on, off, and the very same scene once more.
fn measure(case: &Case, particles: &[ParticleState]) -> [Ratio; 3] {
    const ROUNDS: usize = 24;
    let mut all = [case.on, case.off, case.never, case.never].map(|filling| simulation(filling, particles));
    for simulation in &mut all {
        timed_steps(simulation);
    }
    let mut times = [(); 4].map(|()| Vec::with_capacity(ROUNDS));
    for round in 0..ROUNDS {
        for turn in 0..all.len() {
            let which = (round + turn) % all.len();
            times[which].push(timed_steps(&mut all[which]));
        }
    }
    let [on, off, never, again] = &times;
    [on, off, again].map(|times| Ratio::of(times, never))
}

fn main() -> ExitCode {
    let wanted: Vec<String> = std::env::args().skip(1).filter(|word| !word.starts_with('-')).collect();
    let chosen =
        CASES.iter().filter(|case| wanted.is_empty() || wanted.iter().any(|word| case.name.contains(word.as_str())));
    let particles = bed();
    let measured: Vec<(&Case, [Ratio; 3])> = chosen.map(|case| (case, measure(case, &particles))).collect();
    // The same scene twice differs by where its lists happen to lie in memory: nothing smaller can be told.
    let unlike = measured.iter().map(|(_, [.., again])| (again.median - 1.0).abs()).fold(0.0, f64::max);
    println!(
        "{} particles; processor time of a step over that of a scene that never had the model, +- standard error",
        particles.len()
    );
    println!("{:<20} {:>17} {:>17} {:>17} {:>8}", "model", "on", "off", "never, again", "bound");
    let mut fails = false;
    for (case, [on, off, again]) in measured {
        let bound = 1.0 + unlike + 3.0 * off.error;
        let verdict = if off.median <= bound { "pass" } else { "FAIL" };
        fails |= off.median > bound;
        let shown = [on, off, again].map(|ratio| format!("{:.4} +- {:.4}", ratio.median, ratio.error));
        println!("{:<20} {:>17} {:>17} {:>17} {bound:>8.4}  {verdict}", case.name, shown[0], shown[1], shown[2]);
    }
    if fails { ExitCode::FAILURE } else { ExitCode::SUCCESS }
}
