//! A part of a capture's pixels, decoded: every row and some of the columns, so that damage of a few rows
//! is seen too.

use crate::maps::{AxisMap, Decoded, Verdict};
use crate::plan::AxisPlan;
use crate::robust_scale::Shared;
use crate::{Decoder, Held, Options, Plan, deviation, estimate_noise};
use phasmid_core::statistics::median;
use phasmid_geometry::NoiseModel;
use phasmid_pattern::{Axis, Image, Manifest};
use rayon::prelude::*;
use std::ops::RangeInclusive;

/// Fewest pixels that tell a property of all.
pub(super) const FEWEST: usize = 400;
/// Part of the contrast by which sums of complements may differ.
const UNLIKE: f64 = 0.5;
/// Pixels from one to the next that tell which frames are exchanged.
const THIN: usize = 3;
/// Deviations of a sample in those of a calibration up to which frames may have more noise.
const KNOWN: f64 = 2.0;
/// Part of the light of the brightest frame from which on one is bright.
const BRIGHTEST: f64 = 0.6;
/// Rows that tell the noise of a frame.
const ROWS: usize = 12;
/// Approximate number of pixels in these rows.
const SMOOTH: usize = 6_000;
/// Minimum light of a lit pixel in its brightest frame, as a part of that of the brightest hundredth.
const LIT: f64 = 0.25;
/// Minimum light of a bright pixel of a frame, as a part of that of the brightest tenth.
const BRIGHT_PART: f64 = 0.5;
/// Pixels that are decoded, about,
const PIXELS: usize = 25_000;
/// and columns, at least.
const COLUMNS: usize = 32;
/// Relative change of the light from a pixel to the next above which a surface or its colour ends there.
const STEP: f32 = 0.2;
/// Modulation in standard deviations of a sample's noise from which on noise does not make orders
/// uncertain.
const BRIGHT: f64 = 14.0;

/// Pixels with their samples and what they decode to.
pub(super) struct Sample {
    pub(super) plan: Plan,
    frames: Vec<Image>,
    pub(super) decoded: Decoded,
    decoder: Decoder,
    /// Columns from a pixel to the next.
    every: usize,
    /// Pixels away from the ends of surfaces and colours, and below the camera's full scale.
    plain: Vec<bool>,
    /// Pixels at the camera's full scale in some frame.
    saturated: Vec<bool>,
    /// The camera's full scale in DN, if pixels reach it.
    pub(super) full: f32,
}

/// Pixels whose frames could contradict each other, and those whose do.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub(super) struct Count {
    pub(super) all: usize,
    pub(super) odd: usize,
}

impl Count {
    /// The part of the pixels, 0 to 1.
    pub(super) fn share(self) -> f64 {
        self.odd as f64 / self.all.max(1) as f64
    }
}

impl Sample {
    /// Decodes some pixels of frames of one size, none of them empty; `None` where that is not possible.
    pub(super) fn new(
        manifest: &Manifest,
        frames: &[Image],
        noise: Option<NoiseModel>,
    ) -> Option<Self> {
        let plan = Plan::new(manifest).ok()?;
        let (light, smooth) = smoothness(frames);
        let first = frames.first()?;
        let every =
            (first.width() * first.height() / PIXELS).clamp(1, first.width().div_ceil(COLUMNS));
        let frames: Vec<Image> = frames.par_iter().map(|f| f.columns(every)).collect();
        let [width, height] = Image::common_size(&frames).ok()?;
        let options = Options {
            noise: Some(noise_of(&plan, &frames, light, smooth, noise)),
            // Its tables take longer than the rest.
            held: Held::Off,
            ..Options::default()
        };
        let decoder = Decoder::new(manifest, width, height, None, options).ok()?;
        let decoder = decoder.spaced(every);
        let decoded = decoder.decode(&frames).ok()?;
        let full = full_scale(&frames);
        let pixels = 0..width * height;
        let is_full = |i| frames.iter().any(|frame| f32::from(frame.value(i)) >= full);
        let saturated: Vec<bool> = pixels.map(|i| full.is_finite() && is_full(i)).collect();
        let lights = lights(&plan, &frames);
        let mut plain = plain(&lights, width);
        for (plain, saturated) in plain.iter_mut().zip(&saturated) {
            *plain &= !saturated;
        }
        Some(Self {
            plan,
            frames,
            decoded,
            decoder,
            every,
            plain,
            saturated,
            full,
        })
    }

