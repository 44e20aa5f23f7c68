//! Exports the planning folder of a generated patient. A host knows nothing else about the patient.

use super::{PHASES, Phantom, REFERENCE_PHASE, SKIN_TRIANGLES, State, hounsfield};
use glam::DVec3;
use phasmid_core::error::{Error, Result};
use phasmid_core::new_file::check_folder;
use phasmid_core::output_folder::OutputFolder;
use phasmid_geometry::{Mesh, ply};
use phasmid_planning::metaimage::{write_field_by_planes, write_volume_by_planes};
use phasmid_planning::planning::PlanningFile;
use phasmid_planning::volume::Grid;
use rayon::prelude::*;
use std::path::Path;

/// Margin around the skin.
const MARGIN_MM: f64 = 10.0;
const SPACING_MM: std::ops::RangeInclusive<f64> = 1.0..=20.0;
/// Subdivision level of the tumour's mesh: 5120 triangles.
const LEVEL: u32 = 4;

impl Phantom {
    /// Writes the planning folder, which is created if it does not exist: `planning.toml`;
    /// `skin.ply` and `tumour.ply` at the reference phase; `dvf_00.mha` to `dvf_90.mha`, the
    /// displacement of the reference phase's points to each phase on a grid around the body, in
    /// millimetres; and, if `ct` is set, `ct_50.mha`, the reference phase in Hounsfield units on
    /// the same grid. CT voxels at a tissue border have partial volumes, as in a real scanner, so
    /// the skin can be located to a small fraction of a voxel.
    ///
    /// # Errors
    /// Returns an error if the spacing is outside 1 to 20 mm, if files exist and `force` is not
    /// set, or if writing fails.
    pub fn export_planning(
        &self,
        folder: &Path,
        spacing_mm: f64,
        ct: bool,
        force: bool,
    ) -> Result<()> {
        if !SPACING_MM.contains(&spacing_mm) {
            let (least, most) = (SPACING_MM.start(), SPACING_MM.end());
            return Err(Error::input(
                "spacing of displacement fields in mm",
                spacing_mm,
                format!("{least} to {most}"),
            ));
        }
        let file = PlanningFile {
            name: self.patient().name.clone(),
            ..PlanningFile::usual(
                (0..PHASES).map(|tenth| 10.0 * tenth as f64),
                10.0 * REFERENCE_PHASE as f64,
                DVec3::splat(spacing_mm),
                ct,
            )
        };
        check_folder(folder, file.names(), force)?;
        let skin = self.skin(SKIN_TRIANGLES)?;
        let grid = around(skin.bounds().unwrap_or_default(), spacing_mm);
        let folder = OutputFolder::create(folder, force)?;
        self.write_files(folder.draft(), &file, &skin, &grid)?;
        folder.finish([""; 0], Some(PlanningFile::NAME))
    }

    fn write_files(
        &self,
        folder: &Path,
        file: &PlanningFile,
        skin: &Mesh,
        grid: &Grid,
    ) -> Result<()> {
        ply::write_mesh(&folder.join(&file.skin), skin)?;
        let tumour = self.tumour_mesh(&State::REFERENCE, LEVEL);
        ply::write_mesh(&folder.join(&file.tumour), &tumour)?;
        for (tenth, phase) in file.phase.iter().enumerate() {
            let state = self.planning_phase(tenth);
            let voxel = |x| self.displacement(x, &state).as_vec3().to_array();
            write_field_by_planes(&folder.join(&phase.field), grid, |k| plane(grid, k, voxel))?;
        }
        if let Some(name) = &file.ct {
            let border_mm = hounsfield::BORDER_MM.max(0.5 * grid.spacing_mm.x);
            let voxel = |x| {
                let number = self.hounsfield_of(x, &State::REFERENCE, border_mm);
                number.round() as i16
            };
            write_volume_by_planes(&folder.join(name), grid, |k| plane(grid, k, voxel))?;
        }
        file.write(folder)
    }
}

/// Returns a grid that encloses a box plus the margin.
fn around((lo, hi): (DVec3, DVec3), spacing_mm: f64) -> Grid {
    let (lo, hi) = (lo - MARGIN_MM, hi + MARGIN_MM);
    let steps = ((hi - lo) / spacing_mm).ceil().to_array();
    Grid::upright(steps.map(|n| n as usize + 1), DVec3::splat(spacing_mm), lo)
}

/// Returns the voxels of plane `k`, i fastest, then j.
fn plane<T: Copy + Default + Send>(
    grid: &Grid,
    k: usize,
    voxel: impl Fn(DVec3) -> T + Sync,
) -> Vec<T> {
    let [ni, nj, _] = grid.size;
    let mut numbers = vec![T::default(); ni * nj];
    numbers.par_chunks_mut(ni).enumerate().for_each(|(j, row)| {
        for (i, number) in row.iter_mut().enumerate() {
            *number = voxel(grid.point(DVec3::from_array([i, j, k].map(|x| x as f64))));
        }
    });
    numbers
}
