//! The recent traffic between a scanner and its host.

use phasmid_protocol::printable;
use phasmid_protocol::record::{Channel, Event};
use serde::Serialize;
use std::collections::VecDeque;

/// Maximum number of events that are kept, not counting free-running frames.
const MAX_EVENTS: usize = 2000;
/// Maximum number of free-running frames that are kept. They are stored separately, because
/// otherwise they would displace all other events.
const MAX_FREE: usize = 300;
/// Maximum number of bytes shown per message.
const MAX_BYTES: usize = 400;

/// An event.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub(crate) struct Entry {
    /// Number among the scanner's events, from 1.
    pub(crate) number: u64,
    time_s: f64,
    channel: &'static str,
    what: &'static str,
    /// The message or note, with control characters escaped.
    #[serde(skip_serializing_if = "Option::is_none")]
    text: Option<String>,
    /// Number of bytes of the message.
    #[serde(skip_serializing_if = "Option::is_none")]
    bytes: Option<usize>,
    #[serde(skip_serializing_if = "Option::is_none")]
    frame: Option<FrameEntry>,
}

#[derive(Debug, Clone, PartialEq, Serialize)]
struct FrameEntry {
    id: u64,
    pattern: Option<u32>,
    /// Start and end of the exposure, if both are on the same clock as the event's time.
    exposure_s: Option<[f64; 2]>,
}

/// The recent events.
#[derive(Default)]
pub(crate) struct Traffic {
    events: VecDeque<Entry>,
    free: VecDeque<Entry>,
    count: u64,
    /// Whether the times of events are on the device's clock.
    device_times: bool,
    last_ns: Option<u64>,
}

impl Traffic {
    /// Forgets all events.
    pub(crate) fn restart(&mut self, device_times: bool) {
        self.events.clear();
        self.free.clear();
        (self.device_times, self.last_ns) = (device_times, None);
    }

    /// Returns whether the times of events are on the device's clock.
    pub(crate) fn has_device_times(&self) -> bool {
        self.device_times
    }

    /// Returns the time of the last event.
    pub(crate) fn last_ns(&self) -> Option<u64> {
        self.last_ns
    }

    /// Adds an event.
    pub(crate) fn push(&mut self, time_ns: u64, channel: Channel, event: &Event) {
        let (what, text, bytes, frame) = match event {
            Event::Sent(bytes) => ("sent", Some(shown(bytes)), Some(bytes.len()), None),
            Event::Received(bytes) => ("received", Some(shown(bytes)), Some(bytes.len()), None),
            Event::Frame(frame) => {
                let times = [frame.exposure_start_ns, frame.exposure_end_ns];
                let comparable = channel == Channel::Camera && self.device_times;
                let entry = FrameEntry {
                    id: frame.id,
                    pattern: frame.pattern_index,
                    exposure_s: { comparable }.then(|| times.map(|ns| ns as f64 * 1e-9)),
                };
                ("frame", None, Some(frame.data.len()), Some(entry))
            }
            Event::Note(text) => ("note", Some(shown(text.as_bytes())), None, None),
            Event::Opened => ("opened", None, None, None),
            Event::Left => ("left", None, None, None),
            Event::Unplugged => ("unplugged", None, None, None),
            Event::Plugged => ("plugged", None, None, None),
            Event::About(_) | Event::Cut(_) | Event::End => return,
        };
        self.count += 1;
        self.last_ns = Some(time_ns);
        let is_free = frame.as_ref().is_some_and(|frame| frame.pattern.is_none());
        let (kept, most) = match is_free {
            true => (&mut self.free, MAX_FREE),
            false => (&mut self.events, MAX_EVENTS),
        };
        if kept.len() == most {
            kept.pop_front();
        }
        kept.push_back(Entry {
            number: self.count,
            time_s: time_ns as f64 * 1e-9,
            channel: match channel {
                Channel::Recording => "device",
                Channel::Control => "port",
                Channel::Usb => "USB port",
                Channel::Camera | Channel::Counted => "camera",
            },
            what,
            text,
            bytes,
            frame,
        });
    }

    /// Returns the events that are still kept and have a number greater than `number`.
    pub(crate) fn after(&self, number: u64) -> Vec<Entry> {
        let new = |kept: &VecDeque<Entry>| {
            let begin = kept.partition_point(|entry| entry.number <= number);
            kept.range(begin..).cloned().collect::<Vec<_>>()
        };
        let mut all = [new(&self.events), new(&self.free)].concat();
        all.sort_unstable_by_key(|entry| entry.number);
        all
    }
}

/// Returns the start of a message, with control characters escaped.
fn shown(bytes: &[u8]) -> String {
    let start = &bytes[..bytes.len().min(MAX_BYTES)];
    let mut text = printable(&String::from_utf8_lossy(start));
    if bytes.len() > MAX_BYTES {
        text.push('…');
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_recent_events_are_kept() {
        let mut traffic = Traffic::default();
        for i in 0..MAX_EVENTS as u64 + 5 {
            traffic.push(i, Channel::Control, &Event::Sent(vec![b'a'; 3]));
        }
        let numbers = |after| {
            traffic
                .after(after)
                .iter()
                .map(|entry| entry.number)
                .collect::<Vec<_>>()
        };
        assert_eq!(numbers(0).len(), MAX_EVENTS);
        assert_eq!(numbers(0)[0], 6);
        assert_eq!(numbers(2003), [2004, 2005]);
        assert_eq!(numbers(2005), [0; 0]);
    }

    #[test]
    fn messages_are_escaped_and_cut() {
        let mut traffic = Traffic::default();
        traffic.push(
            1_500_000_000,
            Channel::Control,
            &Event::Received(b"1,\x1b[2J\n".to_vec()),
        );
        traffic.push(2, Channel::Usb, &Event::Sent(vec![b'x'; 500]));
        let [reply, long] = &traffic.after(0)[..] else {
            panic!()
        };
        assert_eq!(reply.text.as_deref(), Some("1,\\u{1b}[2J\\n"));
        assert_eq!(
            (reply.time_s, reply.what, reply.bytes),
            (1.5, "received", Some(7))
        );
        assert_eq!(long.text.as_ref().unwrap().chars().count(), MAX_BYTES + 1);
    }
}
