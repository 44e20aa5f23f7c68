//! Output of the geometry pass: one value per pixel and quantity.

use super::indirect_map::InterreflectionMap;
use super::kernel::{Blurred, Kernels, KeyFootprint, KeyKernels};
use super::skin_maps::{Samples, SkinMaps};
use crate::scene::Surface;
use crate::{Plan, Term};
use phasmid_pattern::Axis;
use rayon::prelude::*;
use std::sync::Arc;

/// Maps over the camera's pixels in row-major order, and the samples of mixed pixels.
#[derive(Debug, Clone, Default)]
pub(crate) struct GeometryBuffer {
    pub(crate) width: usize,
    pub(crate) height: usize,
    /// Projector column (x) that lights the pixel's centre, in projector pixels; NaN if missing.
    pub(crate) x: Vec<f32>,
    pub(crate) y: Vec<f32>,
    /// Derivatives of x with respect to camera column and row; empty if no pattern varies along x.
    pub(crate) x_slope: Vec<[f32; 2]>,
    /// Derivatives of y with respect to camera column and row; empty if no pattern varies along y.
    pub(crate) y_slope: Vec<[f32; 2]>,
    /// Electrons per second from the projector at full white; 0 where its light does not arrive.
    pub(crate) projected: Vec<f32>,
    /// Electrons per second from ambient light.
    pub(crate) ambient: Vec<f32>,
    /// Flicker amplitude of the ambient light in electrons per second; empty if all light is steady.
    pub(crate) flickering: Vec<f32>,
    /// One bit for each lamp, set if the lamp lights the pixel's centre; empty without lamps.
    pub(crate) lamps: Vec<u32>,
    /// Depth z in the camera's frame in millimetres; NaN where no surface is visible.
    pub(crate) depth: Vec<f32>,
    /// Surface that the pixel's centre sees.
    pub(crate) surface: Vec<u32>,
    /// Unit normal of that surface, on the side of the camera.
    pub(crate) normal: Vec<[f32; 3]>,
    /// Standard deviation of the projector's blur along x in projector pixels; empty without
    /// defocus.
    pub(crate) blur: Vec<f32>,
    /// Ratio of the blur along y to the blur along x, minus 1: 0 if projector pixels are square.
    pub(crate) blur_stretch: f32,
    /// Electrons per second per W/m^2 of uniform ambient light; empty without interreflection.
    pub(crate) evenly: Vec<f32>,
    /// Indirect light between surfaces; empty without interreflection.
    pub(crate) interreflection: InterreflectionMap,
    /// Weights of the pattern's columns (x) and rows (y) in each blurred footprint: first for the
    /// footprint of each pixel, then for the sixteen samples of each mixed pixel. `None` without
    /// defocus and skin, or if no pattern varies along that axis.
    pub(crate) kernels: [Option<Arc<Kernels>>; 2],
    /// Where light enters the skin, and how it spreads under it; `None` without skin.
    pub(crate) skin: Option<SkinMaps>,
    /// Flags such as `Truth::SEEN`.
    pub(crate) flags: Vec<u8>,
    /// Samples of the mixed pixels, whose footprints cover more than one surface, in pixel order.
    pub(crate) mixed: Vec<Mixed>,
}

/// Sixteen samples of a mixed pixel's footprint. A pixel with more samples has several consecutive
/// entries, whose electrons are summed.
#[derive(Debug, Clone)]
pub(crate) struct Mixed {
    /// Row-major pixel index.
    pub(crate) pixel: u32,
    pub(crate) x: [f32; 16],
    pub(crate) y: [f32; 16],
    pub(crate) x_slope: [[f32; 2]; 16],
    pub(crate) y_slope: [[f32; 2]; 16],
    /// Electrons per second from the projector at full white; 0 for unlit samples.
    pub(crate) projected: [f32; 16],
    /// Electrons per second from ambient light, averaged over the samples.
    pub(crate) ambient: f32,
    /// Flicker amplitude of the ambient light in electrons per second, averaged over the samples.
    pub(crate) flickering: f32,
    /// Blur of each sample, as in [`GeometryBuffer::blur`]; 0 without defocus.
    pub(crate) blur: [f32; 16],
    /// Spread of light under skin at each sample; `None` if no sample is on skin.
    pub(crate) skin: Option<Box<Samples>>,
}

