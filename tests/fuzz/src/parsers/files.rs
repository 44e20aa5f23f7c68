//! Binary files, read from disk like a user's files.

use phasmid::decode::{Plan, load_frames};
use phasmid::geometry::Mesh;
use phasmid::pattern::{Image, Manifest};
use std::path::PathBuf;

/// Calls `read` with the path of a file that holds these bytes and exists until `read` returns.
pub fn with_file(extension: &str, bytes: &[u8], read: impl FnOnce(PathBuf) -> bool) -> bool {
    let thread = std::thread::current().id();
    let name = format!("phasmid-fuzz-{}-{thread:?}.{extension}", std::process::id());
    let path = std::env::temp_dir().join(name);
    std::fs::write(&path, bytes).expect("a small file can be written");
    let known = read(path.clone());
    std::fs::remove_file(path).expect("the file exists");
    known
}

fn mesh(extension: &str, bytes: &[u8]) -> bool {
    with_file(extension, bytes, |path| {
        let Ok(mesh) = Mesh::read(&path) else {
            return false;
        };
        mesh.checked("fuzz")
            .expect("a mesh that was read can be rendered");
        true
    })
}

/// Reads an STL file, binary or text.
pub fn stl(bytes: &[u8]) -> bool {
    mesh("stl", bytes)
}

/// Reads a Wavefront OBJ file.
pub fn obj(bytes: &[u8]) -> bool {
    mesh("obj", bytes)
}

/// Reads a Stanford PLY file, as a mesh and as a cloud.
pub fn ply(bytes: &[u8]) -> bool {
    let cloud = with_file("ply", bytes, |path| {
        phasmid::geometry::ply::read_cloud(&path).is_ok()
    });
    mesh("ply", bytes) || cloud
}

/// Reads a camera image of a sequence.
pub fn image(bytes: &[u8]) -> bool {
    let frame = |name: &str, phase: f64| {
        format!(
            "[[frame]]\nfile = \"{name}\"\npattern = {{ kind = \"fringe\", axis = \"x\", \
             period_px = 16, phase_rad = {phase} }}\n"
        )
    };
    with_file("png", bytes, |path| {
        let name = path
            .file_name()
            .expect("the path has a file name")
            .to_string_lossy();
        let frames: String = [0.0, 2.0, 4.0].map(|phase| frame(&name, phase)).concat();
        let text = format!("[projector]\nwidth_px = 64\nheight_px = 64\n{frames}");
        let manifest = Manifest::parse(&text, "fuzz").expect("a manifest");
        let plan = Plan::new(&manifest).expect("three steps");
        let folder = path.parent().expect("the path has a parent folder");
        let Ok(images) = load_frames(&manifest, &plan, folder) else {
            return false;
        };
        Image::common_size(&images).expect("checked when loaded");
        true
    })
}
