//! Voxel grids, and trilinear interpolation between the eight voxels around an index.

use glam::{DMat3, DVec3};
use phasmid_core::error::{Error, Result};

/// Maximum number of voxels, more than 512 x 512 x 1000.
const MOST_VOXELS: u64 = 1 << 28;

/// Maximum number of voxels along an axis.
const LONGEST_AXIS: usize = 1 << 14;

/// Minimum and maximum voxel spacing, in millimetres.
const SPACING_MM: [f64; 2] = [1e-3, 1e3];

/// Maximum absolute coordinate of an origin, in millimetres.
const FARTHEST_MM: f64 = 1e6;

/// Tolerance for orthonormal directions; files give six digits.
const ORTHONORMAL: f64 = 1e-4;

/// Maximum distance between corresponding corners of grids that count as equal, as a fraction of a
/// voxel: rounding the spacing to six digits shifts the far side of a volume by as much.
const SAME: f64 = 0.01;

/// A grid of voxels, as in ITK and DICOM: index (0, 0, 0) is the centre of the first voxel, and
/// `point = origin + direction (spacing * index)`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Grid {
    /// Voxels along i, j and k; i runs fastest in memory.
    pub size: [usize; 3],
    /// Spacing of voxel centres along i, j and k, in millimetres.
    pub spacing_mm: DVec3,
    /// Centre of the first voxel in the patient frame (LPS), in millimetres.
    pub origin_mm: DVec3,
    /// The columns are the directions of i, j and k in the patient frame: orthonormal, right- or
    /// left-handed.
    pub direction: DMat3,
}

impl Grid {
    /// Creates a grid along the axes of the patient frame.
    pub fn upright(size: [usize; 3], spacing_mm: DVec3, origin_mm: DVec3) -> Self {
        Self {
            size,
            spacing_mm,
            origin_mm,
            direction: DMat3::IDENTITY,
        }
    }

    /// Returns the grid if it is valid: 1 to 16384 voxels along each axis and at most 2^28 in
    /// total, spacings of 0.001 to 1000 mm, an origin within 1e6 mm, directions orthonormal to
    /// 1e-4. `place` names it in messages.
    ///
    /// # Errors
    /// Returns the first violation.
    pub fn checked(self, place: &str) -> Result<Self> {
        let [ni, nj, nk] = self.size;
        if self.size.iter().any(|n| !(1..=LONGEST_AXIS).contains(n)) {
            return Err(Error::input(
                place,
                format!("{ni} x {nj} x {nk} voxels"),
                format!("1 to {LONGEST_AXIS} voxels along each axis"),
            ));
        }
        if self.size.iter().map(|&n| n as u64).product::<u64>() > MOST_VOXELS {
            return Err(Error::input(
                place,
                format!("{ni} x {nj} x {nk} voxels"),
                format!("up to {MOST_VOXELS} voxels in all"),
            ));
        }
        let [least, most] = SPACING_MM;
        let spacing = self.spacing_mm.to_array();
        if !spacing.iter().all(|mm| (least..=most).contains(mm)) {
            return Err(Error::input(
                place,
                format!("a spacing of {}", listed(self.spacing_mm)),
                format!("spacings of {least} to {most} mm"),
            ));
        }
        // glam's maximum ignores NaN.
        let origin = self.origin_mm.to_array();
        if !origin.iter().all(|mm| mm.abs() <= FARTHEST_MM) {
            return Err(Error::input(
                place,
                format!("an origin at {}", listed(self.origin_mm)),
                format!("finite coordinates within {FARTHEST_MM:e} mm"),
            ));
        }
        let off = self.direction.transpose() * self.direction - DMat3::IDENTITY;
        if !off
            .to_cols_array()
            .iter()
            .all(|x| x.is_finite() && x.abs() <= ORTHONORMAL)
        {
            let axes = [0, 1, 2].map(|axis| listed(self.direction.col(axis)));
            return Err(Error::input(
                place,
                format!("directions {}", axes.join(", ")),
                format!("orthonormal directions, to within {ORTHONORMAL}"),
            ));
        }
        Ok(self)
    }

    /// Returns the total number of voxels.
    pub fn voxels(&self) -> usize {
        self.size.iter().product()
    }

    /// Returns the memory index of a voxel.
    pub fn offset(&self, [i, j, k]: [usize; 3]) -> usize {
        i + self.size[0] * (j + self.size[1] * k)
    }

    /// Returns the point of an index (integers are centres), in millimetres in the patient frame.
    #[inline]
    pub fn point(&self, index: DVec3) -> DVec3 {
        self.origin_mm + self.direction * (self.spacing_mm * index)
    }

    /// Returns the index of a point, the inverse of [`Grid::point`] up to the orthonormality of the
    /// directions.
    #[inline]
    pub fn index(&self, point_mm: DVec3) -> DVec3 {
        self.direction.transpose() * (point_mm - self.origin_mm) / self.spacing_mm
    }

