//! What the passes and their terms cost here: each is timed with and without, in turns, so that a
//! machine whose speed wanders is as fast for the one as for the other.

use crate::cli::step;
use phasmid_render::{Decision, Pass, Term};
use phasmid_render::{Renderer, shot::Shot};
use phasmid_report::stopwatch::Stopwatch;
use phasmid_study::timing::Timing;
use serde::Serialize;
use std::time::Instant;

/// A pass as it runs, and what it costs.
#[derive(Debug, Serialize)]
pub(super) struct PassCost {
    /// The pass; the exposure and the sensor pass run as one.
    pub(super) pass: &'static str,
    /// How often it runs.
    pub(super) runs: &'static str,
    /// Nanoseconds a pixel on all threads together.
    pub(super) ns_per_pixel: f64,
}

/// A term, and what it costs or would cost.
#[derive(Debug, Serialize)]
pub(super) struct TermCost {
    #[serde(flatten)]
    pub(super) decision: Decision,
    /// Nanoseconds a pixel more with it than without.
    pub(super) ns_per_pixel: f64,
}

/// The costs of a renderer's plan for the exposures of a sequence.
pub(super) fn costs(renderer: &mut Renderer, shots: &[Shot]) -> (Vec<PassCost>, Vec<TermCost>) {
    step("timing the passes");
    let decisions = renderer.decisions();
    // Where a scene moves, each frame has geometry passes of its own: that is what motion costs, and
    // the other terms are timed without.
    renderer.force(Term::Motion, false);
    let begin = Instant::now();
    let clock = || begin.elapsed();
    let mut timing = Timing::new(renderer, shots, Stopwatch::new(&clock));
    let passes = vec![
        PassCost {
            pass: "geometry",
            runs: "once for each state of the scene",
            ns_per_pixel: timing.pass_ns(Pass::Geometry),
        },
        PassCost {
            pass: "exposure and sensor",
            runs: "for each frame",
            ns_per_pixel: timing.pass_ns(Pass::Exposure),
        },
    ];
    let terms = decisions.into_iter().map(|decision| {
        step(&format!("timing {}", decision.term));
        let [without, with] = timing.term_ns(decision.term);
        TermCost {
            decision,
            ns_per_pixel: with - without,
        }
    });
    (passes, terms.collect())
}
