//! The whole device but for its optics: firmware, control port, and what goes wrong on a bad day.
//! Nothing here waits and nothing reads a clock; whoever drives it says what time it is.
//!
//! ```text
//!  link --bytes--> [ line ] --> [ faults ] --> [ port ] --commands--> [ firmware ] --exposures--.
//!  link <--bytes-- [ line ] <-- [ faults ] <-- [ port ] <--answers--- [          ]             |
//!                                                                                              v
//!  link <--frames------------------ [ faults ] <------------------ optics <-- [ faults ] <-----'
//! ```
//!
//! Faults are wrappers around the ways in and out; the firmware knows nothing of them.

use super::faults::{Faults, Incoming};
use super::line::SerialLine;
use super::port::Port;
use super::{Exposure, Firmware, State};
use phasmid_protocol::Frame;
use std::sync::Arc;

/// A device without its optics.
pub struct Machine {
    firmware: Firmware,
    port: Port,
    line: SerialLine,
    faults: Faults,
    /// Bytes that have come over the line.
    taken_in: u64,
    /// Frames of which the firmware does not know yet that they have left.
    rendered: u64,
}

impl Machine {
    /// Puts a device together.
    pub fn new(firmware: Firmware, port: Port, line: SerialLine, mut faults: Faults) -> Self {
        faults.listen_to(port.dialect());
        Self {
            firmware,
            port,
            line,
            faults,
            taken_in: 0,
            rendered: 0,
        }
    }

    /// The firmware.
    pub fn firmware(&self) -> &Firmware {
        &self.firmware
    }

    /// The firmware, for what reaches it past the control port.
    pub fn firmware_mut(&mut self) -> &mut Firmware {
        &mut self.firmware
    }

    /// What goes wrong.
    pub fn faults(&self) -> &Faults {
        &self.faults
    }

    /// What goes wrong, to change it.
    pub fn faults_mut(&mut self) -> &mut Faults {
        &mut self.faults
    }

    /// Takes bytes that a client has put on the line at a time.
    pub fn receive(&mut self, bytes: &[u8], now_ns: u64) {
        self.line.receive(bytes, now_ns);
        self.advance(now_ns);
    }

    /// The client has gone: forgets unfinished input and replies, as when a cable is pulled.
    pub fn hang_up(&mut self) {
        self.line.clear();
        self.faults.hang_up();
        self.port.hang_up(&mut self.firmware);
    }

    /// Works off what was due up to a time, each thing at its own time, however late this is asked.
    pub fn advance(&mut self, now_ns: u64) {
        let mut last = None;
        while let Some(next) = self.next_step_ns(last).filter(|&next| next < now_ns) {
            self.step(next);
            last = Some(next);
        }
        self.step(now_ns);
    }

    /// What happens next by itself after the last step. A free-running camera catches up on its own.
    fn next_step_ns(&self, last: Option<u64>) -> Option<u64> {
        let running = matches!(self.firmware.state(), State::Running { .. });
        [
            self.firmware.next_event_ns().filter(|_| running),
            self.line.next_received_ns(),
            self.port.next_event_ns(),
            self.faults.next_event_ns(),
        ]
        .into_iter()
        .flatten()
        .filter(|&next| last.is_none_or(|last| next > last))
        .min()
    }

    fn step(&mut self, now_ns: u64) {
        self.firmware.advance(now_ns);
        let bytes = self.line.received(now_ns);
        if !bytes.is_empty() {
            self.taken_in += bytes.len() as u64;
            for incoming in self.faults.incoming(&bytes, now_ns) {
                self.take_in(incoming, now_ns);
            }
            self.suffer(now_ns);
        }
        self.collect(now_ns);
    }

    fn take_in(&mut self, incoming: Incoming, now_ns: u64) {
        match incoming {
            Incoming::Bytes(bytes) => self.port.receive(&bytes, &mut self.firmware, now_ns),
            Incoming::Refused(reply) if reply.is_empty() => self.firmware.input_lost(),
            Incoming::Refused(reply) => {
                // Behind the answers to what came before it.
                self.collect(now_ns);
                if !self.line.send(&reply, now_ns) {
                    self.firmware.reply_lost();
                }
            }
        }
    }