    /// Returns whether an index lies in the space of the voxels, which extends half a voxel beyond the
    /// outermost centres, plus the tolerance of [`Grid::difference`]: a surface cut at the border of one
    /// grid must lie in an equal grid.
    #[inline]
    pub fn holds(&self, index: DVec3) -> bool {
        let reach = DVec3::splat(0.5 + 2.0 * SAME);
        index.cmpge(-reach).all() && index.cmple(self.last() + reach).all()
    }

    /// Returns the index of the last voxel.
    #[inline]
    pub fn last(&self) -> DVec3 {
        DVec3::from_array(self.size.map(|n| n as f64 - 1.0))
    }

    /// Bounding box of all centres along the patient's axes, for messages.
    pub(crate) fn box_in_words(&self) -> String {
        let corner = |n: usize| {
            let pick = |axis: usize| [0.0, 1.0][n >> axis & 1];
            self.point(self.last() * DVec3::new(pick(0), pick(1), pick(2)))
        };
        let first = (corner(0), corner(0));
        let (low, high) = (1..8).fold(first, |(a, b), n| (a.min(corner(n)), b.max(corner(n))));
        format!("{} to {} mm", listed(low), listed(high))
    }

    /// Returns the grid with its origin shifted by `shift_mm`.
    #[must_use]
    pub fn shifted(mut self, shift_mm: DVec3) -> Self {
        self.origin_mm += shift_mm;
        self
    }

    /// Describes how this grid differs from another by more than a hundredth of a voxel at any
    /// corner, as texts for this grid and the other; `None` if they are equal.
    pub fn difference(&self, other: &Self) -> Option<(String, String)> {
        if self.size != other.size {
            let words = |g: &Self| format!("{} x {} x {} voxels", g.size[0], g.size[1], g.size[2]);
            return Some((words(self), words(other)));
        }
        let tolerance = SAME * other.spacing_mm.min_element();
        let far = self.last();
        if ((self.spacing_mm - other.spacing_mm) * far)
            .abs()
            .max_element()
            > tolerance
            || (self.spacing_mm - other.spacing_mm).abs().max_element() > tolerance
        {
            let words = |g: &Self| format!("a spacing of {}", listed(g.spacing_mm));
            return Some((words(self), words(other)));
        }
        if (self.origin_mm - other.origin_mm).abs().max_element() > tolerance {
            let words = |g: &Self| format!("an origin at {}", listed(g.origin_mm));
            return Some((words(self), words(other)));
        }
        let turned = (0..8).any(|corner| {
            let pick = |axis: usize| f64::from(u8::from(corner >> axis & 1 == 1));
            let index = far * DVec3::new(pick(0), pick(1), pick(2));
            (self.point(index) - other.point(index)).length() > 2.0 * tolerance
        });
        turned.then(|| {
            let words = |g: &Self| {
                let axes = [0, 1, 2].map(|axis| listed(g.direction.col(axis)));
                format!("directions {}", axes.join(", "))
            };
            (words(self), words(other))
        })
    }
}

/// Formats three numbers for a message.
pub(crate) fn listed(v: DVec3) -> String {
    format!("({}, {}, {})", v.x, v.y, v.z)
}

/// Offsets and weights of eight voxels; the weights sum to one.
pub(super) struct Cell {
    pub(super) offsets: [usize; 8],
    pub(super) weights: [f64; 8],
}

/// Returns the cell of an index, clamped to the outermost centres. NaN counts as the first voxel.
pub(super) fn cell(grid: &Grid, index: DVec3) -> Cell {
    let mut low = [0_usize; 3];
    let mut step = [0_usize; 3];
    let mut part = [0.0_f64; 3];
    let strides = [1, grid.size[0], grid.size[0] * grid.size[1]];
    for axis in 0..3 {
        let last = grid.size[axis] - 1;
        // `max` returns 0 if the index is NaN.
        let x = index[axis].max(0.0).min(last as f64);
        // The last centre belongs to the cell before it.
        low[axis] = (x as usize).min(last.saturating_sub(1));
        part[axis] = x - low[axis] as f64;
        step[axis] = if last == 0 { 0 } else { strides[axis] };
    }
    let first = low[0] + grid.size[0] * (low[1] + grid.size[1] * low[2]);
    let mut cell = Cell {
        offsets: [first; 8],
        weights: [1.0; 8],
    };
    for corner in 0..8 {
        for axis in 0..3 {
            let upper = corner >> axis & 1 == 1;
            cell.offsets[corner] += if upper { step[axis] } else { 0 };
            cell.weights[corner] *= if upper { part[axis] } else { 1.0 - part[axis] };
        }
    }
    cell
}
