//! A campaign on Slurm, with the program itself: twelve jobs, eleven of which wait for the first; one fails by design; the scheduler is
//! killed in the middle and started again.

use crate::cluster::{Slurm, wait_until};
use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Output, Stdio};

const HOPPER: &str = include_str!("../scenes/gate/hopper.toml");

/// The sixth floor is so high that the heap backs up to the gate.
const FLOORS: [u32; 11] = [130, 132, 134, 136, 138, 196, 140, 142, 144, 146, 148];

struct Campaign<'a> {
    slurm: &'a Slurm,
    folder: PathBuf,
}

impl<'a> Campaign<'a> {
    fn new(slurm: &'a Slurm) -> Self {
        let folder = slurm.path("it's a campaign");
        fs::create_dir(&folder).unwrap();
        fs::write(folder.join("scene.toml"), HOPPER).unwrap();
        fs::write(folder.join("site.toml"), "wall_time = \"1 h\"\n").unwrap();
        let floors: Vec<String> = FLOORS.iter().map(|height| format!("[0, 0, {height}]")).collect();
        let text = format!(
            "version = 1\n[set]\n\"output.frames\" = \"100 ms\"\n\"gate.outlet.paths.every\" = 4\n\"feed.fill.amount\" = 80\n\
             \"end.time\" = \"0.25 s\"\n[[axis]]\nname = \"floor\"\nkeys = \"part.floor.point_mm\"\nvalues = [{}]\n",
            floors.join(", ")
        );
        fs::write(folder.join("campaign.toml"), text).unwrap();
        Self { slurm, folder }
    }

    fn command(&self, out: &str, further: &[&str]) -> Command {
        let mut command = Command::new(env!("CARGO_BIN_EXE_tollgate"));
        command.current_dir(&self.folder).args(["campaign", "run", ".", "--out", out]).args(further);
        command.env("SLURM_CONF", self.slurm.path("slurm.conf")).stdin(Stdio::null());
        command
    }

    fn start(&self, further: &[&str]) -> Child {
        let mut command = self.command("out", &[&["--scheduler", "slurm", "--site", "site.toml"], further].concat());
        command.stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap()
    }

    /// Rows of the results without what was measured on a clock.
    fn results(&self, out: &str) -> Vec<BTreeMap<String, String>> {
        let mut table = csv::Reader::from_path(self.folder.join(out).join("results.csv")).unwrap();
        let header: Vec<String> = table.headers().unwrap().iter().map(str::to_owned).collect();
        let is_kept = |name: &String| !name.ends_with("cpu_s") && !name.ends_with("memory_bytes");
        let rows = table.records().map(|row| row.unwrap());
        rows.map(|row| header.iter().cloned().zip(row.iter().map(str::to_owned)).filter(|(n, _)| is_kept(n)).collect())
            .collect()
    }
}

fn ended(output: &Output, code: i32) {
    assert_eq!(output.status.code(), Some(code), "{}", String::from_utf8_lossy(&output.stderr));
}

fn entries(folder: &Path) -> usize {
    fs::read_dir(folder).map_or(0, Iterator::count)
}

#[test]
fn twelve_jobs_one_of_which_fails_come_to_the_right_table_though_the_scheduler_is_killed() {
    let slurm = Slurm::start();
    let campaign = Campaign::new(&slurm);
    let mut first = campaign.start(&[]);
    let heaps = campaign.folder.join("out/stages/heap");
    wait_until("the first heap is done", || entries(&heaps) > 1 || first.try_wait().unwrap().is_some());
    first.kill().unwrap();
    first.wait().unwrap();
    // What it had submitted goes on, and the next one finds it.
    let jobs = || fs::read_to_string(campaign.folder.join("out/slurm/jobs.json")).unwrap();
    let submitted = jobs();
    let second = campaign.start(&[]).wait_with_output().unwrap();
    ended(&second, 9);
    assert_eq!(jobs(), submitted, "nothing was submitted twice");
    // The same campaign on this computer alone.
    ended(&campaign.command("local", &[]).output().unwrap(), 9);
    let results = campaign.results("out");
    assert_eq!(results, campaign.results("local"));
    let failed: Vec<&str> =
        results.iter().filter(|row| row["status"] == "failed").map(|row| row["floor"].as_str()).collect();
    assert_eq!(failed, ["[0, 0, 196]"]);
    assert_eq!(results.iter().filter(|row| row["status"] == "done").count(), FLOORS.len() - 1);
    // Every task was computed once: a log has one line of a start each.
    let logs = fs::read_dir(campaign.folder.join("out/slurm/logs")).unwrap().map(|entry| entry.unwrap().path());
    let logs: Vec<PathBuf> = logs.filter(|path| !path.is_symlink()).collect();
    assert_eq!(logs.len(), 12);
    for log in logs {
        let text = fs::read_to_string(&log).unwrap();
        assert_eq!(text.matches("(0.0 %)").count(), 1, "{}: {text}", log.display());
    }
    // Failed ones are submitted again when asked, and only these.
    ended(&campaign.start(&["--rerun", "failed"]).wait_with_output().unwrap(), 9);
    assert_ne!(jobs(), submitted);
    assert_eq!(campaign.results("out"), results);
}

#[test]
fn a_campaign_without_slurm_says_what_is_missing() {
    let folder = tempfile::tempdir().unwrap();
    fs::write(folder.path().join("scene.toml"), HOPPER).unwrap();
    fs::write(folder.path().join("campaign.toml"), "version = 1\n").unwrap();
    fs::write(folder.path().join("site.toml"), "wall_time = \"1 h\"\n").unwrap();
    let run = |further: &[&str]| {
        let mut command = Command::new(env!("CARGO_BIN_EXE_tollgate"));
        command.current_dir(folder.path()).args(["campaign", "run", ".", "--scheduler", "slurm"]).args(further);
        command.env("PATH", "/nowhere").output().unwrap()
    };
    let no_site = run(&[]);
    ended(&no_site, 2);
    assert!(String::from_utf8_lossy(&no_site.stderr).contains("needs --site FILE"));
    let missing = run(&["--site", "site.toml"]);
    assert!(missing.status.code().is_some_and(|code| code != 0), "{missing:?}");
    assert!(String::from_utf8_lossy(&missing.stderr).contains("scontrol"), "{missing:?}");
    fs::write(folder.path().join("site.toml"), "wal_time = \"1 h\"\n").unwrap();
    let wrong = run(&["--site", "site.toml"]);
    ended(&wrong, 2);
    assert!(String::from_utf8_lossy(&wrong.stderr).contains("did you mean `wall_time`?"), "{wrong:?}");
}
