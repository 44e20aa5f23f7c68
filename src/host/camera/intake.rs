//! Converts the frames of every opened camera to GREY or Y16, and removes the embedded data line.

use super::Camera;
use phasmid_core::error::{Error, Result};
use phasmid_protocol::data_line::{self, Found};
use phasmid_protocol::{Frame, PixelFormat};
use std::time::Duration;

/// A camera whose frames are GREY or Y16, without the embedded data line. The contents of the line
/// become the frame's id, pattern index and exposure times.
pub struct Intake<C> {
    camera: C,
    /// A valid data line has been seen. From now on a frame without a valid data line counts as
    /// damaged.
    lined: bool,
    skipped: bool,
}

impl<C: Camera> Intake<C> {
    /// Wraps a camera.
    pub fn new(camera: C) -> Self {
        Self {
            camera,
            lined: false,
            skipped: false,
        }
    }
}

impl<C: Camera> Camera for Intake<C> {
    fn info(&self) -> &str {
        self.camera.info()
    }

    fn next_frame(&mut self, timeout: Duration) -> Result<Option<Frame>> {
        self.skipped = false;
        let Some(frame) = self.camera.next_frame(timeout)? else {
            return Ok(None);
        };
        let need = frame.format.frame_bytes(frame.width, frame.height);
        let odd = frame.format == PixelFormat::Yuyv && frame.width % 2 == 1;
        if frame.data.len() != need || odd {
            self.skipped = true;
            return Err(Error::device(format!(
                "{}: a frame of {} x {} {:?} with {} bytes, expected {need}",
                self.info(),
                frame.width,
                frame.height,
                frame.format,
                frame.data.len()
            )));
        }
        let (frame, found) = data_line::strip(frame.into_luma());
        self.lined |= found == Found::Line;
        if self.lined && found != Found::Line {
            self.skipped = true;
            return Err(Error::device(format!(
                "{}: a frame's embedded data line is {}",
                self.info(),
                if found == Found::Damaged {
                    "damaged"
                } else {
                    "missing"
                }
            )));
        }
        Ok(Some(frame))
    }

    fn has_skipped(&self) -> bool {
        self.skipped || self.camera.has_skipped()
    }

    fn identifies(&self) -> bool {
        self.lined || self.camera.identifies()
    }

    fn has_gone(&self) -> bool {
        self.camera.has_gone()
    }

    fn reopen(&mut self, timeout: Duration) -> Result<()> {
        self.lined = false;
        self.camera.reopen(timeout)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::MemoryCamera;

    fn bare(id: u64) -> Frame {
        Frame {
            id,
            pattern_index: Some(id as u32),
            width: 300,
            height: 2,
            format: PixelFormat::Grey,
            exposure_start_ns: 10 * id,
            exposure_end_ns: 10 * id + 5,
            data: (0..600).map(|i| (i * 7 + id) as u8).collect(),
        }
    }

    /// Returns a frame as received over a link that carries no frame identity: id and times are those
    /// that such a link sets, not the device's.
    fn sent(id: u64) -> Frame {
        Frame {
            id: 99,
            pattern_index: None,
            exposure_start_ns: 1,
            exposure_end_ns: 1,
            ..data_line::prepend(bare(id), 255).into_yuyv()
        }
    }

    #[test]
    fn the_line_names_the_frame_and_a_damaged_one_is_skipped() {
        let memory = MemoryCamera::default();
        let mut camera = Intake::new(memory.clone());
        let mut torn = sent(4);
        torn.data[2 * 100] ^= 0xFF;
        let mut cut = sent(5);
        cut.data.truncate(600);
        for frame in [sent(3), torn, bare(4).into_yuyv(), cut, sent(6)] {
            memory.put(frame);
        }
        let mut next = || {
            let frame = camera.next_frame(Duration::ZERO);
            (frame.map_err(|e| e.to_string()), camera.has_skipped())
        };
        assert_eq!(next(), (Ok(Some(bare(3))), false));
        for what in ["is damaged", "is missing", "600 bytes, expected 1800"] {
            let (frame, skipped) = next();
            assert!(frame.unwrap_err().contains(what) && skipped, "{what}");
        }
        assert_eq!(next(), (Ok(Some(bare(6))), false));
        assert_eq!(next(), (Ok(None), false));
    }
}
