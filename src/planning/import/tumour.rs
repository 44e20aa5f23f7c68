//! The tumour: a mesh, or the surface of a mask.

use crate::isosurface::{Parts, isosurface};
use crate::metaimage;
use crate::planning::fit::{Moments, closed};
use phasmid_core::error::{Error, Result};
use phasmid_geometry::{Mesh, extension};
use std::path::Path;

/// Level of a mask's surface, half-way between outside (0) and tumour (1).
const MIDWAY: f64 = 0.5;

/// A tumour in the CT's LPS.
pub(super) struct Tumour {
    pub(super) mesh: Mesh,
    pub(super) moments: Moments,
}

impl Tumour {
    /// Reads a closed mesh, or a MetaImage whose voxels are 0 outside and 1 in the tumour.
    pub(super) fn read(path: &Path) -> Result<Self> {
        let place = path.display().to_string();
        let mesh = match extension(path).as_str() {
            "mha" | "mhd" => of_mask(path, &place)?,
            "stl" | "obj" | "ply" => Mesh::read(path)?,
            other => {
                let allowed = ".stl, .obj or .ply, or a mask as .mha or .mhd";
                return Err(Error::input(place, format!("extension `{other}`"), allowed));
            }
        };
        let moments = closed(&mesh, &place)?;
        // Drop colours and texture coordinates.
        let mesh = Mesh {
            vertices: mesh.vertices,
            triangles: mesh.triangles,
            ..Mesh::default()
        };
        Ok(Self { mesh, moments })
    }
}

/// Extracts the surface of all parts of a mask; separate parts belong to the target too.
fn of_mask(path: &Path, place: &str) -> Result<Mesh> {
    let mask = metaimage::read_volume(path)?;
    let numbers = (0..mask.voxels().len()).map(|n| f64::from(mask.voxels().get(n)));
    let (least, most) = numbers.fold((f64::MAX, f64::MIN), |(a, b), x| (a.min(x), b.max(x)));
    let allowed = "a mask: 0 outside and 1 in the tumour";
    if least < 0.0 || most > 1.0 {
        // With labels, or 255 instead of 1, the level would not be half-way.
        return Err(Error::input(
            place,
            format!("numbers from {least} to {most}"),
            allowed,
        ));
    }
    if most < MIDWAY {
        return Err(Error::input(place, "no voxel of the tumour", allowed));
    }
    isosurface(&mask, MIDWAY, Parts::All, place)
}
