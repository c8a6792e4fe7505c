//! Submits arrays of tasks, asks how far they are, and cancels them.
//!
//! squeue knows what lives, and for some minutes (`MinJobAge`) what has ended; sacct knows it for longer where the cluster keeps
//! accounts. What neither knows is [`TaskState::Unknown`].

use super::answers::{Settings, read_sacct, read_settings, read_squeue};
use super::array::{ArrayJob, ArrayRequest, Submission, TaskId, cut, dependency, log_pattern, share, unique_name};
use super::commands::{Commands, shown};
use super::error::SlurmError;
use super::state::TaskState;
use std::collections::BTreeMap;
use std::ffi::{OsStr, OsString};

/// A cluster with Slurm.
#[derive(Debug, Clone)]
pub struct Cluster {
    commands: Commands,
    settings: Settings,
}

/// So many jobs are asked for by one command: a line of arguments has an end.
const JOBS_A_COMMAND: usize = 1000;
/// What squeue prints of a task.
const SQUEUE_FIELDS: &str = "ArrayJobID:|,ArrayTaskID:|,State:|,Reason:|,exit_code:|";
/// What squeue and scancel say where no job that was named is known any more.
const NO_SUCH_JOB: &str = "Invalid job id specified";

impl Cluster {
    /// The cluster that the commands lead to.
    ///
    /// # Errors
    /// Where Slurm's commands are missing, fail, or say what cannot be read.
    pub fn connect(commands: Commands) -> Result<Self, SlurmError> {
        let arguments = ["show", "config"].map(OsString::from);
        let text = commands.run("scontrol", &arguments)?;
        let settings = read_settings(&text)
            .map_err(|reason| SlurmError::unreadable(&shown("scontrol", &arguments), &text, reason))?;
        Ok(Self { commands, settings })
    }

    /// What the cluster says of its settings.
    #[must_use]
    pub const fn settings(&self) -> &Settings {
        &self.settings
    }

    /// Submits an array of tasks, in parts where the cluster demands it: all of it, or nothing.
    ///
    /// # Errors
    /// Where Slurm refuses a part (those before it are cancelled then), cannot be reached, or a path is none for it.
    pub fn submit(&self, request: &ArrayRequest<'_>) -> Result<Submission, SlurmError> {
        let most = request.max_array_size.unwrap_or(u64::MAX).min(self.settings.max_array_size);
        let parts = cut(request.count, most);
        if parts.is_empty() {
            return Err(SlurmError::refused("an array without tasks cannot be submitted"));
        }
        let mut submission = Submission { jobs: Vec::new() };
        for (number, &(first, count)) in parts.iter().enumerate() {
            let throttle = request.throttle.map(|limit| share(limit, parts.len() as u64, number as u64));
            match self.submit_part(request, first, count, throttle) {
                Ok(job) => submission.jobs.push(ArrayJob { job, first, count }),
                Err(error) => {
                    // The reason of the refusal must not be hidden by a failure to tidy up.
                    let _ = self.cancel(&submission.jobs);
                    return Err(error);
                }
            }
        }
        Ok(submission)
    }

    fn submit_part(
        &self,
        request: &ArrayRequest<'_>,
        first: u64,
        count: u64,
        throttle: Option<u64>,
    ) -> Result<u64, SlurmError> {
        let name = unique_name(request.name);
        let mut arguments: Vec<OsString> = vec!["--parsable".into(), format!("--job-name={name}").into()];
        let limit = throttle.map_or_else(String::new, |limit| format!("%{limit}"));
        arguments.push(format!("--array=0-{}{limit}", count - 1).into());
        arguments.push(option("--chdir=", request.workspace.as_os_str()));
        arguments.push(option("--output=", &log_pattern(request.logs)?));
        if let Some(dependency) = dependency(request.after, first, count)? {
            arguments.push(format!("--dependency={dependency}").into());
        }
        arguments.extend([request.script.as_os_str().to_owned(), first.to_string().into()]);
        let mut is_repeated = false;
        self.commands.patiently(|| {
            // A controller that did not answer may have taken the job all the same.
            if std::mem::replace(&mut is_repeated, true)
                && let Some(job) = self.find(&name)?
            {
                return Ok(job);
            }
            let text = self.commands.once("sbatch", &arguments)?;
            // On several clusters, the cluster's name follows.
            let number = text.trim().split(';').next().unwrap_or_default();
            number
                .parse()
                .map_err(|_| SlurmError::unreadable(&shown("sbatch", &arguments), &text, "a job's number was expected"))
        })
    }

    /// The job of a name.
    fn find(&self, name: &str) -> Result<Option<u64>, SlurmError> {
        let name = format!("--name={name}");
        let arguments = ["--noheader", "--states=all", "--Format=ArrayJobID:|", &name].map(OsString::from);
        let text = self.commands.once("squeue", &arguments)?;
        Ok(text.lines().find_map(|line| line.trim().trim_end_matches('|').parse().ok()))
    }

