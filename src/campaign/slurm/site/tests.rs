//! Site files, good ones and bad ones.

use super::*;

fn wrong(text: &str) -> Vec<(&'static str, usize, String)> {
    let findings = Site::from_text(text, "cluster.toml").expect_err("findings");
    assert!(findings.iter().all(|finding| finding.file == "cluster.toml"));
    findings
        .into_iter()
        .map(|finding| (finding.rule, finding.line, format!("{}; {}", finding.what, finding.next)))
        .collect()
}

const WHOLE: &str = r#"
account = "chemeng"
partition = "short"
qos = "normal"
reservation = "course"
constraint = "[rack1|rack2]"
modules = ["gcc/12", "openmpi"]
setup = ["export OMP_PROC_BIND=true"]
launcher = ["srun", "--mpi=pmix"]
wall_time = "2 h"
signal_lead = "2 min"
memory = "1.5 GB"
cpus = 8
max_array_size = 500
throttle = 20
sbatch = ["--gres=gpu:1", "-x node7"]
"#;

#[test]
fn every_key_is_read() {
    let site = Site::from_text(WHOLE, "cluster.toml").unwrap();
    let texts = |texts: &[&str]| texts.iter().map(|text| (*text).to_owned()).collect::<Vec<_>>();
    let expected = Site {
        account: Some("chemeng".into()),
        partition: Some("short".into()),
        qos: Some("normal".into()),
        reservation: Some("course".into()),
        constraint: Some("[rack1|rack2]".into()),
        modules: texts(&["gcc/12", "openmpi"]),
        setup: texts(&["export OMP_PROC_BIND=true"]),
        launcher: texts(&["srun", "--mpi=pmix"]),
        wall_time: 7200.0,
        signal_lead: 120,
        memory: Some(3 << 29),
        cpus: Some(8),
        max_array_size: Some(500),
        throttle: Some(20),
        sbatch: texts(&["--gres=gpu:1", "-x node7"]),
    };
    assert_eq!(site, expected);
}

#[test]
fn the_least_file_is_a_wall_time() {
    let site = Site::from_text("wall_time_h = 2", "cluster.toml").unwrap();
    assert_eq!((site.wall_time, site.signal_lead, site.memory), (7200.0, 60, None));
    assert!(site.modules.is_empty() && site.account.is_none());
    let missing = wrong("");
    assert!(missing.len() == 1 && missing[0].2.contains("the site file has no `wall_time`"), "{missing:?}");
}

#[test]
fn everything_wrong_is_said_at_once_with_its_line() {
    let text = "acount = \"a\"\npartition = 3\nqos = \"two words\"\nmodules = \"gcc\"\nsetup = [\"a\\nb\"]\nmemory = \"4 kg\"\n\
                cpus = 0\nthrottle = -1\nsbatch = [\"gres=gpu\", \"--time=3\", \"-J x\"]\nsignal_lead = \"3 mm\"\n";
    let found = wrong(text);
    let expected = [
        ("missing-key", 1, "`wall_time`"),
        ("unknown-key", 1, "`acount` is not a key of the site file; did you mean `account`?"),
        ("wrong-type", 2, "`partition` must be a string, not an integer"),
        ("bad-name", 3, "two words"),
        ("wrong-type", 4, "`modules` must be an array of strings"),
        ("bad-name", 5, "one entry a line"),
        ("bad-quantity", 6, "4 GB"),
        ("out-of-range", 7, "at least 1"),
        ("out-of-range", 8, "not be negative"),
        ("bad-name", 9, "without `#SBATCH`"),
        ("key-not-here", 9, "the key `wall_time`"),
        ("key-not-here", 9, "--job-name"),
        ("wrong-dimension", 10, "a unit of a length"),
    ];
    assert_eq!(found.len(), expected.len(), "{found:#?}");
    for ((rule, line, says), (expected_rule, expected_line, part)) in found.iter().zip(expected) {
        assert!(
            *rule == expected_rule && *line == expected_line && says.contains(part),
            "{rule} {line} {says}: {part}"
        );
    }
}

#[test]
fn a_wall_time_that_leaves_no_time_is_refused() {
    assert!(wrong("wall_time = \"2 min\"")[0].2.contains("leaves no time to compute"));
    assert!(Site::from_text("wall_time = \"2 min\"\nsignal_lead = \"30 s\"", "x").is_ok());
}

#[test]
fn a_file_that_is_not_there_is_named() {
    let findings = Site::read(Path::new("/no/such/cluster.toml")).expect_err("missing");
    assert!(findings[0].what.contains("/no/such/cluster.toml") && findings[0].rule == "file-unreadable");
    assert!(Site::read(Path::new("/")).is_err());
    assert_eq!(wrong("a = = 1\n")[0].0, "toml-syntax");
}

#[test]
fn the_page_explains_every_key() {
    let page = include_str!("../../../../docs/slurm.md");
    let (_, keys) = crate::scene::schema::SITE_SECTIONS[0];
    for key in keys {
        assert!(page.contains(&format!("`{key}`")), "docs/slurm.md does not explain `{key}`");
        assert!(WHOLE.contains(&format!("\n{key} =")), "{key}");
    }
    for (block, text) in page.split("```").enumerate().filter(|(index, _)| index % 2 == 1) {
        if let Some(text) = text.strip_prefix("ini site\n") {
            assert!(Site::from_text(text, "slurm.md").is_ok(), "block {block} of docs/slurm.md is no site file");
        }
    }
}
