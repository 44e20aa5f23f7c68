//! Plays a recording to a client: compares the client's bytes with the recorded ones and schedules
//! the recorded output of the device. The player neither waits nor reads a clock.
//!
//! The device's output follows the client's bytes that were recorded before it, with the recorded
//! delay. A client may send its bytes without waiting for the answers to earlier ones. A session is
//! everything that a client sends between connecting and disconnecting. A disconnection ends the
//! session, and the next client is compared with the next session.

use super::ahead::{Ahead, End, Output};
use super::departure::{Departure, Said};
use phasmid_protocol::Frame;
use phasmid_protocol::record::{Channel, Event, Reader, Record};
use std::collections::VecDeque;
use std::io::Read;

/// Maximum number of client bytes that wait to be compared with the recording.
const MAX_INPUT: usize = 64 << 10;
/// A frame whose timestamp differs by at least this much from its arrival was timestamped by another
/// clock.
const PLAUSIBLE_NS: u64 = 10_000_000_000;

/// Reason why reading the recording has stopped.
#[derive(Debug, PartialEq, Eq)]
enum Stop {
    /// Enough has been read ahead.
    Full,
    /// The client has to send these bytes.
    Expect(Expected),
    /// The client has to disconnect, as the recorded client did at the record with this number and
    /// time.
    Leave(u64, u64),
    /// End of the recording.
    End,
}

#[derive(Debug, PartialEq, Eq)]
struct Expected {
    number: u64,
    time_ns: u64,
    bytes: Vec<u8>,
    /// Number of these bytes that have arrived.
    matched: usize,
}

impl Expected {
    fn rest(&self) -> &[u8] {
        &self.bytes[self.matched..]
    }

    fn missing(&self) -> u64 {
        self.rest().len() as u64
    }
}

/// Result of a replay: how far clients followed the recording.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Outcome {
    /// Number of sessions in which a client departed from the recording.
    pub departures: u64,
    /// Number of recorded client bytes that clients of the replay have sent too.
    pub matched_bytes: u64,
    /// Number of recorded client bytes that clients of the replay have not sent.
    pub missing_bytes: u64,
}

/// A recording and the present position in it.
pub(super) struct Player<R> {
    reader: Reader<R>,
    stop: Stop,
    /// Whether recorded delays are skipped.
    fast: bool,
    /// See [`phasmid_protocol::record::About`].
    monotonic_ns: Option<u64>,
    /// Whether the client of this session has sent something.
    spoke: bool,
    /// Whether the client has departed from the recording and therefore gets no answers.
    astray: bool,
    /// Whether the client has disconnected while the recording has not reached the recorded
    /// disconnection yet.
    gone: bool,
    /// Whether the recorded client of this session has sent something.
    recorded_spoke: bool,
    /// Whether the device has sent nothing since the recorded client's last bytes.
    unanswered: bool,
    /// Whether the port was disconnected while the recorded client was sending. Further bytes of the
    /// client are then lost, as in the recording.
    lost: bool,
    /// A recorded time and the time of the replay that corresponds to it. Nothing is sent before
    /// both are known.
    anchor: Option<(u64, u64)>,
    /// Whether the first recorded event has been read; the anchor's recorded time is the time of
    /// that event.
    started: bool,
    ahead: Ahead,
    /// Number of finished sessions.
    session: u64,
    /// Bytes received and not compared yet.
    input: VecDeque<u8>,
    /// Number and time of the last record read.
    place: (u64, u64),
    outcome: Outcome,
    news: VecDeque<String>,
}

impl<R: Read> Player<R> {
    /// Returns a player at the start of a recording; `fast` skips the recorded delays.
    /// `monotonic_ns` is the reading, at time 0 of the recording, of the clock that timestamps
    /// frames without an id.
    pub(super) fn new(reader: Reader<R>, fast: bool, monotonic_ns: Option<u64>) -> Self {
        Self {
            reader,
            stop: Stop::Full,
            fast,
            monotonic_ns,
            spoke: false,
            astray: false,
            gone: false,
            recorded_spoke: false,
            unanswered: false,
            lost: false,
            anchor: None,
            started: false,
            ahead: Ahead::default(),
            session: 0,
            input: VecDeque::new(),
            place: (0, 0),
            outcome: Outcome::default(),
            news: VecDeque::new(),
        }
    }

    /// Starts the time of the replay, if it is not running yet, when a client connects to the port
    /// or the camera.
    pub(super) fn begin(&mut self, now_ns: u64) {
        if self.anchor.is_none() {
            self.anchor = Some((0, now_ns));
            self.go_on(now_ns);
        }
    }

    /// Receives bytes of the client.
    pub(super) fn receive(&mut self, bytes: &[u8], now_ns: u64) {
        self.begin(now_ns);
        if !self.astray {
            self.spoke = true;
            self.input.extend(bytes);
            self.go_on(now_ns);
        }
    }

    /// Returns whether the port may be read: not while many bytes wait for comparison, and not
    /// before the session of a disconnected client has ended.
    pub(super) fn listens(&self) -> bool {
        !self.gone && self.input.len() < MAX_INPUT
    }

    /// Handles a disconnection. The disconnection of a client that sent nothing is ignored.
    pub(super) fn hang_up(&mut self, now_ns: u64) {
        if self.spoke {
            self.gone = true;
            self.go_on(now_ns);
        }
    }

