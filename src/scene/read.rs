//! From a file to a scene, or to everything that is wrong with it.

use super::diagnostics::{Finding, Place, Report, Severity};
use super::meshes::Meshes;
use super::resolve::{Draft, resolve};
use super::{Domain, MeasureKind, Scene, extent, rules, tree};
use crate::material::MaterialTable;
use crate::math::Bounds;
use std::path::{Path, PathBuf};

/// A scene file in a folder.
const FILE: &str = "scene.toml";
/// Scenes are written by hand; what is larger than this [bytes] is something else.
const LARGEST: u64 = 16 << 20;

/// Reads a scene: `path` is its file, or a folder that holds `scene.toml`. `settings` are overrides: dotted key, value
/// (TOML, or else a string); elements of arrays go by their name, pairs by `a-b`, others by their number from 0.
///
/// # Errors
/// All findings, if any of them is an error; a valid scene comes with its warnings.
pub fn read(path: &Path, settings: &[(String, String)]) -> Result<(Scene, Vec<Finding>), Vec<Finding>> {
    Source::open(path)?.resolve(settings)
}

/// Reads a scene from its text. `file` is what findings call it; files that the scene names are looked for in `base`.
///
/// # Errors
/// All findings, if any of them is an error; a valid scene comes with its warnings.
pub fn read_text(
    text: &str,
    file: &str,
    base: &Path,
    settings: &[(String, String)],
) -> Result<(Scene, Vec<Finding>), Vec<Finding>> {
    Source::of_text(text.to_owned(), file, base)?.resolve(settings)
}

/// A scene file that is read once and resolved under as many settings as one likes; files that it names are read once, too.
#[derive(Debug)]
pub struct Source {
    file: String,
    base: PathBuf,
    text: String,
    root: tree::Table,
    meshes: Meshes,
}

impl Source {
    /// Reads the file: `path` itself, or the `scene.toml` in that folder.
    ///
    /// # Errors
    /// When it cannot be read, or is no TOML.
    pub fn open(path: &Path) -> Result<Self, Vec<Finding>> {
        let file = if path.is_dir() { path.join(FILE) } else { path.to_owned() };
        let shown = file.display().to_string();
        let text = match std::fs::metadata(&file) {
            Ok(found) if !found.is_file() => Err("it is no file".to_owned()),
            Ok(found) if found.len() > LARGEST => Err(format!("it has {} bytes, more than any scene", found.len())),
            Ok(_) => std::fs::read_to_string(&file).map_err(|error| error.to_string()),
            Err(error) => Err(error.to_string()),
        };
        match text {
            Ok(text) => Self::of_text(text, &shown, file.parent().unwrap_or(Path::new(""))),
            Err(reason) => {
                let report = Report::new(&shown, "");
                report.error(
                    "file-unreadable",
                    &Place::in_file(0..0),
                    format!("the scene \"{shown}\" cannot be read: {reason}"),
                    "name a scene file, or a folder that holds a scene.toml; `tollgate init` writes one",
                );
                Err(report.into_findings())
            }
        }
    }

    fn of_text(text: String, file: &str, base: &Path) -> Result<Self, Vec<Finding>> {
        let report = Report::new(file, &text);
        let root = tree::parse(&text, &report);
        if !report.is_empty() {
            // What follows a syntax error is anybody's guess.
            return Err(report.into_findings());
        }
        Ok(Self { file: file.to_owned(), base: base.to_owned(), text, root, meshes: Meshes::default() })
    }

    /// The scene under `settings`, as of [`read`].
    ///
    /// # Errors
    /// All findings, if any of them is an error; a valid scene comes with its warnings.
    pub fn resolve(&self, settings: &[(String, String)]) -> Result<(Scene, Vec<Finding>), Vec<Finding>> {
        let report = Report::new(&self.file, &self.text);
        let mut root = self.root.clone();
        for (path, value) in settings {
            tree::set(&mut root, path, value, &report);
        }
        let name = default_name(&self.file, &self.base);
        let draft = resolve(&root, &name, Files { base: &self.base, meshes: &self.meshes }, &report);
        let domain = extent::domain(&draft);
        rules::check(&root, &draft, domain, &self.meshes, &report);
        let findings = report.into_findings();
        if findings.iter().any(|finding| finding.severity == Severity::Error) {
            return Err(findings);
        }
        match assemble(draft, domain) {
            Some(scene) => Ok((scene, findings)),
            None => unreachable!("a scene without errors resolves as a whole"),
        }
    }
}

