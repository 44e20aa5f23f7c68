//! The serial port's endpoints: data in both directions, and notifications of the serial lines that
//! the device drives.

use super::descriptors::{NOTIFY_IN, SERIAL_CONTROL, SERIAL_IN, SERIAL_OUT};
use super::outgoing::Outgoing;
use phasmid_protocol::usb::cdc::DeviceLines;
use phasmid_protocol::usb::usbip::{Submit, status};
use std::collections::VecDeque;

/// Maximum number of serial bytes queued for the host.
const MAX_TO_HOST: usize = 1 << 20;
/// Number of serial bytes queued for the firmware at which the host has to wait.
const MAX_TO_DEVICE: usize = 64 << 10;
/// Maximum number of bytes in transfers from the host that have not completed.
const MAX_HELD: usize = 4 << 20;

/// State of the serial port's endpoints.
#[derive(Default)]
pub(super) struct Serial {
    to_host: VecDeque<u8>,
    reads: VecDeque<Submit>,
    notifications: VecDeque<Submit>,
    /// Transfers from the host whose bytes the firmware has not received yet.
    writes: VecDeque<(Submit, Vec<u8>)>,
    held: usize,
    lines: DeviceLines,
    /// State of the lines that was last reported to the host.
    told: Option<DeviceLines>,
}

impl Serial {
    pub(super) fn read(&mut self, submit: Submit) {
        self.reads.push_back(submit);
    }

    pub(super) fn notify(&mut self, submit: Submit) {
        self.notifications.push_back(submit);
    }

    /// Queues a transfer from the host. Returns `false` if the host has more bytes pending than any
    /// driver sends.
    pub(super) fn write(&mut self, submit: Submit, data: Vec<u8>) -> bool {
        self.held += data.len();
        self.writes.push_back((submit, data));
        self.held <= MAX_HELD
    }

    /// Cancels a transfer. Returns `false` if the transfer is not pending.
    pub(super) fn unlink(&mut self, seqnum: u32) -> bool {
        let other = |submit: &Submit| submit.seqnum != seqnum;
        let before = self.waiting();
        self.reads.retain(other);
        self.notifications.retain(other);
        self.writes.retain(|(submit, data)| {
            let stays = other(submit);
            self.held -= if stays { 0 } else { data.len() };
            stays
        });
        self.waiting() < before
    }

    /// Fails pending transfers on halted endpoints.
    pub(super) fn stall(&mut self, is_halted: impl Fn(u8) -> bool, outgoing: &mut Outgoing) {
        let mut fail = |submit: Submit| outgoing.received(submit.seqnum, status::STALL, 0);
        if is_halted(0x80 | SERIAL_IN) {
            self.reads.drain(..).for_each(&mut fail);
        }
        if is_halted(0x80 | NOTIFY_IN) {
            self.notifications.drain(..).for_each(&mut fail);
        }
        if is_halted(SERIAL_OUT) {
            self.held = 0;
            self.writes.drain(..).for_each(|(submit, _)| fail(submit));
        }
    }

    /// Returns the number of pending transfers.
    pub(super) fn waiting(&self) -> usize {
        self.reads.len() + self.notifications.len() + self.writes.len()
    }

    /// Queues bytes for the host. Returns `false` if too many bytes are queued; the new bytes are
    /// then lost.
    pub(super) fn send(&mut self, bytes: &[u8]) -> bool {
        let fits = self.to_host.len() + bytes.len() <= MAX_TO_HOST;
        if fits {
            self.to_host.extend(bytes);
        }
        fits
    }

    /// Discards bytes queued for a host that has closed the port.
    pub(super) fn hang_up(&mut self) {
        self.to_host.clear();
    }

    pub(super) fn set_lines(&mut self, lines: DeviceLines) {
        self.lines = lines;
    }

    /// Resets the endpoints and discards pending transfers when the device is detached.
    pub(super) fn reset(&mut self) {
        let lines = self.lines;
        *self = Self::default();
        self.lines = lines;
    }

    /// Completes all transfers that can complete now. Returns the bytes that the firmware may
    /// receive now, given that `taken` bytes already wait for the firmware.
    pub(super) fn pump(&mut self, mut taken: usize, outgoing: &mut Outgoing) -> Vec<u8> {
        while !self.to_host.is_empty()
            && let Some(read) = self.reads.pop_front()
        {
            let len = self.to_host.len().min(read.length as usize);
            let data: Vec<u8> = self.to_host.drain(..len).collect();
            outgoing.submitted(read.seqnum, status::OK, data);
        }
        if self.told != Some(self.lines)
            && let Some(notification) = self.notifications.pop_front()
        {
            let mut data = self.lines.notification(SERIAL_CONTROL).to_vec();
            data.truncate(notification.length as usize);
            outgoing.submitted(notification.seqnum, status::OK, data);
            self.told = Some(self.lines);
        }
        let mut received = Vec::new();
        while taken < MAX_TO_DEVICE
            && let Some((write, data)) = self.writes.pop_front()
        {
            outgoing.received(write.seqnum, status::OK, data.len() as u32);
            self.held -= data.len();
            taken += data.len();
            received.extend(data);
        }
        received
    }
}
