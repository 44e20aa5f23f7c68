//! The data of the row kernels: the constants of each axis, which a decoder computes once; the job of
//! one decoding; the buffers of a worker; and the output.

use super::fringes::SetRow;
use crate::gray::{GrayBit, GrayRow, Threshold};
use crate::maps::Verdict;
use crate::options::Options;
use crate::order::{Ensemble, GrayJoin};
use crate::phase::{RowNoise, SetKernel};
use crate::plan::{AxisPlan, Order};
use crate::robust_scale::RobustScale;
use phasmid_pattern::Axis;

/// Rows per parallel task: few enough for load balance, enough to amortise the overhead.
pub(crate) const BAND: usize = 8;
/// Repeat that is used for fringes that do not repeat within the axis, in projector pixels.
const NO_REPEAT: f32 = 1e6;

/// One axis of a plan, in f32.
#[derive(Debug)]
pub(crate) struct AxisKernel {
    pub(crate) axis: Axis,
    pub(super) extent: f32,
    pub(crate) sets: Vec<SetKernel>,
    pub(super) ensemble: Option<Ensemble>,
    pub(crate) bits: Vec<(GrayBit, Threshold)>,
    pub(crate) join: Option<GrayJoin>,
    pub(super) wrapped: bool,
}

impl AxisKernel {
    pub(crate) fn new(plan: &AxisPlan, references: bool, options: &Options) -> Self {
        let kernel = |set| SetKernel::new(set, options);
        let mut sets: Vec<SetKernel> = plan.sets.iter().map(kernel).collect();
        if options.consistency {
            SetKernel::tie(&mut sets);
        }
        let wrapped = matches!(plan.order, Order::Wrapped { .. });
        let repeat = match plan.order {
            Order::Resolved { repeat_px } if repeat_px.is_finite() => repeat_px as f32,
            _ => NO_REPEAT,
        };
        let bits: Vec<_> = plan
            .gray
            .iter()
            .flat_map(|g| g.bits.iter().copied())
            .zip(plan.thresholds.iter().copied())
            .collect();
        let steps = plan.sets.first().map_or(0, |s| s.frames.len());
        let noise_factor = bits
            .iter()
            .map(|(_, t)| t.variance_factor(steps))
            .fold(0.0, f64::max)
            .sqrt() as f32;
        let join = plan.gray.as_ref().map(|g| GrayJoin {
            cell: g.cell_px as f32,
            repeat,
            noise_factor,
        });
        // A single period with Gray code needs no search among candidates.
        let alone = sets.len() == 1 && join.is_some() && repeat < NO_REPEAT;
        let search = !sets.is_empty() && !wrapped && !alone;
        let ensemble = search.then(|| Ensemble::new(sets.iter().map(|set| set.period).collect()));
        debug_assert!(references || bits.iter().all(|(_, t)| *t != Threshold::Reference));
        Self {
            axis: plan.axis,
            extent: plan.extent_px as f32,
            sets,
            ensemble,
            bits,
            join,
            wrapped,
        }
    }
}

/// Data shared by all rows of a decoding.
pub(crate) struct Job<'a, T> {
    pub(crate) frames: &'a [&'a [T]],
    pub(crate) kernels: &'a [AxisKernel],
    /// Typical residuals of each kernel's sets in this capture.
    pub(crate) robust_scale: &'a [Vec<RobustScale>],
    pub(crate) references: Option<(usize, usize)>,
    /// Number of each axis' finest Gray bits that are not used.
    pub(crate) unused_bits: [usize; 2],
    pub(crate) noise: RowNoise,
    pub(crate) saturation: f32,
    /// Range from black level to saturation, in DN.
    pub(crate) range: f32,
    pub(crate) min_modulation: f32,
    /// Minimum modulation as a fraction of half of white minus black.
    pub(crate) min_contrast: f32,
    pub(crate) max_phase_sigma: f32,
    pub(crate) width: usize,
}

/// Buffers of a worker thread, each one row long.
#[derive(Debug, Default)]
pub(crate) struct Scratch {
    pub(super) sets: Vec<SetRow>,
    pub(super) gray: GrayRow,
    pub(super) top: Vec<f32>,
    /// Sum of the sets' means.
    pub(super) sum: Vec<f32>,
    /// Mean of white and black.
    pub(super) middle: Vec<f32>,
    /// Half of white minus black; if the sequence lacks these frames, the modulation.
    pub(super) half: Vec<f32>,
    /// Standard deviation of a sample at the pixel's mean.
    pub(super) sigma: Vec<f32>,
    pub(super) variance: Vec<f32>,
    pub(super) ok: Vec<bool>,
    pub(super) candidate: (Vec<f32>, Vec<f32>),
}

/// A row of an axis' maps.
pub(crate) struct AxisOut<'a> {
    pub(crate) coordinate: &'a mut [f32],
    pub(crate) sigma: &'a mut [f32],
    pub(crate) verdict: &'a mut [Verdict],
}

pub(super) fn clear(buffer: &mut Vec<f32>, n: usize) {
    buffer.clear();
    buffer.resize(n, 0.0);
}
