//! Selects the decoded pixels in a point's cell of the board, except pixels that an outline
//! crosses.

use super::super::Seen;
use super::super::smooth::Smooth;
use glam::{DMat2, DVec2};
use phasmid_decode::{AxisMap, Decoded, Verdict};
use phasmid_geometry::Board;

/// Minimum gap in camera pixels between an outline and the square of a used pixel. It allows for
/// blur.
const MARGIN_PX: f64 = 1.0;
/// Maximum half side of a cell in camera pixels, because the fitted plane is not accurate over
/// larger areas. A large dot may need a larger cell.
const HALF_PX: f64 = 16.0;
/// Approximate maximum number of pixels per cell.
const PIXELS: f64 = 4096.0;

/// A pixel decoded on both axes.
#[derive(Debug, Clone, Copy)]
pub(super) struct Sample {
    /// Centre in camera pixels.
    pub(super) at: DVec2,
    /// Projector column and row, in pixels.
    pub(super) value: [f64; 2],
    /// Standard deviations of `value`, in pixels.
    pub(super) sigma: [f64; 2],
    /// Whether the pixel lies on a dot.
    pub(super) ink: bool,
}

/// The cells of a board and the decoded maps.
pub(super) struct Cells<'a> {
    board: &'a Board,
    camera: &'a Smooth,
    decoded: &'a Decoded,
    axes: [&'a AxisMap; 2],
}

impl<'a> Cells<'a> {
    /// Returns `None` if the sequence does not resolve both axes.
    pub(super) fn new(board: &'a Board, camera: &'a Smooth, decoded: &'a Decoded) -> Option<Self> {
        let pixels = decoded.width.checked_mul(decoded.height)?;
        let resolved = |map: &'a Option<AxisMap>| {
            map.as_ref().filter(|m| {
                let whole = [m.coordinate.len(), m.sigma.len(), m.verdict.len()] == [pixels; 3];
                m.wrapped_px.is_none() && whole
            })
        };
        Some(Self {
            board,
            camera,
            decoded,
            axes: [resolved(&decoded.x)?, resolved(&decoded.y)?],
        })
    }

    /// Collects the pixels of one point's cell.
    pub(super) fn samples(&self, seen: &Seen) -> Vec<Sample> {
        let middle = self.board.point(seen.index);
        let px_per_mm = self.camera.slope(middle);
        let mm_per_px = px_per_mm.inverse();
        if !mm_per_px.is_finite() || !seen.px.is_finite() {
            return Vec::new();
        }
        let half_mm = self.half_mm(seen.index, px_per_mm);
        // Bounding box of the cell in the image, with a pixel of margin for curvature.
        let reach = (px_per_mm.x_axis.abs() + px_per_mm.y_axis.abs()) * half_mm + 1.0;
        let size = DVec2::new(self.decoded.width as f64, self.decoded.height as f64);
        let low = (seen.px - reach).ceil().max(DVec2::ZERO);
        let high = (seen.px + reach).floor().min(size - 1.0);
        if !(low.cmple(high).all()) {
            return Vec::new();
        }
        let area = (high - low + 1.0).element_product();
        let stride = (area / PIXELS).sqrt().ceil().max(1.0) as usize;
        let mut samples = Vec::new();
        for v in (low.y as usize..=high.y as usize).step_by(stride) {
            for u in (low.x as usize..=high.x as usize).step_by(stride) {
                let at = DVec2::new(u as f64, v as f64);
                let linear = middle + mm_per_px * (at - seen.px);
                let mm = linear + mm_per_px * (at - self.camera.at(linear));
                if ((mm - middle).abs().max_element() > half_mm) || self.crossed(mm, mm_per_px) {
                    continue;
                }
                samples.extend(self.sample(v * self.decoded.width + u, at, mm));
            }
        }
        samples
    }

    /// Half the side of a cell in millimetres: half a pitch, or less if half a pitch spans too many
    /// pixels.
    fn half_mm(&self, index: [u32; 2], px_per_mm: DMat2) -> f64 {
        let scale = px_per_mm.x_axis.length().max(px_per_mm.y_axis.length());
        let needed = (2.0 * self.board.radius_mm(index)).max(HALF_PX / scale);
        needed.min(self.board.pitch_mm() / 2.0)
    }

    fn sample(&self, i: usize, at: DVec2, mm: DVec2) -> Option<Sample> {
        let value = self.axes.map(|map| f64::from(map.coordinate[i]));
        let sigma = self.axes.map(|map| f64::from(map.uncertainty(i)));
        let valid = self.axes.iter().all(|map| map.verdict[i] == Verdict::Valid);
        let known =
            value.iter().all(|v| v.is_finite()) && sigma.iter().all(|&s| s > 0.0 && s.is_finite());
        (valid && known).then(|| Sample {
            at,
            value,
            sigma,
            ink: self.on_ink(mm),
        })
    }

    /// Signed distance in millimetres to the nearest outline (negative inside a dot) and its gradient. A
    /// chessboard has two outlines, one for each family of edges; a dot's outline is given twice.
    fn outlines(&self, mm: DVec2) -> [(f64, DVec2); 2] {
        let index = self.nearest(mm);
        let from = mm - self.board.point(index);
        match self.board {
            Board::Dots { .. } => {
                let away = from.length();
                let distance = away - self.board.radius_mm(index);
                [(distance, from.normalize_or(DVec2::X)); 2]
            }
            Board::Chess { .. } => [(from.x, DVec2::X), (from.y, DVec2::Y)],
        }
    }

    /// Whether an outline crosses the pixel's square or the margin around it.
    fn crossed(&self, mm: DVec2, mm_per_px: DMat2) -> bool {
        self.outlines(mm).iter().any(|&(distance, gradient)| {
            // Gradient per camera pixel; a square extends half a pixel along both axes.
            let by_px = mm_per_px.transpose() * gradient;
            let square = 0.5 * (by_px.x.abs() + by_px.y.abs());
            !(distance.abs() > square + MARGIN_PX * by_px.length())
        })
    }

    fn on_ink(&self, mm: DVec2) -> bool {
        match self.board {
            Board::Dots { .. } => self.outlines(mm)[0].0 < 0.0,
            // Pixels on ink are left out of the fit of the whole map. On a chessboard no pixel
            // counts as ink, so that squares of both colours are used.
            Board::Chess { .. } => false,
        }
    }

    /// Nearest point of the grid, clamped to the grid.
    fn nearest(&self, mm: DVec2) -> [u32; 2] {
        let first = self.board.point([0, 0]);
        let at = ((mm - first) / self.board.pitch_mm()).round();
        let [columns, rows] = self.board.grid();
        let clamp = |v: f64, n: u32| v.clamp(0.0, f64::from(n.saturating_sub(1))) as u32;
        [clamp(at.x, columns), clamp(at.y, rows)]
    }
}
