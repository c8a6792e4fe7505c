//! The script: what stands in it, and that bash takes it as it is meant whatever the paths.

use super::*;
use std::fs;
use std::process::{Command, Stdio};

fn site(text: &str) -> Site {
    Site::from_text(text, "cluster.toml").unwrap()
}

fn script<'a>(site: &'a Site, folder: &'a Path, command: &'a [OsString]) -> TaskScript<'a> {
    TaskScript {
        site,
        command,
        tasks: folder,
        logs: folder,
        title: "heap, 12 variants\nof a chute",
        threads: 2,
        ranks: 1,
        memory: 300 << 20,
    }
}

fn lines(text: &str) -> Vec<&str> {
    text.lines().filter(|line| line.starts_with("#SBATCH")).collect()
}

#[test]
fn a_plain_site_asks_for_what_the_task_needs() {
    let site = site("wall_time = \"26 h\"");
    let text = script(&site, Path::new("/w"), &["tollgate".into()]).render().unwrap();
    let expected = [
        "#SBATCH --nodes=1",
        "#SBATCH --ntasks=1",
        "#SBATCH --cpus-per-task=2",
        "#SBATCH --mem=300M",
        "#SBATCH --time=1-02:00:00",
        "#SBATCH --signal=B:USR1@60",
        "#SBATCH --requeue",
        "#SBATCH --open-mode=append",
        "#SBATCH --kill-on-invalid-dep=no",
    ];
    assert_eq!(lines(&text), expected);
    assert!(text.starts_with("#!/bin/bash\n# heap, 12 variants of a chute\n"), "{text}");
    assert!(text.contains("\ntollgate \"$key\" --threads 2 &\n") && !text.contains("{{"), "{text}");
}

#[test]
fn the_site_goes_before_what_the_campaign_asks_for() {
    let site = site(
        "wall_time = \"90 min\"\nsignal_lead = \"5 min\"\naccount = \"chem\"\npartition = \"long\"\nconstraint = \"a&b\"\ncpus = 8\n\
         memory = \"2 GB\"\nmodules = [\"gcc/12\", \"it's\"]\nsetup = [\"export A=1\"]\nlauncher = [\"srun\", \"--mpi=pmix\"]\n\
         sbatch = [\"--gres=gpu:1\"]",
    );
    let text = script(&site, Path::new("/w"), &["tollgate".into()]).render().unwrap();
    for line in [
        "#SBATCH --cpus-per-task=8",
        "#SBATCH --mem=2048M",
        "#SBATCH --time=0-01:30:00",
        "#SBATCH --signal=B:USR1@300",
        "#SBATCH --account=chem",
        "#SBATCH --partition=long",
        "#SBATCH --constraint=a&b",
        "#SBATCH --gres=gpu:1",
        "module load gcc/12 || { echo 'the module gcc/12 cannot be loaded' >&2; exit 3; }",
        "export A=1",
        "export TOLLGATE_MPI_LAUNCHER=$'srun\\012--mpi=pmix'",
        "tollgate \"$key\" --threads 8 &",
    ] {
        assert!(text.lines().any(|found| found == line), "no {line} in\n{text}");
    }
    let module = text.lines().find(|line| line.starts_with("module load") && line.contains("it'")).unwrap();
    assert_eq!(module, r"module load 'it'\''s' || { echo 'the module it'\''s cannot be loaded' >&2; exit 3; }");
}

#[test]
fn bash_reads_every_word_as_it_was() {
    let words: Vec<OsString> = ["plain", "", "a b", "it's", "\"$HOME\" `id`", "new\nline\\", "é%!*", "-n"]
        .map(OsString::from)
        .into_iter()
        .chain([OsString::from(OsStr::from_bytes(b"no utf-8 \xff'\\"))])
        .collect();
    let line: Vec<String> = words.iter().map(|word| quoted(word)).collect();
    let output = Command::new("bash").args(["-c", &format!("printf '%s\\0' {}", line.join(" "))]).output().unwrap();
    let expected: Vec<u8> = words.iter().flat_map(|word| [word.as_bytes(), b"\0"].concat()).collect();
    assert_eq!(output.stdout, expected);
}

/// A folder in which the script runs without Slurm: `scontrol` writes down what it is asked for.
struct Place {
    folder: tempfile::TempDir,
}

impl Place {
    fn new() -> Self {
        let folder = tempfile::Builder::new().prefix("it's a \"50%\" $HOME ").tempdir().unwrap();
        let place = Self { folder };
        // Not by this process: a command that another thread is just starting would hold the file open, and it could not be run.
        let write = "echo '#!/bin/sh\necho \"$@\" >> \"$(dirname \"$0\")/asked\"' > \"$0\"; chmod +x \"$0\"";
        let status = Command::new("sh").args(["-c", write]).arg(place.path("scontrol")).status();
        assert!(status.unwrap().success());
        place
    }

