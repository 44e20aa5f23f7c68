//! A node under `/dev`: what it is and what it can do now.

use super::call::ioctl;
use rustix::fs::{FlockOperation, flock};
use std::io;
use std::os::fd::BorrowedFd;
use std::path::{Path, PathBuf};
use v4l::Device;
use v4l::v4l_sys::{
    V4L2_CAP_DEVICE_CAPS, V4L2_CAP_STREAMING, V4L2_CAP_VIDEO_CAPTURE, V4L2_CAP_VIDEO_OUTPUT,
    v4l2_capability,
};
use v4l::v4l2::vidioc;

/// The driver's name that v4l2loopback gives.
pub const LOOPBACK_DRIVER: &str = "v4l2 loopback";

/// What a node says of itself.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Node {
    /// Its path.
    pub path: PathBuf,
    /// The driver.
    pub driver: String,
    /// The device's name: v4l2loopback's label.
    pub card: String,
    /// Where it is attached.
    pub bus: String,
    /// The driver's version, as the kernel counts.
    pub version: (u8, u8, u8),
    /// Frames can be read from it now.
    pub captures: bool,
    /// Frames can be written to it now.
    pub outputs: bool,
    /// It streams by queues of buffers.
    pub streams: bool,
}

impl Node {
    /// Opens a device and asks it.
    ///
    /// # Errors
    /// A path that cannot be opened for reading and writing, or that is no V4L2 device (ENOTTY).
    pub fn open(path: &Path) -> io::Result<(Device, Self)> {
        let device = Device::with_path(path)?;
        let mut caps = v4l2_capability {
            driver: [0; 16],
            card: [0; 32],
            bus_info: [0; 32],
            version: 0,
            capabilities: 0,
            device_caps: 0,
            reserved: [0; 3],
        };
        // SAFETY: VIDIOC_QUERYCAP takes a `v4l2_capability`.
        #[allow(unsafe_code)]
        unsafe {
            ioctl(&device.handle(), vidioc::VIDIOC_QUERYCAP, &mut caps)?;
        }
        // `capabilities` is the whole device's; a webcam's metadata node is no camera.
        let can = if caps.capabilities & V4L2_CAP_DEVICE_CAPS != 0 {
            caps.device_caps
        } else {
            caps.capabilities
        };
        let [_, major, minor, patch] = caps.version.to_be_bytes();
        let node = Self {
            path: path.to_owned(),
            driver: text(&caps.driver),
            card: text(&caps.card),
            bus: text(&caps.bus_info),
            version: (major, minor, patch),
            captures: can & V4L2_CAP_VIDEO_CAPTURE != 0,
            outputs: can & V4L2_CAP_VIDEO_OUTPUT != 0,
            streams: can & V4L2_CAP_STREAMING != 0,
        };
        Ok((device, node))
    }

    /// Whether it is v4l2loopback's.
    pub fn is_loopback(&self) -> bool {
        self.driver == LOOPBACK_DRIVER
    }
}

/// Locks a node for its writer: `false` when another program of ours has done so. The lock ends
/// when the device is closed. Programs that do not ask for it are not kept out.
///
/// # Errors
/// What the system refuses.
pub fn lock(device: &Device) -> io::Result<bool> {
    let handle = device.handle();
    // SAFETY: the handle keeps its descriptor open for as long as this function borrows it.
    #[allow(unsafe_code)]
    let node = unsafe { BorrowedFd::borrow_raw(handle.fd()) };
    match flock(node, FlockOperation::NonBlockingLockExclusive) {
        Ok(()) => Ok(true),
        Err(e) if e.kind() == io::ErrorKind::WouldBlock => Ok(false),
        Err(e) => Err(e.into()),
    }
}

/// A string of C that ends at its zero or its end.
pub(super) fn text(bytes: &[u8]) -> String {
    let used = bytes.split(|byte| *byte == 0).next().unwrap_or_default();
    String::from_utf8_lossy(used).into_owned()
}

/// The V4L2 nodes under a folder such as `/dev`, in the order of their numbers.
pub fn node_paths(dev: &Path) -> Vec<PathBuf> {
    let Ok(entries) = std::fs::read_dir(dev) else {
        return Vec::new();
    };
    let mut numbered: Vec<(u32, PathBuf)> = entries
        .flatten()
        .filter_map(|entry| {
            let name = entry.file_name();
            let number = name.to_str()?.strip_prefix("video")?.parse().ok()?;
            Some((number, entry.path()))
        })
        .collect();
    numbered.sort();
    numbered.into_iter().map(|(_, path)| path).collect()
}
