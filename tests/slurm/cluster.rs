//! A Slurm of one node in a temporary folder: its own munge, controller and node daemon on free ports of the loopback. It needs no
//! root; without, the daemons run as the user. Whatever happens, dropping it ends all that it started.

use std::collections::BTreeMap;
use std::ffi::OsString;
use std::fs;
use std::net::TcpListener;
use std::os::unix::fs::{OpenOptionsExt, PermissionsExt};
use std::os::unix::process::CommandExt;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Output, Stdio};
use std::time::{Duration, Instant};
use tempfile::TempDir;
use tollgate::campaign::slurm::{
    ArrayJob, ArrayRequest, Cluster, Commands, Prerequisite, Site, Submission, TaskId, TaskScript, TaskState,
    write_tasks,
};

/// Longest wait for anything: a busy computer takes its time.
const PATIENCE: Duration = Duration::from_secs(50);
/// Most tasks in an array, so small that arrays are cut.
pub const MAX_ARRAY_SIZE: u64 = 5;
/// Processors of the node, whatever the computer has.
pub const CPUS: u32 = 2;

/// A running Slurm.
pub struct Slurm {
    folder: TempDir,
    daemons: Vec<Child>,
}

impl Slurm {
    /// Starts one and waits until its node takes jobs.
    pub fn start() -> Self {
        let folder = tempfile::Builder::new().prefix("tollgate-slurm-").tempdir().unwrap();
        // Jobs of other users never run here, but munge wants its socket to be reachable.
        fs::set_permissions(folder.path(), fs::Permissions::from_mode(0o711)).unwrap();
        let mut slurm = Self { folder, daemons: Vec::new() };
        for name in ["state", "spool", "munge"] {
            fs::create_dir(slurm.path(name)).unwrap();
            fs::set_permissions(slurm.path(name), fs::Permissions::from_mode(0o711)).unwrap();
        }
        // A munge that reads no other key lets nobody in who has not this one.
        let mut key = fs::OpenOptions::new().write(true).create_new(true).mode(0o600).open(slurm.path("key")).unwrap();
        let mut random = fs::File::open("/dev/urandom").unwrap();
        std::io::copy(&mut std::io::Read::take(&mut random, 128), &mut key).unwrap();
        drop(key);
        // Another program may take a free port before the daemon does.
        for attempt in 1.. {
            slurm.start_daemons();
            if slurm.waits_until_idle() {
                return slurm;
            }
            slurm.stop_daemons();
            assert!(attempt < 3, "Slurm did not start:\n{}", slurm.logs());
        }
        unreachable!("it starts or it panics")
    }