    /// Returns the next action that is due.
    pub(super) fn next(&mut self, now_ns: u64) -> Option<Output> {
        while self.next_event_ns().is_some_and(|due_ns| due_ns <= now_ns) {
            let due = self.ahead.take()?;
            // Output for a disconnected client is lost, as on a physical line.
            let heard = !self.gone && due.session == self.session;
            // The client loses the port.
            self.gone |= self.spoke && due.output == Output::Gone(End::Port);
            self.go_on(now_ns);
            if heard || !matches!(due.output, Output::Bytes(_)) {
                return Some(due.output);
            }
        }
        None
    }

    /// Returns when the next action is due, provided that no client input arrives earlier.
    pub(super) fn next_event_ns(&self) -> Option<u64> {
        self.ahead.next_ns()
    }

    /// Takes a message for the operator.
    pub(super) fn news(&mut self) -> Option<String> {
        self.news.pop_front()
    }

    /// Reads the rest of the recording and returns the result of the replay.
    pub(super) fn finish(mut self) -> Outcome {
        loop {
            if let Stop::Expect(expected) = &self.stop {
                self.outcome.missing_bytes += expected.missing();
            }
            if self.stop == Stop::End {
                return self.outcome;
            }
            self.ahead.forget();
            self.read(0);
        }
    }

    /// Reads the recording and compares the client's bytes with it as far as possible.
    fn go_on(&mut self, now_ns: u64) {
        loop {
            let going = match self.astray {
                true => self.gone && self.skip(now_ns),
                false => self.step(now_ns),
            };
            if !going {
                return;
            }
        }
    }

    /// Skips a record of a session whose client departed from the recording and disconnected;
    /// always makes progress.
    fn skip(&mut self, now_ns: u64) -> bool {
        self.ahead.forget();
        match &self.stop {
            Stop::Full => self.read(now_ns),
            Stop::Expect(expected) => {
                self.outcome.missing_bytes += expected.missing();
                self.stop = Stop::Full;
            }
            Stop::Leave(..) | Stop::End => self.next_session(now_ns),
        }
        true
    }

    /// Takes one step; returns `false` if it needs client input or elapsed time first.
    fn step(&mut self, now_ns: u64) -> bool {
        match &mut self.stop {
            Stop::Full => {
                self.read(now_ns);
                self.stop != Stop::Full
            }
            Stop::Expect(expected) => {
                let Some(byte) = self.input.pop_front() else {
                    if self.gone {
                        let rest = Said::Bytes(expected.rest().to_vec());
                        let place = (expected.number, expected.time_ns);
                        self.depart(place, rest, Said::Words("the client has left"));
                    }
                    return self.gone;
                };
                if byte == expected.bytes[expected.matched] {
                    expected.matched += 1;
                    self.outcome.matched_bytes += 1;
                    if expected.rest().is_empty() {
                        self.anchor = Some((expected.time_ns, now_ns));
                        self.stop = Stop::Full;
                    }
                } else {
                    let mut came = expected.bytes[..expected.matched].to_vec();
                    came.push(byte);
                    came.extend(&self.input);
                    let bytes = Said::Bytes(expected.bytes.clone());
                    let place = (expected.number, expected.time_ns);
                    self.depart(place, bytes, Said::Bytes(came));
                }
                true
            }
            Stop::Leave(..) if self.lost && !self.input.is_empty() => {
                self.input.clear();
                true
            }
            Stop::Leave(number, time_ns) if !self.input.is_empty() => {
                let place = (*number, *time_ns);
                self.depart_with_input(place, "the client to leave");
                true
            }
            Stop::End if !self.input.is_empty() => {
                let place = (self.place.0 + 1, self.place.1);
                self.depart_with_input(place, "nothing more, as the recording ends here");
                true
            }
            Stop::Leave(..) | Stop::End => {
                let gone = self.gone;
                if gone {
                    self.next_session(now_ns);
                }
                gone
            }
        }
    }

    fn depart_with_input(&mut self, place: (u64, u64), expected: &'static str) {
        let came = self.input.iter().copied().collect();
        self.depart(place, Said::Words(expected), Said::Bytes(came));
    }

    /// Records where the client departed from the recording. The client then gets no further
    /// answers.
    fn depart(&mut self, (number, time_ns): (u64, u64), expected: Said, came: Said) {
        let departure = Departure {
            number,
            time_ns,
            expected,
            came,
        };
        self.news.push_back(format!(
            "the client departs from the recording: {departure}"
        ));
        self.outcome.departures += 1;
        self.astray = true;
        self.input.clear();
        self.ahead.forget();
    }

    /// Moves to the start of the next session.
    fn next_session(&mut self, now_ns: u64) {
        (self.spoke, self.astray, self.gone) = (false, false, false);
        (self.recorded_spoke, self.unanswered, self.lost) = (false, false, false);
        self.session += 1;
        if let Stop::Leave(_, time_ns) = self.stop {
            self.anchor = Some((time_ns, now_ns));
            self.stop = Stop::Full;
        }
    }
}

impl<R: Read> Player<R> {
    /// Reads the recording until there is a reason to stop.
    fn read(&mut self, now_ns: u64) {
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
            // Recorded time starts with the first event.
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
                // The session of a recorded client that sent nothing has no counterpart in the
                // replay.
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
    /// after the client's bytes as in the recording. If the driver's clock is unknown, returns the
    /// time at which the frame arrived.
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

/// Returns the end of the device that a channel belongs to.
fn end_of(channel: Channel) -> End {
    match channel.is_port() {
        true => End::Port,
        false => End::Camera,
    }
}

#[cfg(test)]
#[path = "player_tests.rs"]
mod tests;
