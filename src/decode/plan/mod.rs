//! How a sequence can be decoded, axis by axis, or what it lacks.
//!
//! `axis` collects the fringes and Gray bits of an axis; `order` determines how its periods are
//! counted.

mod axis;
mod order;
#[cfg(test)]
mod tests;

use super::gray::{GrayCode, Threshold};
use super::steps::FringeSet;
use axis::plan_axis;
use phasmid_core::error::{Error, Result};
use phasmid_pattern::{Axis, Manifest, Pattern};

/// How the fringe order (number of whole periods) is determined.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Order {
    /// Not determined: coordinates are modulo this period, in projector pixels.
    Wrapped {
        /// Period in projector pixels.
        period_px: f64,
    },
    /// By the combination of all fringe sets, and by Gray code if their combination repeats within
    /// the axis.
    Resolved {
        /// Distance after which all fringe sets repeat, in projector pixels; infinite if beyond the
        /// axis.
        repeat_px: f64,
    },
    /// By Gray code without fringes: the coordinate is the centre of a cell.
    Cells,
}

/// How one axis is decoded.
#[derive(Debug, Clone)]
pub struct AxisPlan {
    /// The projector's axis.
    pub axis: Axis,
    /// Number of projector pixels along the axis.
    pub extent_px: f64,
    /// Fringe sets, finest period first.
    pub sets: Vec<FringeSet>,
    /// Gray code, if used.
    pub gray: Option<GrayCode>,
    /// How the fringe order is determined.
    pub order: Order,
    /// Threshold of each Gray bit.
    pub(super) thresholds: Vec<Threshold>,
}

/// How a sequence is decoded.
#[derive(Debug, Clone)]
pub struct Plan {
    /// The axes that the sequence encodes, x before y.
    pub axes: Vec<AxisPlan>,
    /// Index of the white frame.
    pub white: Option<usize>,
    /// Index of the black frame.
    pub black: Option<usize>,
    /// Number of frames in the sequence.
    pub frames: usize,
    /// Notes for the user about the sequence, such as frames that are not needed.
    pub notes: Vec<String>,
    used: Vec<bool>,
}

impl Plan {
    /// Plans the decoding of a manifest's sequence.
    ///
    /// # Errors
    /// Returns an error that names what is missing if the sequence determines no coordinate.
    pub fn new(manifest: &Manifest) -> Result<Self> {
        let patterns = || manifest.frame.iter().map(|f| &f.pattern).enumerate();
        let white = patterns().find_map(|(i, p)| matches!(p, Pattern::White {}).then_some(i));
        let black = patterns().find_map(|(i, p)| matches!(p, Pattern::Black {}).then_some(i));
        let references = white.is_some() && black.is_some();
        let mut notes = Vec::new();
        let mut axes = Vec::new();
        for (axis, extent) in [
            (Axis::X, manifest.projector.width_px),
            (Axis::Y, manifest.projector.height_px),
        ] {
            let plan = plan_axis(axis, f64::from(extent), manifest, references, &mut notes)?;
            axes.extend(plan);
        }
        if axes.is_empty() {
            return Err(Error::input(
                "sequence",
                "neither fringes nor Gray code",
                "fringes of 3 or more steps, or a Gray code, along x or y",
            ));
        }
        let mut used = vec![false; manifest.frame.len()];
        for axis in &axes {
            for &i in axis.sets.iter().flat_map(|s| &s.frames) {
                used[i] = true;
            }
            for bit in axis.gray.iter().flat_map(|g| &g.bits) {
                for i in [bit.plain, bit.inverse].into_iter().flatten() {
                    used[i] = true;
                }
            }
        }
        for i in [white, black].into_iter().flatten() {
            used[i] = true;
        }
        Ok(Self {
            axes,
            white,
            black,
            frames: manifest.frame.len(),
            notes,
            used,
        })
    }

    /// Returns whether frame `i` of the sequence is needed.
    pub fn uses(&self, i: usize) -> bool {
        self.used.get(i).copied().unwrap_or(false)
    }

    /// Returns the plan of an axis, if encoded.
    pub fn axis(&self, axis: Axis) -> Option<&AxisPlan> {
        self.axes.iter().find(|a| a.axis == axis)
    }

    /// Indices of the white and black frames, if both exist.
    pub(super) fn references(&self) -> Option<(usize, usize)> {
        self.white.zip(self.black)
    }
}
