//! The workspace of a campaign: facts on disk, under their keys.
//!
//! | Place | What it is |
//! |---|---|
//! | `campaign.json` | which campaign the folder belongs to |
//! | `stages/GROUP/NAME` | result of a task; whole or absent |
//! | `stages/GROUP/NAME.staging` | a task that was begun |
//! | `orders/NAME.json` | what a task consists of, for the process that computes it |
//! | `claims/NAME.N` | a task that is being computed |
//! | `failed/NAME.json` | why a task failed |
//! | `logs/NAME.log` | what its process said |
//! | `results.csv`, `summary.csv`, `load.json`, `figures/` | what came out |
//!
//! NAME is 32 digits of the task's key and 8 of that of its outputs; GROUP the stage's name.

use super::CampaignError;
use super::file::Campaign;
use super::task::Task;
use crate::stage::key::{lacking, value_of};
use crate::storage::StorageError;
use crate::storage::staging::{STAGING_SUFFIX, write_whole};
use serde::{Deserialize, Serialize};
use serde_json::{Value, json};
use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::{Path, PathBuf};

/// Version of the workspace's layout.
const FORMAT: u64 = 1;

/// Which campaign a folder belongs to.
const RECORD: &str = "campaign.json";

/// A campaign's folder.
#[derive(Debug, Clone)]
pub struct Workspace {
    /// The folder.
    pub root: PathBuf,
}

/// Why a task failed.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct Failure {
    /// Exit status that `tollgate run` would have ended with.
    pub exit_code: u8,
    /// In words.
    pub reason: String,
    /// Where it was computed.
    pub host: String,
}

/// What a process needs to compute a task.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Order {
    /// The scene, as an absolute path.
    pub scene: PathBuf,
    /// Changed settings: dotted key, TOML value.
    pub settings: Vec<(String, String)>,
    /// Name of the stage.
    pub stage: String,
    /// Whether it is a whole run.
    pub is_whole: bool,
    /// Key of the task.
    pub key: String,
    /// Key of its outputs.
    pub outputs_key: String,
    /// What groups it.
    pub group: String,
    /// Results of the stages upstream of it, by the stage's name, relative to the workspace.
    pub upstream: BTreeMap<String, PathBuf>,
}

impl Workspace {
    /// The workspace in `root`, whether it is there or not, unless the folder belongs to something else.
    ///
    /// # Errors
    /// When the folder holds something else.
    pub fn at(root: &Path, campaign: &Campaign) -> Result<Self, CampaignError> {
        let record = root.join(RECORD);
        let shown = root.display();
        let refused = |what: String| Err(CampaignError::Request(format!("{what}; choose another --out")));
        let Ok(text) = fs::read_to_string(&record) else {
            let is_ours = |name: &str| name.ends_with(STAGING_SUFFIX);
            let mut entries = fs::read_dir(root).into_iter().flatten().flatten();
            if root.is_file() || entries.any(|entry| !is_ours(&entry.file_name().to_string_lossy())) {
                return refused(format!("the folder {shown} is not empty and holds no campaign"));
            }
            return Ok(Self { root: root.to_path_buf() });
        };
        let held: Value = serde_json::from_str(&text).unwrap_or_default();
        if held["format"] != FORMAT {
            return refused(format!("{} was written by another version of this program", record.display()));
        }
        if held["campaign"] != campaign.name.as_str() {
            return refused(format!("the folder {shown} belongs to the campaign {}", held["campaign"]));
        }
        Ok(Self { root: root.to_path_buf() })
    }

    /// Makes the folder and says in it whose it is.
    ///
    /// # Errors
    /// When the disk refuses.
    pub fn make(&self, campaign: &Campaign) -> Result<(), StorageError> {
        let record = self.root.join(RECORD);
        if record.is_file() {
            return Ok(());
        }
        write_whole(&record, format!("{}\n", json!({"format": FORMAT, "campaign": campaign.name})).as_bytes())
    }

    /// The workspace that a process of a campaign was pointed at.
    ///
    /// # Errors
    /// When there is none.
    pub fn existing(root: &Path) -> Result<Self, CampaignError> {
        if root.join(RECORD).is_file() {
            return Ok(Self { root: root.to_path_buf() });
        }
        Err(CampaignError::Request(format!("{} holds no campaign; `tollgate campaign run` makes one", root.display())))
    }

    /// Where the result of a task is or will be.
    #[must_use]
    pub fn place(&self, group: &str, name: &str) -> PathBuf {
        self.root.join("stages").join(group).join(name)
    }

    /// Where a task is computed.
    #[must_use]
    pub fn staging(&self, group: &str, name: &str) -> PathBuf {
        self.root.join("stages").join(group).join(format!("{name}{STAGING_SUFFIX}"))
    }

    /// The folder of claims.
    #[must_use]
    pub fn claims(&self) -> PathBuf {
        self.root.join("claims")
    }

    /// The log of a task.
    #[must_use]
    pub fn log(&self, name: &str) -> PathBuf {
        self.root.join("logs").join(format!("{name}.log"))
    }

    fn order_place(&self, name: &str) -> PathBuf {
        self.root.join("orders").join(format!("{name}.json"))
    }

    fn failure_place(&self, name: &str) -> PathBuf {
        self.root.join("failed").join(format!("{name}.json"))
    }

