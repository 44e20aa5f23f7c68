//! Displacement fields of the phases: checks whether they fit, and writes them to the folder.

use crate::metaimage::{self, Packing};
use crate::planning::fit;
use crate::planning::{MOST_PHASES, PhaseFile, SPACING_MM};
use crate::volume::{Field, Grid, listed};
use glam::DVec3;
use phasmid_core::error::{Error, Result};
use phasmid_geometry::Mesh;
use std::path::{Path, PathBuf};

/// The fields of all phases, which are on one grid. Only their headers have been read.
pub(super) struct Fields {
    /// Grid of the files.
    pub(super) grid: Grid,
    /// Grid of the written fields: equal to `grid`, or coarser with the same extent.
    pub(super) target: Grid,
    /// File of the first field, from which `grid` was read.
    first: PathBuf,
    reference_percent: f64,
    /// Per cent of the cycle, ascending, and file. The reference phase may have no file, as its
    /// displacement is zero.
    phases: Vec<(f64, Option<PathBuf>)>,
}

/// Largest displacement over the phases, in millimetres.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub(super) struct Motion {
    pub(super) skin_mm: f64,
    pub(super) tumour_mm: f64,
}

impl Fields {
    /// Reads the headers of the files by phase; `spacing_mm` requests a coarser grid.
    ///
    /// # Errors
    /// Returns an error for invalid phases, files that are not fields or not on one grid, and
    /// fields that are too large or coarser than requested.
    pub(super) fn look(
        named: &[(f64, PathBuf)],
        reference_percent: f64,
        spacing_mm: Option<f64>,
    ) -> Result<Self> {
        let mut phases: Vec<(f64, Option<PathBuf>)> = named
            .iter()
            .map(|(percent, path)| (*percent, Some(path.clone())))
            .collect();
        if named
            .iter()
            .all(|(percent, _)| *percent != reference_percent)
        {
            phases.push((reference_percent, None));
        }
        phases.sort_by(|a, b| a.0.total_cmp(&b.0));
        let place = |phase: &(f64, Option<PathBuf>)| match &phase.1 {
            Some(path) => format!("phase {} %: {}", phase.0, path.display()),
            None => format!("phase {} %", phase.0),
        };
        for phase in &phases {
            if !(phase.0 >= 0.0 && phase.0 < 100.0) {
                let allowed = "per cent of the cycle, 0 or more, less than 100";
                return Err(Error::input(place(phase), phase.0, allowed));
            }
        }
        if let Some(pair) = phases.windows(2).find(|pair| pair[0].0 == pair[1].0) {
            let (a, b) = (&pair[0], &pair[1]);
            let allowed = format!("one field per phase: {} is already given", place(a));
            return Err(Error::input(place(b), "a second field", allowed));
        }
        if !(2..=MOST_PHASES).contains(&phases.len()) {
            return Err(Error::input(
                "fields",
                format!("{} phases with the reference", phases.len()),
                format!("2 to {MOST_PHASES} phases"),
            ));
        }
        let mut one: Option<(Grid, PathBuf)> = None;
        for phase in &phases {
            let Some(path) = &phase.1 else { continue };
            let grid = fit::grid_of(path, 3).map_err(|e| e.at(format!("phase {} %", phase.0)))?;
            match &one {
                None => one = Some((grid, path.clone())),
                Some((first, named)) => {
                    if let Some((here, there)) = grid.difference(first) {
                        let allowed = format!("{there}, as in {}", named.display());
                        return Err(Error::input(place(phase), here, allowed));
                    }
                }
            }
        }
        let Some((grid, first)) = one else {
            return Err(Error::input("fields", "none", "one for each phase"));
        };
        let place = first.display().to_string();
        let spacing = grid.spacing_mm.to_array();
        let (least, most) = (SPACING_MM.start(), SPACING_MM.end());
        if !spacing.iter().all(|mm| SPACING_MM.contains(mm)) {
            return Err(Error::input(
                place,
                format!("a spacing of {}", listed(grid.spacing_mm)),
                format!("{least} to {most} mm"),
            ));
        }
        let target = match spacing_mm {
            None => grid,
            Some(mm) if mm >= grid.spacing_mm.max_element() && mm <= *most => coarser(&grid, mm),
            Some(mm) => {
                return Err(Error::input(
                    "spacing of the fields in mm",
                    mm,
                    format!(
                        "{} to {most}: {place} has {}",
                        grid.spacing_mm.max_element(),
                        listed(grid.spacing_mm)
                    ),
                ));
            }
        };
        fit::in_memory(&target, phases.len(), &place)?;
        Ok(Self {
            grid,
            target,
            first,
            reference_percent,
            phases,
        })
    }

