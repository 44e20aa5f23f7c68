//! Gray frames against white and black.
//!
//! A pixel of a Gray frame is as bright as white, or as dark as black, or on an edge between. None is
//! brighter than white or darker than black, whatever the surface; where a frame lacks rows those of
//! a brighter surface stand in for those of a darker one, and flipped bits, of black too, go anywhere.

use super::noise::Noise;
use super::scatter::Scatter;
use phasmid_decode::AxisPlan;

/// Pixels that are looked at, about.
const PIXELS: usize = 16_000;
/// Deviations beyond which a pixel is brighter than white or darker than black.
const SIGMAS: f64 = 5.0;
/// Part of the lit, or of the dark, pixels that may be,
const SHARE: f64 = 1e-3;
/// and how many at least.
const LEAST: usize = 8;
/// Fewest pixels that tell their noise.
const FEWEST: usize = 400;
/// Contrast of white and black in DN from which on a pixel is looked at.
const LEAST_DN: f64 = 20.0;
/// Part of it from which on a pixel is lit; it is dark below the rest.
const LIT: f64 = 0.75;

/// Whether too many pixels of a Gray frame are brighter than white or darker than black.
pub(super) fn check(
    axis: &AxisPlan,
    references: Option<(usize, usize)>,
    scatter: &Scatter,
) -> Result<(), String> {
    let Some((white, black)) = references else {
        return Ok(());
    };
    let stride = scatter.len().div_ceil(PIXELS).max(1);
    let bits = axis.gray.iter().flat_map(|code| &code.bits);
    for frame in bits.flat_map(|bit| [bit.plain, bit.inverse]).flatten() {
        let (mut lit, mut dark) = (Vec::new(), Vec::new());
        for pixel in scatter.pixels().step_by(stride) {
            let [seen, white, black] = [frame, white, black].map(|f| f64::from(pixel[f]));
            let contrast = white - black;
            if contrast < LEAST_DN {
                continue;
            }
            let part = (seen - black) / contrast;
            if part > LIT {
                lit.push((white, seen - white));
            } else if part < 1.0 - LIT {
                dark.push((black, black - seen));
            }
        }
        let damaged = "rows or bits of one are damaged, or something moved";
        if let Some(share) = beyond(lit) {
            return Err(format!(
                "frame {frame} is brighter than the white frame {white} in {:.2} % of the pixels \
                 that are lit: {damaged}",
                100.0 * share
            ));
        }
        if let Some(share) = beyond(dark) {
            return Err(format!(
                "frame {frame} is darker than the black frame {black} in {:.2} % of the pixels \
                 that are not lit: {damaged}",
                100.0 * share
            ));
        }
    }
    Ok(())
}

/// The part of pixels, of a reference and by how much they are beyond it, that is too much to be
/// noise; `None` where it is no more than may be.
fn beyond(mut pixels: Vec<(f64, f64)>) -> Option<f64> {
    if pixels.len() < FEWEST {
        return None;
    }
    // The lamp may have been brighter in this frame, or ambient light darker.
    let mut gains: Vec<f64> = pixels
        .iter()
        .map(|(light, more)| more / light.max(1.0))
        .collect();
    let middle = gains.len() / 2;
    let gain = gains
        .select_nth_unstable_by(middle, f64::total_cmp)
        .1
        .max(0.0);
    for (light, more) in &mut pixels {
        *more -= gain * *light;
    }
    pixels.sort_by(|a, b| a.0.total_cmp(&b.0));
    let deviations = Noise::of(&pixels).each();
    let far = |((_, more), deviation): &(&(f64, f64), f64)| *more > SIGMAS * deviation;
    let found = pixels.iter().zip(deviations).filter(far).count();
    let share = found as f64 / pixels.len() as f64;
    (found >= LEAST && share > SHARE).then_some(share)
}
