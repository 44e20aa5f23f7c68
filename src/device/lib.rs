//! The emulated device: firmware, control port, projector timing, readout, faults and the links
//! that carry commands and frames. It renders through `phasmid-render` and never depends on a
//! host-side crate.
//!
//! | module | contents |
//! | --- | --- |
//! | `bench` | a whole device in memory, stepped by function calls, in time that jumps instead of waiting |
//! | `builder` | assembles a device |
//! | [`faults`] | faults on messages, frames and the whole device |
//! | [`firmware`] | commands, trigger system, sequences, status registers |
//! | `link` (Linux) | pseudo-terminal, sockets, V4L2 (feature `v4l2`), USB/IP and the service channel |
//! | `line` | the serial line in device time |
//! | `machine` | the device without its optics |
//! | [`port`] | the control port's dialect |
//! | `projection` | patterns and bit planes over time |
//! | `readout`, `roi` | region, pixel format and data line of a frame |
//! | `sink` | receivers of frames |

mod bench;
mod builder;
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

pub use bench::{Bench, VirtualClock};
pub use builder::{Device, DeviceBuilder};
pub use firmware::{CameraControls, Firmware, State, UserSequence};
pub use line::SerialLine;
pub use machine::Machine;
pub use phasmid_render::Renderer;
pub use phasmid_render::pattern_image::PatternImage;
pub use phasmid_render::shot::{Shot, Showing, Shutter};
pub use phasmid_render::truth::Truth;
pub use readout::{Exposure, Readout};
pub use roi::Roi;
pub use sink::{FrameSink, MemorySink, Stream, StreamSink};
