//! A folder whose files fit each other, read one by one.

use super::file::PlanningFile;
use super::fit;
use crate::metaimage;
use crate::volume::{Field, Grid, Volume, listed};
use glam::DVec3;
use phasmid_core::error::{Error, Result};
use phasmid_core::source::TomlSource;
use phasmid_geometry::Mesh;
use std::path::{Path, PathBuf};

/// A planning folder: its `planning.toml` and the grids of its fields and CT, which have been looked
/// at, and the way to its files.
#[derive(Debug)]
pub struct Folder {
    path: PathBuf,
    file: PlanningFile,
    /// The fields', in the files' LPS.
    grid: Grid,
}

impl Folder {
    /// Looks at a folder.
    ///
    /// # Errors
    /// What [`PlanningFile::read`] refuses; a field or CT that is not there or malformed; fields
    /// whose grids are not the same or do not have the spacing that the file says; a CT that lies
    /// elsewhere: turned against the fields or not around them.
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
                    let found = format!("{}, as {}", listed(wanted), folder.file.phase[0].field);
                    let found = format!("{found} does not have it");
                    let allowed = listed(grid.spacing_mm);
                    return Err(source.violation("spacing_mm", found, allowed));
                }
                folder.grid = grid;
            } else if let Some((here, there)) = grid.difference(&folder.grid) {
                let place = format!("{at}: {}", field.display());
                let allowed = format!("as {}: {there}", folder.file.phase[0].field);
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

    /// What `planning.toml` says.
    pub fn file(&self) -> &PlanningFile {
        &self.file
    }

    /// The fields' grid in the patient frame.
    pub fn grid(&self) -> Grid {
        self.grid.shifted(-self.file.isocentre_mm)
    }

    /// The skin at the reference phase, in the patient frame.
    ///
    /// # Errors
    /// What [`Mesh::read`] refuses, and vertices outside of the fields.
    pub fn skin(&self) -> Result<Mesh> {
        self.mesh(&self.file.skin)
    }

    /// The tumour at the reference phase, in the patient frame.
    ///
    /// # Errors
    /// As for [`Self::skin`], and a surface that is not closed or whose normals point inwards.
    pub fn tumour(&self) -> Result<Mesh> {
        let mesh = self.mesh(&self.file.tumour)?;
        let path = self.path.join(&self.file.tumour);
        fit::closed(&mesh, &path.display().to_string())?;
        Ok(mesh)
    }

    /// The displacements from the reference phase to a phase, in the order of the file, in the
    /// patient frame.
    ///
    /// # Errors
    /// What [`metaimage::read_field`] refuses, and a field from the reference phase to itself that
    /// moves anything by more than 0.5 mm.
    ///
    /// # Panics
    /// Where there is no phase of that number.
    pub fn field(&self, phase: usize) -> Result<Field> {
        let entry = &self.file.phase[phase];
        let path = self.path.join(&entry.field);
        let field = metaimage::read_field(&path)?;
        if entry.percent == self.file.reference_phase {
            fit::still(&field, &path.display().to_string())?;
        }
        Ok(field.shifted(-self.file.isocentre_mm))
    }

    /// The CT at the reference phase in Hounsfield units, in the patient frame, if there is one.
    ///
    /// # Errors
    /// What [`metaimage::read_volume`] refuses.
    pub fn ct(&self) -> Result<Option<Volume>> {
        let Some(name) = &self.file.ct else {
            return Ok(None);
        };
        let volume = metaimage::read_volume(&self.path.join(name))?;
        Ok(Some(volume.shifted(-self.file.isocentre_mm)))
    }

    fn mesh(&self, name: &str) -> Result<Mesh> {
        let path = self.path.join(name);
        let mut mesh = Mesh::read(&path)?;
        fit::within(&mesh, &self.grid, &path.display().to_string())?;
        for vertex in &mut mesh.vertices {
            *vertex -= self.file.isocentre_mm;
        }
        Ok(mesh)
    }
}
