//! Ellipse that outlines an imaged dot, and the window of pixels around it.

use glam::{DMat2, DVec2};

/// An ellipse: the unit circle transformed by a symmetric, positive matrix, about a centre.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Ellipse {
    /// In pixels.
    pub centre: DVec2,
    /// In pixels.
    pub shape: DMat2,
}

impl Ellipse {
    /// Half the width and height of the bounding box.
    pub fn reach(&self) -> DVec2 {
        DVec2::new(self.shape.x_axis.length(), self.shape.y_axis.length())
    }

    /// Semi-axes in pixels, the smaller first.
    pub fn half_axes(&self) -> [f64; 2] {
        let (mean, half, off) = (
            0.5 * (self.shape.x_axis.x + self.shape.y_axis.y),
            0.5 * (self.shape.x_axis.x - self.shape.y_axis.y),
            self.shape.x_axis.y,
        );
        let spread = half.hypot(off);
        [mean - spread, mean + spread]
    }

    /// Area in units of pi pixels.
    pub fn size(&self) -> f64 {
        self.shape.determinant()
    }

    /// Returns the ellipse with both semi-axes longer by `px`.
    pub fn wider(&self, px: f64) -> Self {
        Self {
            centre: self.centre,
            shape: self.shape + DMat2::from_diagonal(DVec2::splat(px)),
        }
    }

    /// Whether the ellipse is finite and not degenerate.
    pub fn is_sound(&self) -> bool {
        let [small, large] = self.half_axes();
        self.centre.is_finite() && small > 0.05 && large.is_finite()
    }

    /// Returns a function that maps a pixel position to a value below 1 inside and above 1 outside.
    pub fn inward(&self) -> impl Fn(DVec2) -> f64 + use<> {
        let (centre, inverse) = (self.centre, self.shape.inverse());
        move |px| (inverse * (px - centre)).length_squared()
    }
}

/// Symmetric square root of a symmetric, positive matrix, by the Cayley-Hamilton theorem. Adds a
/// multiple of the identity if needed, so that the root's eigenvalues are at least `least`.
pub(super) fn root(m: DMat2, least: f64) -> DMat2 {
    let m = {
        let [small, _] = Ellipse {
            centre: DVec2::ZERO,
            shape: m,
        }
        .half_axes();
        let lift = (least * least - small).max(0.0);
        m + DMat2::from_diagonal(DVec2::splat(lift))
    };
    let product = m.determinant().max(0.0).sqrt();
    let sum = (m.x_axis.x + m.y_axis.y + 2.0 * product).sqrt();
    (m + DMat2::from_diagonal(DVec2::splat(product))) * (1.0 / sum)
}

/// A rectangle of pixels: columns from `left`, rows from `top`.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Window {
    pub left: usize,
    pub top: usize,
    pub width: usize,
    pub height: usize,
}

impl Window {
    /// Pixels within `reach` of `centre`, clipped to an image of `width` x `height`; `None` if
    /// there are none.
    pub fn about(centre: DVec2, reach: DVec2, width: usize, height: usize) -> Option<Self> {
        if !(centre.is_finite() && reach.is_finite()) {
            return None;
        }
        let range = |middle: f64, reach: f64, size: usize| {
            let first = (middle - reach).ceil().max(0.0);
            let last = (middle + reach).floor().min(size as f64 - 1.0);
            (last >= first).then(|| (first as usize, last as usize - first as usize + 1))
        };
        let (left, columns) = range(centre.x, reach.x, width)?;
        let (top, rows) = range(centre.y, reach.y, height)?;
        Some(Self {
            left,
            top,
            width: columns,
            height: rows,
        })
    }

    /// Positions of the window's pixels, row by row.
    pub fn pixels(&self) -> impl Iterator<Item = DVec2> + use<> {
        let Self {
            left,
            top,
            width,
            height,
        } = *self;
        (top..top + height)
            .flat_map(move |v| (left..left + width).map(move |u| DVec2::new(u as f64, v as f64)))
    }
}
