//! The serial port of a USB device: a command port with the control lines that a pty lacks.

use super::connection::{Done, Receiver, Shared, lock};
use super::device::UsbDevice;
use super::feed::{Feed, Flow};
use super::serial::SerialFunction;
use super::transfer::transfer_like;
use crate::CommandPort;
use phasmid_core::error::{Error, Result};
use phasmid_protocol::usb::Setup;
use phasmid_protocol::usb::cdc::{DeviceLines, HostLines, LineCoding, request};
use phasmid_protocol::usb::usbip::status;
use std::collections::VecDeque;
use std::io::{self, Read};
use std::sync::{Arc, Condvar, Mutex, PoisonError};
use std::time::{Duration, Instant};

/// Number of reads in flight, and the size of each in bytes.
const READS: usize = 4;
const READ_LEN: u32 = 4096;
/// Maximum number of received bytes that wait to be read before the device has to wait.
const MAX_WAITING: usize = 64 << 10;
/// Number of notification transfers in flight, and the size of each in bytes.
const NOTIFICATIONS: usize = 2;
const NOTIFICATION_LEN: u32 = 64;
/// Maximum size of a write, in bytes.
const WRITE_LEN: usize = 4096;

/// An open CDC-ACM port: DTR and RTS are set, the line runs at 115,200 baud, 8N1.
pub struct UsbPort {
    device: Arc<UsbDevice>,
    function: SerialFunction,
    data: Feed,
    notifications: Option<Feed>,
    inbox: Arc<Inbox>,
    lines: HostLines,
}

/// Data and line states received from the device.
struct Inbox {
    state: Mutex<State>,
    changed: Condvar,
}

struct State {
    data: Flow,
    bytes: VecDeque<u8>,
    notifications: Flow,
    lines: DeviceLines,
    /// The error of a data transfer.
    failure: Option<String>,
}

impl State {
    /// Returns the number of reads to submit now.
    fn more(&mut self) -> usize {
        let room = self.bytes.len() < MAX_WAITING;
        self.data.more(room)
    }
}

struct Data(Arc<Inbox>);

struct Notifications(Arc<Inbox>);

impl UsbPort {
    /// Opens the device's serial port.
    ///
    /// # Errors
    /// Returns an error if the device has no serial port, refuses, does not answer, or is gone.
    pub fn open(device: &Arc<UsbDevice>) -> Result<Self> {
        let function = SerialFunction::find(device.configuration())
            .map_err(|what| Error::device(format!("{}: {what}", device.place())))?;
        let inbox = Arc::new(Inbox {
            state: Mutex::new(State {
                data: Flow::new(READS),
                bytes: VecDeque::new(),
                notifications: Flow::new(NOTIFICATIONS),
                lines: DeviceLines::default(),
                failure: None,
            }),
            changed: Condvar::new(),
        });
        let feed = |address, len, receiver: Shared| Feed {
            device: Arc::clone(device),
            like: transfer_like(address, len),
            receiver,
        };
        let data: Shared = Arc::new(Mutex::new(Data(Arc::clone(&inbox))));
        let told: Shared = Arc::new(Mutex::new(Notifications(Arc::clone(&inbox))));
        let mut port = Self {
            data: feed(function.input, READ_LEN, data),
            notifications: function
                .notifications
                .map(|address| feed(address, NOTIFICATION_LEN, told)),
            device: Arc::clone(device),
            function,
            inbox,
            lines: HostLines::default(),
        };
        port.request(request::SET_LINE_CODING, 0, &LineCoding::default().encode())?;
        port.set_lines(HostLines {
            dtr: true,
            rts: true,
        })?;
        let (reads, notifications) = {
            let mut state = lock(&port.inbox.state);
            (state.more(), state.notifications.more(true))
        };
        port.data.submit(reads)?;
        if let Some(feed) = &port.notifications {
            feed.submit(notifications)?;
        }
        Ok(port)
    }

    /// Sets DTR and RTS.
    ///
    /// # Errors
    /// Returns an error if the device refuses, does not answer, or is gone.
    pub fn set_lines(&mut self, lines: HostLines) -> Result<()> {
        self.request(request::SET_CONTROL_LINE_STATE, lines.encode(), &[])?;
        self.lines = lines;
        Ok(())
    }

    /// Sets RTS and leaves DTR unchanged.
    ///
    /// # Errors
    /// Same as [`Self::set_lines`].
    pub fn set_rts(&mut self, rts: bool) -> Result<()> {
        self.set_lines(HostLines { rts, ..self.lines })
    }

    /// Sends a break of the given length in milliseconds; 0xFFFF holds it until the next call, 0
    /// ends it.
    ///
    /// # Errors
    /// Same as [`Self::set_lines`].
    pub fn send_break(&mut self, milliseconds: u16) -> Result<()> {
        self.request(request::SEND_BREAK, milliseconds, &[])
    }

    /// Sets the line coding (baud rate and framing).
    ///
    /// # Errors
    /// Same as [`Self::set_lines`].
    pub fn set_line_coding(&mut self, coding: LineCoding) -> Result<()> {
        self.request(request::SET_LINE_CODING, 0, &coding.encode())
    }

