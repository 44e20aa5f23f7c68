//! What a V4L2 device says of itself.

use crate::error::Result;
use crate::host::explain_device;
use crate::v4l2::{Control, Node, controls, current_format, offered_formats};
use serde_json::{Value, json};
use std::path::Path;
use v4l::frameinterval::FrameIntervalEnum;
use v4l::framesize::FrameSizeEnum;
use v4l::video::Capture as _;
use v4l::{Device, FourCC, Fraction};

/// Sizes of a format and intervals of a size that are listed at most.
const MAX_LISTED: usize = 64;

/// Prints the report.
///
/// # Errors
/// A device that cannot be opened or is no V4L2 device.
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
            "version": version, "capabilities": can, "loopback": node.is_loopback(),
            "current": current, "formats": formats,
            "controls": controls.iter().map(control_json).collect::<Vec<_>>(),
        });
        println!("{report}");
        return Ok(());
    }
    println!("camera       {address}");
    println!("card         {}", node.card);
    println!("driver       {} {version}, at {}", node.driver, node.bus);
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
        None => println!("format       none yet: no producer streams into it"),
    }
    for (code, words, sizes) in &formats {
        println!("offers       {code} ({words})");
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

/// Sizes of a format, each with its intervals.
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
    let mut line = format!("{} ({})", control.name, control.kind);
    if let Some(value) = control.value {
        let entry = control.menu.iter().find(|(at, _)| *at == i64::from(value));
        line += &match entry {
            Some((_, words)) => format!(" = {value} ({words})"),
            None => format!(" = {value}"),
        };
    }
    if let Some((low, high, step, default)) = control.range {
        line += &format!(", {low} to {high} in steps of {step}, default {default}");
    }
    if control.read_only {
        line += ", read only";
    }
    line
}

fn control_json(control: &Control) -> Value {
    json!({
        "id": control.id, "name": control.name, "kind": control.kind, "value": control.value,
        "minimum": control.range.map(|r| r.0), "maximum": control.range.map(|r| r.1),
        "step": control.range.map(|r| r.2), "default": control.range.map(|r| r.3),
        "menu": control.menu, "read_only": control.read_only,
    })
}
