//! `tollgate doctor`: what is installed, what it can do, and what to install.

use super::print;
use serde_json::{Value, json};
use std::ffi::OsStr;
use std::fmt::Write;
use std::path::PathBuf;
use tollgate::backend::liggghts::probe::{self, HOW_TO_INSTALL, Kind, PROGRAM_VARIABLE, Probe, Tools, Unusable};
use tollgate::backend::native;
use tollgate::exit_code;
use tollgate::verify::{self, CaseResult};

#[derive(Debug, clap::Args)]
pub struct Arguments {
    /// The findings as JSON on stdout
    #[arg(long)]
    json: bool,
}

/// Case of `tollgate verify` that shows in no time that the solver works here.
const CASE: &str = "chung-ooi-7";

struct Native {
    threads: usize,
    instructions: Vec<&'static str>,
    check: CaseResult,
}

struct Findings {
    native: Native,
    liggghts: Result<Probe, Unusable>,
    tools: Tools,
    yade: Option<PathBuf>,
}

pub fn run(arguments: &Arguments) -> u8 {
    let findings = Findings::gather();
    if arguments.json {
        print::result(&format!("{:#}", findings.json()));
    } else {
        print::result(&findings.text());
    }
    if findings.native.check.passed() { exit_code::DONE } else { exit_code::OUT_OF_TOLERANCE }
}

impl Findings {
    fn gather() -> Self {
        let suite = verify::suite();
        let case = suite.iter().find(|case| case.name == CASE).expect("the case is in the suite");
        let native = Native {
            threads: native::processor::physical_cores(),
            instructions: instructions(),
            check: verify::run_case(case, &mut verify::Native),
        };
        let yade = ["yade", "yade-batch"].iter().find_map(|name| probe::find(OsStr::new(name)));
        Self { native, liggghts: probe::probe(), tools: Tools::find(), yade }
    }

    fn text(&self) -> String {
        let mut text = String::new();
        let Native { threads, instructions, check } = &self.native;
        let works = if check.passed() { "works" } else { "DOES NOT WORK: run `tollgate verify`" };
        let _ =
            writeln!(text, "native    {works} (tollgate {}, {CASE} of `tollgate verify`)", env!("CARGO_PKG_VERSION"));
        let _ = writeln!(text, "          {threads} processor cores, {}", instructions.join(", "));
        match &self.liggghts {
            Ok(probe) => liggghts_text(probe, &mut text),
            Err(unusable) => {
                let _ = writeln!(text, "liggghts  not usable: {unusable}");
            }
        }
        for (name, path, package, purpose) in self.starters() {
            let found =
                path.map_or_else(|| format!("missing: `apt-get install {package}`"), |path| path.display().to_string());
            let _ = writeln!(text, "          {name}: {found} ({purpose})");
        }
        let yade =
            self.yade.as_ref().map_or_else(|| "not found".to_owned(), |path| format!("found: {}", path.display()));
        let _ = writeln!(text, "yade      {yade}; this version does not use it");
        text
    }

    fn starters(&self) -> [(&'static str, Option<&PathBuf>, &'static str, &'static str); 3] {
        let Tools { mpirun, stdbuf, setpriv } = &self.tools;
        [
            ("mpirun", mpirun.as_ref(), "openmpi-bin", "more than one rank"),
            ("stdbuf", stdbuf.as_ref(), "coreutils", "errors are seen"),
            ("setpriv", setpriv.as_ref(), "util-linux", "nothing is left behind"),
        ]
    }

    fn json(&self) -> Value {
        let Native { threads, instructions, check } = &self.native;
        let tools: serde_json::Map<String, Value> =
            self.starters().into_iter().map(|(name, path, ..)| (name.to_owned(), json!(path))).collect();
        let mut liggghts = match &self.liggghts {
            Ok(probe) => json!({
                "usable": probe.lacking().is_empty(),
                "path": probe.path,
                "version": probe.version,
                "lacking": probe.lacking().iter().map(|(kind, style)| format!("{}: {style}", kind.heading())).collect::<Vec<_>>(),
                "styles": probe.styles.iter().map(|(kind, styles)| (kind.heading().to_owned(), json!(styles))).collect::<serde_json::Map<_, _>>(),
            }),
            Err(unusable) => json!({ "usable": false, "reason": unusable.to_string(), "install": HOW_TO_INSTALL }),
        };
        liggghts["tools"] = tools.into();
        json!({
            "native": {
                "usable": check.passed(),
                "version": env!("CARGO_PKG_VERSION"),
                "threads": threads,
                "instructions": instructions,
            },
            "liggghts": liggghts,
            "yade": { "usable": false, "path": self.yade },
        })
    }
}

fn liggghts_text(probe: &Probe, text: &mut String) {
    let lacking = probe.lacking();
    let works = if lacking.is_empty() { "has what decks need" } else { "LACKS WHAT DECKS NEED" };
    let _ = writeln!(
        text,
        "liggghts  {works} ({} {}; another one: {PROGRAM_VARIABLE})",
        probe.path.display(),
        probe.version
    );
    for kind in [Kind::Normal, Kind::Tangential, Kind::Rolling, Kind::Cohesion] {
        let known: Vec<&str> = probe.styles.get(&kind).into_iter().flatten().map(String::as_str).collect();
        let _ = writeln!(text, "          {}: {}", kind.heading(), known.join(", "));
    }
    for (kind, style) in &lacking {
        let _ = writeln!(
            text,
            "          missing in {}: {style}; install Debian's with `{HOW_TO_INSTALL}`",
            kind.heading()
        );
    }
}

/// Vector instructions of this processor that compilers use for numbers of double precision.
fn instructions() -> Vec<&'static str> {
    let mut found = Vec::new();
    #[cfg(target_arch = "x86_64")]
    {
        found.push("sse2");
        found.extend(std::arch::is_x86_feature_detected!("avx2").then_some("avx2"));
        found.extend(std::arch::is_x86_feature_detected!("fma").then_some("fma"));
        found.extend(std::arch::is_x86_feature_detected!("avx512f").then_some("avx512f"));
    }
    #[cfg(target_arch = "aarch64")]
    found.push("neon");
    found
}