impl Mixed {
    /// Creates an entry whose samples see no surface.
    pub(crate) fn new(pixel: u32) -> Self {
        Self {
            pixel,
            x: [0.0; 16],
            y: [0.0; 16],
            x_slope: [[0.0; 2]; 16],
            y_slope: [[0.0; 2]; 16],
            projected: [0.0; 16],
            ambient: 0.0,
            flickering: 0.0,
            blur: [0.0; 16],
            skin: None,
        }
    }
}

/// Pixels and samples whose levels under blur are interpolated between the levels at key instants.
pub(crate) struct KeyLevels<'a> {
    pub(crate) keys: [&'a GeometryBuffer; 3],
    /// Weights of the levels at the key instants, for each row of the camera.
    pub(crate) weights: Vec<[f32; 3]>,
    /// One value per pixel; bit 0 is set if levels along x are interpolated, bit 1 along y.
    pub(crate) along: &'a [u8],
    /// Indices, in the key instants' lists, of the mixed pixels whose levels are interpolated, for x and
    /// for y; one entry per mixed pixel.
    pub(crate) mixed: [Vec<Option<[u32; 3]>>; 2],
}

impl KeyLevels<'_> {
    /// Returns the kernels along an axis; `None` if a key instant has none.
    fn kernels(&self, axis: usize) -> Option<KeyKernels> {
        let [a, b, c] = self.keys.map(|key| key.kernels[axis].clone());
        Some(KeyKernels {
            kernels: [a?, b?, c?],
            weights: self.weights.clone(),
        })
    }

    /// Returns the indices of a footprint's kernels along an axis at the key instants; `None` if its
    /// level is not interpolated. Footprints are numbered as in [`GeometryBuffer::kernels`].
    fn indices(&self, axis: usize, footprint: usize) -> Option<[u32; 3]> {
        let pixels = self.along.len();
        match self.along.get(footprint) {
            Some(along) => (along >> axis & 1 != 0).then_some([footprint as u32; 3]),
            None => {
                let (mixed, sample) = ((footprint - pixels) / 16, (footprint - pixels) % 16);
                let indices = self.mixed[axis][mixed]?;
                Some(indices.map(|index| (pixels + sample) as u32 + 16 * index))
            }
        }
    }
}

/// A band of rows of the maps, which one task fills.
pub(crate) struct Band<'a> {
    pub(crate) first_row: usize,
    /// Number of rows of each band; the last band may have fewer.
    pub(crate) rows: usize,
    pub(crate) x: &'a mut [f32],
    pub(crate) y: &'a mut [f32],
    pub(crate) x_slope: &'a mut [[f32; 2]],
    pub(crate) y_slope: &'a mut [[f32; 2]],
    pub(crate) projected: &'a mut [f32],
    pub(crate) ambient: &'a mut [f32],
    pub(crate) flickering: &'a mut [f32],
    pub(crate) lamps: &'a mut [u32],
    pub(crate) depth: &'a mut [f32],
    pub(crate) surface: &'a mut [u32],
    pub(crate) normal: &'a mut [[f32; 3]],
    pub(crate) blur: &'a mut [f32],
    pub(crate) evenly: &'a mut [f32],
    pub(crate) flags: &'a mut [u8],
}

