//! A small case by hand, ways to run it, and what the launch says of it.

use std::fs;
use std::path::Path;
use std::process::{Command, Output};
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};
use tollgate::backend::BackendError;
use tollgate::backend::liggghts::launch::{self, Deleted, Event, Finished, Launch, Outcome};
use tollgate::backend::stage::EndReason;
use tollgate::output::progress::Verbosity;

/// Three spheres above a floor; one is below the plane of deletion. Batches of 100 time steps, looks every 20; CASE-SPECIFIC lines
/// are put in by name.
const DECK: &str = "\
# three spheres
atom_style granular
atom_modify map array sort 0 0
boundary f f f
newton off
communicate single vel yes
units si
region box block -0.05 0.05 -0.05 0.05 -0.01 0.1 units box
create_box 1 box
neighbor 0.001 bin
neigh_modify delay 0
fix m1 all property/global youngsModulus peratomtype 5.e6
fix m2 all property/global poissonsRatio peratomtype 0.3
fix m3 all property/global coefficientRestitution peratomtypepair 1 0.4
fix m4 all property/global coefficientFriction peratomtypepair 1 0.5
pair_style gran model hertz tangential history
pair_coeff * *
timestep 1e-5
fix floor all wall/gran model hertz tangential history primitive type 1 zplane 0.0
create_atoms 1 single 0 0 0.01 units box
create_atoms 1 single 0.02 0 0.02 units box
create_atoms 1 single 0.02 0 -0.009 units box
set group all diameter 0.004 density 2500
group active id > 0
fix i active nve/sphere
fix grav all gravity 9.81 vector 0 0 -1
region low block INF INF INF INF INF -0.005
thermo_style custom step atoms ke
thermo 500
thermo_modify lost ignore norm no
# here
variable st equal step
variable n loop BATCHES
label batch
run 100 pre no post no every 20 \"group below region low\"
delete_atoms region low compress no
next n
jump in.liggghts batch
print \"tollgate event lid 0 ${st}\"
print \"tollgate end time ${st}\"
";
/// Where a deck can be changed.
pub const HERE: &str = "# here";
pub const FLOOR: &str = "fix floor all wall/gran model hertz tangential history primitive type 1 zplane 0.0";
/// Batches of a run that nobody waits for: minutes.
pub const ENDLESS: u64 = 100_000_000;

/// The deck for so many batches, with pieces exchanged; every piece must be there.
pub fn deck(batches: u64, changes: &[(&str, &str)]) -> String {
    let mut text = DECK.replace("BATCHES", &batches.to_string());
    for (old, new) in changes {
        assert!(text.contains(old), "{old:?} is not in the deck");
        text = text.replacen(old, new, 1);
    }
    text
}

/// A case with that deck, at the path that the system knows it by.
pub struct Case {
    folder: tempfile::TempDir,
}

impl Case {
    pub fn new(batches: u64, changes: &[(&str, &str)]) -> Self {
        let folder = tempfile::tempdir().unwrap();
        fs::write(folder.path().join("in.liggghts"), deck(batches, changes)).unwrap();
        Self { folder }
    }

    pub fn path(&self) -> &Path {
        self.folder.path()
    }

    /// Processes at work in the case's folder, which those of a case are.
    pub fn processes(&self) -> Vec<i32> {
        processes_in(self.path())
    }

    /// Fails where one is left after a while.
    pub fn assert_deserted(&self) {
        let since = Instant::now();
        while !self.processes().is_empty() {
            assert!(since.elapsed() < Duration::from_secs(5), "left behind: {:?}", self.processes());
            std::thread::sleep(Duration::from_millis(20));
        }
    }
}

/// Numbers of all living processes whose working folder is `folder`. One that has ended has none.
pub fn processes_in(folder: &Path) -> Vec<i32> {
    let place = folder.canonicalize().unwrap();
    let numbers = fs::read_dir("/proc").unwrap().flatten().filter_map(|entry| entry.file_name().to_str()?.parse().ok());
    numbers.filter(|pid: &i32| fs::read_link(format!("/proc/{pid}/cwd")).is_ok_and(|at| at == place)).collect()
}

/// How a case is run in a test.
#[derive(Clone, Copy)]
pub struct Way {
    pub ranks: u32,
    pub steps: u64,
    pub time_limit: f64,
}

pub const SERIAL: Way = Way { ranks: 1, steps: 400, time_limit: 60.0 };

static NEVER: AtomicBool = AtomicBool::new(false);

pub fn launch<'a>(case: &'a Path, way: Way, interrupted: &'a AtomicBool) -> Launch<'a> {
    let Way { ranks, steps, time_limit } = way;
    Launch { case, ranks, mpirun: &[], time_limit, steps, timestep: 1e-5, interrupted, verbosity: Verbosity::Silent }
}

pub fn run(case: &Path, way: Way) -> Result<Outcome, BackendError> {
    launch::run(&launch(case, way, &NEVER), &mut |_| Ok(()))
}

pub fn finished(outcome: Outcome) -> Finished {
    match outcome {
        Outcome::Finished(finished) => finished,
        Outcome::Interrupted(_) => panic!("interrupted"),
    }
}

/// The error of a case that must not come to its end; nothing is left of it.
pub fn error(case: &Case, way: Way) -> BackendError {
    let error = run(case.path(), way).expect_err("this case has a fault");
    case.assert_deserted();
    error
}