    /// Standard deviation of a pixel's noise in DN, about.
    pub(super) fn noise_dn(&self, pixel: usize) -> f64 {
        let Some(noise) = self.decoded.noise else {
            return 1.0;
        };
        let range = noise.saturation_dn - noise.black_level_dn;
        let light =
            noise.black_level_dn + range * f64::from(self.decoded.intensity[pixel].max(0.0));
        noise.variance_dn2(light).sqrt()
    }

    /// Number of pixels.
    pub(super) fn pixels(&self) -> usize {
        self.decoded.modulation.len()
    }

    /// Standard deviation of the noise at a tenth of the camera's range, in DN.
    pub(super) fn usual_noise_dn(&self) -> f64 {
        self.decoded.noise.map_or(1.0, |noise| {
            let range = noise.saturation_dn - noise.black_level_dn;
            noise
                .variance_dn2(noise.black_level_dn + 0.1 * range)
                .sqrt()
        })
    }

    /// Whether a pixel shows fringes or a code of an axis, away from where surfaces end.
    pub(super) fn is_plain(&self, map: &AxisMap, pixel: usize) -> bool {
        self.plain[pixel] && !matches!(map.verdict[pixel], Verdict::Dim | Verdict::Saturated)
    }

    /// Share of the pixels that are at full scale in some frame.
    pub(super) fn saturated(&self) -> f64 {
        let count = self
            .saturated
            .iter()
            .filter(|saturated| **saturated)
            .count();
        count as f64 / self.saturated.len().max(1) as f64
    }

    /// A pixel's sample in a frame, in DN.
    pub(super) fn value(&self, frame: usize, pixel: usize) -> f64 {
        f64::from(self.frames[frame].value(pixel))
    }

    /// Whether a pixel is at the camera's full scale in some frame.
    pub(super) fn is_saturated(&self, pixel: usize) -> bool {
        self.saturated[pixel]
    }

    /// Whether noise is too small to make a pixel's order uncertain.
    fn is_bright(&self, pixel: usize) -> bool {
        f64::from(self.decoded.modulation[pixel]) >= BRIGHT * self.noise_dn(pixel)
    }

    /// Counts the pixels of an axis whose frames contradict each other: steps or sets by their residuals,
    /// and all of them, if `orders` are known twice, by an uncertain order.
    pub(super) fn count(&self, axis: &AxisPlan, map: &AxisMap, orders: bool) -> Count {
        let bits = axis.gray.iter().flat_map(|code| &code.bits);
        let pairs: Vec<_> = bits.filter_map(|bit| bit.plain.zip(bit.inverse)).collect();
        let mut count = Count::default();
        for i in (0..map.verdict.len()).filter(|i| self.is_plain(map, *i) && self.is_bright(*i)) {
            count.all += 1;
            count.odd += usize::from(match map.verdict[i] {
                Verdict::Odd => true,
                Verdict::Uncertain if orders => true,
                _ => self.complements_disagree(&pairs, i),
            });
        }
        count
    }

    /// Whether bits and their complements have distinctly different sums in a pixel.
    fn complements_disagree(&self, pairs: &[(usize, usize)], pixel: usize) -> bool {
        let range = |low: f64, high: f64, v: f64| (low.min(v), high.max(v));
        let none = (f64::INFINITY, f64::NEG_INFINITY);
        let (mut sums, mut samples) = (none, none);
        for (plain, inverse) in pairs {
            let [plain, inverse] = [*plain, *inverse].map(|frame| self.value(frame, pixel));
            sums = range(sums.0, sums.1, plain + inverse);
            samples = range(samples.0, samples.1, plain);
            samples = range(samples.0, samples.1, inverse);
        }
        sums.1 - sums.0 > UNLIKE * (samples.1 - samples.0)
    }

    /// The rows in which nine of ten contradictory pixels lie, if they are less than half of all.
    pub(super) fn odd_rows(&self, map: &AxisMap) -> Option<RangeInclusive<usize>> {
        let is_odd = |i: &usize| {
            let odd = matches!(map.verdict[*i], Verdict::Odd | Verdict::Uncertain);
            odd && self.is_plain(map, *i) && self.is_bright(*i)
        };
        let pixels = (0..map.verdict.len()).filter(is_odd);
        let rows: Vec<usize> = pixels.map(|i| i / self.decoded.width).collect();
        let first = *rows.get(rows.len() / 20)?;
        let last = *rows.get(rows.len() * 19 / 20)?;
        (2 * (last - first) < self.decoded.height).then_some(first..=last)
    }

    /// What the residuals of all pixels have in common, by axis and set.
    pub(super) fn shared(&self) -> Vec<Vec<Option<Shared>>> {
        let views: Vec<_> = self.frames.iter().map(Image::view).collect();
        match &self.decoded.noise {
            Some(noise) => self.decoder.shared_residuals(&views, noise),
            None => Vec::new(),
        }
    }

