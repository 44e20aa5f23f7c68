//! Triangle meshes, which all file readers return, with their validation and cleaning.

use glam::DVec3;
use phasmid_core::error::{Error, Result};
use rayon::prelude::*;
use std::fmt;
use std::hash::{DefaultHasher, Hash, Hasher};

/// Coordinate limit. Larger values are mistakes, and their squares would overflow f32.
const LARGEST_MM: f64 = 1e9;
/// Maximum number of corners of a polygon. Polygons become fans, whose slivers share one corner and
/// overlap in every search tree, so each ray would test most of them.
pub(crate) const MAX_CORNERS: usize = 1000;
/// A triangle is degenerate if its height is at most this fraction of its longest side: the
/// direction of its normal is then a rounding error.
const FLATTEST: f64 = 1e-12;

/// Numbers of triangles that [`Mesh::clean`] has removed.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, serde::Serialize)]
pub struct Removed {
    /// Triangles without area.
    pub degenerate: usize,
    /// Triangles with the corners and the orientation of an earlier triangle.
    pub duplicate: usize,
}

impl Removed {
    /// Returns the number of triangles removed.
    pub fn total(&self) -> usize {
        self.degenerate + self.duplicate
    }
}

impl fmt::Display for Removed {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self {
            degenerate,
            duplicate,
        } = self;
        write!(
            f,
            "removed {degenerate} triangles without area and {duplicate} duplicate triangles"
        )
    }
}

/// A triangle mesh with shared vertices, in millimetres in the mesh's own frame. Seen from outside, the
/// corners of a triangle run counter-clockwise, so `(b - a) x (c - a)` points outwards.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Mesh {
    /// Positions in millimetres.
    pub vertices: Vec<DVec3>,
    /// Three indices into `vertices` per triangle.
    pub triangles: Vec<[u32; 3]>,
    /// Reflectance at each vertex, 0 to 1: the luminance of its colour. Empty without colours.
    pub colours: Vec<f32>,
    /// Texture coordinates at the corners of each triangle, u to the right and v up, in units of
    /// the image size. Empty if there are none.
    pub uv: Vec<[[f32; 2]; 3]>,
}

impl Mesh {
    /// Returns the mesh if it can be rendered and measured: at least one triangle, indices in
    /// range, coordinates finite and within 1e9 mm. `place` names it in messages.
    ///
    /// # Errors
    /// Returns the first violation, with the index of the vertex or triangle, counted from 0.
    pub fn checked(self, place: &str) -> Result<Self> {
        if self.triangles.is_empty() {
            return Err(Error::input(place, "no triangle", "at least one triangle"));
        }
        for (index, &vertex) in self.vertices.iter().enumerate() {
            check_vertex(vertex, index, place)?;
        }
        let count = self.vertices.len();
        if !self.colours.is_empty() && self.colours.len() != count {
            return Err(Error::input(
                place,
                format!("{} colours of {count} vertices", self.colours.len()),
                "one colour for each vertex, or no colours",
            ));
        }
        if !self.uv.is_empty() && self.uv.len() != self.triangles.len() {
            let (found, triangles) = (self.uv.len(), self.triangles.len());
            return Err(Error::input(
                place,
                format!("texture coordinates for {found} of {triangles} triangles"),
                "texture coordinates for all triangles, or for none",
            ));
        }
        for (index, &colour) in self.colours.iter().enumerate() {
            if !(0.0..=1.0).contains(&colour) {
                return Err(Error::input(
                    format!("{place}: vertex {index}"),
                    format!("a reflectance of {colour}"),
                    "a reflectance of 0 to 1",
                ));
            }
        }
        for (index, corners) in self.uv.iter().enumerate() {
            if let Some(bad) = corners.as_flattened().iter().find(|c| !(c.abs() <= 1e6)) {
                return Err(Error::input(
                    format!("{place}: triangle {index}"),
                    format!("a texture coordinate of {bad}"),
                    "numbers within 1e6",
                ));
            }
        }
        for (index, triangle) in self.triangles.iter().enumerate() {
            if let Some(bad) = triangle.iter().find(|&&i| i as usize >= count) {
                return Err(Error::input(
                    format!("{place}: triangle {index}"),
                    format!("vertex {bad}"),
                    format!("vertices 0 to {}", count as i64 - 1),
                ));
            }
        }
        Ok(self)
    }

    /// Removes triangles without area. Of triangles with equal corners and orientation, keeps only the
    /// first. The removed triangles change no surface, but they would overlap in every search tree. The
    /// vertices stay. The mesh must have passed [`Self::checked`]; `place` names it in messages.
    ///
    /// # Errors
    /// Returns an error if no triangle is left.
    pub fn clean(&mut self, place: &str) -> Result<Removed> {
        self.clean_deforming(&[], place)
    }

