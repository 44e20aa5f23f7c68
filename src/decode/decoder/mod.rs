//! The decoder turns frames into maps, with tables that are prepared once from a plan, an image size and
//! a rig.
//!
//! `bands` runs pass 1 and `neighbours` pass 2.

mod bands;
mod neighbours;

use super::borders::LightNoise;
use super::held::{self, Held};
use super::loss::note_of_loss;
use super::maps::{AxisMap, Decoded, Verdict};
use super::noise::estimate_noise;
use super::options::Options;
use super::phase::SetKernel;
use super::plan::{Order, Plan};
use super::robust_scale::RobustScale;
use super::rows::{AxisKernel, BAND, triangulate_row};
use super::unwrap::unwrap;
use crate::triangulate::{CoordinateRow, Triangulator};
use neighbours::Finest;
use phasmid_core::Stop;
use phasmid_core::error::{Error, Result};
use phasmid_geometry::{NoiseModel, Rig};
use phasmid_pattern::{Axis, Image, ImageView, Manifest};
use rayon::prelude::*;

/// Decodes frames of one sequence from one camera; reusable for many scans.
#[derive(Debug)]
pub struct Decoder {
    plan: Plan,
    width: usize,
    height: usize,
    options: Options,
    kernels: Vec<AxisKernel>,
    /// Tables of the error due to held projector pixels, x first; `None` for an axis without fringes or
    /// if the error is not stated.
    held: [Option<held::Table>; 2],
    triangulator: Option<Triangulator>,
    noise: Option<NoiseModel>,
    /// Distance between neighbouring pixels, in pixel widths.
    spacing: f32,
    stop: Stop,
}

