//! Results of decoding: maps in row-major order, and the verdict of each pixel.

use phasmid_geometry::NoiseModel;
use phasmid_pattern::Axis;
use std::borrow::Cow;
use std::ops::Range;

/// Whether a pixel has a coordinate, or why not.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
#[repr(u8)]
pub enum Verdict {
    /// The pixel has a coordinate.
    #[default]
    Valid,
    /// A fringe frame is saturated at the pixel.
    Saturated,
    /// The modulation is too low: absolutely, relative to the noise, or relative to white minus
    /// black.
    Dim,
    /// The fringe order is uncertain, the coordinate lies outside the projector, or the pixel spans a
    /// period of the finest fringe.
    Uncertain,
    /// The pixel sees two surfaces at once, or disagrees with its neighbours on both sides.
    Mixed,
    /// The pixel has no valid neighbour to compare with.
    Stray,
    /// The pixel's frames contradict each other, for example because one is damaged.
    Odd,
}

impl Verdict {
    /// All verdicts in order.
    pub const ALL: [Self; 7] = [
        Self::Valid,
        Self::Saturated,
        Self::Dim,
        Self::Uncertain,
        Self::Mixed,
        Self::Stray,
        Self::Odd,
    ];

    /// Returns the name used in tables.
    pub fn name(self) -> &'static str {
        match self {
            Self::Valid => "valid",
            Self::Saturated => "saturated",
            Self::Dim => "low modulation",
            Self::Uncertain => "uncertain order",
            Self::Mixed => "mixed",
            Self::Stray => "stray",
            Self::Odd => "contradictory",
        }
    }
}

/// Maps of one axis, height x width row by row.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct AxisMap {
    /// Projector coordinate in pixels, NaN where invalid.
    pub coordinate: Vec<f32>,
    /// Standard deviation of the coordinate due to noise in projector pixels, NaN where invalid: the
    /// scatter of repeated scans.
    pub sigma: Vec<f32>,
    /// Standard uncertainty in projector pixels due to held projector pixels (see [`crate::Held`]) and
    /// the rounding of their levels to 8 bits, NaN where invalid; empty if the contribution of held
    /// pixels is below a tenth of the noise throughout.
    pub sampling: Vec<f32>,
    /// Verdict of each pixel.
    pub verdict: Vec<Verdict>,
    /// Period that coordinates are known modulo, if the fringe order is unresolved; after spatial
    /// unwrapping, each connected region has an unknown offset of a whole number of periods.
    pub wrapped_px: Option<f64>,
    /// Number of finest Gray bits that the camera does not resolve and that were left out.
    pub unused_bits: usize,
}

impl AxisMap {
    /// Returns the number of pixels with this verdict.
    pub(super) fn count(&self, wanted: Verdict) -> usize {
        // A chunk's count fits into 8 bits, so the loop vectorises with 8-bit sums.
        let of_chunk = |chunk: &[Verdict]| chunk.iter().map(|v| u8::from(*v == wanted)).sum::<u8>();
        let chunks = self.verdict.chunks(usize::from(u8::MAX));
        chunks.map(|chunk| usize::from(of_chunk(chunk))).sum()
    }

    /// Returns a pixel's standard uncertainty in projector pixels: noise and held projector pixels
    /// together. NaN where invalid.
    pub fn uncertainty(&self, i: usize) -> f32 {
        let [noise, held] = [self.sigma[i], self.sampling.get(i).copied().unwrap_or(0.0)];
        (noise * noise + held * held).sqrt()
    }

    /// Returns the standard uncertainties of a range of pixels, as [`Self::uncertainty`].
    pub fn uncertainties(&self, pixels: Range<usize>) -> Cow<'_, [f32]> {
        if self.sampling.is_empty() {
            return self.sigma[pixels].into();
        }
        let [noise, held] = [&self.sigma, &self.sampling].map(|all| &all[pixels.clone()]);
        let both = noise.iter().zip(held);
        both.map(|(noise, held)| (noise * noise + held * held).sqrt())
            .collect()
    }
}

/// The result of decoding a sequence; maps are height x width, row by row.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Decoded {
    /// Columns.
    pub width: usize,
    /// Rows.
    pub height: usize,
    /// Projector columns, if the sequence encodes them.
    pub x: Option<AxisMap>,
    /// Projector rows, if the sequence encodes them.
    pub y: Option<AxisMap>,
    /// Modulation B in DN of the finest fringes of the first axis; for Gray code alone, half its
    /// contrast.
    pub modulation: Vec<f32>,
    /// White minus black (without them: twice the modulation) over the camera's range, 0 to 1.
    pub intensity: Vec<f32>,
    /// Depth z in the camera's frame in mm, NaN where invalid; empty without a rig.
    pub depth: Vec<f32>,
    /// Standard deviation of the depth in mm, due to noise and held projector pixels; NaN where
    /// invalid, empty without a rig.
    pub depth_sigma: Vec<f32>,
    /// Whether depth was mapped from the phase against a reference plane instead of triangulated.
    pub mapped: bool,
    /// The noise model used for the standard deviations.
    pub noise: Option<NoiseModel>,
    /// Notes for the user about the decoding.
    pub notes: Vec<String>,
}

impl Decoded {
    /// Returns the map of an axis, if decoded.
    pub fn axis(&self, axis: Axis) -> Option<&AxisMap> {
        match axis {
            Axis::X => self.x.as_ref(),
            Axis::Y => self.y.as_ref(),
        }
    }

    /// Iterates over the decoded maps, x before y.
    pub fn axes(&self) -> impl Iterator<Item = (Axis, &AxisMap)> {
        [(Axis::X, &self.x), (Axis::Y, &self.y)]
            .into_iter()
            .filter_map(|(axis, map)| map.as_ref().map(|map| (axis, map)))
    }

    /// Returns whether pixel `i` is valid on every decoded axis.
    pub fn is_valid(&self, i: usize) -> bool {
        self.axes().all(|(_, map)| map.verdict[i] == Verdict::Valid)
    }

    pub(super) fn axis_mut(&mut self, axis: Axis) -> &mut Option<AxisMap> {
        match axis {
            Axis::X => &mut self.x,
            Axis::Y => &mut self.y,
        }
    }
}
