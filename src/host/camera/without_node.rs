//! Replaces the module `node` on systems other than Linux and in builds without the feature `v4l2`.

use super::{Camera, CameraDriver};
use phasmid_core::error::{Error, Result};
use std::time::Duration;

/// Always returns an error: V4L2 devices are not supported here.
pub(super) fn open(address: &str, _: CameraDriver, _: Duration) -> Result<Box<dyn Camera + Send>> {
    let found = match cfg!(target_os = "linux") {
        true => {
            "a V4L2 device, which this build cannot open (it was built without the feature v4l2)"
        }
        false => "a V4L2 device, which only a Linux build can open",
    };
    Err(Error::input(
        format!("--camera {address}"),
        found,
        "socket:PATH or tcp:HOST:PORT",
    ))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn refuses_a_node_with_what_the_build_lacks() {
        let refused = open("/dev/video0", CameraDriver::Auto, Duration::ZERO).err();
        let error = refused.expect("no node can be opened");
        assert_eq!(error.exit_code(), 2);
        let text = error.to_string();
        assert!(text.contains("v4l2") || text.contains("Linux"), "{text}");
    }
}
