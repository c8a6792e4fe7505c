//! Who computes what when. Every task is a process of its own; a scheduler knows nothing that is not on disk: two of them on one
//! campaign, or one that is started again, see the same facts, and the claims decide who computes what.

pub mod local;
pub mod slurm;

use super::CampaignError;
use super::claim::Watch;
use super::file::Campaign;
use super::status::{State, states};
use super::task::{Graph, Task};
use super::workspace::Workspace;
use crate::exit_code;
use crate::output::tally::Tally;
use crate::storage::StorageError;
use std::fs;
use std::path::PathBuf;

/// What is computed although something of it is there.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Rerun {
    /// What failed, from its start.
    pub failed: bool,
    /// What lacks outputs that are asked for now, from its start.
    pub outputs: bool,
    /// What was begun and has not ended, from its last checkpoint.
    pub resume: bool,
}

/// How a campaign ended.
#[derive(Debug, Clone, PartialEq)]
pub struct Outcome {
    /// States of all tasks.
    pub states: Vec<State>,
    /// True where it was interrupted.
    pub was_interrupted: bool,
    /// Why no further task was started: the system failed.
    pub stopped: Option<String>,
    /// True where the scenes of some variants cannot run.
    pub has_refused: bool,
}

impl Outcome {
    /// The exit status of the campaign.
    #[must_use]
    pub fn exit_code(&self) -> u8 {
        let is_done = |state: &State| matches!(state, State::Stored(_) | State::NotNeeded);
        if self.stopped.is_some() {
            exit_code::SYSTEM
        } else if self.was_interrupted {
            exit_code::INTERRUPTED
        } else if self.states.iter().all(is_done) && !self.has_refused {
            exit_code::DONE
        } else {
            exit_code::VARIANTS_FAILED
        }
    }
}

/// What all schedulers look at: the tasks and their states.
#[derive(Debug)]
pub struct Board<'a> {
    workspace: &'a Workspace,
    campaign: &'a Campaign,
    graph: &'a Graph,
    rerun: Rerun,
    watch: Watch,
    states: Vec<State>,
    /// Tasks whose process was killed while this scheduler watched: not started again by it.
    killed: Vec<bool>,
    /// Tasks that somebody is going to go on with, whatever is there of them.
    expected: Vec<bool>,
    stopped: Option<String>,
}

impl<'a> Board<'a> {
    /// The states as they are on disk.
    #[must_use]
    pub fn new(workspace: &'a Workspace, campaign: &'a Campaign, graph: &'a Graph, rerun: Rerun) -> Self {
        let mut watch = Watch::default();
        let states = states(workspace, graph, &mut watch);
        let no = vec![false; graph.tasks.len()];
        Self { workspace, campaign, graph, rerun, watch, states, killed: no.clone(), expected: no, stopped: None }
    }

    /// What was begun, failed or lacks outputs is taken up, or refused.
    fn take_up(&mut self) -> Result<(), CampaignError> {
        let of = |wanted: fn(&State) -> bool| {
            let found = self.graph.tasks.iter().zip(&self.states).zip(&self.expected);
            let found = found.filter(move |((_, state), expected)| wanted(state) && !**expected);
            found.map(|((task, _), _)| task).collect::<Vec<&Task>>()
        };
        if self.rerun.failed {
            for task in of(|state| matches!(state, State::Failed(_))) {
                self.workspace.forget_failure(&task.group(), &task.name())?;
            }
        }
        let begun = of(|state| matches!(state, State::Begun));
        if !self.rerun.resume && !begun.is_empty() {
            return Err(CampaignError::Request(format!(
                "{} stages were begun and have not ended ({}): go on with --resume",
                begun.len(),
                some(&begun)
            )));
        }
        let outputs = self.states.iter().filter_map(|state| match state {
            State::Lacking(outputs) => Some(outputs),
            _ => None,
        });
        let lacking: Vec<&Vec<String>> = outputs.collect();
        if let (false, Some(first)) = (self.rerun.outputs, lacking.first()) {
            return Err(CampaignError::Request(format!(
                "{} stored stages lack outputs that are asked for now ({}); compute them again with --rerun outputs, or take these outputs back",
                lacking.len(),
                first.join(", ")
            )));
        }
        self.refresh();
        Ok(())
    }

