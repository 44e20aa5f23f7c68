//! Transfers to the host that are kept under way on an endpoint, as many as there is room for.

use super::connection::{Done, Shared};
use super::device::UsbDevice;
use phasmid_core::error::Result;
use phasmid_protocol::usb::usbip::{Submit, status};
use std::sync::Arc;
use std::time::Duration;

/// Longest wait for transfers that are taken back.
const SETTLE: Duration = Duration::from_secs(1);

/// How an endpoint's transfers stand; whoever receives them keeps it with what has come.
#[derive(Debug)]
pub(super) struct Flow {
    depth: usize,
    under_way: usize,
    /// No more: the host has had enough.
    pub(super) closing: bool,
    /// The endpoint is halted until somebody clears that.
    pub(super) halted: bool,
    /// The connection is over.
    pub(super) gone: bool,
}

impl Flow {
    /// At most `depth` transfers at a time.
    pub(super) fn new(depth: usize) -> Self {
        Self {
            depth,
            under_way: 0,
            closing: false,
            halted: false,
            gone: false,
        }
    }

    /// Takes notice of the end of a transfer; what is wrong with it, if anything.
    pub(super) fn ended(&mut self, done: &Done) -> Option<String> {
        self.under_way = self.under_way.saturating_sub(1);
        match done.status {
            status::OK | status::UNLINKED => None,
            status::STALL => {
                self.halted = true;
                Some("the endpoint is halted".to_owned())
            }
            other => Some(format!("a transfer has failed with status {other}")),
        }
    }

    /// How many transfers to submit where there is room for what they bring; they are counted as
    /// under way. Half of the depth at a time, so that one write carries many.
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
    /// What each transfer is like.
    pub(super) like: Submit,
    pub(super) receiver: Shared,
}

impl Feed {
    /// Submits so many more.
    pub(super) fn submit(&self, count: usize) -> Result<()> {
        if count == 0 {
            return Ok(());
        }
        let connection = self.device.client().connection();
        connection
            .submit(&self.like, &[], count, &self.receiver)
            .map(drop)
    }

    /// Takes all back that are under way, and waits a while until the device knows.
    pub(super) fn take_back(&self) -> Result<()> {
        let connection = self.device.client().connection();
        connection.unlink(|_, receiver| Arc::ptr_eq(receiver, &self.receiver))?;
        connection.settle(SETTLE);
        Ok(())
    }
}
