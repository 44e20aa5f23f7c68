//! The planning folder: all that a host knows of a patient.
//!
//! ```text
//! planning.toml    names and places of the files below, see [`PlanningFile`]
//! skin.ply         the skin at the reference phase
//! tumour.ply       the tumour at the reference phase, a closed surface
//! dvf_00.mha ...   displacement of the reference phase's points to each phase, mm along LPS
//! ct_50.mha        the reference phase in Hounsfield units, if there is one
//! ```
//!
//! The files are in the LPS of the scanner that took the CT, whose origin may lie anywhere. What
//! is handed out here is in the patient frame: the same axes, the origin at the isocentre. Phase 0
//! is the end of inhaling and phase 50 that of exhaling.

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
use phasmid_geometry::{Mesh, ply};
use std::path::Path;

/// A planning folder's content, in the patient frame (LPS about the isocentre), in millimetres.
#[derive(Debug, Clone, PartialEq)]
pub struct Planning {
    /// The patient's name in the folder.
    pub name: String,
    /// Phase at which skin and tumour are, in per cent of the cycle.
    pub reference_percent: f64,
    /// The skin at the reference phase.
    pub skin: Mesh,
    /// The tumour at the reference phase: closed, normals outwards.
    pub tumour: Mesh,
    /// Displacement of the reference phase's points to each phase (per cent of the cycle,
    /// ascending); all on one grid, which holds skin and tumour.
    pub phases: Vec<(f64, Field)>,
}

impl Planning {
    /// Reads a whole folder. Where fields are large and only few points matter, [`Folder`] reads
    /// them one by one.
    ///
    /// # Errors
    /// As for [`Folder::open`] and what it reads; fields of more than 4 GiB in all.
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

    /// Writes it as a folder with the isocentre at the origin of its files, without a CT. The folder
    /// is made if it is not there.
    ///
    /// # Errors
    /// What the system refuses.
    ///
    /// # Panics
    /// Where there is no phase.
    pub fn save(&self, path: &Path) -> Result<()> {
        let percents = self.phases.iter().map(|(percent, _)| *percent);
        let spacing_mm = self.phases[0].1.grid().spacing_mm;
        let file = PlanningFile {
            name: self.name.clone(),
            ..PlanningFile::usual(percents, self.reference_percent, spacing_mm, false)
        };
        file.begin(path)?;
        ply::write_mesh(&path.join(&file.skin), &self.skin)?;
        ply::write_mesh(&path.join(&file.tumour), &self.tumour)?;
        for (phase, (_, field)) in file.phase.iter().zip(&self.phases) {
            metaimage::write_field(&path.join(&phase.field), field, Packing::Plain)?;
        }
        // Last, so that a folder with a planning.toml is whole.
        file.write(path)
    }
}
