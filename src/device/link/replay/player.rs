//! Plays a recording to a client: compares what it sends with what was sent, and says what answers
//! when. It neither waits nor reads a clock.
//!
//! Whatever the device said in the recording comes after the client's bytes that were recorded
//! before it, as long after them as it did then. A client may send ahead of the answers. What a
//! client said between its coming and its leaving is a session; a client that leaves ends its
//! session, and the next one's bytes are compared with the next session's.

mod reading;

use super::ahead::{Ahead, End, Output};
use super::departure::{Departure, Said};
use phasmid_protocol::record::Reader;
use reading::Stop;
use std::collections::VecDeque;
use std::io::Read;

/// Bytes of a client that may wait until they are compared.
const MAX_INPUT: usize = 64 << 10;

/// How far a recording was followed.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Outcome {
    /// Sessions in which a client left the recorded path.
    pub departures: u64,
    /// Bytes of recorded clients that came again.
    pub matched_bytes: u64,
    /// Bytes of recorded clients that have not come.
    pub missing_bytes: u64,
}

/// A recording and the place that has been reached in it.
pub(super) struct Player<R> {
    reader: Reader<R>,
    stop: Stop,
    /// Whether everything happens at once.
    fast: bool,
    /// See [`phasmid_protocol::record::About`].
    monotonic_ns: Option<u64>,
    /// The client of this session has said something,
    spoke: bool,
    /// has left its path and gets no answers,
    astray: bool,
    /// has left the port; the recording is still to be read up to where the recorded one did.
    gone: bool,
    /// The recorded client of this session has said something.
    recorded_spoke: bool,
    /// and the device has not said anything since.
    unanswered: bool,
    /// The port went while the recorded client was speaking: what else a client says then is lost
    /// with it, as it was then.
    lost: bool,
    /// A time of the recording and the same moment of the replay; nothing goes out before there is
    /// one.
    anchor: Option<(u64, u64)>,
    /// The recording's first time is the anchor's.
    started: bool,
    ahead: Ahead,
    /// Sessions that are over.
    session: u64,
    /// What came and has not been compared.
    input: VecDeque<u8>,
    /// Number and time of the last record that was read.
    place: (u64, u64),
    outcome: Outcome,
    news: VecDeque<String>,
}

impl<R: Read> Player<R> {
    /// Stands at the beginning of a recording; `fast` leaves the recorded delays out.
    /// `monotonic_ns` is the clock of frames that only count at the recording's time 0.
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

    /// Somebody has come, to the port or to the camera: time starts to run, if it does not yet.
    pub(super) fn begin(&mut self, now_ns: u64) {
        if self.anchor.is_none() {
            self.anchor = Some((0, now_ns));
            self.go_on(now_ns);
        }
    }

    /// Takes bytes of the client.
    pub(super) fn receive(&mut self, bytes: &[u8], now_ns: u64) {
        self.begin(now_ns);
        if !self.astray {
            self.spoke = true;
            self.input.extend(bytes);
            self.go_on(now_ns);
        }
    }

    /// Whether the port may be listened to: not while much waits to be compared, nor before a
    /// session is over whose client has left.
    pub(super) fn listens(&self) -> bool {
        !self.gone && self.input.len() < MAX_INPUT
    }

    /// The client has left. One that has said nothing was none.
    pub(super) fn hang_up(&mut self, now_ns: u64) {
        if self.spoke {
            self.gone = true;
            self.go_on(now_ns);
        }
    }

    /// What the device does by now.
    pub(super) fn next(&mut self, now_ns: u64) -> Option<Output> {
        while self.next_event_ns().is_some_and(|due_ns| due_ns <= now_ns) {
            let due = self.ahead.take()?;
            // What is said to a client that has left goes nowhere, as on a wire.
            let heard = !self.gone && due.session == self.session;
            // Whoever was there has lost the port.
            self.gone |= self.spoke && due.output == Output::Gone(End::Port);
            self.go_on(now_ns);
            if heard || !matches!(due.output, Output::Bytes(_)) {
                return Some(due.output);
            }
        }
        None
    }

    /// When the device does something next, unless a client comes before.
    pub(super) fn next_event_ns(&self) -> Option<u64> {
        self.ahead.next_ns()
    }

    /// What whoever looks after the replay should know.
    pub(super) fn news(&mut self) -> Option<String> {
        self.news.pop_front()
    }

    /// How far the recording has been followed; reads the rest of it.
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

    /// Reads and compares as far as it goes.
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

    /// Leaves out a piece of a session whose client was astray and has left; always goes on.
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

    /// A step along the path; false when there is none before something happens.
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

    /// Says where the client left the path; it gets no answers any more.
    fn depart(&mut self, (number, time_ns): (u64, u64), expected: Said, came: Said) {
        let departure = Departure {
            number,
            time_ns,
            expected,
            came,
        };
        self.news
            .push_back(format!("the client leaves the recorded path: {departure}"));
        self.outcome.departures += 1;
        self.astray = true;
        self.input.clear();
        self.ahead.forget();
    }

    /// Stands where the next client's session begins.
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

#[cfg(test)]
#[path = "player_tests.rs"]
mod tests;
