//! A device node under `/dev` and its current capabilities.

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

/// Driver name of v4l2loopback.
pub const LOOPBACK_DRIVER: &str = "v4l2 loopback";
/// Explanation for the user of a node for which [`Node::is_forgotten`] is true.
pub const FORGOTTEN: &str = "it has neither a capture nor an output side, because a program that \
                             used write(), such as ffmpeg, has closed it";
/// Command that reloads v4l2loopback, which restores capture and output sides that nodes have lost.
pub const RELOAD: &str = "sudo modprobe -r v4l2loopback && sudo modprobe v4l2loopback";

/// Identity and capabilities reported by a node.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Node {
    /// Path of the node.
    pub path: PathBuf,
    /// Driver name.
    pub driver: String,
    /// Device name; for v4l2loopback, its label.
    pub card: String,
    /// Bus address.
    pub bus: String,
    /// Driver version, in the kernel's format.
    pub version: (u8, u8, u8),
    /// Whether frames can be read from the node now.
    pub captures: bool,
    /// Whether frames can be written to the node now.
    pub outputs: bool,
    /// Whether the node supports streaming I/O with buffer queues.
    pub streams: bool,
}

impl Node {
    /// Opens a device and queries its capabilities.
    ///
    /// # Errors
    /// Returns an error if the path cannot be opened for reading and writing, or is not a V4L2
    /// device (ENOTTY).
    pub fn open(path: &Path) -> io::Result<(Device, Self)> {
        if path.as_os_str().as_encoded_bytes().contains(&0) {
            return Err(io::Error::new(
                io::ErrorKind::InvalidInput,
                "a path with a zero byte",
            ));
        }
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
        // `capabilities` covers all nodes of the device, but a webcam's metadata node is not a
        // camera.
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

    /// Returns whether this is a v4l2loopback node.
    pub fn is_loopback(&self) -> bool {
        self.driver == LOOPBACK_DRIVER
    }

    /// Returns whether this is a loopback node that has lost both its capture side and its output
    /// side. v4l2loopback 0.12 drops the output side of a node whose producer used write(), and the
    /// kernel then refuses formats in either direction.
    pub fn is_forgotten(&self) -> bool {
        self.is_loopback() && !self.captures && !self.outputs
    }
}

/// Locks a node for writing; returns `false` if another Phasmid process holds the lock. Closing the
/// device releases the lock. The lock is advisory: it does not keep other programs out.
///
/// # Errors
/// Returns the system's error.
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

/// Converts a C string that ends at its first NUL or at the end of the slice.
pub(super) fn text(bytes: &[u8]) -> String {
    let used = bytes.split(|byte| *byte == 0).next().unwrap_or_default();
    String::from_utf8_lossy(used).into_owned()
}

/// Returns the V4L2 nodes in a folder such as `/dev`, in numerical order.
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
