//! Checks whether the frames of a capture belong to its sequence, by one model of a capture.
//!
//! **Model.** A pixel sees one place of the projector. It has one mean and, in each fringe set, one
//! contrast (blur reduces that of fine fringes more), and all patterns of an axis agree on one
//! coordinate. Effects of real cameras and projectors are estimated from the capture, not flagged: the
//! light and the fringe amplitude of a step (a flickering lamp), and the second and third harmonics (a
//! response curve), each the same fraction everywhere (`robust_scale`). Pixels on the edges of stripes
//! and surfaces may see two places and are left out, as are pixels whose noise makes the fringe order
//! uncertain.
//!
//! **Statistics**, of about 25,000 pixels from all rows, which the decoder itself decodes. Scale and
//! light use 4,000 of these pixels; jumps of the code and phase errors also use some whole rows:
//!
//! | statistic | sound captures | limit |
//! | --- | --- | --- |
//! | fraction of the pixels whose steps, sets or code contradict each other | at most 0.0017 | [`RATE`], plus an allowance for chance |
//! | scale of the residuals, in standard deviations of noise and model error | at most 1.1 | [`SCALE`] |
//! | difference in light of a set's steps, in units of its residual | at most 0.05 | [`LIGHT`], plus an allowance for chance |
//! | mean of fringes, between black and white | at least 0.36 | [`DARK`] |
//! | error of the phase that follows the phase | at most 0.06 rad | `harmonics::LARGEST_RAD` |
//!
//! The second column was measured on captures of 400 random devices and of built-in ones; captures of a
//! physical scanner and of calibrations pass too. The page on the fault matrix in `docs` names the
//! commands. The allowance for chance is exceeded in one of ten thousand scans of a capture at the
//! limit.
//!
//! **Noise** that is estimated from the same frames hides damage: damage that affects most pixels alike
//! raises the estimate. The noise is therefore taken from the calibration if there is one. Without a
//! calibration it is the smaller of two estimates: from the residuals, and from neighbouring lit pixels
//! in the smoothest frames.
//!
//! **Detectable damage.** N steps of a set leave N - 3 residuals. With four or more steps, each pixel
//! shows that one step is wrong. A set of three steps can only be compared with the mean of the other
//! sets of its axis; a single set of three steps shows nothing. A Gray code with cells of half a period
//! checks every bit against the phase: each wrong bit reverses the order of all finer bits. If an
//! exchange of two frames explains the capture, the message names them; if not, it names the rows if the
//! damage is confined to some.
//!
//! **Undetectable damage**: two frames that are equal where the camera sees them; a rotation or
//! reversal of the steps of a single set, or of a set whose code has no half cells, except for jumps
//! between periods; a Gray code whose first bit is exchanged with its complement, where the mirrored
//! coordinates are on the projector; the last frame shown twice; less light in all frames alike; rows
//! that are missing from every second of four steps, where the surface has neither edges nor texture;
//! damage of less than [`RATE`] of the pixels, which the decoder rejects one by one; and wrong bits in
//! light so dim that noise makes orders uncertain.

mod frame_doubt;
mod frame_noise;
mod harmonics;
mod jumps;
mod pixels;
mod sample;
#[cfg(test)]
mod tests;

pub use frame_doubt::FrameDoubt;
use phasmid_core::statistics::median;

use crate::maps::{Decoded, Verdict};
use crate::plan::{AxisPlan, Order};
use crate::robust_scale::Shared;
use phasmid_core::error::{Error, Result};
use phasmid_geometry::{NoiseModel, Rig};
use phasmid_pattern::{Axis, Image, Manifest};
use sample::{Count, FEWEST, Sample};

