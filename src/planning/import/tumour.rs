//! The tumour: a mesh as somebody has outlined it, or the surface of a mask.

use crate::isosurface::{Parts, isosurface};
use crate::metaimage;
use crate::planning::fit::{Moments, closed};
use phasmid_core::error::{Error, Result};
use phasmid_geometry::{Mesh, extension};
use std::path::Path;

/// Level of a mask's surface: midway between outside (0) and tumour (1).
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
        // A planning has no use for colours and textures.
        let mesh = Mesh {
            vertices: mesh.vertices,
            triangles: mesh.triangles,
            ..Mesh::default()
        };
        Ok(Self { mesh, moments })
    }
}

/// All parts of a mask: what lies apart belongs to the target too.
fn of_mask(path: &Path, place: &str) -> Result<Mesh> {
    let mask = metaimage::read_volume(path)?;
    let numbers = (0..mask.voxels().len()).map(|n| f64::from(mask.voxels().get(n)));
    let (least, most) = numbers.fold((f64::MAX, f64::MIN), |(a, b), x| (a.min(x), b.max(x)));
    let allowed = "a mask: 0 outside and 1 in the tumour";
    if least < 0.0 || most > 1.0 {
        // Of labels, or of 255 for 1, the surface would not lie midway.
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
