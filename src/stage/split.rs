//! What each stage sees: the scene cropped to its parts and feeds, with what it records and what it replays; and the same
//! scene unsplit, as the reference that a split is compared with.

use super::graph::Graph;
use crate::dem::feed::FeedKind;
use crate::geometry::part::{Part, Trigger};
use crate::scene::backend::BackendName;
use crate::scene::gate::{Clock, Gate, Replay, StreamSource};
use crate::scene::layout::Layout;
use crate::scene::{EndConditions, Scene};
use serde::Serialize;

/// A gate that a job records.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Recording {
    /// The gate.
    pub gate: Gate,
    /// True in a whole run: it records and takes nothing out.
    pub observes: bool,
}

/// One solver run: a stage, or a whole run.
#[derive(Debug, Clone, PartialEq)]
pub struct StageJob {
    /// Name of the stage; of a whole run that of its last stage.
    pub name: String,
    /// Who computes it.
    pub backend: BackendName,
    /// The scene as the job sees it: its parts and feeds, its end, no gates and no stages. Feeds of other stages keep their
    /// place and bring nothing.
    pub scene: Scene,
    /// Gates that it records.
    pub records: Vec<Recording>,
    /// Streams that it replays; a gate is an index into the gates of the scene that was split.
    pub replays: Vec<Replay>,
    /// Feeds that bring particles here, as indices into the scene's feeds, ascending.
    pub own_feeds: Vec<usize>,
    /// Feeds whose particles come through gates, ascending.
    pub upstream_feeds: Vec<usize>,
    /// Names of its parts that a stage upstream has as well: what happened to them there is replayed here.
    pub upstream_parts: Vec<String>,
    /// Which of the scene's materials its particles and parts can be of.
    pub materials: Vec<bool>,
    /// Jobs that must be done before, as indices into the list of jobs.
    pub waits_for: Vec<usize>,
    /// True where nothing replays what leaves it.
    pub is_leaf: bool,
}

impl StageJob {
    /// A scene that is not cut, as one job.
    #[must_use]
    pub fn uncut(scene: &Scene) -> Self {
        Self {
            name: scene.name.clone(),
            backend: scene.backend,
            scene: scene.clone(),
            records: Vec::new(),
            replays: Vec::new(),
            own_feeds: (0..scene.feeds.len()).collect(),
            upstream_feeds: Vec::new(),
            upstream_parts: Vec::new(),
            materials: vec![true; scene.materials.materials.len()],
            waits_for: Vec::new(),
            is_leaf: true,
        }
    }
}

/// The stages of a scene as jobs, upstream first; none for a scene without stages.
///
/// # Panics
/// Where the stages form a cycle, which the scene's rules refuse.
#[must_use]
pub fn stage_jobs(scene: &Scene) -> Vec<StageJob> {
    let graph = Graph::of(scene);
    let layout = Layout::of(scene);
    let order = graph.order();
    let place = |stage: usize| order.iter().position(|other| *other == stage);
    let job = |&stage: &usize| {
        let outline = &scene.stages[stage];
        let mut job = crop(scene, &layout, &[stage]);
        job.name.clone_from(&outline.name);
        job.backend = outline.backend.unwrap_or(scene.backend);
        let recording = |gate: &usize| Recording { gate: scene.gates[*gate].clone(), observes: false };
        job.records = outline.records.iter().map(recording).collect();
        job.replays.clone_from(&outline.replays);
        // Where particles leave through a gate, nothing is left to be done once all of them have.
        let scenes_end = EndConditions { empty: scene.end.empty || !outline.records.is_empty(), ..scene.end };
        job.scene.end = outline.end.unwrap_or(scenes_end);
        let (is_upstream, upstream_feeds) = members(scene, &layout, graph.ancestors(stage));
        job.upstream_feeds = upstream_feeds;
        job.materials = materials(scene, &job);
        let upstream = scene.parts.iter().zip(&is_upstream).filter(|(_, is_upstream)| **is_upstream);
        let shared = |part: &&Part| upstream.clone().any(|(other, _)| other.name == part.name);
        job.upstream_parts = job.scene.parts.iter().filter(shared).map(|part| part.name.clone()).collect();
        job.waits_for = graph.parents(stage).iter().filter_map(|parent| place(*parent)).collect();
        job.is_leaf = graph.is_leaf(stage);
        if !job.is_leaf {
            job.scene.measures.clear();
        }
        job
    };
    order.iter().map(job).collect()
}

/// The whole runs of a scene: for each last stage one of everything upstream and itself, in the scene's order. It observes
/// the gates on its way, and ends as the scene does, or as its last stage says.
#[must_use]
pub fn whole_jobs(scene: &Scene) -> Vec<StageJob> {
    let graph = Graph::of(scene);
    let layout = Layout::of(scene);
    let job = |stage: usize| {
        let mut members = graph.ancestors(stage).to_vec();
        members.push(stage);
        let mut job = crop(scene, &layout, &members);
        let outline = &scene.stages[stage];
        job.name.clone_from(&outline.name);
        job.backend = outline.backend.unwrap_or(scene.backend);
        let is_here = |gate: &usize| members.iter().any(|member| scene.stages[*member].records.contains(gate));
        let gates = (0..scene.gates.len()).filter(is_here);
        job.records = gates.map(|gate| Recording { gate: scene.gates[gate].clone(), observes: true }).collect();
        let replays = members.iter().flat_map(|member| &scene.stages[*member].replays);
        job.replays = replays.filter(|replay| matches!(replay.source, StreamSource::Folder(_))).cloned().collect();
        job.scene.end = outline.end.unwrap_or(scene.end);
        job.materials = materials(scene, &job);
        job.is_leaf = true;
        job
    };
    (0..scene.stages.len()).filter(|stage| graph.is_leaf(*stage)).map(job).collect()
}