/// Maximum fraction of contradictory pixels. Sound captures have less than half of this.
const RATE: f64 = 2.5e-3;
/// Maximum fraction of contradictory pixels for a code whose edges coincide with the ends of fringe
/// periods, where pixels are uncertain.
const EDGES: f64 = 0.08;
/// Quantile of the normal distribution for a probability of one in ten thousand, with two axes and a
/// margin for correlated neighbours.
const QUANTILE: f64 = 4.0;
/// Maximum scale of the residuals, in standard deviations of noise and model error.
const SCALE: f32 = 3.0;
/// Maximum difference in light of a set's steps, in units of the residual. It rejects a set of four
/// steps if one has 0.92 of the light of the others, and a set of three steps if one has 0.9.
const LIGHT: f32 = 0.055;
/// The common part of the residuals explains them if removing it divides their scale by at least this
/// factor.
const EXPLAINED: f32 = 10.0;
/// Minimum mean of the fringes on a scale from 0 (black) to 1 (white): a projector of gamma 2.2 has
/// 0.36.
const DARK: f64 = 0.28;
/// Minimum contrast of white and black, in standard deviations of noise, of pixels that are used for
/// the fringes' mean.
const CONTRAST: f32 = 20.0;
/// Minimum fraction of lit pixels for a check.
const LEAST_LIT: f64 = 1e-3;
/// If less than this fraction of the pixels is lit, at least half of the lit pixels must have a
/// coordinate.
const FEW_LIT: f64 = 2e-2;
/// Minimum number of valid pixels of a small surface.
const LEAST_PIXELS: usize = 12;
/// Minimum fraction of saturated pixels for which saturation is reported as the cause of missing
/// modulation.
const MANY_SATURATED: f64 = 0.2;
/// Maximum distance, in frames of the sequence, between two frames that are tested for an exchange.
const NEAR: usize = 3;
/// Maximum cell width of a code, in periods, for which an edge lies within each period.
const HALF_CELL: f64 = 0.75;

/// Information about a capture besides its frames.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Known {
    /// The link identifies each frame, so saturated frames are known to be the requested ones.
    pub identified: bool,
    /// The camera's noise, from a calibration.
    pub noise: Option<NoiseModel>,
}

impl Known {
    /// Collects what is known: whether the link identifies frames, and the noise in the device's
    /// calibration.
    pub fn new(identified: bool, calibration: Option<&Rig>) -> Self {
        Self {
            identified,
            noise: calibration.and_then(|rig| rig.noise),
        }
    }
}

/// Checks that the frames follow the sequence: their number and patterns are those of the sequence, and
/// all have one size and format. Frames that hardly vary pass; [`check_modulation`] rejects them. A
/// sequence passes unchecked if some of its frames were not loaded because no decoder needs them.
///
/// # Errors
/// Returns a [`FrameDoubt`] that states how the frames differ from the sequence.
pub fn check_sequence(
    manifest: &Manifest,
    frames: &[Image],
    known: Known,
) -> Result<(), FrameDoubt> {
    if frames.len() != manifest.frame.len() || frames.iter().any(Image::is_empty) {
        return Ok(());
    }
    Image::common_size(frames).map_err(|e| FrameDoubt::Sizes(e.to_string()))?;
    // A sequence that cannot be decoded has no redundancy to check.
    let Some(sample) = Sample::new(manifest, frames, known.noise) else {
        return Ok(());
    };
    let Lit { share, valid } = Lit::of(&sample.decoded);
    let saturated = sample.saturated();
    if share < FEW_LIT && saturated > share.max(FEW_LIT) {
        return match known.identified {
            true => Ok(()),
            false => Err(FrameDoubt::Saturated { share: saturated }),
        };
    }
    if share < LEAST_LIT || (share < FEW_LIT && 2.0 * valid < share) {
        return Ok(());
    }
    let jumps = || {
        let axes = sample.plan.axes.iter();
        axes.map(|axis| jumps::has_jumps(&sample, axis)).collect()
    };
    let (bent, jumps): (_, Vec<bool>) = rayon::join(|| harmonics::of_capture(&sample), jumps);
    let worst = bent.iter().find(|bent| bent.is_refused());
    let is_bent = bent.iter().any(|bent| bent.is_believed());
    let axes = sample.plan.axes.iter().zip(&sample.shared).zip(jumps);
    for ((axis, shared), jumps) in axes {
        if let Err(doubt) = axis_follows(manifest, &sample, axis, shared, is_bent, jumps) {
            return Err(match worst {
                Some(worst) if matches!(doubt, FrameDoubt::Contradictory { .. }) => worst.doubt(),
                _ => doubt,
            });
        }
    }
    worst.map_or(Ok(()), |worst| Err(worst.doubt()))
}

