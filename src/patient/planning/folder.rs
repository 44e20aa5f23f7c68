//! A folder whose files fit each other, read one by one.

use super::file::{NAME, PlanningFile};
use crate::error::{Error, Result};
use crate::geometry::Mesh;
use crate::patient::metaimage;
use crate::patient::volume::{Field, Grid, Volume, listed};
use crate::profile::TomlSource;
use glam::DVec3;
use std::collections::HashSet;
use std::path::{Path, PathBuf};

/// Longest displacement that a field from the reference phase to itself may have: what a
/// registration of an image with itself leaves.
const STILL_MM: f64 = 0.5;

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
        let source = TomlSource::read(&path.join(NAME))?;
        let file = PlanningFile::from_source(&source)?;
        let mut folder = Self {
            path: path.to_owned(),
            file,
            grid: Grid::upright([1; 3], DVec3::ONE, DVec3::ZERO),
        };
        for n in 0..folder.file.phase.len() {
            let at = source.place_of(&format!("phase[{n}].field"));
            let grid = folder
                .header(&folder.file.phase[n].field, 3)
                .map_err(|e| e.at(&at))?;
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
                let field = &folder.file.phase[n].field;
                let place = format!("{at}: {}", path.join(field).display());
                let allowed = format!("as {}: {there}", folder.file.phase[0].field);
                return Err(Error::input(place, here, allowed));
            }
        }
        if let Some(ct) = &folder.file.ct {
            let at = source.place_of("ct");
            let grid = folder.header(ct, 1).map_err(|e| e.at(&at))?;
            let place = format!("{at}: {}", path.join(ct).display());
            around(&grid, &folder.grid, &place)?;
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
        closed(
            &mesh,
            &self.path.join(&self.file.tumour).display().to_string(),
        )?;
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
        if entry.percent == self.file.reference_phase && !(field.longest_mm() <= STILL_MM) {
            let found = format!("displacements of up to {:.2} mm", field.longest_mm());
            let allowed = format!("none above {STILL_MM} mm from the reference phase to itself");
            return Err(Error::input(path.display(), found, allowed));
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

    fn header(&self, name: &str, channels: usize) -> Result<Grid> {
        let path = self.path.join(name);
        let (grid, found) = metaimage::read_grid(&path)?;
        if found == channels {
            return Ok(grid);
        }
        let allowed = ["one: a CT", "three: a displacement field"][usize::from(channels == 3)];
        Err(Error::input(
            path.display(),
            metaimage::channels(found),
            allowed,
        ))
    }

    fn mesh(&self, name: &str) -> Result<Mesh> {
        let path = self.path.join(name);
        let mut mesh = Mesh::read(&path)?;
        let outside = |v: &&DVec3| !self.grid.holds(self.grid.index(**v));
        let count = mesh.vertices.iter().filter(outside).count();
        if let Some(first) = mesh.vertices.iter().find(outside) {
            let all = mesh.vertices.len();
            return Err(Error::input(
                path.display(),
                format!(
                    "{count} of {all} vertices outside of the fields, {} first",
                    listed(*first)
                ),
                format!("vertices within {}", space(&self.grid)),
            ));
        }
        for vertex in &mut mesh.vertices {
            *vertex -= self.file.isocentre_mm;
        }
        Ok(mesh)
    }
}

/// Refuses a CT that is turned against the fields, or does not hold them (to within one of their
/// voxels).
fn around(ct: &Grid, fields: &Grid, place: &str) -> Result<()> {
    for axis in 0..3 {
        let (a, b) = (ct.direction.col(axis), fields.direction.col(axis));
        if (a - b).length() > 1e-3 {
            let found = format!("axis {axis} along {}", listed(a));
            let allowed = format!("as the fields have it: {}", listed(b));
            return Err(Error::input(place, found, allowed));
        }
    }
    let reach = 0.5 + fields.spacing_mm / ct.spacing_mm;
    let [low, high] = [DVec3::ZERO, fields.last()].map(|end| ct.index(fields.point(end)));
    if low.cmpge(-reach).all() && high.cmple(ct.last() + reach).all() {
        return Ok(());
    }
    let found = format!("a CT of {}", space(ct));
    let allowed = format!("one around the fields, which have {}", space(fields));
    Err(Error::input(place, found, allowed))
}

/// The box around a grid's centres, for a message.
fn space(grid: &Grid) -> String {
    let corner = |n: usize| {
        let pick = |axis: usize| [0.0, 1.0][n >> axis & 1];
        grid.point(grid.last() * DVec3::new(pick(0), pick(1), pick(2)))
    };
    let first = (corner(0), corner(0));
    let (low, high) = (1..8).fold(first, |(a, b), n| (a.min(corner(n)), b.max(corner(n))));
    format!("{} to {} mm", listed(low), listed(high))
}

/// Refuses a surface that encloses no volume.
fn closed(mesh: &Mesh, place: &str) -> Result<()> {
    let mut sides = HashSet::with_capacity(3 * mesh.triangles.len());
    for &[a, b, c] in &mesh.triangles {
        for side in [(a, b), (b, c), (c, a)] {
            if !sides.insert(side) {
                let found = format!(
                    "two triangles on one side of vertices {} and {}",
                    side.0, side.1
                );
                return Err(Error::input(
                    place,
                    found,
                    "a closed surface, each edge of two",
                ));
            }
        }
    }
    if let Some((a, b)) = mesh
        .triangles
        .iter()
        .flat_map(|&[a, b, c]| [(a, b), (b, c), (c, a)])
        .find(|&(a, b)| !sides.contains(&(b, a)))
    {
        let found = format!("an open edge between vertices {a} and {b}");
        return Err(Error::input(
            place,
            found,
            "a closed surface, each edge of two",
        ));
    }
    let volume: f64 = (0..mesh.triangles.len())
        .map(|t| {
            let [a, b, c] = mesh.corners(t);
            a.dot(b.cross(c)) / 6.0
        })
        .sum();
    if volume > 0.0 {
        return Ok(());
    }
    let found = format!("a volume of {volume} mm^3");
    Err(Error::input(
        place,
        found,
        "a surface whose normals point outwards",
    ))
}
