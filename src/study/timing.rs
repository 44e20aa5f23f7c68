//! Timing for commands, studies and benchmarks, with a clock that is passed in. Work is repeated in
//! rounds: the fastest round shows the cost of the work, the others the load of the machine. A memory
//! copy serves as reference. The passes of a renderer are timed with and without their terms.

pub use phasmid_report::spread::{Spread, quantile};
pub use phasmid_report::stopwatch::{Clock, ROUND_S, Stopwatch};

use phasmid_render::{Pass, Renderer, Term, shot::Shot};

/// Number of rounds; the fastest counts, because other load only adds time.
const ROUNDS: usize = 5;
/// Seconds after which no further round begins, so heavy scenes have fewer rounds.
const ENOUGH_S: f64 = 1.5;

/// Times the passes of a renderer for the exposures of a sequence. All figures are nanoseconds per
/// pixel for all threads together, the fastest of some rounds.
pub struct Timing<'a> {
    renderer: &'a mut Renderer,
    shots: &'a [Shot],
    watch: Stopwatch<'a>,
}

impl<'a> Timing<'a> {
    /// Prepares the renderer for the exposures, of which there must be at least one.
    pub fn new(renderer: &'a mut Renderer, shots: &'a [Shot], watch: Stopwatch<'a>) -> Self {
        let mut timing = Self {
            renderer,
            shots,
            watch,
        };
        // Computes the tables of the pattern images once, before timing.
        timing.once_ns(Pass::Exposure);
        timing
    }

    fn rounds(&self) -> impl Iterator<Item = usize> + use<'a> {
        self.watch.rounds(ROUNDS, ENOUGH_S)
    }

    /// Returns the time of a pass under the current plan. The exposure and the sensor pass run as one;
    /// their time is the mean over the frames.
    pub fn pass_ns(&mut self, pass: Pass) -> f64 {
        let rounds = self.rounds();
        let once = |_| self.once_ns(pass);
        rounds.map(once).fold(f64::INFINITY, f64::min)
    }

    /// Returns the times of a pass with this renderer and with another, measured in alternating rounds.
    pub fn beside_ns(&mut self, other: &mut Self, pass: Pass) -> [f64; 2] {
        let rounds = self.rounds();
        let both = rounds.map(|_| [self.once_ns(pass), other.once_ns(pass)]);
        both.fold([f64::INFINITY; 2], |[a, b], [c, d]| [a.min(c), b.min(d)])
    }

    /// Returns the times of a term's pass without and with the term; restores the plan.
    pub fn term_ns(&mut self, term: Term) -> [f64; 2] {
        let included = self.renderer.plan().has(term);
        let shots = self.shots;
        if term == Term::Motion {
            // Use one frame, which must compute its geometry.
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

    /// Returns the time of a pass with all terms forced in; restores the plan.
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

    /// Times one round.
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
                // A change of the plan discards the tables. Compute them before timing, because a
                // device computes them only once per sequence.
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
