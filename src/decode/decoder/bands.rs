//! Pass 1: decodes each row independently; bands of rows are the parallel tasks.

use super::Decoder;
use crate::maps::{AxisMap, Decoded, Verdict};
use crate::phase::RowNoise;
use crate::robust_scale::{RobustScale, Shared};
use crate::rows::{AxisKernel, AxisOut, BAND, Job, Scratch, decode_row};
use crate::sample::{Sample, typed};
use crate::unresolved::{UnresolvedBits, unresolved_bits};
use phasmid_core::error::Result;
use phasmid_geometry::NoiseModel;
use phasmid_pattern::{Image, ImageView};
use rayon::prelude::*;

impl Decoder {
    /// Decodes all rows (pass 1). Returns the typical residual of each set, by axis.
    pub(super) fn rows<T: Sample>(
        &self,
        images: &[ImageView<'_>],
        noise: &NoiseModel,
        [saturation, range]: [f32; 2],
        out: &mut Decoded,
    ) -> Vec<Vec<RobustScale>> {
        let frames: Vec<&[T]> = typed(images);
        let robust_scale = self.robust_scales(&frames, noise, saturation);
        let mut job = Job {
            frames: &frames,
            kernels: &self.kernels,
            robust_scale: &robust_scale,
            references: self.plan.references(),
            unused_bits: [0; 2],
            noise: RowNoise::new(noise),
            saturation,
            range,
            min_modulation: self.options.min_modulation_dn,
            min_contrast: self.options.min_contrast,
            max_phase_sigma: self.options.max_phase_sigma_rad,
            width: self.width,
        };
        self.pass(&job, out);
        let of_axis = |kernel| unresolved_bits(&job, kernel, out.axis(kernel.axis)?);
        let found: Vec<_> = self.kernels.iter().filter_map(of_axis).collect();
        if found.is_empty() {
            return robust_scale;
        }
        for bits in &found {
            job.unused_bits[bits.axis as usize] = bits.count;
        }
        self.pass(&job, out);
        let explains =
            |bits: &UnresolvedBits| out.axis(bits.axis).is_some_and(|map| bits.explain(map));
        let (kept, used): (Vec<_>, Vec<_>) = found.into_iter().partition(explains);
        out.notes.extend(kept.iter().map(UnresolvedBits::note));
        for bits in kept {
            if let Some(map) = out.axis_mut(bits.axis) {
                map.unused_bits = bits.count;
            }
        }
        if !used.is_empty() {
            for bits in used {
                job.unused_bits[bits.axis as usize] = 0;
            }
            self.pass(&job, out);
        }
        robust_scale
    }

    /// Decodes images, and returns the common part of each set's residuals, by axis.
    pub(crate) fn decode_with_shared(
        &self,
        images: &[Image],
    ) -> Result<(Decoded, Vec<Vec<Option<Shared>>>)> {
        let views: Vec<_> = images.iter().map(Image::view).collect();
        let mut decoded = Decoded::default();
        let scales = self.decode_with_scales(&views, &mut decoded)?;
        let of_axis = |(kernel, scales): (&AxisKernel, &Vec<RobustScale>)| {
            let sets = kernel.sets.iter().zip(scales);
            sets.map(|(set, scale)| scale.shared(set)).collect()
        };
        let shared = self.kernels.iter().zip(&scales).map(of_axis).collect();
        Ok((decoded, shared))
    }

    /// The typical residual of each set, by axis.
    fn robust_scales<T: Sample>(
        &self,
        frames: &[&[T]],
        noise: &NoiseModel,
        saturation: f32,
    ) -> Vec<Vec<RobustScale>> {
        let of_axis = |kernel: &AxisKernel| {
            let sets = &kernel.sets;
            let of = |set| RobustScale::of(sets, set, frames, noise, saturation, &self.options);
            sets.par_iter().map(of).collect()
        };
        self.kernels.par_iter().map(of_axis).collect()
    }

    /// Decodes all rows once.
    fn pass<T: Sample>(&self, job: &Job<'_, T>, out: &mut Decoded) {
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
                if self.stop.is_asked() {
                    return;
                }
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
                    decode_row(job, *first + k, scratch, outs, modulation, intensity);
                }
            },
        );
    }
}

/// Splits the three vectors of a map into chunks of `size` pixels, and iterates over matching chunks.
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
