//! The targets of the fuzzer over cases of our own, the same in every run.

use crate::fuzz::{cases::case, device, host};
use std::ops::Range;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::time::Duration;

/// Runs cases; `PHASMA_FUZZ_CASES=FIRST..END` names others than the usual ones.
fn cases(usual: u64, seeds: &[Vec<u8>], run: impl Fn(&[u8])) {
    let named = std::env::var("PHASMA_FUZZ_CASES").ok();
    let range: Range<u64> = named.map_or(0..usual, |named| {
        let (first, end) = named.split_once("..").expect("FIRST..END");
        first.parse().unwrap()..end.parse().unwrap()
    });
    for number in range {
        let script = case(seeds, number);
        let done = catch_unwind(AssertUnwindSafe(|| run(&script)));
        assert!(done.is_ok(), "case {number}: {script:?}");
    }
}

#[test]
fn a_hostile_host_gets_sound_replies_or_is_let_go() {
    let seeds = device::seeds();
    for seed in &seeds {
        device::run(seed);
    }
    cases(4000, &seeds, device::run);
}

#[test]
fn a_hostile_server_gets_the_host_to_give_up_in_time() {
    cases(150, &host::seeds(), |script| {
        host::run(script);
    });
}

/// Otherwise the cases above would show little.
#[test]
fn a_server_without_harm_gives_frames_and_an_echo() {
    for script in [&[][..], &[1], &[0, 1], &[1, 1]] {
        let reached = host::run_within(script, Duration::from_secs(5));
        assert!(reached.opened && reached.echoed, "{reached:?}");
        assert_eq!(reached.frames, 6);
    }
}
