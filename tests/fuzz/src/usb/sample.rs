//! The device under test, and its frames.

use phasmid::link::usb::{CameraState, UsbDevice};
use phasmid::profile::{Profile, Speed, Transfer};
use phasmid::protocol::{Frame, PixelFormat};

pub const WIDTH: u32 = 300;
pub const HEIGHT: u32 = 200;

/// Returns the profile of a device with this speed and transfer type.
pub fn profile(speed: Speed, transfer: Transfer) -> Profile {
    let mut profile = Profile::load("webcam-grey").unwrap();
    profile.usb.speed = speed;
    profile.usb.transfer = transfer;
    profile
}

/// Returns a device of a profile that exposes for 12 ms and offers GREY and YUYV.
pub fn device(profile: &Profile, number: u32) -> UsbDevice {
    device_of(profile, number, &[PixelFormat::Grey, PixelFormat::Yuyv])
}

/// Same as [`device`], with other formats.
pub fn device_of(profile: &Profile, number: u32, formats: &[PixelFormat]) -> UsbDevice {
    let camera = CameraState {
        exposure_ns: 12_000_000,
        gain_db: 0.0,
        settable_ns: Some(u64::MAX),
    };
    UsbDevice::new(profile, number, (WIDTH, HEIGHT), formats, camera).unwrap()
}

/// Returns the camera's frame with id `id`.
pub fn frame(id: u64, format: PixelFormat) -> Frame {
    let len = format.frame_bytes(WIDTH, HEIGHT);
    let mut data: Vec<u8> = (0..len as u64).map(|i| (i * 7 + id * 31) as u8).collect();
    data[..8].copy_from_slice(&id.to_le_bytes());
    Frame {
        id,
        pattern_index: Some(0),
        width: WIDTH,
        height: HEIGHT,
        format,
        exposure_start_ns: 0,
        exposure_end_ns: 0,
        data,
    }
}
