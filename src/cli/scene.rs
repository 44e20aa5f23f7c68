//! `phasmid scene`: lists and prints the built-in scenes and checks scene files.

use super::options::SetArgs;
use phasmid_core::error::Result;
use phasmid_geometry::Mesh;
use phasmid_profile::{Scene, Shape, scene_names};

/// List, print or check scenes.
#[derive(Debug, clap::Args)]
pub struct Args {
    #[command(subcommand)]
    action: Action,
}

#[derive(Debug, clap::Subcommand)]
enum Action {
    /// List the built-in scenes.
    #[command(after_help = "Example:\n  phasmid scene list")]
    List,
    /// Print a scene, as a starting point for your own.
    #[command(after_help = "Example:\n  phasmid scene show sphere > mine.toml")]
    Show {
        /// Built-in name, or path of a TOML file.
        name: String,
        /// Merge the documents that it extends, and print the result without comments; implied by
        /// --set.
        #[arg(long)]
        full: bool,
        #[command(flatten)]
        set: SetArgs,
    },
    /// Check a scene file (or a built-in scene) and the meshes that it names.
    #[command(after_help = "Example:\n  phasmid scene check mine.toml")]
    Check {
        /// Path of a TOML file, or a built-in name.
        file: String,
        #[command(flatten)]
        set: SetArgs,
    },
}

pub(super) fn run(args: &Args) -> Result<()> {
    match &args.action {
        Action::List => {
            for name in scene_names() {
                println!("{name:<24}{}", Scene::load(name)?.description);
            }
        }
        Action::Show { name, full, set } => match set.of_scene()? {
            settings if *full || set.is_some() => {
                print!("{}", Scene::full_text(name, &settings)?);
            }
            _ => print!("{}", Scene::text(name)?),
        },
        Action::Check { file, set } => {
            let scene = Scene::load_with(file, &set.of_scene()?)?;
            let mut triangles = 0;
            for (i, object) in scene.object.iter().enumerate() {
                if let Shape::Mesh { file: mesh } = &object.shape {
                    let place = format!("{file}: object[{i}].shape.file");
                    let path = scene.folder.join(mesh);
                    let mut mesh = Mesh::read(&path).map_err(|e| e.at(&place))?;
                    // Keep all triangles of a deforming mesh, because they must match its
                    // keyframes' triangles.
                    if object.deform.is_none() {
                        let name = path.display().to_string();
                        let removed = mesh.clean(&name).map_err(|e| e.at(&place))?;
                        if removed.total() > 0 {
                            eprintln!("phasmid: {place}: {name}: {removed}");
                        }
                    }
                    triangles += mesh.triangles.len();
                }
                let deform = object.deform.iter().flat_map(|d| &d.keyframes);
                for (j, key) in deform.enumerate() {
                    let place = format!("{file}: object[{i}].deform.keyframes[{j}].file");
                    Mesh::read(&scene.folder.join(&key.file)).map_err(|e| e.at(place))?;
                }
            }
            let objects = match scene.object.len() {
                1 => "1 object".to_owned(),
                count => format!("{count} objects"),
            };
            println!("{file}: ok, {objects}, {triangles} triangles from files");
        }
    }
    Ok(())
}
