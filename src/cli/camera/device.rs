//! Reports a V4L2 device: identity, formats and controls.

use phasmid_core::error::Result;
use phasmid_host::explain_device;
use phasmid_protocol::{printable, printable_json};
use phasmid_v4l2::{
    Control, ControlValue, FORGOTTEN, Node, RELOAD, controls, current_format, offered_formats,
};
use serde_json::{Value, json};
use std::path::Path;
use v4l::frameinterval::FrameIntervalEnum;
use v4l::framesize::FrameSizeEnum;
use v4l::video::Capture as _;
use v4l::{Device, FourCC, Fraction};

/// Maximum number of sizes that are listed for a format. Also the maximum number of intervals that
/// are listed for a size.
const MAX_LISTED: usize = 64;

/// Prints the report.
///
/// # Errors
/// Returns an error if the device cannot be opened or is not a V4L2 device.
pub(super) fn report(address: &str, as_json: bool) -> Result<()> {
    let (device, node) =
        Node::open(Path::new(address)).map_err(|e| explain_device(address, "open", e))?;
    let current = current_format(&device).ok();
    let interval = device.params().ok().map(|params| params.interval);
    let formats: Vec<(String, String, Vec<String>)> = offered_formats(&device)
        .into_iter()
        .map(|(code, words)| (letters(code), words, sizes(&device, code)))
        .collect();
    let controls = controls(&device);
    let (major, minor, patch) = node.version;
    let version = format!("{major}.{minor}.{patch}");
    let mut can = Vec::new();
    for (has, what) in [
        (node.captures, "capture"),
        (node.outputs, "output"),
        (node.streams, "streaming"),
    ] {
        can.extend(has.then_some(what));
    }
    if as_json {
        let current = current.map(|now| {
            json!({
                "format": letters(now.fourcc), "width": now.width, "height": now.height,
                "stride_bytes": now.stride, "frame_bytes": now.size,
                "interval_s": interval.as_ref().map(seconds),
            })
        });
        let formats: Vec<Value> = formats
            .iter()
            .map(|(code, words, sizes)| json!({ "format": code, "words": words, "sizes": sizes }))
            .collect();
        let report = json!({
            "address": address, "driver": node.driver, "card": node.card, "bus": node.bus,
            "kernel": version, "capabilities": can, "loopback": node.is_loopback(),
            "forgotten": node.is_forgotten(),
            "current": current, "formats": formats,
            "controls": controls.iter().map(control_json).collect::<Vec<_>>(),
        });
        println!("{}", printable_json(&report));
        return Ok(());
    }
    println!("camera       {address}");
    println!("card         {}", printable(&node.card));
    println!(
        "driver       {}, kernel {version}, at {}",
        printable(&node.driver),
        printable(&node.bus)
    );
    println!(
        "loopback     {}",
        if node.is_loopback() { "yes" } else { "no" }
    );
    println!("can          {}", can.join(", "));
    match current {
        Some(now) => println!(
            "format       {} {} x {}, {} bytes{}",
            letters(now.fourcc),
            now.width,
            now.height,
            now.size,
            interval.map_or(String::new(), |each| format!(
                ", every {} s",
                seconds(&each)
            ))
        ),
        None if node.is_forgotten() => {
            println!("format       none: {FORGOTTEN}; reload the module: `{RELOAD}`");
        }
        None if node.is_loopback() => {
            println!("format       none yet: no producer streams into it");
        }
        None => println!("format       none"),
    }
    for (code, words, sizes) in &formats {
        println!("offers       {code} ({})", printable(words));
        for size in sizes {
            println!("  {size}");
        }
    }
    for control in &controls {
        println!("control      {}", control_line(control));
    }
    Ok(())
}

fn letters(code: [u8; 4]) -> String {
    code.escape_ascii().to_string().trim_end().to_owned()
}

fn seconds(interval: &Fraction) -> String {
    format!("{}/{}", interval.numerator, interval.denominator)
}

