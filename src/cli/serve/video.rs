//! The V4L2 node of `--camera`.

use super::{Args, Pace};
use phasmid_core::error::{Error, Result};
use phasmid_device::Firmware;
use phasmid_device::link::VideoOutput;
use std::path::PathBuf;
use std::str::FromStr;
use std::time::Duration;

/// Values of `--camera`.
#[derive(Debug, Clone)]
pub(super) enum Choice {
    Auto,
    Socket,
    Node(PathBuf),
}

impl FromStr for Choice {
    type Err = &'static str;

    fn from_str(text: &str) -> std::result::Result<Self, Self::Err> {
        match text {
            "auto" => Ok(Self::Auto),
            "socket" => Ok(Self::Socket),
            path if path.starts_with("/dev/") => Ok(Self::Node(path.into())),
            _ => Err("expected auto, socket or a path such as /dev/video10"),
        }
    }
}

/// Returns the option that selects a pace.
fn option(pace: Pace) -> &'static str {
    match pace {
        Pace::Real => "--clock real",
        Pace::Fast => "--clock fast",
        Pace::Stepped => "--clock stepped",
    }
}

/// Rejects invalid combinations of options before anything is created.
pub(super) fn check(args: &Args, devices: usize) -> Result<()> {
    let Choice::Node(path) = &args.camera else {
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
        Choice::Socket => return Ok((None, String::new())),
        // The USB device provides the camera.
        Choice::Auto if args.usb.is_some() => return Ok((None, String::new())),
        Choice::Node(path) => Ok(VideoOutput::open(path, &stream, bits, power_on)?),
        Choice::Auto if args.clock != Pace::Real => Err(format!(
            "{}: a V4L2 reader cannot pause the device, so frames would be lost",
            option(args.clock)
        )),
        Choice::Auto => VideoOutput::open_any(&stream, bits, power_on)
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
