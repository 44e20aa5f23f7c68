//! What a sequence can be decoded to, axis by axis, or what it lacks.

mod axis;
mod order;
#[cfg(test)]
mod tests;

use super::gray::{GrayCode, Threshold};
use super::steps::FringeSet;
use axis::plan_axis;
use phasmid_core::error::{Error, Result};
use phasmid_pattern::{Axis, Manifest, Pattern};

/// How the number of whole periods is found.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Order {
    /// It is not: coordinates are modulo this period, in projector pixels.
    Wrapped {
        /// The period.
        period_px: f64,
    },
    /// The fringes together repeat after `repeat_px` (beyond the axis: never), and Gray code, where
    /// needed, tells the repeats apart.
    Resolved {
        /// Length after which all fringe sets look the same again; infinite where that is beyond
        /// the axis.
        repeat_px: f64,
    },
    /// Gray code alone: the middle of a cell.
    Cells,
}

/// How one axis is decoded.
#[derive(Debug, Clone)]
pub struct AxisPlan {
    /// The projector's axis.
    pub axis: Axis,
    /// The projector's pixels along it.
    pub extent_px: f64,
    /// Fringe sets, finest period first.
    pub sets: Vec<FringeSet>,
    /// Gray code, where it is used.
    pub gray: Option<GrayCode>,
    /// How whole periods are counted.
    pub order: Order,
    /// Threshold of each Gray bit.
    pub(super) thresholds: Vec<Threshold>,
}

/// How a sequence is decoded.
#[derive(Debug, Clone)]
pub struct Plan {
    /// The axes that the sequence encodes: x before y.
    pub axes: Vec<AxisPlan>,
    /// Frame of full white.
    pub white: Option<usize>,
    /// Frame of full black.
    pub black: Option<usize>,
    /// Frames in the sequence.
    pub frames: usize,
    /// What the user should know about the sequence, such as frames that are not needed.
    pub notes: Vec<String>,
    used: Vec<bool>,
}

impl Plan {
    /// Reads a manifest.
    ///
    /// # Errors
    /// A sequence that determines no coordinate, naming what it lacks.
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

    /// Whether frame `i` of the sequence is needed.
    pub fn uses(&self, i: usize) -> bool {
        self.used.get(i).copied().unwrap_or(false)
    }

    /// The plan of one axis.
    pub fn axis(&self, axis: Axis) -> Option<&AxisPlan> {
        self.axes.iter().find(|a| a.axis == axis)
    }

    /// White and black, where both are there.
    pub(super) fn references(&self) -> Option<(usize, usize)> {
        self.white.zip(self.black)
    }
}
