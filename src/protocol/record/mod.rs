//! Recordings: all bytes and frames exchanged between a device and its client, with timestamps, in
//! one append-only file. If the writer is killed, the disk is full or the power fails, the file can
//! still be read up to the last complete record; it needs no index.
//!
//! All numbers are little-endian. A file is a head of 16 bytes and records behind it:
//!
//! | offset | bytes | field of the head |
//! | --- | --- | --- |
//! | 0 | 8 | magic `PHREC\r\n\x1a` |
//! | 8 | 2 | version, 1 |
//! | 10 | 2 | length of the head, 16 |
//! | 12 | 4 | CRC-32 (IEEE 802.3) of the 12 bytes before |
//!
//! | offset | bytes | field of a record |
//! | --- | --- | --- |
//! | 0 | 4 | magic `PHRR` |
//! | 4 | 2 | kind, see below |
//! | 6 | 2 | channel: 0 the recording itself, 1 control port, 2 control port over USB, 3 camera, 4 camera whose frames only count |
//! | 8 | 8 | number of the record, from 0 without gaps |
//! | 16 | 8 | time in nanoseconds |
//! | 24 | 4 | length of the payload |
//! | 28 | 4 | CRC-32 of the payload |
//! | 32 | 4 | CRC-32 of the 32 bytes before |
//! | 36 | | payload |
//!
//! | kind | payload |
//! | --- | --- |
//! | 1 about | JSON of [`About`]: who recorded what, and when; the first record |
//! | 2 sent | bytes from the client to the device |
//! | 3 received | bytes from the device to the client |
//! | 4 opened | none: a client has opened the channel |
//! | 5 left | none: the channel's last client has left |
//! | 6 frame | a frame as on the frame socket, [`crate::wire`]: 72 bytes and the pixels |
//! | 7 note | text: something that happened, a damaged frame or a fault that struck; or the sequence of the frames around it, [`SequenceAbout::to_note`](crate::service::SequenceAbout::to_note) |
//! | 8 cut | text: why the recording ends here while the device went on |
//! | 9 end | none: the recording ended normally; the last record |
//! | 10 unplugged | none: the device's end of the channel disappeared, as when a cable is pulled |
//! | 11 plugged | none: the device's end of the channel is back |
//!
//! Readers skip unknown kinds. On the device side times are device time; on the host side they
//! count from the start of the recording. Each frame's header holds its format and size, so that a
//! change of format is visible where it happens.
//!
//! The file grows by the recorded data plus 36 bytes per record (108 per frame): a 640 x 480 GREY
//! camera at 30 frames per second produces 9.2 MB/s, a 1138 x 489 one 16.7 MB/s.
//!
//! Twenty lines of Python read the whole file:
//!
//! ```python
#![doc = include_str!("read.py")]
//! ```

mod encode;
mod reader;
mod recorder;
mod summary;
#[cfg(test)]
mod tests;

pub use encode::{encode_head, encode_record};
pub use reader::{Damage, Reader};
pub use recorder::{Limits, Recorder, Store};
pub use summary::{Channels, Ending, Format, Frames, Kind, Summary};

use super::Frame;
use super::wire;
use serde::{Deserialize, Serialize};
use std::fmt;
use std::sync::Arc;

/// Length of a file header in bytes.
pub const HEAD_LEN: usize = 16;
/// Length of a record without its payload in bytes.
pub const RECORD_LEN: usize = 36;
/// Maximum length in bytes of the text or JSON in a record; the writer truncates longer texts.
pub const MAX_TEXT: usize = 64 << 10;
/// Maximum number of port bytes in a record; longer data is split into several records.
pub const MAX_BYTES: usize = 1 << 20;
/// Maximum length in bytes of a payload: the payload of a frame with its header.
pub const MAX_PAYLOAD: usize = wire::HEADER_LEN + wire::MAX_PAYLOAD as usize;

const FILE_MAGIC: [u8; 8] = *b"PHREC\r\n\x1a";
const RECORD_MAGIC: [u8; 4] = *b"PHRR";
const VERSION: u16 = 1;

/// Side of the connection that was recorded.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Side {
    /// Device side: times are device time.
    Device,
    /// Host side: times count from the start of the recording.
    Host,
}

