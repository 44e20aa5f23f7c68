//! One device: the state machine behind its endpoints, and the handle by which firmware and
//! connection share it.

use super::descriptors::{
    Descriptors, INTERFACES, Mode, NOTIFY_IN, SERIAL_IN, SERIAL_OUT, VIDEO_IN,
};
use super::events::Events;
use super::function::{Answer, Function};
use super::outgoing::Outgoing;
use super::serial::Serial;
use super::video::Video;
use super::{CameraLimits, CameraState, Event, Fault};
use crate::error::{Error, Result};
use crate::profile::{Profile, Speed, Transfer};
use crate::protocol::usb::cdc::DeviceLines;
use crate::protocol::usb::descriptor::{Walk, class, kind};
use crate::protocol::usb::usbip::{Command, DeviceInfo, Packet, Submit, status};
use crate::protocol::{Frame, PixelFormat};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::Duration;
use tokio::sync::Notify;

/// Transfers that may wait; drivers have a few dozen.
const MAX_WAITING: usize = 1024;
/// Isochronous packets that may wait; 8 s of them.
const MAX_PACKETS: usize = 1 << 16;

/// The device as a state machine: commands and frames in, replies and events out.
pub(super) struct Session {
    pub(super) function: Function,
    pub(super) video: Video,
    serial: Serial,
    pub(super) outgoing: Outgoing,
    events: Events,
    attached: bool,
    /// Frames that found no room.
    lost: u64,
    unplugged: bool,
}