impl Decoder {
    /// Prepares the decoding of a sequence from images of `width` x `height`, with triangulation if
    /// there is a rig.
    ///
    /// # Errors
    /// Returns an error if the sequence determines no coordinate (see [`Plan::new`]), or if the rig
    /// does not support the sequence or the image size.
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
                             neither a Gray code nor a second period: points cannot be computed",
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
            .map(|axis| AxisKernel::new(axis, plan.references().is_some(), &options))
            .collect();
        Ok(Self {
            width,
            height,
            options,
            kernels,
            held: [Axis::X, Axis::Y].map(|axis| {
                let set = plan.axis(axis).filter(|_| options.held != Held::Off)?;
                let set = set.sets.first()?;
                Some(held::Table::new(set.period_px, set.rounding_px() as f32))
            }),
            triangulator,
            noise: options.noise.or(rig.and_then(|r| r.noise)),
            plan,
            spacing: 1.0,
            stop: Stop::default(),
        })
    }

    /// Sets the distance between neighbouring pixels to `pixels` pixel widths.
    pub(super) fn spaced(self, pixels: usize) -> Self {
        Self {
            spacing: pixels as f32,
            ..self
        }
    }

    /// Lets another thread end decoding early; decoding then returns [`Error::Interrupted`].
    #[must_use]
    pub fn with_stop(self, stop: Stop) -> Self {
        Self { stop, ..self }
    }

    /// Returns the plan of the sequence.
    pub fn plan(&self) -> &Plan {
        &self.plan
    }

    /// Returns the rig's triangulation tables, if there is a rig.
    pub fn triangulator(&self) -> Option<&Triangulator> {
        self.triangulator.as_ref()
    }

    /// Decodes images in the manifest's order. An image that no coordinate depends on, such as the image
    /// of an image pattern, may be empty.
    ///
    /// # Errors
    /// Returns an error if the number or size of the images differs from that given to [`Self::new`],
    /// or if some have 8 and some 16 bits per sample.
    pub fn decode(&self, images: &[Image]) -> Result<Decoded> {
        let mut decoded = Decoded::default();
        self.decode_into(images, &mut decoded)?;
        Ok(decoded)
    }

    /// Like [`Self::decode`], into reusable maps: allocating new memory costs as much as decoding.
    ///
    /// # Errors
    /// Returns the errors of [`Self::decode`].
    pub fn decode_into(&self, images: &[Image], out: &mut Decoded) -> Result<()> {
        let views: Vec<_> = images.iter().map(Image::view).collect();
        self.decode_views(&views, out)
    }

    /// Like [`Self::decode_into`], for images in memory that this program does not own.
    ///
    /// # Errors
    /// Returns the errors of [`Self::decode`].
    pub fn decode_views(&self, images: &[ImageView<'_>], out: &mut Decoded) -> Result<()> {
        self.decode_with_scales(images, out).map(drop)
    }

    /// Like [`Self::decode_views`], but also returns the typical residual of each set, by axis.
    fn decode_with_scales(
        &self,
        images: &[ImageView<'_>],
        out: &mut Decoded,
    ) -> Result<Vec<Vec<RobustScale>>> {
        let deep = self.check(images)?;
        let full_scale: f32 = if deep { 65535.0 } else { 255.0 };
        self.shape(out);
        out.notes.clear();
        out.notes.extend(self.plan.notes.iter().cloned());
        let noise = self
            .noise
            .unwrap_or_else(|| match estimate_noise(&self.plan, images) {
                Some(noise) => {
                    out.notes.push(format!(
                        "noise estimated from the frames: {:.2} DN in the dark, gain {:.4} DN/e",
                        noise.variance_dn2(0.0).sqrt(),
                        noise.gain_dn_per_e
                    ));
                    noise
                }
                None => {
                    out.notes.push(
                        "the noise cannot be estimated from the frames: 1 DN is assumed".to_owned(),
                    );
                    NoiseModel {
                        gain_dn_per_e: 0.0,
                        read_noise_dn: (11.0f64 / 12.0).sqrt(),
                        black_level_dn: 0.0,
                        saturation_dn: f64::from(full_scale),
                    }
                }
            });
        out.noise = Some(noise);
        out.notes.extend(self.unweighted(&noise));
        let saturation = noise.saturation_dn.min(f64::from(full_scale)) as f32;
        let range = (saturation - noise.black_level_dn as f32).max(1.0);
        let scales = match deep {
            false => self.rows::<u8>(images, &noise, [saturation, range], out),
            true => self.rows::<u16>(images, &noise, [saturation, range], out),
        };
        self.stop.check()?;
        self.finish(LightNoise::new(&noise, range), out);
        self.stop.check()?;
        Ok(scales)
    }

    /// Returns the reason why steps are not weighted although the options ask for it.
    fn unweighted(&self, noise: &NoiseModel) -> Option<String> {
        let mut sets = self.kernels.iter().flat_map(|kernel| &kernel.sets);
        let why = if !self.options.weighted {
            return None;
        } else if !sets.any(SetKernel::weighs) {
            "no period has six or more equal steps"
        } else if noise.gain_dn_per_e <= 0.0 {
            "the camera's noise does not grow with the light"
        } else {
            return None;
        };
        Some(format!("all steps have equal weight: {why}"))
    }

    /// Checks the images and returns whether they have 16 bits per sample.
    fn check(&self, images: &[ImageView<'_>]) -> Result<bool> {
        if images.len() != self.plan.frames {
            return Err(Error::input(
                "frames",
                format!("{} frames", images.len()),
                format!(
                    "{} frames, one per pattern of the sequence",
                    self.plan.frames
                ),
            ));
        }
        let [width, height] = ImageView::common_size(images.iter().copied())?;
        if (width, height) != (self.width, self.height) {
            return Err(Error::input(
                "frames",
                format!("{width} x {height}"),
                format!("{} x {}", self.width, self.height),
            ));
        }
        for (i, image) in images.iter().enumerate() {
            if self.plan.uses(i) && image.is_empty() {
                return Err(Error::input(
                    format!("frame {i}"),
                    "no samples",
                    format!("{} x {} samples", self.width, self.height),
                ));
            }
        }
        Ok(images.iter().any(|image| image.bits() == 16))
    }

    /// Resizes the maps; every element is written later.
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
            map.unused_bits = 0;
        }
        out.modulation.resize(n, 0.0);
        out.intensity.resize(n, 0.0);
        let with_depth = if self.triangulator.is_some() { n } else { 0 };
        out.depth.resize(with_depth, 0.0);
        out.depth_sigma.resize(with_depth, 0.0);
    }

    /// Passes 2 to 4: checks against neighbours, unwrapping, correction and triangulation.
    fn finish(&self, light: LightNoise, out: &mut Decoded) {
        let held = [Axis::X, Axis::Y].map(|axis| {
            let table = self.held[axis as usize].as_ref()?;
            let map = out.axis(axis)?;
            let size = [self.width, self.height];
            held::Footprints::new(map, size, self.spacing, table)
        });
        if !self.options.keep_mixed {
            let finest = [Axis::X, Axis::Y].map(|axis| {
                let kernel = self.kernels.iter().find(|kernel| kernel.axis == axis);
                let set = kernel.and_then(|kernel| kernel.sets.first());
                Finest {
                    period: set.map_or(f32::INFINITY, |set| set.period * self.spacing),
                    model: set.map_or(0.0, SetKernel::model_variance),
                }
            });
            neighbours::clean(out, light, finest, &held);
        }
        if self.stop.is_asked() {
            return;
        }
        for (axis, map) in [(Axis::X, &mut out.x), (Axis::Y, &mut out.y)] {
            let Some(map) = map else { continue };
            let Some(period) = map.wrapped_px else {
                continue;
            };
            // Rounds the period for the message, for example to 66.67.
            let shown = (period * 100.0).round() / 100.0;
            out.notes.push(if self.options.unwrap_spatial {
                unwrap(self.width, &mut map.coordinate, &map.sigma, period as f32);
                format!(
                    "axis {axis} is unwrapped spatially: correct up to whole periods of {shown} px \
                     per connected region"
                )
            } else {
                format!(
                    "axis {axis} is known modulo {shown} px only: add a Gray code or a second \
                     period to resolve its periods, or use decode's --unwrap spatial, which is \
                     correct up to whole periods per connected region"
                )
            });
        }
        let mut notes = Vec::new();
        for (axis, footprints) in [Axis::X, Axis::Y].into_iter().zip(&held) {
            let Some(map) = out.axis_mut(axis) else {
                continue;
            };
            map.sampling.clear();
            notes.extend(note_of_loss(axis, map));
            let Some(footprints) = footprints else {
                continue;
            };
            // With an unknown order, the position within a projector pixel may be unknown too.
            let how = match map.wrapped_px {
                None => self.options.held,
                Some(_) => Held::State,
            };
            footprints.correct(map, self.width, how);
            notes.extend(footprints.note(axis, map));
        }
        out.notes.append(&mut notes);
        if self.stop.is_asked() {
            return;
        }
        if let Some(triangulator) = &self.triangulator {
            triangulate(triangulator, out);
        }
    }
}

/// Pass 3: writes the depth maps, row by row, from the axes whose fringe order is resolved.
fn triangulate(triangulator: &Triangulator, out: &mut Decoded) {
    let width = out.width;
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
            let used = [(x, use_x), (y, use_y)].map(|(map, on)| map.as_ref().filter(|_| on));
            let all = used.map(|map| map.map(|map| map.uncertainties(at.clone())));
            let [x, y] = std::array::from_fn(|k| {
                Some(CoordinateRow {
                    px: &used[k]?.coordinate[at.clone()],
                    sigma: all[k].as_ref()?,
                })
            });
            triangulate_row(triangulator, v, x, y, depth, sigma);
        });
}
