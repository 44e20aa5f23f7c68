//! The whole device without its optics: firmware, control port and faults. It neither waits nor
//! reads a clock; the caller passes the time to each method.
//!
//! ```text
//!  link --bytes--> [ line ] --> [ faults ] --> [ port ] --commands--> [ firmware ] --exposures--.
//!  link <--bytes-- [ line ] <-- [ faults ] <-- [ port ] <--answers--- [          ]             |
//!                                                                                              v
//!  link <--frames------------------ [ faults ] <------------------ optics <-- [ faults ] <-----'
//! ```
//!
//! Faults wrap the inputs and outputs of the firmware, which does not know about them.

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
    /// Number of bytes that the device has received over the line.
    taken_in: u64,
    /// Number of rendered frames that the firmware does not yet count as delivered.
    rendered: u64,
}

impl Machine {
    /// Assembles a device.
    pub(crate) fn new(
        firmware: Firmware,
        port: Port,
        line: SerialLine,
        mut faults: Faults,
    ) -> Self {
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

    /// Returns the firmware.
    pub fn firmware(&self) -> &Firmware {
        &self.firmware
    }

    /// Returns the firmware for access that bypasses the control port.
    pub fn firmware_mut(&mut self) -> &mut Firmware {
        &mut self.firmware
    }

    /// Returns the faults.
    pub fn faults(&self) -> &Faults {
        &self.faults
    }

    /// Returns the faults for modification.
    pub fn faults_mut(&mut self) -> &mut Faults {
        &mut self.faults
    }

    /// Receives bytes that a client put on the line at `now_ns`.
    pub fn receive(&mut self, bytes: &[u8], now_ns: u64) {
        self.line.receive(bytes, now_ns);
        self.advance(now_ns);
    }

    /// Handles a client's disconnection: discards unfinished input and replies, as when a cable is
    /// pulled.
    pub fn hang_up(&mut self) {
        self.line.clear();
        self.faults.hang_up();
        self.port.hang_up(&mut self.firmware);
    }

    /// Processes everything due up to `now_ns`, each event at its own due time.
    pub fn advance(&mut self, now_ns: u64) {
        let mut last = None;
        while let Some(next) = self.next_step_ns(last).filter(|&next| next < now_ns) {
            self.step(next);
            last = Some(next);
        }
        self.step(now_ns);
    }

    /// Returns the time of the next event to step to, after a step to `last`. A free-running camera
    /// needs no steps, because it catches up by itself.
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
                // Queue the refusal behind the answers to earlier input.
                self.collect(now_ns);
                if !self.line.send(&reply, now_ns) {
                    self.firmware.reply_lost();
                }
            }
        }
    }

    /// Applies faults that affect the whole device.
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

    /// Returns whether the control port is present. While it is absent, no client can have it open.
    pub fn connected(&self, now_ns: u64) -> bool {
        self.faults.connected(now_ns)
    }

    /// Puts the output of port and firmware on the line.
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

    /// Switches the device off and on again: see [`Firmware::power_cycle`]. Bytes in transit are
    /// lost, and the device sends its power-on message again.
    pub fn power_cycle(&mut self, now_ns: u64) {
        self.advance(now_ns);
        self.boot(now_ns);
        self.collect(now_ns);
    }

    /// Returns whether enough bytes are in transit that a link should stop reading from its client.
    pub fn crowded(&self) -> bool {
        self.line.crowded()
    }

    /// Returns the number of bytes received since the device was made.
    pub fn taken_in(&self) -> u64 {
        self.taken_in
    }

    /// Takes the bytes that have reached the client's side of the line.
    pub fn take_output(&mut self, now_ns: u64) -> Vec<u8> {
        self.collect(now_ns);
        self.line.sent(now_ns)
    }

    /// Takes the exposures to be rendered, in order.
    pub fn take_exposures(&mut self, now_ns: u64) -> Vec<Exposure> {
        let exposures = self.firmware.take_exposures();
        let firmware = &self.firmware;
        let pattern_images = || {
            let shots = firmware.selected_sequence().into_iter();
            shots.map(|(_, shot)| shot.pattern_image).collect()
        };
        let exposures = self.faults.exposures(exposures, now_ns, &pattern_images);
        self.suffer(now_ns);
        exposures
    }

    /// Reports that the frame of an exposure has been rendered or, with `None`, that it will not be
    /// rendered because no client reads.
    pub fn rendered(&mut self, frame: Option<Arc<Frame>>, now_ns: u64) {
        if let Some(frame) = frame {
            self.faults.frame(frame, now_ns);
        }
        self.rendered += 1;
    }

    /// Reports that the links hold back no frames. The device then counts all rendered frames as
    /// delivered, even if some were lost on the way.
    pub fn frames_left(&mut self) {
        self.firmware.delivered(std::mem::take(&mut self.rendered));
    }

    /// Returns the next frame that leaves the device by `now_ns`.
    pub fn next_frame(&mut self, now_ns: u64) -> Option<Arc<Frame>> {
        self.faults.next_frame(now_ns)
    }

    /// Returns the device time of the next event. If `behind`, exposures wait for the optics and are
    /// not counted as events.
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

    /// Returns whether the input is inside a message whose remaining bytes must arrive without a
    /// pause.
    pub fn inside_block(&self) -> bool {
        self.faults.holds_back() || self.port.inside_block(&self.firmware)
    }

    /// Abandons a message whose remaining bytes have stopped arriving.
    pub fn input_stalled(&mut self) {
        let held_back = self.faults.input_stalled();
        if !held_back.is_empty() {
            self.port.receive(&held_back, &mut self.firmware, 0);
        }
        self.port.input_stalled(&mut self.firmware);
    }
}
