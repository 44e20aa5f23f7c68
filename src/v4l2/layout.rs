//! Formats of a capture node: the one in use and the ones on offer.
//!
//! Asked for here and not through the `v4l` crate, which panics when a driver says a colour space,
//! field order or description that the crate does not know.

use super::call::ioctl;
use std::io;
use v4l::Device;
use v4l::v4l_sys::{
    v4l2_buf_type_V4L2_BUF_TYPE_VIDEO_CAPTURE as CAPTURE, v4l2_fmtdesc, v4l2_format,
};
use v4l::v4l2::vidioc;

/// Most formats that are listed; drivers have some dozens.
const MAX_FORMATS: u32 = 256;

/// A four-character code as V4L2 writes it.
pub type FourCc = [u8; 4];

/// How a capture node lays out its frames.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct PixelLayout {
    /// Columns.
    pub width: u32,
    /// Rows.
    pub height: u32,
    /// The pixels' format.
    pub fourcc: FourCc,
    /// Bytes from a row to the next; 0 for compressed formats.
    pub stride: u32,
    /// Most bytes that a frame takes.
    pub size: u32,
}

fn empty() -> v4l2_format {
    // SAFETY: a `v4l2_format` is plain numbers, and zero is a value of each.
    #[allow(unsafe_code)]
    let zero: v4l2_format = unsafe { std::mem::zeroed() };
    v4l2_format {
        type_: CAPTURE,
        ..zero
    }
}

fn layout(format: &v4l2_format) -> PixelLayout {
    // SAFETY: all members of the union are plain numbers; this is the one of capture formats.
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

/// The format in use.
///
/// # Errors
/// What the driver says: EINVAL when a loopback node has no producer yet.
pub fn current_format(device: &Device) -> io::Result<PixelLayout> {
    let mut format = empty();
    // SAFETY: VIDIOC_G_FMT takes a `v4l2_format`.
    #[allow(unsafe_code)]
    unsafe {
        ioctl(&device.handle(), vidioc::VIDIOC_G_FMT, &mut format)?;
    }
    Ok(layout(&format))
}

/// Asks for a format of `width` x `height` and gives what the driver made of it.
///
/// # Errors
/// What the driver says: EBUSY while somebody streams.
pub fn set_format(
    device: &Device,
    (width, height): (u32, u32),
    fourcc: FourCc,
) -> io::Result<PixelLayout> {
    let mut format = empty();
    // Fields of a `Copy` member of the union are written without reading it.
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

/// The formats on offer with the driver's words for each; empty where there is none yet.
pub fn offered_formats(device: &Device) -> Vec<(FourCc, String)> {
    let mut found = Vec::new();
    for index in 0..MAX_FORMATS {
        // SAFETY: a `v4l2_fmtdesc` is plain numbers, and zero is a value of each.
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
