//! The decoder: a plan, an image size and a rig made into tables once, then frames into maps.

use super::borders::{self, LightNoise};
use super::edges;
use super::noise::estimate_noise;
use super::phase::RowNoise;
use super::plan::{Order, Plan};
use super::rows::{
    AxisKernel, AxisOut, Job, Scratch, apply_flags, decode_row, judge_borders, judge_row,
    triangulate_row,
};
use super::samples::{FrameStack, Sample, Samples};
use super::unwrap::unwrap;
use crate::calibrate::{CoordinateRow, Triangulator};
use crate::error::{Error, Result};
use crate::geometry::{NoiseModel, Rig};
use crate::pattern::{Axis, Manifest};
use rayon::prelude::*;

/// Rows that one task decodes: few enough for balance, enough to amortise.
const BAND: usize = 8;

/// What the user chooses.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Options {
    /// Keeps pixels that read two surfaces at once.
    pub keep_mixed: bool,
    /// Unwraps a single wrapped period along space.
    pub unwrap_spatial: bool,
    /// Least modulation B in DN.
    pub min_modulation_dn: f32,
    /// Largest standard deviation of a set's phase in radians: beyond it a phase is hardly known.
    pub max_phase_sigma_rad: f32,
    /// The camera's noise; comes before the rig's, and both before an estimate from the frames.
    pub noise: Option<NoiseModel>,
}

impl Default for Options {
    fn default() -> Self {
        Self {
            keep_mixed: false,
            unwrap_spatial: false,
            min_modulation_dn: 2.0,
            max_phase_sigma_rad: 0.15,
            noise: None,
        }
    }
}

/// Why a pixel has no coordinate.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
#[repr(u8)]
pub enum Verdict {
    /// It has one.
    #[default]
    Valid,
    /// A fringe frame is saturated there.
    Saturated,
    /// Too little modulation, absolutely or against the noise.
    Dim,
    /// The order of its period is not certain, or beyond the projector.
    Uncertain,
    /// It reads two surfaces at once, or disagrees with both neighbourhoods.
    Mixed,
    /// No neighbour is valid that it could be checked against.
    Stray,
}

impl Verdict {
    /// Every verdict in order.
    pub const ALL: [Self; 6] = [
        Self::Valid,
        Self::Saturated,
        Self::Dim,
        Self::Uncertain,
        Self::Mixed,
        Self::Stray,
    ];

    /// The name in tables.
    pub fn name(self) -> &'static str {
        match self {
            Self::Valid => "valid",
            Self::Saturated => "saturated",
            Self::Dim => "low modulation",
            Self::Uncertain => "uncertain order",
            Self::Mixed => "mixed",
            Self::Stray => "stray",
        }
    }
}

/// Maps of one axis, height x width row by row.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct AxisMap {
    /// Projector coordinate in pixels, NaN where invalid.
    pub coordinate: Vec<f32>,
    /// Standard deviation of the coordinate in projector pixels, NaN where invalid.
    pub sigma: Vec<f32>,
    /// Why each pixel is valid or not.
    pub verdict: Vec<Verdict>,
    /// The period that coordinates are known modulo, where their order is not resolved: after
    /// spatial unwrapping, up to one whole number of periods per connected region.
    pub wrapped_px: Option<f64>,
}

/// What a sequence decodes to; maps are height x width, row by row.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Decoded {
    /// Columns.
    pub width: usize,
    /// Rows.
    pub height: usize,
    /// Projector columns, if the sequence encodes them.
    pub x: Option<AxisMap>,
    /// Projector rows, if the sequence encodes them.
    pub y: Option<AxisMap>,
    /// Modulation B in DN of the finest fringes of the first axis; of Gray code alone, its half
    /// contrast.
    pub modulation: Vec<f32>,
    /// White minus black (without them: twice the modulation) over the camera's range, 0 to 1.
    pub intensity: Vec<f32>,
    /// Depth z in the camera's frame in mm, NaN where there is none; empty without a rig.
    pub depth: Vec<f32>,
    /// Standard deviation of the depth in mm, NaN where there is none; empty without a rig.
    pub depth_sigma: Vec<f32>,
    /// The noise model that the standard deviations come from.
    pub noise: Option<NoiseModel>,
    /// What the user should know about how it was decoded.
    pub notes: Vec<String>,
}

impl Decoded {
    /// The map of an axis.
    pub fn axis(&self, axis: Axis) -> Option<&AxisMap> {
        match axis {
            Axis::X => self.x.as_ref(),
            Axis::Y => self.y.as_ref(),
        }
    }

    /// The maps there are, x before y.
    pub fn axes(&self) -> impl Iterator<Item = (Axis, &AxisMap)> {
        [(Axis::X, &self.x), (Axis::Y, &self.y)]
            .into_iter()
            .filter_map(|(axis, map)| map.as_ref().map(|map| (axis, map)))
    }

