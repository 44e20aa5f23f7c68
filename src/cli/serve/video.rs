//! The V4L2 node of `--camera`.

use super::args::{Args, CameraChoice, Pace};
use phasmid_core::error::{Error, Result};
use phasmid_device::Firmware;
use phasmid_device::link::VideoOutput;
use std::time::Duration;

/// Returns the command-line option that selects this pace of the clock.
fn option(pace: Pace) -> &'static str {
    match pace {
        Pace::Real => "--clock real",
        Pace::Fast => "--clock fast",
        Pace::Stepped => "--clock stepped",
    }
}

/// Rejects invalid combinations of options before anything is created.
pub(super) fn check(args: &Args, devices: usize) -> Result<()> {
    let CameraChoice::Node(path) = &args.camera else {
        return Ok(());
    };
    if args.clock != Pace::Real {
        return Err(Error::input(
            option(args.clock),
            format!("with --camera {}", path.display()),
            "--clock real: a V4L2 reader cannot pause the device, so frames would be lost; or \
             --camera socket",
        ));
    }
    if devices > 1 {
        return Err(Error::input(
            format!("--camera {}", path.display()),
            format!("one node for {devices} devices"),
            "auto, a free node for each, or socket",
        ));
    }
    Ok(())
}

/// Opens the requested V4L2 node or a free one. Also returns a description of the camera, or why it has
/// no node.
pub(super) fn open_video(
    args: &Args,
    firmware: &Firmware,
    bits: u32,
    power_on: Duration,
) -> Result<(Option<VideoOutput>, String)> {
    let stream = firmware.stream();
    let opened = match &args.camera {
        CameraChoice::Socket => return Ok((None, String::new())),
        // With `--usb`, the USB device provides the camera, so no V4L2 node is needed.
        CameraChoice::Auto if args.usb.is_some() => return Ok((None, String::new())),
        CameraChoice::Node(path) => Ok(VideoOutput::open(path, &stream, bits, power_on)?),
        CameraChoice::Auto if args.clock != Pace::Real => Err(format!(
            "{}: a V4L2 reader cannot pause the device, so frames would be lost",
            option(args.clock)
        )),
        CameraChoice::Auto => VideoOutput::open_any(&stream, bits, power_on)
            .map_err(|why| format!("{why}; run phasmid doctor")),
    };
    Ok(match opened {
        Ok(video) => {
            let about = video.about();
            (Some(video), about)
        }
        Err(why) => (None, why),
    })
}