impl Session {
    fn new(function: Function) -> Self {
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

    /// A host takes the device; `false` when another has it, or when the firmware has not yet taken
    /// what those before have done.
    pub(super) fn attach(&mut self) -> bool {
        if self.attached || self.unplugged || self.events.is_full() {
            return false;
        }
        self.attached = true;
        self.events.push(Event::Attached);
        true
    }

    /// The host is gone, whatever it left behind.
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

    /// Whether the connection is to end.
    pub(super) fn is_unplugged(&self) -> bool {
        self.unplugged
    }

    /// Works off a command with the data or packets that came with it.
    ///
    /// # Errors
    /// What no driver sends; the connection is to end.
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
                // A host that takes everything back has stopped reading.
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
                    return Err(Error::device("USB: the host sends without waiting"));
                }
            }
            // No such endpoint.
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

    /// Passes on what requests have set off.
    fn collect(&mut self) {
        for event in self.function.take_events() {
            match event {
                Event::Stopped => self.stop(),
                // What an earlier stream has left is of no stream.
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

    /// Moves data between what waits on either side.
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

    fn pump_serial(&mut self) {
        let waiting = self.events.received();
        let received = self.serial.pump(waiting, &mut self.outgoing);
        if !received.is_empty() {
            self.events.push(Event::Received(received));
        }
    }
}

struct Shared {
    session: Mutex<Session>,
    /// The connection has something to send.
    outward: Notify,
    /// The firmware has something to do.
    inward: Notify,
}

/// A device that hosts can take; clones are the same device.
#[derive(Clone)]
pub struct UsbDevice {
    shared: Arc<Shared>,
    info: Arc<DeviceInfo>,
}

impl UsbDevice {
    /// A device of a profile with a camera of `width` x `height` pixels in one of these formats,
    /// the first by default. `number`, from 1, is its place on the bus.
    pub fn new(
        profile: &Profile,
        number: u32,
        (width, height): (u32, u32),
        formats: &[PixelFormat],
        camera: CameraState,
    ) -> Result<Self> {
        let largest = 2 * u64::from(width) * u64::from(height);
        if width > u32::from(u16::MAX) || height > u32::from(u16::MAX) || largest > 1 << 30 {
            return Err(Error::input(
                format!("profile {}", profile.name),
                format!("frames of {width} x {height} pixels"),
                "up to 65535 x 65535 pixels and 1 GiB over USB",
            ));
        }
        let modes: Vec<Mode> = formats
            .iter()
            .map(|&format| Mode {
                format,
                width,
                height,
            })
            .collect();
        let descriptors = Descriptors::new(profile, &modes);
        let ns = |us: f64| (us * 1e3).round() as u64;
        let [shortest, longest] = profile.camera.exposure_range_us;
        let limits = CameraLimits {
            exposure_ns: (ns(shortest), ns(longest)),
            default_exposure_ns: ns(profile.camera.exposure_us),
            max_gain_db: profile.camera.max_gain_db,
        };
        let usb = &profile.usb;
        let info = DeviceInfo {
            bus_id: format!("1-{number}"),
            bus: 1,
            device: number + 1,
            speed: match usb.speed {
                Speed::High => 3,
                Speed::Super => 5,
            },
            vendor: usb.vendor_id,
            product: usb.product_id,
            release: usb.release_bcd,
            class: class::COMPOSITE,
            interfaces: INTERFACES,
        };
        Ok(Self {
            shared: Arc::new(Shared {
                session: Mutex::new(Session::new(Function::new(descriptors, limits, camera))),
                outward: Notify::new(),
                inward: Notify::new(),
            }),
            info: Arc::new(info),
        })
    }

    /// The format of a number that a host has agreed on.
    pub(super) fn format(&self, number: u8) -> PixelFormat {
        let session = self.session();
        let modes = &session.function.descriptors.modes;
        modes[usize::from(number).clamp(1, modes.len()) - 1].format
    }

    /// The device as USB/IP shows it.
    pub fn info(&self) -> &DeviceInfo {
        &self.info
    }

    /// Class, subclass and protocol of each interface and a zero, as a list of devices has them.
    pub(super) fn interface_classes(&self) -> Vec<u8> {
        let configuration = self.session().function.descriptors.configuration.clone();
        Walk::new(&configuration)
            // Each interface once, by its first setting.
            .filter(|d| d[1] == kind::INTERFACE && d[3] == 0)
            .flat_map(|d| [d[5], d[6], d[7], 0])
            .collect()
    }

    fn session(&self) -> MutexGuard<'_, Session> {
        let session = self.shared.session.lock();
        session.unwrap_or_else(PoisonError::into_inner)
    }

    /// Changes the session and wakes both sides.
    pub(super) fn with<T>(&self, change: impl FnOnce(&mut Session) -> T) -> T {
        let (value, outward, inward) = {
            let mut session = self.session();
            let value = change(&mut session);
            let outward = !session.outgoing.is_empty() || session.unplugged;
            (value, outward, !session.events.is_empty())
        };
        if outward {
            self.shared.outward.notify_one();
        }
        if inward {
            self.shared.inward.notify_one();
        }
        value
    }

    /// Whether the firmware is so far behind that hosts have to wait.
    pub(super) fn is_behind(&self) -> bool {
        self.session().events.is_full()
    }

    /// Waits until the connection has something to send, or may listen again.
    pub(super) async fn outward(&self) {
        self.shared.outward.notified().await;
    }

    /// Waits until a host has done something; [`Self::take_events`] then says what.
    pub async fn changed(&self) {
        self.shared.inward.notified().await;
    }

    /// What hosts have done since the last call.
    pub fn take_events(&self) -> Vec<Event> {
        let (events, was_full) = self.with(|session| {
            let was_full = session.events.is_full();
            let events = session.events.take();
            // Data that waited for these to be taken may come now.
            session.pump_serial();
            (events, was_full)
        });
        if was_full {
            // The host is listened to again.
            self.shared.outward.notify_one();
        }
        events
    }

    /// Whether a host reads frames.
    pub fn is_streaming(&self) -> bool {
        self.session().video.started
    }

    /// Whether as many frames of a free-running camera wait as are kept for a host.
    pub fn is_crowded(&self) -> bool {
        self.session().video.is_crowded()
    }

    /// Hands a frame on, at a time of the connection's clock; `false` when nobody reads, the stream
    /// has another format, or too many frames wait.
    pub fn put(&self, frame: Arc<Frame>, now: Duration) -> bool {
        self.with(|session| {
            let fits = session.function.stream().is_some_and(|stream| {
                session.function.descriptors.modes[usize::from(stream.format) - 1].format
                    == frame.format
                    && stream.max_frame as usize == frame.data.len()
            });
            if !fits || !session.video.started {
                return false;
            }
            let taken = session.video.put(frame);
            if taken {
                session.pump(now);
            } else {
                session.lost += 1;
            }
            taken
        })
    }

    /// Frames that were lost because the host reads too slowly.
    pub fn lost(&self) -> u64 {
        self.session().lost
    }

    /// Sends bytes over the serial port; `false` when too many wait.
    pub fn send(&self, bytes: &[u8], now: Duration) -> bool {
        self.with(|session| {
            let sent = session.serial.send(bytes);
            session.pump(now);
            sent
        })
    }

    /// Says how the camera is set.
    pub fn set_camera(&self, camera: CameraState) {
        self.session().function.set_camera(camera);
    }

    /// Raises and lowers the device's lines of the serial port.
    pub fn set_lines(&self, lines: DeviceLines, now: Duration) {
        self.with(|session| {
            session.serial.set_lines(lines);
            session.pump(now);
        });
    }

    /// Lets something go wrong with the next frame that has no fault yet.
    pub fn inject(&self, fault: Fault) {
        self.session().video.faults.push(fault);
    }

    /// Takes the device off the bus, from under its host; with `false`, puts it back.
    pub fn unplug(&self, out: bool) {
        self.with(|session| session.unplugged = out);
    }
}
