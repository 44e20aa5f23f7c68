//! Phasmid: a software structured-light 3D scanner.
//!
//! It renders what a real scanner's camera would see, delivers the frames as a camera does, accepts
//! projector and trigger commands on a serial port, and decodes the frames of any such device,
//! emulated or physical, into a measured surface.
//!
//! # Programs of ten lines
//!
//! A device in memory, scanned, decoded, and compared with its truth:
//!
//! ```
//! use phasmid::{DecodeOptions, Device};
//!
//! let mut device = Device::builder().profile("webcam-grey").scene("sphere").seed(1).build()?;
//! let capture = device.scan("quick-4")?;
//! let rig = device.factory_calibration()?;
//! let decoding = phasmid::decode(&capture, &rig, &DecodeOptions::default())?;
//! let score = phasmid::compare(&decoding, &device.truth()?, &device.rig())?;
//! println!("{} points, {:.3} mm RMS", score.points, score.inlier_rmse_mm);
//! # Ok::<(), phasmid::Error>(())
//! ```
//!
//! The same device behind a serial port and a camera, and any scanner by its addresses:
//!
//! ```
//! # #[cfg(target_os = "linux")]
//! # fn main() -> Result<(), phasmid::Error> {
//! use phasmid::{Device, ScanOptions, Scanner, ServeOptions};
//!
//! let device = Device::builder().profile("webcam-grey").scene("sphere").build()?;
//! let serving = device.serve(&ServeOptions::default())?;
//!
//! let at = serving.endpoints();
//! let mut scanner = Scanner::connect(&at.camera, &at.control, ScanOptions::default())?;
//! let capture = scanner.scan()?;
//! scanner.finish()?;
//! # assert_eq!(capture.images.len(), 13);
//! # Ok(())
//! # }
//! # #[cfg(not(target_os = "linux"))]
//! # fn main() {}
//! ```
//!
//! | call | does |
//! | --- | --- |
//! | [`Device`] | an emulated device in memory: scans, truth, moves, faults, links |
//! | [`Scanner`] | any scanner, by the addresses of its camera and control port |
//! | [`fn@decode`] | a capture to a surface with a standard deviation for each pixel |
//! | [`compare`] | a surface against the truth |
//! | [`fn@calibrate`] | captures of a board to a calibration |
//! | [`fn@track`] | scanners at known places in a treatment room to the position of a patient and a tumour, scan by scan |
//! | [`Console`], [`watch_camera`] | a page in the browser that shows served devices, or a camera, at work |
//!
//! The rest of this page is an overview of the crates.
//!
//! # Device side and host side
//!
//! ```text
//!  profile + scene                                                 sequence manifest
//!        |                                                                 |
//!   [ emulator ] --> [ link: socket, V4L2, USB ] --> [ host: camera ] --> [ decode ] --> cloud
//!        ^                                                   |               ^
//!        +---- [ link: pty, USB ] <------ [ host: port ] <---+          calibration
//! ```
//!
//! | side | crate | module | contents |
//! | ---- | ----- | ------ | -------- |
//! | shared | `core` | [`error`] | errors, checked values, TOML with line numbers, file input and output, random numbers, SIMD dispatch |
//! | shared | `shaders`, `device-profiles` | | embedded WGSL; embedded profiles, scenes, stations, dialects, patients |
//! | shared | `geometry` | [`geometry`] | poses, lens model, rigs, solids, meshes and their files, ray casting |
//! | shared | `pattern` | [`pattern`] | projected patterns; the sequence manifest |
//! | shared | `protocol` | [`protocol`] | SCPI, dialects, header of the frame socket, data line, USB and USB/IP, recordings, service channel, `device.json`, fault schedules |
//! | shared | `planning` | [`patient`] | volumes, MetaImage, DICOM CT series, the skin as an iso-surface, the planning folder and import of clinical data into one |
//! | shared | `console` | [`console`] | the page in the browser that shows a scanner working: its server, access and assets (feature `console`) |
//! | shared | `v4l2` | `v4l2` | device nodes and buffer queues of the kernel's camera interface (Linux only, feature `v4l2`) |
//! | device | `phantom` | [`patient::phantom`] | generated patients: a breathing thorax with a tumour |
//! | device | `profile` | [`profile`] | devices, scenes and stations as typed, checked structs, and the built-in ones |
//! | device | `render` | [`emulator::render`] | image formation on CPU and GPU (feature `gpu`), ground truth |
//! | device | `device` | [`emulator`], `link` | firmware, control port and serial line, faults; the links (Linux only): pty, frame socket, V4L2 node, USB device, service socket, time and scene shared by several devices, replay |
//! | host | `decode` | [`mod@decode`] | frames to projector coordinates to points |
//! | host | `calibrate` | [`mod@calibrate`] | board detection, calibration of a rig, pose of a calibrated rig, calibration files and report |
//! | host | `measure` | [`measure`] | distances to ground truth, overlap of solids, registration |
//! | host | `host` | [`host`] | an application's access to a device: camera, port (SCPI or a dialect), scanner |
//! | host | `sgrt` | [`host::track`] | patient tracking by the skin surface: six degrees of freedom, tumour position by a motion model, beam hold |
//! | shared | `report` | [`measure::plot`] | plots, images, the framework of the studies |
//! | both | `study` | [`study`] | code that needs both sides: scans scored against ground truth, the studies |
//! | both | this crate | `doctor`, [`cli`] | check of a machine's setup (Linux only); the commands |
//!
//! The crate `NAME` is the package `phasmid-NAME` in the folder `src/NAME` (`shaders` and
//! `device-profiles` are top-level folders); this crate re-exports them. A crate depends only on
//! crates listed before it in the members of `Cargo.toml`. Host-side crates never depend on
//! device-side crates, nor the reverse, not even in their tests; `.ci/crates` checks it. A decoder
//! with access to the renderer's data would prove nothing about a real scanner.
//!
//! # Features
//!
//! All are on by default.
//!
//! | feature | gives | needs |
//! | --- | --- | --- |
//! | `console` | a page in the browser that shows a scanner working: [`Console`], `serve --console` | |
//! | `gpu` | rendering on a GPU; without it, [`emulator::render::Backend::Gpu`] fails and `Auto` renders on the CPU | a Vulkan driver at run time |
//! | `v4l2` | cameras of the kernel (Linux): reading `/dev/videoN`, and `CameraNode` other than `None` | libclang to build |
//! | `schema` | JSON Schemas of profiles, scenes and other files | |
//!
//! USB devices and, on Unix, serial ports use no package that the rest does not use, so they have no
//! features.
//!
//! # Conventions
//!
//! Internal units are millimetres, seconds and radians; in files, the field's name contains the
//! unit. Device time is in integer nanoseconds. The camera's frame is OpenCV's (x right, y down, z
//! forward, pixel centres at integers), and the rig's frame is that of camera 0. A pose `a_from_b`
//! transforms coordinates from frame b to frame a. A fringe is
//! `A + B cos(2 pi x / period_px + phase_rad)`; see [`pattern`].
//!
//! The calls in the first table, and all types reached through them, take and return types of this
//! workspace and of std. Other modules also use vectors and matrices of glam, which [`geometry`]
//! re-exports.
//!
//! Only [`cli`] reads the wall clock or the environment. The links and the host side use the
//! monotonic clock, for pacing and timeouts. No crate uses a global random generator; the console's tokens come from the system.
//!
//! # Design decisions
//!
//! Rendering:
//!
//! - A footprint projected onto a pattern's axis is the convolution of two boxes (from the camera's
//!   column and row): a trapezoid. Second differences of a second prefix sum give the exact average
//!   of a pattern under a trapezoid, as first differences of a prefix sum do under a box.
//! - Rays are cast in packets of sixteen with a common origin, so shadow rays start at the
//!   projector's pupil and end at the surface. obvhs builds the hierarchy; the traversal is our own.
//! - An f32 hit has an error bound, and hits that the bounds cannot order are ordered in f64, also
//!   for shadows. No fixed margin has to suit all sizes of triangles and scenes.
//! - The samples of a pixel first decide whether the closed form of its footprint is valid; only if
//!   it is not, their mean is used. Depth of field widens the footprint by two boxes with the blur
//!   disc's moments, which adds no cost per frame.
//! - A moving mesh has its own hierarchy in its own frame, into which ray packets are transformed.
//!   Its exposure is the mean of frames at a few instants. Instants with the same scene state are
//!   merged, so a scene costs more only while something moves.
//! - Shaders are assembled from pieces named in their first lines instead of by a preprocessor, and
//!   buffers are bound by name. Ground truth is always computed on the CPU, because it needs f64.
//! - Ambient light, radiometry and the sensor use SI units and electrons, so that an exposure in a
//!   profile has the same meaning as on a real camera.
//! - The light source needs no general matrix exponential: that of its lifted system is known in
//!   closed form, and written as sums of positive terms it loses no digits at any step length.
//! - Noise is keyed by separate counts of triggered and free-running exposures, not by the frame id.
//!   A V4L2 node does not report whether anyone reads from it, so the camera always runs, and a
//!   sequence must look the same however long it ran before.
//!
//! Device and links:
//!
//! - The frames of every link contain the embedded data line, as a sensor outputs it, so the bytes
//!   are the same on all links. The host removes it wherever it finds one.
//! - Clocks do not share a trait. A bench has a virtual clock. A server has one timeline for all of
//!   its devices, which advances only when it knows what each device waits for.
//! - [`emulator::Machine`] is between the serial line and the firmware, and applies the faults. The
//!   firmware handles commands independently of the dialect and does not know about faults.
//! - Frames leave for a V4L2 node no closer together than they were exposed: a v4l2loopback reader
//!   that is more than two frames behind loses all but the newest.
//!
//! Files, ports and patients:
//!
//! - STL, OBJ, PLY, `.npy`, and OpenCV's YAML and XML are read and written by our own code: existing
//!   crates lose the line of an error, f64 vertices, or bounds on memory.
//! - DICOM CT images are read by our own code: the DICOM crate allocates whatever length a file
//!   declares and recurses as deep as its sequences are nested.
//! - The descriptor of a serial port of `serialport` is made non-blocking: its writes block in the
//!   kernel if the line accepts no data.
//! - Planning folders, volumes and iso-surfaces are available to both sides. Generated patients,
//!   [`patient::phantom`], are ground truth, and host-side crates never depend on them.

