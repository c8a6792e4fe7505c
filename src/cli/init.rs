//! `tollgate init`: a commented scene that runs.

use super::print;
use std::fs;
use std::path::PathBuf;
use tollgate::exit_code;

/// The default scene.
const DEFAULT_SCENE: &str = include_str!("../../templates/scene.default.toml");

#[derive(Debug, clap::Args)]
pub struct Arguments {
    /// Folder to write scene.toml into
    #[arg(default_value = ".")]
    folder: PathBuf,
}

pub fn run(arguments: &Arguments) -> u8 {
    let path = arguments.folder.join("scene.toml");
    if path.exists() {
        print::message(&format!("{} exists and is left as it is; choose another folder", path.display()));
        return exit_code::USAGE;
    }
    let written = fs::create_dir_all(&arguments.folder).and_then(|()| fs::write(&path, DEFAULT_SCENE));
    if let Err(error) = written {
        print::message(&format!("cannot write {}: {error}", path.display()));
        return exit_code::SYSTEM;
    }
    print::result(&format!(
        "wrote {}; next: tollgate plan {}, then tollgate run {}",
        path.display(),
        arguments.folder.display(),
        arguments.folder.display()
    ));
    exit_code::DONE
}
