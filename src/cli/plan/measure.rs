//! What the passes and their terms cost here: each is timed with and without, in turns, so that a
//! machine whose speed wanders is as fast for the one as for the other.

use crate::cli::step;
use crate::emulator::render::{Decision, Pass, Term};
use crate::emulator::{Renderer, Shot};
use serde::Serialize;
use std::time::Instant;

/// Rounds, of which the fastest counts: what else runs here only ever adds.
const ROUNDS: usize = 5;
/// No round begins after this many seconds: heavy scenes have fewer of them.
const ENOUGH_S: f64 = 1.5;

/// The rounds of one figure.
fn rounds() -> impl Iterator<Item = usize> {
    let begin = Instant::now();
    (0..ROUNDS).take_while(move |&i| i == 0 || begin.elapsed().as_secs_f64() < ENOUGH_S)
}

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
    let mut timing = Timing::new(renderer, shots);
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

/// Times the passes of a renderer for the exposures of a sequence. All figures are nanoseconds a
/// pixel of all threads together, the fastest of some rounds.
pub struct Timing<'a> {
    renderer: &'a mut Renderer,
    shots: &'a [Shot],
}

impl<'a> Timing<'a> {
    /// Prepares what the exposures, of which there is at least one, need.
    pub fn new(renderer: &'a mut Renderer, shots: &'a [Shot]) -> Self {
        let mut timing = Self { renderer, shots };
        // Makes the slides' tables, which are then at hand.
        timing.once_ns(Pass::Exposure);
        timing
    }

    /// A pass under the plan; the exposure and the sensor pass run as one, whose mean over the
    /// frames this is.
    pub fn pass_ns(&mut self, pass: Pass) -> f64 {
        let once = |_| self.once_ns(pass);
        rounds().map(once).fold(f64::INFINITY, f64::min)
    }

    /// The same of this renderer and another one, in turns.
    pub fn beside_ns(&mut self, other: &mut Self, pass: Pass) -> [f64; 2] {
        let rounds = rounds().map(|_| [self.once_ns(pass), other.once_ns(pass)]);
        rounds.fold([f64::INFINITY; 2], |[a, b], [c, d]| [a.min(c), b.min(d)])
    }

    /// The pass that a term belongs to, without it and with it; the plan is as before after that.
    pub fn term_ns(&mut self, term: Term) -> [f64; 2] {
        let included = self.renderer.plan().has(term);
        let shots = self.shots;
        if term == Term::Motion {
            // A frame alone: it has its geometry to do.
            self.shots = &shots[..1];
        }
        let mut fastest = [f64::INFINITY; 2];
        for _ in rounds() {
            for (included, fastest) in [false, true].into_iter().zip(&mut fastest) {
                self.renderer.force(term, included);
                *fastest = fastest.min(self.once_ns(term.pass()));
            }
        }
        self.renderer.force(term, included);
        self.shots = shots;
        fastest
    }

    /// A pass with all terms forced in; the plan is as before after that.
    pub fn full_ns(&mut self, pass: Pass) -> f64 {
        let plan = self.renderer.plan();
        let left_out = Term::ALL.into_iter().filter(|term| !plan.has(*term));
        for term in left_out.clone() {
            self.renderer.force(term, true);
        }
        let ns = self.pass_ns(pass);
        for term in left_out {
            self.renderer.force(term, false);
        }
        ns
    }

    /// One round.
    fn once_ns(&mut self, pass: Pass) -> f64 {
        let ns = match pass {
            Pass::Geometry => {
                self.renderer.invalidate();
                let begin = Instant::now();
                self.renderer.prepare();
                begin.elapsed().as_secs_f64() * 1e9
            }
            Pass::Exposure | Pass::Sensor => {
                // A plan that has just changed has no tables; they are made once a sequence.
                self.renderer.make_ready(self.shots);
                let begin = Instant::now();
                for shot in self.shots {
                    std::hint::black_box(self.renderer.expose(shot));
                }
                begin.elapsed().as_secs_f64() * 1e9 / self.shots.len() as f64
            }
        };
        ns / self.renderer.pixel_count() as f64
    }
}
