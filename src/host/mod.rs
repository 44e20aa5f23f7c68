//! How an application reaches a device, any device: camera, port, scanner.
//!
//! Addresses say where, never who: the host opens one and takes what is behind it as a device.
//! The system's monotonic clock is read here for one purpose only, to end waits in time.

mod camera;
mod captured;
mod decoding;
mod instrument;
mod local;
mod port;
mod scanner;
pub mod usb;

pub use camera::{Camera, MemoryCamera, SocketCamera, open_camera};
pub use captured::{CALIBRATION_FILE, Captured, MANIFEST_FILE};
pub use instrument::Instrument;
pub use port::{CommandPort, MemoryPort, SerialPort};
pub use scanner::{Progress, ScanOptions, Scanner};
