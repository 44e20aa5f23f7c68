//! Decodes every n-th pixel of every n-th row in 1/n^2 of the time, for applications that need only
//! some tens of thousands of points.
//!
//! A kept pixel sees the same scene along the same ray: pixel (u, v) of the sparse image is pixel
//! (n u, n v) of the camera, so focal lengths and principal point are divided by n (pixel centres
//! are at integers). Neighbours are n pixels apart, so more pixels border on a step; footprints do
//! not overlap, and the limit on a surface's slope within a footprint is unchanged.

use super::{Decoded, Decoder, Options};
use phasmid_core::error::Result;
use phasmid_geometry::{Lens, Rig, View};
use phasmid_pattern::{Image, Manifest};
use rayon::prelude::*;

/// Maximum distance in pixels between decoded pixels.
const MOST: usize = 4;

/// Decodes a subset of the pixels of a sequence's frames; reusable.
#[derive(Debug)]
pub struct SparseDecoder {
    decoder: Decoder,
    every: usize,
}

impl SparseDecoder {
    /// Prepares decoding of `width` x `height` images with the sparsest grid (every pixel, every
    /// second pixel of every second row, and so on) that keeps at least `least` pixels.
    ///
    /// # Errors
    /// Returns the errors of [`Decoder::new`].
    pub fn new(
        manifest: &Manifest,
        [width, height]: [usize; 2],
        rig: Option<&Rig>,
        options: Options,
        least: usize,
    ) -> Result<Self> {
        let left = |every: usize| (width / every) * (height / every);
        let every = (2..=MOST)
            .take_while(|every| left(*every) >= least)
            .last()
            .unwrap_or(1);
        let rig = rig.map(|rig| sparse(rig, every));
        let [width, height] = [width, height].map(|n| n.div_ceil(every));
        let decoder = Decoder::new(manifest, width, height, rig.as_ref(), options)?;
        Ok(Self {
            decoder: decoder.spaced(every),
            every,
        })
    }

    /// Returns the spacing of decoded pixels in columns and rows.
    pub fn every(&self) -> usize {
        self.every
    }

    /// Returns the decoder of the kept pixels; the size of its maps is the number of kept columns and
    /// rows.
    pub fn decoder(&self) -> &Decoder {
        &self.decoder
    }

    /// Decodes full images into maps of the kept pixels, which are reused.
    ///
    /// # Errors
    /// Returns the errors of [`Decoder::decode_into`].
    pub fn decode_into(&self, images: &[Image], out: &mut Decoded) -> Result<()> {
        if self.every == 1 {
            return self.decoder.decode_into(images, out);
        }
        let thin = images.par_iter().map(|image| image.thinned(self.every));
        self.decoder.decode_into(&thin.collect::<Vec<_>>(), out)
    }
}

/// Returns the rig of a camera that has only every n-th pixel of every n-th row.
fn sparse(rig: &Rig, every: usize) -> Rig {
    let lens = &rig.camera.lens;
    let n = every as f64;
    Rig {
        camera: View {
            lens: Lens {
                width_px: lens.width_px.div_ceil(every as u32),
                height_px: lens.height_px.div_ceil(every as u32),
                focal_px: lens.focal_px / n,
                principal_px: lens.principal_px / n,
                distortion: lens.distortion,
            },
            ..rig.camera
        },
        // The covariance refers to the original lens parameters.
        covariance: None,
        ..*rig
    }
}