impl GeometryBuffer {
    /// Resizes the maps and allocates the maps that the plan needs. Previous contents are lost.
    pub(crate) fn resize(&mut self, width: usize, height: usize, plan: &Plan) {
        let n = width * height;
        (self.width, self.height) = (width, height);
        self.x.resize(n, f32::NAN);
        self.y.resize(n, f32::NAN);
        self.x_slope
            .resize(if plan.has(Term::FootprintX) { n } else { 0 }, [0.0; 2]);
        self.y_slope
            .resize(if plan.has(Term::FootprintY) { n } else { 0 }, [0.0; 2]);
        self.projected.resize(n, 0.0);
        self.ambient.resize(n, 0.0);
        self.flickering
            .resize(if plan.has(Term::Flicker) { n } else { 0 }, 0.0);
        self.lamps
            .resize(if plan.has(Term::Lights) { n } else { 0 }, 0);
        self.depth.resize(n, f32::NAN);
        self.surface.resize(n, Surface::NONE.0);
        self.normal.resize(n, [0.0; 3]);
        self.blur.resize(
            if plan.has(Term::ProjectorDefocus) {
                n
            } else {
                0
            },
            0.0,
        );
        let bounces = plan.has(Term::Interreflection);
        self.evenly.resize(if bounces { n } else { 0 }, 0.0);
        self.interreflection = InterreflectionMap::default();
        self.kernels = [None, None];
        self.skin = None;
        self.flags.resize(n, 0);
        self.mixed.clear();
    }

    /// Splits the maps into bands of `rows` rows each.
    pub(crate) fn bands(&mut self, rows: usize) -> Vec<Band<'_>> {
        let n = rows * self.width;
        let (mut xs, mut ys) = (self.x_slope.chunks_mut(n), self.y_slope.chunks_mut(n));
        let mut y = self.y.chunks_mut(n);
        let mut projected = self.projected.chunks_mut(n);
        let mut ambient = self.ambient.chunks_mut(n);
        let mut flickering = self.flickering.chunks_mut(n);
        let mut lamps = self.lamps.chunks_mut(n);
        let mut depth = self.depth.chunks_mut(n);
        let mut surface = self.surface.chunks_mut(n);
        let mut normal = self.normal.chunks_mut(n);
        let mut blur = self.blur.chunks_mut(n);
        let mut evenly = self.evenly.chunks_mut(n);
        let mut flags = self.flags.chunks_mut(n);
        let same = "all maps have one length";
        self.x
            .chunks_mut(n)
            .enumerate()
            .map(|(i, x)| Band {
                first_row: i * rows,
                rows,
                x,
                y: y.next().expect(same),
                x_slope: xs.next().unwrap_or_default(),
                y_slope: ys.next().unwrap_or_default(),
                projected: projected.next().expect(same),
                ambient: ambient.next().expect(same),
                flickering: flickering.next().unwrap_or_default(),
                lamps: lamps.next().unwrap_or_default(),
                depth: depth.next().expect(same),
                surface: surface.next().expect(same),
                normal: normal.next().expect(same),
                blur: blur.next().unwrap_or_default(),
                evenly: evenly.next().unwrap_or_default(),
                flags: flags.next().expect(same),
            })
            .collect()
    }
}

impl GeometryBuffer {
    /// Returns the projector's blur along x and along y, given the blur along x.
    pub(crate) fn blur_along(&self, blur: f32) -> [f32; 2] {
        [blur, blur * (1.0 + self.blur_stretch)]
    }

    /// Returns, for each pixel, the projector coordinate along an axis at which the pixel's light
    /// comes from the projector.
    pub(crate) fn lit_from(&self, axis: Axis) -> &[f32] {
        match (&self.skin, axis) {
            (Some(skin), Axis::X) => &skin.from[0],
            (Some(skin), Axis::Y) => &skin.from[1],
            (None, Axis::X) => &self.x,
            (None, Axis::Y) => &self.y,
        }
    }

