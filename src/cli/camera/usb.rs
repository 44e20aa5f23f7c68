//! Reports the camera of a USB device over USB/IP, without attaching it to a kernel or starting a
//! stream.

use phasmid_core::error::{Error, Result};
use phasmid_host::usb::{
    ControlState, UsbAddress, UsbDevice, VideoControl, VideoFunction, VideoMode,
};
use phasmid_protocol::usb::uvc::{EXPOSURE_UNIT_NS, INTERVAL_UNIT_NS};
use phasmid_protocol::{printable, printable_json};
use serde_json::{Value, json};
use std::time::Duration;

/// A control: its name, the unit of its values, and its state or the error of reading the state.
type Control = (&'static str, String, Result<ControlState>);

/// Prints the report.
///
/// # Errors
/// Returns an error if the address is invalid, or the device cannot be reached or has no camera.
pub(super) fn report(address: &str, timeout: Duration, as_json: bool) -> Result<()> {
    let at = UsbAddress::parse(address, "ADDR")?;
    let device = UsbDevice::open(&at, timeout)?;
    let function = VideoFunction::find(device.configuration())
        .map_err(|what| Error::device(format!("{}: {what}", device.place())))?;
    let mut controls = Vec::new();
    for (control, name, unit) in [
        (
            VideoControl::Exposure,
            "exposure",
            format!("{} us", EXPOSURE_UNIT_NS / 1000),
        ),
        (VideoControl::Gain, "gain", "the device's own".to_owned()),
    ] {
        let state = control.read(&device, &function).transpose();
        controls.extend(state.map(|state| (name, unit, state)));
    }
    if as_json {
        println!(
            "{}",
            printable_json(&to_json(&device, &function, &controls))
        );
    } else {
        print!("{}", to_text(&device, &function, &controls));
    }
    Ok(())
}

fn to_json(device: &UsbDevice, function: &VideoFunction, controls: &[Control]) -> Value {
    let (id, info) = (device.identity(), device.client().info());
    let formats: Vec<Value> = formats(function)
        .into_iter()
        .map(|(format, modes)| {
            let sizes: Vec<String> = modes.into_iter().map(size).collect();
            json!({ "format": format, "sizes": sizes })
        })
        .collect();
    json!({
        "address": device.place(), "bus": info.bus_id, "speed": speed(info.speed),
        "vendor_id": id.vendor_id, "product_id": id.product_id,
        "release": bcd(id.release_bcd), "usb": bcd(id.usb_bcd), "uvc": bcd(function.uvc_bcd),
        "manufacturer": id.manufacturer, "card": id.product, "serial": id.serial,
        "formats": formats,
        "controls": controls.iter().map(control_json).collect::<Vec<_>>(),
    })
}

fn to_text(device: &UsbDevice, function: &VideoFunction, controls: &[Control]) -> String {
    let (id, info) = (device.identity(), device.client().info());
    let words = |text: &Option<String>| match text {
        Some(text) => printable(text),
        None => "not reported".to_owned(),
    };
    let mut lines = vec![
        format!("camera       {}", device.place()),
        format!("card         {}", words(&id.product)),
        format!("maker        {}", words(&id.manufacturer)),
        format!("serial       {}", words(&id.serial)),
        format!(
            "device       {:04x}:{:04x}, release {}, USB {}, UVC {}",
            id.vendor_id,
            id.product_id,
            bcd(id.release_bcd),
            bcd(id.usb_bcd),
            bcd(function.uvc_bcd)
        ),
        format!("speed        {}", speed(info.speed)),
    ];
    for (format, modes) in formats(function) {
        lines.push(format!("offers       {format}"));
        lines.extend(modes.into_iter().map(|mode| format!("  {}", size(mode))));
    }
    for control in controls {
        lines.push(format!("control      {}", control_line(control)));
    }
    lines.join("\n") + "\n"
}

/// Groups the modes by format, in the device's order.
fn formats(function: &VideoFunction) -> Vec<(&'static str, Vec<&VideoMode>)> {
    let mut formats: Vec<(&'static str, Vec<&VideoMode>)> = Vec::new();
    for mode in &function.modes {
        let code = mode.format.name();
        match formats.iter_mut().find(|(have, _)| *have == code) {
            Some((_, modes)) => modes.push(mode),
            None => formats.push((code, vec![mode])),
        }
    }
    formats
}

/// Describes the size of a mode and its intervals.
fn size(mode: &VideoMode) -> String {
    let size = format!("{} x {}", mode.width, mode.height);
    let seconds = |units: &u32| {
        let ns = u64::from(*units) * INTERVAL_UNIT_NS;
        (ns as f64 / 1e9).to_string()
    };
    match &mode.intervals[..] {
        [shortest, longest, _] if mode.is_range => {
            let (shortest, longest) = (seconds(shortest), seconds(longest));
            format!("{size}, every {shortest} to {longest} s")
        }
        [] => size,
        all => {
            let all: Vec<String> = all.iter().map(seconds).collect();
            format!("{size}, every {} s", all.join(", "))
        }
    }
}

/// Describes a USB speed. `number` is the speed's number in USB/IP, which is the same as the Linux
/// kernel's.
fn speed(number: u32) -> String {
    match number {
        1 => "low, 1.5 Mbit/s".to_owned(),
        2 => "full, 12 Mbit/s".to_owned(),
        3 => "high, 480 Mbit/s".to_owned(),
        5 => "SuperSpeed, 5 Gbit/s".to_owned(),
        6 => "SuperSpeed+, 10 Gbit/s".to_owned(),
        other => format!("unknown ({other})"),
    }
}

/// Formats a release number in binary-coded decimal: major, minor, sub-minor.
fn bcd(release: u16) -> String {
    format!("{:x}.{:02x}", release >> 8, release & 0xFF)
}

fn control_line((name, unit, state): &Control) -> String {
    match state {
        Ok(state) => format!(
            "{name} (integer) = {}, {} to {} in steps of {}, default {}, unit {unit}",
            state.current,
            state.range.start(),
            state.range.end(),
            state.step,
            state.default
        ),
        Err(why) => format!("{name} (integer) (not read: {why})"),
    }
}

fn control_json((name, unit, state): &Control) -> Value {
    let state = state.as_ref().ok();
    json!({
        "name": name, "kind": "integer", "unit": unit, "value": state.map(|s| s.current),
        "minimum": state.map(|s| s.range.start()), "maximum": state.map(|s| s.range.end()),
        "step": state.map(|s| s.step), "default": state.map(|s| s.default),
        "read_only": false,
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use phasmid_protocol::PixelFormat;

    #[test]
    fn intervals_are_a_list_or_a_range() {
        let mut mode = VideoMode {
            format_index: 1,
            frame_index: 1,
            format: PixelFormat::Grey,
            width: 1138,
            height: 489,
            default_interval: 333_333,
            intervals: vec![333_333, 666_666, 10_000_000],
            is_range: false,
        };
        assert_eq!(size(&mode), "1138 x 489, every 0.0333333, 0.0666666, 1 s");
        mode.is_range = true;
        assert_eq!(size(&mode), "1138 x 489, every 0.0333333 to 0.0666666 s");
        mode.intervals.clear();
        assert_eq!(size(&mode), "1138 x 489");
        assert_eq!(bcd(0x0210), "2.10");
    }

    #[test]
    fn a_control_that_is_not_read_says_why() {
        let line = control_line(&("gain", "x".to_owned(), Err(Error::device("no answer"))));
        assert_eq!(line, "gain (integer) (not read: no answer)");
    }
}
