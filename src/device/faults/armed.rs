//! One fault of a schedule: counts events and decides which of the events the fault strikes.

use super::chance::{Chance, Draws};
use phasmid_protocol::faults::{Direction, Fault, Frames, Side, What};

/// Kind of event that a fault strikes.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Way {
    /// Frames, at the start of their exposure.
    Camera,
    /// Messages to the device.
    ToDevice,
    /// Messages to the host.
    ToHost,
}

/// A frame or message that a fault may strike.
#[derive(Debug, Clone, Copy)]
pub(super) struct Event<'a> {
    /// Device time in nanoseconds.
    pub(super) time_ns: u64,
    /// For a command, the command itself; for a reply, the command that it answers; for a frame, the
    /// last command before the frame.
    pub(super) command: &'a str,
    /// For a frame, whether its exposure was triggered; `None` for a message.
    pub(super) triggered: Option<bool>,
}

/// A fault and its counters.
#[derive(Debug, Clone)]
pub(super) struct Armed {
    pub(super) id: u64,
    pub(super) fault: Fault,
    /// Number of matching events.
    counted: u64,
    /// Number of times that the fault has struck.
    pub(super) struck: u64,
}

impl Armed {
    pub(super) fn new(id: u64, fault: Fault) -> Self {
        Self {
            id,
            fault,
            counted: 0,
            struck: 0,
        }
    }

    /// Returns the kind of event that the fault strikes.
    pub(super) fn way(&self) -> Way {
        if self.fault.side() == Side::Camera {
            return Way::Camera;
        }
        match self.fault.what {
            What::Nak
            | What::Disconnect { .. }
            | What::Reset
            | What::BitErrors {
                direction: Direction::ToDevice,
                ..
            } => Way::ToDevice,
            What::BitErrors {
                direction: Direction::ToHost,
                ..
            }
            | What::NoReply
            | What::LateReply { .. }
            | What::ReplyTwice
            | What::GarbageBefore { .. }
            | What::GarbageInside { .. } => Way::ToHost,
            What::Dropped
            | What::Repeated
            | What::Late { .. }
            | What::Swapped { .. }
            | What::Torn { .. }
            | What::RowsMissing { .. }
            | What::BitsFlipped { .. }
            | What::Dark
            | What::WrongPattern { .. }
            | What::PartialExposure { .. } => Way::Camera,
        }
    }

    /// Returns whether the fault has struck as often as allowed.
    pub(super) fn is_over(&self) -> bool {
        self.fault.times.is_some_and(|times| self.struck >= times)
    }

    /// Counts an event. If the fault strikes the event, returns what goes wrong and the event's
    /// random draws.
    pub(super) fn strike(&mut self, event: &Event<'_>, chance: Chance) -> Option<(What, Draws)> {
        if self.is_over() || !self.counts(event) {
            return None;
        }
        self.counted += 1;
        let when = &self.fault.when;
        let due = match (when.nth, when.every) {
            (None, None) => true,
            (Some(nth), None) => self.counted == nth,
            (None, Some(every)) => self.counted.is_multiple_of(every),
            (Some(nth), Some(every)) => {
                self.counted >= nth && (self.counted - nth).is_multiple_of(every)
            }
        };
        let mut draws = chance.draws(self.id, self.counted);
        if !due || when.probability.is_some_and(|p| draws.unit() >= p) {
            return None;
        }
        self.struck += 1;
        Some((self.fault.what, draws))
    }

    /// Returns whether an event matches the fault's conditions.
    fn counts(&self, event: &Event<'_>) -> bool {
        let when = &self.fault.when;
        let side = match event.triggered {
            None => Side::Port,
            Some(_) => Side::Camera,
        };
        let frames =
            event
                .triggered
                .is_none_or(|triggered| match when.frames.unwrap_or_default() {
                    Frames::Triggered => triggered,
                    Frames::Free => !triggered,
                    Frames::All => true,
                });
        let inside = when.window_s.is_none_or(|[from, to]| {
            let time_s = event.time_ns as f64 * 1e-9;
            (from..to).contains(&time_s)
        });
        let command = when.command.as_deref();
        side == self.fault.side()
            && frames
            && inside
            && command.is_none_or(|text| holds(event.command, text))
    }
}

/// Returns whether `text` contains `part`, ignoring ASCII case.
fn holds(text: &str, part: &str) -> bool {
    let part = part.as_bytes();
    part.is_empty()
        || text
            .as_bytes()
            .windows(part.len())
            .any(|window| window.eq_ignore_ascii_case(part))
}

#[cfg(test)]
mod tests {
    use super::*;
    use phasmid_protocol::faults::{What, When};

    fn armed(what: What, when: When, times: Option<u64>) -> Armed {
        let fault = Fault {
            when,
            times,
            ..Fault::new(what)
        };
        Armed::new(1, fault)
    }

    /// Returns the numbers, from 1, of the events that the fault strikes; events are 0.1 s apart.
    fn struck(mut armed: Armed, events: u64, command: &str) -> Vec<u64> {
        let chance = Chance::new(1, "");
        let mut hit = |n: &u64| {
            let event = Event {
                time_ns: n * 100_000_000,
                command,
                triggered: Some(true),
            };
            armed.strike(&event, chance).is_some()
        };
        (1..=events).filter(|n| hit(n)).collect()
    }

    #[test]
    fn fault_strikes_by_its_counts_and_conditions() {
        let when = |nth, every| When {
            nth,
            every,
            ..When::default()
        };
        for (when, times, wanted) in [
            (when(None, None), Some(2), vec![1, 2]),
            (when(Some(3), None), None, vec![3]),
            (when(None, Some(4)), None, vec![4, 8, 12]),
            (when(Some(3), Some(5)), None, vec![3, 8]),
            (
                When {
                    window_s: Some([0.5, 0.8]),
                    nth: Some(2),
                    ..When::default()
                },
                None,
                vec![6],
            ),
            (
                When {
                    frames: Some(Frames::Free),
                    ..When::default()
                },
                None,
                vec![],
            ),
            (
                When {
                    command: Some("*trg".into()),
                    nth: Some(1),
                    ..When::default()
                },
                None,
                vec![1],
            ),
            (
                When {
                    command: Some("*OPC".into()),
                    ..When::default()
                },
                None,
                vec![],
            ),
        ] {
            let hit = struck(armed(What::Dropped, when.clone(), times), 12, "INIT;*TRG");
            assert_eq!(hit, wanted, "{when:?}");
        }
        // A message fault does not strike frames.
        assert!(struck(armed(What::Nak, When::default(), None), 3, "").is_empty());
    }

    #[test]
    fn probability_is_met_and_reproducible() {
        let when = When {
            probability: Some(0.25),
            ..When::default()
        };
        let hit = struck(armed(What::Dark, when.clone(), None), 10_000, "");
        // Five standard deviations of the binomial distribution of the number of hits.
        let far = 5.0 * (10_000.0f64 * 0.25 * 0.75).sqrt();
        assert!((hit.len() as f64 - 2500.0).abs() < far, "{}", hit.len());
        assert_eq!(hit, struck(armed(What::Dark, when, None), 10_000, ""));
    }
}
