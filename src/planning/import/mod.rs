//! Creates a planning folder from clinical data: a CT, displacement fields and a tumour.
//!
//! ```text
//!  DICOM or MetaImage ------> [ ct ] ------> skin ---\
//!  closed mesh or mask -----> [ tumour ] -> inside? --+--> planning folder
//!  MetaImage fields --------> [ fields ] -> reach? --/
//! ```
//!
//! All three inputs, and the folder, are in the LPS of the scanner that took the CT; see
//! [`planning`](super::planning). A field gives, at each point of the reference phase, the displacement
//! of the tissue at this point to the field's own phase: the result of a registration whose fixed image
//! is the reference phase and whose moving image is the field's phase (ITK, elastix's `transformix -def
//! all`, plastimatch's `output_vf`). Inconsistent inputs are rejected before anything is written.

mod ct;
mod fields;
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
use phasmid_core::new_file::check_folder;
use phasmid_core::output_folder::OutputFolder;
use phasmid_geometry::{Mesh, ply};
use std::path::{Path, PathBuf};
use tumour::{Tumour, outside};

/// Minimum skin motion over all phases, in millimetres; below it the fields contain no breathing.
const LEAST_MOTION_MM: f64 = 0.1;

/// Maximum breathing motion of skin and tumour, in millimetres; above it the fields have other
/// units or another byte order.
const MOST_MOTION_MM: f64 = 100.0;

/// Inputs of a planning folder.
#[derive(Debug, Clone, PartialEq)]
pub struct Import {
    /// The patient's name in the planning: 1 to 64 letters, digits, `-`, `_` or `.`.
    pub name: String,
    /// The CT of the reference phase: a DICOM folder with one series or a 4D-CT that includes the
    /// reference phase, or a MetaImage in Hounsfield units.
    pub ct: PathBuf,
    /// Level of the skin in Hounsfield units, see [`SKIN_HU`](super::isosurface::SKIN_HU).
    pub skin_hu: f64,
    /// The tumour at the reference phase: a closed mesh (PLY, STL or OBJ) in millimetres in the
    /// CT's LPS, normals outwards, or a MetaImage mask, 0 outside and 1 inside.
    pub tumour: PathBuf,
    /// The isocentre in the CT's LPS, in millimetres; defaults to the tumour's centroid.
    pub isocentre_mm: Option<DVec3>,
    /// The reference phase, in per cent of the cycle.
    pub reference_percent: f64,
    /// Displacement fields from the reference phase to each phase, by per cent of the cycle; 0 is
    /// end-inhale. The field of the reference phase itself may be omitted; it is zero.
    pub phases: Vec<(f64, PathBuf)>,
    /// Voxel spacing of the written fields, in millimetres, not less than the spacing of the input,
    /// which is the default. Breathing is smooth: fields on a CT's own grid are far larger than
    /// necessary, and a tracker holds all of them in memory.
    pub spacing_mm: Option<f64>,
    /// Whether to write the CT to the folder, as MetaImage.
    pub with_ct: bool,
    /// Whether existing files in the folder may be replaced.
    pub force: bool,
}

/// Summary of an import.
#[derive(Debug, Clone, PartialEq)]
pub struct Imported {
    /// Content of `planning.toml`.
    pub file: PlanningFile,
    /// Title of the CT.
    pub ct: String,
    /// Grid of the CT.
    pub ct_grid: Grid,
    /// Number of triangles of the skin.
    pub skin_triangles: usize,
    /// The tumour's volume in cubic millimetres.
    pub tumour_mm3: f64,
    /// The tumour's centroid in the CT's LPS, in millimetres.
    pub tumour_mm: DVec3,
    /// Largest distance of the tumour's centroid from its position at the reference phase, in
    /// millimetres.
    pub tumour_motion_mm: f64,
    /// Largest distance of a point of the skin from its position at the reference phase, in millimetres.
    pub skin_motion_mm: f64,
}

impl Import {
    /// Writes the folder. It may exist but must not contain any of the files to be written, unless
    /// `force` is set. Progress messages go to `step`.
    ///
    /// Returns an error if an input cannot be read; if the CT has missing slices, several series or
    /// uneven distances, or is not in Hounsfield units; if the fields are not on one grid, too large in
    /// total, outside the CT, do not cover skin and tumour or move the reference phase; if the tumour
    /// is not closed or not in the body; if the isocentre is outside the CT; or if writing fails. After
    /// an error no files are left behind.
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
        // The fields cover a box, so they cover everything inside the skin too.
        fields.reach(&skin, "skin")?;

        let fields_read = self.phases.iter().map(|(_, field)| field);
        let inputs = [&self.ct, &self.tumour].into_iter().chain(fields_read);
        let folder = OutputFolder::create(out, self.force)?.sparing(inputs);
        let draft = folder.draft();
        ply::write_mesh(&draft.join(&file.skin), &skin)?;
        ply::write_mesh(&draft.join(&file.tumour), &tumour.mesh)?;
        if let Some(name) = &file.ct {
            step("writing the CT");
            metaimage::write_volume(&draft.join(name), &ct.volume, Packing::Zlib)?;
        }
        let centroid_mm = tumour.moments.centroid_mm;
        let motion = fields.write(&file.phase, draft, &skin, centroid_mm, step)?;
        if motion.skin_mm < LEAST_MOTION_MM {
            return Err(Error::input(
                "fields",
                format!("a skin that moves {:.3} mm at most", motion.skin_mm),
                format!("{LEAST_MOTION_MM} mm or more: less shows no breathing"),
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
        file.write(draft)?;
        folder.finish([""; 0], Some(PlanningFile::NAME))?;
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

    /// Returns the isocentre: the requested one, if it lies in the CT, else the tumour's centroid.
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
                "a point inside the CT, in its LPS coordinates, within {}",
                grid.box_in_words()
            ),
        ))
    }

    /// Rejects a tumour that is not inside the body.
    fn in_body(&self, tumour: &Tumour, skin: &Mesh) -> Result<()> {
        let outside = outside(&tumour.mesh.vertices, skin);
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
