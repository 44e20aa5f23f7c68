//! A single transfer: submit, wait, unlink.

use super::connection::{Connection, Done, Receiver};
use phasmid_core::error::Result;
use phasmid_protocol::usb::Setup;
use phasmid_protocol::usb::usbip::Submit;
use std::io::{self, Read};
use std::sync::Arc;
use std::sync::mpsc::{Receiver as Inbox, RecvTimeoutError, SyncSender};
use std::time::Duration;

/// Builds a transfer for an endpoint; bit 7 of `address` is set for transfers to the host.
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

/// A completed transfer.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Completed {
    /// See [`status`](phasmid_protocol::usb::usbip::status).
    pub status: i32,
    /// Number of bytes transferred.
    pub actual: usize,
    /// Data from the device.
    pub data: Vec<u8>,
}

/// A transfer in flight; dropping it before it completes unlinks it.
pub struct Transfer {
    pub(super) connection: Arc<Connection>,
    pub(super) seqnum: u32,
    pub(super) inbox: Inbox<Completed>,
}

impl Transfer {
    /// Waits for completion. On timeout the transfer is unlinked and `None` returned.
    ///
    /// # Errors
    /// Returns an error if the connection has ended.
    pub fn wait(self, timeout: Duration) -> Result<Option<Completed>> {
        match self.inbox.recv_timeout(timeout) {
            Ok(completed) => Ok(Some(completed)),
            Err(RecvTimeoutError::Timeout) => Ok(None),
            Err(RecvTimeoutError::Disconnected) => Err(self.connection.error()),
        }
    }

    /// Unlinks the transfer; [`Self::wait`] shows whether it completed before.
    ///
    /// # Errors
    /// Returns an error if the connection has ended.
    pub fn unlink(&self) -> Result<()> {
        self.connection.unlink(|seqnum, _| seqnum == self.seqnum)
    }
}

impl Drop for Transfer {
    fn drop(&mut self) {
        // Sends nothing for a completed transfer. An error means that the connection has ended, and
        // the transfer with it.
        let _ = self.unlink();
    }
}

/// Receives the completion of one transfer.
pub(super) struct Once(pub(super) SyncSender<Completed>);

impl Receiver for Once {
    fn reply(&mut self, done: &Done, data: &mut dyn Read) -> io::Result<usize> {
        let mut bytes = Vec::new();
        data.read_to_end(&mut bytes)?;
        // Ignore an error: the waiter may have given up.
        let _ = self.0.try_send(Completed {
            status: done.status,
            actual: done.actual,
            data: bytes,
        });
        Ok(0)
    }
}
