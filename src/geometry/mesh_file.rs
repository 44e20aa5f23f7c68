//! Reads meshes from files; the extension selects the format.

use super::{Mesh, file, obj, ply, stl};
use phasmid_core::error::{Error, Result};
use std::path::Path;

impl Mesh {
    /// Reads `.stl` (binary or ASCII), `.obj` or `.ply` (ASCII, little or big endian), selected by
    /// the extension in any case. Coordinates are taken as millimetres. Polygons become triangle
    /// fans of up to 1000 corners; degenerate and duplicate triangles are kept, see [`Self::clean`].
    ///
    /// # Errors
    /// Returns an error if the file cannot be read, has another extension, is malformed or
    /// truncated, declares a count larger than the file, or has no triangle, an index out of range
    /// or a coordinate that is not finite.
    pub fn read(path: &Path) -> Result<Self> {
        let place = path.display().to_string();
        let parse = match extension(path).as_str() {
            "stl" => stl::parse,
            "obj" => obj::parse,
            "ply" => ply::parse_mesh,
            other => {
                return Err(Error::input(
                    place,
                    format!("extension `{other}`"),
                    ".stl, .obj or .ply",
                ));
            }
        };
        parse(&file::read(path)?, &place)
    }
}

/// Returns the extension in lower case, or an empty string.
pub fn extension(path: &Path) -> String {
    path.extension()
        .map(|e| e.to_string_lossy().to_ascii_lowercase())
        .unwrap_or_default()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_extension_decides_in_any_case() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("A.ObJ");
        std::fs::write(&path, "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n").unwrap();
        assert_eq!(Mesh::read(&path).unwrap().triangles, [[0, 1, 2]]);
        let other = Mesh::read(Path::new("torso.step")).unwrap_err();
        assert_eq!(other.exit_code(), 2);
        assert!(other.to_string().contains("`step`"), "{other}");
        assert_eq!(
            Mesh::read(Path::new("absent.stl")).unwrap_err().exit_code(),
            2
        );
    }
}
