//! How commands, studies and benchmarks take times, by a clock that is passed in: rounds, the fastest
//! of which says what the work costs and the others how much else runs here; a memory copy to hold
//! them against; the passes of a renderer with and without their terms.

pub use phasmid_report::spread::{Spread, quantile};
pub use phasmid_report::stopwatch::{Clock, ROUND_S, Stopwatch};

use phasmid_render::{Pass, Renderer, Term, shot::Shot};

/// Rounds, of which the fastest counts: what else runs here only ever adds.
const ROUNDS: usize = 5;
/// No round begins after this many seconds: heavy scenes have fewer of them.
const ENOUGH_S: f64 = 1.5;

/// Times the passes of a renderer for the exposures of a sequence. All figures are nanoseconds a
/// pixel of all threads together, the fastest of some rounds.
pub struct Timing<'a> {
    renderer: &'a mut Renderer,
    shots: &'a [Shot],
    watch: Stopwatch<'a>,
}

impl<'a> Timing<'a> {
    /// Prepares what the exposures, of which there is at least one, need.
    pub fn new(renderer: &'a mut Renderer, shots: &'a [Shot], watch: Stopwatch<'a>) -> Self {
        let mut timing = Self {
            renderer,
            shots,
            watch,
        };
        // Makes the slides' tables, which are then at hand.
        timing.once_ns(Pass::Exposure);
        timing
    }

    fn rounds(&self) -> impl Iterator<Item = usize> + use<'a> {
        self.watch.rounds(ROUNDS, ENOUGH_S)
    }

    /// A pass under the plan; the exposure and the sensor pass run as one, whose mean over the
    /// frames this is.
    pub fn pass_ns(&mut self, pass: Pass) -> f64 {
        let rounds = self.rounds();
        let once = |_| self.once_ns(pass);
        rounds.map(once).fold(f64::INFINITY, f64::min)
    }

    /// The same of this renderer and another one, in turns.
    pub fn beside_ns(&mut self, other: &mut Self, pass: Pass) -> [f64; 2] {
        let rounds = self.rounds();
        let both = rounds.map(|_| [self.once_ns(pass), other.once_ns(pass)]);
        both.fold([f64::INFINITY; 2], |[a, b], [c, d]| [a.min(c), b.min(d)])
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
        for _ in self.rounds() {
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
                let renderer = &mut self.renderer;
                let prepare = || {
                    renderer.prepare();
                };
                self.watch.seconds(prepare) * 1e9
            }
            Pass::Exposure | Pass::Sensor => {
                // A plan that has just changed has no tables; they are made once a sequence.
                self.renderer.make_ready(self.shots);
                let (renderer, shots) = (&mut self.renderer, self.shots);
                let expose = || {
                    for shot in shots {
                        std::hint::black_box(renderer.expose(shot));
                    }
                };
                self.watch.seconds(expose) * 1e9 / shots.len() as f64
            }
        };
        ns / self.renderer.pixel_count() as f64
    }
}
