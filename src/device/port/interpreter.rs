//! Executes messages of a dialect one after the other: parses each message, runs its firmware
//! messages and replies.

use crate::Firmware;
use crate::firmware::{Before, Done};
use phasmid_protocol::dialect::{Asked, Cut, Cutter, Dialect, Direction, WireError};
use phasmid_protocol::scpi::{DeviceError, ErrorCode};
use std::collections::VecDeque;
use std::sync::Arc;

/// Maximum number of queued requests.
const MAX_REQUESTS: usize = 64;

/// A message of the device to its client.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Message {
    /// The bytes on the wire.
    pub bytes: Vec<u8>,
    /// The received line, or the command name of the received packet, that this message answers;
    /// `None` for an unsolicited message.
    pub to: Option<String>,
}

/// Returns an unsolicited message.
pub(super) fn unasked(bytes: Vec<u8>) -> Message {
    Message {
        bytes,
        ..Message::default()
    }
}

/// A request of the client that has not been answered yet.
#[derive(Debug)]
struct Request {
    asked: Asked,
    to: String,
    /// Firmware messages still to be executed for this request.
    left: VecDeque<String>,
    answers: Vec<Vec<u8>>,
    /// Ticket of the firmware message in progress.
    ticket: Option<u64>,
    /// Whether the request executes even while earlier requests wait: a trigger or an abort.
    urgent: bool,
    /// Snapshot of the settings before the request started, or before it continued after a wait.
    before: Option<Before>,
}

/// Translates between a dialect and the firmware's messages.
#[derive(Debug)]
pub(super) struct Interpreter {
    dialect: Arc<Dialect>,
    cutter: Cutter,
    requests: VecDeque<Request>,
    tickets: u64,
    said: Vec<Message>,
}

impl Interpreter {
    pub(super) fn new(dialect: Arc<Dialect>) -> Self {
        Self {
            cutter: dialect.cutter(Direction::ToDevice),
            requests: VecDeque::new(),
            tickets: 0,
            said: Vec::new(),
            dialect,
        }
    }

    pub(super) fn receive(&mut self, bytes: &[u8], firmware: &mut Firmware, now_ns: u64) {
        let mut cuts = Vec::new();
        self.cutter.push(bytes, &mut |cut| cuts.push(cut));
        for cut in cuts {
            match cut {
                Cut::Message(message) => self.message(&message, firmware, now_ns),
                Cut::Dropped(error) => self.not_understood(&error, String::new()),
            }
        }
    }

    pub(super) fn collect(&mut self, firmware: &mut Firmware, now_ns: u64) -> Vec<Message> {
        self.run(firmware, now_ns);
        std::mem::take(&mut self.said)
    }

    /// Discards unfinished input and requests. Call after the firmware has discarded its messages.
    pub(super) fn clear(&mut self) {
        self.cutter.reset();
        self.requests.clear();
        self.said.clear();
    }

    pub(super) fn inside(&self) -> bool {
        self.cutter.inside()
    }

    pub(super) fn input_stalled(&mut self) {
        if self.cutter.inside() {
            self.cutter.reset();
        }
    }

    fn message(&mut self, message: &[u8], firmware: &mut Firmware, now_ns: u64) {
        if self.dialect.echo() {
            self.said.push(unasked(self.dialect.echoed(message)));
        }
        let line = || String::from_utf8_lossy(message).trim_end().to_owned();
        let asked = match self.dialect.asked(message) {
            Ok(asked) => asked,
            Err(error) => return self.not_understood(&error, line()),
        };
        let to = match self.dialect.has_sequence() {
            true => asked.command.clone(),
            false => line(),
        };
        let left: VecDeque<_> = self.dialect.runs(&asked).into();
        let urgent = left.iter().all(|m| Firmware::acts_at_once(m.as_bytes())) && !left.is_empty();
        // An urgent request is accepted even beyond the limit, since it may be the only way to end
        // the wait.
        if self.requests.len() >= MAX_REQUESTS + usize::from(urgent) {
            let error = ErrorCode::InputBufferOverrun.with("too many requests are pending");
            let bytes = self.dialect.refusal(&asked, &error);
            return self.say(bytes, to);
        }
        self.requests.push_back(Request {
            urgent,
            before: None,
            asked,
            to,
            left,
            answers: Vec::new(),
            ticket: None,
        });
        self.run(firmware, now_ns);
    }

    fn not_understood(&mut self, error: &WireError, to: String) {
        let bytes = self.dialect.nack(error);
        if !bytes.is_empty() {
            self.said.push(Message {
                bytes,
                to: Some(to),
            });
        }
    }

    fn say(&mut self, bytes: Vec<u8>, to: String) {
        if !bytes.is_empty() {
            self.said.push(Message {
                bytes,
                to: Some(to),
            });
        }
    }

    /// Executes the requests until the firmware makes one of them wait. The firmware messages of the
    /// first request execute one by one until one fails, and so do the messages of urgent requests
    /// behind it. If a message fails, the settings that its request has made since the request's
    /// last wait are restored.
    fn run(&mut self, firmware: &mut Firmware, now_ns: u64) {
        loop {
            for done in firmware.take_done() {
                self.done(done, firmware);
            }
            let free = |(index, request): (usize, &Request)| {
                request.ticket.is_none() && (index == 0 || request.urgent)
            };
            let Some(index) = self.requests.iter().enumerate().position(free) else {
                // Time passes now, so settings made so far can no longer be undone.
                self.requests.iter_mut().for_each(|r| r.before = None);
                return;
            };
            let request = &mut self.requests[index];
            match request.left.pop_front() {
                Some(message) => {
                    request.before.get_or_insert_with(|| {
                        firmware.advance(now_ns);
                        firmware.before()
                    });
                    request.ticket = Some(self.tickets);
                    firmware.submit(message.as_bytes(), self.tickets, now_ns);
                    self.tickets += 1;
                }
                None => {
                    if let Some(request) = self.requests.remove(index) {
                        self.answer(request, firmware);
                    }
                }
            }
        }
    }

    /// Records the result of a firmware message. After the first error, the rest of its request is
    /// dropped.
    fn done(&mut self, done: Done, firmware: &mut Firmware) {
        let of = |request: &Request| request.ticket == Some(done.ticket);
        let Some(index) = self.requests.iter().position(of) else {
            return;
        };
        let Some(error) = done.errors.first() else {
            let request = &mut self.requests[index];
            request.ticket = None;
            request.answers.push(done.answers.join(&b';'));
            return;
        };
        if let Some(request) = self.requests.remove(index) {
            self.refuse(request, error, firmware);
        }
    }

    fn answer(&mut self, request: Request, firmware: &mut Firmware) {
        match self.dialect.answer(&request.asked, &request.answers) {
            Ok(bytes) => self.say(bytes, request.to),
            Err(error) => self.refuse(request, &error, firmware),
        }
    }

    fn refuse(&mut self, request: Request, error: &DeviceError, firmware: &mut Firmware) {
        if let Some(before) = request.before {
            firmware.put_back(before);
        }
        let bytes = self.dialect.refusal(&request.asked, error);
        self.say(bytes, request.to);
    }
}
