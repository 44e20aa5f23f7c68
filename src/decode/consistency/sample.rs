//! Decodes a part of a capture's pixels: all rows of some columns, so that damage of a few rows is
//! detected; and some rows with all columns, so that neighbouring pixels can be compared.

use super::frame_noise::noise_of;
use super::pixels::{Pixels, full_scale};
use crate::maps::{AxisMap, Decoded, Verdict};
use crate::plan::AxisPlan;
use crate::robust_scale::Shared;
use crate::{Decoder, Held, Options, Plan};
use phasmid_geometry::NoiseModel;
use phasmid_pattern::{Axis, Image, Manifest};
use rayon::prelude::*;
use std::ops::{Range, RangeInclusive};

/// Minimum number of pixels for an estimate of a property of all pixels.
pub(super) const FEWEST: usize = 400;
/// Maximum difference, between the bits of an axis, in the sum of a bit and its complement, relative to
/// the contrast.
const UNLIKE: f32 = 0.5;
/// Spacing in pixels of the samples that test which frames are exchanged.
const THIN: usize = 3;
/// Approximate number of decoded pixels.
const PIXELS: usize = 25_000;
/// Minimum number of decoded columns.
const COLUMNS: usize = 32;
/// Number of rows that are read with all columns.
const ROWS: usize = 32;
/// Minimum modulation, in standard deviations of a sample's noise, at which noise does not make orders
/// uncertain.
const BRIGHT: f32 = 14.0;

/// A part of a capture's pixels: samples and decoded maps.
pub(super) struct Sample {
    pub(super) plan: Plan,
    /// The decoded columns of each frame.
    frames: Vec<Image>,
    pub(super) columns: Pixels,
    pub(super) rows: Pixels,
    pub(super) decoded: Decoded,
    /// Common part of the residuals of all pixels, by axis and set.
    pub(super) shared: Vec<Vec<Option<Shared>>>,
    /// Spacing of the decoded columns in pixels.
    every: usize,
    /// Flags pixels away from edges of surfaces and colours that stay below the camera's full scale.
    plain: Vec<bool>,
    /// Approximate standard deviation of each pixel's noise in DN.
    pub(super) noise_dn: Vec<f32>,
}

/// Number of pixels whose frames could contradict each other (`all`), and whose frames do (`odd`).
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub(super) struct Count {
    pub(super) all: usize,
    pub(super) odd: usize,
}

impl Count {
    /// Fraction of contradictory pixels, 0 to 1.
    pub(super) fn share(self) -> f64 {
        self.odd as f64 / self.all.max(1) as f64
    }
}

