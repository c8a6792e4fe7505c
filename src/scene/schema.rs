//! Every key a scene or a campaign can have, section by section: what the reader asks for, what `docs/scene.md` and
//! `docs/campaign.md` explain.

/// Sections of a scene and their keys. A key that the reader asks for and that is not here is our own bug; the tests find it.
pub(crate) const SECTIONS: &[(&str, &[&str])] = &[
    (
        "scene",
        &[
            "version",
            "title",
            "dimensions",
            "thickness",
            "seed",
            "gravity",
            "start_checkpoint",
            "domain",
            "contact",
            "material",
            "pair",
            "particle",
            "feed",
            "part",
            "solver",
            "end",
            "output",
            "measure",
            "gate",
            "stage",
            "backend",
            "liggghts",
        ],
    ),
    ("domain", &["min", "max", "boundary"]),
    ("domain.boundary", &["x", "y", "z"]),
    (
        "contact",
        &[
            "law",
            "tangential",
            "tangential_damping",
            "attraction",
            "rolling",
            "characteristic_velocity",
            "compatibility",
        ],
    ),
    ("material", &["density", "youngs_modulus", "poissons_ratio"]),
    (
        "pair",
        &[
            "between",
            "restitution",
            "normal_stiffness",
            "tangential_stiffness",
            "normal_damping",
            "tangential_damping",
            "friction",
            "rolling_friction",
        ],
    ),
    ("particle", &["material", "diameter"]),
    ("particle.diameter", &["uniform", "normal", "lognormal", "sieve"]),
    ("particle.diameter.normal", &["mean", "deviation", "minimum", "maximum"]),
    ("particle.diameter.lognormal", &["median", "geometric_deviation", "minimum", "maximum"]),
    ("particle.diameter.sieve", &["by", "sizes", "fractions"]),
    (
        "feed",
        &[
            "name", "kind", "particle", "region", "face", "amount", "rate", "velocity", "start", "until", "interval",
            "file",
        ],
    ),
    ("feed.region", &["shape", "min", "max", "start", "end", "radius", "file", "scale", "place"]),
    ("feed.face", &["shape", "centre", "normal", "radius", "side_a", "side_b"]),
    (
        "part",
        &[
            "name",
            "material",
            "shape",
            "point",
            "normal",
            "min",
            "max",
            "start",
            "end",
            "radius",
            "start_radius",
            "end_radius",
            "file",
            "scale",
            "place",
            "motion",
            "appears",
            "disappears",
        ],
    ),
    ("place", &["move", "rotate"]),
    ("place.rotate", &["axis", "angle", "origin"]),
    (
        "part.motion",
        &["kind", "origin", "axis", "rate", "velocity", "amplitude", "frequency", "phase", "from", "until"],
    ),
    ("trigger", &["at_rest"]),
    ("at_rest", &["speed", "hold", "not_before"]),
    ("solver", &["timestep", "timestep_fraction", "skin", "overlap_limit", "impact_speed", "sleeping", "models"]),
    ("solver.sleeping", &["speed", "hold", "unbalanced"]),
    ("solver.models", &[]),
    ("end", &["time", "at_rest", "empty", "left_count"]),
    ("output", &["frames", "formats", "contacts", "series", "energy", "checkpoints"]),
    ("measure", &["name", "kind", "region", "along", "point", "normal"]),
    ("measure.region", &["min", "max"]),
    ("gate", &["name", "point", "normal", "aperture", "passage", "exclusion", "paths", "returning", "sitting"]),
    ("gate.aperture", &["shape", "radius", "side_a", "side_b"]),
    ("gate.exclusion", &["mode", "length"]),
    ("gate.paths", &["every", "length"]),
    ("stage", &["name", "parts", "feeds", "records", "end", "backend", "replay"]),
    (
        "stage.replay",
        &[
            "gate",
            "stream",
            "path",
            "length",
            "clock",
            "timing",
            "from",
            "until",
            "loops",
            "gap",
            "place",
            "mirror",
            "leaving",
            "backing_up",
            "compliance",
        ],
    ),
    ("stage.replay.mirror", &["point", "normal"]),
    (
        "liggghts",
        &[
            "sample_every",
            "batch_every",
            "contacts",
            "ranks",
            "processors",
            "skin",
            "templates",
            "mpirun",
            "time_limit",
            "keep_samples",
            "lines",
        ],
    ),
    (
        "liggghts.lines",
        &["after_system", "after_materials", "after_walls", "after_integration", "before_run", "after_run"],
    ),
];

