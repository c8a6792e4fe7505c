//! From a file to a scene, or to everything that is wrong with it.

use super::diagnostics::{Finding, Place, Report, Severity};
use super::resolve::{Draft, resolve};
use super::{Domain, MeasureKind, Scene, extent, rules, tree};
use crate::material::MaterialTable;
use crate::math::Bounds;
use std::path::Path;

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
    let file = if path.is_dir() { path.join(FILE) } else { path.to_owned() };
    let shown = file.display().to_string();
    let size = std::fs::metadata(&file).map(|found| found.len());
    let text = match size {
        Ok(size) if size > LARGEST => Err(format!("it has {size} bytes, more than any scene")),
        Ok(_) => std::fs::read_to_string(&file).map_err(|error| error.to_string()),
        Err(error) => Err(error.to_string()),
    };
    match text {
        Ok(text) => {
            let base = file.parent().unwrap_or(Path::new(""));
            read_text(&text, &shown, base, settings)
        }
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
    let report = Report::new(file, text);
    let mut root = tree::parse(text, &report);
    if !report.is_empty() {
        // What follows a syntax error is anybody's guess.
        return Err(report.into_findings());
    }
    for (path, value) in settings {
        tree::set(&mut root, path, value, &report);
    }
    let draft = resolve(&root, &default_name(file, base), base, &report);
    let domain = extent::domain(&draft);
    rules::check(&draft, domain, &report);
    let findings = report.into_findings();
    if findings.iter().any(|finding| finding.severity == Severity::Error) {
        return Err(findings);
    }
    match assemble(draft, domain) {
        Some(scene) => Ok((scene, findings)),
        None => unreachable!("a scene without errors resolves as a whole"),
    }
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
