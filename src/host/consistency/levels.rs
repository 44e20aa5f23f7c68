//! Frames whose brightness is known beforehand.

use super::grid::{Grid, range, share};
use phasmid_decode::{AxisPlan, Plan};

/// Part of a pixel's range by which a reference may miss its end.
const MARGIN: f32 = 0.3;
/// Share of the pixels that may say otherwise.
const DISSENT: f64 = 0.3;

/// White is the brightest, black the darkest, and a bit differs from its complement.
pub(super) fn check(plan: &Plan, axis: &AxisPlan, grid: &Grid) -> Result<(), String> {
    let dissent = |wrong: &dyn Fn(&[f32], f32, f32) -> bool| {
        let pixels = grid.lines.iter().flat_map(|line| line.varying());
        share(pixels.map(|values| {
            let (low, high) = range(values);
            wrong(values, low, high)
        }))
    };
    let replaced = "a frame up to there was lost, repeated or exchanged";
    if let Some(white) = plan.white
        && dissent(&|v, low, high| v[white] < high - MARGIN * (high - low)) > DISSENT
    {
        return Err(format!(
            "frame {white} ought to be white and is not the brightest: {replaced}"
        ));
    }
    if let Some(black) = plan.black
        && dissent(&|v, low, high| v[black] > low + MARGIN * (high - low)) > DISSENT
    {
        return Err(format!(
            "frame {black} ought to be black and is not the darkest: {replaced}"
        ));
    }
    let bits = axis.gray.iter().flat_map(|code| &code.bits);
    for (plain, inverse) in bits.filter_map(|bit| bit.plain.zip(bit.inverse)) {
        let same = |v: &[f32], low: f32, high: f32| {
            let (margin, sum) = (MARGIN * (high - low), v[plain] + v[inverse]);
            // Complements that blur leaves no contrast are both half as bright.
            (v[plain] - v[inverse]).abs() < margin && (sum - low - high).abs() > margin
        };
        if dissent(&same) > DISSENT {
            return Err(format!(
                "frames {plain} and {inverse} ought to be complements and are not: {replaced}"
            ));
        }
    }
    Ok(())
}