    /// Whether pixel `i` is valid on every axis that was decoded.
    pub fn is_valid(&self, i: usize) -> bool {
        self.axes().all(|(_, map)| map.verdict[i] == Verdict::Valid)
    }

    fn axis_mut(&mut self, axis: Axis) -> &mut Option<AxisMap> {
        match axis {
            Axis::X => &mut self.x,
            Axis::Y => &mut self.y,
        }
    }
}

/// Decodes the frames of one sequence from one camera, again and again.
#[derive(Debug)]
pub struct Decoder {
    plan: Plan,
    width: usize,
    height: usize,
    options: Options,
    kernels: Vec<AxisKernel>,
    triangulator: Option<Triangulator>,
    noise: Option<NoiseModel>,
}

impl Decoder {
    /// Prepares the decoding of a sequence from images of `width` x `height`, to points if there is
    /// a rig.
    ///
    /// # Errors
    /// A sequence that determines no coordinate (see [`Plan::new`]), or one or an image size that
    /// the rig cannot triangulate.
    pub fn new(
        manifest: &Manifest,
        width: usize,
        height: usize,
        rig: Option<&Rig>,
        options: Options,
    ) -> Result<Self> {
        let plan = Plan::new(manifest)?;
        if width == 0 || height == 0 {
            return Err(Error::input(
                "frames",
                format!("{width} x {height}"),
                "at least 1 x 1",
            ));
        }
        let triangulator = match rig {
            Some(rig) => {
                if plan
                    .axes
                    .iter()
                    .all(|a| matches!(a.order, Order::Wrapped { .. }))
                {
                    let axis = &plan.axes[0];
                    let period = axis.sets[0].period_px;
                    return Err(Error::input(
                        format!("sequence, axis {}", axis.axis),
                        format!(
                            "period {period} px covers only 1/{:.0} of the {} px, and there is \
                             neither Gray code nor a second period: no points with that",
                            axis.extent_px / period,
                            axis.extent_px
                        ),
                        "a Gray code or a second period, or no calibration",
                    ));
                }
                Some(Triangulator::new(rig, width, height)?)
            }
            None => None,
        };
        let kernels = plan
            .axes
            .iter()
            .map(|axis| AxisKernel::new(axis, plan.references().is_some()))
            .collect();
        Ok(Self {
            width,
            height,
            options,
            kernels,
            triangulator,
            noise: options.noise.or(rig.and_then(|r| r.noise)),
            plan,
        })
    }

    /// How the sequence is decoded.
    pub fn plan(&self) -> &Plan {
        &self.plan
    }

    /// The rig's tables, if there is a rig.
    pub fn triangulator(&self) -> Option<&Triangulator> {
        self.triangulator.as_ref()
    }

    /// Decodes frames in the manifest's order.
    ///
    /// # Errors
    /// Another number or size of frames than the decoder was made for.
    pub fn decode(&self, stack: &FrameStack<'_>) -> Result<Decoded> {
        let mut decoded = Decoded::default();
        self.decode_into(stack, &mut decoded)?;
        Ok(decoded)
    }

    /// [`Self::decode`] into maps that are used again: fresh memory costs as much as decoding.
    ///
    /// # Errors
    /// As [`Self::decode`].
    pub fn decode_into(&self, stack: &FrameStack<'_>, out: &mut Decoded) -> Result<()> {
        self.check(stack)?;
        self.shape(out);
        out.notes.clear();
        out.notes.extend(self.plan.notes.iter().cloned());
        let noise = self
            .noise
            .unwrap_or_else(|| match estimate_noise(&self.plan, stack) {
                Some(noise) => {
                    out.notes.push(format!(
                        "noise estimated from the frames: {:.2} DN in the dark, gain {:.4} DN/e",
                        noise.variance_dn2(0.0).sqrt(),
                        noise.gain_dn_per_e
                    ));
                    noise
                }
                None => {
                    out.notes
                        .push("the frames do not tell their noise: 1 DN is assumed".to_owned());
                    NoiseModel {
                        gain_dn_per_e: 0.0,
                        read_noise_dn: (11.0f64 / 12.0).sqrt(),
                        black_level_dn: 0.0,
                        saturation_dn: f64::from(stack.full_scale()),
                    }
                }
            });
        out.noise = Some(noise);
        let saturation = noise.saturation_dn.min(f64::from(stack.full_scale())) as f32;
        let range = (saturation - noise.black_level_dn as f32).max(1.0);
        match stack.frames()[0] {
            Samples::U8(_) => self.rows::<u8>(stack, &noise, [saturation, range], out),
            Samples::U16(_) => self.rows::<u16>(stack, &noise, [saturation, range], out),
        }
        self.finish(LightNoise::new(&noise, range), out);
        Ok(())
    }