    /// Returns the phases in per cent of the cycle, ascending.
    pub(super) fn percents(&self) -> impl Iterator<Item = f64> {
        self.phases.iter().map(|(percent, _)| *percent)
    }

    /// Rejects a CT that does not enclose the fields or is rotated against them.
    pub(super) fn lie_in(&self, ct: &Grid, place: &str) -> Result<()> {
        fit::around(ct, &self.grid, place)
    }

    /// Rejects a mesh that extends beyond the fields.
    pub(super) fn reach(&self, mesh: &Mesh, what: &str) -> Result<()> {
        fit::within(mesh, &self.grid, what).map_err(|e| e.at(self.first.display()))
    }

    /// Writes the fields one by one into a folder, under the names in `files`. Returns the largest
    /// displacements of skin and tumour.
    ///
    /// # Errors
    /// Returns an error if a field is malformed or cannot be written, or if the reference phase's
    /// field is not zero.
    pub(super) fn write(
        &self,
        files: &[PhaseFile],
        folder: &Path,
        skin: &Mesh,
        tumour_mm: DVec3,
        step: &dyn Fn(&str),
    ) -> Result<Motion> {
        let mut motion = Motion::default();
        for ((percent, path), file) in self.phases.iter().zip(files) {
            step(&format!("phase {percent} %"));
            let field = match path {
                None => {
                    let still = vec![[0.0; 3]; self.target.voxels()];
                    Field::new(self.target, still, &file.field)?
                }
                Some(path) => {
                    let field = metaimage::read_field(path)?;
                    if *percent == self.reference_percent {
                        fit::still(&field, &path.display().to_string())?;
                    }
                    if self.target == self.grid {
                        field
                    } else {
                        let at = |p| field.nearest(self.grid.index(p));
                        Field::of(self.target, at, &file.field)?
                    }
                }
            };
            let gone = |at: &DVec3| field.at(*at).map_or(0.0, |u| u.length());
            motion.tumour_mm = motion.tumour_mm.max(gone(&tumour_mm));
            let farthest = skin.vertices.iter().map(gone).fold(0.0, f64::max);
            motion.skin_mm = motion.skin_mm.max(farthest);
            metaimage::write_field(&folder.join(&file.field), &field, Packing::Plain)?;
        }
        Ok(motion)
    }
}

/// Returns a grid with cubic voxels of the given spacing, centred on `grid`. Its outermost voxel
/// centres lie at or beyond the outermost centres of `grid`.
fn coarser(grid: &Grid, spacing_mm: f64) -> Grid {
    let length_mm = grid.last() * grid.spacing_mm;
    // If the number of steps is an integer, rounding errors must not add a step.
    let steps = (length_mm / spacing_mm - 1e-6).ceil().max(DVec3::ZERO);
    let before = 0.5 * (steps * spacing_mm - length_mm);
    Grid {
        size: steps.to_array().map(|n| n as usize + 1),
        spacing_mm: DVec3::splat(spacing_mm),
        origin_mm: grid.origin_mm - grid.direction * before,
        direction: grid.direction,
    }
}
