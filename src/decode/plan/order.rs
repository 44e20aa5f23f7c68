//! Determines how the fringe order of an axis is found, or what is missing for it.

use super::Order;
use crate::gray::{self, GrayCode};
use crate::steps::FringeSet;
use phasmid_core::error::{Error, Result};
use phasmid_pattern::Axis;

/// Two positions are indistinguishable if their wrapped coordinates differ by less than this fraction
/// of every period.
const SAME_PHASE: f64 = 0.002;

/// The shortest shift below `extent_px` that leaves all fringe sets unchanged; infinite if there is
/// none.
fn repeat_px(sets: &[FringeSet], extent_px: f64) -> f64 {
    let Some(finest) = sets.first() else {
        return f64::INFINITY;
    };
    let mut k = 1.0;
    while k * finest.period_px < extent_px {
        let shift = k * finest.period_px;
        let unseen = sets.iter().all(|set| {
            let turns = shift / set.period_px;
            (turns - turns.round()).abs() < SAME_PHASE
        });
        if unseen {
            return shift;
        }
        k += 1.0;
    }
    f64::INFINITY
}

/// Chooses how the fringe order of an axis is found, and the Gray code needed for it.
pub(super) fn resolve(
    axis: Axis,
    extent_px: f64,
    sets: &[FringeSet],
    found: &gray::Found,
) -> Result<(Option<GrayCode>, Order)> {
    let place = format!("sequence, axis {axis}");
    let incomplete = |missing: &str| {
        Error::input(
            &place,
            format!("{missing} is missing"),
            format!("every bit from a cell up to the projector's {extent_px} px"),
        )
    };
    let missing = found.missing.as_deref();
    if sets.is_empty() {
        return match (&found.code, missing) {
            (Some(code), None) => Ok((Some(code.clone()), Order::Cells)),
            (_, missing) => Err(incomplete(missing.unwrap_or("a Gray bit"))),
        };
    }
    let repeat = repeat_px(sets, extent_px);
    let resolved = Order::Resolved { repeat_px: repeat };
    if let Some(code) = &found.code
        && code.cell_px <= repeat * (1.0 + 1e-6)
    {
        return Ok((Some(code.clone()), resolved));
    }
    if repeat.is_infinite() {
        return Ok((None, resolved));
    }
    if let Some(missing) = missing {
        return Err(incomplete(missing));
    }
    let periods: Vec<String> = sets.iter().map(|s| s.period_px.to_string()).collect();
    let periods = periods.join(" and ");
    if let Some(code) = &found.code {
        return Err(Error::input(
            place,
            format!(
                "Gray cells of {} px, wider than the {repeat:.6} px after which the fringes of \
                 period {periods} px repeat",
                code.cell_px
            ),
            format!("Gray cells of at most {repeat:.6} px, or one more period"),
        ));
    }
    if sets.len() > 1 {
        return Err(Error::input(
            place,
            format!(
                "fringes of period {periods} px repeat after {repeat:.6} px of {extent_px} px, and \
                 there is no Gray code"
            ),
            format!("a Gray code with cells of at most {repeat:.6} px, or one more period"),
        ));
    }
    let period_px = sets[0].period_px;
    Ok((None, Order::Wrapped { period_px }))
}