    /// The two frames of `pairs` with whose exchange the most pixels of an axis have a coordinate, if that
    /// explains most of the others.
    pub(super) fn exchanged(
        &self,
        manifest: &Manifest,
        axis: Axis,
        pairs: impl Iterator<Item = [usize; 2]>,
    ) -> Option<[usize; 2]> {
        let thin: Vec<Image> = self.frames.iter().map(|f| f.thinned(THIN)).collect();
        let [width, height] = Image::common_size(&thin).ok()?;
        let options = Options {
            noise: self.decoded.noise,
            held: Held::Off,
            ..Options::default()
        };
        let decoder = Decoder::new(manifest, width, height, None, options).ok()?;
        let decoder = decoder.spaced(THIN * self.every);
        let mut views: Vec<_> = thin.iter().map(Image::view).collect();
        let mut decoded = Decoded::default();
        let mut valid = |views: &[_]| {
            decoder.decode_views(views, &mut decoded).ok()?;
            let verdicts = &decoded.axis(axis)?.verdict;
            let lit = verdicts
                .iter()
                .filter(|v| !matches!(v, Verdict::Dim | Verdict::Saturated));
            let valid = verdicts.iter().filter(|v| **v == Verdict::Valid).count();
            Some((valid, lit.count()))
        };
        let (before, lit) = valid(&views)?;
        let tried = pairs.filter_map(|pair @ [one, other]| {
            views.swap(one, other);
            let found = valid(&views);
            views.swap(one, other);
            Some((found?.0, pair))
        });
        let (best, pair) = tried.max_by_key(|(valid, _)| *valid)?;
        (2 * best.saturating_sub(before) > lit.saturating_sub(before)).then_some(pair)
    }
}

/// The noise of frames: that which they contradict each other by, or if it is smaller, that of neighbouring
/// pixels in the smoothest frames. Damage raises the first, texture the second. What is `known` is believed
/// if they do not have more, up to [`KNOWN`] times as much.
fn noise_of(
    plan: &Plan,
    frames: &[Image],
    light: f64,
    smooth: NoiseModel,
    known: Option<NoiseModel>,
) -> NoiseModel {
    let thin: Vec<Image> = frames.iter().map(|f| f.thinned(2)).collect();
    let views: Vec<_> = thin.iter().map(Image::view).collect();
    let found = match estimate_noise(plan, &views) {
        Some(noise) if noise.variance_dn2(light) <= smooth.variance_dn2(light) => noise,
        _ => smooth,
    };
    let Some(known) = known else {
        return found;
    };
    let more = found.variance_dn2(light) / known.variance_dn2(light).max(1e-9);
    let factor = more.clamp(1.0, KNOWN * KNOWN);
    NoiseModel {
        gain_dn_per_e: known.gain_dn_per_e * factor,
        read_noise_dn: known.read_noise_dn * factor.sqrt(),
        ..known
    }
}

/// The light of bright frames in DN, and the noise by fourth differences along rows, both of lit pixels: a
/// line through the smoothest frame and the smoothest bright one.
fn smoothness(frames: &[Image]) -> (f64, NoiseModel) {
    let lit = lit(frames);
    // Only bright pixels of a frame: a part of each code and fringe is dark.
    let of_frame = |frame: &Image| {
        let at = |i: usize| f64::from(frame.value(i));
        let mut lights: Vec<f64> = lit.iter().map(|i| at(*i)).collect();
        lights.sort_unstable_by(f64::total_cmp);
        let high = *lights.get(lights.len() * 9 / 10)?;
        let bright = || lit.iter().filter(|i| at(**i) >= BRIGHT_PART * high);
        let light = median(&mut bright().map(|i| at(*i)).collect::<Vec<_>>())?;
        let step = |i: &usize| at(i - 2) + at(i + 2) - 4.0 * (at(i - 1) + at(i + 1)) + 6.0 * at(*i);
        let mut steps: Vec<f64> = bright().map(|i| step(i).abs()).collect();
        // A difference 1, -4, 6, -4, 1 has 70 times the variance of a sample.
        let deviation = deviation::of_most(&mut steps, 3.0, 2.0) / 70f64.sqrt();
        Some((light, deviation * deviation))
    };
    let mut found: Vec<(f64, f64)> = frames.par_iter().filter_map(of_frame).collect();
    found.sort_by(|a, b| a.1.total_cmp(&b.1));
    let brightest = found.iter().map(|(light, _)| *light).fold(0.0, f64::max);
    let (dark, low) = found.first().copied().unwrap_or((0.0, 1.0));
    let mut bright = found
        .iter()
        .filter(|(light, _)| *light >= BRIGHTEST * brightest);
    let (light, high) = bright.next().copied().unwrap_or((dark, low));
    let gain = ((high - low) / (light - dark).max(1.0)).max(0.0);
    let full = frames
        .iter()
        .map(Image::full_scale)
        .max()
        .unwrap_or(u16::MAX);
    let noise = NoiseModel {
        gain_dn_per_e: gain,
        read_noise_dn: (low - gain * dark).max(0.25 * low).sqrt(),
        black_level_dn: 0.0,
        saturation_dn: f64::from(full),
    };
    (light, noise)
}

