//! Whether frames follow their sequence, told from the frames alone.
//!
//! Frames from a link without identity only count: as many came as were due, but a lost one that
//! another replaced, two that changed places or one that came twice would leave no trace in the
//! count. A sequence is redundant, and each part of it that is gives a check that noise, texture,
//! response curves and steps in depth do not trip:
//!
//! - `tails`: no frame ends in rows of zeros below rows that were written;
//! - `levels`: white is the brightest frame of each pixel and black the darkest, and a Gray bit
//!   is not its complement;
//! - `dimmed`: a lit stripe of a Gray frame is as bright as white, and fringes are about half as bright;
//! - `fringes`: more steps than unknowns leave a residual, which another order or the lack of
//!   one frame would make distinctly smaller;
//! - `gains`: a step of fringes that had less light than the others leaves a residual that its gain
//!   takes away; sets of three steps have none of their own, but one mean between them;
//! - `gray`: along a line of the image the code counts; another order of its bits would make it
//!   jump less;
//! - `sense`: the phase of short fringe sets grows where the code counts up;
//! - `shifts`: all frames of an axis are what the patterns have at one coordinate, offset and
//!   scaled; the list with one frame lost, repeated or exchanged with its neighbour would leave
//!   less than half, or explain as much with fewer jumps between neighbouring pixels. Of sequences of
//!   fringes alone each set has the contrast that is left of it (`contrasts`). This ties
//!   sets of three steps, references and Gray code together;
//! - `each`: without a frame that was dark, lit too short, torn or of another pattern the others fit
//!   far better, in some part of the image;
//! - `residuals`: hardly a pixel's steps contradict each other by more than its noise. Rows that are
//!   missing and bits that are flipped leave pixels that do;
//! - `impulses`: hardly a pixel is like none beside it;
//! - `means`: sets of three steps have the mean of the other sets, but in a few pixels;
//! - `evenness`: the phase of fringes runs evenly along a line;
//! - `harmonics`: the modulation of fringes does not follow their phase;
//! - `lit`: hardly a pixel of a Gray frame is brighter than white;
//! - `slips`: the means of three sets in turn are not whole rows apart;
//! - `torn`: no frame changes along a whole row from one to the next while the others do not;
//! - `rows`: no frame is whole rows above the others where surfaces end.
//!
//! `fringes` to `each` compare the order that was asked for with others on the same pixels, so what
//! disturbs a scene disturbs both sides. Pixels at the camera's full scale are left out, and frames
//! in which hardly any others vary are called saturated.
//!
//! What no frame tells is not found: two frames that show the same picture in the part of the
//! projector that the camera sees; one set of three steps alone; a Gray code whose first bit is
//! exchanged with its complement, which mirrors the picture, where the mirrored coordinates are on
//! the projector; a
//! bit whose edges the camera does not see; the last frame, shown twice; less light in all frames alike,
//! which makes noise, of which the deviations tell; from a link that leaves no
//! empty rows at the bottom, rows that all frames lack alike, rows that a frame lacks whose patterns
//! vary down the image, and rows that several lack where a surface has neither edges nor shades. Limits of the checks
//! themselves: patterns of a period below 10 projector pixels are left out of `shifts`; a frame exchanged with one that is not its neighbour is looked for only within a
//! set and a code; of two faults in one run each is looked for alone, and several that together make another
//! order of a set or a code are left to [`Decoded::doubt`](phasmid_decode::Decoded::doubt), which sees that
//! orders are uncertain; a set of many steps that begins elsewhere by less than a tenth of its period is not
//! told; objects on less than 0.1 % of the
//! image are not checked; and in light so dim that noise is much of the fringes (about a tenth of a
//! built-in profile's) exchanged steps of a set of three may pass, for the noise then leaves
//! more than half of what the fault does. Single pixels are told in sets of four or more steps, from 4
//! deviations of noise and in 0.05 % of the pixels on, and in several sets of three from 2 % on (fewer are
//! the decoder's to refuse); with four steps of 16 projector pixels, 60 DN of
//! modulation and 1.5 DN of noise that is an error of 0.1 rad in each. Harmonics are believed up to
//! 0.08 rad.

mod changes;
mod contrasts;
mod dimmed;
mod direction;
mod each;
mod evenness;
mod explained;
mod frame_doubt;
mod fringes;
mod gains;
mod gray;
mod grid;
mod harmonics;
mod impulses;
mod levels;
mod lit;
mod means;
mod modulation;
mod moments;
mod noise;
mod residuals;
mod rows;
mod scatter;
mod sense;
mod shifts;
mod slips;
mod tails;
mod torn;

pub use frame_doubt::FrameDoubt;
pub use modulation::check_modulation;
use modulation::following;

use grid::Grid;
use phasmid_decode::{AxisPlan, Plan};
use phasmid_pattern::{Axis, Image, Manifest};
use scatter::Scatter;

/// Share of pixels that has to vary in runs for the frames to tell anything.
const LEAST_VARYING: f64 = 1e-3;
/// Share below which what varies may be something else in front of the camera.
const FEW_VARYING: f64 = 2e-2;

