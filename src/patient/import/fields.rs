//! Displacement fields of the phases: whether they fit, and their way into the folder.

use crate::error::{Error, Result};
use crate::geometry::Mesh;
use crate::patient::metaimage::{self, Packing};
use crate::patient::planning::fit;
use crate::patient::planning::{MOST_PHASES, PhaseFile, SPACING_MM};
use crate::patient::volume::{Field, Grid, listed};
use glam::DVec3;
use std::path::{Path, PathBuf};

/// The fields of all phases, looked at but not in memory: all on one grid.
pub(super) struct Fields {
    pub(super) grid: Grid,
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
    /// Looks at files by their phases.
    ///
    /// # Errors
    /// Phases that no planning has, and files that are no fields, or not on one grid.
    pub(super) fn look(named: &[(f64, PathBuf)], reference_percent: f64) -> Result<Self> {
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
        if let Some([a, b]) = phases.array_windows().find(|[a, b]| a.0 == b.0) {
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
        let spacing = grid.spacing_mm.to_array();
        if !spacing.iter().all(|mm| SPACING_MM.contains(mm)) {
            let (least, most) = (SPACING_MM.start(), SPACING_MM.end());
            return Err(Error::input(
                first.display(),
                format!("a spacing of {}", listed(grid.spacing_mm)),
                format!("{least} to {most} mm"),
            ));
        }
        fit::in_memory(&grid, phases.len(), &first.display().to_string())?;
        Ok(Self {
            grid,
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
                None => Field::new(self.grid, vec![[0.0; 3]; self.grid.voxels()], &file.field)?,
                Some(path) => {
                    let field = metaimage::read_field(path)?;
                    if *percent == self.reference_percent {
                        fit::still(&field, &path.display().to_string())?;
                    }
                    field
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
