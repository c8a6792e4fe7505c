//! `tollgate deck`: the decks of an external code, rendered and not run.

use super::{SceneArguments, print};
use std::path::PathBuf;
use tollgate::exit_code;
use tollgate::run::deck::{DeckRequest, render};

#[derive(Debug, clap::Args)]
pub struct Arguments {
    #[command(flatten)]
    scene: SceneArguments,
    /// Folder for the cases, one a stage; never overwritten
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
    /// Only this stage; may be repeated
    #[arg(long = "stage", value_name = "NAME")]
    stages: Vec<String>,
    /// A run in which the stages upstream have recorded their streams [default: runs/<scene>]
    #[arg(long, value_name = "RUN")]
    run: Option<PathBuf>,
    /// Do not cut at the gates: each last stage with all that is upstream of it in one deck
    #[arg(long)]
    whole: bool,
    /// Use streams although they do not fit the scene
    #[arg(long)]
    accept_stream: bool,
}

pub fn run(arguments: &Arguments) -> u8 {
    let request = DeckRequest {
        scene: arguments.scene.scene.clone(),
        settings: arguments.scene.all_settings(),
        out: arguments.out.clone(),
        stages: arguments.stages.clone(),
        run: arguments.run.clone(),
        whole: arguments.whole,
        accept_stream: arguments.accept_stream,
    };
    match render(&request) {
        Ok(cases) => {
            for case in cases {
                print::result(&format!("{}: {}", case.stage, case.command));
                case.warnings.iter().for_each(|warning| print::message(&format!("{}: warning: {warning}", case.stage)));
            }
            exit_code::DONE
        }
        Err(error) => {
            print::message(&super::run::explain(&arguments.scene, &error));
            error.exit_code()
        }
    }
}