const CASE: &str = "TOLLGATE_TEST_CASE";
const RANKS: &str = "TOLLGATE_TEST_RANKS";
const BATCHES: &str = "TOLLGATE_TEST_STEPS";

/// A process of its own that runs a case, for what a process as a whole is asked for: environment, death, exit status.
pub fn in_process(case: &Path, way: Way) -> Command {
    let mut command = Command::new(std::env::current_exe().unwrap());
    command.args(["--ignored", "--exact", "launching::runs_the_case_of_the_environment", "--nocapture"]);
    command.env(CASE, case).env(RANKS, way.ranks.to_string()).env(BATCHES, way.steps.to_string());
    command
}

/// What it wrote on stderr, after a look at its exit status.
pub fn said(output: &Output, code: u8) -> String {
    let text = String::from_utf8_lossy(&output.stderr).into_owned();
    assert_eq!(output.status.code(), Some(code.into()), "{text}");
    text
}

#[test]
#[ignore = "started by other tests as a process of its own"]
fn runs_the_case_of_the_environment() {
    let Some(case) = std::env::var_os(CASE) else { return };
    let number = |name: &str| std::env::var(name).unwrap().parse::<u64>().unwrap();
    let way = Way { ranks: number(RANKS) as u32, steps: number(BATCHES), time_limit: f64::INFINITY };
    let code = match run(Path::new(&case), way) {
        Ok(outcome) => {
            finished(outcome);
            0
        }
        Err(error) => {
            eprintln!("{error}");
            error.exit_code()
        }
    };
    std::process::exit(code.into());
}

fn assert_as_expected(finished: &Finished) {
    assert_eq!((finished.steps, finished.atoms, finished.end), (400, 2, Some(EndReason::Time)));
    assert_eq!(finished.events, [Event { part: "lid".into(), present: false, step: 400 }]);
    // the one that starts below the plane, at the end of the first batch
    assert_eq!(finished.deleted, [Deleted { what: "low".into(), count: 1, step: 100 }]);
    assert_eq!(finished.warnings, [""; 0]);
    assert!(finished.cpu_s.unwrap() > 0.0 && finished.wall_s > 0.0);
    // the program alone has more than 10 MB of code in memory
    assert!(finished.peak_memory_bytes.unwrap() > 10 << 20);
}

#[test]
fn a_case_runs_to_its_end() {
    let case = Case::new(4, &[]);
    assert_as_expected(&finished(run(case.path(), SERIAL).unwrap()));
    case.assert_deserted();
    let screen = fs::read_to_string(case.path().join("screen.txt")).unwrap();
    assert!(screen.contains("Setting up run") && screen.ends_with("tollgate end time 400\n"), "{screen}");
    assert!(fs::read_to_string(case.path().join("log.liggghts")).unwrap().contains("tollgate end time 400"));
}

#[test]
fn a_case_runs_on_two_ranks_and_on_more_than_there_are_cores() {
    let case = Case::new(4, &[]);
    for ranks in [2, 2 * std::thread::available_parallelism().unwrap().get() as u32] {
        assert_as_expected(&finished(run(case.path(), Way { ranks, ..SERIAL }).unwrap()));
        case.assert_deserted();
    }
}

#[test]
fn the_caller_works_while_it_runs() {
    let case = Case::new(6_000, &[]);
    let mut steps = Vec::new();
    let way = Way { steps: 600_000, ..SERIAL };
    let mut each = |step| {
        steps.push(step);
        Ok(())
    };
    finished(launch::run(&launch(case.path(), way, &NEVER), &mut each).unwrap());
    assert!(steps.len() >= 2 && steps.is_sorted() && steps[0] < 600_000, "{steps:?}");
}

#[test]
fn an_error_of_the_callers_ends_the_case() {
    let case = Case::new(ENDLESS, &[]);
    let way = Way { steps: u64::MAX, ..SERIAL };
    let each = &mut |_: u64| Err(BackendError::Incapable("enough".into()));
    let error = launch::run(&launch(case.path(), way, &NEVER), each).unwrap_err();
    assert_eq!(error.to_string(), "enough");
    case.assert_deserted();
}

#[test]
fn an_interrupt_ends_all_ranks() {
    for ranks in [1, 2] {
        let case = Case::new(ENDLESS, &[]);
        let interrupted = AtomicBool::new(false);
        let way = Way { ranks, steps: u64::MAX, ..SERIAL };
        let mut each = |_: u64| {
            assert!(case.processes().len() >= ranks as usize);
            interrupted.store(true, Ordering::Relaxed);
            Ok(())
        };
        let started = Instant::now();
        let outcome = launch::run(&launch(case.path(), way, &interrupted), &mut each).unwrap();
        assert!(matches!(outcome, Outcome::Interrupted(Finished { end: None, steps: 1.., .. })), "{outcome:?}");
        assert!(started.elapsed() < Duration::from_secs(10));
        case.assert_deserted();
    }
}

#[test]
fn a_time_limit_is_kept() {
    let case = Case::new(ENDLESS, &[]);
    let error = error(&case, Way { steps: u64::MAX, time_limit: 0.5, ..SERIAL });
    let text = error.to_string();
    assert!(text.contains("time limit of 0.5 s") && error.exit_code() == 4, "{text}");
    assert!(text.contains(&format!("cd {} && liggghts -in in.liggghts", case.path().display())), "{text}");
}
