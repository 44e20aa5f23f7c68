//! Collects the fringes and Gray bits of one axis from a sequence in any order.

use super::AxisPlan;
use super::order::resolve;
use crate::gray::{self, GrayFrame};
use crate::steps::FringeSet;
use phasmid_core::error::{Error, Result};
use phasmid_pattern::{Axis, Manifest, Pattern};

/// Maximum number of periods along one axis, to limit the search among candidates.
const MAX_SETS: usize = 16;

/// Plans one axis; `None` if the sequence does not encode it.
pub(super) fn plan_axis(
    axis: Axis,
    extent_px: f64,
    manifest: &Manifest,
    references: bool,
    notes: &mut Vec<String>,
) -> Result<Option<AxisPlan>> {
    let sets = fringe_sets(axis, manifest)?;
    let gray_frames: Vec<GrayFrame> = manifest
        .frame
        .iter()
        .enumerate()
        .filter_map(|(frame, f)| match f.pattern {
            Pattern::Gray {
                axis: a,
                cell_px,
                bit,
                inverted,
                ..
            } if a == axis => Some(GrayFrame {
                frame,
                cell_px,
                bit,
                inverted,
            }),
            _ => None,
        })
        .collect();
    if sets.is_empty() && gray_frames.is_empty() {
        return Ok(None);
    }
    let found = gray::find(axis, extent_px, &gray_frames);
    let (gray, order) = resolve(axis, extent_px, &sets, &found)?;
    if let (Some(missing), true) = (&found.missing, gray.is_some() || !sets.is_empty()) {
        notes.push(format!("{missing} is missing; decoded without it"));
    }
    let thresholds = gray.iter().flat_map(|g| &g.bits);
    let thresholds = thresholds
        .map(|&bit| gray::threshold(axis, bit, references, !sets.is_empty()))
        .collect::<Result<Vec<_>>>()?;
    Ok(Some(AxisPlan {
        axis,
        extent_px,
        sets,
        gray,
        order,
        thresholds,
    }))
}

/// The fringe sets of an axis, finest period first.
fn fringe_sets(axis: Axis, manifest: &Manifest) -> Result<Vec<FringeSet>> {
    let mut groups: Vec<(f64, Vec<usize>, Vec<f64>)> = Vec::new();
    for (i, frame) in manifest.frame.iter().enumerate() {
        let Pattern::Fringe {
            axis: a,
            period_px,
            phase_rad,
        } = frame.pattern
        else {
            continue;
        };
        if a != axis {
            continue;
        }
        let near = groups
            .iter()
            .position(|g| (g.0 / period_px - 1.0).abs() < 1e-6);
        let at = near.unwrap_or_else(|| {
            groups.push((period_px, Vec::new(), Vec::new()));
            groups.len() - 1
        });
        groups[at].1.push(i);
        groups[at].2.push(phase_rad);
    }
    if groups.len() > MAX_SETS {
        return Err(Error::input(
            format!("sequence, axis {axis}"),
            format!("fringes of {} periods", groups.len()),
            format!("up to {MAX_SETS} periods per axis"),
        ));
    }
    groups.sort_by(|a, b| a.0.total_cmp(&b.0));
    groups
        .into_iter()
        .map(|(period, frames, phases)| {
            let place = format!("sequence, axis {axis}, fringes of period {period} px");
            FringeSet::new(&place, period, frames, phases)
        })
        .collect()
}
