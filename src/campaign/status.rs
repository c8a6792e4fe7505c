//! Where a campaign stands: the state of every task, from the facts on disk.

use super::claim::{Claimed, Holder, Watch};
use super::task::Graph;
use super::workspace::{Contents, Failure, Stored, Workspace};
use std::collections::BTreeMap;

/// The state of a task.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum State {
    /// Its result is there, in the folder of this name.
    Stored(String),
    /// A result is there, without some of the outputs that are asked for.
    Lacking(Vec<String>),
    /// Somebody is computing it.
    Running(Holder),
    /// It was begun and has not ended: killed, or interrupted.
    Begun,
    /// It failed.
    Failed(Failure),
    /// One upstream of it failed, lacks outputs, or is itself held up: that task.
    HeldUp(usize),
    /// It is to be computed.
    Due,
    /// Everything that would need it is there.
    NotNeeded,
}

impl State {
    /// In one word, for tables.
    #[must_use]
    pub const fn word(&self) -> &'static str {
        match self {
            Self::Stored(_) => "done",
            Self::Lacking(_) => "lacks outputs",
            Self::Running(_) => "running",
            Self::Begun => "begun",
            Self::Failed(_) => "failed",
            Self::HeldUp(_) => "held up",
            Self::Due => "due",
            Self::NotNeeded => "not needed",
        }
    }
}

/// The states of all tasks of a graph.
pub fn states(workspace: &Workspace, graph: &Graph, watch: &mut Watch) -> Vec<State> {
    let contents = Contents::of(workspace);
    let claims = by_task(&contents.claims);
    let mut states: Vec<State> = Vec::with_capacity(graph.tasks.len());
    for task in &graph.tasks {
        let name = task.name();
        let claimed = |watch: &mut Watch| match claims.get(name.as_str()) {
            Some(files) => watch.look(&workspace.claims(), &name, files),
            None => Claimed::Free,
        };
        let state = match contents.result(workspace, task) {
            Stored::Whole(folder) => State::Stored(folder),
            Stored::Lacking(outputs) if !contents.is_begun(task) => State::Lacking(outputs),
            _ => match claimed(watch) {
                Claimed::By(holder) => State::Running(holder),
                _ => match workspace.failure(&name).filter(|_| contents.failed.contains(&name)) {
                    Some(failure) => State::Failed(failure),
                    None if contents.is_begun(task) => State::Begun,
                    None => State::Due,
                },
            },
        };
        let stops = |index: &&usize| matches!(states[**index], State::Failed(_) | State::Lacking(_) | State::HeldUp(_));
        let held_up = task.upstream.iter().find(stops).filter(|_| matches!(state, State::Due | State::Begun));
        states.push(held_up.map_or(state, |index| State::HeldUp(*index)));
    }
    leave_out_what_nobody_needs(graph, &mut states);
    states
}

/// Files of claims by the task that they are of.
fn by_task(claims: &[String]) -> BTreeMap<&str, Vec<String>> {
    let mut found: BTreeMap<&str, Vec<String>> = BTreeMap::new();
    for name in claims {
        if let Some((task, _)) = name.rsplit_once('.') {
            found.entry(task).or_default().push(name.clone());
        }
    }
    found
}

/// A task upstream of results that are all there need not be computed for them.
fn leave_out_what_nobody_needs(graph: &Graph, states: &mut [State]) {
    let mut is_needed: Vec<bool> = graph.tasks.iter().map(|task| task.is_leaf).collect();
    for (index, task) in graph.tasks.iter().enumerate().rev() {
        if is_needed[index] && !matches!(states[index], State::Stored(_)) {
            task.upstream.iter().for_each(|upstream| is_needed[*upstream] = true);
        }
    }
    for (state, is_needed) in states.iter_mut().zip(is_needed) {
        if !is_needed && !matches!(state, State::Stored(_) | State::Running(_)) {
            *state = State::NotNeeded;
        }
    }
}

/// How many tasks of each group are in each state: group, word, number.
#[must_use]
pub fn tally(graph: &Graph, states: &[State]) -> BTreeMap<(String, &'static str), usize> {
    let mut found = BTreeMap::new();
    for (task, state) in graph.tasks.iter().zip(states) {
        *found.entry((task.group(), state.word())).or_insert(0) += 1;
    }
    found
}
