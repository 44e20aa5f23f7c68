//! Splits a byte stream into a dialect's messages.
//!
//! After any error the stream resynchronises: a line dialect at the next line end, a packet dialect
//! at the next plausible header, with a matching checksum if packets have one. If packets have
//! neither start bytes nor a checksum, garbage that looks like a header consumes bytes of the
//! following packet; the client must then retry.

use super::command::LineEnds;
use super::packet::{Extent, Layout};
use super::value::{Direction, WireError};
use crate::scpi::{ErrorCode, Framer, Framing};
use std::sync::Arc;

/// Output of a cutter.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Cut {
    /// A message: a line without its end, or a complete packet.
    Message(Vec<u8>),
    /// Bytes were discarded, for the given reason. Reported once per run of discarded bytes, at its
    /// start.
    Dropped(WireError),
}

/// State of one stream. Its memory is bounded by the longest message.
#[derive(Debug, Clone)]
pub struct Cutter(State);

#[derive(Debug, Clone)]
enum State {
    Scpi(Framer),
    Lines(Lines),
    Packets(Packets),
}

#[derive(Debug, Clone)]
struct Lines {
    ends: Arc<LineEnds>,
    end: u8,
    buffer: Vec<u8>,
    /// Whether the rest of the present line is being discarded.
    skips: bool,
}

#[derive(Debug, Clone)]
struct Packets {
    layout: Arc<Layout>,
    direction: Direction,
    buffer: Vec<u8>,
    /// Whether bytes have been discarded since the last packet.
    dropping: bool,
}

impl Cutter {
    pub(super) fn scpi() -> Self {
        Self(State::Scpi(Framer::default()))
    }

    pub(super) fn lines(ends: Arc<LineEnds>, direction: Direction) -> Self {
        let end = match direction {
            Direction::ToDevice => &ends.to_device,
            Direction::ToHost => &ends.to_host,
        };
        Self(State::Lines(Lines {
            end: end.bytes().last().unwrap_or(b'\n'),
            ends,
            buffer: Vec::new(),
            skips: false,
        }))
    }

    pub(super) fn packets(layout: Arc<Layout>, direction: Direction) -> Self {
        Self(State::Packets(Packets {
            layout,
            direction,
            buffer: Vec::new(),
            dropping: false,
        }))
    }

    /// Takes received bytes and passes on every complete message.
    pub fn push(&mut self, bytes: &[u8], take: &mut dyn FnMut(Cut)) {
        match &mut self.0 {
            State::Scpi(framer) => framer.push(bytes, &mut |framing| {
                take(match framing {
                    Framing::Message(message) => Cut::Message(message),
                    Framing::Dropped(error) => Cut::Dropped(WireError::line(error)),
                });
            }),
            State::Lines(lines) => bytes.iter().for_each(|byte| lines.step(*byte, take)),
            State::Packets(packets) => {
                let piece = packets.layout.max;
                bytes
                    .chunks(piece)
                    .for_each(|bytes| packets.push(bytes, take));
            }
        }
    }

    /// Returns whether a partial message is pending whose remaining bytes cannot be distinguished
    /// from the next message. The caller must call [`Self::reset`] after a timeout.
    pub fn inside(&self) -> bool {
        match &self.0 {
            State::Scpi(framer) => framer.inside_block(),
            State::Lines(_) => false,
            State::Packets(packets) => !packets.buffer.is_empty(),
        }
    }

    /// Discards a partial message.
    pub fn reset(&mut self) {
        match &mut self.0 {
            State::Scpi(framer) => framer.reset(),
            State::Lines(lines) => {
                lines.buffer.clear();
                lines.skips = false;
            }
            State::Packets(packets) => {
                packets.buffer.clear();
                packets.dropping = false;
            }
        }
    }
}

impl Lines {
    fn step(&mut self, byte: u8, take: &mut dyn FnMut(Cut)) {
        if byte != self.end {
            if self.buffer.len() < self.ends.max {
                self.buffer.push(byte);
            } else {
                self.skips = true;
            }
            return;
        }
        let line = std::mem::take(&mut self.buffer);
        if std::mem::take(&mut self.skips) {
            let what = format!("up to {} bytes in a line", self.ends.max);
            let error = ErrorCode::InputBufferOverrun.with(what);
            take(Cut::Dropped(WireError::line(error)));
        } else if !self.ends.content(&line).is_empty() {
            take(Cut::Message(line.trim_ascii().to_vec()));
        }
    }
}

impl Packets {
    fn push(&mut self, bytes: &[u8], take: &mut dyn FnMut(Cut)) {
        self.buffer.extend_from_slice(bytes);
        let mut at = 0;
        while at < self.buffer.len() {
            let rest = &self.buffer[at..];
            let wrong = match self.layout.extent(rest, self.direction) {
                Extent::More => break,
                Extent::Whole { len, .. } if rest.len() < len => break,
                Extent::Whole { len, .. } => match self.layout.open(&rest[..len], self.direction) {
                    Ok(_) => {
                        self.dropping = false;
                        at += len;
                        take(Cut::Message(rest[..len].to_vec()));
                        continue;
                    }
                    Err(wrong) => wrong,
                },
                Extent::None => "bytes that do not start a packet".to_owned(),
            };
            at += 1;
            if !std::mem::replace(&mut self.dropping, true) {
                take(Cut::Dropped(WireError::damaged(wrong)));
            }
        }
        self.buffer.drain(..at);
    }
}
