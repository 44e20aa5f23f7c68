//! A checked planning folder whose files are read on demand.

use super::file::PlanningFile;
use super::fit;
use crate::metaimage;
use crate::volume::{Field, Grid, Volume, listed};
use glam::DVec3;
use phasmid_core::error::{Error, Result};
use phasmid_core::source::TomlSource;
use phasmid_geometry::Mesh;
use std::path::{Path, PathBuf};

/// A planning folder: its `planning.toml`, with the grids of its fields and CT checked. Files are
/// read on demand.
#[derive(Debug)]
pub struct Folder {
    path: PathBuf,
    file: PlanningFile,
    /// Grid of the fields, in the files' LPS.
    grid: Grid,
}

impl Folder {
    /// Opens a folder and checks the file headers.
    ///
    /// # Errors
    /// Returns the errors of [`PlanningFile::read`], and an error if a field or CT is missing or
    /// malformed, if the fields' grids differ from each other or from the stated spacing, or if the
    /// CT is rotated against the fields or does not enclose them.
    pub fn open(path: &Path) -> Result<Self> {
        let source = TomlSource::read(&path.join(PlanningFile::NAME))?;
        let file = PlanningFile::from_source(&source)?;
        let mut folder = Self {
            path: path.to_owned(),
            file,
            grid: Grid::upright([1; 3], DVec3::ONE, DVec3::ZERO),
        };
        for n in 0..folder.file.phase.len() {
            let at = source.place_of(&format!("phase[{n}].field"));
            let field = path.join(&folder.file.phase[n].field);
            let grid = fit::grid_of(&field, 3).map_err(|e| e.at(&at))?;
            if n == 0 {
                let wanted = folder.file.spacing_mm.0;
                if (grid.spacing_mm - wanted).abs().max_element() > 1e-3 * wanted.min_element() {
                    let first = &folder.file.phase[0].field;
                    let found = format!("{}, unlike {first}", listed(wanted));
                    let allowed = listed(grid.spacing_mm);
                    return Err(source.violation("spacing_mm", found, allowed));
                }
                folder.grid = grid;
            } else if let Some((here, there)) = grid.difference(&folder.grid) {
                let place = format!("{at}: {}", field.display());
                let allowed = format!("{there}, as in {}", folder.file.phase[0].field);
                return Err(Error::input(place, here, allowed));
            }
        }
        if let Some(ct) = &folder.file.ct {
            let at = source.place_of("ct");
            let grid = fit::grid_of(&path.join(ct), 1).map_err(|e| e.at(&at))?;
            let place = format!("{at}: {}", path.join(ct).display());
            fit::around(&grid, &folder.grid, &place)?;
        }
        Ok(folder)
    }

    /// Returns the content of `planning.toml`.
    pub fn file(&self) -> &PlanningFile {
        &self.file
    }

    /// Returns the grid of the fields in the patient frame.
    pub fn grid(&self) -> Grid {
        self.grid.shifted(-self.file.isocentre_mm)
    }

    /// Reads the skin at the reference phase, in the patient frame.
    ///
    /// # Errors
    /// Returns the errors of [`Mesh::read`], and an error if vertices lie outside the fields.
    pub fn skin(&self) -> Result<Mesh> {
        self.mesh(&self.file.skin, "skin")
    }

    /// Reads the tumour at the reference phase, in the patient frame.
    ///
    /// # Errors
    /// Returns the errors of [`Self::skin`], and an error if the surface is not closed or its
    /// normals point inwards.
    pub fn tumour(&self) -> Result<Mesh> {
        let mesh = self.mesh(&self.file.tumour, "tumour")?;
        let path = self.path.join(&self.file.tumour);
        fit::closed(&mesh, &path.display().to_string())?;
        Ok(mesh)
    }

    /// Reads the displacements from the reference phase to a phase, by index in the file, in the
    /// patient frame.
    ///
    /// # Errors
    /// Returns the errors of [`metaimage::read_field`], and an error if the field from the
    /// reference phase to itself moves anything by more than 0.5 mm.
    ///
    /// # Panics
    /// Panics if the index is out of range.
    pub fn field(&self, phase: usize) -> Result<Field> {
        let entry = &self.file.phase[phase];
        let path = self.path.join(&entry.field);
        let field = metaimage::read_field(&path)?;
        if entry.percent == self.file.reference_phase {
            fit::still(&field, &path.display().to_string())?;
        }
        Ok(field.shifted(-self.file.isocentre_mm))
    }

    /// Reads the CT at the reference phase in Hounsfield units, in the patient frame, if there is
    /// one.
    ///
    /// # Errors
    /// Returns the errors of [`metaimage::read_volume`].
    pub fn ct(&self) -> Result<Option<Volume>> {
        let Some(name) = &self.file.ct else {
            return Ok(None);
        };
        let volume = metaimage::read_volume(&self.path.join(name))?;
        Ok(Some(volume.shifted(-self.file.isocentre_mm)))
    }

    /// Reads the mesh that a field of the file names.
    fn mesh(&self, name: &str, field: &str) -> Result<Mesh> {
        let path = self.path.join(name);
        let of = self.path.join(PlanningFile::NAME);
        let mut mesh = Mesh::read(&path).map_err(|e| e.at(format!("{}: {field}", of.display())))?;
        fit::within(&mesh, &self.grid, &path.display().to_string())?;
        for vertex in &mut mesh.vertices {
            *vertex -= self.file.isocentre_mm;
        }
        Ok(mesh)
    }
}
