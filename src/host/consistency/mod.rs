//! Whether frames follow their sequence, told from the frames alone.
//!
//! Frames from a link without identity only count: as many came as were due, but a lost one that
//! another replaced, two that changed places or one that came twice would leave no trace in the
//! count. A sequence is redundant, and each part of it that is gives a check that noise, texture,
//! response curves and steps in depth do not trip:
//!
//! - `levels`: white is the brightest frame of each pixel and black the darkest, and a Gray bit
//!   is not its complement;
//! - `fringes`: more steps than unknowns leave a residual, which another order or the lack of
//!   one frame would make distinctly smaller;
//! - `gray`: along a line of the image the code counts; another order of its bits would make it
//!   jump less.
//!
//! Both of the latter compare the order that was asked for with others on the same pixels, so what
//! disturbs a scene disturbs both sides. What no frame tells is not found: two frames that show the
//! same picture in the part of the projector that the camera sees; steps of a set that hold
//! no redundancy (three), or that are exchanged for steps of opposite phase in a set of four; a bit
//! whose edges the camera does not see; the last frame, shown twice.

mod fringes;
mod gray;
mod grid;
mod levels;
mod modulation;
mod shifts;

pub(super) use modulation::following;

use crate::decode::Plan;
use crate::pattern::{Axis, Manifest};
use crate::protocol::Frame;
use grid::Grid;

/// Share of pixels that has to vary in runs for the frames to tell anything.
const LEAST_VARYING: f64 = 1e-3;
/// Share below which what varies may be something else in front of the camera.
const FEW_VARYING: f64 = 2e-2;
/// Least share of the pixels that follow the sequence, for frames to show one.
pub(super) const LEAST_FOLLOWING: f64 = 1e-3;

/// Checks frames, as many as the sequence has and all of one size and format, GREY or Y16. Frames
/// that hardly vary pass: that they show no modulation is another matter ([`Captured::check_modulation`](crate::host::Captured::check_modulation)).
///
/// # Errors
/// How the frames depart from the sequence, with the position where they tell it.
pub fn check(manifest: &Manifest, frames: &[Frame]) -> Result<(), String> {
    // What cannot be decoded holds nothing that could be checked.
    let Ok(plan) = Plan::new(manifest) else {
        return Ok(());
    };
    if frames.len() != plan.frames {
        return Ok(());
    }
    for axis in &plan.axes {
        let grid = Grid::new(frames, axis.axis);
        let varying = grid.varying();
        let shown = || following(manifest, frames).is_none_or(|share| share >= LEAST_FOLLOWING);
        if varying < LEAST_VARYING || (varying < FEW_VARYING && !shown()) {
            return Ok(());
        }
        let found = levels::check(&plan, axis, &grid)
            .and_then(|()| fringes::check(axis, &grid))
            .and_then(|()| gray::check(axis, &grid))
            .and_then(|()| shifts::check(manifest, axis, &grid));
        found.map_err(|what| format!("the frames do not follow the sequence: {what}"))?;
    }
    Ok(())
}

/// The axis along which most of the sequence varies.
fn main_axis(plan: &Plan) -> Axis {
    plan.axes.first().map_or(Axis::X, |axis| axis.axis)
}
