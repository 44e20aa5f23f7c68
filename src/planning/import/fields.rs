//! Displacement fields of the phases: whether they fit, and their way into the folder.

use crate::metaimage::{self, Packing};
use crate::planning::fit;
use crate::planning::{MOST_PHASES, PhaseFile, SPACING_MM};
use crate::volume::{Field, Grid, listed};
use glam::DVec3;
use phasmid_core::error::{Error, Result};
use phasmid_geometry::Mesh;
use std::path::{Path, PathBuf};

/// The fields of all phases, looked at but not in memory: all on one grid.
pub(super) struct Fields {
    /// Where they are.
    pub(super) grid: Grid,
    /// Where they are to be: there, or on a coarser grid of the same space.
    pub(super) target: Grid,
    /// File of the first, whose grid it is.
    first: PathBuf,
    reference_percent: f64,
    /// Per cent of the cycle, ascending, and the file; the reference phase may have none, as nothing
    /// moves from it to itself.
    phases: Vec<(f64, Option<PathBuf>)>,
}

/// How far things go over the phases, in millimetres.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub(super) struct Motion {
    pub(super) skin_mm: f64,
    pub(super) tumour_mm: f64,
}

impl Fields {
    /// Looks at files by their phases; `spacing_mm` asks for a coarser grid.
    ///
    /// # Errors
    /// Phases that no planning has, files that are no fields or not on one grid, and fields that are
    /// too large or coarser than asked for.
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
            let allowed = format!("one field a phase: {} is there", place(a));
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
                        let allowed = format!("as {}: {there}", named.display());
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

    /// The phases, in per cent of the cycle, ascending.
    pub(super) fn percents(&self) -> impl Iterator<Item = f64> {
        self.phases.iter().map(|(percent, _)| *percent)
    }

    /// Refuses a CT that does not lie around the fields, or is turned against them.
    pub(super) fn lie_in(&self, ct: &Grid, place: &str) -> Result<()> {
        fit::around(ct, &self.grid, place)
    }

    /// Refuses a mesh that the fields do not reach all of.
    pub(super) fn reach(&self, mesh: &Mesh, what: &str) -> Result<()> {
        fit::within(mesh, &self.grid, what).map_err(|e| e.at(self.first.display()))
    }

    /// Writes them into a folder, one after the other, under the names of `files`, and says how far
    /// skin and tumour go.
    ///
    /// # Errors
    /// A field that is malformed, one that moves the reference phase against itself, and what the
    /// system refuses.
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

/// A grid of larger voxels, the same along all axes, whose centres reach to the ends of a grid's or
/// beyond, by the same at both.
fn coarser(grid: &Grid, spacing_mm: f64) -> Grid {
    let length_mm = grid.last() * grid.spacing_mm;
    // What rounding makes of a whole number of steps is no step more.
    let steps = (length_mm / spacing_mm - 1e-6).ceil().max(DVec3::ZERO);
    let before = 0.5 * (steps * spacing_mm - length_mm);
    Grid {
        size: steps.to_array().map(|n| n as usize + 1),
        spacing_mm: DVec3::splat(spacing_mm),
        origin_mm: grid.origin_mm - grid.direction * before,
        direction: grid.direction,
    }
}