mod facade;

pub use facade::{
    Decoding, Device, DeviceBuilder, Pod, ProfileSource, ScanOptions, Scanner, SceneSource,
    SkinPose, TrackOptions, TrackProgress, Tracked, Tracker, TumourPosition, calibrate,
    calibrate_with_stop, compare, decode, track, watch_camera,
};
#[cfg(feature = "console")]
pub use facade::{Follower, Playback, RoomViews, ScanViews, operate};
#[cfg(feature = "console")]
pub use phasmid_console::{Console, ConsoleOptions};
pub use phasmid_decode::{Capture, Decoder, FrameInfo, Options as DecodeOptions};
#[cfg(target_os = "linux")]
pub use phasmid_device::link::{
    CameraNode, Notice, RecordingFile, ServeOptions, Serving, UsbServing,
};
pub use phasmid_pattern::Image;
pub use phasmid_render::truth::Truth;

pub use phasmid_calibrate as calibrate;
pub mod cli;
/// A page in the browser that shows a scanner working.
///
/// ```
/// # #[cfg(target_os = "linux")] {
/// use phasmid::{Console, ConsoleOptions, Device, Follower, ServeOptions};
///
/// let console = Console::start(&ConsoleOptions::default())?;
/// let follower = Follower::start(console.source("bench"))?;
/// let options = ServeOptions {
///     observer: Some(follower.observer()),
///     ..ServeOptions::default()
/// };
/// let device = Device::builder().profile("webcam-grey").scene("sphere").build()?;
/// let serving = device.serve(&options)?;
/// follower.ask_at(&serving.endpoints().service);
/// println!("open {} while a program scans with {}", console.url(), serving.endpoints().name);
/// # }
/// # Ok::<(), phasmid::Error>(())
/// ```
#[cfg(feature = "console")]
pub mod console {
    pub use phasmid_console::*;
}
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
    pub use phasmid_report::map_image;
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
pub use phasmid_sgrt as track;
/// See [`phasmid_study`].
pub mod study {
    pub use phasmid_report::lab;
    #[doc(no_inline)]
    pub use phasmid_study::*;
}
pub use phasmid_core::Stop;
pub use phasmid_core::error::{Error, Result};
#[cfg(all(target_os = "linux", feature = "v4l2"))]
pub use phasmid_v4l2 as v4l2;
