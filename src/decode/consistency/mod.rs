//! Whether the frames of a capture are those of its sequence, judged by one model of a capture.
//!
//! **Model.** A pixel sees one place of the projector. It has one mean and, in each fringe set, one
//! contrast (blur takes more of fine fringes), and all patterns of an axis agree on one coordinate. What
//! real cameras and projectors add is estimated from the capture, not flagged: the light of a step and of
//! the fringe in it (a lamp that flickers), and the second and third harmonics (a response curve), each the
//! same part everywhere (`robust_scale`). Pixels on the edges of stripes and surfaces may see two places
//! and are left out, and so are those in which noise makes a fringe order uncertain.
//!
//! **Statistics**, of about 25,000 pixels from all rows, as the decoder itself decodes them (scale and light of
//! 4,000 of them; jumps of the code and errors of phase also of some whole rows):
//!
//! | statistic | sound captures | limit |
//! | --- | --- | --- |
//! | part of the pixels whose steps, sets or code contradict each other | at most 0.0017 | [`RATE`], and beyond it what chance adds |
//! | scale of the residuals, in standard deviations of noise and model error | at most 1.1 | [`SCALE`] |
//! | light that a set's steps differ by, in units of its residual | at most 0.05 | [`LIGHT`], and beyond it what chance adds |
//! | mean of fringes, between black and white | at least 0.36 | [`DARK`] |
//! | error of the phase that follows the phase | at most 0.06 rad | `harmonics::LARGEST_RAD` |
//!
//! The second column was measured on captures of 400 random devices and of built-in ones; captures of a
//! physical scanner and of calibrations pass too. The book's page on the faults matrix names the commands. Counts are
//! refused where chance exceeds them once in ten thousand scans of a capture at the limit.
//!
//! **Noise** that is estimated from the same frames normalises itself: damage that most pixels have alike
//! raises it. It is therefore taken from the calibration if there is one, and otherwise the smaller of
//! that of the residuals and that of neighbouring pixels in the smoothest frames, where they are lit.
//!
//! **What a sequence can show.** N steps of a set leave N - 3 residuals. Four or more show that one of
//! them is wrong in each pixel, of which sets of three are only held against the mean of the other sets of
//! their axis; a single set of three shows nothing of its own. The Gray code of half a period holds every
//! bit against the phase: each wrong bit turns round the order of all finer ones. If two frames exchanged
//! explain the capture, they are named; otherwise the rows are, where the damage has some.
//!
//! **What no frame shows**: two frames that are equal where the camera sees them; the rotation or reversal
//! of the steps of a lone set, or of one whose code has no half cells, but for the jumps from period to
//! period; a Gray code whose first bit is exchanged with its complement, where the mirrored coordinates
//! are on the projector; the last frame shown twice; less light in all frames alike; rows that are missing
//! from every second of four steps, where the surface has neither edges nor texture; damage of less than
//! [`RATE`] of the pixels, which the decoder leaves out one by one; and in light so dim that noise makes
//! orders uncertain, wrong bits.

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

/// Part of the pixels whose frames may contradict each other: more than twice what sound captures have.
const RATE: f64 = 2.5e-3;
/// The same of a code whose edges lie where the fringes begin anew: a pixel there is uncertain.
const EDGES: f64 = 0.08;
/// Standard normal quantile of one in ten thousand, both axes and a margin for neighbours that are alike.
const QUANTILE: f64 = 4.0;
/// Largest scale of residuals, in standard deviations of noise and model error.
const SCALE: f32 = 3.0;
/// Largest difference of the light of a set's steps, as it shows in the residual: one of four steps with
/// 0.92 of the light of the others, one of three with 0.9.
const LIGHT: f32 = 0.055;
/// Scale of residuals before their common part is taken off, in parts of that after it, from which on the
/// common part explains them.
const EXPLAINED: f32 = 10.0;
/// Least mean of fringes between black and white: that of a projector of gamma 2.2 is 0.36.
const DARK: f64 = 0.28;
/// Contrast of white and black in standard deviations of noise from which on it tells the mean.
const CONTRAST: f32 = 20.0;
/// Least part of the pixels that have to be lit to tell anything,
const LEAST_LIT: f64 = 1e-3;
/// below which other things in front of the camera may be.
const FEW_LIT: f64 = 2e-2;
/// Fewest pixels that show a surface.
const LEAST_PIXELS: usize = 12;
/// Share of saturated pixels that is the likeliest cause of frames that show no modulation.
const MANY_SATURATED: f64 = 0.2;
/// Frames from one to another that may be exchanged with it.
const NEAR: usize = 3;
/// Cells of a code in periods below which an edge lies within each period.
const HALF_CELL: f64 = 0.75;

/// What is known of a capture besides its frames.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Known {
    /// The link says which frame each is, so that saturated ones are those that were asked for.
    pub identified: bool,
    /// The camera's noise, from a calibration.
    pub noise: Option<NoiseModel>,
}

impl Known {
    /// Describes frames that the link identifies or not, from a device with a calibration or without.
    pub fn new(identified: bool, calibration: Option<&Rig>) -> Self {
        Self {
            identified,
            noise: calibration.and_then(|rig| rig.noise),
        }
    }
}

/// Checks frames, as many as the sequence has and all of one size and format. Frames that hardly vary
/// pass: that they show no modulation is another matter ([`check_modulation`]). A sequence passes
/// unchecked if some of its frames were not loaded because no decoder needs them.
///
/// # Errors
/// Returns how the frames depart from the sequence.
pub fn check_sequence(
    manifest: &Manifest,
    frames: &[Image],
    known: Known,
) -> Result<(), FrameDoubt> {
    if frames.len() != manifest.frame.len() || frames.iter().any(Image::is_empty) {
        return Ok(());
    }
    Image::common_size(frames).map_err(|e| FrameDoubt::Sizes(e.to_string()))?;
    // What cannot be decoded holds nothing that could be checked.
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

/// What a user should know of frames that follow their sequence: fringes that are not sinusoidal, so that
/// the error of a point depends on its place in a fringe. Arguments as for [`check_sequence`].
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

/// Shares of all pixels.
struct Lit {
    /// Modulated and not saturated.
    share: f64,
    /// With a coordinate.
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

/// Whether the frames of one axis agree; with harmonics in the fringes, orders may be wrong of themselves.
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
    // Without fringes a code says itself what it resolves.
    let orders = !bent && axis.order != Order::Cells;
    let count = sample.count(axis, map, orders);
    let rate = if has_half_cells(axis) { RATE } else { EDGES };
    // Beside saturated pixels light may spill over.
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
    // The light of a step that is dark as a whole explains its residuals, although their rest is large too.
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
    // A bad step of one set also changes what the others are compared with, but less.
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

/// Whether more pixels contradict themselves than chance makes of a rate.
fn is_too_many(count: Count, rate: f64) -> bool {
    let expected = rate * count.all as f64;
    // The last terms are the Poisson distribution's distance from the normal one.
    let most = expected + QUANTILE * expected.sqrt() + QUANTILE * QUANTILE / 6.0;
    count.odd as f64 > most
}

/// Whether each order is known twice: by several periods, or by a code with an edge within each period.
/// Otherwise pixels on the edges of the code are uncertain.
fn has_half_cells(axis: &AxisPlan) -> bool {
    match (&axis.gray, axis.order) {
        (Some(code), Order::Resolved { repeat_px }) => code.cell_px < HALF_CELL * repeat_px,
        (Some(_), _) => false,
        (None, _) => true,
    }
}

/// Fringes with distinctly less light than white.
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

/// The two frames near each other that explain most of the contradictions if they are exchanged.
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