/// Pixels of some rows, not the two at either end, that are lit in some frame: unlit ones have less noise,
/// and in most captures there are more of them.
fn lit(frames: &[Image]) -> Vec<usize> {
    let Some(first) = frames.first() else {
        return Vec::new();
    };
    let (width, height) = (first.width(), first.height());
    let rows = (0..height).step_by((height / ROWS).max(1));
    let every = (width * ROWS / SMOOTH).max(1);
    let pixels = rows.flat_map(|row| {
        (2..width.saturating_sub(2))
            .step_by(every)
            .map(move |i| row * width + i)
    });
    let most = |i: usize| frames.iter().map(|frame| frame.value(i)).max().unwrap_or(0);
    let pixels: Vec<(usize, u16)> = pixels.map(|i| (i, most(i))).collect();
    let mut sorted: Vec<u16> = pixels.iter().map(|(_, most)| *most).collect();
    sorted.sort_unstable();
    let bright = sorted.get(sorted.len() * 99 / 100).copied().unwrap_or(0);
    let is_lit = |(_, most): &(usize, u16)| LIT * f64::from(bright) <= f64::from(*most);
    pixels.into_iter().filter(is_lit).map(|(i, _)| i).collect()
}

/// The greatest sample, where it is the full scale of 8 to 16 bits, at either end of a word; else
/// infinity.
fn full_scale(frames: &[Image]) -> f32 {
    let greatest = |frame: &Image| (0..frame.samples().len()).map(|i| frame.value(i)).max();
    let top = frames.iter().filter_map(greatest).max().unwrap_or(0);
    let ones = top.count_ones();
    let is_end = top.trailing_ones() == ones || top.leading_ones() == ones;
    match ones >= 8 && is_end {
        true => f32::from(top),
        false => f32::INFINITY,
    }
}

/// The light of each pixel in DN, as several groups of frames tell it: white, the means of fringe sets, and
/// without either the second largest sample. A damaged frame changes one of them.
fn lights(plan: &Plan, frames: &[Image]) -> Vec<Vec<f32>> {
    let pixels = 0..frames.first().map_or(0, |f| f.samples().len());
    let value = |frame: usize, i: usize| f32::from(frames[frame].value(i));
    let mut all: Vec<Vec<f32>> = Vec::new();
    all.extend(
        plan.white
            .map(|white| pixels.clone().map(|i| value(white, i)).collect()),
    );
    for set in plan.axes.iter().flat_map(|axis| &axis.sets) {
        let mean = |i: usize| {
            let steps = set.frames.iter().zip(&set.weights);
            steps.map(|(k, w)| w[0] as f32 * value(*k, i)).sum()
        };
        all.push(pixels.clone().map(mean).collect());
    }
    if all.len() < 2 {
        let second = |i: usize| {
            let of_frames = (0..frames.len()).map(|k| value(k, i));
            let two = of_frames.fold((0.0, 0.0), |(first, second): (f32, f32), v| {
                (first.max(v), second.max(first.min(v)))
            });
            two.1
        };
        all.push(pixels.map(second).collect());
    }
    all
}

/// Pixels whose light is like that of those beside, above and below them, by one of the `lights` at least.
fn plain(lights: &[Vec<f32>], width: usize) -> Vec<bool> {
    let like = |light: &[f32], i: usize, j: usize| {
        (light[i] - light[j]).abs() <= STEP * light[i].max(light[j])
    };
    let count = lights.first().map_or(0, Vec::len);
    let is_plain = |i: usize| {
        let column = i % width;
        let beside = [
            (column > 0).then(|| i - 1),
            (column + 1 < width).then(|| i + 1),
            i.checked_sub(width),
            (i + width < count).then(|| i + width),
        ];
        let mut beside = beside.into_iter().flatten();
        beside.all(|j| lights.iter().any(|light| like(light, i, j)))
    };
    (0..count).map(is_plain).collect()
}
