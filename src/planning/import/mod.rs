//! A planning folder from what a clinic has: a CT, displacement fields and a tumour.
//!
//! ```text
//!  DICOM or MetaImage ------> [ ct ] ------> skin ---\
//!  closed mesh or mask -----> [ tumour ] -> inside? --+--> planning folder
//!  MetaImage fields --------> [ fields ] -> reach? --/
//! ```
//!
//! All three are in one LPS, that of the scanner that took the CT, and so is the folder, as
//! [`planning`](super::planning) has it. A field gives, at each point of the reference phase, the way
//! to where its tissue is at its phase: what a registration says whose fixed image is the reference
//! phase and whose moving one is the other (ITK, elastix's `transformix -def all`, plastimatch's
//! `output_vf`). What does not fit together is refused before anything is written.

mod ct;
mod fields;
mod inside;
#[cfg(test)]
mod tests;
mod tumour;

use super::metaimage::{self, Packing};
use super::planning::{ALLOWED_NAME, PlanningFile};
use super::volume::{Grid, listed};
use ct::Ct;
use fields::Fields;
use glam::DVec3;
use phasmid_core::error::{Error, Result};
use phasmid_core::new_file::{check_folder, discard};
use phasmid_geometry::{Mesh, ply};
use std::path::{Path, PathBuf};
use tumour::Tumour;

/// A skin that moves less over all phases shows no breath, in millimetres.
const LEAST_MOTION_MM: f64 = 0.1;

/// No breath moves skin or tumour farther, in millimetres: what does is in another unit, or in another
/// order of bytes.
const MOST_MOTION_MM: f64 = 100.0;

/// What to make a planning folder of.
#[derive(Debug, Clone, PartialEq)]
pub struct Import {
    /// The patient's name in the planning: 1 to 64 letters, digits, `-`, `_` or `.`.
    pub name: String,
    /// The CT of the reference phase: a folder of DICOM with one series, or with the phases of a 4D-CT
    /// of which the reference phase is taken; or a MetaImage in Hounsfield units.
    pub ct: PathBuf,
    /// Level of the skin in Hounsfield units, see [`SKIN_HU`](super::isosurface::SKIN_HU).
    pub skin_hu: f64,
    /// The tumour at the reference phase: a closed mesh (PLY, STL or OBJ) in millimetres in the CT's
    /// LPS, normals outwards, or a MetaImage mask, 0 outside and 1 inside.
    pub tumour: PathBuf,
    /// The isocentre in the CT's LPS, in millimetres; the tumour's centroid if there is none.
    pub isocentre_mm: Option<DVec3>,
    /// The reference phase, in per cent of the cycle.
    pub reference_percent: f64,
    /// Displacement from the reference phase to each phase, by per cent of the cycle: 0 is the end of
    /// inhaling. The reference phase's own may be left out: nothing moves.
    pub phases: Vec<(f64, PathBuf)>,
    /// Distance of the voxels that the fields get, in millimetres, no less than they have; theirs if
    /// there is none. Breathing is smooth: fields on a CT's own grid are many times larger than they
    /// have to be, and all of them have to be in a tracker's memory.
    pub spacing_mm: Option<f64>,
    /// Whether the folder gets the CT, as MetaImage.
    pub with_ct: bool,
    /// Whether files in the folder may be replaced.
    pub force: bool,
}

/// What has been made.
#[derive(Debug, Clone, PartialEq)]
pub struct Imported {
    /// What `planning.toml` says.
    pub file: PlanningFile,
    /// What the CT is called.
    pub ct: String,
    /// Where the CT's voxels lie.
    pub ct_grid: Grid,
    /// The skin's triangles.
    pub skin_triangles: usize,
    /// The tumour's volume in cubic millimetres.
    pub tumour_mm3: f64,
    /// The tumour's centroid in the CT's LPS, in millimetres.
    pub tumour_mm: DVec3,
    /// Farthest that the tumour's centroid goes from the reference phase, in millimetres.
    pub tumour_motion_mm: f64,
    /// Farthest that any point of the skin does.
    pub skin_motion_mm: f64,
}

