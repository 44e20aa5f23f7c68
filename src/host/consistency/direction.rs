//! Along which axis of the image patterns vary.
//!
//! The manifest says along which axis of the projector they do; how the camera is rolled against the
//! projector, the frames have to say.

use super::grid::value;
use phasmid_decode::AxisPlan;
use phasmid_pattern::Axis;
use phasmid_pattern::Image;

/// Pixels that are looked at in each frame, about.
const PIXELS: usize = 2_000;
/// Part of the changes along rows from which on those down the image are many.
const MANY: f64 = 0.5;

/// The axis of the image along which an axis' patterns vary; the columns' where they vary along both.
/// Frames are of one size.
pub(super) fn along(axis: &AxisPlan, frames: &[Image]) -> Axis {
    let own = shown(axis)
        .into_iter()
        .filter_map(|frame| frames.get(frame));
    let [along, across] = own.fold([0.0; 2], |sums, frame| {
        let more = changes(frame);
        [sums[0] + more[0], sums[1] + more[1]]
    });
    match across > MANY * along {
        true => Axis::Y,
        false => Axis::X,
    }
}

/// Marks the frames of an axis whose patterns vary down the image: their own edges lie along rows, as
/// those of a frame that is torn or lacks rows do.
pub(super) fn mark(axis: &AxisPlan, along: Axis, down: &mut [bool]) {
    if along == Axis::Y {
        for frame in shown(axis) {
            if let Some(down) = down.get_mut(frame) {
                *down = true;
            }
        }
    }
}

/// The frames of an axis.
fn shown(axis: &AxisPlan) -> Vec<usize> {
    let sets = axis.sets.iter().flat_map(|set| set.frames.iter().copied());
    let bits = axis.gray.iter().flat_map(|code| &code.bits);
    let bits = bits.flat_map(|bit| [bit.plain, bit.inverse]).flatten();
    sets.chain(bits).collect()
}

/// How much a frame changes along its rows, and across them, in sums of squares: edges more than noise.
fn changes(frame: &Image) -> [f64; 2] {
    let (width, height) = (frame.width(), frame.height());
    if width < 2 || height < 2 {
        return [0.0; 2];
    }
    let last = (height - 1) * width;
    let stride = last.div_ceil(PIXELS) | 1;
    (0..last)
        .step_by(stride)
        .filter(|at| at % width + 1 < width)
        .fold([0.0; 2], |[along, across], at| {
            let here = value(frame, at);
            let squared = |other: f32| f64::from(other - here).powi(2);
            [
                along + squared(value(frame, at + 1)),
                across + squared(value(frame, at + width)),
            ]
        })
}
