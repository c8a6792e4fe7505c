//! `tollgate plan`: what follows from a scene.

use super::{SceneArguments, print};
use tollgate::backend::{liggghts, native};
use tollgate::math::lanes::SimdLevel;
use tollgate::plan::{self, stages::SplitPlan};
use tollgate::stage::split::stage_jobs;
use tollgate::{exit_code, scene};

#[derive(Debug, clap::Args)]
pub struct Arguments {
    #[command(flatten)]
    pub scene: SceneArguments,
    /// Threads that the run will have [default: one a physical core]
    #[arg(long, value_parser = super::threads)]
    pub threads: Option<usize>,
    /// Instruction set that the run will have: scalar, baseline, avx2 or avx512 [default: the fastest there is]
    #[arg(long, value_parser = super::simd)]
    pub simd: Option<SimdLevel>,
    /// The plan as JSON on stdout
    #[arg(long)]
    pub json: bool,
}

pub fn run(arguments: &Arguments) -> u8 {
    let (scene, warnings) = match scene::read(&arguments.scene.scene, &arguments.scene.all_settings()) {
        Ok(read) => read,
        Err(findings) => {
            print::message(&arguments.scene.rendered(&findings));
            return exit_code::USAGE;
        }
    };
    let processor = native::processor::Processor::new(arguments.threads, arguments.simd);
    let first = plan::plan(&scene, None);
    let calibration = native::calibrate::calibrate(&scene, &first, processor, native::calibrate::TIME);
    let (json, text, is_refused) = if scene.stages.is_empty() {
        let mut plan = plan::plan(&scene, calibration);
        plan.backends.push(liggghts::verdict(&scene, &[], &[]));
        (serde_json::to_string_pretty(&plan), plan.to_text(), plan.is_refused())
    } else {
        let mut plan = SplitPlan::of(&scene, calibration);
        for (stage, job) in plan.stages.iter_mut().zip(stage_jobs(&scene)) {
            stage.backends.push(liggghts::verdict(&job.scene, &job.records, &job.replays));
        }
        (serde_json::to_string_pretty(&plan), plan.to_text(), plan.is_refused())
    };
    if arguments.json {
        print::result(&json.expect("a plan is plain numbers and names"));
    } else {
        print::message(&arguments.scene.rendered(&warnings));
        print::result(&text);
    }
    if is_refused { exit_code::USAGE } else { exit_code::DONE }
}