    /// Estimates the size of maps and kernels in bytes, with patterns along both axes.
    pub(crate) fn bytes(&self) -> usize {
        /// Size of the maps per pixel.
        const MAPS: usize = 120;
        // A kernel reaches some four standard deviations to either side; wide ones have groups.
        let of_kernel = |i: usize| -> usize {
            let of_skin = |axis: usize| {
                let spread = self.skin.as_ref().and_then(|skin| skin.spread(i, axis));
                spread.map_or(0.0, |spread| spread.widest_px())
            };
            let blur = self.blur_along(self.blur.get(i).copied().unwrap_or(0.0));
            let sigma = [0, 1].map(|axis| of_skin(axis).hypot(blur[axis]).min(64.0));
            let weights = |sigma: f32| {
                if sigma > 0.0 { 8.0 * sigma + 12.0 } else { 0.0 }
            };
            32 + size_of::<f32>() * (weights(sigma[0]) + weights(sigma[1])) as usize
        };
        let pixels: usize = (0..self.x.len()).into_par_iter().map(of_kernel).sum();
        let of_mixed = |mixed: &Mixed| {
            let own = size_of::<Mixed>() + size_of::<Samples>();
            own + 16 * of_kernel(mixed.pixel as usize)
        };
        let mixed: usize = self.mixed.par_iter().map(of_mixed).sum();
        MAPS * self.x.len() + pixels + mixed + self.interreflection.bytes()
    }

    /// Computes the blur kernels that the plan needs, for a pattern with `size` columns and rows.
    /// Footprints whose levels are interpolated get none.
    pub(crate) fn blur_footprints(
        &mut self,
        size: [usize; 2],
        plan: &Plan,
        levels: Option<&KeyLevels<'_>>,
    ) {
        if !plan.has(Term::ProjectorDefocus) && !plan.has(Term::Subsurface) {
            return;
        }
        let n = self.x.len();
        let kernels = std::array::from_fn(|axis| {
            plan.has([Term::FootprintX, Term::FootprintY][axis])
                .then(|| {
                    let keys = levels.and_then(|levels| levels.kernels(axis));
                    let between = |i: usize| {
                        let indices = levels?.indices(axis, i)?;
                        let pixel = i
                            .checked_sub(n)
                            .map_or(i, |sample| self.mixed[sample / 16].pixel as usize);
                        let row = (pixel / self.width) as u32;
                        Some(KeyFootprint { indices, row })
                    };
                    let count = n + 16 * self.mixed.len();
                    let footprint = |i| self.footprint(axis, i);
                    let kernels = Kernels::new(count, size[axis], keys, between, footprint);
                    Arc::new(kernels)
                })
        });
        self.kernels = kernels;
    }

    /// Returns the footprint with index `i` along an axis; numbered as in [`GeometryBuffer::kernels`].
    #[inline(always)]
    pub(crate) fn footprint(&self, axis: usize, i: usize) -> Blurred<'_> {
        if let Some(sample) = i.checked_sub(self.x.len()) {
            return self.footprint_of_sample(axis, &self.mixed[sample / 16], sample % 16);
        }
        let (x, slope) = match axis {
            0 => (self.lit_from(Axis::X)[i], self.x_slope[i]),
            _ => (self.lit_from(Axis::Y)[i], self.y_slope[i]),
        };
        let lit = self.projected[i] > 0.0;
        let blur = self.blur.get(i).filter(|_| lit).copied().unwrap_or(0.0);
        let skin = self.skin.as_ref();
        Blurred {
            x,
            slope,
            sigma: self.blur_along(blur)[axis],
            spread: skin.and_then(|skin| skin.spread(i, axis)),
        }
    }

    /// Returns the footprint of a sample of a mixed pixel along an axis.
    pub(crate) fn footprint_of_sample(&self, axis: usize, mixed: &Mixed, k: usize) -> Blurred<'_> {
        let (x, slope) = match axis {
            0 => (mixed.x[k], mixed.x_slope[k]),
            _ => (mixed.y[k], mixed.y_slope[k]),
        };
        let lit = mixed.projected[k] > 0.0;
        let blur = if lit { mixed.blur[k] } else { 0.0 };
        let samples = mixed.skin.as_ref().filter(|_| lit);
        let skin = self.skin.as_ref().zip(samples);
        Blurred {
            x,
            slope,
            sigma: self.blur_along(blur)[axis],
            spread: skin.and_then(|(skin, samples)| skin.sample(samples, k, axis)),
        }
    }
}
