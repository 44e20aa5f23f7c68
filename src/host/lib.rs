//! How an application reaches a device, any device: camera, port, scanner.
//!
//! Addresses say where, never who: the host opens one and takes what is behind it as a device.
//! The system's monotonic clock is read here for two purposes only: to end waits in time, and to
//! tell frames that a camera took before it was triggered from those it took after.
//!
//! What an application of radiotherapy does with the scans is in `track`.

mod camera;
mod captured;
mod clock;
mod consistency;
mod control;
mod decoding;
mod instrument;
mod local;
mod patience;
mod pictures;
mod plug;
mod port;
mod record;
mod scanner;
mod tcp;

pub mod usb;

#[cfg(target_os = "linux")]
pub use camera::explain_device;
pub use camera::{Camera, Capture, Intake, MemoryCamera, SocketCamera, open_camera};
pub use captured::{CALIBRATION_FILE, Captured, MANIFEST_FILE, write_png};
pub use clock::monotonic_ns;
pub use consistency::{check as check_sequence, check_identified as check_identified_sequence};
pub use instrument::Instrument;
pub use pictures::{check_pictures, doubt_pictures, frame_of};
pub use port::{CommandPort, MemoryPort, SerialPort};
pub use record::{RecordedCamera, RecordedPort, Tape};
pub use scanner::{Progress, ScanOptions, Scanner, scan_free_running};