    pub fn path(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    fn start_daemons(&mut self) {
        let shown = |name: &str| self.path(name).display().to_string();
        fs::write(self.path("slurm.conf"), self.configuration()).unwrap();
        let munge: Vec<String> = ["socket", "pid-file", "seed-file", "log-file"]
            .iter()
            .map(|file| format!("--{file}={}", shown(&format!("munge/{file}"))))
            .chain([format!("--key-file={}", shown("key")), "--foreground".into(), "--force".into()])
            .collect();
        let munged = self.daemon("munged", &munge);
        self.daemons.push(munged);
        let socket = self.path("munge/socket");
        wait_until("munge answers", || std::os::unix::net::UnixStream::connect(&socket).is_ok());
        // Clean starts: nothing of an attempt before.
        for name in ["slurmctld", "slurmd"] {
            let daemon = self.daemon(name, &["-D".to_owned(), "-c".to_owned()]);
            self.daemons.push(daemon);
        }
    }

    fn daemon(&self, name: &str, arguments: &[String]) -> Child {
        let log = fs::File::create(self.path(&format!("{name}.log"))).unwrap();
        let program = find(name).unwrap_or_else(|| panic!("{name} is missing; ./run-tests installs it"));
        // Where this process is killed, nobody is left to drop anything.
        let mut command = Command::new("setpriv");
        command.args(["--pdeathsig", "KILL"]).arg(program).args(arguments).env("SLURM_CONF", self.path("slurm.conf"));
        command.process_group(0).stdin(Stdio::null()).stderr(log.try_clone().unwrap()).stdout(log);
        command.current_dir(self.folder.path()).spawn().unwrap()
    }

    fn configuration(&self) -> String {
        let host = fs::read_to_string("/proc/sys/kernel/hostname").unwrap();
        let host = host.trim().split('.').next().unwrap();
        let folder = self.folder.path().display();
        let [control, node] = free_ports();
        let user = user();
        format!(
            "ClusterName=tollgate\n\
             SlurmctldHost={host}(127.0.0.1)\n\
             SlurmUser={user}\n\
             SlurmdUser={user}\n\
             SlurmctldPort={control}\n\
             SlurmdPort={node}\n\
             AuthType=auth/munge\n\
             CredType=cred/munge\n\
             # The shortest: a job that is queued again waits for so long.\n\
             AuthInfo=socket={folder}/munge/socket,cred_expire=5\n\
             StateSaveLocation={folder}/state\n\
             SlurmdSpoolDir={folder}/spool\n\
             SlurmctldPidFile={folder}/slurmctld.pid\n\
             SlurmdPidFile={folder}/slurmd.pid\n\
             ProctrackType=proctrack/linuxproc\n\
             TaskPlugin=task/none\n\
             JobAcctGatherType=jobacct_gather/none\n\
             MpiDefault=none\n\
             SwitchType=switch/none\n\
             SelectType=select/cons_tres\n\
             SelectTypeParameters=CR_CPU_Memory\n\
             SlurmdParameters=config_overrides\n\
             SchedulerParameters=batch_sched_delay=0,sched_interval=1,bf_interval=1\n\
             ReturnToService=2\n\
             KillWait=2\n\
             MaxArraySize={MAX_ARRAY_SIZE}\n\
             MinJobAge=60\n\
             NodeName={host} NodeAddr=127.0.0.1 CPUs={CPUS} RealMemory={memory}\n\
             PartitionName=main Nodes={host} Default=YES MaxTime=INFINITE State=UP\n",
            memory = memory_megabytes(),
        )
    }

    fn waits_until_idle(&mut self) -> bool {
        let started = Instant::now();
        while started.elapsed() < PATIENCE {
            let answer = self.command("sinfo", &["--noheader", "--format=%T"]);
            if answer.status.success() && answer.stdout == b"idle\n" {
                return true;
            }
            if self.daemons.iter_mut().any(|daemon| daemon.try_wait().unwrap().is_some()) {
                return false;
            }
            std::thread::sleep(Duration::from_millis(20));
        }
        false
    }

    fn logs(&self) -> String {
        let log = |name: &&str| {
            format!("== {name}\n{}", fs::read_to_string(self.path(&format!("{name}.log"))).unwrap_or_default())
        };
        ["munged", "slurmctld", "slurmd"].iter().map(log).collect()
    }

    /// One of Slurm's commands, by hand.
    pub fn command(&self, name: &str, arguments: &[&str]) -> Output {
        Command::new(name).args(arguments).env("SLURM_CONF", self.path("slurm.conf")).output().unwrap()
    }

    /// Moves the end of a running task's wall time, whose shortest is a minute otherwise.
    pub fn set_end(&self, task: TaskId, end: &str) {
        let answer = self.command("scontrol", &["update", &format!("JobId={task}"), &format!("EndTime={end}")]);
        assert!(answer.status.success(), "{answer:?}");
    }

    /// What is tested here.
    pub fn cluster(&self) -> Cluster {
        Cluster::connect(Commands::default().with_variable("SLURM_CONF", self.path("slurm.conf"))).unwrap()
    }

    /// A workspace whose tasks are a line of shell; it gets the key as `$1`.
    pub fn workspace(&self, name: &str, task: &str) -> Workspace {
        Workspace::new(self.path(name), task)
    }

    fn stop_daemons(&mut self) {
        // Munge last, without which the others cannot end their talks.
        while let Some(mut daemon) = self.daemons.pop() {
            let group = daemon.id();
            signal("TERM", group);
            let started = Instant::now();
            while daemon.try_wait().is_ok_and(|ended| ended.is_none()) && started.elapsed() < Duration::from_secs(3) {
                std::thread::sleep(Duration::from_millis(5));
            }
            signal("KILL", group);
            drop(daemon.kill());
            drop(daemon.wait());
        }
    }

    /// Jobs and what watches over them outlive the daemons; they are known by the configuration in their environment.
    fn kill_jobs(&self) {
        let mark = format!("SLURM_CONF={}", self.path("slurm.conf").display());
        for entry in fs::read_dir("/proc").into_iter().flatten().flatten() {
            let environment = fs::read(entry.path().join("environ")).unwrap_or_default();
            let is_ours = environment.split(|&byte| byte == 0).any(|variable| variable == mark.as_bytes());
            if let (true, Some(process)) = (is_ours, entry.file_name().to_str()) {
                drop(Command::new("kill").args(["-KILL", process]).stderr(Stdio::null()).status());
            }
        }
    }
}

impl Drop for Slurm {
    #[expect(clippy::print_stderr, reason = "shown with the test that failed")]
    fn drop(&mut self) {
        if std::thread::panicking() {
            let queue = self.command("scontrol", &["--oneliner", "show", "job"]);
            eprintln!("{}\n{}", self.logs(), String::from_utf8_lossy(&queue.stdout));
        }
        self.stop_daemons();
        self.kill_jobs();
    }
}

/// To all processes of a group.
fn signal(name: &str, group: u32) {
    let target = format!("-{group}");
    drop(Command::new("kill").args([&format!("-{name}"), "--", &target]).stderr(Stdio::null()).status());
}

/// A program of the search path or of the folders for administrators, which are not in every user's.
fn find(name: &str) -> Option<PathBuf> {
    let search = std::env::var_os("PATH").unwrap_or_default();
    let folders = std::env::split_paths(&search).chain(["/usr/sbin", "/sbin"].map(PathBuf::from));
    folders.map(|folder| folder.join(name)).find(|path| path.is_file())
}

fn user() -> String {
    let output = Command::new("id").arg("-un").output().unwrap();
    String::from_utf8(output.stdout).unwrap().trim().to_owned()
}

/// Two ports that are free now.
fn free_ports() -> [u16; 2] {
    // Both are held until both are known.
    let listeners = [(); 2].map(|()| TcpListener::bind("127.0.0.1:0").unwrap());
    listeners.map(|listener| listener.local_addr().unwrap().port())
}

/// The computer's memory [MB].
fn memory_megabytes() -> u64 {
    let text = fs::read_to_string("/proc/meminfo").unwrap();
    let line = text.lines().find_map(|line| line.strip_prefix("MemTotal:")).unwrap();
    line.trim().trim_end_matches("kB").trim().parse::<u64>().unwrap() / 1024
}

/// Waits until something holds.
///
/// # Panics
/// Where it does not within [`PATIENCE`].
pub fn wait_until(what: &str, mut holds: impl FnMut() -> bool) {
    let started = Instant::now();
    while !holds() {
        assert!(started.elapsed() < PATIENCE, "in vain: {what}");
        std::thread::sleep(Duration::from_millis(20));
    }
}

/// A folder with a script, its tasks and their logs.
pub struct Workspace {
    folder: PathBuf,
    command: Vec<OsString>,
}

impl Workspace {
    fn new(folder: PathBuf, task: &str) -> Self {
        fs::create_dir(&folder).unwrap();
        // `$0` is the workspace.
        let command = ["bash".into(), "-c".into(), task.into(), folder.clone().into_os_string()];
        Self { folder, command: command.into() }
    }

