//! The light source along device time: what drives it, and what exposures see of it.

use super::{Model, State};
use std::collections::VecDeque;
use std::sync::Arc;

/// Changes of the drive that are told apart between two exposures; of more, the oldest are over.
const MOST_CHANGES: usize = 4096;

/// A value that changes at times, kept from some time on.
#[derive(Debug, Clone)]
struct Steps<T> {
    /// Before the first change that is kept.
    first: T,
    /// Each with the nanosecond that it holds from, in the order of time.
    changes: VecDeque<(u64, T)>,
}

impl<T: Copy + PartialEq> Steps<T> {
    fn new(first: T) -> Self {
        Self {
            first,
            changes: VecDeque::new(),
        }
    }

    /// From a time on it is this, whatever was planned for later.
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

/// A light source in a device. It is driven at a level, as lamp and current say, while patterns
/// open it.
#[derive(Debug, Clone)]
pub struct Source {
    model: Arc<Model>,
    /// Where it stood at this nanosecond; what came before is forgotten.
    known: (u64, State),
    level: Steps<f64>,
    open: Steps<bool>,
}

impl Source {
    /// One that is cold and dark at time 0, and open.
    pub fn new(model: Model) -> Self {
        let state = model.off();
        Self {
            model: Arc::new(model),
            known: (0, state),
            level: Steps::new(0.0),
            open: Steps::new(true),
        }
    }

    /// From a time on lamp and current ask for this, 0 to 1.
    pub fn drive(&mut self, from_ns: u64, level: f64) {
        self.level.set(from_ns, level.clamp(0.0, 1.0));
        self.bound();
    }

    /// From a time on the pattern sequence lets it shine, or not. It may be said later than a
    /// change of the level that came after it.
    pub fn open(&mut self, from_ns: u64, open: bool) {
        self.open.set(from_ns, open);
        self.bound();
    }

    /// What there is of light from a time on, as far as it is known. Times before the latest such
    /// start are forgotten: exposures come in the order of time.
    pub fn emission(&mut self, start_ns: u64) -> Arc<Emission> {
        self.forget_before(start_ns);
        Arc::new(Emission {
            model: self.model.clone(),
            pieces: self.pieces().collect(),
        })
    }

    /// Stretches of constant drive from the time on that is known.
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

    /// Nobody who turns the lamp on and off fills the memory.
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

/// A stretch of constant drive.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Piece {
    from_ns: u64,
    /// At its start.
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
    /// At least one, in the order of time; the last goes on.
    pieces: Vec<Piece>,
}

impl Emission {
    /// Mean over a stretch of device time of the light, relative to that of a cold source at full
    /// current; the light at that time over a stretch of none. Before the first that is known it is
    /// taken to have been as it was then.
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
