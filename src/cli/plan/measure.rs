//! What the passes and their terms cost here: each is timed with and without, in turns, so that a
//! machine whose speed wanders is as fast for the one as for the other.

use crate::cli::step;
use crate::emulator::render::{Decision, Pass, Term};
use crate::emulator::{Renderer, Shot};
use serde::Serialize;
use std::time::Instant;

/// Rounds, of which the fastest counts: what else runs here only ever adds.
const ROUNDS: usize = 5;

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
pub(super) fn costs(
    renderer: &mut Renderer,
    shots: &[Shot],
    pixels: usize,
) -> (Vec<PassCost>, Vec<TermCost>) {
    step("timing the passes");
    // Makes the slides' tables, which are then at hand.
    frames_ns(renderer, shots);
    let fastest = |ns: &mut dyn FnMut() -> f64| {
        (0..ROUNDS).map(|_| ns()).fold(f64::INFINITY, f64::min) / pixels as f64
    };
    let decisions = renderer.decisions();
    // Where a scene moves, each frame has geometry passes of its own: that is what motion costs, and
    // the other terms are timed without.
    renderer.force(Term::Motion, false);
    let passes = vec![
        PassCost {
            pass: "geometry",
            runs: "once for each state of the scene",
            ns_per_pixel: fastest(&mut || geometry_ns(renderer)),
        },
        PassCost {
            pass: "exposure and sensor",
            runs: "for each frame",
            ns_per_pixel: fastest(&mut || frames_ns(renderer, shots)),
        },
    ];
    let terms = decisions
        .into_iter()
        .map(|decision| {
            step(&format!("timing {}", decision.term));
            let mut fastest = [f64::INFINITY; 2];
            for _ in 0..ROUNDS {
                for (included, fastest) in [false, true].into_iter().zip(&mut fastest) {
                    renderer.force(decision.term, included);
                    let ns = match (decision.term, decision.pass) {
                        (Term::Motion, _) => frames_ns(renderer, &shots[..1]),
                        (_, Pass::Geometry) => geometry_ns(renderer),
                        (_, Pass::Exposure | Pass::Sensor) => frames_ns(renderer, shots),
                    };
                    *fastest = ns.min(*fastest);
                }
            }
            let back = decision.included && decision.term != Term::Motion;
            renderer.force(decision.term, back);
            TermCost {
                decision,
                ns_per_pixel: (fastest[1] - fastest[0]) / pixels as f64,
            }
        })
        .collect();
    (passes, terms)
}

fn geometry_ns(renderer: &mut Renderer) -> f64 {
    renderer.invalidate();
    let begin = Instant::now();
    renderer.prepare();
    begin.elapsed().as_secs_f64() * 1e9
}

/// The mean over a sequence's frames, slides and geometry at hand.
fn frames_ns(renderer: &mut Renderer, shots: &[Shot]) -> f64 {
    renderer.prepare();
    let begin = Instant::now();
    for shot in shots {
        std::hint::black_box(renderer.expose(shot));
    }
    begin.elapsed().as_secs_f64() * 1e9 / shots.len() as f64
}
