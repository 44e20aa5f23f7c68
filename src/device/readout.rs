//! Readout: converts a rendered frame to the frame that the camera sends. Crops the frame to the
//! region, prepends the embedded data line and packs the pixels in the link's format.

use super::{Roi, Shot, Stream};
use phasmid_protocol::{Frame, PixelFormat, data_line};

/// A shot and the parameters of its readout.
#[derive(Debug, Clone, PartialEq)]
pub struct Exposure {
    /// Input of the optics.
    pub shot: Shot,
    /// Conversion of the rendered frame to the frame that the camera sends.
    pub readout: Readout,
}

/// Parameters of the readout.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Readout {
    /// Region of the sensor.
    pub roi: Roi,
    /// Pixel format, which the sensor must support; YUYV requires a region of even width.
    pub format: PixelFormat,
    /// Full-scale value of the sensor if the frame gets an embedded data line; `None` if it does
    /// not.
    pub data_line: Option<u16>,
}

impl Readout {
    /// Converts a frame of the whole sensor in its native format to what the camera sends.
    pub fn read(&self, frame: Frame) -> Frame {
        let mut frame = self.roi.crop(frame);
        if self.format == PixelFormat::Yuyv {
            frame = frame.into_yuyv();
        }
        if let Some(full_scale_dn) = self.data_line {
            frame = data_line::prepend(frame, full_scale_dn);
        }
        frame.into_depth(self.format)
    }

    /// Returns the stream format of the frames that the camera sends, with this frame interval.
    pub fn stream(&self, interval_ns: u64) -> Stream {
        Stream {
            width: self.roi.width,
            height: self.roi.height + u32::from(self.data_line.is_some()),
            format: self.format,
            interval_ns,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use phasmid_protocol::data_line::{Found, strip};

    fn rendered() -> Frame {
        Frame {
            id: 7,
            pattern_index: Some(3),
            width: 300,
            height: 4,
            format: PixelFormat::Grey,
            exposure_start_ns: 1000,
            exposure_end_ns: 1500,
            data: (0..1200u32).map(|i| (i % 251) as u8).collect(),
        }
    }

    fn readout(format: PixelFormat, line: bool) -> Readout {
        Readout {
            roi: Roi {
                x: 9,
                y: 1,
                width: 260,
                height: 2,
            },
            format,
            data_line: line.then_some(255),
        }
    }

    #[test]
    fn the_line_lies_above_the_region_in_the_link_s_format() {
        let region = readout(PixelFormat::Grey, false).read(rendered());
        assert_eq!((region.width, region.height), (260, 2));
        assert_eq!(region.data[0], ((300 + 9) % 251) as u8);
        for format in [PixelFormat::Grey, PixelFormat::Yuyv] {
            for line in [false, true] {
                let readout = readout(format, line);
                let frame = readout.read(rendered());
                let stream = readout.stream(1);
                assert_eq!(
                    (stream.width, stream.height, stream.format),
                    (frame.width, frame.height, frame.format)
                );
                assert_eq!(stream.bytes(), frame.data.len());
                let (frame, found) = strip(frame);
                assert_eq!(found == Found::Line, line);
                assert_eq!(frame.into_luma(), region);
            }
        }
    }
    /// A frame that needs no cropping, conversion or data line keeps the memory that the sensor pass
    /// wrote.
    #[test]
    fn a_whole_frame_is_not_copied() {
        let frame = rendered();
        let (width, height) = (frame.width, frame.height);
        let readout = Readout {
            roi: Roi {
                x: 0,
                y: 0,
                width,
                height,
            },
            format: PixelFormat::Grey,
            data_line: None,
        };
        let memory = frame.data.as_ptr();
        assert_eq!(readout.read(frame).data.as_ptr(), memory);
    }
}
