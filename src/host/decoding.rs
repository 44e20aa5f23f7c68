//! Decoding of a capture.

use super::Captured;
use phasmid_core::error::Result;
use phasmid_decode::{Decoded, Decoder, FrameStack, Options, Samples};
use phasmid_protocol::PixelFormat;

impl Captured {
    /// Decodes the frames with the capture's calibration. Without one the result has projector
    /// coordinates but no points.
    ///
    /// # Errors
    /// Returns an error if the sequence does not determine a projector coordinate, or if the frames
    /// do not match it.
    pub fn decode(&self, options: Options) -> Result<(Decoder, Decoded)> {
        self.with_stack(|stack| {
            let rig = self.calibration.as_ref();
            let (width, height) = (stack.width(), stack.height());
            let decoder = Decoder::new(&self.manifest, width, height, rig, options)?;
            let decoded = decoder.decode(stack)?;
            Ok((decoder, decoded))
        })
    }

    /// Calls `then` with the frames as a stack, the form that decoders take.
    ///
    /// # Errors
    /// Returns the errors of `then`, and an error if there are no frames or they do not match each
    /// other.
    pub fn with_stack<T>(&self, then: impl FnOnce(&FrameStack<'_>) -> Result<T>) -> Result<T> {
        let (width, height) = self
            .frames
            .first()
            .map_or((0, 0), |f| (f.width as usize, f.height as usize));
        let wide: Vec<Vec<u16>> = self
            .frames
            .iter()
            .map(|frame| match frame.format {
                PixelFormat::Y16 => frame
                    .data
                    .chunks_exact(2)
                    .map(|b| u16::from_le_bytes([b[0], b[1]]))
                    .collect(),
                _ => Vec::new(),
            })
            .collect();
        let samples = self
            .frames
            .iter()
            .zip(&wide)
            .map(|(frame, wide)| match frame.format {
                PixelFormat::Y16 => Samples::U16(wide),
                _ => Samples::U8(&frame.data),
            })
            .collect();
        then(&FrameStack::new(width, height, samples)?)
    }
}
