//! The scenes: boxes of spheres and a hopper, each with its time step, its numbers of steps and the settings of every code.

use crate::bed::Bed;
use crate::code::Code;
use std::path::{Path, PathBuf};
use tollgate::math::{Vec3, vec3};

/// Numbers of steps of the short and of the long run.
#[derive(Debug, Clone, Copy)]
pub struct Steps {
    pub short: u64,
    pub long: u64,
}

/// Where the start state comes from.
#[derive(Debug, Clone, Copy)]
pub enum Start {
    /// A bed that LIGGGHTS settles, the one of the tests.
    Bed(Bed),
    /// Such a bed so many times along x and y, without walls between.
    Tiles(Bed, [u32; 2]),
    /// A dilute cloud.
    Cloud,
    /// Big spheres bedded in small ones.
    TwoSizes,
    /// A full hopper.
    Hopper,
}

#[derive(Debug, Clone, Copy)]
pub struct Scene {
    pub name: &'static str,
    /// What it is, for the page.
    pub about: &'static str,
    pub start: Start,
    /// Box [m], one corner at the origin.
    pub size: [f64; 3],
    /// Direction of gravity, of any length.
    pub down: [f64; 3],
    /// [us]
    pub timestep: f64,
    /// Of tollgate, LIGGGHTS and LAMMPS.
    pub steps: Steps,
    /// Of YADE, which is ten times slower.
    pub yade_steps: Steps,
    /// Neighbour skins of LIGGGHTS and of LAMMPS [m], and which were tried: the fastest in short runs.
    pub skins: [f64; 2],
    pub tried: &'static str,
    /// Bins of LIGGGHTS [m]; 0: its own choice.
    pub bin: f64,
    /// `verletDist` of YADE [m].
    pub yade_skin: f64,
    /// Largest diameters [m] of the small and of all spheres, where there are two sizes far apart.
    pub two_sizes: Option<[f64; 2]>,
    /// Dashpot of LAMMPS over that of the settled bed, see its deck: the same force as LIGGGHTS' at the overlaps and masses here.
    pub dashpot: f64,
    pub peers: &'static [Code],
    /// Too long to be measured unasked.
    pub only_by_name: bool,
}

const DOWN: [f64; 3] = [0.0, 0.0, -1.0];
const ALL: &[Code] = &[Code::Avx2, Code::Liggghts, Code::Lammps, Code::Yade];
const BED_20K: Scene = Scene {
    name: "settled-bed-20k",
    about: "20 000 spheres of 3 to 5 mm, settled in a closed box, 5 contacts each",
    start: Start::Bed(Bed::TWENTY_THOUSAND),
    size: [0.100, 0.100, 0.280],
    down: DOWN,
    timestep: 10.0,
    steps: Steps { short: 500, long: 3500 },
    yade_steps: Steps { short: 50, long: 350 },
    skins: [0.3e-3, 0.3e-3],
    tried: "both 0.2, 0.3, 0.5 and 0.8 mm",
    bin: 0.0,
    yade_skin: 1e-4,
    two_sizes: None,
    dashpot: 1.0,
    peers: ALL,
    only_by_name: false,
};