    fn check(&self, stack: &FrameStack<'_>) -> Result<()> {
        if (stack.width(), stack.height()) != (self.width, self.height) {
            return Err(Error::input(
                "frames",
                format!("{} x {}", stack.width(), stack.height()),
                format!("{} x {}", self.width, self.height),
            ));
        }
        if stack.frames().len() != self.plan.frames {
            return Err(Error::input(
                "frames",
                format!("{} frames", stack.frames().len()),
                format!("{} frames, one a pattern of the sequence", self.plan.frames),
            ));
        }
        for (i, frame) in stack.frames().iter().enumerate() {
            if self.plan.uses(i) && frame.is_empty() {
                return Err(Error::input(
                    format!("frame {i}"),
                    "no samples",
                    format!("{} x {} samples", self.width, self.height),
                ));
            }
        }
        Ok(())
    }

    /// Gives the maps their sizes; every element is written later.
    fn shape(&self, out: &mut Decoded) {
        let n = self.width * self.height;
        (out.width, out.height) = (self.width, self.height);
        for axis in [Axis::X, Axis::Y] {
            let slot = out.axis_mut(axis);
            let Some(plan) = self.plan.axis(axis) else {
                *slot = None;
                continue;
            };
            let map = slot.get_or_insert_default();
            map.coordinate.resize(n, 0.0);
            map.sigma.resize(n, 0.0);
            map.verdict.resize(n, Verdict::Valid);
            map.wrapped_px = match plan.order {
                Order::Wrapped { period_px } => Some(period_px),
                _ => None,
            };
        }
        out.modulation.resize(n, 0.0);
        out.intensity.resize(n, 0.0);
        let with_depth = if self.triangulator.is_some() { n } else { 0 };
        out.depth.resize(with_depth, 0.0);
        out.depth_sigma.resize(with_depth, 0.0);
    }

    /// Pass 1: every row on its own.
    fn rows<T: Sample>(
        &self,
        stack: &FrameStack<'_>,
        noise: &NoiseModel,
        [saturation, range]: [f32; 2],
        out: &mut Decoded,
    ) {
        let frames: Vec<&[T]> = stack.typed().expect("checked: all frames are of one type");
        let job = Job {
            frames: &frames,
            kernels: &self.kernels,
            references: self.plan.references(),
            noise: RowNoise::new(noise),
            saturation,
            range,
            min_modulation: self.options.min_modulation_dn,
            max_phase_sigma: self.options.max_phase_sigma_rad,
            width: self.width,
        };
        let size = BAND * self.width;
        let mut x = bands(&mut out.x, size);
        let mut y = bands(&mut out.y, size);
        let mut tasks: Vec<_> = out
            .modulation
            .chunks_mut(size)
            .zip(out.intensity.chunks_mut(size))
            .enumerate()
            .map(|(i, (modulation, intensity))| {
                let maps = [x.next(), y.next()];
                (i * BAND, maps, modulation, intensity)
            })
            .collect();
        tasks.par_iter_mut().for_each_init(
            Scratch::default,
            |scratch, (first, maps, modulation, intensity)| {
                let width = self.width;
                let rows = modulation
                    .chunks_mut(width)
                    .zip(intensity.chunks_mut(width));
                for (k, (modulation, intensity)) in rows.enumerate() {
                    let row = k * width..(k + 1) * width;
                    let outs = maps.each_mut().map(|map| {
                        map.as_mut().map(|(c, s, v)| AxisOut {
                            coordinate: &mut c[row.clone()],
                            sigma: &mut s[row.clone()],
                            verdict: &mut v[row.clone()],
                        })
                    });
                    decode_row(&job, *first + k, scratch, outs, modulation, intensity);
                }
            },
        );
    }

