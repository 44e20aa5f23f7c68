//! The planning folder, which contains all data about a patient available to the host.
//!
//! ```text
//! planning.toml    names and places of the files below, see [`PlanningFile`]
//! skin.ply         the skin at the reference phase
//! tumour.ply       the tumour at the reference phase, a closed surface
//! dvf_00.mha ...   displacement of the reference phase's points to each phase, mm along LPS
//! ct_50.mha        the reference phase in Hounsfield units, if there is one
//! ```
//!
//! The files are in the LPS of the scanner that took the CT, with an arbitrary origin. The data
//! returned here is in the patient frame: the same axes, with the origin at the isocentre. Phase 0
//! is end-inhale, phase 50 end-exhale.

mod file;
pub mod fit;
mod folder;
#[cfg(test)]
mod tests;

pub(super) use file::{ALLOWED_NAME, MOST_PHASES, SPACING_MM};
pub use file::{PhaseFile, PlanningFile, Spacing};
pub use folder::Folder;

use super::metaimage::{self, Packing};
use super::volume::Field;
use phasmid_core::error::Result;
use phasmid_core::output_folder::OutputFolder;
use phasmid_geometry::{Mesh, ply};
use std::path::Path;

/// A planning folder's content, in the patient frame (LPS about the isocentre), in millimetres.
#[derive(Debug, Clone, PartialEq)]
pub struct Planning {
    /// The patient's name in the folder.
    pub name: String,
    /// Phase of skin and tumour, in per cent of the cycle.
    pub reference_percent: f64,
    /// The skin at the reference phase.
    pub skin: Mesh,
    /// The tumour at the reference phase: closed, normals outwards.
    pub tumour: Mesh,
    /// Displacement of the reference phase's points to each phase (per cent of the cycle,
    /// ascending); all on one grid, which encloses skin and tumour.
    pub phases: Vec<(f64, Field)>,
}

impl Planning {
    /// Reads a complete folder. If the fields are large and only few points are needed, use
    /// [`Folder`] to read them one by one.
    ///
    /// # Errors
    /// Returns the errors of [`Folder::open`] and of its readers, and an error if the fields exceed
    /// 4 GiB in total.
    pub fn load(path: &Path) -> Result<Self> {
        let folder = Folder::open(path)?;
        let count = folder.file().phase.len();
        fit::in_memory(&folder.grid(), count, &path.display().to_string())?;
        let phases: Result<Vec<_>> = (0..count)
            .map(|phase| Ok((folder.file().phase[phase].percent, folder.field(phase)?)))
            .collect();
        Ok(Self {
            name: folder.file().name.clone(),
            reference_percent: folder.file().reference_phase,
            skin: folder.skin()?,
            tumour: folder.tumour()?,
            phases: phases?,
        })
    }

    /// Writes a folder without a CT, with the isocentre at the origin of its files. Creates the
    /// folder if it does not exist.
    ///
    /// # Errors
    /// Returns an error if files exist and `force` is not set, or the system's error.
    ///
    /// # Panics
    /// Panics if there are no phases.
    pub fn save(&self, path: &Path, force: bool) -> Result<()> {
        let percents = self.phases.iter().map(|(percent, _)| *percent);
        let spacing_mm = self.phases[0].1.grid().spacing_mm;
        let file = PlanningFile {
            name: self.name.clone(),
            ..PlanningFile::usual(percents, self.reference_percent, spacing_mm, false)
        };
        let folder = OutputFolder::create(path, force)?;
        let draft = folder.draft();
        ply::write_mesh(&draft.join(&file.skin), &self.skin)?;
        ply::write_mesh(&draft.join(&file.tumour), &self.tumour)?;
        for (phase, (_, field)) in file.phase.iter().zip(&self.phases) {
            metaimage::write_field(&draft.join(&phase.field), field, Packing::Plain)?;
        }
        file.write(draft)?;
        folder.finish([""; 0], Some(PlanningFile::NAME))
    }
}