    pub fn path(&self, name: &str) -> PathBuf {
        self.folder.join(name)
    }

    /// Writes the script for keys `k0`, `k1`, ... and a site file.
    pub fn write(&self, name: &str, count: u64, site: &str) -> PathBuf {
        let site = Site::from_text(site, "site.toml").unwrap();
        let keys: Vec<String> = (0..count).map(|number| format!("k{number}")).collect();
        let tasks = self.path(&format!("{name}.tasks"));
        write_tasks(&tasks, &keys).unwrap();
        let script = TaskScript {
            site: &site,
            command: &self.command,
            tasks: &tasks,
            logs: &self.path("logs"),
            title: name,
            threads: 1,
            ranks: 1,
            memory: 10 << 20,
        };
        let path = self.path(&format!("{name}.sh"));
        script.write(&path).unwrap();
        path
    }

    /// Submits `count` tasks.
    pub fn submit(&self, cluster: &Cluster, name: &str, count: u64, throttle: Option<u64>) -> Submission {
        self.submit_after(cluster, name, count, &[], throttle)
    }

    /// Submits `count` tasks that wait for others.
    pub fn after(&self, cluster: &Cluster, name: &str, count: u64, after: &[Prerequisite]) -> Submission {
        self.submit_after(cluster, name, count, after, None)
    }

    fn submit_after(
        &self,
        cluster: &Cluster,
        name: &str,
        count: u64,
        after: &[Prerequisite],
        throttle: Option<u64>,
    ) -> Submission {
        let script = self.write(name, count, "wall_time = \"1 h\"");
        let logs = self.path("logs");
        let request = ArrayRequest {
            script: &script,
            count,
            name,
            workspace: &self.folder,
            logs: &logs,
            after,
            throttle,
            max_array_size: None,
        };
        cluster.submit(&request).unwrap()
    }

    /// What a task left under its key.
    pub fn left(&self, key: &str) -> Option<String> {
        fs::read_to_string(self.path(key)).ok()
    }

    pub fn log(&self, task: TaskId) -> String {
        fs::read_to_string(self.path("logs").join(format!("{task}.log"))).unwrap_or_default()
    }
}

/// The states of a submission's tasks, in the order of their lines.
pub fn states(cluster: &Cluster, submission: &Submission) -> Vec<TaskState> {
    let states: BTreeMap<TaskId, TaskState> = cluster.states(&submission.jobs).unwrap();
    submission.tasks().map(|(_, task)| states[&task].clone()).collect()
}

/// Waits until all tasks of a submission have come to an end, and returns their states.
pub fn ends(cluster: &Cluster, submission: &Submission) -> Vec<TaskState> {
    let mut last = Vec::new();
    wait_until("all tasks end", || {
        last = states(cluster, submission);
        !last.iter().any(TaskState::is_live)
    });
    last
}

/// Only the jobs' numbers.
pub fn jobs(submission: &Submission) -> Vec<u64> {
    submission.jobs.iter().map(|&ArrayJob { job, .. }| job).collect()
}

/// A file appears.
pub fn wait_for(path: &Path) {
    wait_until(&format!("{} appears", path.display()), || path.exists());
}