    /// The states as the disk tells them; what is to be computed although something of it is there becomes due.
    fn refresh(&mut self) {
        self.states = states(self.workspace, self.graph, &mut self.watch);
        for index in 0..self.states.len() {
            let state = &mut self.states[index];
            match state {
                State::Begun if !self.killed[index] => *state = State::Due,
                State::Lacking(_) if self.rerun.outputs => *state = State::Due,
                State::HeldUp(_) => *state = State::Due,
                _ => {}
            }
            // Also where it was killed before it had written anything.
            if *state == State::Due && self.killed[index] {
                *state = State::Begun;
            }
            let stops =
                |state: &State| matches!(state, State::Failed(_) | State::Lacking(_) | State::HeldUp(_) | State::Begun);
            let upstream = &self.graph.tasks[index].upstream;
            if self.states[index] == State::Due
                && let Some(by) = upstream.iter().find(|by| stops(&self.states[**by]))
            {
                self.states[index] = State::HeldUp(*by);
            }
        }
    }

    /// Whether something is still to come: due, or computed by somebody.
    fn is_waiting(&self) -> bool {
        self.states.iter().any(|state| matches!(state, State::Due | State::Running(_)))
    }

    /// Whether everything upstream of a task is stored.
    fn is_ready(&self, index: usize) -> bool {
        let is_there = |upstream: &usize| matches!(self.states[*upstream], State::Stored(_));
        self.graph.tasks[index].upstream.iter().all(is_there)
    }

    /// Writes down what a task consists of.
    fn write_order(&self, index: usize) -> Result<(), StorageError> {
        let task = &self.graph.tasks[index];
        let place = |index: &usize| {
            let other = &self.graph.tasks[*index];
            let folder = match &self.states[*index] {
                State::Stored(folder) => folder.clone(),
                _ => other.name(),
            };
            (other.stage.clone(), PathBuf::from("stages").join(other.group()).join(folder))
        };
        self.workspace.write_order(self.campaign, task, task.upstream.iter().map(place).collect())
    }

    /// The last line of a task's log.
    fn last_words(&self, name: &str) -> String {
        let text = fs::read_to_string(self.workspace.log(name)).unwrap_or_default();
        let line = text.lines().rev().find(|line| !line.trim().is_empty());
        line.unwrap_or("it said nothing").trim().to_owned()
    }

    /// Tells how far everything is.
    fn show(&self, tally: &mut Tally, running: usize) {
        let mut done = (0, 0.0);
        let mut all = (0, 0.0);
        let mut failed = 0;
        for (task, state) in self.graph.tasks.iter().zip(&self.states) {
            if *state == State::NotNeeded {
                continue;
            }
            all = (all.0 + 1, all.1 + task.forecast.particle_steps);
            match state {
                State::Stored(_) => done = (done.0 + 1, done.1 + task.forecast.particle_steps),
                State::Failed(_) | State::HeldUp(_) | State::Begun => {
                    failed += 1;
                    all.1 -= task.forecast.particle_steps;
                }
                _ => {}
            }
        }
        tally.update(done.0, all.0, running, failed, done.1 / f64::max(all.1, f64::MIN_POSITIVE));
    }

    /// How it ended.
    fn outcome(mut self, was_interrupted: bool) -> Outcome {
        Outcome {
            states: states(self.workspace, self.graph, &mut self.watch),
            was_interrupted,
            stopped: self.stopped,
            has_refused: self.graph.runs.iter().any(|run| run.refused.is_some()),
        }
    }
}

/// The groups of some tasks, the first few of them.
fn some(tasks: &[&Task]) -> String {
    let names: Vec<String> = tasks.iter().take(3).map(|task| format!("{} {}", task.group(), task.name())).collect();
    let more = if tasks.len() > names.len() { ", ..." } else { "" };
    format!("{}{more}", names.join(", "))
}
