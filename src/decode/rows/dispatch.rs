//! The choice of instruction set for all row kernels.
//!
//! The bodies are written once, to vectorise; on x86-64 with AVX2 they run compiled for it. No
//! multiplication is fused with an addition in either, so both give the same bits.

use super::{AxisOut, Job, Scratch, apply_body, decode_body};
use crate::calibrate::{CoordinateRow, Triangulator};
use crate::decode::borders::{self, Near};
use crate::decode::edges::{self, Around};
use crate::decode::samples::Sample;

/// Defines a function that runs `$body` compiled for AVX2 where the machine has it.
macro_rules! dispatch {
    ($(#[$meta:meta])* $name:ident => $body:path
        [$($generic:ident : $bound:path)?] ($($arg:ident : $type:ty),* $(,)?)) => {
        $(#[$meta])*
        pub(in crate::decode) fn $name$(<$generic: $bound>)?($($arg: $type),*) {
            #[cfg(target_arch = "x86_64")]
            {
                #[target_feature(enable = "avx2")]
                fn fast$(<$generic: $bound>)?($($arg: $type),*) {
                    $body($($arg),*);
                }
                if std::arch::is_x86_feature_detected!("avx2") {
                    #[allow(unsafe_code)]
                    // SAFETY: the machine has just said that it has AVX2, which is all that
                    // `fast` asks for beyond the target's baseline.
                    unsafe {
                        fast($($arg),*);
                    }
                    return;
                }
            }
            $body($($arg),*);
        }
    };
}

dispatch! {
    /// Pass 1 of row `v`.
    decode_row => decode_body [T: Sample] (
        job: &Job<'_, T>,
        v: usize,
        scratch: &mut Scratch,
        outs: [Option<AxisOut<'_>>; 2],
        modulation: &mut [f32],
        intensity: &mut [f32],
    )
}

dispatch! {
    /// Pass 2 of a row: see [`edges::judge_row`].
    judge_row => edges::judge_row [] (around: &Around<'_>, period: f32, flags: &mut [u8])
}

dispatch! {
    /// Pass 2 of a row, once the first flags are applied: see [`borders::judge_row`].
    judge_borders => borders::judge_row [] (near: &Near<'_>, period: f32, flags: &mut [u8])
}

dispatch! {
    /// The second half of pass 2: takes a row's flagged pixels out of a map.
    apply_flags => apply_body [] (out: AxisOut<'_>, flags: &[u8])
}

dispatch! {
    /// Pass 3 of row `v`: see [`Triangulator::row`].
    triangulate_row => Triangulator::row [] (
        triangulator: &Triangulator,
        v: usize,
        x: Option<CoordinateRow<'_>>,
        y: Option<CoordinateRow<'_>>,
        depth: &mut [f32],
        sigma: &mut [f32],
    )
}