    fn path(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    /// The script of a task that is a line of shell, for keys `aa` and `bb`.
    fn command(&self, task: &str, site_text: &str) -> Command {
        write_tasks(&self.path("tasks"), &["aa".to_owned(), "bb".to_owned()]).unwrap();
        let site = site(site_text);
        let command = ["bash", "-c", task].map(OsString::from);
        let script = TaskScript { tasks: &self.path("tasks"), ..script(&site, self.folder.path(), &command) };
        script.write(&self.path("script.sh")).unwrap();
        let mut command = Command::new("bash");
        command.arg(self.path("script.sh")).stdin(Stdio::null()).stdout(Stdio::piped()).stderr(Stdio::piped());
        let search = format!("{}:{}", self.folder.path().display(), std::env::var("PATH").unwrap());
        command.env("PATH", search).env("SLURM_ARRAY_JOB_ID", "7").env("SLURM_ARRAY_TASK_ID", "0");
        command
    }
}

#[test]
fn a_task_gets_its_key_and_ends_as_it_ends() {
    let place = Place::new();
    let output = place.command("echo \"$0 $1 $2\"; exit 5", "wall_time_h = 1").arg("1").output().unwrap();
    let said = String::from_utf8_lossy(&output.stdout);
    assert!(output.status.code() == Some(5) && said.contains("\nbb --threads 2\n"), "{said}");
    assert_eq!(fs::read_link(place.path("bb.log")).unwrap(), Path::new("7_0.log"));
    let output = place.command("exit 0", "wall_time_h = 1").arg("2").output().unwrap();
    let said = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.code() == Some(2) && said.contains("there is no line 3 in"), "{said}");
}

#[test]
fn a_module_that_cannot_be_loaded_ends_the_task() {
    let place = Place::new();
    let text = "wall_time_h = 1\nmodules = [\"no-such/1\"]";
    let output = place.command("echo computed", text).arg("0").output().unwrap();
    let said = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.code() == Some(3) && said.contains("the module no-such/1 cannot be loaded"), "{said}");
    assert!(!String::from_utf8_lossy(&output.stdout).contains("computed"));
}

/// Runs a task to which a signal is sent once it says that it is ready; its exit status, and what `scontrol` was asked for.
fn signalled(signal: &str, task: &str) -> (Option<i32>, String) {
    let place = Place::new();
    let ready = place.path("ready");
    let child = place.command(task, "wall_time_h = 1").arg("0").env("READY", &ready).spawn().unwrap();
    while !ready.exists() {
        std::thread::sleep(std::time::Duration::from_millis(5));
    }
    assert!(Command::new("kill").args([signal, &child.id().to_string()]).status().unwrap().success());
    let output = child.wait_with_output().unwrap();
    (output.status.code(), fs::read_to_string(place.path("asked")).unwrap_or_default())
}

#[test]
fn a_checkpoint_at_the_end_of_the_wall_time_queues_the_task_again() {
    let loops = "touch \"$READY\"; while :; do sleep 0.02; done";
    let again = (Some(130), "requeue 7_0\n".to_owned());
    assert_eq!(signalled("-USR1", &format!("trap 'exit 130' TERM; {loops}")), again);
    // It takes a while to write.
    assert_eq!(signalled("-USR1", &format!("trap 'sleep 0.3; exit 130' TERM; {loops}")), again);
    // It was just finished.
    assert_eq!(signalled("-USR1", &format!("trap 'exit 0' TERM; {loops}")), (Some(0), String::new()));
    assert_eq!(signalled("-USR1", &format!("trap 'exit 4' TERM; {loops}")), (Some(4), String::new()));
    // One that cannot write a checkpoint would start from the beginning for ever.
    assert_eq!(signalled("-USR1", loops).1, "");
    // Somebody else wants it to end.
    assert_eq!(signalled("-TERM", &format!("trap 'exit 130' TERM; {loops}")), (Some(130), String::new()));
}

#[test]
fn keys_that_are_none_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    let refused = write_tasks(&folder.path().join("tasks"), &["a b".to_owned()]).unwrap_err();
    assert!(refused.to_string().contains("\"a b\""), "{refused}");
    write_tasks(&folder.path().join("tasks"), &["0af".to_owned(), "1".to_owned()]).unwrap();
    assert_eq!(fs::read_to_string(folder.path().join("tasks")).unwrap(), "0af\n1\n");
}
