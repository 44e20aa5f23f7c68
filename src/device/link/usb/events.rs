//! A bounded queue of host events that the firmware has not processed yet.
//!
//! If several settings of the same kind are queued, only the last one is kept, and serial bytes are
//! merged with the serial bytes before them. All other events, including triggers on RTS, are kept
//! in order. When the queue is full, the host has to wait.

use super::Event;
use std::collections::VecDeque;

/// Number of queued events at which reading of commands stops. The firmware takes events many times
/// a second.
const MAX_EVENTS: usize = 1024;

/// Events in order of occurrence.
#[derive(Default)]
pub(super) struct Events {
    waiting: VecDeque<Event>,
    /// Number of serial bytes among the events.
    received: usize,
}

impl Events {
    /// Returns whether hosts have to wait until the firmware has taken events.
    pub(super) fn is_full(&self) -> bool {
        self.waiting.len() >= MAX_EVENTS
    }

    pub(super) fn is_empty(&self) -> bool {
        self.waiting.is_empty()
    }

    /// Returns the number of queued serial bytes.
    pub(super) fn received(&self) -> usize {
        self.received
    }

    pub(super) fn push(&mut self, event: Event) {
        if let Event::Received(bytes) = &event {
            self.received += bytes.len();
            if let Some(Event::Received(before)) = self.waiting.back_mut() {
                before.extend(bytes);
                return;
            }
        }
        if is_setting(&event) {
            // Two settings are merged only if no other kind of event lies between them: an event
            // such as a trigger separates them.
            let settings = self.waiting.iter_mut().rev();
            let mut settings = settings.take_while(|before| is_setting(before));
            if let Some(before) = settings.find(|before| is_like(before, &event)) {
                *before = event;
                return;
            }
        }
        self.waiting.push_back(event);
    }

    /// Removes and returns all events.
    pub(super) fn take(&mut self) -> Vec<Event> {
        self.received = 0;
        self.waiting.drain(..).collect()
    }
}

/// Returns whether an event replaces earlier events of the same kind.
fn is_setting(event: &Event) -> bool {
    matches!(
        event,
        Event::Exposure(_) | Event::Gain(_) | Event::LineCoding(_)
    )
}

fn is_like(one: &Event, other: &Event) -> bool {
    std::mem::discriminant(one) == std::mem::discriminant(other)
}

#[cfg(test)]
mod tests {
    use super::*;
    use phasmid_protocol::usb::cdc::HostLines;

    #[test]
    fn repeated_settings_merge_between_triggers() {
        let rts = |rts| Event::Lines(HostLines { dtr: true, rts });
        let mut events = Events::default();
        for event in [
            Event::Exposure(1),
            Event::Gain(1.0),
            Event::Exposure(2),
            rts(true),
            Event::Exposure(3),
            Event::Received(vec![1]),
            Event::Received(vec![2, 3]),
            rts(false),
        ] {
            events.push(event);
        }
        assert_eq!(events.received(), 3);
        let wanted = [
            Event::Exposure(2),
            Event::Gain(1.0),
            rts(true),
            Event::Exposure(3),
            Event::Received(vec![1, 2, 3]),
            rts(false),
        ];
        assert_eq!(events.take(), wanted);
        assert!(events.is_empty() && events.received() == 0);
    }
}
