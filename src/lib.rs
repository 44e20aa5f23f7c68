//! Phasma: a structured-light 3D scanner that is not there.
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
//! | layer  | module | holds |
//! | ------ | ------ | ----- |
//! | ground | [`geometry`] | poses, the lens model, rigs, solids, meshes and their files, ray casting |
//! | ground | [`pattern`] | what a projector shows; the sequence manifest |
//! | ground | [`patient`] | volumes, MetaImage, CT series of DICOM, the skin as an iso-surface, the planning folder and what is imported into one; generated patients: a breathing thorax with a tumour |
//! | ground | [`profile`] | devices, scenes, stations and schedules of faults as typed, checked structs; the built-in ones |
//! | ground | [`protocol`] | SCPI, dialects, the frame socket's header, the data line, USB and USB/IP, recordings, the service channel, `device.json` |
//! | ground | `v4l2` | nodes and queues of buffers of the kernel's camera interface (Linux only) |
//! | device | [`emulator`] | firmware, control port and line, faults, slides, light source, [rendering](emulator::render), ground truth |
//! | device | `link` | how a device reaches the world: pty, frame socket, V4L2 node, USB device, service socket, the time and the scene that several devices share, replay (Linux only) |
//! | host   | [`host`] | how an application reaches a device: camera, port (SCPI or a dialect), scanner |
//! | host   | [`host::track`] | a patient by the skin: six degrees of freedom, the tumour by a motion model, beam-hold |
//! | host   | [`decode`] | frames to projector coordinates to points |
//! | host   | [`calibrate`] | boards in pictures, solving for the rig or for where a known one stands, its files and report; triangulation |
//! | host   | [`measure`] | distances to the truth, overlap of solids, registration, pictures, plots |
//! | top    | [`study`], `doctor`, [`cli`] | what needs both halves; what a machine lacks (Linux only); the commands |
//!
//! The wall: host-side modules never import device-side ones, nor the reverse; `tests/wall.rs`
//! fails when one does. A decoder that could look behind it would prove nothing.
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
//! - Patients are ground: planning folders, volumes and iso-surfaces are both halves' to read. The
//!   generated ones, [`patient::phantom`], are truth, and the host's half never imports them.
//! - Frames go to a V4L2 node no faster than they were exposed: a v4l2loopback reader that is more
//!   than two frames behind loses all but the newest.

pub mod calibrate;
pub mod cli;
pub mod decode;
#[cfg(target_os = "linux")]
pub mod doctor;
pub mod emulator;
pub mod error;
mod file;
pub mod geometry;
pub mod host;
#[cfg(target_os = "linux")]
pub mod link;
pub mod measure;
mod new_file;
mod numbers;
pub mod patient;
pub mod pattern;
mod philox;
pub mod profile;
pub mod protocol;
mod simd;
pub mod study;
#[cfg(target_os = "linux")]
pub mod v4l2;

pub use error::{Error, Result};
