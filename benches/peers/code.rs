//! The codes: how each is called, found and started, and the proof that it did what it was asked to.

use crate::commands;
use crate::process::{Cost, timed};
use crate::scene::Scene;
use std::ffi::OsStr;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;
use tollgate::backend::liggghts::probe::find;
use tollgate::math::lanes::SimdLevel;
use tollgate::output::lammps::DumpReader;
use tollgate::particle::{Body, ParticleState};
use tollgate::storage::StorageError;

#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, clap::ValueEnum)]
pub enum Code {
    #[value(skip)]
    Tollgate,
    /// tollgate with `--simd avx2`.
    Avx2,
    Liggghts,
    Lammps,
    Yade,
}

/// One run of a scene.
#[derive(Debug, Clone, Copy)]
pub struct Job<'a> {
    pub scene: &'a Scene,
    /// tollgate's program.
    pub tollgate: &'a Path,
    pub steps: u64,
    pub threads: u32,
    /// Spheres of the start state.
    pub count: usize,
    /// Whose conventions tollgate follows; the others have their own.
    pub conventions: Conventions,
}

/// Conventions of tollgate's laws, as its scenes name them.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Conventions {
    Tollgate,
    Liggghts,
}

impl Job<'_> {
    /// What tollgate is told beside the scene file: keys and values.
    pub fn settings(&self) -> Vec<(String, String)> {
        let mut settings = self.scene.settings(self.steps);
        settings.push(("contact.compatibility".to_owned(), self.conventions.name().to_owned()));
        settings
    }
}

impl Conventions {
    pub const fn name(self) -> &'static str {
        match self {
            Self::Tollgate => "tollgate",
            Self::Liggghts => "liggghts",
        }
    }
}

const YADE_MODULES: &str = "/usr/lib/x86_64-linux-gnu/yade-double/py";

impl Code {
    pub const fn name(self) -> &'static str {
        match self {
            Self::Tollgate => "tollgate",
            Self::Avx2 => "tollgate with AVX2 only",
            Self::Liggghts => "LIGGGHTS",
            Self::Lammps => "LAMMPS",
            Self::Yade => "YADE",
        }
    }

    /// Why it cannot be run with so many threads or ranks, if so.
    pub fn missing(self, threads: u32) -> Option<String> {
        let is_there = |program: &str| find(OsStr::new(program)).is_some();
        let (program, package) = match self {
            Self::Tollgate => return None,
            Self::Avx2 => {
                let missing = !SimdLevel::Avx2.is_available();
                return missing.then(|| format!("{}: this processor has no AVX2", self.name()));
            }
            Self::Liggghts => ("liggghts", "liggghts"),
            Self::Lammps => ("lmp", "lammps"),
            Self::Yade => ("yade", "yade"),
        };
        let has_modules = self != Self::Yade || (is_there(commands::PYTHON) && Path::new(YADE_MODULES).exists());
        if !is_there(program) || !has_modules {
            return Some(format!("{} is missing: apt-get install {package}", self.name()));
        }
        if threads > 1 && self != Self::Yade && !is_there("mpirun") {
            return Some(format!("{} on several ranks: apt-get install openmpi-bin", self.name()));
        }
        None
    }

    /// Conventions with which tollgate is compared with it.
    pub const fn conventions(self) -> Conventions {
        match self {
            Self::Liggghts => Conventions::Liggghts,
            _ => Conventions::Tollgate,
        }
    }

    /// Whether it is tollgate.
    pub const fn is_ours(self) -> bool {
        matches!(self, Self::Tollgate | Self::Avx2)
    }

    /// Whether its law of damping is tollgate's own.
    pub const fn has_our_law(self) -> bool {
        self.is_ours() || matches!(self, Self::Liggghts)
    }

    /// Runs a job, proves that it was done, and tells its cost and where its last state is.
    pub fn run(self, job: &Job) -> (Cost, PathBuf) {
        let folder = job.scene.folder();
        let log = folder.join(format!("{}.log", self.name()));
        let state = folder.join(format!("{}.dump", self.name()));
        drop(fs::remove_file(&state));
        if self.is_ours() {
            let simd = (self == Self::Avx2).then_some(SimdLevel::Avx2);
            return commands::tollgate(job, simd, &folder, &log);
        }
        let mut command = match self {
            Self::Yade => commands::yade(job),
            Self::Lammps => commands::lammps(job),
            _ => commands::liggghts(job),
        };
        let (text, cost) = timed(command.arg(&state).current_dir(&folder), &log);
        let [steps, count] = [job.steps, job.count as u64].map(|number| number.to_string());
        let done = match self {
            Self::Yade => format!("did {steps} steps with {count} spheres"),
            _ => format!("on {} procs for {steps} steps with {count} atoms", job.threads),
        };
        assert!(text.contains(&done), "{}: not \"{done}\" in {}", job.scene.name, log.display());
        (cost, state)
    }

    /// What its program or its last run's log says of its version.
    pub fn version(self, scene: &Scene, tollgate: &Path) -> String {
        if self.is_ours() {
            let output = Command::new(tollgate).arg("--version").output().expect("tollgate says its version");
            return String::from_utf8_lossy(&output.stdout).trim().to_owned();
        }
        let log = scene.folder().join(format!("{}.log", self.name()));
        let text = fs::read_to_string(&log).unwrap_or_default();
        let (before, after) = match self {
            Self::Liggghts => ("(Version LIGGGHTS-PUBLIC ", ","),
            Self::Lammps => ("LAMMPS (", ")\n"),
            _ => ("YADE ", " did"),
        };
        let version = text.split_once(before).and_then(|(_, rest)| rest.split_once(after)).map(|(version, _)| version);
        format!("{} {}", self.name(), version.unwrap_or("of unknown version"))
    }
}

/// The last state in a dump, whoever wrote it.
pub fn last_state(path: &Path) -> Vec<ParticleState> {
    let read = || {
        let mut reader = DumpReader::open(path)?;
        let mut states = Vec::new();
        while reader.next_frame()?.is_some() {
            states = reader.particles(&Body::Sphere)?;
        }
        Ok::<_, StorageError>(states)
    };
    read().unwrap_or_else(|error| panic!("{}: {error:?}", path.display()))
}