    /// Passes 2 and 3: what needs neighbours, then depth.
    fn finish(&self, light: LightNoise, out: &mut Decoded) {
        let width = self.width;
        if !self.options.keep_mixed {
            let mut flags = vec![edges::KEEP; width * self.height];
            self.judge(out, &mut flags);
            apply(out, &flags);
            self.judge_borders(out, light, &mut flags);
            apply(out, &flags);
        }
        if self.options.unwrap_spatial {
            for (axis, map) in [(Axis::X, &mut out.x), (Axis::Y, &mut out.y)] {
                let Some(map) = map else { continue };
                let Some(period) = map.wrapped_px else {
                    continue;
                };
                unwrap(width, &mut map.coordinate, &map.sigma, period as f32);
                out.notes.push(format!(
                    "axis {axis} is unwrapped along space: right up to whole periods of {period} px \
                     per connected region"
                ));
            }
        }
        if let Some(triangulator) = &self.triangulator {
            let resolved =
                |map: &Option<AxisMap>| map.as_ref().filter(|m| m.wrapped_px.is_none()).is_some();
            let (use_x, use_y) = (resolved(&out.x), resolved(&out.y));
            let (x, y) = (&out.x, &out.y);
            out.depth
                .par_chunks_mut(width)
                .zip(out.depth_sigma.par_chunks_mut(width))
                .enumerate()
                .with_min_len(BAND)
                .for_each(|(v, (depth, sigma))| {
                    let at = v * width..(v + 1) * width;
                    let [x, y] = [(x, use_x), (y, use_y)].map(|(map, on)| {
                        map.as_ref().filter(|_| on).map(|m| CoordinateRow {
                            px: &m.coordinate[at.clone()],
                            sigma: &m.sigma[at.clone()],
                        })
                    });
                    triangulate_row(triangulator, v, x, y, depth, sigma);
                });
        }
    }

    /// Pass 2: flags of pixels that disagree with their neighbours on any axis.
    fn judge(&self, out: &Decoded, flags: &mut [u8]) {
        let width = self.width;
        let nan = vec![f32::NAN; width];
        flags
            .par_chunks_mut(width)
            .enumerate()
            .with_min_len(BAND)
            .for_each_init(
                || vec![f32::NAN; width + 6],
                |padded, (v, flags)| {
                    for (_, map) in out.axes() {
                        let rows = rows_around(&map.coordinate, &nan, v);
                        padded[3..width + 3].copy_from_slice(rows[3]);
                        let around = edges::Around {
                            rows,
                            padded,
                            sigma: &map.sigma[v * width..(v + 1) * width],
                        };
                        judge_row(&around, map.wrapped_px.unwrap_or(0.0) as f32, flags);
                    }
                },
            );
    }

    /// Pass 2 again: flags of border pixels that are not trusted on some axis.
    fn judge_borders(&self, out: &Decoded, noise: LightNoise, flags: &mut [u8]) {
        let width = self.width;
        let nan = vec![f32::NAN; width];
        flags
            .par_chunks_mut(width)
            .enumerate()
            .with_min_len(BAND)
            .for_each_init(
                || (vec![f32::NAN; width + 4], vec![f32::NAN; width + 2]),
                |(padded, padded_light), (v, flags)| {
                    flags.fill(edges::KEEP);
                    let light = rows_around(&out.intensity, &nan, v);
                    padded_light[1..width + 1].copy_from_slice(light[1]);
                    for (_, map) in out.axes() {
                        let rows = rows_around(&map.coordinate, &nan, v);
                        padded[2..width + 2].copy_from_slice(rows[2]);
                        let near = borders::Near {
                            rows,
                            padded,
                            light,
                            padded_light,
                            sigma: &map.sigma[v * width..(v + 1) * width],
                            noise,
                        };
                        judge_borders(&near, map.wrapped_px.unwrap_or(0.0) as f32, flags);
                    }
                },
            );
    }
}

/// Takes flagged pixels out of every map.
fn apply(out: &mut Decoded, flags: &[u8]) {
    let width = out.width;
    for map in [&mut out.x, &mut out.y].into_iter().flatten() {
        map.coordinate
            .par_chunks_mut(width)
            .zip(map.sigma.par_chunks_mut(width))
            .zip(map.verdict.par_chunks_mut(width))
            .zip(flags.par_chunks(width))
            .with_min_len(BAND)
            .for_each(|(((coordinate, sigma), verdict), flags)| {
                let out = AxisOut {
                    coordinate,
                    sigma,
                    verdict,
                };
                apply_flags(out, flags);
            });
    }
}

/// `N` rows of a map about row `v`; `beyond` stands for those outside it.
fn rows_around<'a, const N: usize>(map: &'a [f32], beyond: &'a [f32], v: usize) -> [&'a [f32]; N] {
    let width = beyond.len();
    std::array::from_fn(|k| {
        let first = (v + k).wrapping_sub(N / 2).wrapping_mul(width);
        if first < map.len() {
            &map[first..first + width]
        } else {
            beyond
        }
    })
}

/// Chunks of a map's three vectors side by side.
fn bands(
    map: &mut Option<AxisMap>,
    size: usize,
) -> impl Iterator<Item = (&mut [f32], &mut [f32], &mut [Verdict])> {
    map.iter_mut().flat_map(move |map| {
        map.coordinate
            .chunks_mut(size)
            .zip(map.sigma.chunks_mut(size))
            .zip(map.verdict.chunks_mut(size))
            .map(|((c, s), v)| (c, s, v))
    })
}
