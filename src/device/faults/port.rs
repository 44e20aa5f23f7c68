//! Faults of the control port: messages in both directions.

use super::armed::{Armed, Event, Way};
use super::chance::Draws;
use super::listener::Listener;
use super::{Faults, frame, ns};
use crate::port::Message;
use phasmid_protocol::dialect::Dialect;
use phasmid_protocol::faults::What;
use std::sync::Arc;

/// Maximum length of a message in bytes. A longer message passes in pieces, and faults strike only
/// its last piece.
const MAX_MESSAGE: usize = 1 << 20;

/// Bytes on their way to the device, after the faults have been applied.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Incoming {
    /// Bytes that arrive.
    Bytes(Vec<u8>),
    /// Reply of the device to a message that it refuses because it is busy; empty if the dialect has
    /// no such reply.
    Refused(Vec<u8>),
}

impl Faults {
    /// Sets the dialect of the control port; the default is SCPI.
    pub fn listen_to(&mut self, dialect: Option<&Arc<Dialect>>) {
        self.listener = Listener::new(dialect);
    }

    /// Passes bytes on to the device. As long as some fault may strike messages to the device, the
    /// bytes are delivered message by message.
    pub fn incoming(&mut self, bytes: &[u8], now_ns: u64) -> Vec<Incoming> {
        self.now_ns = self.now_ns.max(now_ns);
        if !self.connected(now_ns) {
            return Vec::new();
        }
        let to_device = |armed: &Armed| armed.way() == Way::ToDevice && !armed.is_over();
        let mut out = Vec::new();
        if !self.armed.iter().any(to_device) {
            self.unfinished.extend_from_slice(bytes);
            for byte in bytes {
                if let Some(command) = self.listener.hear(*byte) {
                    self.command = command;
                }
            }
            out.push(Incoming::Bytes(std::mem::take(&mut self.unfinished)));
            return out;
        }
        for byte in bytes {
            self.unfinished.push(*byte);
            if let Some(command) = self.listener.hear(*byte) {
                self.command = command;
                let message = std::mem::take(&mut self.unfinished);
                out.extend(self.message(message));
                if self.reset || !self.connected(now_ns) {
                    // The remaining bytes arrive after the disconnection or reset and are lost.
                    return out;
                }
            } else if self.unfinished.len() >= MAX_MESSAGE {
                out.push(Incoming::Bytes(std::mem::take(&mut self.unfinished)));
            }
        }
        out
    }

    /// Applies faults to one message on its way to the device.
    fn message(&mut self, mut message: Vec<u8>) -> Option<Incoming> {
        let command = self.command.clone();
        let event = Event {
            time_ns: self.now_ns,
            command: &command,
            triggered: None,
        };
        let mut refused = false;
        for (effect, mut draws) in self.strike(Way::ToDevice, &event, None) {
            match effect {
                What::BitErrors { count, rate, .. } => flip(&mut message, count, rate, &mut draws),
                What::Nak => refused = true,
                What::Disconnect { for_ms } => {
                    self.disconnect(ns(for_ms));
                    return None;
                }
                What::Reset => {
                    self.reset(None);
                    return None;
                }
                // All other effects are applied elsewhere in this module or to frames.
                _ => {}
            }
        }
        Some(match refused {
            true => Incoming::Refused(self.listener.busy(&message)),
            false => Incoming::Bytes(message),
        })
    }

    /// Accepts a message of the device on its way to the client.
    pub fn reply(&mut self, message: Message, now_ns: u64) {
        self.now_ns = self.now_ns.max(now_ns);
        if !self.connected(now_ns) {
            return;
        }
        let Message { mut bytes, to, .. } = message;
        let command = to.unwrap_or_else(|| self.command.clone());
        let event = Event {
            time_ns: now_ns,
            command: &command,
            triggered: None,
        };
        let (mut copies, mut late_ns) = (1, 0);
        for (effect, mut draws) in self.strike(Way::ToHost, &event, None) {
            match effect {
                What::NoReply => copies = 0,
                What::LateReply { by_ms } => late_ns += ns(by_ms),
                What::ReplyTwice => copies = 2 * copies.min(1),
                What::GarbageBefore { count } => insert(&mut bytes, 0, count, &mut draws),
                What::GarbageInside { count } => {
                    let at = 1 + draws.below(bytes.len().saturating_sub(1));
                    insert(&mut bytes, at, count, &mut draws);
                }
                What::BitErrors { count, rate, .. } => flip(&mut bytes, count, rate, &mut draws),
                // All other effects are applied elsewhere.
                _ => {}
            }
        }
        let due_ns = now_ns.saturating_add(late_ns);
        for _ in 0..copies {
            // A reply that does not fit into the queue is lost: the client is sending queries
            // without reading the replies.
            let _ = self
                .replies
                .push(now_ns, due_ns, bytes.len(), bytes.clone());
        }
    }

    /// Takes the messages to be sent by `now_ns`.
    pub fn replies(&mut self, now_ns: u64) -> Vec<Vec<u8>> {
        self.now_ns = self.now_ns.max(now_ns);
        std::iter::from_fn(|| self.replies.pop(now_ns)).collect()
    }

    /// Returns whether the control port is present.
    pub fn connected(&self, now_ns: u64) -> bool {
        now_ns >= self.gone_until_ns
    }

    /// Discards everything in transit when the client disconnects.
    pub fn hang_up(&mut self) {
        self.replies.clear();
        self.unfinished.clear();
        self.listener.reset();
    }

    /// Returns whether the beginning of a message is held back until the message is complete.
    pub fn holds_back(&self) -> bool {
        !self.unfinished.is_empty()
    }

    /// Returns an incomplete message whose remainder has stopped arriving.
    pub fn input_stalled(&mut self) -> Vec<u8> {
        self.listener.reset();
        std::mem::take(&mut self.unfinished)
    }
}

/// Inverts bits of a message: each bit with probability `rate` or, without a rate, `count` random
/// bits (1 by default).
fn flip(bytes: &mut [u8], count: Option<u32>, rate: Option<f64>, draws: &mut Draws) {
    match rate {
        None => frame::bits_flipped(bytes, count.unwrap_or(1), draws),
        Some(rate) => {
            for byte in bytes {
                for bit in 0..8 {
                    *byte ^= u8::from(draws.unit() < rate) << bit;
                }
            }
        }
    }
}

/// Inserts random bytes.
fn insert(bytes: &mut Vec<u8>, at: usize, count: u32, draws: &mut Draws) {
    let garbage: Vec<u8> = (0..count).map(|_| draws.below(256) as u8).collect();
    let at = at.min(bytes.len());
    bytes.splice(at..at, garbage);
}