/// Returns a warning for frames that follow their sequence but whose fringes are not sinusoidal, so
/// that the error of a point depends on its position in a fringe. Arguments as for [`check_sequence`].
pub fn doubt_of_fringes(manifest: &Manifest, frames: &[Image], known: Known) -> Option<FrameDoubt> {
    if frames.len() != manifest.frame.len() || frames.iter().any(Image::is_empty) {
        return None;
    }
    let sample = Sample::new(manifest, frames, known.noise)?;
    let bent = harmonics::of_capture(&sample);
    bent.first().map(|bent| bent.doubt())
}

/// Rejects images that show no surface: hardly any pixel follows the sequence.
///
/// # Errors
/// Returns an error if the camera does not see the projected patterns.
pub fn check_modulation(manifest: &Manifest, frames: &[Image]) -> Result<()> {
    if frames.len() != manifest.frame.len() || frames.iter().any(Image::is_empty) {
        return Ok(());
    }
    let Some(sample) = Sample::new(manifest, frames, None) else {
        return Ok(());
    };
    let Lit { share, valid } = Lit::of(&sample.decoded);
    let pixels = sample.decoded.modulation.len() as f64;
    let small = valid * pixels >= LEAST_PIXELS as f64 && 2.0 * valid >= share;
    if valid >= LEAST_LIT || small {
        return Ok(());
    }
    let saturated = sample.saturated();
    let cause = match saturated >= MANY_SATURATED {
        true => format!(
            "{:.0} % are saturated: shorten the exposure, lower the gain, or keep other light out",
            100.0 * saturated
        ),
        false => {
            "the camera does not see the projector, or its frames are not those of the sequence"
                .to_owned()
        }
    };
    Err(Error::device(format!(
        "the frames show no modulation: {:.2} % of the pixels follow the sequence, expected {} % or \
         more; {cause}",
        100.0 * valid,
        100.0 * LEAST_LIT,
    )))
}

/// How much of the image is lit, as fractions of all pixels.
struct Lit {
    /// Fraction of the pixels that are modulated and not saturated.
    share: f64,
    /// Fraction of the pixels that have a coordinate.
    valid: f64,
}

impl Lit {
    fn of(decoded: &Decoded) -> Self {
        let pixels = decoded.modulation.len().max(1) as f64;
        let most = |wanted: fn(Verdict) -> bool| {
            let count = |verdicts: &[Verdict]| verdicts.iter().filter(|v| wanted(**v)).count();
            let counts = decoded.axes().map(|(_, map)| count(&map.verdict));
            counts.max().unwrap_or(0) as f64 / pixels
        };
        Self {
            share: most(|v| !matches!(v, Verdict::Dim | Verdict::Saturated)),
            valid: most(|v| v == Verdict::Valid),
        }
    }
}

