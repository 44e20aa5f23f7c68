//! The state machine behind the endpoints of a USB device.

use super::Event;
use super::descriptors::{NOTIFY_IN, SERIAL_IN, SERIAL_OUT, VIDEO_IN};
use super::events::Events;
use super::function::{Answer, Function};
use super::outgoing::Outgoing;
use super::serial::Serial;
use super::video::Video;
use phasmid_core::error::{Error, Result};
use phasmid_profile::Transfer;
use phasmid_protocol::usb::usbip::{Command, Packet, Submit, status};
use std::time::Duration;

/// Maximum number of pending transfers; drivers use a few dozen.
const MAX_WAITING: usize = 1024;
/// Maximum number of pending isochronous packets, which take 8 s.
const MAX_PACKETS: usize = 1 << 16;

/// A USB device as a state machine: takes commands and frames, returns replies and events.
pub(super) struct Session {
    pub(super) function: Function,
    pub(super) video: Video,
    pub(super) serial: Serial,
    pub(super) outgoing: Outgoing,
    pub(super) events: Events,
    attached: bool,
    /// Number of frames lost because the queue for the host was full.
    pub(super) lost: u64,
    pub(super) unplugged: bool,
}

impl Session {
    pub(super) fn new(function: Function) -> Self {
        Self {
            function,
            video: Video::default(),
            serial: Serial::default(),
            outgoing: Outgoing::default(),
            events: Events::default(),
            attached: false,
            lost: 0,
            unplugged: false,
        }
    }

    /// Attaches the device to a host. Returns `false` if another host has attached the device, if it
    /// is unplugged, or if too many events wait for the firmware.
    pub(super) fn attach(&mut self) -> bool {
        if self.attached || self.unplugged || self.events.is_full() {
            return false;
        }
        self.attached = true;
        self.events.push(Event::Attached);
        true
    }

    /// Detaches the device and resets its state.
    pub(super) fn detach(&mut self) {
        self.stop();
        self.function.reset();
        self.collect();
        self.video.reset();
        self.serial.reset();
        self.outgoing = Outgoing::default();
        self.attached = false;
        self.events.push(Event::Detached);
    }

    /// Returns whether the device is unplugged, which ends the connection.
    pub(super) fn is_unplugged(&self) -> bool {
        self.unplugged
    }

    /// Executes a command with its data or packets.
    ///
    /// # Errors
    /// Returns an error if the host exceeds limits that no driver reaches; the caller must then end
    /// the connection.
    pub(super) fn command(
        &mut self,
        command: Command,
        data: Vec<u8>,
        packets: &[Packet],
        now: Duration,
    ) -> Result<()> {
        match command {
            Command::Unlink { seqnum, target } => {
                let video = self.video.unlink(target);
                let held = video || self.serial.unlink(target);
                // A host that has cancelled all its transfers has stopped reading frames.
                if video && self.video.waiting() == 0 {
                    self.stop();
                }
                let status = if held { status::UNLINKED } else { status::OK };
                self.outgoing.unlinked(seqnum, status);
            }
            Command::Submit(submit) => self.submit(submit, data, packets, now)?,
        }
        self.pump(now);
        Ok(())
    }

    fn submit(
        &mut self,
        submit: Submit,
        data: Vec<u8>,
        packets: &[Packet],
        now: Duration,
    ) -> Result<()> {
        let address = submit.endpoint | if submit.input { 0x80 } else { 0 };
        let isochronous = address == 0x80 | VIDEO_IN
            && self.function.descriptors.transfer == Transfer::Isochronous;
        let fits = submit.packets.is_some() == isochronous;
        if submit.endpoint != 0 && self.function.is_halted(address) || !fits {
            self.outgoing.failed(&submit, packets, status::STALL);
            return Ok(());
        }
        match (submit.endpoint, submit.input) {
            (0, _) => self.control(submit, &data),
            (VIDEO_IN, true) => {
                self.video.submit(submit, packets, now);
                if self.function.stream().is_some() && !self.video.started {
                    self.video.started = true;
                    self.events.push(Event::Started);
                }
            }
            (SERIAL_IN, true) => self.serial.read(submit),
            (NOTIFY_IN, true) => self.serial.notify(submit),
            (SERIAL_OUT, false) => {
                if !self.serial.write(submit, data) {
                    return Err(Error::device(
                        "USB: the host sends data before earlier data is accepted",
                    ));
                }
            }
            // The endpoint does not exist.
            _ => self.outgoing.received(submit.seqnum, status::STALL, 0),
        }
        if self.serial.waiting() + self.video.waiting() > MAX_WAITING {
            return Err(Error::device(format!(
                "USB: more than {MAX_WAITING} transfers at a time"
            )));
        }
        if submit.packets.is_some() && self.video.packets() > MAX_PACKETS {
            return Err(Error::device(format!(
                "USB: more than {MAX_PACKETS} isochronous packets at a time"
            )));
        }
        Ok(())
    }

    fn control(&mut self, submit: Submit, data: &[u8]) {
        let answer = self.function.control(submit.setup, data);
        match answer {
            Answer::Stall => self.outgoing.received(submit.seqnum, status::STALL, 0),
            Answer::Data(_) if !submit.input => {
                self.outgoing
                    .received(submit.seqnum, status::OK, data.len() as u32);
            }
            Answer::Data(mut bytes) => {
                bytes.truncate(submit.length as usize);
                self.outgoing.submitted(submit.seqnum, status::OK, bytes);
            }
        }
        self.collect();
    }

    /// Processes the events caused by requests.
    fn collect(&mut self) {
        for event in self.function.take_events() {
            match event {
                Event::Stopped => self.stop(),
                // Discard the frames of the previous stream, which do not belong to the new one.
                Event::Committed(_) => {
                    self.stop();
                    self.events.push(event);
                }
                Event::Lines(lines) => {
                    if !lines.dtr {
                        self.serial.hang_up();
                    }
                    self.events.push(event);
                }
                event => self.events.push(event),
            }
        }
    }

    fn stop(&mut self) {
        if self.video.started {
            self.events.push(Event::Stopped);
        }
        self.video.stop();
    }

    /// Completes the pending transfers, in both directions, for which data is queued.
    pub(super) fn pump(&mut self, now: Duration) {
        if self.function.is_halted(0x80 | VIDEO_IN) {
            self.video.stall(&mut self.outgoing);
        }
        let halted = |address| self.function.is_halted(address);
        self.serial.stall(halted, &mut self.outgoing);
        if let Some(stream) = self.function.stream() {
            let halt = self
                .video
                .pump(stream.max_payload as usize, now, &mut self.outgoing);
            if halt {
                self.function.halt(0x80 | VIDEO_IN);
                self.video.stall(&mut self.outgoing);
            }
        }
        self.pump_serial();
    }

    pub(super) fn pump_serial(&mut self) {
        let waiting = self.events.received();
        let received = self.serial.pump(waiting, &mut self.outgoing);
        if !received.is_empty() {
            self.events.push(Event::Received(received));
        }
    }
}
