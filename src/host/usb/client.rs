//! A USB/IP client: lists the devices that a server exports, imports one, and carries its
//! transfers.

use super::connection::{Connection, Shared};
use super::opening::{Talk, only};
use super::transfer::{Once, Transfer, transfer_like};
use phasmid_core::error::{Error, Result};
use phasmid_protocol::printable;
use phasmid_protocol::usb::Setup;
use phasmid_protocol::usb::usbip::{
    DEVICE_LEN, DeviceInfo, Operation, Submit, bus_id_bytes, status,
};
use std::io;
use std::net::TcpStream;
use std::sync::mpsc::sync_channel;
use std::sync::{Arc, Mutex};
use std::thread::JoinHandle;
use std::time::Duration;

/// Maximum wait for the server to release a device on detach.
const FAREWELL: Duration = Duration::from_millis(500);
/// Maximum number of devices in a list.
const MAX_DEVICES: u32 = 256;

/// An imported device; dropping it detaches the device.
pub struct Client {
    connection: Arc<Connection>,
    info: DeviceInfo,
    reader: Option<JoinHandle<()>>,
}

impl Client {
    /// Lists the devices that a server at `HOST:PORT` exports.
    ///
    /// # Errors
    /// Returns an error if the server cannot be reached, does not answer within `timeout`, or is
    /// not a USB/IP server.
    pub fn list(host: &str, timeout: Duration) -> Result<Vec<DeviceInfo>> {
        let place = format!("usb:{host}");
        let mut talk = Talk::connect(host, timeout, &place)?;
        talk.ask(Operation::List, &[])?;
        let count = u32::from_be_bytes(talk.read()?);
        if count > MAX_DEVICES {
            return Err(Error::device(format!(
                "{place}: a list of {count} devices; expected at most {MAX_DEVICES}"
            )));
        }
        (0..count)
            .map(|_| {
                let device = DeviceInfo::decode(&talk.read::<DEVICE_LEN>()?);
                for _ in 0..device.interfaces {
                    talk.read::<4>()?;
                }
                Ok(device)
            })
            .collect()
    }

    /// Imports a device from a server at `HOST:PORT`: the device with this bus id, or, without one,
    /// the server's only device.
    ///
    /// # Errors
    /// Returns the errors of [`Self::list`], and an error if there are several devices and no name
    /// is given, the server does not have the device, or it is already imported.
    pub fn import(host: &str, bus_id: Option<&str>, timeout: Duration) -> Result<Self> {
        let bus_id = match bus_id {
            Some(bus_id) => bus_id.to_owned(),
            None => only(host, Self::list(host, timeout)?)?,
        };
        let place = format!("usb:{host}/{}", printable(&bus_id));
        let mut talk = Talk::connect(host, timeout, &place)?;
        talk.ask(Operation::Import, &bus_id_bytes(&bus_id))?;
        let info = DeviceInfo::decode(&talk.read()?);
        if info.bus_id != bus_id {
            return Err(Error::device(format!(
                "{place}: the server returned device {:?}",
                info.bus_id
            )));
        }
        Self::start(talk.into_stream(), info, &place).map_err(|e| Error::io(&place, e))
    }

    fn start(stream: TcpStream, info: DeviceInfo, place: &str) -> io::Result<Self> {
        stream.set_nodelay(true)?;
        stream.set_read_timeout(None)?;
        let incoming = stream.try_clone()?;
        let connection = Arc::new(Connection::new(stream, info.id(), place));
        let reading = Arc::clone(&connection);
        let reader = std::thread::Builder::new()
            .name("usb replies".to_owned())
            .spawn(move || reading.read(incoming))?;
        Ok(Self {
            connection,
            info,
            reader: Some(reader),
        })
    }

    /// Returns the device as the server describes it.
    pub fn info(&self) -> &DeviceInfo {
        &self.info
    }

    /// Returns the address, for messages.
    pub fn place(&self) -> &str {
        self.connection.place()
    }

    pub(super) fn connection(&self) -> &Arc<Connection> {
        &self.connection
    }

    /// Submits a transfer from or to an endpoint: up to `length` bytes in, or `data` out. In
    /// `address`, as in the endpoint descriptor, bit 7 is set for transfers to the host.
    ///
    /// # Errors
    /// Returns an error if the connection has ended.
    pub fn submit(&self, address: u8, length: u32, data: &[u8]) -> Result<Transfer> {
        let input = address & 0x80 != 0;
        let length = if input { length } else { data.len() as u32 };
        self.transfer(
            &transfer_like(address, length),
            if input { &[] } else { data },
        )
    }

    /// Performs a control transfer. If `setup` requests data from the device, returns that data;
    /// else sends `data` to the device.
    ///
    /// # Errors
    /// Returns an error if the device refuses the request (stalls) or does not answer within
    /// `timeout`.
    pub fn control(&self, setup: Setup, data: &[u8], timeout: Duration) -> Result<Vec<u8>> {
        let done = self.submit_control(setup, data)?.wait(timeout)?;
        let Some(done) = done else {
            return Err(self.refusal(setup, &format!("no answer for {} s", timeout.as_secs_f64())));
        };
        match done.status {
            status::OK => Ok(done.data),
            status::STALL => Err(self.refusal(setup, "refused (a stall)")),
            other => Err(self.refusal(setup, &format!("failed with status {other}"))),
        }
    }

    /// Submits a control transfer.
    ///
    /// # Errors
    /// Returns an error if the connection has ended.
    pub fn submit_control(&self, setup: Setup, data: &[u8]) -> Result<Transfer> {
        let address = if setup.input() { 0x80 } else { 0 };
        let like = Submit {
            setup,
            ..transfer_like(address, setup.length.into())
        };
        if !setup.input() && data.len() != usize::from(setup.length) {
            return Err(self.refusal(setup, &format!("has {} bytes of data", data.len())));
        }
        self.transfer(&like, data)
    }

    fn refusal(&self, setup: Setup, what: &str) -> Error {
        Error::device(format!(
            "{}: request {:#04x} of kind {:#04x}, value {:#06x}, index {:#06x}, {} bytes: {what}",
            self.place(),
            setup.request,
            setup.kind,
            setup.value,
            setup.index,
            setup.length
        ))
    }

    fn transfer(&self, like: &Submit, data: &[u8]) -> Result<Transfer> {
        let (sender, inbox) = sync_channel(1);
        let receiver: Shared = Arc::new(Mutex::new(Once(sender)));
        let seqnum = self.connection.submit(like, data, 1, &receiver)?;
        Ok(Transfer {
            connection: Arc::clone(&self.connection),
            seqnum,
            inbox,
        })
    }
}

impl Drop for Client {
    fn drop(&mut self) {
        let why = "this program detached the device";
        self.connection.leave(why, FAREWELL);
        if let Some(reader) = self.reader.take() {
            // A panic of the reader thread is of no consequence here.
            let _ = reader.join();
        }
    }
}