/// Description of the recorded device.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct About {
    /// Recorded side.
    pub side: Side,
    /// Recording program with its version.
    pub program: String,
    /// Start of the recording in seconds since 1970.
    pub started_unix_s: u64,
    /// Name of the device: its `*IDN?` on the device side, the address of its port on the host
    /// side.
    pub name: String,
    /// Address of the control port; empty if there is none.
    #[serde(default)]
    pub control: String,
    /// Address of the camera.
    #[serde(default)]
    pub camera: String,
    /// Profile as selected, if the device is emulated.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub profile: Option<String>,
    /// Scene as selected, if the device is emulated.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub scene: Option<String>,
    /// Noise seed, if the device is emulated.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub seed: Option<u64>,
    /// Host side: reading of the system's monotonic clock at time 0 of the recording, in
    /// nanoseconds. Most drivers timestamp their frames with this clock.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub monotonic_ns: Option<u64>,
}

/// Channel of a record.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
#[repr(u16)]
pub enum Channel {
    /// The recording itself.
    Recording = 0,
    /// The control port.
    Control = 1,
    /// The control port over USB.
    Usb = 2,
    /// The camera.
    Camera = 3,
    /// A camera that does not identify its frames: their ids are only a count.
    Counted = 4,
}

impl Channel {
    const ALL: [Self; 5] = [
        Self::Recording,
        Self::Control,
        Self::Usb,
        Self::Camera,
        Self::Counted,
    ];

    fn from_code(code: u16) -> Option<Self> {
        Self::ALL.get(usize::from(code)).copied()
    }

    /// Returns whether the channel is a control port.
    pub fn is_port(self) -> bool {
        matches!(self, Self::Control | Self::Usb)
    }
}

/// Content of a record.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Event {
    /// Description of the recorded device; the first record.
    About(About),
    /// Bytes from the client to the device.
    Sent(Vec<u8>),
    /// Bytes from the device to the client.
    Received(Vec<u8>),
    /// A client has opened the channel.
    Opened,
    /// The channel's last client has left.
    Left,
    /// A frame.
    Frame(Arc<Frame>),
    /// A note, for example on a damaged frame or a fault.
    Note(String),
    /// The recording ends here, for the given reason, while the device continues.
    Cut(String),
    /// The recording ended properly.
    End,
    /// The device's end of the channel is unplugged.
    Unplugged,
    /// The device's end of the channel is plugged in again.
    Plugged,
}

impl Event {
    /// Returns the number of the event's kind in a file.
    pub fn code(&self) -> u16 {
        match self {
            Self::About(_) => 1,
            Self::Sent(_) => 2,
            Self::Received(_) => 3,
            Self::Opened => 4,
            Self::Left => 5,
            Self::Frame(_) => 6,
            Self::Note(_) => 7,
            Self::Cut(_) => 8,
            Self::End => 9,
            Self::Unplugged => 10,
            Self::Plugged => 11,
        }
    }

    /// Returns the approximate size of the event in memory, in bytes.
    fn bytes(&self) -> usize {
        RECORD_LEN
            + match self {
                Self::Sent(bytes) | Self::Received(bytes) => bytes.len(),
                Self::Frame(frame) => wire::HEADER_LEN + frame.data.len(),
                Self::Note(text) | Self::Cut(text) => text.len(),
                Self::About(_)
                | Self::Opened
                | Self::Left
                | Self::End
                | Self::Unplugged
                | Self::Plugged => 0,
            }
    }
}

/// One record of a recording.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Record {
    /// Index, from 0.
    pub number: u64,
    /// Offset of the record in the file.
    pub offset: u64,
    /// Time in nanoseconds; see [`Side`].
    pub time_ns: u64,
    /// Channel.
    pub channel: Channel,
    /// Content.
    pub event: Event,
}

type Seen = dyn Fn(u64, Channel, &Event) + Send + Sync;

/// Receives the events of links as they happen: the same events as in a recording, at the same times
/// in nanoseconds.
///
/// It is called on the thread that serves the links, and must not block.
#[derive(Clone)]
pub struct Observer(Arc<Seen>);

impl Observer {
    /// Returns an observer that passes events to a function.
    pub fn new(seen: impl Fn(u64, Channel, &Event) + Send + Sync + 'static) -> Self {
        Self(Arc::new(seen))
    }

    /// Passes an event to the observer's function.
    pub fn see(&self, time_ns: u64, channel: Channel, event: &Event) {
        (self.0)(time_ns, channel, event);
    }
}

impl fmt::Debug for Observer {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("Observer")
    }
}
