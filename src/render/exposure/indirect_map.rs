//! Settings for gathering indirect light, and the map that stores the result.

use phasmid_profile::Interreflection;

/// Number of rays per gather point, and spacing of the gather points in pixels.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Gathering {
    pub(crate) samples: u32,
    pub(crate) step_px: u32,
}

impl Gathering {
    /// Returns the settings of a scene. For settings that the scene leaves open, returns defaults,
    /// which are used until the error bound of the scene has determined them.
    pub(crate) fn new(wanted: Interreflection) -> Self {
        Self {
            samples: wanted.samples.unwrap_or(64),
            step_px: wanted.step_px.unwrap_or(4),
        }
    }
}

/// Number of rays that are averaged together (one SIMD block).
pub(crate) const BLOCK: usize = 8;

/// Indirect light between surfaces, prepared for the exposure of frames.
#[derive(Debug, Clone, Default)]
pub(crate) struct InterreflectionMap {
    /// For each gather point, the end index of its blocks of rays.
    pub(crate) ends: Vec<u32>,
    /// Irradiance of each gather point in W/m^2 under full white.
    pub(crate) white: Vec<f32>,
    /// Projector coordinates of the points that the rays hit; zeros for padding rays. Empty if no
    /// pattern varies along that axis.
    pub(crate) x: Vec<[f32; BLOCK]>,
    pub(crate) y: Vec<[f32; BLOCK]>,
    /// Derivatives of the coordinates along the two sides of the patch of the hemisphere that each
    /// ray represents.
    pub(crate) x_slope: Vec<[[f32; 2]; BLOCK]>,
    pub(crate) y_slope: Vec<[[f32; 2]; BLOCK]>,
    /// Irradiance contributed by each ray under full white, in W/m^2.
    pub(crate) weight: Vec<[f32; BLOCK]>,
    /// Irradiance of each gather point by the indirect light of lamps in W/m^2, and its flicker
    /// amplitude.
    pub(crate) lamps: Vec<[f32; 2]>,
    /// For each pixel, the index of the first of the four gather points from which its light is
    /// interpolated.
    pub(crate) first: Vec<u32>,
    /// For each pixel, the electrons per second that 1 W/m^2 at each of these four gather points
    /// contributes.
    pub(crate) shares: Vec<[f32; 4]>,
    /// Number of gather points per row of their grid. The four points of a pixel are `first`, the
    /// next one, and the two below them in the next row.
    pub(crate) stride: usize,
}

impl InterreflectionMap {
    /// Interpolates a quantity that is given at the gather points, for one pixel.
    #[inline(always)]
    pub(crate) fn at(&self, pixel: usize, points: &[f32]) -> f32 {
        let first = self.first[pixel] as usize;
        let [a, b, c, d] = self.shares[pixel];
        let (near, far) = (&points[first..], &points[first + self.stride..]);
        (a * near[0] + b * near[1]) + (c * far[0] + d * far[1])
    }

    /// Appends gather points.
    pub(crate) fn append(&mut self, more: Self) {
        let from = self.weight.len() as u32;
        self.ends.extend(more.ends.iter().map(|end| from + end));
        self.white.extend(more.white);
        self.x.extend(more.x);
        self.y.extend(more.y);
        self.x_slope.extend(more.x_slope);
        self.y_slope.extend(more.y_slope);
        self.weight.extend(more.weight);
        self.lamps.extend(more.lamps);
    }

    /// Returns the size in bytes with patterns along both axes.
    pub(crate) fn bytes(&self) -> usize {
        let pixels = self.first.len() * size_of::<[f32; 5]>();
        pixels + self.weight.len() * BLOCK * size_of::<[f32; 7]>()
    }

    /// Returns the number of gather points, including padding past the end that [`Self::at`] may
    /// access.
    pub(crate) fn padded(&self) -> usize {
        self.ends.len() + self.stride + 2
    }
}