    /// Writes down what a task consists of; `upstream` are the results it needs, by the stage's name, relative to the workspace.
    ///
    /// # Errors
    /// When the disk refuses.
    pub fn write_order(
        &self,
        campaign: &Campaign,
        task: &Task,
        upstream: BTreeMap<String, PathBuf>,
    ) -> Result<(), StorageError> {
        let order = Order {
            scene: std::path::absolute(&campaign.scene).unwrap_or_else(|_| campaign.scene.clone()),
            settings: task.settings.clone(),
            stage: task.stage.clone(),
            is_whole: task.is_whole,
            key: task.key.clone(),
            outputs_key: task.outputs_key.clone(),
            group: task.group(),
            upstream,
        };
        let text = serde_json::to_vec_pretty(&order).expect("an order is names and texts");
        write_whole(&self.order_place(&task.name()), &text)
    }

    /// Reads what a task consists of.
    ///
    /// # Errors
    /// When there is no such task, or its file is damaged.
    pub fn order(&self, name: &str) -> Result<Order, StorageError> {
        let place = self.order_place(name);
        let text = fs::read(&place).map_err(|source| StorageError::system("read", &place, source))?;
        serde_json::from_slice(&text).map_err(|error| StorageError::unusable(&place, error.to_string()))
    }

    /// Notes that a task failed.
    ///
    /// # Errors
    /// When the disk refuses.
    pub fn note_failure(&self, name: &str, failure: &Failure) -> Result<(), StorageError> {
        let text = serde_json::to_vec_pretty(failure).expect("a failure is texts and a number");
        write_whole(&self.failure_place(name), &text)
    }

    /// Why a task failed.
    #[must_use]
    pub fn failure(&self, name: &str) -> Option<Failure> {
        let text = fs::read(self.failure_place(name)).ok()?;
        serde_json::from_slice(&text).ok()
    }

    /// Forgets that a task failed, and what was computed of it.
    ///
    /// # Errors
    /// When the disk refuses.
    pub fn forget_failure(&self, group: &str, name: &str) -> Result<(), StorageError> {
        let staging = self.staging(group, name);
        if staging.exists() {
            fs::remove_dir_all(&staging).map_err(|source| StorageError::system("remove", &staging, source))?;
        }
        let place = self.failure_place(name);
        match fs::remove_file(&place) {
            Err(source) if source.kind() != std::io::ErrorKind::NotFound => {
                Err(StorageError::system("remove", &place, source))
            }
            _ => Ok(()),
        }
    }
}

/// What is in a workspace, read once.
#[derive(Debug, Clone, Default)]
pub struct Contents {
    /// Results and begun tasks by group: names of folders.
    pub stages: BTreeMap<String, BTreeSet<String>>,
    /// Tasks that failed.
    pub failed: BTreeSet<String>,
    /// Files of claims.
    pub claims: Vec<String>,
}

impl Contents {
    /// Looks at a workspace.
    #[must_use]
    pub fn of(workspace: &Workspace) -> Self {
        let names = |folder: &Path| -> BTreeSet<String> {
            let entries = fs::read_dir(folder).into_iter().flatten().flatten();
            entries.filter_map(|entry| entry.file_name().into_string().ok()).collect()
        };
        let stages = workspace.root.join("stages");
        let groups = names(&stages).into_iter().map(|group| (group.clone(), names(&stages.join(&group))));
        let failed = names(&workspace.root.join("failed"));
        Self {
            stages: groups.collect(),
            failed: failed.iter().filter_map(|name| name.strip_suffix(".json")).map(str::to_owned).collect(),
            claims: super::claim::names(&workspace.claims()),
        }
    }

    /// Whether a task was begun and has no result.
    #[must_use]
    pub fn is_begun(&self, task: &Task) -> bool {
        let folders = self.stages.get(&task.group());
        folders.is_some_and(|names| names.contains(&format!("{}{STAGING_SUFFIX}", task.name())))
    }

    /// The result of a task: its own, or of the same stage with more outputs.
    #[must_use]
    pub fn result(&self, workspace: &Workspace, task: &Task) -> Stored {
        let (group, name) = (task.group(), task.name());
        let Some(names) = self.stages.get(&group) else { return Stored::Nothing };
        if names.contains(&name) {
            return Stored::Whole(name);
        }
        let start = format!("{}.", &task.key[..32]);
        let others = names.range(start.clone()..).take_while(|other| other.starts_with(&start));
        let mut missing = Stored::Nothing;
        for other in others.filter(|other| !other.ends_with(STAGING_SUFFIX)) {
            let record = workspace.place(&group, other).join("run.json");
            let held = fs::read(&record).ok().and_then(|text| serde_json::from_slice::<Value>(&text).ok());
            let lacks = held.map_or_else(Vec::new, |held| lacking(&held["outputs"], &value_of(&task.outputs)));
            if lacks.is_empty() {
                return Stored::Whole(other.clone());
            }
            missing = Stored::Lacking(lacks);
        }
        missing
    }
}

/// What a workspace holds of a task.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Stored {
    /// No result.
    Nothing,
    /// A result, in the folder of this name.
    Whole(String),
    /// A result without some of the outputs.
    Lacking(Vec<String>),
}
