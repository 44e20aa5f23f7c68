//! Where voxels lie.

use glam::{DMat3, DVec3};
use phasmid_core::error::{Error, Result};

/// Most voxels that a volume may have. 512 x 512 x 1000 are fewer.
const MOST_VOXELS: u64 = 1 << 28;

/// Most voxels along an axis.
const LONGEST_AXIS: usize = 1 << 14;

/// Least and greatest distance of voxels, in millimetres.
const SPACING_MM: [f64; 2] = [1e-3, 1e3];

/// Farthest that an origin may be, in millimetres.
const FARTHEST_MM: f64 = 1e6;

/// How far directions may be from orthonormal; files give six digits.
const ORTHONORMAL: f64 = 1e-4;

/// How far places of grids may be apart that count as the same, as a part of a voxel: a spacing of six
/// digits puts the far side of a volume off by as much.
const SAME: f64 = 0.01;

/// A grid of voxels, as ITK and DICOM have it: index (0, 0, 0) is the centre of the first voxel, and
/// `point = origin + direction (spacing * index)`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Grid {
    /// Voxels along i, j and k; i runs fastest in memory.
    pub size: [usize; 3],
    /// Distance of neighbouring centres along i, j and k, in millimetres.
    pub spacing_mm: DVec3,
    /// Centre of the first voxel in the patient frame (LPS), in millimetres.
    pub origin_mm: DVec3,
    /// Its columns are the directions of i, j and k in the patient frame: orthonormal, right- or
    /// left-handed.
    pub direction: DMat3,
}

impl Grid {
    /// A grid along the axes of the patient frame.
    pub fn upright(size: [usize; 3], spacing_mm: DVec3, origin_mm: DVec3) -> Self {
        Self {
            size,
            spacing_mm,
            origin_mm,
            direction: DMat3::IDENTITY,
        }
    }

    /// The grid, if there can be such voxels in memory: 1 to 16384 along each axis and at most 2^28
    /// in all, spacings of 0.001 to 1000 mm, an origin within 1e6 mm, orthonormal directions to
    /// 1e-4. `place` names it in messages.
    ///
    /// # Errors
    /// What cannot be.
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
        // glam's maximum passes over what is no number.
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

    /// Voxels in all.
    pub fn voxels(&self) -> usize {
        self.size.iter().product()
    }

    /// Place of a voxel in memory.
    pub fn offset(&self, [i, j, k]: [usize; 3]) -> usize {
        i + self.size[0] * (j + self.size[1] * k)
    }

    /// The point of an index (whole numbers are centres), in millimetres in the patient frame.
    #[inline]
    pub fn point(&self, index: DVec3) -> DVec3 {
        self.origin_mm + self.direction * (self.spacing_mm * index)
    }

    /// The index of a point; [`Grid::point`]'s inverse, as far as the directions are orthonormal.
    #[inline]
    pub fn index(&self, point_mm: DVec3) -> DVec3 {
        self.direction.transpose() * (point_mm - self.origin_mm) / self.spacing_mm
    }

    /// Whether an index lies in the space of the voxels, which reaches half a voxel beyond the
    /// outermost centres, and by as much farther as the corners of grids may be apart that are the
    /// same by [`Grid::difference`]: what is cut at the border of one lies in the other.
    #[inline]
    pub fn holds(&self, index: DVec3) -> bool {
        let reach = DVec3::splat(0.5 + 2.0 * SAME);
        index.cmpge(-reach).all() && index.cmple(self.last() + reach).all()
    }

    /// The index of the last voxel.
    #[inline]
    pub fn last(&self) -> DVec3 {
        DVec3::from_array(self.size.map(|n| n as f64 - 1.0))
    }

    /// The box around all centres along the patient's axes, for a message.
    pub(crate) fn box_in_words(&self) -> String {
        let corner = |n: usize| {
            let pick = |axis: usize| [0.0, 1.0][n >> axis & 1];
            self.point(self.last() * DVec3::new(pick(0), pick(1), pick(2)))
        };
        let first = (corner(0), corner(0));
        let (low, high) = (1..8).fold(first, |(a, b), n| (a.min(corner(n)), b.max(corner(n))));
        format!("{} to {} mm", listed(low), listed(high))
    }

    /// The same grid with its origin elsewhere by `shift_mm`.
    #[must_use]
    pub fn shifted(mut self, shift_mm: DVec3) -> Self {
        self.origin_mm += shift_mm;
        self
    }

    /// In words, how this grid differs from another by more than a hundredth of a voxel at any of
    /// its corners: what is here and what is there.
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

/// Three numbers for a message.
pub(crate) fn listed(v: DVec3) -> String {
    format!("({}, {}, {})", v.x, v.y, v.z)
}
