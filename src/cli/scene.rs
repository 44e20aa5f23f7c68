//! `phasma scene`: lists the built-in scenes and checks scene files.

use crate::error::Result;
use crate::profile::{Scene, scene_names};

/// List or check scenes.
#[derive(Debug, clap::Args)]
pub struct Args {
    #[command(subcommand)]
    action: Action,
}

#[derive(Debug, clap::Subcommand)]
enum Action {
    /// List the built-in scenes.
    List,
    /// Check a scene file (or a built-in scene).
    Check {
        /// Path of a TOML file, or a built-in name.
        file: String,
    },
}

pub(super) fn run(args: &Args) -> Result<()> {
    match &args.action {
        Action::List => {
            for name in scene_names() {
                println!("{name:<16}{}", Scene::load(name)?.description);
            }
        }
        Action::Check { file } => {
            let scene = Scene::load(file)?;
            println!("{file}: ok, {} objects", scene.object.len());
        }
    }
    Ok(())
}
