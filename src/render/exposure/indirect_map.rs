//! Settings of the gathering of indirect light, and the map that it fills.

use phasmid_profile::Interreflection;

/// Number of rays per gather point, and spacing of the gather points in pixels.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Gathering {
    pub(crate) samples: u32,
    pub(crate) step_px: u32,
}

impl Gathering {
    /// The settings of a scene, or defaults until its error bound has determined them.
    pub(crate) fn new(wanted: Interreflection) -> Self {
        Self {
            samples: wanted.samples.unwrap_or(64),
            step_px: wanted.step_px.unwrap_or(4),
        }
    }
}

/// Rays averaged together (SIMD block).
pub(crate) const BLOCK: usize = 8;

/// Indirect light, prepared for the exposure of frames.
#[derive(Debug, Clone, Default)]
pub(crate) struct InterreflectionMap {
    /// For each gather point, the end index of its blocks of rays.
    pub(crate) ends: Vec<u32>,
    /// Irradiance of each gather point in W/m^2 under full white.
    pub(crate) white: Vec<f32>,
    /// Projector coordinates of the rays' hits; zeros for padding rays. As in the maps, empty when
    /// no pattern varies along that axis.
    pub(crate) x: Vec<[f32; BLOCK]>,
    pub(crate) y: Vec<[f32; BLOCK]>,
    /// Derivatives of the coordinates along the two sides of each ray's patch of the hemisphere.
    pub(crate) x_slope: Vec<[[f32; 2]; BLOCK]>,
    pub(crate) y_slope: Vec<[[f32; 2]; BLOCK]>,
    /// Irradiance contributed by each ray under full white, in W/m^2.
    pub(crate) weight: Vec<[f32; BLOCK]>,
    /// For each pixel, the first of the four points it is interpolated from.
    pub(crate) first: Vec<u32>,
    /// Electrons per second that 1 W/m^2 at each of these four points contributes to the pixel.
    pub(crate) shares: Vec<[f32; 4]>,
    /// Points per grid row: the four are `first`, the next one, and those one row below.
    pub(crate) stride: usize,
}

impl InterreflectionMap {
    /// Interpolates a quantity given at the gather points for a pixel.
    #[inline(always)]
    pub(crate) fn at(&self, pixel: usize, points: &[f32]) -> f32 {
        let first = self.first[pixel] as usize;
        let [a, b, c, d] = self.shares[pixel];
        let (near, far) = (&points[first..], &points[first + self.stride..]);
        (a * near[0] + b * near[1]) + (c * far[0] + d * far[1])
    }

    /// Returns the number of points, including those past the end that [`Self::at`] may access.
    pub(crate) fn padded(&self) -> usize {
        self.ends.len() + self.stride + 2
    }
}
