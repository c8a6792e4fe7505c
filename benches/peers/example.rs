//! The main example, hopper and one chute of it, from start to end: natively, and the same run with LIGGGHTS as the backend.

use crate::process::{Cost, timed};
use crate::rounds::Plan;
use crate::scene::root;
use std::fs;
use std::process::Command;

pub const NAME: &str = "main-example";
/// Heap angles of single runs scatter by 0.3 to 0.6 degrees.
const ANGLE_TOLERANCE: f64 = 2.0;
/// Backends that are compared.
pub const BACKENDS: [&str; 2] = ["native", "liggghts"];

/// What the runs came to, native first.
#[derive(Debug, Clone)]
pub struct Example {
    /// User processor time of the whole process [s], round by round.
    pub seconds: [Vec<f64>; 2],
    /// Crossings that arrived on the chute.
    pub arrived: [u64; 2],
    /// [deg]
    pub angle: [f64; 2],
}

impl Example {
    pub fn holds(&self) -> bool {
        self.arrived[0] == self.arrived[1] && (self.angle[0] - self.angle[1]).abs() <= ANGLE_TOLERANCE
    }

    /// All rounds, in alternation.
    pub fn measure(plan: &Plan) -> Self {
        let mut example = Self { seconds: [Vec::new(), Vec::new()], arrived: [0; 2], angle: [f64::NAN; 2] };
        for round in 1..=plan.rounds {
            for (which, backend) in BACKENDS.iter().enumerate() {
                let (cost, summary) = run(plan, backend);
                example.seconds[which].push(cost.user);
                (example.arrived[which], example.angle[which]) = results(&summary);
                eprintln!("{NAME}, round {round}: {backend} {:.1} s of processor time", cost.user);
            }
        }
        example
    }
}

fn run(plan: &Plan, backend: &str) -> (Cost, serde_json::Value) {
    let folder = root().join("target/peers").join(NAME);
    fs::create_dir_all(&folder).expect("a folder under target/");
    let out = folder.join(backend);
    drop(fs::remove_dir_all(&out));
    let mut command = Command::new(&plan.tollgate);
    command.arg("run").arg(root().join("examples/sinter-chute")).arg("--out").arg(&out);
    command.args(["--stage", "hopper", "--stage", "chute-40", "--threads", "1", "--backend", backend]);
    let (_, cost) = timed(&mut command, &folder.join(format!("{backend}.log")));
    let summary = fs::read_to_string(out.join("summary.json")).expect("summary.json");
    (cost, serde_json::from_str(&summary).expect("a summary in JSON"))
}

/// Crossings that arrived on the chute, and the heap's angle [deg].
fn results(summary: &serde_json::Value) -> (u64, f64) {
    let replayed =
        summary["gates"][0]["replayed"].as_array().and_then(|list| list.iter().find(|r| r["stage"] == "chute-40"));
    let arrived = replayed.and_then(|replay| replay["arrivals"]["arrived"]["count"].as_u64());
    let angle = summary["measures"]["chute-40.heap_deg"].as_f64();
    (arrived.expect("what arrived on the chute"), angle.expect("the heap's angle"))
}
