//! Statistics of a recording.

use super::{About, Channel, Damage, Event, Reader, Record};
use crate::Frame;
use serde::Serialize;
use std::io::Read;

/// Maximum number of distinct frame formats (size and layout) listed. Frames of further formats are
/// only counted.
const MAX_FORMATS: usize = 64;

/// Totals for records of one kind.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize)]
pub struct Kind {
    /// Number of records.
    pub count: u64,
    /// Payload bytes, excluding record headers.
    pub bytes: u64,
}

/// Client connections.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize)]
pub struct Channels {
    /// Connections to the control port, over any link.
    pub control: u64,
    /// Connections to the camera.
    pub camera: u64,
}

/// Frames of one size and layout.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct Format {
    /// V4L2 four-character code.
    pub format: String,
    /// Columns.
    pub width: u32,
    /// Rows.
    pub height: u32,
    /// Number of frames.
    pub count: u64,
}

/// Frame statistics.
#[derive(Debug, Clone, Default, PartialEq, Eq, Serialize)]
pub struct Frames {
    /// Id of the first frame.
    pub first_id: Option<u64>,
    /// Id of the last frame.
    pub last_id: Option<u64>,
    /// Frames whose id is not one more than that of the previous frame.
    pub out_of_order: u64,
    /// Sizes and layouts, in order of first appearance.
    pub formats: Vec<Format>,
    /// Frames of sizes and layouts that are not listed in `formats`.
    pub of_other_formats: u64,
}

/// How a recording ends.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase", tag = "how", content = "why")]
pub enum Ending {
    /// Ended properly.
    Proper,
    /// The writer cut the recording, for the given reason.
    Cut(String),
    /// The end record is missing: the writer was killed or is still writing.
    Open,
    /// The file is damaged, as described.
    Damaged(String),
}

/// Statistics of a recording.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct Summary {
    /// Description of the recorded device, if the first record holds one.
    pub about: Option<About>,
    /// Time from the first record to the last, in nanoseconds.
    pub duration_ns: u64,
    /// Number of complete records.
    pub records: u64,
    /// Data sent by clients: `count` is the number of chunks as received, `bytes` their total size.
    pub sent: Kind,
    /// Number of newlines in the data sent by clients.
    pub lines_sent: u64,
    /// Data that the device sent on the control port.
    pub received: Kind,
    /// Frames, and their bytes of pixel data.
    pub frame: Kind,
    /// Notes.
    pub notes: Kind,
    /// Frame ids and formats.
    pub frames: Frames,
    /// Client connections per channel.
    pub clients: Channels,
    /// Number of times the port was unplugged.
    pub unplugged: u64,
    /// How the recording ends.
    pub ending: Ending,
    /// File offset of the first damage.
    pub damaged_at: Option<u64>,
}

impl Summary {
    /// Reads a whole recording and summarizes it.
    pub fn of<R: Read>(reader: &mut Reader<R>) -> Self {
        let mut summary = Self {
            about: None,
            duration_ns: 0,
            records: 0,
            sent: Kind::default(),
            lines_sent: 0,
            received: Kind::default(),
            frame: Kind::default(),
            notes: Kind::default(),
            frames: Frames::default(),
            clients: Channels::default(),
            unplugged: 0,
            ending: Ending::Open,
            damaged_at: None,
        };
        let mut start_ns = None;
        loop {
            match reader.read() {
                Ok(Some(record)) => {
                    let start_ns = *start_ns.get_or_insert(record.time_ns);
                    let since_ns = record.time_ns.saturating_sub(start_ns);
                    summary.duration_ns = summary.duration_ns.max(since_ns);
                    summary.add(record);
                }
                Ok(None) => return summary,
                Err(damage) => {
                    summary.end_in(&damage);
                    return summary;
                }
            }
        }
    }

    fn end_in(&mut self, damage: &Damage) {
        self.damaged_at = Some(damage.offset);
        // Keep the reason for the cut, which is more useful than a report of the partial record that
        // follows it.
        if !matches!(self.ending, Ending::Cut(_)) {
            self.ending = Ending::Damaged(damage.to_string());
        }
    }

    fn add(&mut self, record: Record) {
        self.records += 1;
        // If another record follows an end record, the end record does not count.
        self.ending = Ending::Open;
        let count = |kind: &mut Kind, len: usize| {
            kind.count += 1;
            kind.bytes += len as u64;
        };
        match record.event {
            Event::About(about) => self.about = self.about.take().or(Some(about)),
            Event::Sent(bytes) => {
                count(&mut self.sent, bytes.len());
                self.lines_sent += bytes.iter().filter(|&&b| b == b'\n').count() as u64;
            }
            Event::Received(bytes) => count(&mut self.received, bytes.len()),
            Event::Opened if record.channel.is_port() => self.clients.control += 1,
            Event::Opened if record.channel != Channel::Recording => self.clients.camera += 1,
            Event::Opened | Event::Left | Event::Plugged => {}
            Event::Unplugged => self.unplugged += 1,
            Event::Frame(frame) => {
                count(&mut self.frame, frame.data.len());
                self.frames.add(&frame);
            }
            Event::Note(text) => count(&mut self.notes, text.len()),
            Event::Cut(why) => self.ending = Ending::Cut(why),
            Event::End => self.ending = Ending::Proper,
        }
    }
}

impl Frames {
    fn add(&mut self, frame: &Frame) {
        self.first_id.get_or_insert(frame.id);
        let follows = self
            .last_id
            .is_none_or(|last| last.wrapping_add(1) == frame.id);
        self.out_of_order += u64::from(!follows);
        self.last_id = Some(frame.id);
        let code = frame.format.fourcc();
        let code = String::from_utf8_lossy(&code);
        let code = code.trim_end();
        let size = (frame.width, frame.height);
        let same = |f: &Format| f.format == code && (f.width, f.height) == size;
        match self.formats.iter().position(same) {
            Some(at) => self.formats[at].count += 1,
            None if self.formats.len() >= MAX_FORMATS => self.of_other_formats += 1,
            None => self.formats.push(Format {
                format: code.to_owned(),
                width: frame.width,
                height: frame.height,
                count: 1,
            }),
        }
    }
}
