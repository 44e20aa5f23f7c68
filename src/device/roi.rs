//! Region of interest: the part of the sensor that is read out.

use glam::DVec2;
use phasmid_geometry::Rig;
use phasmid_protocol::Frame;

/// A rectangle of whole pixels inside the sensor.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Roi {
    /// First column.
    pub x: u32,
    /// First row.
    pub y: u32,
    /// Columns, at least 1.
    pub width: u32,
    /// Rows, at least 1.
    pub height: u32,
}

impl Roi {
    /// Crops a frame of the whole sensor to the region; a frame that does not contain the region is
    /// returned unchanged. Each pixel of the frame must take whole bytes, so packed formats are
    /// cropped before packing.
    pub fn crop(self, frame: Frame) -> Frame {
        let inside = |first: u32, len: u32, all: u32| {
            len > 0 && first.checked_add(len).is_some_and(|end| end <= all)
        };
        let whole = (self.width, self.height) == (frame.width, frame.height);
        if whole
            || !inside(self.x, self.width, frame.width)
            || !inside(self.y, self.height, frame.height)
        {
            return frame;
        }
        let pixel = frame.format.bytes_per_pixel();
        let stride = frame.width as usize * pixel;
        let (first, len) = (self.x as usize * pixel, self.width as usize * pixel);
        let data = frame
            .data
            .chunks_exact(stride)
            .skip(self.y as usize)
            .take(self.height as usize)
            .flat_map(|row| &row[first..first + len])
            .copied()
            .collect();
        Frame {
            width: self.width,
            height: self.height,
            data,
            ..frame
        }
    }

    /// Returns the rig as seen through the region: the image is smaller and the principal point is
    /// shifted.
    pub fn rig(self, mut rig: Rig) -> Rig {
        rig.camera.lens.width_px = self.width;
        rig.camera.lens.height_px = self.height;
        rig.camera.lens.principal_px -= DVec2::new(f64::from(self.x), f64::from(self.y));
        rig
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use phasmid_protocol::PixelFormat;

    #[test]
    fn crop_keeps_the_pixels_of_the_region() {
        let frame = Frame {
            id: 7,
            pattern_index: Some(1),
            width: 4,
            height: 3,
            format: PixelFormat::Y16,
            exposure_start_ns: 0,
            exposure_end_ns: 1,
            data: (0..24).collect(),
        };
        let roi = |x, y, width, height| Roi {
            x,
            y,
            width,
            height,
        };
        let part = roi(1, 2, 2, 1).crop(frame.clone());
        assert_eq!(
            (part.width, part.height, part.id, &part.data[..]),
            (2, 1, 7, &[18, 19, 20, 21][..])
        );
        assert_eq!(roi(0, 0, 4, 3).crop(frame.clone()), frame);
        assert_eq!(roi(3, 0, 2, 3).crop(frame.clone()), frame, "outside");
        assert_eq!(roi(u32::MAX, 0, 2, 3).crop(frame.clone()), frame);
    }
}
