//! The planning folder of a generated patient: all that a host knows of one.

use super::metaimage::{self, Lattice};
use super::{PHASES, Phantom, REFERENCE_PHASE, SKIN_TRIANGLES, State};
use crate::error::{Error, Result};
use crate::geometry::{file, ply};
use glam::DVec3;
use rayon::prelude::*;
use std::fmt::Write as _;
use std::io::Write as _;
use std::path::Path;

/// Space around the skin.
const MARGIN_MM: f64 = 10.0;
const SPACING_MM: std::ops::RangeInclusive<f64> = 1.0..=20.0;
/// Level of the tumour's mesh: 5120 triangles.
const LEVEL: u32 = 4;

impl Phantom {
    /// Writes the planning folder, which is made if it is not there: `planning.toml`; `skin.ply` and
    /// `tumour.ply` at the reference phase; `dvf_00.mha` to `dvf_90.mha`, the displacement of the
    /// reference phase's points to each phase on a lattice around the body, in millimetres; and where
    /// `ct` is asked for, `ct_50.mha`, the reference phase in Hounsfield units on the same lattice.
    ///
    /// # Errors
    /// A spacing outside 1 to 20 mm, and what the system refuses.
    pub fn export_planning(&self, folder: &Path, spacing_mm: f64, ct: bool) -> Result<()> {
        if !SPACING_MM.contains(&spacing_mm) {
            let (least, most) = (SPACING_MM.start(), SPACING_MM.end());
            return Err(Error::input(
                "spacing of displacement fields in mm",
                spacing_mm,
                format!("{least} to {most}"),
            ));
        }
        std::fs::create_dir_all(folder).map_err(|e| Error::io(folder, e))?;
        let skin = self.skin(SKIN_TRIANGLES)?;
        let lattice = lattice(skin.bounds().unwrap_or_default(), spacing_mm);
        ply::write_mesh(&folder.join("skin.ply"), &skin)?;
        let tumour = self.tumour_mesh(&State::REFERENCE, LEVEL);
        ply::write_mesh(&folder.join("tumour.ply"), &tumour)?;
        for tenth in 0..PHASES {
            let state = self.planning_phase(tenth);
            let voxel = |x| {
                let u = self.displacement(x, &state).as_vec3().to_array();
                let bytes = u.map(f32::to_le_bytes);
                std::array::from_fn::<u8, 12, _>(|i| bytes[i / 4][i % 4])
            };
            let path = folder.join(dvf(tenth));
            metaimage::write_vectors(&path, &lattice, |k| plane(&lattice, k, voxel))?;
        }
        if ct {
            let voxel = |x| {
                let hounsfield = self.hounsfield(x, &State::REFERENCE).round();
                (hounsfield as i16).to_le_bytes()
            };
            let path = folder.join(CT);
            metaimage::write_shorts(&path, &lattice, |k| plane(&lattice, k, voxel))?;
        }
        let text = self.planning_toml(spacing_mm, ct);
        file::write_whole(&folder.join("planning.toml"), |out| {
            out.write_all(text.as_bytes())
        })
    }

    fn planning_toml(&self, spacing_mm: f64, ct: bool) -> String {
        let mut text = format!("name = {:?}\n", self.patient().name);
        let reference = REFERENCE_PHASE * 10;
        // Writing to a string cannot fail.
        let _ = writeln!(text, "reference_phase = {reference}");
        let _ = writeln!(text, "isocentre_mm = [0.0, 0.0, 0.0]");
        let _ = writeln!(text, "spacing_mm = {spacing_mm:?}");
        let _ = writeln!(text, "skin = \"skin.ply\"\ntumour = \"tumour.ply\"");
        if ct {
            let _ = writeln!(text, "ct = \"{CT}\"");
        }
        for tenth in 0..PHASES {
            let (percent, file) = (tenth * 10, dvf(tenth));
            let _ = writeln!(text, "\n[[phase]]\npercent = {percent}\nfield = \"{file}\"");
        }
        text
    }
}

const CT: &str = "ct_50.mha";

fn dvf(tenth: usize) -> String {
    format!("dvf_{tenth}0.mha")
}

/// A lattice that holds a box and some space around it.
fn lattice((lo, hi): (DVec3, DVec3), spacing_mm: f64) -> Lattice {
    let (lo, hi) = (lo - MARGIN_MM, hi + MARGIN_MM);
    let size = ((hi - lo) / spacing_mm).ceil().to_array();
    Lattice {
        size: size.map(|n| n as usize + 1),
        spacing_mm,
        origin_mm: lo,
    }
}

/// The bytes of the voxels of one z.
fn plane<const N: usize>(
    lattice: &Lattice,
    z: usize,
    voxel: impl Fn(DVec3) -> [u8; N] + Sync,
) -> Vec<u8> {
    let [nx, ny, _] = lattice.size;
    let mut bytes = vec![[0; N]; nx * ny];
    bytes.par_chunks_mut(nx).enumerate().for_each(|(y, row)| {
        for (x, bytes) in row.iter_mut().enumerate() {
            *bytes = voxel(lattice.point([x, y, z]));
        }
    });
    bytes.into_flattened()
}
