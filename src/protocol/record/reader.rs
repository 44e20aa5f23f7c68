//! Reads records with bounded memory and checks them, up to the first damage.

use super::{
    Channel, Event, FILE_MAGIC, HEAD_LEN, MAX_BYTES, MAX_PAYLOAD, MAX_TEXT, RECORD_LEN,
    RECORD_MAGIC, Record, VERSION,
};
use crate::wire::{self, FrameHeader};
use phasmid_core::error::{Error, Result};
use std::fmt;
use std::io::{ErrorKind, Read, Seek, SeekFrom};
use std::sync::Arc;

/// Where and why a recording becomes unreadable; all earlier records are intact.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Damage {
    /// Index of the damaged record.
    pub number: u64,
    /// File offset at which the record starts.
    pub offset: u64,
    /// Description of the damage.
    pub what: String,
}

impl fmt::Display for Damage {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self {
            number,
            offset,
            what,
        } = self;
        write!(f, "record {number} at byte {offset}: {what}")
    }
}

/// Reads the records of a recording in order. Damage is reported once; no records follow it. At most
/// one record is in memory, and never more bytes than the file contains.
pub struct Reader<R> {
    source: R,
    /// Index of the next record.
    number: u64,
    offset: u64,
    ended: bool,
}

/// Result of reading the file at one position.
enum Step {
    Known(Box<Record>),
    /// A record of an unknown kind or channel.
    Unknown,
    End,
}

/// Header fields of a record.
struct Head {
    kind: u16,
    channel: u16,
    time_ns: u64,
    len: usize,
    crc: u32,
}

impl<R: Read> Reader<R> {
    /// Creates a reader and checks the file header; `place` names the file in messages.
    ///
    /// # Errors
    /// Returns an error if the file cannot be read, is not a recording, or has another version.
    pub fn new(mut source: R, place: &str) -> Result<Self> {
        let allowed = "a recording of phasmid serve --record or phasmid scan --record";
        let refuse = |found: String| Err(Error::input(place, found, allowed));
        let head = take(&mut source, HEAD_LEN).map_err(|e| Error::io(place, e))?;
        if head.len() < HEAD_LEN {
            return refuse(format!("{} bytes, which is not a recording", head.len()));
        }
        if head[..8] != FILE_MAGIC {
            return refuse(format!(
                "starts with \"{}\", which is not a recording",
                head[..8].escape_ascii()
            ));
        }
        if crc32fast::hash(&head[..12]) != u32_at(&head, 12) {
            return refuse("the head of a recording, damaged: its checksum does not match".into());
        }
        let (version, len) = (u16_at(&head, 8), usize::from(u16_at(&head, 10)));
        if (version, len) != (VERSION, HEAD_LEN) {
            return Err(Error::input(
                place,
                format!("a recording of version {version}, with a head of {len} bytes"),
                format!("version {VERSION}, {HEAD_LEN} bytes"),
            ));
        }
        Ok(Self {
            source,
            number: 0,
            offset: HEAD_LEN as u64,
            ended: false,
        })
    }

    /// Returns the next record; `None` after the last.
    ///
    /// # Errors
    /// Returns the first damage as an error. A read failure counts as damage at that point.
    pub fn read(&mut self) -> Result<Option<Record>, Damage> {
        while !self.ended {
            let read = self.step();
            // No records are read after damage or after the end.
            self.ended = !matches!(read, Ok(Step::Known(_) | Step::Unknown));
            match read {
                Ok(Step::Known(record)) => return Ok(Some(*record)),
                Ok(Step::Unknown) => {}
                Ok(Step::End) => return Ok(None),
                Err(what) => {
                    return Err(Damage {
                        number: self.number,
                        offset: self.offset,
                        what,
                    });
                }
            }
        }
        Ok(None)
    }

    fn step(&mut self) -> Result<Step, String> {
        let bytes = take(&mut self.source, RECORD_LEN).map_err(|e| e.to_string())?;
        if bytes.is_empty() {
            return Ok(Step::End);
        }
        if bytes.len() < RECORD_LEN {
            return Err(format!("cut off after {} bytes", bytes.len()));
        }
        let head = self.head(&bytes)?;
        let payload = take(&mut self.source, head.len).map_err(|e| e.to_string())?;
        if payload.len() < head.len {
            return Err(format!(
                "cut off after {} of {} bytes",
                RECORD_LEN + payload.len(),
                RECORD_LEN + head.len
            ));
        }
        if crc32fast::hash(&payload) != head.crc {
            return Err("its payload is damaged: the checksum does not match".into());
        }
        let event = event(&head, payload)?;
        let (number, offset) = (self.number, self.offset);
        self.number += 1;
        self.offset += (RECORD_LEN + head.len) as u64;
        let Some((event, channel)) = event.zip(Channel::from_code(head.channel)) else {
            return Ok(Step::Unknown);
        };
        Ok(Step::Known(Box::new(Record {
            number,
            offset,
            time_ns: head.time_ns,
            channel,
            event,
        })))
    }

