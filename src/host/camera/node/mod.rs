//! Opens V4L2 devices by the path of their device node, and explains their errors, with a remedy if one
//! is known.

mod unplugged;
mod v4l2;
mod webcam;

pub(super) use unplugged::open;

use super::{Camera, CameraDriver, Intake};
use phasmid_core::error::Error;
use std::io;

const EIO: i32 = 5;
const EACCES: i32 = 13;
const EBUSY: i32 = 16;
const ENODEV: i32 = 19;
const ENXIO: i32 = 6;
const EINVAL: i32 = 22;
const ENOTTY: i32 = 25;

/// Describes a system error of the device at `address` that occurred while `doing` something.
pub fn explain(address: &str, doing: &str, error: io::Error) -> Error {
    let place = format!("--camera {address}");
    let remedy = match error.raw_os_error() {
        _ if error.kind() == io::ErrorKind::NotFound => {
            return Error::input(
                place,
                "no such device",
                "an existing V4L2 device; `phasmid doctor` lists them",
            );
        }
        Some(EACCES) => {
            "you may not open it; join its group (usually `sudo usermod -aG video $USER`, then log \
             in again); `phasmid doctor` says more"
        }
        Some(EBUSY) => {
            "another program uses it (v4l2loopback 0.14 and later allows one reader at a time); \
             close that one"
        }
        Some(ENODEV | ENXIO) => "the device disconnected",
        Some(ENOTTY) => {
            return Error::input(place, "no V4L2 device", "a camera such as /dev/video0");
        }
        _ => return Error::device(format!("{place}: {doing}: {error}")),
    };
    Error::device(format!("{place}: {doing}: {error}: {remedy}"))
}
