//! `phasma record export`: pictures and text out of a recording.

use crate::error::{Error, Result};
use crate::host::write_png;
use crate::protocol::Frame;
use crate::protocol::record::{Channel, Event, Record};
use std::fs::{self, File};
use std::io::{BufWriter, Write};
use std::path::Path;

/// Name of the conversation in the folder.
const CONVERSATION: &str = "conversation.txt";

pub(super) fn run(path: &Path, out: &Path, force: bool) -> Result<()> {
    let mut reader = super::open(path)?;
    let text = out.join(CONVERSATION);
    if text.exists() && !force {
        return Err(Error::input(
            format!("--out {}", out.display()),
            format!("{CONVERSATION} of an earlier export"),
            "another folder, or --force to overwrite",
        ));
    }
    fs::create_dir_all(out).map_err(|e| Error::io(out, e))?;
    let io = |e| Error::io(&text, e);
    let mut lines = BufWriter::new(File::create(&text).map_err(io)?);
    let (mut records, mut frames) = (0_u64, 0_u64);
    loop {
        let record = match reader.read() {
            Ok(Some(record)) => record,
            Ok(None) => break,
            Err(damage) => {
                writeln!(lines, "damaged: {damage}").map_err(io)?;
                eprintln!("phasma: {}: {damage}", path.display());
                break;
            }
        };
        records += 1;
        let mut words = words(&record);
        if let Event::Frame(frame) = record.event {
            // The number keeps frames apart whose ids repeat.
            let name = format!("frame_{frames:06}.png");
            let frame = Frame::clone(&frame).into_luma();
            words = format!("{words}: {name}");
            write_png(&frame, &out.join(name))?;
            frames += 1;
        }
        let seconds = record.time_ns as f64 * 1e-9;
        writeln!(lines, "{seconds:14.6} {words}").map_err(io)?;
    }
    lines.flush().map_err(io)?;
    println!(
        "{records} records, {frames} frames: written {}",
        out.display()
    );
    Ok(())
}

/// A record in a line, its bytes escaped.
fn words(record: &Record) -> String {
    let channel = match record.channel {
        Channel::Recording => "recording",
        Channel::Control => "port",
        Channel::Usb => "usb port",
        Channel::Camera | Channel::Counted => "camera",
    };
    let what = match &record.event {
        Event::About(about) => format!("of {}", about.name.escape_default()),
        Event::Sent(bytes) => format!("< \"{}\"", bytes.escape_ascii()),
        Event::Received(bytes) => format!("> \"{}\"", bytes.escape_ascii()),
        Event::Opened => "opened".to_owned(),
        Event::Left => "left".to_owned(),
        Event::Frame(frame) => {
            let index = frame.pattern_index;
            let index = index.map_or("free".to_owned(), |index| format!("pattern {index}"));
            format!(
                "frame {}, {index}, {} x {}, {} to {} ns",
                frame.id, frame.width, frame.height, frame.exposure_start_ns, frame.exposure_end_ns
            )
        }
        Event::Note(text) => format!("note: {}", text.escape_debug()),
        Event::Cut(why) => format!("cut: {}", why.escape_debug()),
        Event::End => "ended in order".to_owned(),
        Event::Unplugged => "has gone".to_owned(),
        Event::Plugged => "is back".to_owned(),
    };
    format!("{channel} {what}")
}
