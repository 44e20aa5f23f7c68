//! Measures durations with a clock that the caller provides.

use crate::spread::Spread;
use std::hint::black_box;
use std::time::Duration;

/// Returns the time since a fixed moment.
pub type Clock<'a> = &'a (dyn Fn() -> Duration + Sync);

/// Target duration of a round of frames in seconds, which limits the number of frames per round.
pub const ROUND_S: f64 = 1.0;
/// Number of rounds of frames. The fastest round counts, because other programs can only slow a round
/// down.
const ROUNDS: usize = 3;
/// Number of memory copies, of which the fastest counts.
const COPIES: usize = 200;
/// Number of memory copies per round of [`Stopwatch::beside_a_copy`].
const BESIDE: usize = 3;

/// Measures durations.
#[derive(Clone, Copy)]
pub struct Stopwatch<'a> {
    clock: Clock<'a>,
}

impl<'a> Stopwatch<'a> {
    /// Makes a stopwatch with a clock.
    pub fn new(clock: Clock<'a>) -> Self {
        Self { clock }
    }

    /// Runs `work`; returns its result and its duration in seconds.
    pub fn timed<T>(self, work: impl FnOnce() -> T) -> (T, f64) {
        let begin = (self.clock)();
        let done = work();
        (done, (self.clock)().saturating_sub(begin).as_secs_f64())
    }

    /// Returns the clock's time in seconds.
    pub fn now_s(self) -> f64 {
        (self.clock)().as_secs_f64()
    }

    /// Returns the duration of `work` in seconds.
    pub fn seconds(self, work: impl FnOnce()) -> f64 {
        self.timed(work).1
    }

    /// Returns the indices of up to `most` rounds. No round but the first starts after `enough_s`
    /// seconds.
    pub fn rounds(self, most: usize, enough_s: f64) -> impl Iterator<Item = usize> + use<'a> {
        let begin = (self.clock)();
        let passed = move || (self.clock)().saturating_sub(begin).as_secs_f64();
        (0..most).take_while(move |&i| i == 0 || passed() < enough_s)
    }

    /// Returns the quartiles of the duration of `work` in seconds, over the rounds of [`Self::rounds`].
    pub fn spread(self, most: usize, enough_s: f64, mut work: impl FnMut()) -> Spread {
        let rounds = self.rounds(most, enough_s);
        Spread::new(rounds.map(|_| self.seconds(&mut work)).collect())
    }

    /// Returns the shortest duration of `work` in seconds, over the rounds of [`Self::rounds`].
    pub fn fastest(self, most: usize, enough_s: f64, mut work: impl FnMut()) -> f64 {
        let rounds = self.rounds(most, enough_s);
        let seconds = rounds.map(|_| self.seconds(&mut work));
        seconds.fold(f64::INFINITY, f64::min)
    }

    /// Returns the seconds per frame. `run(n)` makes `n` frames; a round has at most `frames` frames
    /// and takes about [`ROUND_S`] at most.
    pub fn seconds_a_frame(self, frames: usize, mut run: impl FnMut(usize)) -> f64 {
        // The first run includes one-time preparation; the second shows how many frames fit in a round.
        run(1);
        let one = self.seconds(|| run(1));
        let count = ((ROUND_S / one) as usize).clamp(1, frames.max(1));
        let rounds = (0..ROUNDS).map(|_| self.seconds(|| run(count)) / count as f64);
        rounds.fold(f64::INFINITY, f64::min)
    }

    /// Returns the duration in seconds of a memory copy of `bytes` bytes on one thread: the shortest of
    /// many copies.
    pub fn seconds_a_copy(self, bytes: usize) -> f64 {
        let from = vec![1u8; bytes];
        let mut to = vec![0u8; bytes];
        let copies = (0..COPIES)
            .map(|_| self.seconds(|| black_box(&mut to).copy_from_slice(black_box(&from))));
        copies.fold(f64::INFINITY, f64::min)
    }

    /// Returns the shortest durations in seconds of `work` and of a memory copy of `bytes` bytes. They
    /// run in alternation for `enough_s` seconds, so that a change in the machine's speed affects both
    /// equally.
    pub fn beside_a_copy(self, bytes: usize, enough_s: f64, mut work: impl FnMut()) -> [f64; 2] {
        let from = vec![1u8; bytes];
        // Fill with nonzero bytes: the system allocates the memory of zeros only at the first
        // write, which takes longer than the copy.
        let mut to = vec![2u8; bytes];
        work();
        let mut fastest = [f64::INFINITY; 2];
        for _ in self.rounds(usize::MAX, enough_s) {
            fastest[0] = fastest[0].min(self.seconds(&mut work));
            for _ in 0..BESIDE {
                let copy = || black_box(&mut to).copy_from_slice(black_box(&from));
                fastest[1] = fastest[1].min(self.seconds(copy));
            }
        }
        fastest
    }

    /// Returns the shortest durations in seconds of two pieces of work, which run in alternation for
    /// `enough_s` seconds, after one run of each.
    pub fn in_turns(self, enough_s: f64, works: &mut [Box<dyn FnMut()>; 2]) -> [f64; 2] {
        works.iter_mut().for_each(|work| work());
        let mut fastest = [f64::INFINITY; 2];
        for _ in self.rounds(usize::MAX, enough_s) {
            for (fastest, work) in fastest.iter_mut().zip(works.iter_mut()) {
                *fastest = fastest.min(self.seconds(work));
            }
        }
        fastest
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::sync::atomic::{AtomicU64, Ordering};

    #[test]
    fn stopwatch_ends_rounds_when_time_is_up() {
        let ticks = AtomicU64::new(0);
        let clock = || Duration::from_millis(ticks.load(Ordering::Relaxed));
        let watch = Stopwatch::new(&clock);
        let work = || {
            ticks.fetch_add(300, Ordering::Relaxed);
        };
        assert_eq!(watch.rounds(9, 1.0).map(|_| work()).count(), 4);
        assert_eq!(watch.rounds(2, 1.0).map(|_| work()).count(), 2);
        assert_eq!(watch.rounds(5, 0.0).map(|_| work()).count(), 1);
        assert!((watch.spread(3, 9.0, work).median - 0.3).abs() < 1e-12);
        let a_frame = watch.seconds_a_frame(10, |count| (0..count).for_each(|_| work()));
        assert!((a_frame - 0.3).abs() < 1e-12);
        assert_eq!(watch.beside_a_copy(8, 1.0, work), [0.3, 0.0]);
        assert_eq!(watch.seconds_a_copy(8), 0.0);
    }
}
