//! Measures the run times of the render passes and of the terms of image formation that a plan
//! selects. A renderer is timed with and without a term in alternation, so that a change in the
//! machine's speed affects both times equally.

use crate::cli::output::step;
use phasmid_render::{Decision, Pass, Term};
use phasmid_render::{Renderer, shot::Shot};
use phasmid_report::stopwatch::Stopwatch;
use phasmid_study::timing::Timing;
use serde::Serialize;
use std::time::Instant;

/// A pass and its cost.
#[derive(Debug, Serialize)]
pub(super) struct PassCost {
    /// The pass; the exposure and the sensor pass run as one.
    pub(super) pass: &'static str,
    /// How often the pass runs.
    pub(super) runs: &'static str,
    /// Run time in nanoseconds per pixel, using all threads.
    pub(super) ns_per_pixel: f64,
}

/// A term of image formation, and the time that it costs or would cost.
#[derive(Debug, Serialize)]
pub(super) struct TermCost {
    #[serde(flatten)]
    pub(super) decision: Decision,
    /// Additional run time with the term, in nanoseconds per pixel.
    pub(super) ns_per_pixel: f64,
}

/// Measures the costs of a renderer's plan for the exposures of a sequence.
pub(super) fn costs(renderer: &mut Renderer, shots: &[Shot]) -> (Vec<PassCost>, Vec<TermCost>) {
    step("timing the passes");
    let decisions = renderer.decisions();
    // In a moving scene, each frame has its own geometry passes, which are the cost of motion. Therefore
    // time the other terms without motion.
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
