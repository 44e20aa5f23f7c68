//! Status reporting: the registers of IEEE 488.2 chapter 11 and SCPI-1999 volume 1 chapter 9, and
//! the error queue.

use phasmid_protocol::scpi::{DeviceError, ErrorCode};
use std::collections::VecDeque;

/// Capacity of the error queue; the last entry is reserved for -350.
const QUEUE: usize = 32;

/// Bits of the standard event status register (IEEE 488.2, 11.5.1).
pub(super) const OPERATION_COMPLETE: u8 = 1;
const QUERY_ERROR: u8 = 1 << 2;
const DEVICE_ERROR: u8 = 1 << 3;
const EXECUTION_ERROR: u8 = 1 << 4;
const COMMAND_ERROR: u8 = 1 << 5;
const POWER_ON: u8 = 1 << 7;

/// Bit of the operation register: exposing (SCPI's "measuring").
pub(super) const MEASURING: u16 = 1 << 4;
/// Bit of the operation register: waiting for a trigger.
pub(super) const WAITING_FOR_TRIGGER: u16 = 1 << 5;

/// Bit of the operation register: a sequence is being loaded (SCPI's "settling").
pub(super) const LOADING: u16 = 1 << 1;
/// Bit of the questionable register: a trigger came too early. SCPI leaves this bit to the device.
pub(super) const TRIGGER_MISSED: u16 = 1 << 9;

/// A condition register with its event and enable registers. An event bit is set when the condition
/// bit becomes 1.
#[derive(Debug, Default)]
pub(super) struct Register {
    condition: u16,
    event: u16,
    pub(super) enable: u16,
}

impl Register {
    pub(super) fn condition(&self) -> u16 {
        self.condition
    }

    pub(super) fn set(&mut self, condition: u16) {
        self.event |= condition & !self.condition;
        self.condition = condition;
    }

    /// Sets event bits for an instantaneous event.
    pub(super) fn happen(&mut self, event: u16) {
        self.event |= event;
    }

    pub(super) fn take_event(&mut self) -> u16 {
        std::mem::take(&mut self.event)
    }

    fn summary(&self) -> bool {
        self.event & self.enable != 0
    }
}

/// All status registers and the error queue.
#[derive(Debug)]
pub(super) struct Status {
    event: u8,
    pub(super) event_enable: u8,
    pub(super) service_enable: u8,
    pub(super) operation: Register,
    pub(super) questionable: Register,
    errors: VecDeque<DeviceError>,
}

impl Status {
    pub(super) fn power_on() -> Self {
        Self {
            event: POWER_ON,
            event_enable: 0,
            service_enable: 0,
            operation: Register::default(),
            questionable: Register::default(),
            errors: VecDeque::new(),
        }
    }

    /// `*CLS`: clears events and errors, not the enable registers.
    pub(super) fn clear(&mut self) {
        self.event = 0;
        self.operation.take_event();
        self.questionable.take_event();
        self.errors.clear();
    }

    pub(super) fn preset(&mut self) {
        self.operation.enable = 0;
        self.questionable.enable = 0;
    }

    pub(super) fn raise(&mut self, bits: u8) {
        self.event |= bits;
    }

    pub(super) fn take_event(&mut self) -> u8 {
        std::mem::take(&mut self.event)
    }

    /// Queues an error and sets the event bit of the error's class. If the queue is full, its last
    /// entry becomes -350 and the new error is lost (SCPI-1999 vol 1, 21.8.1).
    pub(super) fn report(&mut self, error: DeviceError) {
        self.event |= match error.code.number() / 100 {
            -1 => COMMAND_ERROR,
            -2 => EXECUTION_ERROR,
            -4 => QUERY_ERROR,
            _ => DEVICE_ERROR,
        };
        if self.errors.len() < QUEUE {
            self.errors.push_back(error);
        } else if let Some(last) = self.errors.back_mut() {
            *last = ErrorCode::QueueOverflow.into();
            self.event |= DEVICE_ERROR;
        }
    }

    pub(super) fn next_error(&mut self) -> DeviceError {
        self.errors
            .pop_front()
            .unwrap_or_else(|| ErrorCode::NoError.into())
    }

    pub(super) fn error_count(&self) -> usize {
        self.errors.len()
    }

    /// Returns the answer of `*STB?`, with the master summary in bit 6; `message` says whether a
    /// reply is waiting.
    pub(super) fn byte(&self, message: bool) -> u8 {
        let summary = u8::from(!self.errors.is_empty()) << 2
            | u8::from(self.questionable.summary()) << 3
            | u8::from(message) << 4
            | u8::from(self.event & self.event_enable != 0) << 5
            | u8::from(self.operation.summary()) << 7;
        let master = summary & self.service_enable & !(1 << 6) != 0;
        summary | u8::from(master) << 6
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn full_error_queue_reports_overflow_and_stays_bounded() {
        let mut status = Status::power_on();
        for _ in 0..100 {
            status.report(ErrorCode::UndefinedHeader.into());
        }
        assert_eq!(status.error_count(), QUEUE);
        for _ in 0..QUEUE - 1 {
            assert_eq!(status.next_error().code, ErrorCode::UndefinedHeader);
        }
        assert_eq!(status.next_error().code, ErrorCode::QueueOverflow);
        assert_eq!(status.next_error().code, ErrorCode::NoError);
        assert_eq!(status.take_event(), POWER_ON | COMMAND_ERROR | DEVICE_ERROR);
    }

    #[test]
    fn summaries_reach_the_status_byte() {
        let mut status = Status::power_on();
        status.take_event();
        assert_eq!(status.byte(false), 0);
        status.service_enable = 1 << 5;
        status.event_enable = EXECUTION_ERROR;
        status.report(ErrorCode::DataOutOfRange.into());
        assert_eq!(status.byte(true), 1 << 2 | 1 << 4 | 1 << 5 | 1 << 6);
        status.clear();
        status.operation.enable = MEASURING;
        status.operation.set(MEASURING | WAITING_FOR_TRIGGER);
        status.operation.set(0);
        assert_eq!(
            status.byte(false),
            1 << 7,
            "the event outlives the condition"
        );
        assert_eq!(
            status.operation.take_event(),
            MEASURING | WAITING_FOR_TRIGGER
        );
        assert_eq!(status.byte(false), 0);
    }
}