    /// Cleans a mesh that deforms, like [`Self::clean`]: removes triangles that have no area, or equal
    /// an earlier triangle, both in this shape and in all `keyframes`. Each keyframe has as many
    /// vertices as the mesh.
    ///
    /// # Errors
    /// Returns an error if no triangle is left.
    pub fn clean_deforming(&mut self, keyframes: &[Vec<DVec3>], place: &str) -> Result<Removed> {
        let count = self.triangles.len();
        let shapes: Vec<&[DVec3]> = std::iter::once(&self.vertices)
            .chain(keyframes)
            .map(Vec::as_slice)
            .collect();
        let bits = |i: u32| bits(self.triangles[i as usize], &shapes);
        let mut kept: Vec<(u64, u32)> = (0..count as u32)
            .into_par_iter()
            .filter(|&i| {
                let corners = |shape: &[DVec3]| corners(self.triangles[i as usize], shape);
                !shapes.iter().all(|shape| is_degenerate(corners(shape)))
            })
            .map(|i| {
                let mut hasher = DefaultHasher::new();
                bits(i).for_each(|bits| bits.hash(&mut hasher));
                (hasher.finish(), i)
            })
            .collect();
        let degenerate = count - kept.len();
        kept.par_sort_unstable();
        kept.dedup_by(|later, first| later.0 == first.0 && bits(later.1).eq(bits(first.1)));
        let removed = Removed {
            degenerate,
            duplicate: count - degenerate - kept.len(),
        };
        if kept.is_empty() {
            return Err(Error::input(
                place,
                format!("{count} triangles, all without area"),
                "at least one triangle with an area",
            ));
        }
        if removed.total() > 0 {
            kept.par_sort_unstable_by_key(|&(_, i)| i);
            let kept = || kept.iter().map(|&(_, i)| i as usize);
            if !self.uv.is_empty() {
                self.uv = kept().map(|i| self.uv[i]).collect();
            }
            self.triangles = kept().map(|i| self.triangles[i]).collect();
        }
        Ok(removed)
    }

    /// Returns the corners of triangle `index`, in millimetres.
    pub fn corners(&self, index: usize) -> [DVec3; 3] {
        corners(self.triangles[index], &self.vertices)
    }

    /// Returns the lowest and highest corner of the bounding box of all vertices, in millimetres;
    /// `None` without vertices.
    pub fn bounds(&self) -> Option<(DVec3, DVec3)> {
        let first = *self.vertices.first()?;
        Some(
            self.vertices
                .iter()
                .fold((first, first), |(lo, hi), &v| (lo.min(v), hi.max(v))),
        )
    }
}

fn corners(triangle: [u32; 3], vertices: &[DVec3]) -> [DVec3; 3] {
    triangle.map(|i| vertices[i as usize])
}

/// Returns the bits of a triangle's corners in each shape, rotated so that the corner with the lowest
/// bits in the first shape comes first.
fn bits<'a>(
    triangle: [u32; 3],
    shapes: &'a [&[DVec3]],
) -> impl Iterator<Item = [[u64; 3]; 3]> + use<'a> {
    // Adding zero turns -0 into +0.
    let bits = move |shape| {
        corners(triangle, shape).map(|v| (v + DVec3::ZERO).to_array().map(f64::to_bits))
    };
    let first = bits(shapes[0]);
    let lowest = (0..3).min_by_key(|&i| first[i]).unwrap_or(0);
    shapes.iter().map(move |shape| {
        let mut bits = bits(shape);
        bits.rotate_left(lowest);
        bits
    })
}

fn is_degenerate([a, b, c]: [DVec3; 3]) -> bool {
    let [u, v, w] = [b - a, c - b, a - c];
    let longest = [u, v, w].map(DVec3::length_squared);
    u.cross(v).length() <= FLATTEST * longest.into_iter().fold(0.0, f64::max)
}

/// Rejects a polygon of more corners than [`MAX_CORNERS`].
pub(crate) fn check_corners(corners: usize, at: impl Fn() -> String) -> Result<()> {
    if corners <= MAX_CORNERS {
        return Ok(());
    }
    Err(Error::input(
        at(),
        format!("a face of more than {MAX_CORNERS} corners"),
        format!("3 to {MAX_CORNERS}; split the face into triangles"),
    ))
}