pub const SCENES: [Scene; 7] = [
    BED_20K,
    Scene {
        name: "settled-bed-100k",
        about: "100 000 spheres of 3 to 5 mm, settled in a closed box, 5 contacts each",
        start: Start::Bed(Bed::HUNDRED_THOUSAND),
        size: [0.170, 0.170, 0.480],
        steps: Steps { short: 100, long: 1100 },
        yade_steps: Steps { short: 20, long: 120 },
        ..BED_20K
    },
    Scene {
        name: "settled-bed-1m",
        about: "ten of the beds of 100 000 side by side, five along x and two along y, without walls between; joined by 1000 steps",
        start: Start::Tiles(Bed::HUNDRED_THOUSAND, [5, 2]),
        size: [0.850, 0.340, 0.480],
        steps: Steps { short: 20, long: 320 },
        peers: &[Code::Avx2, Code::Liggghts],
        only_by_name: true,
        ..BED_20K
    },
    Scene {
        name: "dilute",
        about: "20 000 spheres of 3 to 5 mm in a closed cube, 2 % of its volume, at random speeds of 0.5 m/s a component",
        start: Start::Cloud,
        size: [0.339, 0.339, 0.339],
        steps: Steps { short: 500, long: 8500 },
        yade_steps: Steps { short: 250, long: 2250 },
        skins: [3e-3, 3e-3],
        tried: "both 1, 2, 3 and 4 mm",
        yade_skin: 3e-4,
        dashpot: 0.74, // overlaps of 70 um: (21 / 70)^0.25
        ..BED_20K
    },
    Scene {
        name: "dense-flow",
        about: "the bed of 20 000 with gravity turned to (1, 0, -0.3): it slides and piles up at one side",
        down: [1.0, 0.0, -0.3],
        ..BED_20K
    },
    Scene {
        name: "hopper",
        about: "12 000 spheres of 3 to 5 mm run out of a hopper of 8448 triangles, in which a paddle of 1568 turns with 60 rpm",
        start: Start::Hopper,
        size: [0.140, 0.140, 0.620],
        // Not longer: the small differences between the codes' conventions grow in the flow. After 27 ms mean overlap and kinetic energy
        // differ by 1 %, after 55 ms by 6 and 5 %; there tollgate in LIGGGHTS' conventions has 3.5 % less kinetic energy too.
        steps: Steps { short: 250, long: 2750 },
        peers: &[Code::Avx2, Code::Liggghts],
        tried: "LIGGGHTS 0.3, 0.5 and 0.8 mm, with its own bins and with those of 8.3 mm",
        ..BED_20K
    },
    Scene {
        name: "size-ratio-10",
        about: "20 000 spheres of 2 mm with 27 of 20 mm bedded in them, in a closed box",
        start: Start::TwoSizes,
        size: [0.080, 0.080, 0.200],
        steps: Steps { short: 500, long: 3500 },
        skins: [0.8e-3, 0.3e-3],
        bin: 3.5e-3,
        tried: "LIGGGHTS 0.1 to 1.2 mm with bins of 2 to 20 mm, LAMMPS 0.1, 0.2, 0.3 and 0.5 mm",
        // Small ones would have 4.8. But it grows with the overlap, and is then too stiff for this time step where big ones lie on
        // small ones: kinetic energy is made. Of 0.3, 0.5, 1, 2 and 4.8 this one comes nearest to LIGGGHTS' overlaps.
        dashpot: 0.5,
        two_sizes: Some([2.1e-3, 20.1e-3]),
        ..BED_20K
    },
];

impl Scene {
    pub fn size(&self) -> Vec3 {
        vec3(self.size[0], self.size[1], self.size[2])
    }

    /// As text, for it is the text that all codes must round alike.
    pub fn timestep_in_seconds(&self) -> String {
        format!("{}e-6", self.timestep)
    }

    /// Folder of its files under `target/`; survives between runs.
    pub fn folder(&self) -> PathBuf {
        root().join("target/peers").join(self.name)
    }

    /// The scene file of tollgate.
    pub fn deck(&self) -> PathBuf {
        deck(if self.has_machine() { "hopper.toml" } else { "box.toml" })
    }

    /// Whether there are meshes.
    pub fn has_machine(&self) -> bool {
        matches!(self.start, Start::Hopper)
    }

    /// Steps of a code, shortened to a share of their number.
    pub fn steps_of(&self, code: Code, share: f64) -> Steps {
        let full = if code == Code::Yade { self.yade_steps } else { self.steps };
        let shortened = |steps: u64| ((steps as f64 * share).round() as u64).max(1);
        Steps { short: shortened(full.short), long: shortened(full.long).max(shortened(full.short) + 1) }
    }

    /// What tollgate is told beside the scene file: keys and values.
    pub fn settings(&self, steps: u64) -> Vec<(String, String)> {
        let end = format!("\"{} us\"", self.timestep * steps as f64);
        let mut settings = vec![
            ("solver.timestep".to_owned(), format!("\"{} us\"", self.timestep)),
            ("end.time".to_owned(), end.clone()),
            ("output".to_owned(), format!("{{ formats = [\"lammps\"], series = {end} }}")),
        ];
        if !self.has_machine() {
            settings.extend(self.box_settings());
        }
        settings
    }

    fn box_settings(&self) -> Vec<(String, String)> {
        let vector = |v: [f64; 3], unit: &str| {
            format!("[{}]", v.map(|component| format!("\"{component:?} {unit}\"")).join(", "))
        };
        let direction = vec3(self.down[0], self.down[1], self.down[2]).normalize() * 9.81;
        let corner = vector(self.size, "m");
        let mut settings =
            vec![("gravity".to_owned(), vector(direction.into(), "m/s2")), ("domain.max".to_owned(), corner.clone())];
        settings.extend(["right", "back", "lid"].map(|part| (format!("part.{part}.point"), corner.clone())));
        settings
    }
}

/// The repository.
pub fn root() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR"))
}

/// A deck beside this file.
pub fn deck(name: &str) -> PathBuf {
    root().join("benches/peers/decks").join(name)
}