/// Files that a scene names.
#[derive(Debug, Clone, Copy)]
pub(super) struct Files<'a> {
    /// Folder that they are named from.
    pub base: &'a Path,
    /// Those that were read already.
    pub meshes: &'a Meshes,
}

/// The folder's name for `scene.toml`, else the file's.
fn default_name(file: &str, base: &Path) -> String {
    let path = Path::new(file);
    let folder = if path.file_name().is_some_and(|name| name == FILE) {
        path.parent().and_then(Path::file_name).or_else(|| base.file_name())
    } else {
        None
    };
    folder.or_else(|| path.file_stem()).map_or_else(|| "scene".to_owned(), |name| name.to_string_lossy().into_owned())
}

fn assemble(draft: Draft, domain: Domain) -> Option<Scene> {
    let mut materials = MaterialTable::new(draft.materials);
    for pair in &draft.pairs {
        materials.set_pair(pair.item.a, pair.item.b, pair.item.properties?);
    }
    let measures = draft.measures.into_iter().map(|measure| {
        let mut measure = measure.item.measure;
        within(&mut measure.kind, &domain.bounds);
        measure
    });
    Some(Scene {
        name: draft.name,
        seed: draft.seed,
        body: draft.body,
        gravity: draft.gravity,
        domain,
        materials,
        law: draft.law?,
        classes: draft.classes.into_iter().map(|class| class.item).collect::<Option<_>>()?,
        feeds: draft.feeds.into_iter().map(|feed| feed.item).collect(),
        parts: draft.parts.into_iter().map(|part| part.item.part).collect(),
        solver: draft.solver,
        end: draft.end?,
        output: draft.output,
        measures: measures.collect(),
        gates: draft.gates.into_iter().map(|gate| gate.item).collect(),
        stages: draft.stages.stages.into_iter().map(|stage| stage.item).collect(),
        backend: draft.backend,
        liggghts: draft.liggghts,
        start_checkpoint: draft.start_checkpoint,
    })
}

