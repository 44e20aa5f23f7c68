//! `phasmid record export`: writes the frames of a recording as images and the rest as text.

use super::recording::open;
use phasmid_core::error::{Error, Result};
use phasmid_core::new_file::{NewFile, check_folder};
use phasmid_core::output_folder::OutputFolder;
use phasmid_decode::{Capture, write_png};
use phasmid_protocol::Frame;
use phasmid_protocol::record::{Channel, Event, Record};
use std::io::Write;
use std::path::Path;

/// Name of the file in the output folder that contains the conversation as text.
const CONVERSATION: &str = "conversation.txt";

pub(super) fn run(path: &Path, out: &Path, force: bool) -> Result<()> {
    let mut reader = open(path)?;
    check_folder(out, [CONVERSATION], force)?;
    Capture::check_folder(out, force)?;
    let folder = OutputFolder::create(out, force)?;
    let text = folder.draft().join(CONVERSATION);
    let io = |e| Error::io(out.join(CONVERSATION), e);
    let mut lines = NewFile::create(&text, false)?;
    let (mut records, mut frames) = (0_u64, 0_u64);
    loop {
        let record = match reader.read() {
            Ok(Some(record)) => record,
            Ok(None) => break,
            Err(damage) => {
                writeln!(lines, "damaged: {damage}").map_err(io)?;
                eprintln!("phasmid: {}: {damage}", path.display());
                break;
            }
        };
        records += 1;
        let mut words = words(&record);
        if let Event::Frame(frame) = record.event {
            // Name frames by their number in the recording, because frame ids may repeat.
            let name = frame_name(frames);
            words = format!("{words}: {name}");
            write_png(
                &Frame::clone(&frame).into_image()?,
                &folder.draft().join(name),
                false,
            )?;
            frames += 1;
        }
        let seconds = record.time_ns as f64 * 1e-9;
        writeln!(lines, "{seconds:14.6} {words}").map_err(io)?;
    }
    lines.finish()?;
    let mut earlier = Capture::frames_in(out)?;
    // Replace only frames of an earlier export. The names of a scan's frames have fewer digits, so
    // they are not replaced.
    earlier.retain(|frame| frame.as_os_str().len() == frame_name(0).len());
    folder.sparing([path]).finish(earlier, Some(CONVERSATION))?;
    println!(
        "{records} records, {frames} frames: written {}",
        out.display()
    );
    Ok(())
}

fn frame_name(number: u64) -> String {
    format!("frame_{number:06}.png")
}

/// Describes a record in one line, with its bytes escaped.
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
        Event::End => "ended normally".to_owned(),
        Event::Unplugged => "disconnected".to_owned(),
        Event::Plugged => "reconnected".to_owned(),
    };
    format!("{channel} {what}")
}