impl Import {
    /// Makes the folder, which may exist and, unless `force`, hold anything but files of the names that
    /// are written.
    /// `step` hears what goes on.
    ///
    /// # Errors
    /// What cannot be read; a CT with slices missing, of several series or at uneven distances, or not
    /// in Hounsfield units; fields that are not on one grid, too large in all, lie outside of the CT, do not reach skin
    /// and tumour or move the reference phase against itself; a tumour that is not closed or not in
    /// the body; an isocentre outside of the CT; what the system refuses. Nothing is left behind.
    pub fn write(&self, out: &Path, step: &dyn Fn(&str)) -> Result<Imported> {
        if !PlanningFile::is_name(&self.name) {
            let found = format!("{:?}", self.name);
            return Err(Error::input("patient's name", found, ALLOWED_NAME));
        }
        let fields = Fields::look(&self.phases, self.reference_percent, self.spacing_mm)?;
        let mut file = PlanningFile {
            name: self.name.clone(),
            ..PlanningFile::usual(
                fields.percents(),
                self.reference_percent,
                fields.target.spacing_mm,
                self.with_ct,
            )
        };
        check_folder(out, file.names(), self.force)?;
        step("CT");
        let ct = Ct::read(&self.ct, self.reference_percent)?;
        fields.lie_in(ct.volume.grid(), &ct.place)?;
        step("tumour");
        let tumour = Tumour::read(&self.tumour)?;
        file.isocentre_mm = self.isocentre(&ct, &tumour)?;
        step("skin");
        let skin = ct.skin(self.skin_hu)?;
        self.in_body(&tumour, &skin)?;
        // They are a box, so that they reach what the skin encloses too.
        fields.reach(&skin, "skin")?;

        let made = !out.exists();
        file.begin(out)?;
        let motion = (|| {
            ply::write_mesh(&out.join(&file.skin), &skin)?;
            ply::write_mesh(&out.join(&file.tumour), &tumour.mesh)?;
            if let Some(name) = &file.ct {
                step("writing the CT");
                metaimage::write_volume(&out.join(name), &ct.volume, Packing::Zlib)?;
            }
            let centroid_mm = tumour.moments.centroid_mm;
            let motion = fields.write(&file.phase, out, &skin, centroid_mm, step)?;
            if motion.skin_mm < LEAST_MOTION_MM {
                return Err(Error::input(
                    "fields",
                    format!("a skin that moves {:.3} mm at most", motion.skin_mm),
                    format!("{LEAST_MOTION_MM} mm or more: without it no breath can be seen"),
                ));
            }
            let farthest_mm = motion.skin_mm.max(motion.tumour_mm);
            if farthest_mm > MOST_MOTION_MM {
                return Err(Error::input(
                    "fields",
                    format!("skin or tumour that move up to {farthest_mm:.1} mm"),
                    format!("{MOST_MOTION_MM} mm or less: displacements in millimetres"),
                ));
            }
            // Last, so that a folder with a planning.toml is whole.
            file.write(out)?;
            Ok(motion)
        })();
        let motion = motion.inspect_err(|_| {
            // Files that were there before may be what is imported.
            if self.force {
                return;
            }
            // The first failure is the one worth telling.
            discard(out, file.names());
            if made {
                let _ = std::fs::remove_dir(out);
            }
        })?;
        Ok(Imported {
            ct_grid: *ct.volume.grid(),
            ct: ct.title,
            skin_triangles: skin.triangles.len(),
            tumour_mm3: tumour.moments.volume_mm3,
            tumour_mm: tumour.moments.centroid_mm,
            tumour_motion_mm: motion.tumour_mm,
            skin_motion_mm: motion.skin_mm,
            file,
        })
    }

    /// The isocentre: the one that is asked for, if the CT shows it.
    fn isocentre(&self, ct: &Ct, tumour: &Tumour) -> Result<DVec3> {
        let Some(at) = self.isocentre_mm else {
            return Ok(tumour.moments.centroid_mm);
        };
        let grid = ct.volume.grid();
        if at.is_finite() && grid.holds(grid.index(at)) {
            return Ok(at);
        }
        Err(Error::input(
            format!("isocentre in {}", ct.place),
            format!("{} mm", listed(at)),
            format!(
                "a point in the CT's LPS that it shows, within {}",
                grid.box_in_words()
            ),
        ))
    }

    /// Refuses a tumour that is not in the body.
    fn in_body(&self, tumour: &Tumour, skin: &Mesh) -> Result<()> {
        let outside = inside::outside(&tumour.mesh.vertices, skin);
        let Some(&first) = outside.first() else {
            return Ok(());
        };
        let all = &tumour.mesh.vertices;
        let (low, high) = skin.bounds().unwrap_or_default();
        Err(Error::input(
            self.tumour.display(),
            format!(
                "{} of {} vertices outside of the skin, {} first",
                outside.len(),
                all.len(),
                listed(all[first])
            ),
            format!(
                "a tumour in the body, whose skin is within {} to {} mm",
                listed(low),
                listed(high)
            ),
        ))
    }
}
