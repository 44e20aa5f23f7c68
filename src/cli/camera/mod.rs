//! `phasmid camera info`: reports a camera's identity, formats and controls.

#[cfg(all(target_os = "linux", feature = "v4l2"))]
mod device;
mod usb;

use phasmid_core::error::{Error, Result};
use phasmid_host::{Camera as _, CameraDriver, open_camera};
use phasmid_protocol::printable_json;
use serde_json::json;
use std::time::Duration;

/// Inspect cameras
#[derive(Debug, clap::Args)]
pub(super) struct Args {
    #[command(subcommand)]
    command: Command,
}

#[derive(Debug, clap::Subcommand)]
enum Command {
    Info(InfoArgs),
}

/// Report a camera's identity, formats, intervals and controls, or the next frame of a socket
#[derive(Debug, clap::Args)]
#[command(after_help = "Example:\n  phasmid camera info /dev/video0")]
struct InfoArgs {
    /// Camera: /dev/videoN, usb:HOST:PORT[/BUSID], socket:PATH or tcp:HOST:PORT. For tcp:, the
    /// environment variable PHASMID_TCP_TOKEN_FILE names the file of the device's --tcp-token.
    #[arg(value_name = "ADDR")]
    address: String,
    /// Seconds to wait for a frame from a socket or an answer from a USB device, 0.001 to 3600.
    #[arg(long, value_name = "S", default_value_t = 2.0)]
    timeout: f64,
    /// Print the report as JSON.
    #[arg(long)]
    json: bool,
}

pub(super) fn run(args: &Args) -> Result<()> {
    let Command::Info(args) = &args.command;
    if !(0.001..=3600.0).contains(&args.timeout) {
        return Err(Error::input("--timeout", args.timeout, "0.001 to 3600 s"));
    }
    #[cfg(all(target_os = "linux", feature = "v4l2"))]
    if args.address.starts_with("/dev/") {
        return device::report(&args.address, args.json);
    }
    let timeout = Duration::from_secs_f64(args.timeout);
    if args.address.starts_with("usb:") {
        return usb::report(&args.address, timeout, args.json);
    }
    let known = ["/dev/", "socket:", "tcp:"];
    if !known.iter().any(|kind| args.address.starts_with(kind)) {
        return Err(Error::input(
            format!("camera {}", args.address),
            "an unknown kind of address",
            "/dev/videoN, usb:HOST:PORT[/BUSID], socket:PATH or tcp:HOST:PORT",
        ));
    }
    let mut camera = open_camera(&args.address, CameraDriver::Auto, timeout)?;
    let Some(frame) = camera.next_frame(timeout)? else {
        return Err(Error::device(format!(
            "camera {}: no frame within {} s; a camera that waits for a trigger sends none until \
             it is triggered (--timeout waits longer)",
            args.address, args.timeout
        )));
    };
    if args.json {
        let report = json!({
            "address": args.address,
            "width": frame.width,
            "height": frame.height,
            "format": frame.format,
            "id": frame.id,
            "pattern_index": frame.pattern_index,
            "exposure_us": (frame.exposure_end_ns - frame.exposure_start_ns.min(frame.exposure_end_ns)) / 1000,
        });
        println!("{}", printable_json(&report));
        return Ok(());
    }
    println!("camera       {}", args.address);
    println!(
        "frame        {} x {} {:?}",
        frame.width, frame.height, frame.format
    );
    println!("id           {}", frame.id);
    match frame.pattern_index {
        Some(index) => println!("pattern      {index}"),
        None => println!("pattern      none: the camera runs free"),
    }
    Ok(())
}