    /// What befalls the whole device.
    fn suffer(&mut self, now_ns: u64) {
        if self.faults.take_broken() {
            self.hang_up();
        }
        if self.faults.take_reset() {
            self.boot(now_ns);
        }
    }

    fn boot(&mut self, now_ns: u64) {
        self.hang_up();
        self.firmware.power_cycle(now_ns);
        self.port.power_on(now_ns);
    }

    /// Whether the control port is there; while it is not, nobody can have it open.
    pub fn connected(&self, now_ns: u64) -> bool {
        self.faults.connected(now_ns)
    }

    /// Hands on what the device has to say.
    fn collect(&mut self, now_ns: u64) {
        for message in self.port.collect(&mut self.firmware, now_ns) {
            self.faults.reply(message, now_ns);
        }
        for bytes in self.faults.replies(now_ns) {
            if !self.line.send(&bytes, now_ns) {
                self.firmware.reply_lost();
            }
        }
    }

    /// Switches the device off and on again: see [`Firmware::power_cycle`]. What is on its way on
    /// the line is lost, and it says again what it says at power-on.
    pub fn power_cycle(&mut self, now_ns: u64) {
        self.advance(now_ns);
        self.boot(now_ns);
        self.collect(now_ns);
    }

    /// Whether so much is on its way on the line that a link should take nothing more from its
    /// client.
    pub fn crowded(&self) -> bool {
        self.line.crowded()
    }

    /// Bytes that have reached the device since it was made.
    pub fn taken_in(&self) -> u64 {
        self.taken_in
    }

    /// Bytes that are on the client's side of the line by now.
    pub fn take_output(&mut self, now_ns: u64) -> Vec<u8> {
        self.collect(now_ns);
        self.line.sent(now_ns)
    }

    /// What is to be rendered, in order.
    pub fn take_exposures(&mut self, now_ns: u64) -> Vec<Exposure> {
        let exposures = self.firmware.take_exposures();
        let firmware = &self.firmware;
        let slides = || {
            let shots = firmware.selected_sequence().into_iter();
            shots.map(|(_, shot)| shot.slide).collect()
        };
        let exposures = self.faults.exposures(exposures, now_ns, &slides);
        self.suffer(now_ns);
        exposures
    }

    /// Says that an exposure's frame is there, or with `None` that it will never be rendered, as
    /// nobody reads.
    pub fn rendered(&mut self, frame: Option<Arc<Frame>>, now_ns: u64) {
        if let Some(frame) = frame {
            self.faults.frame(frame, now_ns);
        }
        self.rendered += 1;
    }

    /// Says that the links hold no frame back: as far as the device knows, all that were rendered
    /// have left, whatever has become of them on their way.
    pub fn frames_left(&mut self) {
        self.firmware.delivered(std::mem::take(&mut self.rendered));
    }

    /// The next frame that leaves by now.
    pub fn next_frame(&mut self, now_ns: u64) -> Option<Arc<Frame>> {
        self.faults.next_frame(now_ns)
    }

    /// When something happens next, in device time. With `behind`, exposures wait for the optics.
    pub fn next_event_ns(&self, behind: bool) -> Option<u64> {
        let exposure = self.firmware.next_event_ns().filter(|_| !behind);
        [
            exposure,
            self.line.next_event_ns(),
            self.port.next_event_ns(),
            self.faults.next_event_ns(),
        ]
        .into_iter()
        .flatten()
        .min()
    }

    /// Whether the input stands inside of a message that has to go on without a pause.
    pub fn inside_block(&self) -> bool {
        self.faults.holds_back() || self.port.inside_block(&self.firmware)
    }

    /// Gives up on a message that stopped coming.
    pub fn input_stalled(&mut self) {
        let held_back = self.faults.input_stalled();
        if !held_back.is_empty() {
            self.port.receive(&held_back, &mut self.firmware, 0);
        }
        self.port.input_stalled(&mut self.firmware);
    }
}
