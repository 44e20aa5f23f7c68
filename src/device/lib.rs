//! The emulated device: clock, firmware, projector, sensor, ground truth, rendering.

mod bench;
mod clock;
pub mod faults;
pub mod firmware;
#[cfg(target_os = "linux")]
pub mod link;

mod line;
mod machine;

pub mod port;
mod projection;
mod readout;

mod roi;

mod sink;

pub use bench::Bench;
pub use clock::VirtualClock;
pub use firmware::{CameraControls, Firmware, State, UserSequence};
pub use line::SerialLine;
pub use machine::Machine;
pub use phasmid_render::Renderer;
pub use phasmid_render::shot::{Shot, Showing, Shutter};
pub use phasmid_render::slide::Slide;
pub use phasmid_render::truth::Truth;
pub use readout::{Exposure, Readout};
pub use roi::Roi;
pub use sink::{FrameSink, MemorySink, Stream, StreamSink};
