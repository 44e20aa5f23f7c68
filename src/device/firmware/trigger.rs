//! The trigger system: a state machine in device time. When armed, each exposure gives exactly one
//! frame, in order; nothing else is exposed.
//!
//! | from | by | to |
//! | --- | --- | --- |
//! | Idle | `INITiate` | Armed at pattern 0 |
//! | Armed | a trigger | Running: the sequence, or in STEP mode the next pattern |
//! | Running | last exposure of the trigger ends | Armed at the next pattern, if one is left |
//! | Running | last exposure of the sequence ends | Idle; Armed with `INITiate:CONTinuous ON` |
//! | Armed, Running | `ABORt` | Idle; Armed with `INITiate:CONTinuous ON` |
//! | Idle | source INTernal and a client reads | Free |
//! | Free | another source, or no client reads | Idle; Armed with `INITiate:CONTinuous ON` |

use super::settings::{Mode, Settings, Source};
use phasmid_protocol::scpi::{DeviceError, ErrorCode};

/// State of the trigger system.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum State {
    /// Nothing is exposed.
    Idle,
    /// Free-running.
    Free {
        /// Start of the next exposure in nanoseconds of device time.
        start_ns: u64,
    },
    /// Waiting for a trigger, which exposes pattern `next` and, unless in STEP mode, all later
    /// patterns.
    Armed {
        /// Position in the sequence of the next pattern.
        next: u32,
    },
    /// Exposing patterns `next..end`; pattern `next` is exposed from `start_ns` on.
    Running {
        /// Position in the sequence of the pattern being exposed.
        next: u32,
        /// Position after the last pattern that this trigger exposes.
        end: u32,
        /// Start of the exposure of pattern `next` in nanoseconds of device time.
        start_ns: u64,
    },
}

/// A completed exposure.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Exposed {
    /// Position in the sequence; `None` when free-running.
    pub(super) index: Option<u32>,
    pub(super) start_ns: u64,
    /// Position after the last exposure that the same trigger started.
    pub(super) end: u32,
}

/// Maximum lag in nanoseconds of a free-running camera that catches up; a camera that lags more
/// skips frames.
const MAX_LAG_NS: u64 = 1_000_000_000;

impl State {
    /// Returns the state of the trigger system when no operation is pending.
    pub(super) fn rest(settings: &Settings, streaming: bool, now_ns: u64) -> Self {
        if settings.source == Source::Internal {
            if streaming {
                return Self::Free { start_ns: now_ns };
            }
        } else if settings.continuous {
            return Self::Armed { next: 0 };
        }
        Self::Idle
    }

    /// Returns whether an `INITiate` is in progress.
    pub(super) fn initiated(self) -> bool {
        matches!(self, Self::Armed { .. } | Self::Running { .. })
    }

    /// Handles `INITiate`.
    pub(super) fn initiate(&mut self, settings: &Settings) -> Result<(), DeviceError> {
        if self.initiated() {
            return Err(ErrorCode::InitIgnored.into());
        }
        if settings.source == Source::Internal {
            return Err(ErrorCode::SettingsConflict
                .with("TRIGger:SOURce INTernal runs free, choose SOFTware, BUS or EXTernal"));
        }
        *self = Self::Armed { next: 0 };
        Ok(())
    }

    /// Handles a trigger for a sequence of `len` patterns.
    pub(super) fn trigger(
        &mut self,
        settings: &Settings,
        len: u32,
        now_ns: u64,
    ) -> Result<(), DeviceError> {
        let Self::Armed { next } = *self else {
            return Err(ErrorCode::TriggerIgnored.with(match self {
                Self::Running { .. } => "still exposing",
                _ => "not initiated",
            }));
        };
        *self = Self::Running {
            next,
            end: match settings.mode {
                Mode::Sequence => len,
                Mode::Step => next + 1,
            },
            start_ns: now_ns.saturating_add(settings.start_delay_ns()),
        };
        Ok(())
    }

    /// Returns when the current or next exposure has ended and been read out.
    pub(super) fn next_event_ns(self, settings: &Settings) -> Option<u64> {
        match self {
            Self::Free { start_ns } | Self::Running { start_ns, .. } => {
                Some(start_ns.saturating_add(settings.done_ns()))
            }
            Self::Idle | Self::Armed { .. } => None,
        }
    }

    /// Ends the exposure due at `now_ns`, if any, of a sequence of `len` patterns.
    pub(super) fn advance(
        &mut self,
        settings: &Settings,
        len: u32,
        now_ns: u64,
    ) -> Option<Exposed> {
        if self.next_event_ns(settings)? > now_ns {
            return None;
        }
        match *self {
            Self::Free { mut start_ns } => {
                let interval = settings
                    .interval_ns
                    .max(settings.shortest_period_ns())
                    .max(1);
                let lag = now_ns - start_ns;
                if lag > MAX_LAG_NS {
                    start_ns += (lag - settings.done_ns()) / interval * interval;
                }
                *self = Self::Free {
                    start_ns: start_ns + interval,
                };
                Some(Exposed {
                    index: None,
                    start_ns,
                    end: 0,
                })
            }
            Self::Running {
                next,
                end,
                start_ns,
            } => {
                *self = if next + 1 < end {
                    Self::Running {
                        next: next + 1,
                        end,
                        start_ns: start_ns.saturating_add(settings.period_ns),
                    }
                } else if end < len {
                    Self::Armed { next: end }
                } else if settings.continuous {
                    Self::Armed { next: 0 }
                } else {
                    Self::Idle
                };
                Some(Exposed {
                    index: Some(next),
                    start_ns,
                    end,
                })
            }
            Self::Idle | Self::Armed { .. } => None,
        }
    }
}
