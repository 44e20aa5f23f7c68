//! Phasmid: a structured-light 3D scanner that is not there.
//!
//! It renders what a real scanner's camera would see, hands the frames out as a camera would, takes
//! projector and trigger commands on a serial port, and decodes the frames of any such device,
//! emulated or physical, into a measured surface. This page is the map.
//!
//! # Two halves and the ground between them
//!
//! ```text
//!  profile + scene                                                 sequence manifest
//!        |                                                                 |
//!   [ emulator ] --> [ link: socket, V4L2, USB ] --> [ host: camera ] --> [ decode ] --> cloud
//!        ^                                                   |               ^
//!        +---- [ link: pty, USB ] <------ [ host: port ] <---+          calibration
//! ```
//!
//! | layer  | crate | here | holds |
//! | ------ | ----- | ---- | ----- |
//! | ground | `core` | [`error`] | errors, checked values, TOML with line numbers, file input and output, random numbers, SIMD dispatch |
//! | ground | `shaders`, `device-profiles` | | embedded WGSL; embedded profiles, scenes, stations, dialects, patients |
//! | ground | `geometry` | [`geometry`] | poses, the lens model, rigs, solids, meshes and their files, ray casting |
//! | ground | `pattern` | [`pattern`] | what a projector shows; the sequence manifest |
//! | ground | `protocol` | [`protocol`] | SCPI, dialects, the frame socket's header, the data line, USB and USB/IP, recordings, the service channel, `device.json`, schedules of faults |
//! | ground | `planning` | [`patient`] | volumes, MetaImage, CT series of DICOM, the skin as an iso-surface, the planning folder and what is imported into one |
//! | ground | `v4l2` | `v4l2` | nodes and queues of buffers of the kernel's camera interface (Linux only) |
//! | device | `phantom` | [`patient::phantom`] | generated patients: a breathing thorax with a tumour |
//! | device | `profile` | [`profile`] | devices, scenes and stations as typed, checked structs; the built-in ones |
//! | device | `render` | [`emulator::render`] | image formation on the CPU and on a GPU, ground truth |
//! | device | `device` | [`emulator`], `link` | firmware, control port and line, faults; how a device reaches the world: pty, frame socket, V4L2 node, USB device, service socket, the time and the scene that several devices share, replay (links on Linux only) |
//! | host   | `decode` | [`decode`] | frames to projector coordinates to points |
//! | host   | `calibrate` | [`calibrate`] | boards in pictures, solving for the rig or for where a known one stands, its files and report |
//! | host   | `measure` | [`measure`] | distances to the truth, overlap of solids, registration |
//! | host   | `host` | [`host`] | how an application reaches a device: camera, port (SCPI or a dialect), scanner |
//! | host   | `sgrt` | [`host::track`] | a patient by the skin: six degrees of freedom, the tumour by a motion model, beam-hold |
//! | both   | `report` | [`measure::plot`] | plots, pictures, the studies' bookkeeping |
//! | top    | `study` | [`study`] | what needs both halves |
//! | top    | this one | `doctor`, [`cli`] | what a machine lacks (Linux only); the commands |
//!
//! Each crate `NAME` is `phasmid-NAME` in the folder `src/NAME` (`shaders` and `device-profiles` at the
//! top level), and this one hands all of them out. A crate depends only on those above it in the
//! members of `Cargo.toml`. The wall: host-side crates never depend on device-side ones, nor the
//! reverse, not even in their tests; `.ci/crates` checks it. A decoder that could look behind it would
//! prove nothing.
//!
//! # Conventions
//!
//! Millimetres, seconds and radians inside; files carry the unit in the field's name. Device time
//! is integer nanoseconds. The camera's frame is OpenCV's (x right, y down, z forward, pixel centres
//! at integers) and the rig's frame is camera 0's. A pose `a_from_b` takes coordinates in b to
//! coordinates in a. A fringe is `A + B cos(2 pi x / period_px + phase_rad)`; see [`pattern`].
//! Nothing below [`cli`] reads a wall clock, the environment or a global random generator.
//!
//! # Where the code departs from the first design, and why
//!
//! - A footprint seen along a pattern's axis is not a box but the convolution of two (by the
//!   camera's column and row). Second differences of a second prefix sum average a slide under that
//!   trapezoid as exactly as first differences do under a box, so `exposure` does that.
//! - Rays are cast in packets of sixteen with one origin, so shadow rays start at the projector's
//!   pupil and end at the surface, and the hierarchy's traversal is ours; obvhs builds it.
//! - A hit in f32 carries a bound on its error, and hits whose order the bounds leave open are put
//!   in order in f64, shadows too: no margin has to fit all sizes of triangles and scenes.
//! - Samples of a pixel only decide whether the closed form of its footprint stands for it; their
//!   mean counts where it does not. Depth of field widens that footprint by two boxes with the
//!   disc's moments, so that it costs a frame nothing.
//! - A mesh that moves has a hierarchy of its own, in its own frame, and packets of rays are taken
//!   there; an exposure of it is the mean of frames at a few instants. Instants between which nothing
//!   has moved are one, so a scene pays for motion only while it lasts.
//! - Shaders are put together by their first lines rather than by a preprocessor, and buffers bound by
//!   name. Ground truth comes from the CPU whatever renders the frames: it is f64's to say.
//! - STL, OBJ, PLY, `.npy` and OpenCV's YAML and XML are read and written here: the crates lose the
//!   line of an error, f64 vertices, or bounds on memory.
//! - DICOM is read here as far as CT images go: the crate for it makes room for whatever length a file
//!   declares, and recurses into sequences as deep as they are.
//! - Ambient light, radiometry and the sensor work in SI units and electrons from the start, so that
//!   an exposure in a profile means what it means on a camera.
//! - The embedded data line is in the frames of every link, as a sensor puts it there, so that they
//!   are the same bytes everywhere; the host takes it off wherever it finds one.
//! - Noise is keyed by a count of triggered exposures and one of free-running ones, not by the
//!   frame's id: a V4L2 node does not tell whether somebody reads, so the camera always runs, and a
//!   sequence has to look the same however long it did.
//! - The clock is no trait: a bench has a virtual clock, a server one timeline for all its devices,
//!   which has to know who waits for what before time may go on.
//! - Between the line and the firmware stands [`emulator::Machine`], which faults wrap: the firmware
//!   knows commands, whatever the dialect, and nothing of what goes wrong.
//! - The light source's matrix exponential is not computed by a general algorithm: the lifted
//!   system's is known in closed form, and as sums of positive terms it loses no digit at any step.
//! - A serial port of a Unix is opened by rustix and not by serialport, whose writes block in the
//!   kernel where a line takes nothing, and whose descriptor cannot be told otherwise without unsafe
//!   code. Elsewhere it is serialport's.
//! - Planning folders, volumes and iso-surfaces are both halves' to read. Generated patients,
//!   [`patient::phantom`], are truth, and the host's half never depends on them.
//! - Frames go to a V4L2 node no faster than they were exposed: a v4l2loopback reader that is more
//!   than two frames behind loses all but the newest.

