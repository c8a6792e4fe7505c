//! A dense bed against LIGGGHTS: same start state, same time step, same laws, 5000 steps.
//!
//! A dense bed is chaotic, so single particles cannot be compared; sums over the bed can.
#![expect(clippy::unwrap_used, reason = "a test fails by panicking")]

#[path = "liggghts_bed/bed.rs"]
mod bed;
#[path = "liggghts_bed/native.rs"]
mod native;
#[path = "liggghts_bed/state.rs"]
mod state;

use bed::Bed;
use state::{Measures, measure};
use std::fmt::Write as _;
use tollgate::math::vec3;
use tollgate::particle::ParticleState;

const STEPS: u64 = 5000;
/// Contacts and mean overlap are sums over 50 000 contacts: what differs is a few contacts about to open or close.
const STATIC_TOLERANCE: f64 = 3e-3;
/// Kinetic energy of a bed almost at rest: a few rattling spheres make it, hence also the scatter of kicked runs.
const KINETIC_TOLERANCE: f64 = 0.05;

/// Name, value and tolerance of a compared sum.
type Row = (&'static str, fn(&Measures) -> f64, f64);

/// Both codes' results from one start state.
struct Comparison {
    bed: Bed,
    start: Measures,
    liggghts: Measures,
    tollgate: Measures,
    /// Largest deviation of kinetic energy among kicked runs [-]; `None` where nobody needed to ask.
    scatter: Option<f64>,
}

fn compare(bed: Bed, always_kick: bool) -> Comparison {
    let start = bed.start();
    // LIGGGHTS runs in its own process meanwhile
    let liggghts = std::thread::spawn(move || bed.run_liggghts(STEPS).0);
    let ours = native::run(&bed, &start, STEPS, 1);
    let liggghts = liggghts.join().unwrap();
    assert_eq!((liggghts.len(), ours.len()), (bed.count, bed.count), "particles were lost");
    let (liggghts, tollgate) = (measure(&liggghts), measure(&ours));
    let apart = (tollgate.kinetic_energy / liggghts.kinetic_energy - 1.0).abs();
    let scatter = (always_kick || apart > KINETIC_TOLERANCE).then(|| scatter(&bed, &start, &tollgate));
    Comparison { bed, start: measure(&start), liggghts, tollgate, scatter }
}

/// Largest relative deviation of the kinetic energy in five runs, each with one sphere kicked by 1 nm/s.
fn scatter(bed: &Bed, start: &[ParticleState], plain: &Measures) -> f64 {
    let kicked = (1..=5_usize).map(|run| {
        let mut states = start.to_vec();
        let chosen = run * states.len() / 6;
        states[chosen].velocity += vec3(1e-9, 0.0, 0.0);
        measure(&native::run(bed, &states, STEPS, 2)).kinetic_energy
    });
    kicked.map(|energy| (energy / plain.kinetic_energy - 1.0).abs()).fold(0.0, f64::max)
}

impl Comparison {
    fn rows(&self) -> [Row; 4] {
        let kinetic = KINETIC_TOLERANCE.max(self.scatter.unwrap_or(0.0));
        [
            ("contacts between spheres [-]", |m| m.contacts, STATIC_TOLERANCE),
            ("mean overlap [m]", |m| m.mean_overlap, STATIC_TOLERANCE),
            ("kinetic energy of the centres [J]", |m| m.kinetic_energy, kinetic),
            ("kinetic energy of the spins [J]", |m| m.rotational_energy, kinetic),
        ]
    }

    fn table(&self) -> String {
        let mut text = format!("{} spheres, {STEPS} steps\n\n", self.bed.count);
        text.push_str(
            "| quantity | start | LIGGGHTS | tollgate | difference | tolerance |\n|---|---|---|---|---|---|\n",
        );
        for (name, value, tolerance) in self.rows() {
            let [start, theirs, ours] = [&self.start, &self.liggghts, &self.tollgate].map(value);
            let difference = 100.0 * (ours / theirs - 1.0);
            let _ = writeln!(
                text,
                "| {name} | {start:.6e} | {theirs:.6e} | {ours:.6e} | {difference:+.3} % | {:.2} % |",
                100.0 * tolerance
            );
        }
        if let Some(scatter) = self.scatter {
            let _ = writeln!(text, "\nScatter of the kinetic energy in five kicked runs: {:.2} %.", 100.0 * scatter);
        }
        text
    }

    fn check(&self) {
        for (name, value, tolerance) in self.rows() {
            let (theirs, ours) = (value(&self.liggghts), value(&self.tollgate));
            assert!((ours / theirs - 1.0).abs() <= tolerance, "{name}\n{}", self.table());
        }
        // a bed that lies, not one that flies: else the tolerances above mean nothing
        let lying = 2.0 * self.start.contacts / self.bed.count as f64;
        assert!(lying > 4.0, "the start state has a coordination number of {lying} only");
    }
}

#[test]
fn twenty_thousand_spheres() {
    let comparison = compare(Bed::TWENTY_THOUSAND, false);
    println!("{}", comparison.table());
    comparison.check();
}

#[test]
#[ignore = "minutes of both codes; run by ./validate with the kicked runs"]
fn hundred_thousand_spheres() {
    let comparison = compare(Bed::HUNDRED_THOUSAND, false);
    println!("{}", comparison.table());
    comparison.check();
}

/// The long version, with the scatter of kicked runs.
#[test]
#[ignore = "many minutes; run by ./validate"]
fn with_kicked_runs() {
    let bed = match std::env::var("BED").as_deref() {
        Ok("20000") => Bed::TWENTY_THOUSAND,
        Ok("100000") | Err(_) => Bed::HUNDRED_THOUSAND,
        Ok(other) => panic!("no bed of {other} spheres"),
    };
    let comparison = compare(bed, true);
    println!("{}", comparison.table());
    comparison.check();
}
