//! The USB/IP exchange with a server before a device is imported.

use super::connection::left;
use crate::sockets;
use phasmid_core::error::{Error, Result};
use phasmid_protocol::printable;
use phasmid_protocol::usb::usbip::{DeviceInfo, OPERATION_LEN, Operation, Outcome};
use std::io::{ErrorKind, Read, Write};
use std::net::TcpStream;
use std::time::{Duration, Instant};

/// The connection to a server before an import is granted.
pub(super) struct Talk {
    stream: TcpStream,
    deadline: Instant,
    place: String,
}

impl Talk {
    /// Connects to a server at `HOST:PORT`; `timeout` bounds the whole exchange. `place` is the
    /// address as shown in messages.
    pub(super) fn connect(host: &str, timeout: Duration, place: &str) -> Result<Self> {
        let deadline = Instant::now() + timeout;
        let stream = sockets::connect(host, timeout, place)?;
        stream
            .set_write_timeout(Some(timeout.max(Duration::from_millis(1))))
            .map_err(|e| Error::io(place, e))?;
        Ok(Self {
            stream,
            deadline,
            place: place.to_owned(),
        })
    }

    /// Returns the stream once the exchange is complete.
    pub(super) fn into_stream(self) -> TcpStream {
        self.stream
    }

    /// Requests an operation; returns an error if the server refuses it.
    pub(super) fn ask(&mut self, operation: Operation, rest: &[u8]) -> Result<()> {
        let bytes = [&operation.encode()[..], rest].concat();
        self.stream
            .write_all(&bytes)
            .map_err(|e| Error::io(&self.place, e))?;
        let header = self.read::<OPERATION_LEN>()?;
        let outcome = operation
            .decode_reply(header)
            .map_err(|e| e.at(&self.place))?;
        let why = match outcome {
            Outcome::Done => return Ok(()),
            Outcome::Busy => "the device is in use by another host".to_owned(),
            Outcome::NoDevice => "no such device".to_owned(),
            Outcome::Refused(code) => format!("status {code}"),
        };
        Err(Error::device(format!(
            "{}: the server refuses: {why}",
            self.place
        )))
    }

    /// Reads exactly `N` bytes before the deadline, however slowly they arrive.
    pub(super) fn read<const N: usize>(&mut self) -> Result<[u8; N]> {
        let mut bytes = [0; N];
        let mut have = 0;
        while have < N {
            let left = left(self.deadline);
            let silent = || Error::device(format!("{}: the server does not answer", self.place));
            if left.is_zero() {
                return Err(silent());
            }
            let got = self
                .stream
                .set_read_timeout(Some(left.max(Duration::from_micros(1))))
                .and_then(|()| self.stream.read(&mut bytes[have..]));
            match got {
                Ok(0) => {
                    return Err(Error::device(format!(
                        "{}: the server has closed the connection",
                        self.place
                    )));
                }
                Ok(len) => have += len,
                Err(e) if matches!(e.kind(), ErrorKind::WouldBlock | ErrorKind::TimedOut) => {
                    return Err(silent());
                }
                Err(e) if e.kind() == ErrorKind::Interrupted => {}
                Err(e) => return Err(Error::io(&self.place, e)),
            }
        }
        Ok(bytes)
    }
}

/// Returns the bus id of the server's only device; an error if there is none or more than one.
pub(super) fn only(host: &str, devices: Vec<DeviceInfo>) -> Result<String> {
    match &devices[..] {
        [] => Err(Error::device(format!(
            "usb:{host}: the server exports no device"
        ))),
        [device] => Ok(device.bus_id.clone()),
        _ => {
            let names: Vec<String> = devices
                .iter()
                .map(|d| format!("usb:{host}/{}", printable(&d.bus_id)))
                .collect();
            Err(Error::input(
                format!("usb:{host}"),
                format!("{} devices", devices.len()),
                names.join(", "),
            ))
        }
    }
}