pub use phasmid_calibrate as calibrate;
pub mod cli;
pub use phasmid_decode as decode;
#[cfg(target_os = "linux")]
pub mod doctor;
/// See [`phasmid_device`].
pub mod emulator {
    #[doc(no_inline)]
    pub use phasmid_device::*;
    pub use phasmid_render as render;
    pub use phasmid_render::led;
}
pub use phasmid_core::error;
pub use phasmid_geometry as geometry;
/// See [`phasmid_host`].
pub mod host {
    #[doc(no_inline)]
    pub use phasmid_host::*;
    pub use phasmid_sgrt as track;
}
#[cfg(target_os = "linux")]
pub use phasmid_device::link;
/// See [`phasmid_measure`].
pub mod measure {
    #[doc(no_inline)]
    pub use phasmid_measure::*;
    pub use phasmid_report::picture;
    pub use phasmid_report::plot;
}
/// See [`phasmid_planning`].
pub mod patient {
    pub use phasmid_phantom as phantom;
    #[doc(no_inline)]
    pub use phasmid_planning::*;
}
pub use phasmid_pattern as pattern;
/// See [`phasmid_profile`].
pub mod profile {
    #[doc(no_inline)]
    pub use phasmid_profile::*;
    pub use phasmid_protocol::faults;
}
pub use phasmid_protocol as protocol;
/// See [`phasmid_study`].
pub mod study {
    pub use phasmid_report::lab;
    #[doc(no_inline)]
    pub use phasmid_study::*;
}
pub use phasmid_core::error::{Error, Result};
#[cfg(target_os = "linux")]
pub use phasmid_v4l2 as v4l2;
