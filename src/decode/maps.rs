//! What decoding gives: maps of one row of values after another, and why a pixel has none.

use phasmid_geometry::NoiseModel;
use phasmid_pattern::Axis;

/// Why a pixel has no coordinate.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
#[repr(u8)]
pub enum Verdict {
    /// It has one.
    #[default]
    Valid,
    /// A fringe frame is saturated there.
    Saturated,
    /// Too little modulation: absolutely, against the noise, or against white minus black.
    Dim,
    /// The order of its period is not certain, or beyond the projector, or the pixel spans a
    /// period of the finest fringe.
    Uncertain,
    /// It reads two surfaces at once, or disagrees with both neighbourhoods.
    Mixed,
    /// No neighbour is valid that it could be checked against.
    Stray,
    /// Its frames contradict each other, as where one of them is damaged.
    Odd,
}

impl Verdict {
    /// Every verdict in order.
    pub const ALL: [Self; 7] = [
        Self::Valid,
        Self::Saturated,
        Self::Dim,
        Self::Uncertain,
        Self::Mixed,
        Self::Stray,
        Self::Odd,
    ];

    /// The name in tables.
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
    /// Standard deviation of the coordinate in projector pixels, NaN where invalid.
    pub sigma: Vec<f32>,
    /// Why each pixel is valid or not.
    pub verdict: Vec<Verdict>,
    /// The period that coordinates are known modulo, where their order is not resolved: after
    /// spatial unwrapping, up to one whole number of periods per connected region.
    pub wrapped_px: Option<f64>,
}

/// What a sequence decodes to; maps are height x width, row by row.
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
    /// Modulation B in DN of the finest fringes of the first axis; of Gray code alone, its half
    /// contrast.
    pub modulation: Vec<f32>,
    /// White minus black (without them: twice the modulation) over the camera's range, 0 to 1.
    pub intensity: Vec<f32>,
    /// Depth z in the camera's frame in mm, NaN where there is none; empty without a rig.
    pub depth: Vec<f32>,
    /// Standard deviation of the depth in mm, NaN where there is none; empty without a rig.
    pub depth_sigma: Vec<f32>,
    /// The noise model that the standard deviations come from.
    pub noise: Option<NoiseModel>,
    /// What the user should know about how it was decoded.
    pub notes: Vec<String>,
}

impl Decoded {
    /// The map of an axis.
    pub fn axis(&self, axis: Axis) -> Option<&AxisMap> {
        match axis {
            Axis::X => self.x.as_ref(),
            Axis::Y => self.y.as_ref(),
        }
    }

    /// The maps there are, x before y.
    pub fn axes(&self) -> impl Iterator<Item = (Axis, &AxisMap)> {
        [(Axis::X, &self.x), (Axis::Y, &self.y)]
            .into_iter()
            .filter_map(|(axis, map)| map.as_ref().map(|map| (axis, map)))
    }

    /// Whether pixel `i` is valid on every axis that was decoded.
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
