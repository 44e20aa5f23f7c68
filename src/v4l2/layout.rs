//! Pixel formats of a capture node: the current format and the formats that the node offers.
//!
//! Implemented without the `v4l` crate, which panics on colour spaces, field orders and
//! descriptions that it does not know.

use super::call::ioctl;
use std::io;
use v4l::Device;
use v4l::v4l_sys::{
    v4l2_buf_type_V4L2_BUF_TYPE_VIDEO_CAPTURE as CAPTURE, v4l2_fmtdesc, v4l2_format,
};
use v4l::v4l2::vidioc;

/// Maximum number of formats listed; drivers offer a few dozen.
const MAX_FORMATS: u32 = 256;

/// A four-character code in V4L2 byte order.
pub type FourCc = [u8; 4];

/// Frame layout of a capture node.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct PixelLayout {
    /// Columns.
    pub width: u32,
    /// Rows.
    pub height: u32,
    /// Pixel format.
    pub fourcc: FourCc,
    /// Bytes per row, including padding; 0 for compressed formats.
    pub stride: u32,
    /// Maximum number of bytes per frame.
    pub size: u32,
}

fn empty() -> v4l2_format {
    // SAFETY: a `v4l2_format` consists of plain numbers, for which zero is valid.
    #[allow(unsafe_code)]
    let zero: v4l2_format = unsafe { std::mem::zeroed() };
    v4l2_format {
        type_: CAPTURE,
        ..zero
    }
}

fn layout(format: &v4l2_format) -> PixelLayout {
    // SAFETY: all members of the union are plain numbers; capture formats use this one.
    #[allow(unsafe_code)]
    let pix = unsafe { format.fmt.pix };
    PixelLayout {
        width: pix.width,
        height: pix.height,
        fourcc: pix.pixelformat.to_le_bytes(),
        stride: pix.bytesperline,
        size: pix.sizeimage,
    }
}

/// Returns the current format.
///
/// # Errors
/// Returns the driver's error: EINVAL if a loopback node has no producer yet.
pub fn current_format(device: &Device) -> io::Result<PixelLayout> {
    let mut format = empty();
    // SAFETY: VIDIOC_G_FMT takes a `v4l2_format`.
    #[allow(unsafe_code)]
    unsafe {
        ioctl(&device.handle(), vidioc::VIDIOC_G_FMT, &mut format)?;
    }
    Ok(layout(&format))
}

/// Requests a format of `width` x `height` pixels and returns the format that the driver has chosen.
///
/// # Errors
/// Returns the driver's error: EBUSY while another program streams.
pub fn set_format(
    device: &Device,
    (width, height): (u32, u32),
    fourcc: FourCc,
) -> io::Result<PixelLayout> {
    let mut format = empty();
    // Writing a field of a `Copy` union member does not read the union.
    format.fmt.pix.width = width;
    format.fmt.pix.height = height;
    format.fmt.pix.pixelformat = u32::from_le_bytes(fourcc);
    // SAFETY: VIDIOC_S_FMT takes a `v4l2_format`.
    #[allow(unsafe_code)]
    unsafe {
        ioctl(&device.handle(), vidioc::VIDIOC_S_FMT, &mut format)?;
    }
    Ok(layout(&format))
}

/// Returns the formats that the node offers, with the driver's descriptions; empty if it offers none
/// yet.
pub fn offered_formats(device: &Device) -> Vec<(FourCc, String)> {
    let mut found = Vec::new();
    for index in 0..MAX_FORMATS {
        // SAFETY: a `v4l2_fmtdesc` consists of plain numbers, for which zero is valid.
        #[allow(unsafe_code)]
        let zero: v4l2_fmtdesc = unsafe { std::mem::zeroed() };
        let mut description = v4l2_fmtdesc {
            index,
            type_: CAPTURE,
            ..zero
        };
        // SAFETY: VIDIOC_ENUM_FMT takes a `v4l2_fmtdesc`.
        #[allow(unsafe_code)]
        let done = unsafe { ioctl(&device.handle(), vidioc::VIDIOC_ENUM_FMT, &mut description) };
        if done.is_err() {
            break;
        }
        let code = description.pixelformat.to_le_bytes();
        found.push((code, super::node::text(&description.description)));
    }
    found
}