/// Puts the domain where a measure has no region of its own.
fn within(kind: &mut MeasureKind, domain: &Bounds) {
    match kind {
        MeasureKind::AngleOfRepose { region, .. }
        | MeasureKind::CoordinationNumber { region }
        | MeasureKind::SolidFraction { region }
        | MeasureKind::CentreOfMass { region }
        | MeasureKind::SizeDistribution { region } => {
            if region.is_empty() {
                *region = *domain;
            }
        }
        MeasureKind::MassFlowRate { .. } => {}
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::dem::feed::{Amount, FeedKind, Rate, Region};
    use crate::geometry::motion::MotionKind;
    use crate::geometry::part::{Surface, Trigger};
    use crate::geometry::plane::Aperture;
    use crate::material::PairContact;
    use crate::math::vec3;
    use crate::particle::{Body, SizeDistribution};
    use crate::scene::gate::{
        BackingUp, Clock, ExclusionMode, Fate, PassingPoint, PathMode, StreamSource, Timing, Transform,
    };
    use proptest::prelude::*;
    use std::f64::consts::PI;

    const EVERYTHING: &str = include_str!("../../tests/scenes/good/everything.toml");
    const PLANE: &str = include_str!("../../tests/scenes/good/plane.toml");
    const GATES: &str = include_str!("../../tests/scenes/good/gates.toml");
    const DEFAULT: &str = include_str!("../../templates/scene.default.toml");

    fn base() -> &'static Path {
        Path::new("tests/scenes/good")
    }

    fn everything(settings: &[(&str, &str)]) -> Scene {
        let settings: Vec<_> = settings.iter().map(|(key, value)| ((*key).to_owned(), (*value).to_owned())).collect();
        match read_text(EVERYTHING, "everything.toml", base(), &settings) {
            Ok((scene, _)) => scene,
            Err(findings) => panic!("{}", super::super::diagnostics::render(&findings, EVERYTHING)),
        }
    }

    fn close(a: f64, b: f64) {
        // Conversions round a few times.
        assert!((a - b).abs() <= 1e-12 * b.abs().max(1e-3), "{a}, not {b}");
    }

    #[test]
    fn values_arrive_in_si() {
        let scene = everything(&[]);
        assert_eq!((scene.name.as_str(), scene.seed, scene.body), ("everything", 42, Body::Sphere));
        assert_eq!(scene.domain.periodic, [true, false, false]);
        assert_eq!(scene.domain.bounds.maximum, [0.5; 3]);
        close(scene.gravity.z, -9.81);
        close(scene.law.characteristic_velocity, 1.5);
        assert_eq!(scene.materials.materials[0].density, Some(3300.0));
        let ore = scene.materials.pair(0, 0).expect("a pair");
        let PairContact::Stiffness { normal_stiffness, tangential_damping, .. } = ore.contact else {
            panic!("{ore:?}")
        };
        close(normal_stiffness, 1200.0);
        close(tangential_damping, 0.01);
        let wall = scene.materials.pair(0, 1).expect("a pair in either order");
        assert_eq!(wall.contact, PairContact::Restitution { coefficient: 0.5 });
        let SizeDistribution::Sieve { sieves, fractions, .. } = &scene.classes[4].diameter else { panic!("a sieve") };
        close(sieves[3], 8e-3);
        assert_eq!(fractions, &[0.25, 0.5, 0.25]);
        close(scene.solver.timestep.expect("a time step"), 2e-6);
        close(scene.solver.overlap_limit, 0.05);
        assert_eq!(scene.solver.forced_models, [("rolling".to_owned(), true), ("friction".to_owned(), false)]);
        close(scene.output.frame_interval.expect("frames"), 0.02);
    }

    #[test]
    fn feeds_arrive_as_written() {
        let scene = everything(&[]);
        let kinds: Vec<&FeedKind> = scene.feeds.iter().map(|feed| &feed.kind).collect();
        assert!(
            matches!(kinds[0], FeedKind::Fill { amount: Amount::Count(100), interval, .. } if interval.is_infinite())
        );
        assert!(
            matches!(kinds[1], FeedKind::Fill { amount: Amount::Mass(mass), until, .. } if *mass == 0.5 && *until == 2.0)
        );
        let FeedKind::Fill { region: Region::Inside(mesh), .. } = kinds[2] else { panic!("{:?}", kinds[2]) };
        // A cube of 50 mm, 1.5 times as large, moved by 200 mm.
        close(mesh.bounds().minimum[0], 0.2);
        close(mesh.bounds().maximum[0], 0.2 + 1.5 * 0.05);
        let FeedKind::Stream { rate: Rate::Mass(rate), .. } = kinds[3] else { panic!("{:?}", kinds[3]) };
        close(*rate, 1800.0 / 3600.0);
        assert!(
            matches!(kinds[4], FeedKind::Stream { rate: Rate::Count(rate), amount: Some(Amount::Count(300)), .. } if *rate == 200.0)
        );
        let FeedKind::File { particles } = kinds[6] else { panic!("{:?}", kinds[6]) };
        assert_eq!((particles.len(), particles[1].id.feed(), particles[0].velocity.z), (2, 6, -0.5));
    }

    #[test]
    fn parts_are_scaled_turned_moved_and_set_in_motion() {
        let scene = everything(&[]);
        let part = |name: &str| scene.parts.iter().find(|part| part.name == name).expect("a part");
        let Surface::Frustum { start, end, start_radius, .. } = part("hopper").surface else { panic!("a cone") };
        assert!((start - vec3(0.3, -0.3, 0.0)).norm() < 1e-12);
        // Half of 80 mm along z, turned by 15 degrees about y.
        let turned = vec3((15.0 * PI / 180.0).sin(), 0.0, (15.0 * PI / 180.0).cos()) * 0.04;
        assert!((end - start - turned).norm() < 1e-12);
        close(start_radius, 0.0075);
        let MotionKind::Rotate { rate, .. } = part("mill").motion.terms[0].kind else { panic!("a rotation") };
        close(rate, 30.0 / 60.0 * 2.0 * PI);
        let Surface::Plane { normal, .. } = part("floor").surface else { panic!("a plane") };
        assert_eq!(normal, vec3(0.0, 0.0, 1.0));
        let crate_ = part("crate");
        assert_eq!((crate_.appears, crate_.disappears), (Trigger::At { time: 0.5 }, Trigger::At { time: 2.5 }));
        let gate = part("gate");
        assert!(matches!(gate.disappears, Trigger::AtRest(rest) if rest.not_before == 2.0));
        assert_eq!(gate.motion.terms.len(), 3);
        // The cube's corner (0, 0, 50 mm) turned by a quarter about x through (0, 0, 25 mm), then moved.
        let Surface::Mesh(mesh) = &gate.surface else { panic!("a mesh") };
        let corner = vec3(0.0, -0.025 + 0.3, 0.025 - 0.3);
        assert!(mesh.vertices.iter().any(|vertex| (vertex - corner).norm() < 1e-9), "{:?}", mesh.vertices);
    }

    #[test]
    fn overrides_act_before_anything_is_resolved() {
        let scene = everything(&[
            ("end.time", "4 s"),
            ("feed.block.amount", "7"),
            ("part.mill.motion.0.rate", "60 rpm"),
            ("pair.ore-steel.friction", "0.9"),
            ("particle.fixed.diameter", "3 mm"),
        ]);
        assert_eq!(scene.end.time, 4.0);
        assert!(matches!(scene.feeds[0].kind, FeedKind::Fill { amount: Amount::Count(7), .. }));
        let MotionKind::Rotate { rate, .. } = scene.parts[2].motion.terms[0].kind else { panic!("a rotation") };
        close(rate, 2.0 * PI);
        close(scene.materials.pair(1, 0).expect("a pair").sliding_friction, 0.9);
        assert_eq!(scene.classes[0].diameter, SizeDistribution::Fixed { diameter: 0.003 });
    }

    #[test]
    fn a_name_that_ends_like_a_unit_is_no_other_name() {
        let settings = [("material.glass_mm".to_owned(), "{}".to_owned())];
        let findings = read_text(DEFAULT, "scene.toml", base(), &settings).expect_err("glass has been replaced");
        assert!(findings.iter().any(|finding| finding.rule == "unknown-name"), "{findings:?}");
    }

    #[test]
    fn a_plane_problem_keeps_its_thickness_and_checkpoint() {
        let (scene, _) = read_text(PLANE, "folder/scene.toml", base(), &[]).expect("a valid scene");
        assert_eq!(scene.name, "folder");
        assert_eq!(scene.body, Body::Disc { thickness: 0.004 });
        assert_eq!(scene.start_checkpoint, Some(base().join("fill.checkpoint")));
    }

    #[test]
    fn a_measure_without_region_takes_the_domain() {
        let scene = everything(&[]);
        let MeasureKind::CoordinationNumber { region } = scene.measures[2].kind else { panic!("{:?}", scene.measures) };
        assert_eq!(region, scene.domain.bounds);
    }

    fn gates(settings: &[(&str, &str)]) -> Scene {
        let settings: Vec<_> = settings.iter().map(|(key, value)| ((*key).to_owned(), (*value).to_owned())).collect();
        match read_text(GATES, "gates.toml", base(), &settings) {
            Ok((scene, _)) => scene,
            Err(findings) => panic!("{}", super::super::diagnostics::render(&findings, GATES)),
        }
    }

    #[test]
    fn gates_arrive_with_defaults_from_the_largest_diameter() {
        let scene = gates(&[]);
        let [outlet, edge] = scene.gates.as_slice() else { panic!("two gates") };
        assert_eq!((outlet.passage, outlet.returning, outlet.sitting), (PassingPoint::Centre, Fate::Keep, Fate::Error));
        assert_eq!(outlet.paths.map(|paths| paths.every), Some(10));
        close(outlet.paths.expect("paths").length, 0.009);
        assert!(matches!(outlet.plane.aperture, Aperture::Disc { radius } if (radius - 0.06).abs() < 1e-15));
        assert_eq!(
            (edge.paths, edge.passage, edge.exclusion.mode),
            (None, PassingPoint::LowestPoint, ExclusionMode::Ballistic)
        );
        // The class reaches 5 mm.
        close(edge.exclusion.length, 1.2 * 0.005);
        assert!((edge.plane.normal - vec3(0.5, 0.0, -0.5).normalize()).norm() < 1e-15);
        let gates = gates(&[("gate.outlet.paths.every", "1"), ("gate.outlet.exclusion.mode", "constant")]);
        assert_eq!(gates.gates[0].paths.map(|paths| paths.every), Some(1));
        assert_eq!(gates.gates[0].exclusion.mode, ExclusionMode::Constant);
    }

    #[test]
    fn stages_name_their_parts_feeds_and_streams_by_index() {
        let scene = gates(&[]);
        let [hopper, chute, plate, last] = scene.stages.as_slice() else { panic!("four stages") };
        assert_eq!((&hopper.parts, &hopper.feeds), (&Some(vec![0]), &Some(vec![0])));
        assert_eq!((&hopper.records[..], &chute.records[..], &plate.feeds), (&[0][..], &[1][..], &Some(vec![])));
        assert_eq!(hopper.end.map(|end| (end.time, end.empty)), Some((3.0, true)));
        let [replay] = chute.replays.as_slice() else { panic!("one replay") };
        assert_eq!((&replay.source, replay.path), (&StreamSource::Gate(0), PathMode::Recorded));
        assert_eq!((replay.clock, replay.timing, replay.loops), (Clock::Plant, Timing::Arrival, 1));
        assert_eq!((replay.window, replay.transform), ([0.0, f64::INFINITY], Transform::IDENTITY));
        assert_eq!((replay.leaving, replay.backing_up), (Fate::Delete, BackingUp::Stop));
        close(replay.length, 1.2 * 0.005);
        close(replay.compliance, 0.1 * 0.005);
        let [replay] = plate.replays.as_slice() else { panic!("one replay") };
        assert_eq!(
            (replay.path, replay.clock, replay.timing),
            (PathMode::Compliant, Clock::FirstPassage, Timing::Creation)
        );
        assert_eq!((replay.window, replay.loops, replay.gap), ([0.2, 2.0], 3, 0.1));
        assert_eq!((replay.leaving, replay.backing_up), (Fate::Keep, BackingUp::Warn));
        let (axis, angle, _) = replay.transform.rotation.expect("a rotation");
        assert_eq!((axis, angle), (vec3(0.0, 0.0, 1.0), PI));
        assert_eq!(replay.transform.mirror, Some((vec3(0.0, 0.0, 0.0), vec3(1.0, 0.0, 0.0))));
        assert_eq!(last.replays[0].path, PathMode::Ballistic, "the gate stores no paths");
        assert_eq!(last.replays[1].source, StreamSource::Folder(base().join("stored/edge")));
    }

    #[test]
    fn a_replay_goes_by_its_gate_or_its_number() {
        for name in ["outlet", "0"] {
            let scene = gates(&[(&format!("stage.plate.replay.{name}.loops"), "2")]);
            assert_eq!(scene.stages[2].replays[0].loops, 2);
        }
    }

    #[test]
    fn a_source_gives_each_of_many_scenes_as_if_it_was_the_only_one() {
        let folder = Path::new("examples/chute-tilt-campaign");
        let source = Source::open(folder).expect("a scene");
        let values: [(&str, &[&str]); 6] = [
            ("part.chute.place.rotate.angle", &["30 deg", "0 deg", "-0.0 deg", "40 deg"]),
            ("part.box.scale", &["0.001", "0.002"]),
            ("part.box.place.move_mm", &["[0, 0, 0]", "[-0.0, 0, 0]", "[0, 0, 900]"]),
            ("part.box.file", &["chute.stl", "missing.stl", "."]),
            ("gate.outlet.exclusion.length_mm", &["7", "-7"]),
            ("stage.1.replay.0.length", &["6 mm", "9 mm"]),
        ];
        let mut tried = vec![Vec::new()];
        for (key, values) in values {
            let setting = |value: &&str| (key.to_owned(), (*value).to_owned());
            tried.extend(values.iter().map(setting).map(|one| vec![one]));
            tried.extend(values.iter().map(setting).map(|one| vec![one, ("pair.1.friction".into(), "0.1".into())]));
        }
        let shown = |result| format!("{result:?}");
        let alone: Vec<String> = tried.iter().map(|settings| shown(read(folder, settings))).collect();
        // Each after every other, so that whatever is taken over could come from the wrong one.
        for (first, second) in (0..tried.len()).flat_map(|first| (0..first).map(move |second| (first, second))) {
            for index in [first, second, first] {
                assert_eq!(shown(source.resolve(&tried[index])), alone[index], "{:?}", tried[index]);
            }
        }
    }

    #[test]
    fn every_finding_of_a_scene_comes_at_once() {
        let text = "version = 2\ncolour = 1\n[contact]\nlaw = \"herz\"\n[end]\ntime = 3\n";
        let findings = read_text(text, "scene.toml", base(), &[]).expect_err("many mistakes");
        let rules: Vec<&str> = findings.iter().map(|finding| finding.rule).collect();
        assert_eq!(rules, ["unknown-version", "no-feed", "unknown-key", "unknown-word", "bare-number"]);
    }

    #[test]
    fn a_monster_of_a_number_is_refused_and_nothing_is_allocated_for_it() {
        for amount in ["9223372036854775807", "99999999999999999999999", "\"1e300 kg\""] {
            // Whatever the verdict, it comes without drawing a single particle.
            let settings = [("feed.fill.amount".to_owned(), amount.to_owned())];
            let _ = read_text(DEFAULT, "scene.toml", base(), &settings);
        }
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(200))]

        #[test]
        fn arbitrary_text_never_panics(text in "\\PC{0,200}") {
            let _ = read_text(&text, "scene.toml", base(), &[]);
        }

        #[test]
        fn arbitrary_overrides_never_panic(
            key in "(feed|part|pair|end|output|material|solver)(\\.(fill|container|0|time|motion|glass|amount|region|min)){0,4}(_mm|_s)?",
            value in "(-?[0-9]{1,4}(\\.[0-9])?( (mm|s|kg|rpm))?|\\[\\]|\\{\\}|true|\"[a-z ]{0,5}\"|\\PC{0,8})",
        ) {
            let _ = read_text(DEFAULT, "scene.toml", base(), &[(key, value)]);
        }

        #[test]
        fn mutated_scenes_never_panic(
            which in 0..4_usize,
            edits in proptest::collection::vec((any::<proptest::sample::Index>(), any::<proptest::sample::Index>(), 0..4_u8), 1..6),
        ) {
            let mut lines: Vec<String> = [EVERYTHING, PLANE, DEFAULT, GATES][which].lines().map(str::to_owned).collect();
            for (at, other, kind) in edits {
                let (at, other) = (at.index(lines.len()), other.index(lines.len()));
                match kind {
                    0 => { lines.remove(at); }
                    1 => { let line = lines[other].clone(); lines.insert(at, line); }
                    2 => lines.swap(at, other),
                    _ => {
                        // Values change places: types, units and ranges go wrong.
                        let value = lines[other].split_once('=').map(|(_, value)| value.to_owned());
                        let key = lines[at].split_once('=').map(|(key, _)| key.to_owned());
                        if let (Some(key), Some(value)) = (key, value) {
                            lines[at] = format!("{key}={value}");
                        }
                    }
                }
                if lines.is_empty() {
                    break;
                }
            }
            let text = lines.join("\n");
            if let Err(findings) = read_text(&text, "scene.toml", base(), &[]) {
                prop_assert!(!findings.is_empty());
                prop_assert!(!super::super::diagnostics::render(&findings, &text).is_empty());
            }
        }

        #[test]
        fn mutated_characters_never_panic(at in any::<proptest::sample::Index>(), with in "\\PC{0,3}") {
            let mut text: Vec<char> = EVERYTHING.chars().collect();
            let at = at.index(text.len());
            text.splice(at..=at, with.chars());
            let text: String = text.into_iter().collect();
            if let Err(findings) = read_text(&text, "scene.toml", base(), &[]) {
                prop_assert!(!super::super::diagnostics::render(&findings, &text).is_empty());
            }
        }
    }
}
