//! Reads a recording ahead until there is a reason to stop.

use super::{End, Output, Player};
use phasmid_protocol::Frame;
use phasmid_protocol::record::{Channel, Event, Record};
use std::io::Read;

/// A frame that arrived this long after its time was timed by another clock.
const PLAUSIBLE_NS: u64 = 10_000_000_000;

/// Why reading has stopped.
#[derive(Debug, PartialEq, Eq)]
pub(super) enum Stop {
    /// Enough has been read ahead.
    Full,
    /// The client has to send this.
    Expect(Expected),
    /// The client has to disconnect: the recorded one did at this record and time.
    Leave(u64, u64),
    /// End of the recording.
    End,
}

#[derive(Debug, PartialEq, Eq)]
pub(super) struct Expected {
    pub(super) number: u64,
    pub(super) time_ns: u64,
    pub(super) bytes: Vec<u8>,
    /// Number of these bytes that have arrived.
    pub(super) matched: usize,
}

impl Expected {
    pub(super) fn rest(&self) -> &[u8] {
        &self.bytes[self.matched..]
    }

    pub(super) fn missing(&self) -> u64 {
        self.rest().len() as u64
    }
}

impl<R: Read> Player<R> {
    /// Reads until there is a reason to stop.
    pub(super) fn read(&mut self, now_ns: u64) {
        self.stop = Stop::Full;
        while !self.ahead.is_full() {
            let Record {
                number,
                time_ns,
                channel,
                event,
                ..
            } = match self.reader.read() {
                Ok(Some(record)) => record,
                Ok(None) => {
                    self.stop = Stop::End;
                    return;
                }
                Err(damage) => {
                    self.news
                        .push_back(format!("the recording is damaged and ends here: {damage}"));
                    self.stop = Stop::End;
                    return;
                }
            };
            self.place = (number, time_ns);
            // Time starts with the first event.
            if !self.started && !matches!(event, Event::About(_)) {
                self.started = true;
                self.anchor = self.anchor.map(|(_, replay_ns)| (time_ns, replay_ns));
            }
            match event {
                Event::Received(bytes) => {
                    self.unanswered = false;
                    self.put(time_ns, Output::Bytes(bytes), now_ns);
                }
                Event::Frame(frame) if channel == Channel::Counted => {
                    let taken_ns = self.taken(&frame, time_ns);
                    self.put(time_ns, Output::Counted(frame, taken_ns), now_ns);
                }
                Event::Frame(frame) => self.put(time_ns, Output::Frame(frame), now_ns),
                Event::Sent(bytes) if !bytes.is_empty() => {
                    (self.recorded_spoke, self.unanswered) = (true, true);
                    self.stop = Stop::Expect(Expected {
                        number,
                        time_ns,
                        bytes,
                        matched: 0,
                    });
                    return;
                }
                // A recorded client that sent nothing has no counterpart.
                Event::Left if channel.is_port() && self.recorded_spoke => {
                    self.stop = Stop::Leave(number, time_ns);
                    return;
                }
                Event::Unplugged => {
                    self.put(time_ns, Output::Gone(end_of(channel)), now_ns);
                    if channel.is_port() && self.recorded_spoke {
                        self.lost = self.unanswered;
                        self.stop = Stop::Leave(number, time_ns);
                        return;
                    }
                }
                Event::Plugged => self.put(time_ns, Output::Back(end_of(channel)), now_ns),
                Event::Cut(why) => self
                    .news
                    .push_back(format!("the recording was cut here: {why}")),
                _ => {}
            }
        }
    }

    /// Returns when a frame without an id was taken, in the time of the replay: as long before or
    /// after the client's bytes as recorded. If the driver's clock is unknown, when it arrived.
    fn taken(&self, frame: &Frame, time_ns: u64) -> u64 {
        let since = |zero_ns: u64| frame.exposure_end_ns.checked_sub(zero_ns);
        let taken_ns = self.monotonic_ns.and_then(since);
        let taken_ns = taken_ns.filter(|taken_ns| taken_ns.abs_diff(time_ns) < PLAUSIBLE_NS);
        let (recorded_ns, replay_ns) = self.anchor.unwrap_or((time_ns, 0));
        let taken_ns = taken_ns.unwrap_or(time_ns);
        (replay_ns.saturating_add(taken_ns)).saturating_sub(recorded_ns)
    }

    /// Schedules an action.
    fn put(&mut self, time_ns: u64, output: Output, now_ns: u64) {
        let (recorded_ns, replay_ns) = self.anchor.unwrap_or((time_ns, now_ns));
        let due_ns = replay_ns.saturating_add(time_ns.saturating_sub(recorded_ns));
        let due_ns = if self.fast { 0 } else { due_ns };
        self.ahead.put(due_ns, output, self.session);
    }
}

/// Returns the end of a channel.
fn end_of(channel: Channel) -> End {
    match channel.is_port() {
        true => End::Port,
        false => End::Camera,
    }
}
