//! How commands, studies and benchmarks take times, by a clock that is passed in: rounds, the fastest
//! of which says what the work costs and the others how much else runs here; a memory copy to hold
//! them against; the passes of a renderer with and without their terms.

mod renderer;

pub use phasmid_report::spread::{Spread, quantile};
pub use phasmid_report::stopwatch::{Clock, ROUND_S, Stopwatch};
pub use renderer::Timing;