/// Lists the sizes of a format, each with its intervals.
fn sizes(device: &Device, code: [u8; 4]) -> Vec<String> {
    let fourcc = FourCC::new(&code);
    let Ok(sizes) = device.enum_framesizes(fourcc) else {
        return Vec::new();
    };
    let more = sizes.len().saturating_sub(MAX_LISTED);
    let mut lines: Vec<String> = sizes
        .into_iter()
        .take(MAX_LISTED)
        .map(|size| match size.size {
            FrameSizeEnum::Discrete(size) => {
                let every = intervals(device, fourcc, size.width, size.height);
                format!("{} x {}{every}", size.width, size.height)
            }
            FrameSizeEnum::Stepwise(steps) => {
                let every = intervals(device, fourcc, steps.max_width, steps.max_height);
                format!(
                    "{} x {} to {} x {} in steps of {} x {}{every}",
                    steps.min_width,
                    steps.min_height,
                    steps.max_width,
                    steps.max_height,
                    steps.step_width,
                    steps.step_height
                )
            }
        })
        .collect();
    if more > 0 {
        lines.push(format!("and {more} more"));
    }
    lines
}

fn intervals(device: &Device, fourcc: FourCC, width: u32, height: u32) -> String {
    let Ok(intervals) = device.enum_frameintervals(fourcc, width, height) else {
        return String::new();
    };
    let words: Vec<String> = intervals
        .iter()
        .take(MAX_LISTED)
        .map(|each| match &each.interval {
            FrameIntervalEnum::Discrete(each) => seconds(each),
            FrameIntervalEnum::Stepwise(steps) => {
                format!("{} to {}", seconds(&steps.min), seconds(&steps.max))
            }
        })
        .collect();
    match words.is_empty() {
        true => String::new(),
        false => format!(", every {} s", words.join(", ")),
    }
}

fn control_line(control: &Control) -> String {
    let mut line = format!("{} ({})", printable(&control.name), control.kind);
    line += &match &control.value {
        Some(ControlValue::Number(value)) => {
            match control.menu.iter().find(|(at, _)| at == value) {
                Some((_, words)) => format!(" = {value} ({})", printable(words)),
                None => format!(" = {value}"),
            }
        }
        Some(ControlValue::Mask(bits)) => format!(" = {bits:#x}"),
        Some(ControlValue::Text(text)) => format!(" = {text:?}"),
        None if control.kind == "button" => String::new(),
        None => " (not read)".to_owned(),
    };
    match control.range {
        Some((_, mask, _, default)) if control.kind == "bit mask" => {
            line += &format!(", of {mask:#x}, default {default:#x}");
        }
        Some((low, high, step, default)) => {
            line += &format!(", {low} to {high} in steps of {step}, default {default}");
        }
        None => {}
    }
    if control.read_only {
        line += ", read only";
    }
    line
}

fn control_json(control: &Control) -> Value {
    let value = match &control.value {
        Some(ControlValue::Number(value)) => json!(value),
        Some(ControlValue::Mask(bits)) => json!(bits),
        Some(ControlValue::Text(text)) => json!(text),
        None => Value::Null,
    };
    json!({
        "id": control.id, "name": control.name, "kind": control.kind, "value": value,
        "minimum": control.range.map(|r| r.0), "maximum": control.range.map(|r| r.1),
        "step": control.range.map(|r| r.2), "default": control.range.map(|r| r.3),
        "menu": control.menu, "read_only": control.read_only,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn line(kind: &'static str, value: Option<ControlValue>) -> String {
        let range = (kind != "string").then_some((0, 0xffff_ffff, 1, 0x10));
        control_line(&Control {
            id: 1,
            name: "It".into(),
            kind,
            range,
            value,
            menu: Vec::new(),
            read_only: false,
        })
    }

    #[test]
    fn masks_are_unsigned_and_unread_values_are_marked() {
        assert_eq!(
            line("bit mask", Some(ControlValue::Mask(0x8000_2000))),
            "It (bit mask) = 0x80002000, of 0xffffffff, default 0x10"
        );
        assert_eq!(
            line("64-bit integer", Some(ControlValue::Number(-1))),
            "It (64-bit integer) = -1, 0 to 4294967295 in steps of 1, default 16"
        );
        // Control characters in a driver's text are escaped.
        assert_eq!(
            line("string", Some(ControlValue::Text("a\u{1b}".into()))),
            "It (string) = \"a\\u{1b}\""
        );
        assert_eq!(line("string", None), "It (string) (not read)");
        let steering = Control {
            id: 1,
            name: "a\u{1b}[2J".into(),
            kind: "menu",
            range: None,
            value: Some(ControlValue::Number(3)),
            menu: vec![(3, "b\u{9b}".into())],
            read_only: false,
        };
        assert_eq!(control_line(&steering), "a\\u{1b}[2J (menu) = 3 (b\\u{9b})");
    }
}