/// Checks that the frames of one axis agree. If harmonics bend the fringes (`bent`), uncertain orders
/// are not counted, because the harmonics may cause them.
fn axis_follows(
    manifest: &Manifest,
    sample: &Sample,
    axis: &AxisPlan,
    shared: &[Option<Shared>],
    bent: bool,
    jumps: bool,
) -> Result<(), FrameDoubt> {
    let Some(map) = sample.decoded.axis(axis.axis) else {
        return Ok(());
    };
    // Without fringes, an uncertain order only means that the camera does not resolve the code's bits.
    let orders = !bent && axis.order != Order::Cells;
    let count = sample.count(axis, map, orders);
    let rate = if has_half_cells(axis) { RATE } else { EDGES };
    // Light may spill over from saturated pixels to their neighbours, so the axis is not checked.
    if map.count(Verdict::Saturated) > count.all {
        return Ok(());
    }
    if let Some(part) = dark_fringes(sample, axis) {
        return Err(part);
    }
    let exchanged = || exchanged(manifest, sample, axis.axis);
    let sets = axis.sets.iter().zip(shared);
    let known = || {
        sets.clone()
            .filter_map(|(set, shared)| Some((set, shared.as_ref()?)))
    };
    // If one step is dark as a whole, its light explains the residuals even if the remaining residuals
    // are large too.
    let explained = |shared: &Shared| shared.differs_by(LIGHT) && shared.explains(EXPLAINED);
    let is_odd = |shared: &Shared| shared.scale > SCALE && !explained(shared);
    if let Some((set, _)) = known().find(|(_, shared)| is_odd(shared)) {
        return Err(exchanged().unwrap_or_else(|| FrameDoubt::Contradictory {
            axis: axis.axis,
            share: count.share(),
            frames: Some(range(&set.frames)),
            rows: None,
        }));
    }
    // A bad step also changes the mean that other sets are compared with, but less: report the largest
    // difference.
    let uneven = known().filter(|(_, shared)| shared.differs_by(LIGHT));
    if let Some((set, shared)) =
        uneven.max_by(|(_, a), (_, b)| a.difference().total_cmp(&b.difference()))
    {
        return Err(exchanged().unwrap_or_else(|| {
            let (step, part) = shared.step(set);
            FrameDoubt::Light {
                frame: set.frames[step],
                part,
            }
        }));
    }
    match is_too_many(count, rate) || jumps {
        false => Ok(()),
        true => Err(exchanged().unwrap_or_else(|| FrameDoubt::Contradictory {
            axis: axis.axis,
            share: count.share(),
            frames: None,
            rows: sample.odd_rows(map),
        })),
    }
}

fn range(frames: &[usize]) -> std::ops::RangeInclusive<usize> {
    let first = frames.iter().copied().min().unwrap_or(0);
    first..=frames.iter().copied().max().unwrap_or(first)
}

/// Whether more pixels contradict themselves than the rate and chance explain.
fn is_too_many(count: Count, rate: f64) -> bool {
    let expected = rate * count.all as f64;
    // The last term corrects the normal approximation towards the Poisson distribution.
    let most = expected + QUANTILE * expected.sqrt() + QUANTILE * QUANTILE / 6.0;
    count.odd as f64 > most
}

/// Whether the fringe order of each pixel is determined twice: by several periods, or by a code with an
/// edge within each period. If not, pixels on the edges of the code are uncertain.
fn has_half_cells(axis: &AxisPlan) -> bool {
    match (&axis.gray, axis.order) {
        (Some(code), Order::Resolved { repeat_px }) => code.cell_px < HALF_CELL * repeat_px,
        (Some(_), _) => false,
        (None, _) => true,
    }
}

/// Detects fringes with distinctly less light than white.
fn dark_fringes(sample: &Sample, axis: &AxisPlan) -> Option<FrameDoubt> {
    let (white, black) = sample.plan.references()?;
    let map = sample.decoded.axis(axis.axis)?;
    let [white, black] = [white, black].map(|frame| sample.columns.frame(frame));
    axis.sets.iter().find_map(|set| {
        let means = &sample.columns.fringes(set)?.mean;
        let part = |i: usize| {
            let contrast = white[i] - black[i];
            let is_bright =
                !sample.columns.is_saturated(i) && contrast >= CONTRAST * sample.noise_dn[i];
            is_bright.then(|| (means[i] - black[i]) / contrast)
        };
        let mut parts: Vec<f32> = (0..map.verdict.len()).filter_map(part).collect();
        if parts.len() < FEWEST {
            return None;
        }
        let mean = f64::from(median(&mut parts)?);
        (mean < DARK).then(|| FrameDoubt::Dark {
            frames: range(&set.frames),
            part: 2.0 * mean,
        })
    })
}

/// Finds the two frames near each other whose exchange explains most of the contradictions.
fn exchanged(manifest: &Manifest, sample: &Sample, axis: Axis) -> Option<FrameDoubt> {
    let plan = &sample.plan;
    let used: Vec<usize> = (0..plan.frames).filter(|i| plan.uses(*i)).collect();
    let pairs = used.iter().enumerate().flat_map(|(n, one)| {
        let near = used[n + 1..].iter().take(NEAR);
        near.map(move |other| [*one, *other])
    });
    let frames = sample.exchanged(manifest, axis, pairs)?;
    Some(FrameDoubt::Exchanged { frames })
}
