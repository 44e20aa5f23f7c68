//! Grey levels from anywhere, as a link would have brought them.

use super::consistency::{check, doubt};
use phasmid_decode::{FrameStack, Samples};
use phasmid_pattern::Manifest;
use phasmid_protocol::{Frame, PixelFormat};

/// A frame of so many columns and rows, with what it says of itself but its times: its place in the
/// sequence.
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

/// Whether pictures follow their sequence, as far as they tell. A sequence some of whose pictures
/// nobody loaded, for no decoder needs them, cannot be checked and passes.
///
/// # Errors
/// How they depart from the sequence.
pub fn check_pictures(manifest: &Manifest, stack: &FrameStack<'_>) -> Result<(), String> {
    frames_of(stack).map_or(Ok(()), |frames| check(manifest, &frames))
}

/// What a user should know of pictures that follow their sequence.
pub fn doubt_pictures(manifest: &Manifest, stack: &FrameStack<'_>) -> Option<String> {
    doubt(manifest, &frames_of(stack)?)
}

/// Frames of all pictures, if all were loaded.
fn frames_of(stack: &FrameStack<'_>) -> Option<Vec<Frame>> {
    let size = (stack.width(), stack.height());
    let there = |(place, samples): (usize, &Samples<'_>)| {
        (!samples.is_empty()).then(|| frame_of(samples, size, place))
    };
    stack.frames().iter().enumerate().map(there).collect()
}
