//! `phasmid record info`: summarises a recording.

use super::recording::open;
use phasmid_core::error::{Error, Result};
use phasmid_protocol::record::{About, Ending, Kind, Side, Summary};
use phasmid_protocol::{printable, printable_json};
use std::path::Path;

pub(super) fn run(path: &Path, json: bool) -> Result<()> {
    let mut reader = open(path)?;
    let summary = Summary::of(&mut reader);
    let size = phasmid_core::file::regular(path)?.len();
    if json {
        let mut report = serde_json::to_value(&summary).expect("numbers and strings");
        report["file"] = path.display().to_string().into();
        report["file_bytes"] = size.into();
        println!("{}", printable_json(&report));
        return sound(path, &summary);
    }
    if let Some(about) = &summary.about {
        tell_about(about);
    }
    let seconds = summary.duration_ns as f64 * 1e-9;
    println!("duration     {seconds:.6} s in {} records", summary.records);
    tell_size(size, seconds);
    let Kind { count, bytes } = summary.sent;
    let lines = summary.lines_sent;
    println!("sent         {bytes} bytes, {lines} lines, in {count} pieces");
    let Kind { count, bytes } = summary.received;
    println!("received     {bytes} bytes in {count} pieces");
    tell_frames(&summary);
    let clients = summary.clients;
    println!(
        "clients      {} of the port, {} of the camera",
        clients.control, clients.camera
    );
    if summary.unplugged > 0 {
        println!("unplugged    {} times", summary.unplugged);
    }
    if summary.notes.count > 0 {
        println!("notes        {}", summary.notes.count);
    }
    let ending = match &summary.ending {
        Ending::Proper => "in order".to_owned(),
        Ending::Cut(why) => format!("cut: {}", printable(why)),
        Ending::Open => "no end record: its writer was killed, or is still writing".to_owned(),
        Ending::Damaged(what) => format!("damaged: {}", printable(what)),
    };
    println!("ends         {ending}");
    sound(path, &summary)
}

/// Returns an error, which sets the exit status, if the recording is damaged. Call this after the
/// report is printed.
///
/// # Errors
/// Returns an error if the recording is damaged. A killed writer does not count as damage.
fn sound(path: &Path, summary: &Summary) -> Result<()> {
    match &summary.ending {
        Ending::Damaged(what) => Err(Error::device(format!(
            "{}: damaged: {}",
            path.display(),
            printable(what)
        ))),
        _ => Ok(()),
    }
}

fn tell_about(about: &About) {
    let side = match about.side {
        Side::Device => "the device's",
        Side::Host => "the host's",
    };
    let name = printable(&about.name);
    println!("recorded     {name}, on {side} side");
    let program = printable(&about.program);
    let since = about.started_unix_s;
    println!("by           {program}, {since} s after the start of 1970");
    let known = |what: &Option<String>| what.as_deref().map(printable);
    if let (Some(profile), Some(scene)) = (known(&about.profile), known(&about.scene)) {
        let seed = about.seed.unwrap_or_default();
        println!("device       {profile} looking at {scene}, seed {seed}");
    }
    let (control, camera) = (printable(&about.control), printable(&about.camera));
    if !control.is_empty() {
        println!("control      {control}");
    }
    if !camera.is_empty() {
        println!("camera       {camera}");
    }
}

fn tell_size(bytes: u64, seconds: f64) {
    let mebibytes = bytes as f64 / f64::from(1 << 20);
    // The data rate is undefined for a recording with a duration of 0.
    match seconds > 0.0 {
        true => println!(
            "size         {mebibytes:.1} MiB, {:.1} MiB/s",
            mebibytes / seconds
        ),
        false => println!("size         {mebibytes:.1} MiB"),
    }
}

fn tell_frames(summary: &Summary) {
    let Kind { count, bytes } = summary.frame;
    let frames = &summary.frames;
    let (Some(first), Some(last)) = (frames.first_id, frames.last_id) else {
        println!("frames       none");
        return;
    };
    println!("frames       {count}, ids {first} to {last}, {bytes} bytes of pixels");
    if frames.out_of_order > 0 {
        println!(
            "             {} do not follow the previous frame",
            frames.out_of_order
        );
    }
    for format in &frames.formats {
        println!(
            "             {} of {} {} x {}",
            format.count, format.format, format.width, format.height
        );
    }
    if frames.of_other_formats > 0 {
        println!("             {} of others", frames.of_other_formats);
    }
}
