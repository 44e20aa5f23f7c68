//! The constants of one axis, computed once per decoder.

use crate::Options;
use crate::gray::{GrayBit, Threshold};
use crate::order::{Ensemble, GrayJoin};
use crate::phase::SetKernel;
use crate::plan::{AxisPlan, Order};
use phasmid_pattern::Axis;

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