    /// How far the tasks of some jobs are, all of them.
    ///
    /// # Errors
    /// Where Slurm cannot be asked, or says what cannot be read.
    pub fn states(&self, jobs: &[ArrayJob]) -> Result<BTreeMap<TaskId, TaskState>, SlurmError> {
        let mut found = BTreeMap::new();
        // States of all tasks of a job that are not told one by one.
        let mut together = BTreeMap::new();
        for jobs in jobs.chunks(JOBS_A_COMMAND) {
            self.ask_squeue(jobs, &mut found, &mut together)?;
            let forgotten = |job: &&ArrayJob| job.tasks().any(|(_, task)| !found.contains_key(&task));
            let forgotten: Vec<ArrayJob> = jobs.iter().filter(forgotten).copied().collect();
            if self.settings.accounting && !forgotten.is_empty() {
                self.ask_sacct(&forgotten, &mut found)?;
            }
        }
        let tasks = jobs.iter().flat_map(ArrayJob::tasks);
        let mut state = |task: &TaskId| found.remove(task).or_else(|| together.get(&task.job).cloned());
        Ok(tasks.map(|(_, task)| (task, state(&task).unwrap_or(TaskState::Unknown))).collect())
    }

    fn ask_squeue(
        &self,
        jobs: &[ArrayJob],
        found: &mut BTreeMap<TaskId, TaskState>,
        together: &mut BTreeMap<u64, TaskState>,
    ) -> Result<(), SlurmError> {
        let format = format!("--Format={SQUEUE_FIELDS}");
        let arguments =
            ["--noheader", "--array", "--states=all", &format, &format!("--jobs={}", list(jobs))].map(OsString::from);
        let text = match self.commands.run("squeue", &arguments) {
            Err(SlurmError::Failed { stderr, .. }) if stderr.contains(NO_SUCH_JOB) => String::new(),
            other => other?,
        };
        for line in text.lines().filter(|line| !line.trim().is_empty()) {
            let read = read_squeue(line);
            let (job, index, state) = read.ok_or_else(|| {
                SlurmError::unreadable(&shown("squeue", &arguments), line, "job|task|state|reason|status was expected")
            })?;
            match index {
                Some(index) => drop(found.insert(TaskId { job, index }, state)),
                None => drop(together.insert(job, state)),
            }
        }
        Ok(())
    }

    /// Adds what is not known yet.
    fn ask_sacct(&self, jobs: &[ArrayJob], found: &mut BTreeMap<TaskId, TaskState>) -> Result<(), SlurmError> {
        let arguments = [
            "--noheader",
            "--parsable2",
            "--allocations",
            "--format=JobID,State,ExitCode",
            &format!("--jobs={}", list(jobs)),
        ]
        .map(OsString::from);
        let text = self.commands.run("sacct", &arguments)?;
        for line in text.lines().filter(|line| !line.trim().is_empty()) {
            let read = read_sacct(line);
            let read = read.ok_or_else(|| {
                SlurmError::unreadable(&shown("sacct", &arguments), line, "job_task|state|status was expected")
            })?;
            if let Some((task, state)) = read {
                found.entry(task).or_insert(state);
            }
        }
        Ok(())
    }

    /// Cancels all tasks of some jobs that have not ended.
    ///
    /// # Errors
    /// Where Slurm cannot be asked, or refuses.
    pub fn cancel(&self, jobs: &[ArrayJob]) -> Result<(), SlurmError> {
        jobs.chunks(JOBS_A_COMMAND).try_for_each(|jobs| self.scancel(jobs.iter().map(|job| job.job.to_string())))
    }

    /// Cancels some tasks, as far as they have not ended.
    ///
    /// # Errors
    /// Where Slurm cannot be asked, or refuses.
    pub fn cancel_tasks(&self, tasks: &[TaskId]) -> Result<(), SlurmError> {
        tasks.chunks(JOBS_A_COMMAND).try_for_each(|tasks| self.scancel(tasks.iter().map(TaskId::to_string)))
    }

    fn scancel(&self, names: impl Iterator<Item = String>) -> Result<(), SlurmError> {
        // Without --quiet it complains of those that have ended.
        let arguments: Vec<OsString> = std::iter::once("--quiet".to_owned()).chain(names).map(OsString::from).collect();
        if arguments.len() == 1 {
            return Ok(());
        }
        match self.commands.run("scancel", &arguments) {
            Err(SlurmError::Failed { stderr, .. }) if stderr.contains(NO_SUCH_JOB) => Ok(()),
            other => other.map(drop),
        }
    }
}

fn list(jobs: &[ArrayJob]) -> String {
    jobs.iter().map(|job| job.job.to_string()).collect::<Vec<_>>().join(",")
}

fn option(name: &str, value: &OsStr) -> OsString {
    let mut option = OsString::from(name);
    option.push(value);
    option
}

#[cfg(test)]
mod tests;
