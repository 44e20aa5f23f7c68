//! How fast frames come, by the clock on the wall.

use std::hint::black_box;
use std::time::Instant;

/// Rounds, of which the fastest counts: what else runs here only ever adds.
const ROUNDS: usize = 3;
/// A round has no more frames than come in so many seconds.
pub(super) const ROUND_S: f64 = 1.0;

/// Seconds that a frame takes where `run` makes so many of them, one after the other; at most
/// `frames` in a round.
pub(super) fn seconds_a_frame(frames: usize, mut run: impl FnMut(usize)) -> f64 {
    // Makes what is made once, and tells how many fit.
    run(1);
    let one = seconds(|| run(1));
    let count = ((ROUND_S / one) as usize).clamp(1, frames);
    let rounds = (0..ROUNDS).map(|_| seconds(|| run(count)) / count as f64);
    rounds.fold(f64::INFINITY, f64::min)
}

/// Seconds that a memory copy of so many bytes takes on one thread.
pub(super) fn seconds_a_copy(bytes: usize) -> f64 {
    const COPIES: usize = 200;
    let from = vec![1u8; bytes];
    let mut to = vec![0u8; bytes];
    let copies =
        (0..COPIES).map(|_| seconds(|| black_box(&mut to).copy_from_slice(black_box(&from))));
    copies.fold(f64::INFINITY, f64::min)
}

fn seconds(run: impl FnOnce()) -> f64 {
    let begin = Instant::now();
    run();
    begin.elapsed().as_secs_f64()
}
