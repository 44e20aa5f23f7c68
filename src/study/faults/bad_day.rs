//! The faults that a host is tested with: each kind of fault, at each place of a scan.

use phasmid_protocol::faults::{Direction, Fault, Schedule, Side, What, When};

/// Number of frames or messages at which [`Place::Once`] strikes.
const PLACES: u64 = 6;
/// Rows near the end of a frame at which it is torn: the small devices have 96 rows.
const LATE_ROWS: [u32; 2] = [86, 94];

/// A kind of fault with its parameters.
#[derive(Debug, Clone)]
pub struct BadDay {
    /// Name in a table.
    pub name: String,
    /// The fault, without its time.
    pub fault: Fault,
}

/// The frames or messages that a fault strikes.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Place {
    /// Once per scan. Six scans test six frames or messages, spread from the first to the last.
    Once,
    /// Once per scan. As many scans test every frame or message.
    Each,
    /// At the same frame or message of every attempt.
    Always,
    /// At random, with a probability of one in twenty.
    Chance,
    /// At every second frame or message.
    Second,
}

impl Place {
    /// Returns all places, with [`Self::Each`] if `each` is set and [`Self::Once`] if not.
    /// [`Self::Each`] takes longer than a few minutes.
    pub fn all(each: bool) -> [Self; 4] {
        [
            if each { Self::Each } else { Self::Once },
            Self::Always,
            Self::Chance,
            Self::Second,
        ]
    }

    /// Returns the name in a table.
    pub fn name(self) -> &'static str {
        match self {
            Self::Once => "once per scan, six positions",
            Self::Each => "once per scan, every position",
            Self::Always => "same position in every run",
            Self::Chance => "random, 1 in 20",
            Self::Second => "every second frame or message",
        }
    }
}

impl BadDay {
    fn new(name: &str, what: What) -> Self {
        Self {
            name: name.to_owned(),
            fault: Fault::new(what),
        }
    }

    fn on(mut self, side: Side) -> Self {
        self.fault.on = Some(side);
        self
    }

    /// Returns the faults of frames.
    pub fn of_frames() -> Vec<Self> {
        vec![
            Self::new("dropped", What::Dropped),
            Self::new("repeated", What::Repeated),
            Self::new("late, 100 ms", What::Late { by_ms: 100.0 }),
            Self::new("late, 1000 ms", What::Late { by_ms: 1000.0 }),
            Self::new("swapped", What::Swapped { by_ms: 1000.0 }),
            Self::new("torn in the middle", What::Torn { row: None }),
            Self::new("torn after the first row", What::Torn { row: Some(1) }),
            Self::new(
                "torn near the end",
                What::Torn {
                    row: Some(LATE_ROWS[0]),
                },
            ),
            Self::new(
                "torn at the last rows",
                What::Torn {
                    row: Some(LATE_ROWS[1]),
                },
            ),
            Self::new("rows missing, 1", What::RowsMissing { row: None, rows: 1 }),
            Self::new(
                "rows missing, 1 near the top",
                What::RowsMissing {
                    row: Some(1),
                    rows: 1,
                },
            ),
            Self::new("rows missing, 2", What::RowsMissing { row: None, rows: 2 }),
            Self::new("rows missing, 8", What::RowsMissing { row: None, rows: 8 }),
            Self::new("bits flipped, 1", What::BitsFlipped { count: 1 }),
            Self::new("bits flipped, 64", What::BitsFlipped { count: 64 }),
            Self::new("bits flipped, 4096", What::BitsFlipped { count: 4096 }),
            Self::new("bits flipped, 20000", What::BitsFlipped { count: 20_000 }),
            Self::new("dark", What::Dark),
            Self::new(
                "wrong pattern, the next one",
                What::WrongPattern { offset: 1 },
            ),
            Self::new(
                "wrong pattern, the previous one",
                What::WrongPattern { offset: -1 },
            ),
            Self::new(
                "partial exposure, 0.5",
                What::PartialExposure { fraction: 0.5 },
            ),
            Self::new(
                "partial exposure, 0.65",
                What::PartialExposure { fraction: 0.65 },
            ),
            Self::new(
                "partial exposure, 0.8",
                What::PartialExposure { fraction: 0.8 },
            ),
            Self::new(
                "partial exposure, 0.9",
                What::PartialExposure { fraction: 0.9 },
            ),
            Self::new(
                "partial exposure, 0.95",
                What::PartialExposure { fraction: 0.95 },
            ),
            Self::new("reset", What::Reset),
            Self::new("disconnect, 200 ms", What::Disconnect { for_ms: 200.0 }).on(Side::Camera),
        ]
    }

    /// Returns the faults of messages.
    pub fn of_messages() -> Vec<Self> {
        let bit_error = |direction| What::BitErrors {
            direction,
            count: None,
            rate: None,
        };
        vec![
            Self::new("no reply", What::NoReply),
            Self::new("late reply, 100 ms", What::LateReply { by_ms: 100.0 }),
            Self::new("late reply, 3000 ms", What::LateReply { by_ms: 3000.0 }),
            Self::new("reply twice", What::ReplyTwice),
            Self::new("garbage before", What::GarbageBefore { count: 8 }),
            Self::new("garbage inside", What::GarbageInside { count: 8 }),
            Self::new("bit error to the host", bit_error(Direction::ToHost)),
            Self::new("bit error to the device", bit_error(Direction::ToDevice)),
            Self::new("NAK or busy", What::Nak),
            Self::new("disconnect, 200 ms", What::Disconnect { for_ms: 200.0 }),
            Self::new("disconnect, 10 s", What::Disconnect { for_ms: 10_000.0 }),
            Self::new("reset", What::Reset).on(Side::Port),
        ]
    }

    /// Returns whether this fault is undetectable in the frames if it strikes at `place`. A row that is
    /// missing from every second frame shifts the sines of four steps against their cosines, which
    /// leaves no residual on a smooth surface. The points are off by half a row, which only edges and
    /// texture could show.
    pub fn is_unfindable(&self, place: Place) -> bool {
        place == Place::Second && matches!(self.fault.what, What::RowsMissing { rows: 1, .. })
    }

    /// Returns the schedules for a place; `count` is the number of frames, or of messages of the kind,
    /// in a sound scan.
    pub fn schedules(&self, place: Place, count: u64) -> Vec<Schedule> {
        let at = |nth: u64, when: When| {
            let fault = Fault {
                when,
                ..self.fault.clone()
            };
            Schedule {
                seed: nth,
                fault: vec![fault],
            }
        };
        match place {
            Place::Each => (1..=count).map(|nth| at(nth, nth_of(nth))).collect(),
            Place::Once => {
                let spread = |i: u64| 1 + i * count.saturating_sub(1) / (PLACES - 1);
                let mut places: Vec<u64> = (0..PLACES).map(spread).collect();
                places.dedup();
                places.into_iter().map(|nth| at(nth, nth_of(nth))).collect()
            }
            Place::Always => {
                let when = When {
                    nth: Some(count / 2),
                    every: Some(count),
                    ..When::default()
                };
                vec![at(1, when)]
            }
            Place::Second => {
                let when = When {
                    every: Some(2),
                    ..When::default()
                };
                vec![at(1, when)]
            }
            Place::Chance => {
                let when = || When {
                    probability: Some(0.05),
                    ..When::default()
                };
                (1..=3).map(|seed| at(seed, when())).collect()
            }
        }
    }
}

fn nth_of(nth: u64) -> When {
    When {
        nth: Some(nth),
        ..When::default()
    }
}
