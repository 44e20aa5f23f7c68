//! Format and frame interval of a node.
//!
//! Implemented without the `v4l` crate, whose `Format` panics on unknown values of the colour
//! fields; a loopback node returns whatever values its producer has set.

use super::call::ioctl;
use std::io;
use v4l::Device;
use v4l::v4l_sys::{
    v4l2_buf_type, v4l2_buf_type_V4L2_BUF_TYPE_VIDEO_CAPTURE as CAPTURE,
    v4l2_buf_type_V4L2_BUF_TYPE_VIDEO_OUTPUT as OUTPUT,
    v4l2_colorspace_V4L2_COLORSPACE_SRGB as SRGB, v4l2_field_V4L2_FIELD_NONE as PROGRESSIVE,
    v4l2_format, v4l2_fract, v4l2_pix_format, v4l2_streamparm,
};
use v4l::v4l2::vidioc;

/// Size and pixel format of frames.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct PixFormat {
    /// Columns.
    pub width: u32,
    /// Rows.
    pub height: u32,
    /// Four-character code.
    pub fourcc: [u8; 4],
    /// Bytes per frame.
    pub size: u32,
}

impl std::fmt::Display for PixFormat {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let code: String = self
            .fourcc
            .iter()
            .map(|byte| char::from(*byte))
            .filter(char::is_ascii_graphic)
            .collect();
        write!(f, "{code} {} x {}", self.width, self.height)
    }
}

impl PixFormat {
    /// Returns the format that readers of the node receive.
    ///
    /// # Errors
    /// Returns the driver's error; EINVAL from v4l2loopback while no producer has set a format.
    pub fn of_capture(device: &Device) -> io::Result<Self> {
        let mut format = zero_format(CAPTURE);
        // SAFETY: VIDIOC_G_FMT takes a `v4l2_format`.
        #[allow(unsafe_code)]
        unsafe {
            ioctl(&device.handle(), vidioc::VIDIOC_G_FMT, &mut format)?;
        }
        Ok(Self::of(&format))
    }

    /// Returns the format to which the driver would adjust this one for frames written to the node.
    /// Here v4l2loopback reports the bytes per frame; when a format is set, it reports the bytes per
    /// buffer.
    ///
    /// # Errors
    /// Returns the driver's error.
    pub fn tried(self, device: &Device) -> io::Result<Self> {
        let mut format = self.for_output();
        // SAFETY: VIDIOC_TRY_FMT takes a `v4l2_format`.
        #[allow(unsafe_code)]
        unsafe {
            ioctl(&device.handle(), vidioc::VIDIOC_TRY_FMT, &mut format)?;
        }
        Ok(Self::of(&format))
    }

    /// Sets the format of frames written to the node; the driver may choose another one.
    ///
    /// # Errors
    /// Returns the driver's error.
    pub fn set(self, device: &Device) -> io::Result<()> {
        let mut format = self.for_output();
        // SAFETY: VIDIOC_S_FMT takes a `v4l2_format`.
        #[allow(unsafe_code)]
        unsafe {
            ioctl(&device.handle(), vidioc::VIDIOC_S_FMT, &mut format)
        }
    }

    fn for_output(self) -> v4l2_format {
        let mut format = zero_format(OUTPUT);
        let rows = self.height.max(1);
        format.fmt.pix = v4l2_pix_format {
            width: self.width,
            height: self.height,
            pixelformat: u32::from_le_bytes(self.fourcc),
            field: PROGRESSIVE,
            bytesperline: self.size / rows,
            sizeimage: self.size,
            colorspace: SRGB,
            ..pix_of(&format)
        };
        format
    }

    fn of(format: &v4l2_format) -> Self {
        let pix = pix_of(format);
        Self {
            width: pix.width,
            height: pix.height,
            fourcc: pix.pixelformat.to_le_bytes(),
            size: pix.sizeimage,
        }
    }
}

fn pix_of(format: &v4l2_format) -> v4l2_pix_format {
    // SAFETY: `zero_format` initialised every byte of the union, and this member consists of plain
    // numbers.
    #[allow(unsafe_code)]
    unsafe {
        format.fmt.pix
    }
}

fn zero_format(kind: v4l2_buf_type) -> v4l2_format {
    // SAFETY: all members are plain numbers, or pointers of an unused member; zero is valid for
    // each.
    #[allow(unsafe_code)]
    let zero: v4l2_format = unsafe { std::mem::zeroed() };
    v4l2_format {
        type_: kind,
        ..zero
    }
}

/// Sets the interval of written frames to `seconds.0 / seconds.1` s.
///
/// # Errors
/// Returns the driver's error.
pub fn announce_interval(device: &Device, seconds: (u32, u32)) -> io::Result<()> {
    let mut parm = zero_parm(OUTPUT);
    parm.parm.output.timeperframe = v4l2_fract {
        numerator: seconds.0,
        denominator: seconds.1,
    };
    // SAFETY: VIDIOC_S_PARM takes a `v4l2_streamparm`.
    #[allow(unsafe_code)]
    unsafe {
        ioctl(&device.handle(), vidioc::VIDIOC_S_PARM, &mut parm)
    }
}

/// Returns the frame interval reported to readers of the node, as numerator and denominator in
/// seconds.
///
/// # Errors
/// Returns the driver's error.
pub fn announced_interval(device: &Device) -> io::Result<(u32, u32)> {
    let mut parm = zero_parm(CAPTURE);
    // SAFETY: VIDIOC_G_PARM takes a `v4l2_streamparm`.
    #[allow(unsafe_code)]
    unsafe {
        ioctl(&device.handle(), vidioc::VIDIOC_G_PARM, &mut parm)?;
    }
    // SAFETY: the buffer type selects this member of the union; it consists of plain numbers.
    #[allow(unsafe_code)]
    let interval = unsafe { parm.parm.capture.timeperframe };
    Ok((interval.numerator, interval.denominator))
}

fn zero_parm(kind: v4l2_buf_type) -> v4l2_streamparm {
    // SAFETY: all members are plain numbers, for which zero is valid.
    #[allow(unsafe_code)]
    let zero: v4l2_streamparm = unsafe { std::mem::zeroed() };
    v4l2_streamparm {
        type_: kind,
        ..zero
    }
}