/// The site file of a cluster and its keys; `docs/slurm.md` explains them.
pub(crate) const SITE_SECTIONS: &[(&str, &[&str])] = &[(
    "site file",
    &[
        "account",
        "partition",
        "qos",
        "reservation",
        "constraint",
        "modules",
        "setup",
        "launcher",
        "wall_time",
        "signal_lead",
        "memory",
        "cpus",
        "max_array_size",
        "throttle",
        "sbatch",
    ],
)];

/// Keys that never carry a unit.
const WORDS: &[&str] = &[
    "version",
    "title",
    "dimensions",
    "seed",
    "name",
    "kind",
    "shape",
    "file",
    "material",
    "particle",
    "part",
    "pair",
    "feed",
    "measure",
    "solver",
    "output",
    "end",
    "contact",
    "domain",
    "place",
    "move",
    "rotate",
    "motion",
    "region",
    "face",
    "law",
    "by",
    "at_rest",
    "empty",
    "formats",
    "contacts",
    "energy",
    "sleeping",
    "models",
    "between",
    "gate",
    "stage",
    "aperture",
    "passage",
    "exclusion",
    "mode",
    "paths",
    "every",
    "returning",
    "sitting",
    "parts",
    "feeds",
    "records",
    "replay",
    "stream",
    "path",
    "clock",
    "timing",
    "loops",
    "mirror",
    "leaving",
    "backing_up",
    "backend",
    "liggghts",
    "sample_every",
    "batch_every",
    "ranks",
    "processors",
    "templates",
    "mpirun",
    "keep_samples",
    "lines",
    "after_system",
    "after_materials",
    "after_walls",
    "after_integration",
    "before_run",
    "after_run",
    "account",
    "partition",
    "qos",
    "reservation",
    "constraint",
    "modules",
    "setup",
    "launcher",
    "memory",
    "cpus",
    "max_array_size",
    "throttle",
    "sbatch",
];

/// Sections of a campaign and their keys.
pub(crate) const CAMPAIGN_SECTIONS: &[(&str, &[&str])] = &[
    ("campaign", &["version", "title", "scene", "replicates", "whole_runs", "set", "axis", "table", "sample"]),
    ("campaign.axis", &["name", "keys", "unit", "values", "from", "to", "count", "spacing", "zip"]),
    ("campaign.table", &["file", "columns"]),
    ("campaign.table.column", &["keys", "unit"]),
    ("campaign.sample", &["count", "seed", "axis"]),
    ("campaign.sample.axis", &["name", "keys", "unit", "from", "to", "spacing"]),
];

/// True where `section` has `key`.
pub(crate) fn knows(section: &str, key: &str) -> bool {
    SECTIONS
        .iter()
        .chain(CAMPAIGN_SECTIONS)
        .chain(SITE_SECTIONS)
        .any(|(name, keys)| *name == section && keys.contains(&key))
}

/// True where a unit may stand at the end of `key`.
pub(crate) fn is_measured(key: &str) -> bool {
    !WORDS.contains(&key)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_good_scenes_use_every_key() {
        // The reader asserts that it asks for no other key than these; this is the other direction.
        let scenes = concat!(
            include_str!("../../tests/scenes/good/everything.toml"),
            include_str!("../../tests/scenes/good/plane.toml"),
            include_str!("../../tests/scenes/good/gates.toml")
        );
        for (section, keys) in SECTIONS {
            for key in *keys {
                let words = scenes.split(|c: char| !c.is_ascii_alphanumeric() && c != '_');
                let used = words.map(crate::scene::quantity::base_of_key).any(|word| word == *key);
                assert!(used, "no good scene uses `{key}` of [{section}]");
            }
        }
    }

    #[test]
    fn the_pages_name_every_key() {
        let scene = ("docs/scene.md", include_str!("../../docs/scene.md"), SECTIONS);
        let campaign = ("docs/campaign.md", include_str!("../../docs/campaign.md"), CAMPAIGN_SECTIONS);
        for (name, page, sections) in [scene, campaign] {
            for (section, keys) in sections {
                for key in *keys {
                    assert!(page.contains(&format!("`{key}`")), "{name} does not explain `{key}` of [{section}]");
                }
            }
        }
    }
}