    /// Reads the device's line coding.
    ///
    /// # Errors
    /// Same as [`Self::set_lines`], and an error if the answer is invalid.
    pub fn line_coding(&self) -> Result<LineCoding> {
        let (index, len) = (self.function.control.into(), LineCoding::LEN as u16);
        let get = request::GET_LINE_CODING;
        let bytes = self.device.get(Setup::CLASS_IN, get, 0, index, len)?;
        LineCoding::decode(&bytes).ok_or_else(|| {
            Error::device(format!(
                "{}: invalid line coding {bytes:02x?}",
                self.device.place()
            ))
        })
    }

    /// Returns the state of the lines that the device drives, as last reported.
    pub fn device_lines(&self) -> DeviceLines {
        lock(&self.inbox.state).lines
    }

    /// Waits until the device's lines are as wanted; returns whether that happened within the
    /// timeout.
    ///
    /// # Errors
    /// Returns an error if the device is gone.
    pub fn wait_for_lines(
        &self,
        wanted: impl Fn(DeviceLines) -> bool,
        timeout: Duration,
    ) -> Result<bool> {
        let state = lock(&self.inbox.state);
        let (state, _) = self
            .inbox
            .changed
            .wait_timeout_while(state, timeout, |s| !wanted(s.lines) && !s.data.gone)
            .unwrap_or_else(PoisonError::into_inner);
        if wanted(state.lines) {
            return Ok(true);
        }
        if state.data.gone {
            return Err(self.device.client().connection().error());
        }
        Ok(false)
    }

    fn request(&self, request: u8, value: u16, data: &[u8]) -> Result<()> {
        let index = self.function.control.into();
        self.device
            .set(Setup::CLASS_OUT, request, value, index, data)
    }

    /// Closes the port as an application does: clears the lines and ends all transfers.
    fn close(&mut self) -> Result<()> {
        {
            let mut state = lock(&self.inbox.state);
            state.data.closing = true;
            state.notifications.closing = true;
        }
        self.set_lines(HostLines::default())?;
        self.data.take_back()?;
        self.notifications.as_ref().map_or(Ok(()), Feed::take_back)
    }
}

impl CommandPort for UsbPort {
    fn info(&self) -> &str {
        self.device.place()
    }

    fn send(&mut self, bytes: &[u8], timeout: Duration) -> Result<()> {
        let deadline = Instant::now() + timeout;
        for piece in bytes.chunks(WRITE_LEN) {
            let write = self
                .device
                .client()
                .submit(self.function.output, 0, piece)?;
            let left = deadline.saturating_duration_since(Instant::now());
            let failed = |what: String| Error::device(format!("{}: {what}", self.device.place()));
            match write.wait(left)? {
                Some(done) if done.status == status::OK && done.actual == piece.len() => {}
                Some(done) => {
                    return Err(failed(format!(
                        "a write of {} bytes ended after {} with status {}",
                        piece.len(),
                        done.actual,
                        done.status
                    )));
                }
                None => {
                    let waited = timeout.as_secs_f64();
                    return Err(failed(format!(
                        "the device has accepted no data in {waited} s"
                    )));
                }
            }
        }
        Ok(())
    }

    fn receive(&mut self, buffer: &mut [u8], timeout: Duration) -> Result<usize> {
        let state = lock(&self.inbox.state);
        let idle = |s: &mut State| s.bytes.is_empty() && s.failure.is_none() && !s.data.gone;
        let (mut state, _) = self
            .inbox
            .changed
            .wait_timeout_while(state, timeout, idle)
            .unwrap_or_else(PoisonError::into_inner);
        if !state.bytes.is_empty() {
            let len = state.bytes.read(buffer).unwrap_or(0);
            let more = state.more();
            drop(state);
            self.data.submit(more)?;
            return Ok(len);
        }
        if state.data.gone {
            return Err(self.device.client().connection().error());
        }
        let Some(what) = state.failure.take() else {
            return Ok(0);
        };
        let halted = state.data.halted;
        drop(state);
        if halted {
            self.device.clear_halt(self.function.input)?;
        }
        let mut state = lock(&self.inbox.state);
        state.data.halted = false;
        let more = state.more();
        drop(state);
        self.data.submit(more)?;
        Err(Error::device(format!("{}: {what}", self.device.place())))
    }
}

impl Drop for UsbPort {
    fn drop(&mut self) {
        // An error here means that the device is gone, and the port with it.
        let _ = self.close();
    }
}

impl Receiver for Data {
    fn reply(&mut self, done: &Done, data: &mut dyn Read) -> io::Result<usize> {
        let mut bytes = Vec::with_capacity(done.actual);
        data.read_to_end(&mut bytes)?;
        let mut state = lock(&self.0.state);
        state.bytes.extend(bytes);
        if let Some(what) = state.data.ended(done) {
            state.failure = Some(what);
        }
        self.0.changed.notify_all();
        Ok(state.more())
    }

    fn gone(&mut self) {
        lock(&self.0.state).data.gone = true;
        self.0.changed.notify_all();
    }
}

impl Receiver for Notifications {
    fn reply(&mut self, done: &Done, data: &mut dyn Read) -> io::Result<usize> {
        let mut bytes = Vec::with_capacity(done.actual);
        data.read_to_end(&mut bytes)?;
        let mut state = lock(&self.0.state);
        if let Some(lines) = DeviceLines::from_notification(&bytes) {
            state.lines = lines;
            self.0.changed.notify_all();
        }
        // The port keeps working without line states, so the error is not reported.
        let failed = state.notifications.ended(done).is_some();
        Ok(if failed {
            0
        } else {
            state.notifications.more(true)
        })
    }
}
