//! Keeps transfers to the host in flight on an endpoint, as long as there is room for received
//! data.

use super::connection::{Done, Shared};
use super::device::UsbDevice;
use phasmid_core::error::Result;
use phasmid_protocol::usb::usbip::{Submit, status};
use std::sync::Arc;
use std::time::Duration;

/// Maximum wait for unlinked transfers to end.
const SETTLE: Duration = Duration::from_secs(1);

/// State of an endpoint's transfers, updated by the receiver of their data.
#[derive(Debug)]
pub(super) struct Flow {
    depth: usize,
    under_way: usize,
    /// The host is closing the stream: submit no more.
    pub(super) closing: bool,
    /// The endpoint is halted until the halt is cleared.
    pub(super) halted: bool,
    /// The connection has ended.
    pub(super) gone: bool,
}

impl Flow {
    /// Creates the state for at most `depth` transfers in flight.
    pub(super) fn new(depth: usize) -> Self {
        Self {
            depth,
            under_way: 0,
            closing: false,
            halted: false,
            gone: false,
        }
    }

    /// Records the end of a transfer; returns a description of its error, if any.
    pub(super) fn ended(&mut self, done: &Done) -> Option<String> {
        self.under_way = self.under_way.saturating_sub(1);
        match done.status {
            status::OK | status::UNLINKED => None,
            status::STALL => {
                self.halted = true;
                Some("the endpoint is halted".to_owned())
            }
            other => Some(format!("a transfer failed with status {other}")),
        }
    }

    /// Returns the number of transfers to submit, and counts them as in flight; `room` is whether
    /// received data can be stored. The number is 0 or at least half the depth, so that one write
    /// carries many transfers.
    pub(super) fn more(&mut self, room: bool) -> usize {
        let missing = self.depth - self.under_way;
        if !room || self.closing || self.halted || self.gone || missing < self.depth.div_ceil(2) {
            return 0;
        }
        self.under_way = self.depth;
        missing
    }
}

/// Submits an endpoint's transfers.
pub(super) struct Feed {
    pub(super) device: Arc<UsbDevice>,
    /// Template for each transfer.
    pub(super) like: Submit,
    pub(super) receiver: Shared,
}

impl Feed {
    /// Submits `count` more transfers.
    pub(super) fn submit(&self, count: usize) -> Result<()> {
        if count == 0 {
            return Ok(());
        }
        let connection = self.device.client().connection();
        connection
            .submit(&self.like, &[], count, &self.receiver)
            .map(drop)
    }

    /// Unlinks all transfers in flight, and waits up to a limit for the device to confirm.
    pub(super) fn take_back(&self) -> Result<()> {
        let connection = self.device.client().connection();
        connection.unlink(|_, receiver| Arc::ptr_eq(receiver, &self.receiver))?;
        connection.settle(SETTLE);
        Ok(())
    }
}
