//! The light source over device time: its drive, and the light during exposures.

use super::{Model, State};
use std::collections::VecDeque;
use std::sync::Arc;

/// Maximum number of drive changes kept between two exposures; beyond it the oldest changes are
/// dropped.
const MOST_CHANGES: usize = 4096;

/// A piecewise constant value over time, whose early history is discarded.
#[derive(Debug, Clone)]
struct Steps<T> {
    /// Value before the first change in `changes`.
    first: T,
    /// Values, each with its start time in nanoseconds, in order of time.
    changes: VecDeque<(u64, T)>,
}

impl<T: Copy + PartialEq> Steps<T> {
    fn new(first: T) -> Self {
        Self {
            first,
            changes: VecDeque::new(),
        }
    }

    /// Sets the value from a time on, and discards changes planned for that time or later.
    fn set(&mut self, from_ns: u64, value: T) {
        while self.changes.back().is_some_and(|(ns, _)| *ns >= from_ns) {
            self.changes.pop_back();
        }
        if self.changes.back().map_or(self.first, |(_, last)| *last) != value {
            self.changes.push_back((from_ns, value));
        }
    }

    fn at(&self, ns: u64) -> T {
        let before = self.changes.partition_point(|(from_ns, _)| *from_ns <= ns);
        match before {
            0 => self.first,
            _ => self.changes[before - 1].1,
        }
    }

    fn forget_before(&mut self, ns: u64) {
        while let Some((from_ns, value)) = self.changes.front().copied()
            && from_ns <= ns
        {
            self.first = value;
            self.changes.pop_front();
        }
    }
}

/// The light source of a device. Lamp state and current set its drive level; the source is driven at
/// this level while the pattern sequence enables it.
#[derive(Debug, Clone)]
pub struct Source {
    model: Arc<Model>,
    /// Earliest known state and its time in nanoseconds; earlier history is discarded.
    known: (u64, State),
    level: Steps<f64>,
    open: Steps<bool>,
}

impl Source {
    /// Creates a source that is cold, dark and enabled at time 0.
    pub fn new(model: Model) -> Self {
        let state = model.off();
        Self {
            model: Arc::new(model),
            known: (0, state),
            level: Steps::new(0.0),
            open: Steps::new(true),
        }
    }

    /// Sets the drive level, 0 to 1, from a time on.
    pub fn drive(&mut self, from_ns: u64, level: f64) {
        self.level.set(from_ns, level.clamp(0.0, 1.0));
        self.bound();
    }

    /// Enables or disables the source from a time on. This time may be earlier than the time of a
    /// level change that was set before.
    pub fn open(&mut self, from_ns: u64, open: bool) {
        self.open.set(from_ns, open);
        self.bound();
    }

    /// Returns the light from a time on, as far as the drive is known. History before this time is
    /// discarded, so calls must be in order of time, as exposures are.
    pub fn emission(&mut self, start_ns: u64) -> Arc<Emission> {
        self.forget_before(start_ns);
        Arc::new(Emission {
            model: self.model.clone(),
            pieces: self.pieces().collect(),
        })
    }

    /// Returns the intervals of constant drive from the earliest known time on.
    fn pieces(&self) -> impl Iterator<Item = Piece> {
        let (mut from_ns, mut state) = self.known;
        let mut times: Vec<u64> = (self.level.changes.iter().map(|(ns, _)| *ns))
            .chain(self.open.changes.iter().map(|(ns, _)| *ns))
            .filter(|ns| *ns > from_ns)
            .collect();
        times.sort_unstable();
        times.dedup();
        std::iter::once(from_ns).chain(times).map(move |ns| {
            state = self
                .model
                .after(&state, self.drive_at(from_ns), (ns - from_ns) as f64);
            from_ns = ns;
            Piece {
                from_ns,
                state,
                drive: self.drive_at(ns),
            }
        })
    }

    fn drive_at(&self, ns: u64) -> f64 {
        match self.open.at(ns) {
            true => self.level.at(ns),
            false => 0.0,
        }
    }

    fn forget_before(&mut self, ns: u64) {
        if ns <= self.known.0 {
            return;
        }
        let last = self.pieces().take_while(|piece| piece.from_ns <= ns).last();
        if let Some(piece) = last {
            self.known = (ns, piece.after(&self.model, ns));
        }
        self.level.forget_before(ns);
        self.open.forget_before(ns);
    }

    /// Limits the memory used when the lamp is switched many times between exposures.
    fn bound(&mut self) {
        let firsts = [
            self.level
                .changes
                .get(MOST_CHANGES)
                .map(|_| self.level.changes[MOST_CHANGES / 2].0),
            self.open
                .changes
                .get(MOST_CHANGES)
                .map(|_| self.open.changes[MOST_CHANGES / 2].0),
        ];
        if let Some(ns) = firsts.into_iter().flatten().max() {
            self.forget_before(ns);
        }
    }
}

/// An interval of constant drive.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Piece {
    from_ns: u64,
    /// State at the start of the interval.
    state: State,
    drive: f64,
}

impl Piece {
    fn after(&self, model: &Model, ns: u64) -> State {
        model.after(
            &self.state,
            self.drive,
            ns.saturating_sub(self.from_ns) as f64,
        )
    }
}

/// The light of a source over an exposure.
#[derive(Debug, Clone, PartialEq)]
pub struct Emission {
    model: Arc<Model>,
    /// Intervals in order of time, at least one; the last interval has no end.
    pieces: Vec<Piece>,
}

impl Emission {
    /// Returns the mean light over an interval of device time, relative to a cold source at full
    /// current. For an empty interval, returns the light at that time. The light before the earliest
    /// known time is assumed to be constant.
    pub fn mean(&self, from_ns: u64, to_ns: u64) -> f64 {
        let to_ns = to_ns.max(from_ns);
        let first = self
            .pieces
            .partition_point(|piece| piece.from_ns <= from_ns);
        let first = first.saturating_sub(1);
        let light = |piece: &Piece, from_ns: u64, to_ns: u64| {
            let state = piece.after(&self.model, from_ns);
            let step_ns = to_ns.saturating_sub(from_ns) as f64;
            self.model.mean(&state, piece.drive, step_ns)
        };
        if from_ns == to_ns {
            return light(&self.pieces[first], from_ns, to_ns);
        }
        let mut at_ns = from_ns.max(self.pieces[first].from_ns.min(to_ns));
        let mut sum = self.model.light(&self.pieces[first].state) * (at_ns - from_ns) as f64;
        for (i, piece) in self.pieces.iter().enumerate().skip(first) {
            let next = self.pieces.get(i + 1).map_or(u64::MAX, |next| next.from_ns);
            let end_ns = next.min(to_ns);
            if end_ns > at_ns {
                sum += light(piece, at_ns, end_ns) * (end_ns - at_ns) as f64;
                at_ns = end_ns;
            }
            if at_ns == to_ns {
                break;
            }
        }
        sum / (to_ns - from_ns) as f64
    }
}