/// Checks frames, as many as the sequence has and all of one size and format. Frames
/// that hardly vary pass: that they show no modulation is another matter ([`check_modulation`]). A sequence
/// passes unchecked if some of its frames were not loaded because no decoder needs them.
///
/// # Errors
/// Returns how the frames depart from the sequence, and the position where they show it.
pub fn check(manifest: &Manifest, frames: &[Image]) -> Result<(), FrameDoubt> {
    examine(manifest, frames, false)
}

/// [`check`] for frames that say which they are: those of a saturated camera tell nothing, but they
/// are the ones that were asked for.
///
/// # Errors
/// As for [`check`].
pub fn check_identified(manifest: &Manifest, frames: &[Image]) -> Result<(), FrameDoubt> {
    examine(manifest, frames, true)
}

/// What a user should know of frames that follow their sequence: fringes that are not sinusoidal, so that
/// points are off by what depends on their place in a fringe. Frames as for [`check`].
pub fn doubt(manifest: &Manifest, frames: &[Image]) -> Option<FrameDoubt> {
    let plan = Plan::new(manifest).ok()?;
    let lacking = frames.len() != plan.frames || frames.iter().any(Image::is_empty);
    if lacking || Image::common_size(frames).is_err() {
        return None;
    }
    plan.axes.iter().find_map(|axis| {
        let grid = Grid::new(frames, direction::along(axis, frames));
        axis.sets.iter().find_map(|set| evenness::doubt(set, &grid))
    })
}

fn examine(manifest: &Manifest, frames: &[Image], identified: bool) -> Result<(), FrameDoubt> {
    // What cannot be decoded holds nothing that could be checked.
    let Ok(plan) = Plan::new(manifest) else {
        return Ok(());
    };
    if frames.len() != plan.frames || frames.iter().any(Image::is_empty) {
        return Ok(());
    }
    Image::common_size(frames).map_err(|e| FrameDoubt::Sizes(e.to_string()))?;
    // Of one short set without references nothing of a single pixel contradicts anything.
    let references = plan.white.zip(plan.black);
    let long = |axis: &AxisPlan| axis.sets.iter().any(|set| set.frames.len() > 3);
    let scatter = if references.is_some() || plan.axes.iter().any(long) {
        Some(Scatter::new(frames, scatter::MANY))
    } else if plan.axes.iter().any(|axis| axis.sets.len() > 1) {
        Some(Scatter::new(frames, scatter::FEW))
    } else {
        None
    };
    let along: Vec<Axis> = plan
        .axes
        .iter()
        .map(|axis| direction::along(axis, frames))
        .collect();
    let mut down = vec![false; frames.len()];
    for (axis, along) in plan.axes.iter().zip(&along) {
        direction::mark(axis, *along, &mut down);
    }
    tails::check(frames, &down).map_err(FrameDoubt::Departs)?;
    let mut noise_dn = 0.0;
    for (axis, along) in plan.axes.iter().zip(along) {
        let grid = Grid::new(frames, along);
        noise_dn = grid.noise_dn;
        let varying = grid.varying();
        if !identified && varying < FEW_VARYING && grid.saturated > varying.max(FEW_VARYING) {
            let share = grid.saturated;
            return Err(FrameDoubt::Saturated { share });
        }
        let shown = || following(manifest, frames).is_none_or(|found| found.is_shown());
        if varying < LEAST_VARYING || (varying < FEW_VARYING && !shown()) {
            return Ok(());
        }
        let found = levels::check(&plan, axis, &grid)
            .and_then(|()| fringes::check(axis, &grid))
            .and_then(|()| gains::check(&plan, &grid))
            .and_then(|()| dimmed::check(&plan, axis, &grid))
            .and_then(|()| gray::check(axis, &grid))
            .and_then(|()| sense::check(axis, &grid))
            .and_then(|()| shifts::check(manifest, axis, &grid))
            .and_then(|()| each::check(manifest, axis, along, &grid))
            .and_then(|()| {
                axis.sets
                    .iter()
                    .try_for_each(|set| evenness::check(set, &grid))
            })
            .and_then(|()| match &scatter {
                Some(scatter) => everywhere(&plan, axis, noise_dn, scatter),
                None => Ok(()),
            });
        found.map_err(FrameDoubt::Departs)?;
    }
    impulses::check(frames, &down, noise_dn)
        .and_then(|()| torn::check(frames, &down, noise_dn))
        .and_then(|()| rows::check(frames, &down, noise_dn))
        .map_err(FrameDoubt::Departs)?;
    let mut axes = plan.axes.iter();
    axes.try_for_each(|axis| slips::check(axis, frames, noise_dn))
        .map_err(FrameDoubt::Departs)
}

/// The checks of single pixels, each held against all the others.
fn everywhere(
    plan: &Plan,
    axis: &AxisPlan,
    noise_dn: f32,
    scatter: &Scatter,
) -> Result<(), String> {
    let references = plan.white.zip(plan.black);
    for set in &axis.sets {
        residuals::check(set, plan.black, scatter)?;
        harmonics::check(set, references, noise_dn, scatter)?;
    }
    means::check(axis, noise_dn, scatter)?;
    lit::check(axis, references, scatter)
}

/// The axis along which most of the sequence varies.
fn main_axis(plan: &Plan) -> Axis {
    plan.axes.first().map_or(Axis::X, |axis| axis.axis)
}