/// Rejects a vertex that is not finite or too far away.
pub(crate) fn check_vertex(vertex: DVec3, index: usize, place: &str) -> Result<()> {
    if vertex.is_finite() && vertex.abs().max_element() <= LARGEST_MM {
        return Ok(());
    }
    Err(Error::input(
        format!("{place}: vertex {index}"),
        format!("({}, {}, {})", vertex.x, vertex.y, vertex.z),
        format!("finite coordinates within {LARGEST_MM:e} mm"),
    ))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn complaint(mesh: Mesh) -> String {
        mesh.checked("m.stl").unwrap_err().to_string()
    }

    #[test]
    fn errors_name_the_faulty_vertex_or_triangle() {
        let good = Mesh {
            vertices: vec![DVec3::ZERO, DVec3::X, DVec3::Y],
            triangles: vec![[0, 1, 2], [0, 0, 0], [0, 1, 2]],
            ..Mesh::default()
        };
        good.clone().checked("m.stl").unwrap();
        let mut nan = good.clone();
        nan.vertices[1].y = f64::NAN;
        assert!(complaint(nan).contains("m.stl: vertex 1: (1, NaN, 0)"));
        let mut far = good.clone();
        far.triangles[1] = [0, 3, 1];
        assert!(complaint(far).contains("triangle 1: vertex 3; expected vertices 0 to 2"));
        let mut dark = good.clone();
        dark.colours = vec![0.5, f32::NAN, 0.5];
        assert!(complaint(dark).contains("vertex 1: a reflectance of NaN"));
        let mut few = good.clone();
        few.colours = vec![0.5];
        assert!(complaint(few).contains("1 colours of 3 vertices"));
        let mut wild = good.clone();
        wild.uv = vec![
            [[0.0; 2]; 3],
            [[0.0, 1e7], [0.0; 2], [0.0; 2]],
            [[0.0; 2]; 3],
        ];
        assert!(complaint(wild).contains("triangle 1: a texture coordinate of 10000000"));
        assert!(complaint(Mesh::default()).contains("no triangle"));
    }

    #[test]
    fn triangles_of_deforming_meshes_are_removed_if_redundant_in_all_keyframes() {
        let rest = vec![DVec3::ZERO, DVec3::X, DVec3::Y, DVec3::ZERO, DVec3::X];
        let mut moved = rest.clone();
        // Opens the triangle 0, 3, 2 and separates 3, 1, 2 from 0, 1, 2.
        moved[3].z = 1.0;
        let mesh = Mesh {
            vertices: rest,
            triangles: vec![[0, 1, 2], [0, 3, 2], [3, 1, 2], [4, 2, 0], [1, 1, 2]],
            ..Mesh::default()
        };
        let kept = |keyframes: &[Vec<DVec3>]| {
            let mut mesh = mesh.clone();
            mesh.clean_deforming(keyframes, "m.stl").unwrap();
            mesh.triangles
        };
        assert_eq!(kept(&[]), [[0, 1, 2]]);
        assert_eq!(kept(&[moved]), [[0, 1, 2], [0, 3, 2], [3, 1, 2]]);
    }

    #[test]
    fn removes_duplicate_and_degenerate_triangles() {
        let third = DVec3::new(1.0 / 3.0, 1.0 / 3.0, 0.0);
        let mut mesh = Mesh {
            // Vertex 3 repeats the first with a negative zero; vertex 4 lies on the edge from 1 to 2.
            vertices: vec![
                DVec3::ZERO,
                DVec3::X,
                DVec3::Y,
                DVec3::new(0.0, -0.0, 0.0),
                DVec3::X + (DVec3::Y - DVec3::X) * third.x,
            ],
            triangles: vec![
                [0, 0, 1],
                [0, 1, 2],
                [1, 2, 3],
                [0, 2, 1],
                [1, 4, 2],
                [2, 0, 1],
                [0, 1, 4],
            ],
            ..Mesh::default()
        };
        mesh.uv = (0..7).map(|i| [[i as f32; 2]; 3]).collect();
        let removed = mesh.clean("m.stl").unwrap();
        assert_eq!((removed.degenerate, removed.duplicate), (2, 2));
        // The opposite orientation is another triangle, which a ray meets from the other side.
        assert_eq!(mesh.triangles, [[0, 1, 2], [0, 2, 1], [0, 1, 4]]);
        assert_eq!(
            mesh.uv.iter().map(|c| c[0][0]).collect::<Vec<_>>(),
            [1.0, 3.0, 6.0]
        );
        assert_eq!(mesh.clean("m.stl").unwrap(), Removed::default());

        mesh.triangles = vec![[0, 0, 1]; 5];
        let error = mesh.clean("m.stl").unwrap_err().to_string();
        assert!(
            error.contains("m.stl: 5 triangles, all without area"),
            "{error}"
        );
    }

    #[test]
    fn many_equal_triangles_become_one() {
        let mut mesh = Mesh {
            vertices: vec![DVec3::ZERO, DVec3::X, DVec3::Y],
            triangles: vec![[0, 1, 2]; 100_000],
            ..Mesh::default()
        };
        let removed = mesh.clean("m.stl").unwrap();
        assert_eq!((removed.total(), mesh.triangles.len()), (99_999, 1));
        assert_eq!(
            removed.to_string(),
            "removed 0 triangles without area and 99999 duplicate triangles"
        );
    }
}
