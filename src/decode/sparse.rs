//! A decoder of every n'th pixel of every n'th row, for applications that need some tens of thousands
//! of points and not all that a camera gives: it takes the n-squared part of the time.
//!
//! A pixel that is left sees what it saw, along the same ray: pixel (u, v) of the sparse image is pixel
//! (n u, n v) of the camera, so that a lens has an n'th of its focal lengths and of its principal point
//! (pixels are counted from their centres). Neighbours are n pixels apart, so that more pixels border on
//! a step; their footprints do not overlap, and how steep a surface may be for a footprint is what it was.

use super::{Decoded, Decoder, FrameStack, Options, Samples};
use phasmid_core::error::Result;
use phasmid_geometry::{Lens, Rig, View};
use phasmid_pattern::Manifest;
use rayon::prelude::*;

/// Most pixels from one that is decoded to the next.
const MOST: usize = 4;

/// Decodes some of the pixels of one sequence's frames, again and again.
#[derive(Debug)]
pub struct SparseDecoder {
    decoder: Decoder,
    every: usize,
}

impl SparseDecoder {
    /// Prepares the decoding of as few pixels of `width` x `height` images as leave at least `least` of
    /// them: all, every second of every second row, and so on.
    ///
    /// # Errors
    /// What [`Decoder::new`] refuses.
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

    /// Every how manyth pixel is decoded.
    pub fn every(&self) -> usize {
        self.every
    }

    /// The decoder of the pixels that are left, whose maps have as many columns and rows as those.
    pub fn decoder(&self) -> &Decoder {
        &self.decoder
    }

    /// Decodes whole frames into maps of the pixels that are left, which are used again.
    ///
    /// # Errors
    /// What [`Decoder::decode_into`] refuses.
    pub fn decode_into(&self, stack: &FrameStack<'_>, out: &mut Decoded) -> Result<()> {
        if self.every == 1 {
            return self.decoder.decode_into(stack, out);
        }
        let (width, every) = (stack.width(), self.every);
        match stack.frames() {
            [Samples::U8(_), ..] => {
                let typed = stack.typed::<u8>().unwrap_or_default();
                self.of(stack, &taken(&typed, width, every), Samples::U8, out)
            }
            _ => {
                let typed = stack.typed::<u16>().unwrap_or_default();
                self.of(stack, &taken(&typed, width, every), Samples::U16, out)
            }
        }
    }

    fn of<'a, T>(
        &self,
        stack: &FrameStack<'_>,
        frames: &'a [Vec<T>],
        samples: fn(&'a [T]) -> Samples<'a>,
        out: &mut Decoded,
    ) -> Result<()> {
        let [width, height] = [stack.width(), stack.height()].map(|n| n.div_ceil(self.every));
        let samples = frames.iter().map(|frame| samples(frame)).collect();
        self.decoder
            .decode_into(&FrameStack::new(width, height, samples)?, out)
    }
}

/// Every so manyth pixel of every so manyth row of each frame.
fn taken<T: Copy + Send + Sync>(frames: &[&[T]], width: usize, every: usize) -> Vec<Vec<T>> {
    let of = |frame: &&[T]| {
        let mut some = Vec::with_capacity(frame.len() / (every * every) + width);
        for row in frame.chunks_exact(width.max(1)).step_by(every) {
            some.extend(row.chunks(every).map(|pixels| pixels[0]));
        }
        some
    };
    frames.par_iter().map(of).collect()
}

/// A rig whose camera has every so manyth pixel.
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
        ..*rig
    }
}