impl Sample {
    /// Decodes some pixels of the frames; `None` if the frames differ in size, are empty or cannot be
    /// decoded.
    pub(super) fn new(
        manifest: &Manifest,
        frames: &[Image],
        noise: Option<NoiseModel>,
    ) -> Option<Self> {
        let plan = Plan::new(manifest).ok()?;
        let [width, height] = Image::common_size(frames).ok()?;
        let every = (width * height / PIXELS).clamp(1, width.div_ceil(COLUMNS));
        let lines = ROWS.min(height);
        let row = |line: usize| (2 * line + 1) * height / (2 * lines);
        let some: Vec<Range<usize>> = (0..lines).map(|line| row(line)..row(line) + 1).collect();
        let largest = frames.iter().map(Image::full_scale).max();
        let of_columns = || {
            let columns: Vec<Image> = frames.par_iter().map(|f| f.columns(every)).collect();
            let pixels = Pixels::new(&plan, &columns, std::slice::from_ref(&(0..height)));
            (columns, pixels)
        };
        let of_rows = || Pixels::new(&plan, frames, &some);
        let ((frames, mut columns), mut rows) = rayon::join(of_columns, of_rows);
        let width = columns.width;
        let full = full_scale(rows.greatest().max(columns.greatest()));
        rows.set_full(full);
        columns.set_full(full);
        let largest = f64::from(largest.unwrap_or(u16::MAX));
        let noise = noise_of(&plan, &frames, &rows, largest, noise);
        let options = Options {
            noise: Some(noise),
            held: Held::Off,
            ..Options::default()
        };
        let decoder = Decoder::new(manifest, width, height, None, options).ok()?;
        let (decoded, shared) = decoder.spaced(every).decode_with_shared(&frames).ok()?;
        let range = noise.saturation_dn - noise.black_level_dn;
        let noise_dn = |light: &f32| {
            let light = noise.black_level_dn + range * f64::from(light.max(0.0));
            noise.variance_dn2(light).sqrt() as f32
        };
        Some(Self {
            plain: columns.plain(&plan),
            noise_dn: decoded.intensity.iter().map(noise_dn).collect(),
            plan,
            frames,
            columns,
            rows,
            decoded,
            shared,
            every,
        })
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

    /// Whether a pixel shows fringes or a code of an axis, away from the edges of surfaces.
    pub(super) fn is_plain(&self, map: &AxisMap, pixel: usize) -> bool {
        self.plain[pixel] && !matches!(map.verdict[pixel], Verdict::Dim | Verdict::Saturated)
    }

    /// Share of the pixels that are at full scale in some frame.
    pub(super) fn saturated(&self) -> f64 {
        let saturated = self.columns.saturated();
        let count = saturated.iter().filter(|saturated| **saturated).count();
        count as f64 / saturated.len().max(1) as f64
    }

    /// Whether noise is too small to make a pixel's order uncertain.
    fn is_bright(&self, pixel: usize) -> bool {
        self.decoded.modulation[pixel] >= BRIGHT * self.noise_dn[pixel]
    }

    /// Counts the pixels of an axis whose frames contradict each other: by the residuals of steps or
    /// sets, by the sums of complementary bits and, if `orders` is set, by an uncertain order.
    pub(super) fn count(&self, axis: &AxisPlan, map: &AxisMap, orders: bool) -> Count {
        let unlike = self.complements_disagree(axis);
        let mut count = Count::default();
        for i in (0..map.verdict.len()).filter(|i| self.is_plain(map, *i) && self.is_bright(*i)) {
            count.all += 1;
            count.odd += usize::from(match map.verdict[i] {
                Verdict::Odd => true,
                Verdict::Uncertain if orders => true,
                _ => unlike[i],
            });
        }
        count
    }

    /// Flags pixels in which the sums of a bit and its complement differ distinctly between the bits of
    /// an axis.
    fn complements_disagree(&self, axis: &AxisPlan) -> Vec<bool> {
        let range = |[low, high]: [f32; 2], v: f32| [low.min(v), high.max(v)];
        let none = [f32::INFINITY, f32::NEG_INFINITY];
        // For each pixel, the range of the sums of a bit and its complement, and the range of the
        // samples.
        let mut ranges = vec![[none; 2]; self.columns.len()];
        let bits = axis.gray.iter().flat_map(|code| &code.bits);
        for (plain, inverse) in bits.filter_map(|bit| bit.plain.zip(bit.inverse)) {
            let [plain, inverse] = [plain, inverse].map(|frame| self.columns.frame(frame));
            for (ranges, (p, i)) in ranges.iter_mut().zip(plain.iter().zip(inverse)) {
                ranges[0] = range(ranges[0], p + i);
                ranges[1] = range(range(ranges[1], *p), *i);
            }
        }
        let differ =
            |[sums, samples]: [[f32; 2]; 2]| sums[1] - sums[0] > UNLIKE * (samples[1] - samples[0]);
        ranges.into_iter().map(differ).collect()
    }

    /// Returns the rows that contain nine of ten contradictory pixels, if they span less than half of
    /// the image.
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

    /// Returns the pair of frames whose exchange gives the most pixels of an axis a coordinate, if that
    /// recovers more than half of the lit pixels without a coordinate.
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