/// Why the stage called `name` has no whole run that is the same plant: its streams, or those upstream, are not replayed as
/// they were recorded. `None` where it has one.
#[must_use]
pub fn why_not_whole(scene: &Scene, name: &str) -> Option<String> {
    let stage = scene.stages.iter().position(|stage| stage.name == name)?;
    let graph = Graph::of(scene);
    let mut members = graph.ancestors(stage).to_vec();
    members.push(stage);
    members.iter().find_map(|member| {
        let outline = &scene.stages[*member];
        let gates = outline.replays.iter().filter(|replay| matches!(replay.source, StreamSource::Gate(_)));
        gates.filter_map(difference).next().map(|what| format!("stage \"{}\" {what}", outline.name))
    })
}

/// What a replay changes about its stream.
fn difference(replay: &Replay) -> Option<&'static str> {
    if !replay.transform.is_identity() {
        Some("moves its stream to another place")
    } else if replay.loops > 1 {
        Some("replays its stream several times")
    } else if replay.window != [0.0, f64::INFINITY] {
        Some("replays a window of its stream")
    } else if replay.clock == Clock::FirstPassage {
        Some("replays its stream from the first passage on")
    } else {
        None
    }
}

/// What some stages have together: which of the parts, and their feeds, ascending.
fn members(scene: &Scene, layout: &Layout<'_>, stages: &[usize]) -> (Vec<bool>, Vec<usize>) {
    let mut has_part = vec![false; scene.parts.len()];
    let mut own_feeds = Vec::new();
    for stage in stages {
        has_part.iter_mut().zip(layout.parts_of(*stage)).for_each(|(has, here)| *has |= here);
        own_feeds.extend(layout.feeds_of(*stage));
    }
    own_feeds.sort_unstable();
    own_feeds.dedup();
    (has_part, own_feeds)
}

/// The scene cut down to some stages: their parts and feeds; the start checkpoint belongs to the stages that nothing enters.
fn crop(scene: &Scene, layout: &Layout<'_>, stages: &[usize]) -> StageJob {
    let (has_part, own_feeds) = members(scene, layout, stages);
    let mut cropped = scene.clone();
    cropped.gates.clear();
    cropped.stages.clear();
    cropped.parts = scene.parts.iter().zip(has_part).filter(|(_, has)| *has).map(|(part, _)| part.clone()).collect();
    for (index, feed) in cropped.feeds.iter_mut().enumerate() {
        if !own_feeds.contains(&index) {
            *feed = feed.elsewhere();
        }
    }
    if stages.iter().all(|stage| !scene.stages[*stage].replays.is_empty()) {
        cropped.start_checkpoint = None;
    }
    StageJob {
        name: String::new(),
        backend: scene.backend,
        scene: cropped,
        records: Vec::new(),
        replays: Vec::new(),
        own_feeds,
        upstream_feeds: Vec::new(),
        upstream_parts: Vec::new(),
        materials: vec![true; scene.materials.materials.len()],
        waits_for: Vec::new(),
        is_leaf: false,
    }
}

/// Which materials `job` can meet: those of its parts, and of the particles that are fed into it or upstream of it. Of a stored
/// stream, or a checkpoint, it is not known what it brings: all of them.
fn materials(scene: &Scene, job: &StageJob) -> Vec<bool> {
    let is_known = job.scene.start_checkpoint.is_none()
        && job.replays.iter().all(|replay| matches!(replay.source, StreamSource::Gate(_)));
    let mut met = vec![!is_known; scene.materials.materials.len()];
    job.scene.parts.iter().for_each(|part| met[usize::from(part.material)] = true);
    for feed in job.own_feeds.iter().chain(&job.upstream_feeds) {
        match &scene.feeds[*feed].kind {
            FeedKind::Fill { class, .. } | FeedKind::Stream { class, .. } => {
                met[usize::from(scene.classes[*class].material)] = true;
            }
            FeedKind::File { particles } => {
                particles.iter().for_each(|particle| met[usize::from(particle.material)] = true);
            }
        }
    }
    met
}

/// Replays in a stage what happened to parts upstream: `events` are part, whether it came (`true`) or went, and the plant
/// time [s]. For each of `upstream_parts`, an event that waited for rest happens when it happened there, or never; a part
/// that no stage upstream has waits for the rest of this stage.
pub fn take_events(scene: &mut Scene, upstream_parts: &[String], events: &[(String, bool, f64)]) {
    for part in scene.parts.iter_mut().filter(|part| upstream_parts.contains(&part.name)) {
        for (trigger, present) in [(&mut part.appears, true), (&mut part.disappears, false)] {
            if matches!(trigger, Trigger::AtRest(_)) {
                let event = events.iter().find(|(name, came, _)| *name == part.name && *came == present);
                *trigger = event.map_or(Trigger::Never, |(_, _, time)| Trigger::At { time: *time });
            }
        }
    }
}

#[cfg(test)]
mod tests;
