//! Whether the codes computed the same thing: sums over the last states of their long runs, all counted by one function.

use crate::code::{Code, Conventions, Job, last_state};
use crate::mesh::OUTLET;
use crate::rounds::{Plan, Series};
use crate::scene::Scene;
use crate::state::{Measures, measure};
use std::collections::BTreeMap;
use std::path::Path;

/// Contacts and overlaps are sums over many contacts, that differ by those about to open or close; the laws of damping differ too.
const STATIC_TOLERANCE: f64 = 0.02;
/// Of a few contacts more is chance: so many standard deviations of the difference of two counts, sqrt(2 / n) each.
const DEVIATIONS: f64 = 3.0;
/// A bed is chaotic: what rattles makes its kinetic energy, and runs that differ by one sphere moved by a nanometre differ by some
/// per cent.
const KINETIC_TOLERANCE: f64 = 0.05;
/// Spheres that are through the outlet in one code and not in the other, by the same chaos.
const STRAYS: f64 = 5.0;

/// A compared sum.
#[derive(Debug, Clone, Copy)]
pub struct Row {
    pub what: &'static str,
    pub ours: f64,
    pub theirs: f64,
    pub tolerance: f64,
}

/// A code with a number of threads against tollgate with one.
#[derive(Debug, Clone)]
pub struct Check {
    pub code: Code,
    pub threads: u32,
    pub steps: u64,
    pub rows: Vec<Row>,
}

#[derive(Debug, Clone, Copy)]
struct Sums {
    of_contacts: Measures,
    below_outlet: f64,
}

impl Row {
    pub fn difference(&self) -> f64 {
        self.theirs / self.ours - 1.0
    }

    pub fn holds(&self) -> bool {
        self.difference().abs() <= self.tolerance
    }
}

impl Check {
    pub fn holds(&self) -> bool {
        self.rows.iter().all(Row::holds)
    }
}

/// Checks everything that was measured; tollgate is run again where a code made another number of steps or has conventions that can
/// be followed: with LIGGGHTS' half-step velocities and cap, spins in the cloud are 11 % lower, and big spheres on small ones
/// rattle 20 % more.
pub fn check(scene: &Scene, count: usize, plan: &Plan, measured: &[Series]) -> Vec<Check> {
    let mut ours: BTreeMap<(u64, Conventions), Sums> = BTreeMap::new();
    let reference = measured.iter().find(|series| series.code == Code::Tollgate);
    if let Some(series) = reference {
        ours.insert((series.steps.long, Conventions::Tollgate), sums(&series.state));
    }
    let is_reference = |series: &Series| reference.is_some_and(|own| std::ptr::eq(own, series));
    let others = measured.iter().filter(|series| !is_reference(series));
    let compared = others.map(|series| {
        let steps = series.steps.long;
        let conventions = series.code.conventions();
        let ours = *ours.entry((steps, conventions)).or_insert_with(|| {
            let job = Job { scene, tollgate: &plan.tollgate, steps, threads: 1, count, conventions };
            sums(&Code::Tollgate.run(&job).1)
        });
        let rows = rows(scene, series.code, &ours, &sums(&series.state));
        Check { code: series.code, threads: series.threads, steps, rows }
    });
    compared.collect()
}

fn rows(scene: &Scene, code: Code, ours: &Sums, theirs: &Sums) -> Vec<Row> {
    let chance = DEVIATIONS * (2.0 / ours.of_contacts.contacts).sqrt();
    let fixed = STATIC_TOLERANCE.max(chance);
    // tollgate's own result is the same for any number of threads and any instruction set
    let share = if code.is_ours() { 0.0 } else { 1.0 };
    let row = |what, value: fn(&Sums) -> f64, tolerance: f64| {
        let (ours, theirs) = (value(ours), value(theirs));
        Row { what, ours, theirs, tolerance: share * tolerance }
    };
    let mut rows = vec![
        row("contacts [-]", |s| s.of_contacts.contacts, fixed),
        row("mean overlap [m]", |s| s.of_contacts.mean_overlap, fixed),
    ];
    if code.has_our_law() {
        rows.push(row("kinetic energy of the centres [J]", |s| s.of_contacts.kinetic_energy, KINETIC_TOLERANCE));
        rows.push(row("kinetic energy of the spins [J]", |s| s.of_contacts.rotational_energy, KINETIC_TOLERANCE));
    }
    if scene.has_machine() {
        rows.push(row("below the outlet [-]", |s| s.below_outlet, KINETIC_TOLERANCE.max(STRAYS / ours.below_outlet)));
    }
    rows
}

fn sums(state: &Path) -> Sums {
    let states = last_state(state);
    let below_outlet = states.iter().filter(|state| state.position.z < OUTLET).count() as f64;
    Sums { of_contacts: measure(&states), below_outlet }
}
