//! Conversion of loaded images to frames, as a device would have sent them, and their checks.

use super::consistency::{check, doubt};
use phasmid_decode::{FrameStack, Samples};
use phasmid_pattern::Manifest;
use phasmid_protocol::{Frame, PixelFormat};

/// Builds a frame of the given width and height from grey levels. `place` becomes its id and
/// pattern index; the exposure times are 0.
pub fn frame_of(samples: &Samples<'_>, (width, height): (usize, usize), place: usize) -> Frame {
    let (format, data) = match samples {
        Samples::U8(levels) => (PixelFormat::Grey, levels.to_vec()),
        Samples::U16(levels) => {
            let bytes = levels.iter().flat_map(|level| level.to_le_bytes());
            (PixelFormat::Y16, bytes.collect())
        }
    };
    Frame {
        id: place as u64,
        pattern_index: Some(place as u32),
        width: width as u32,
        height: height as u32,
        format,
        exposure_start_ns: 0,
        exposure_end_ns: 0,
        data,
    }
}

/// Checks, as far as the images allow, that they follow their sequence. A sequence passes unchecked
/// if some of its images were not loaded because no decoder needs them.
///
/// # Errors
/// Returns a description of how they depart from the sequence.
pub fn check_images(manifest: &Manifest, stack: &FrameStack<'_>) -> Result<(), String> {
    frames_of(stack).map_or(Ok(()), |frames| check(manifest, &frames))
}

/// Returns a warning about images that follow their sequence, if there is one.
pub fn doubt_images(manifest: &Manifest, stack: &FrameStack<'_>) -> Option<String> {
    doubt(manifest, &frames_of(stack)?)
}

/// Converts all images to frames; `None` if some were not loaded.
fn frames_of(stack: &FrameStack<'_>) -> Option<Vec<Frame>> {
    let size = (stack.width(), stack.height());
    let there = |(place, samples): (usize, &Samples<'_>)| {
        (!samples.is_empty()).then(|| frame_of(samples, size, place))
    };
    stack.frames().iter().enumerate().map(there).collect()
}
