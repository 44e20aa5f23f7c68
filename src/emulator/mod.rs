//! The emulated device: clock, firmware, projector, sensor, ground truth, rendering.

mod bench;
mod clock;
pub mod faults;
pub mod firmware;
pub mod led;
mod line;
mod machine;
mod picture;
pub mod port;
mod projection;
mod readout;
pub mod render;
mod roi;
mod shot;
mod sink;
mod slide;
mod truth;
mod truth_maps;

pub use bench::Bench;
pub use clock::VirtualClock;
pub use firmware::{CameraControls, Firmware, State, UserSequence};
pub use line::SerialLine;
pub use machine::Machine;
pub use readout::{Exposure, Readout};
pub use render::Renderer;
pub use roi::Roi;
pub use shot::{Shot, Showing, Shutter};
pub use sink::{FrameSink, MemorySink, Stream, StreamSink};
pub use slide::Slide;
pub use truth::Truth;
