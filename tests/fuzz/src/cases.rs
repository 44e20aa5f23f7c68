//! Scripts for the ordinary tests: seeds and mutations of seeds, which are the same in every run.

use std::ops::Range;
use std::panic::{AssertUnwindSafe, catch_unwind};

/// SplitMix64 (Steele, Lea, Flood 2014); the tests need variety, not statistical quality.
struct Numbers(u64);

impl Numbers {
    fn next(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let z = (self.0 ^ (self.0 >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        let z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
        z ^ (z >> 31)
    }

    fn below(&mut self, n: usize) -> usize {
        (self.next() % n.max(1) as u64) as usize
    }

    fn bytes(&mut self, len: usize) -> Vec<u8> {
        (0..len).map(|_| self.next() as u8).collect()
    }

    fn range(&mut self, len: usize) -> std::ops::Range<usize> {
        let begin = self.below(len + 1);
        let end = begin + self.below((len - begin).min(40) + 1);
        begin..end
    }
}

/// Runs the first `usual` cases, or the cases selected by `PHASMID_FUZZ_CASES=FIRST..END`.
pub fn each(usual: u64, seeds: &[Vec<u8>], run: impl Fn(&[u8])) {
    let named = std::env::var("PHASMID_FUZZ_CASES").ok();
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

/// Returns a case by its number: every fourth case is random bytes, the others are seeds with a few
/// changes.
pub fn case(seeds: &[Vec<u8>], number: u64) -> Vec<u8> {
    let mut numbers = Numbers(number);
    if number % 4 == 3 || seeds.is_empty() {
        let len = numbers.below(400);
        return numbers.bytes(len);
    }
    let mut script = seeds[numbers.below(seeds.len())].clone();
    for _ in 0..numbers.below(9) {
        change(&mut script, seeds, &mut numbers);
    }
    let longest = seeds.iter().map(Vec::len).max().unwrap_or(0);
    script.truncate(4096.max(2 * longest));
    script
}

fn change(script: &mut Vec<u8>, seeds: &[Vec<u8>], numbers: &mut Numbers) {
    let range = numbers.range(script.len());
    match numbers.below(6) {
        0 => {
            let len = range.len();
            script.splice(range, numbers.bytes(len));
        }
        1 => {
            let len = 1 + numbers.below(8);
            script.splice(range.start..range.start, numbers.bytes(len));
        }
        2 => drop(script.drain(range)),
        3 => {
            let again = script[range.clone()].to_vec();
            script.splice(range.end..range.end, again);
        }
        4 => {
            let other = &seeds[numbers.below(seeds.len())];
            let part = other[numbers.range(other.len())].to_vec();
            script.splice(range, part);
        }
        _ => {
            if let Some(byte) = script.get_mut(range.start) {
                *byte ^= 1 << numbers.below(8);
            }
        }
    }
}
