//! One transfer: submitted, waited for, taken back.

use super::connection::{Connection, Done, Receiver};
use phasmid_core::error::Result;
use phasmid_protocol::usb::Setup;
use phasmid_protocol::usb::usbip::Submit;
use std::io::{self, Read};
use std::sync::Arc;
use std::sync::mpsc::{Receiver as Inbox, RecvTimeoutError, SyncSender};
use std::time::Duration;

/// A transfer of an endpoint whose address has bit 7 set for to the host.
pub(super) fn transfer_like(address: u8, length: u32) -> Submit {
    Submit {
        seqnum: 0,
        device: 0,
        input: address & 0x80 != 0,
        endpoint: address & 0x0F,
        flags: 0,
        length,
        packets: None,
        interval: 0,
        setup: Setup::default(),
    }
}

/// The end of a transfer.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Completed {
    /// See [`status`](phasmid_protocol::usb::usbip::status).
    pub status: i32,
    /// Bytes transferred.
    pub actual: usize,
    /// What came from the device.
    pub data: Vec<u8>,
}

/// A transfer under way; dropped before its end, it is taken back.
pub struct Transfer {
    pub(super) connection: Arc<Connection>,
    pub(super) seqnum: u32,
    pub(super) inbox: Inbox<Completed>,
}

impl Transfer {
    /// Waits for the end; without one in time the transfer is taken back.
    ///
    /// # Errors
    /// A connection that is over.
    pub fn wait(self, timeout: Duration) -> Result<Option<Completed>> {
        match self.inbox.recv_timeout(timeout) {
            Ok(completed) => Ok(Some(completed)),
            Err(RecvTimeoutError::Timeout) => Ok(None),
            Err(RecvTimeoutError::Disconnected) => Err(self.connection.error()),
        }
    }

    /// Takes the transfer back; [`Self::wait`] tells whether it was done before.
    ///
    /// # Errors
    /// A connection that is over.
    pub fn unlink(&self) -> Result<()> {
        self.connection.unlink(|seqnum, _| seqnum == self.seqnum)
    }
}

impl Drop for Transfer {
    fn drop(&mut self) {
        // Nothing is sent for a transfer that is over; a connection that is over needs nothing.
        let _ = self.unlink();
    }
}

/// Waits for the end of one transfer.
pub(super) struct Once(pub(super) SyncSender<Completed>);

impl Receiver for Once {
    fn reply(&mut self, done: &Done, data: &mut dyn Read) -> io::Result<usize> {
        let mut bytes = Vec::new();
        data.read_to_end(&mut bytes)?;
        // Nobody may be waiting any more.
        let _ = self.0.try_send(Completed {
            status: done.status,
            actual: done.actual,
            data: bytes,
        });
        Ok(0)
    }
}