    fn head(&self, bytes: &[u8]) -> Result<Head, String> {
        if bytes[..4] != RECORD_MAGIC {
            return Err(format!(
                "starts with \"{}\", not with \"PHRR\"",
                bytes[..4].escape_ascii()
            ));
        }
        if crc32fast::hash(&bytes[..32]) != u32_at(bytes, 32) {
            return Err("its head is damaged: the checksum does not match".into());
        }
        let number = u64_at(bytes, 8);
        if number != self.number {
            return Err(format!("has number {number}: records are missing"));
        }
        let len = u32_at(bytes, 24) as usize;
        if len > MAX_PAYLOAD {
            return Err(format!(
                "{len} bytes of payload, expected at most {MAX_PAYLOAD}"
            ));
        }
        Ok(Head {
            kind: u16_at(bytes, 4),
            channel: u16_at(bytes, 6),
            time_ns: u64_at(bytes, 16),
            len,
            crc: u32_at(bytes, 28),
        })
    }
}

impl<R: Read + Seek> Reader<R> {
    /// Goes to a record that has been read before, given by its [`Record::number`] and
    /// [`Record::offset`]. The next call of [`Self::read`] returns this record.
    ///
    /// # Errors
    /// Returns an error if the file cannot be read.
    pub fn go_to(&mut self, number: u64, offset: u64) -> std::io::Result<()> {
        // If the next record is requested, data that has been read ahead is kept.
        if self.ended || self.offset != offset {
            self.source.seek(SeekFrom::Start(offset))?;
        }
        (self.number, self.offset, self.ended) = (number, offset, false);
        Ok(())
    }
}

/// Decodes a record's payload; `None` for an unknown kind.
fn event(head: &Head, payload: Vec<u8>) -> Result<Option<Event>, String> {
    let most = match head.kind {
        2 | 3 => MAX_BYTES,
        6 => MAX_PAYLOAD,
        4 | 5 | 9..=11 => 0,
        1 | 7 | 8 => MAX_TEXT,
        _ => return Ok(None),
    };
    let (kind, len) = (head.kind, payload.len());
    if len > most {
        return Err(format!(
            "{len} bytes of kind {kind}, expected at most {most}"
        ));
    }
    let text = |payload| String::from_utf8(payload).map_err(|_| "its text is not UTF-8".to_owned());
    Ok(Some(match kind {
        1 => {
            let about = serde_json::from_slice(&payload);
            Event::About(about.map_err(|e| format!("its description of the recording: {e}"))?)
        }
        2 => Event::Sent(payload),
        3 => Event::Received(payload),
        4 => Event::Opened,
        5 => Event::Left,
        6 => frame(payload)?,
        7 => Event::Note(text(payload)?),
        8 => Event::Cut(text(payload)?),
        10 => Event::Unplugged,
        11 => Event::Plugged,
        _ => Event::End,
    }))
}

fn frame(mut payload: Vec<u8>) -> Result<Event, String> {
    let header = payload.first_chunk::<{ wire::HEADER_LEN }>();
    let header = header.ok_or("a frame without its header")?;
    let header = FrameHeader::decode(header).map_err(|e| e.to_string())?;
    payload.drain(..wire::HEADER_LEN);
    let frame = header.with_payload(payload).map_err(|e| e.to_string())?;
    Ok(Event::Frame(Arc::new(frame)))
}

/// Reads up to `len` bytes, fewer at the end of the file; memory grows only with the bytes read.
fn take(source: &mut impl Read, len: usize) -> std::io::Result<Vec<u8>> {
    let mut bytes = Vec::new();
    match source.take(len as u64).read_to_end(&mut bytes) {
        Err(e) if e.kind() != ErrorKind::UnexpectedEof => Err(e),
        _ => Ok(bytes),
    }
}

fn u16_at(bytes: &[u8], at: usize) -> u16 {
    u16::from_le_bytes([bytes[at], bytes[at + 1]])
}

fn u32_at(bytes: &[u8], at: usize) -> u32 {
    u32::from_le_bytes(bytes[at..at + 4].try_into().expect("4 bytes"))
}

fn u64_at(bytes: &[u8], at: usize) -> u64 {
    u64::from_le_bytes(bytes[at..at + 8].try_into().expect("8 bytes"))
}
