//! What of a workspace nobody refers to any more.

use super::claim::{Claimed, Watch};
use super::task::Graph;
use super::workspace::{Contents, Workspace};
use super::{CampaignError, results};
use crate::storage::StorageError;
use crate::storage::staging::STAGING_SUFFIX;
use std::collections::BTreeSet;
use std::fs;
use std::path::PathBuf;

/// A result, or the beginning of one, that no run of the campaign refers to.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Unreferenced {
    /// Its folder.
    pub place: PathBuf,
    /// What it takes on the disk [bytes].
    pub bytes: u64,
    /// Further files of it.
    more: Vec<PathBuf>,
}

/// Everything that no run of `graph`, the whole campaign, refers to; what somebody is computing stays.
#[must_use]
pub fn unreferenced(workspace: &Workspace, graph: &Graph) -> Vec<Unreferenced> {
    let contents = Contents::of(workspace);
    let mut kept: BTreeSet<(String, String)> = BTreeSet::new();
    for task in &graph.tasks {
        kept.insert((task.group(), task.name()));
        if let super::workspace::Stored::Whole(folder) = contents.result(workspace, task) {
            kept.insert((task.group(), folder));
        }
    }
    let mut watch = Watch::default();
    let mut found = Vec::new();
    for (group, names) in &contents.stages {
        for folder in names {
            let name = folder.strip_suffix(STAGING_SUFFIX).unwrap_or(folder);
            let mut is_claimed = || matches!(watch.look(&workspace.claims(), name, &contents.claims), Claimed::By(_));
            if kept.contains(&(group.clone(), name.to_owned())) || is_claimed() {
                continue;
            }
            let place = workspace.place(group, folder);
            let more = ["orders", "failed"].map(|kind| workspace.root.join(kind).join(format!("{name}.json")));
            let more = more.into_iter().chain([workspace.log(name)]).filter(|path| path.exists()).collect();
            found.push(Unreferenced { bytes: results::size_of(&place), place, more });
        }
    }
    found
}

/// Removes what is unreferenced.
///
/// # Errors
/// When the disk refuses; what was removed before is gone.
pub fn remove(found: &[Unreferenced]) -> Result<(), CampaignError> {
    for one in found {
        fs::remove_dir_all(&one.place).map_err(|source| StorageError::system("remove", &one.place, source))?;
        for path in &one.more {
            fs::remove_file(path).map_err(|source| StorageError::system("remove", path, source))?;
        }
    }
    Ok(())
}
