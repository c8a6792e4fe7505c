//! Decks of external codes, rendered and not run.

use super::prepared::{Prepared, prepare};
use super::{RunError, RunRequest, chosen, name_of, stage_folder, streams};
use crate::backend::liggghts;
use crate::backend::stage::StageRequest;
use crate::output::progress::Verbosity;
use crate::scene::backend::BackendName;
use crate::stage::split::take_events;
use std::path::{Path, PathBuf};
use std::sync::atomic::AtomicBool;

/// Which decks are asked for.
#[derive(Debug, Clone, Default)]
pub struct DeckRequest {
    /// Scene file, or the folder that holds `scene.toml`.
    pub scene: PathBuf,
    /// Changed settings, dotted key and value.
    pub settings: Vec<(String, String)>,
    /// Folder for the cases.
    pub out: PathBuf,
    /// Only these stages; empty for all that an external code computes.
    pub stages: Vec<String>,
    /// A run that holds the streams of the stages upstream; `None` for `runs/<scene>`.
    pub run: Option<PathBuf>,
    /// Do not cut at the gates.
    pub whole: bool,
    /// Use streams although they do not fit the scene.
    pub accept_stream: bool,
}

/// A rendered case.
#[derive(Debug, Clone)]
pub struct RenderedCase {
    /// The stage.
    pub stage: String,
    /// The command that runs it.
    pub command: String,
    /// What should be known about it.
    pub warnings: Vec<String>,
}

/// Renders the decks of all stages that are asked for.
///
/// # Errors
/// When the scene is wrong, a stream is missing, or the code cannot do what a stage needs.
pub fn render(request: &DeckRequest) -> Result<Vec<RenderedCase>, RunError> {
    let asked = RunRequest {
        scene: request.scene.clone(),
        settings: request.settings.clone(),
        whole: request.whole,
        ..RunRequest::default()
    };
    let Prepared { scene, plan, jobs, .. } = prepare(&asked)?;
    let wanted = chosen(&jobs, &request.stages, request.whole)?;
    let external: Vec<usize> = wanted.into_iter().filter(|&index| jobs[index].backend != BackendName::Native).collect();
    if external.is_empty() {
        return Err(RunError::Request(
            "none of these stages is computed by an external code; add --backend liggghts, or `backend` to the scene"
                .to_owned(),
        ));
    }
    let run = request.run.clone().unwrap_or_else(|| Path::new("runs").join(name_of(&request.scene, "scene.toml")));
    let places: Vec<PathBuf> = jobs.iter().map(|job| stage_folder(&run, &job.name)).collect();
    let mut cases = Vec::new();
    for index in external {
        let mut job = jobs[index].clone();
        let inputs = streams::inputs(&scene, &jobs, index, &places, request.accept_stream)?;
        let events: Vec<_> = inputs.iter().flat_map(streams::StreamInput::events).collect();
        take_events(&mut job.scene, &job.upstream_parts, &events);
        let place = request.out.join(&job.name);
        if place.exists() {
            let shown = place.display();
            return Err(RunError::Folder(format!("{shown} is there already; choose another --out, or remove it")));
        }
        let replays = streams::replays(&job, &inputs)?;
        let stage = StageRequest {
            folder: &place,
            key: "",
            stage: &job.name,
            resume: false,
            verbosity: Verbosity::Silent,
            interrupted: &AtomicBool::new(false),
            records: &job.records,
            replays: &replays,
            kick: None,
        };
        let rendered = liggghts::render(&job.scene, &plan, &stage, &place)?;
        cases.push(RenderedCase { stage: job.name.clone(), command: rendered.command, warnings: rendered.warnings });
    }
    Ok(cases)
}
